//! What grades are settled by: pinned, changed on purpose, kept, and taken back; from what a report keeps alone.

#![cfg(unix)]

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use similar_asserts::assert_eq;

use crate::downloads::{LATE, Place, config, submission, text};

/// A class of two, one of them late by a day, graded; and the assignment.
fn graded() -> (Place, std::path::PathBuf) {
    let place = Place::new();
    let root = place.assignment(LATE);
    let own = |name: &str, id: u32, day: u32| {
        format!("class/{id}-9 - {name} - Oct {day}, 2019 1000 PM/a2.zip")
    };
    place.put(&own("Bo Ode", 1, 7), &submission(&config("Bo", "Ode", "260000002")));
    place.put(&own("Ann Lee", 2, 6), &submission(&config("Ann", "Lee", "0260000003")));
    place.grade(&root, &["class"]);
    (place, root)
}

/// Of each student: name in the submission, points, and the most that they may be.
fn points(place: &Place) -> Vec<(String, f64, f64)> {
    let report: Value =
        serde_json::from_slice(&fs::read(place.at("out/report.json")).unwrap()).unwrap();
    let rows = report["submissions"].as_array().unwrap().iter();
    let row = |row: &Value| {
        let name = text(&row["student"]["first_name"]).to_owned();
        (name, row["points"].as_f64().unwrap(), row["points_max"].as_f64().unwrap())
    };
    let mut rows: Vec<_> = rows.map(row).collect();
    rows.sort_by(|a, b| a.0.cmp(&b.0));
    rows
}

fn of(name: &str, points: f64) -> (String, f64, f64) {
    (name.to_owned(), points, points)
}

fn edit(root: &Path, change: impl Fn(&mut Value)) {
    let file = root.join("config.json");
    let mut config: Value = serde_json::from_slice(&fs::read(&file).unwrap()).unwrap();
    change(&mut config);
    fs::write(file, config.to_string()).unwrap();
}

fn umbra(place: &Place, root: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let fixed = ["--output", "out", "--root", root.to_str().unwrap()];
    let (code, said, errors) = place.run(&[arguments, &fixed].concat());
    (code, said + &errors)
}

#[test]
fn a_changed_policy_waits_until_it_is_applied_and_every_change_can_be_undone() {
    let (place, root) = graded();
    let regrade = |arguments: &[&str]| umbra(&place, &root, &[&["regrade"], arguments].concat());
    let (code, said) = regrade(&[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("settled by change 1 of 2") && said.contains("nothing changes"),
        "{said}"
    );

    // A decision shows at once, after what lateness costs.
    let set = ["override", "260000002", "1.3", "15", "--reason", "old compiler", "--by", "Eve"];
    let (code, said) = umbra(&place, &root, &set);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(points(&place), [of("Ann", 0.0), of("Bo", 5.0)]);
    let page = "out/1-9---Bo-Ode---Oct-7--2019-1000-PM-a2/report.html";
    assert!(fs::read_to_string(place.at(page)).unwrap().contains("old compiler"));

    // Another policy: shown, and nothing is written.
    edit(&root, |config| config["late"]["penalty"] = json!(5));
    let before = fs::read(place.at("out/report.json")).unwrap();
    let (code, said) = regrade(&[]);
    assert_eq!(code, Some(0), "{said}");
    for line in [
        "what differs: late of config.json\n",
        "2 submissions: 1 rise, 0 fall, 1 stay\n",
        "nothing is written; --apply --reason TEXT does\n",
    ] {
        assert!(said.contains(line), "{said}");
    }
    let row = said.lines().find(|line| line.contains("Bo Ode")).unwrap();
    let cells: Vec<&str> = row.split_whitespace().collect();
    assert_eq!(cells[cells.len() - 3..], ["total", "5", "10"], "{said}");
    assert!(!said.contains("Ann"), "{said}");
    assert_eq!(fs::read(place.at("out/report.json")).unwrap(), before);

    // Who comes now is settled as the others are.
    let cy = "class/3-9 - Cy Poe - Oct 7, 2019 900 PM/a2.zip";
    place.put(cy, &submission(&config("Cy", "Poe", "260000005")));
    let (said, report) = place.grade(&root, &["class"]);
    assert!(said.contains("config.json has other late than this report"), "{said}");
    let command = format!("`umbra regrade --report out --root {}` shows", root.display());
    assert!(said.contains(&command), "{said}");
    assert_eq!(points(&place), [of("Ann", 0.0), of("Bo", 5.0), of("Cy", 0.0)]);
    assert!(!report["submissions"].to_string().contains(" 5 % of the maximum"));

    // Nothing but the report is needed.
    fs::remove_dir_all(place.at("class")).unwrap();
    assert_eq!(regrade(&["--apply"]).0, Some(2));
    let (code, said) = regrade(&["--apply", "--reason", "the senate said so"]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(points(&place), [of("Ann", 0.0), of("Bo", 10.0), of("Cy", 0.0)]);
    let pin = fs::read(place.at("out/instructor/settled/0003.json")).unwrap();
    let pin: Value = serde_json::from_slice(&pin).unwrap();
    assert_eq!((text(&pin["reason"]), &pin["before"]), ("the senate said so", &json!(2)));
    assert_eq!(pin["changes"][0]["before"], json!([5.0, 5.0]));
    assert_eq!(pin["changes"][0]["after"], json!([10.0, 10.0]));

    // The time that the instructor knows, and a decision deleted by hand.
    let in_time = "[[match]]\nsubmission = \"1-9 - Bo Ode - Oct 7, 2019 1000 PM/a2.zip\"\n\
                   submitted = \"2019-10-06T22:00:00-04:00\"\n";
    place.put("out/matches.toml", in_time.as_bytes());
    let (_, said) = regrade(&[]);
    assert!(said.contains("what differs: matches.toml\n"), "{said}");
    assert_eq!(points(&place)[1], of("Bo", 10.0));
    let (code, said) = regrade(&["--apply", "--reason", "by mail"]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(points(&place)[1], of("Bo", 15.0));
    place.put("out/overrides.toml", b"");
    let (code, said) = regrade(&["--apply", "--reason", "withdrawn"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("what differs: overrides.toml\n"), "{said}");
    assert_eq!(points(&place)[1], of("Bo", 0.0));

    // What a file says by now and nobody applied is not lost.
    place.put(
        "out/overrides.toml",
        b"[[override]]\nstudent = \"260000002\"\npart = \"1.1\"\npoints = 1\nreason = \"r\"\n",
    );
    let (code, said) = regrade(&["--undo"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("out: --undo would lose what overrides.toml says by now"), "{said}");
    place.put("out/overrides.toml", b"");

    // Back, change by change, with the files of decisions.
    for (bo, matches, overrides) in
        [(15.0, true, true), (10.0, false, true), (5.0, false, true), (0.0, false, false)]
    {
        let (code, said) = regrade(&["--undo"]);
        assert_eq!(code, Some(0), "{said}");
        assert_eq!(points(&place)[1], of("Bo", bo), "{said}");
        let holds = |name: &str| !fs::read(place.at(name)).unwrap().is_empty();
        assert_eq!((holds("out/matches.toml"), holds("out/overrides.toml")), (matches, overrides));
    }
    let (code, said) = regrade(&["--undo"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("there is nothing to undo"), "{said}");
    assert!(place.at("out/instructor/settled/0009.json").exists());
    assert!(!place.at("out/instructor/settled/0010.json").exists());
}

#[test]
fn changed_rules_regrade_by_the_evidence_that_is_kept() {
    let (place, root) = graded();
    // As if it were built: what was not asked is a range.
    let record = place.at("out/instructor/2-9---Ann-Lee---Oct-6--2019-1000-PM-a2/record.json");
    let kept = fs::read_to_string(&record).unwrap();
    let mut value: Value = serde_json::from_str(&kept).unwrap();
    for check in value["record"]["evidence"]["checks"].as_array_mut().unwrap() {
        if check["id"] == "submission.build" {
            check["verdict"] = json!("pass");
        }
    }
    fs::write(&record, value.to_string()).unwrap();
    let regrade = |arguments: &[&str]| umbra(&place, &root, &[&["regrade"], arguments].concat());
    regrade(&["--apply", "--reason", "reports from records"]);
    let (_, least, most) = points(&place)[0].clone();
    assert!(least < most, "{least} {most}");
    edit(&root, |config| {
        let part = &mut config["rules"]["parts"][0];
        part["points"] = json!(part["points"].as_f64().unwrap() + 2.0);
    });
    let (code, said) = regrade(&[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("what differs: rules of config.json\n"), "{said}");
    assert!(said.contains("2 submissions: 1 rise, 0 fall, 1 stay"), "{said}");
    let (code, said) = regrade(&["--apply", "--reason", "a better rule"]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(points(&place)[0], ("Ann".to_owned(), least, most + 2.0));

    // A report of another assignment, and a folder that is none.
    edit(&root, |config| config["name"] = json!("a3"));
    let (code, said) = regrade(&[]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("is a report of assignment \"a2\", not \"a3\""), "{said}");
    fs::remove_dir_all(place.at("out")).unwrap();
    let (code, said) = regrade(&[]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("expected the --report of an earlier `umbra grade`"), "{said}");
}
