//! Several attempts of a student: which one a number or a name means, where it lies, and what tells which counts.

#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};
use similar_asserts::assert_eq;

use crate::downloads::{LATE, Place, config, rows, submission, text, zip};
use crate::support::one_scene;

const LIST: &str = "OrgDefinedId,Last Name,First Name\n#260000104,Lee,Ann\n#260000106,Ode,Bo\n";

fn umbra(place: &Place, root: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let fixed = ["--report", "out", "--root", root.to_str().unwrap()];
    let without_root = ["status", "export"].contains(&arguments[0]);
    let fixed = if without_root { &fixed[..2] } else { &fixed[..] };
    let (code, said, errors) = place.run(&[arguments, fixed].concat());
    (code, said + &errors)
}

fn download(files: &[(&str, &str)]) -> Vec<u8> {
    let own = |(name, config): &(&str, &str)| ((*name).to_owned(), submission(config));
    let files: Vec<(String, Vec<u8>)> = files.iter().map(own).collect();
    zip(&files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect::<Vec<_>>())
}

fn report(place: &Place) -> Value {
    serde_json::from_slice(&fs::read(place.at("out/report.json")).unwrap()).unwrap()
}

const FIRST: &str = "1-9 - Ann Lee - Oct 5, 2019 1000 PM/a2.zip";
const SECOND: &str = "1-9 - Ann Lee - Oct 6, 2019 1000 PM/a2.zip";
const FIRST_SLUG: &str = "1-9---Ann-Lee---Oct-5--2019-1000-PM-a2";
const SECOND_SLUG: &str = "1-9---Ann-Lee---Oct-6--2019-1000-PM-a2";

/// Ann submitted twice, between two downloads.
fn twice(edit: impl Fn(&mut Value)) -> (Place, PathBuf) {
    let place = Place::new();
    let root = one_scene(&place.at("assignment"), |config| {
        config["late"] = serde_json::from_str(LATE).unwrap();
        edit(config);
    });
    let ann = config("Ann", "Lee", "260000104");
    let bo = ("2-9 - Bo Ode - Oct 8, 2019 1200 AM/a2.zip", &*config("Bo", "Ode", "260000106"));
    place.put("mon.zip", &download(&[(FIRST, &ann), bo]));
    let newer = config("Ann", "Lee", " 260000104");
    place.put("A2 Download.zip", &download(&[(FIRST, &ann), (SECOND, &newer), bo]));
    place.put("list.csv", LIST.as_bytes());
    place.grade(&root, &["mon.zip", "--class", "list.csv"]);
    place.grade(&root, &["A2 Download.zip"]);
    (place, root)
}

#[test]
fn a_number_or_name_means_the_attempt_that_counts() {
    let (place, root) = twice(|_| ());
    for (word, points) in [("260000104", "3"), ("Lee, Ann", "4"), (SECOND_SLUG, "5")] {
        let set = ["override", word, "1.4", points, "--reason", "x"];
        let (code, said) = umbra(&place, &root, &set);
        assert_eq!(code, Some(0), "{word}: {said}");
        assert!(
            said.contains(&format!("({SECOND_SLUG}): part 1.4 now has {points} points")),
            "{said}"
        );
        assert!(said.contains("the reports show it"), "{said}");
        assert_eq!(report(&place)["submissions"][0]["points"].to_string(), format!("{points}.0"));
    }
    let (code, said) = umbra(&place, &root, &["confirm", "260000104", "--reason", "seen"]);
    assert_eq!(code, Some(0), "{said}");
    // By its folder the other one, which shows nowhere.
    let (code, said) =
        umbra(&place, &root, &["override", FIRST_SLUG, "1.4", "15", "--reason", "x"]);
    assert_eq!(code, Some(0), "{said}");
    let expected = format!(
        "no report shows it: the submission {FIRST_SLUG} does not count, {SECOND_SLUG} does"
    );
    assert!(said.contains(&expected), "{said}");
    assert_eq!(report(&place)["submissions"][0]["points"], 5.0);
    // One that counts for less is named.
    let (_, said) = umbra(&place, &root, &["status"]);
    assert!(said.contains("counting attempts that earn less than another attempt: 1"), "{said}");
    assert!(said.contains(&format!("{SECOND}: 5 points, {FIRST} would have 15")), "{said}");
    let (code, said) = umbra(&place, &root, &["defend", FIRST_SLUG, "1.4"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains(&format!("does not count, {SECOND_SLUG} does")), "{said}");
    let export = ["export", "one.json", "--format", "gradescope", "--only", "260000104"];
    let (code, said) = umbra(&place, &root, &export);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("one.json: 1 submission"), "{said}");
    assert!(fs::read_to_string(place.at("one.json")).unwrap().contains("\"score\": 5.0"));
    // Its old page says so, and the instructor's leads to the other.
    let page = |name: &str| fs::read_to_string(place.at(name)).unwrap();
    let old = page(&format!("out/{FIRST_SLUG}/report.html"));
    assert!(old.contains(&format!("does not count: {SECOND_SLUG} does.")), "{old}");
    assert!(!page(&format!("out/{SECOND_SLUG}/report.html")).contains("does not count:"));
    // Which attempt counts is the whole class's.
    let only = ["A2 Download.zip", "--only", "Bo Ode", "--attempt", "first"];
    let (code, said) = umbra(
        &place,
        &root,
        &[&["grade", "--held-back", "off", "--isolation", "reduced"], &only[..]].concat(),
    );
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("--attempt: it is the whole class's"), "{said}");
    assert_eq!(report(&place)["submissions"][0]["points"], 5.0);
    // Its other attempt instead is one student's fall or rise.
    let (said, _) = place.grade(&root, &["A2 Download.zip", "--attempt", "first"]);
    assert!(said.contains(&format!("{FIRST}, not {SECOND}")), "{said}");
    assert!(said.contains("--attempt first instead of latest, for the whole class"), "{said}");
    let (code, said) = umbra(&place, &root, &["regrade", "--undo"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("0 rise, 1 fall, 1 stay"), "{said}");
    assert!(!said.contains("counts"), "{said}");
    assert!(page(&format!("out/{FIRST_SLUG}/report.html")).contains("does not count:"));
}

const THIRD: &str = "1-9 - Ann Lee - Oct 6, 2019 1030 PM/a2.zip";
const THIRD_SLUG: &str = "1-9---Ann-Lee---Oct-6--2019-1030-PM-a2";

#[test]
fn a_decision_on_a_student_is_on_each_of_their_attempts() {
    let (place, root) = twice(|_| ());
    let set = |word: &str, points: &str| {
        let (code, said) =
            umbra(&place, &root, &["override", word, "1.4", points, "--reason", "x"]);
        assert_eq!(code, Some(0), "{said}");
        said
    };
    let ann = || {
        let row = &report(&place)["submissions"][0];
        (text(&row["slug"]).to_owned(), row["points"].as_f64().unwrap())
    };
    // Of two attempts; the last decision counts for a third one, too.
    set("Ann Lee", "7");
    set("260000104", "5");
    let kept = fs::read_to_string(place.at("out/overrides.toml")).unwrap();
    assert_eq!(kept.matches("student = \"260000104\"").count(), 2, "{kept}");
    let files = [(FIRST, ""), (SECOND, " "), (THIRD, "  ")];
    let configs =
        files.map(|(name, space)| (name, config("Ann", "Lee", &format!("{space}260000104"))));
    let files = configs.each_ref().map(|(name, config)| (*name, config.as_str()));
    place.put("wed.zip", &download(&files));
    place.grade(&root, &["wed.zip"]);
    assert_eq!(ann(), (THIRD_SLUG.to_owned(), 5.0));
    // An export says that it was made on another one.
    let (code, said) = umbra(&place, &root, &["export", "book.csv", "--format", "brightspace"]);
    assert_eq!(code, Some(0), "{said}");
    let expected = format!(
        "warning: 1 decision whose evidence has changed since:\n  {THIRD}: part 1.4 was set"
    );
    assert!(said.contains(&expected), "{said}");
    // A report without held-back scenes stays so.
    let (code, said) = umbra(&place, &root, &["grade", "wed.zip", "--isolation", "reduced"]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(report(&place)["held_back"], Value::Null);
    assert_eq!(report(&place)["class"]["incomparable"], json!([]));
    // What lowers the best attempt is not without effect, as the other one is worth as little.
    place.grade(&root, &["wed.zip", "--attempt", "best"]);
    let said = set("260000104", "2");
    assert!(said.contains("the reports show it"), "{said}");
    assert_eq!(ann().1, 2.0);
    // By its folder it is on one attempt, and another may count by then.
    let said = set(THIRD_SLUG, "3");
    assert!(said.contains("the reports show it"), "{said}");
    assert_eq!(ann(), (THIRD_SLUG.to_owned(), 3.0));
    let said = set(THIRD_SLUG, "0");
    assert_eq!((ann().0 != THIRD_SLUG, ann().1), (true, 2.0));
    let expected =
        format!("no report shows it: the submission {THIRD_SLUG} does not count, {} does", ann().0);
    assert!(said.contains(&expected), "{said}");
}

#[test]
fn what_lies_in_a_download_is_found_and_mended() {
    let (place, root) = twice(|config| {
        config["mend"] = json!({"lines": 2, "penalty": 5});
        config["late"]["of"] = json!("earned");
    });
    let (code, said) = umbra(&place, &root, &["defend", "260000104", "1.4"]);
    assert_eq!(code, Some(0), "{said}");
    // The command that it prints works.
    let line = said.lines().find_map(|line| line.split_once("on all:  umbra "));
    let (_, line) = line.unwrap();
    assert!(line.contains("A2 Download.zip' --only ") && line.contains("--root "), "{line}");
    let command = format!("'{}' {line} --isolation reduced", env!("CARGO_BIN_EXE_umbra"));
    let ran =
        Command::new("sh").args(["-c", &command]).current_dir(place.at(".")).output().unwrap();
    assert_eq!(ran.status.code(), Some(0), "{command}: {}", String::from_utf8_lossy(&ran.stderr));
    let again = fs::read(place.at("ANOTHER/report.json")).unwrap();
    let again: Value = serde_json::from_slice(&again).unwrap();
    assert_eq!(again["submissions"][0]["slug"], SECOND_SLUG);

    let patch = "--- a/src/lib.rs\n+++ b/src/lib.rs\n@@ -1 +1 @@\n\
                 -fn main() { not_rust }\n\\ No newline at end of file\n\
                 +fn main() { nor_this }\n\\ No newline at end of file\n";
    place.put("fix.patch", patch.as_bytes());
    let mend = ["mend", "260000104", "fix.patch", "--reason", "x", "--isolation", "reduced"];
    let (code, said) = umbra(&place, &root, &mend);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains(&format!("({SECOND_SLUG}): mended by the instructor, 1 line")), "{said}");
    let mended = format!("out/instructor/{SECOND_SLUG}/mended");
    assert!(place.at(&mended).join("report.html").is_file());

    // Bo is late by two days, of ten per cent of what was earned: of nothing that is nothing.
    let bo = || {
        let report = report(&place);
        let own = report["submissions"].as_array().unwrap().iter();
        own.clone().find(|row| text(&row["name"]).contains("Bo Ode")).unwrap().clone()
    };
    let late = text(&bo()["standing"]["late"]["words"]).to_owned();
    assert!(late.ends_with("it earned nothing, so that costs nothing"), "{late}");
    let (code, said) = umbra(&place, &root, &["override", "Bo Ode", "1.3", "10", "--reason", "x"]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(bo()["points"], 8.0);
    let (code, said) = umbra(&place, &root, &["defend", "Bo Ode", "1.4"]);
    assert_eq!(code, Some(0), "{said}");
    // 10 by hand and 15, less 5, less twice a tenth of that.
    assert!(said.contains("would give 16.00 points instead of 8.00"), "{said}");
    // What is set by hand stays so.
    let (_, said) = umbra(&place, &root, &["defend", "Bo Ode", "1.3"]);
    assert!(said.contains("would give 8.00 points instead of 8.00"), "{said}");
    // Gone.
    fs::remove_file(place.at("A2 Download.zip")).unwrap();
    let (code, said) = umbra(&place, &root, &mend);
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("is not there any more") && said.contains("hint: --submission PATH"),
        "{said}"
    );
}

#[test]
fn canvas_numbers_its_uploads() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let (one, two) = (config("Zoe", "Oz", "260000107"), config("Zoe", "Oz", "260000107 "));
    let three = config("Zoe", "Oz", " 260000107");
    place.put("mon.zip", &download(&[("ozzoe_107_9001_a2.zip", &one)]));
    place.put("tue.zip", &download(&[("ozzoe_107_9051_a2-1.zip", &two)]));
    place.put("wed.zip", &download(&[("ozzoe_107_9057_final.zip", &two)]));
    place.put("thu.zip", &download(&[("ozzoe_107_9061_other.zip", &three)]));
    place.grade(&root, &["mon.zip"]);
    let counts = |report: &Value| -> Vec<String> {
        rows(report).into_iter().map(|(name, ..)| name).collect()
    };
    let (said, report) = place.grade(&root, &["tue.zip"]);
    assert_eq!(counts(&report), ["ozzoe_107_9051_a2-1.zip"], "{said}");
    assert_eq!(report["class"]["undecided"], json!([]), "{said}");
    let (_, report) = place.grade(&root, &["tue.zip", "--attempt", "first"]);
    assert_eq!(counts(&report), ["ozzoe_107_9001_a2.zip"]);
    // The same content under another number: the newer one, which the platform takes feedback on.
    fs::remove_dir_all(place.at("out")).unwrap();
    place.grade(&root, &["tue.zip"]);
    let (said, report) = place.grade(&root, &["wed.zip"]);
    assert_eq!(counts(&report), ["ozzoe_107_9057_final.zip"], "{said}");
    // Two files of other names may be one attempt's.
    let (said, report) = place.grade(&root, &["thu.zip"]);
    assert_eq!(report["class"]["undecided"].as_array().unwrap().len(), 3, "{said}");
}

#[test]
fn a_file_that_was_renamed_is_the_same_submission() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let ann = submission(&config("Ann", "Lee", "260000104"));
    place.put("in/a2_ann.zip", &ann);
    place.grade(&root, &["in"]);
    fs::rename(place.at("in/a2_ann.zip"), place.at("in/lee.zip")).unwrap();
    place.put("in/a2_bo.zip", &submission(&config("Bo", "Ode", "260000106")));
    let (said, report) = place.grade(&root, &["in"]);
    assert!(said.contains("lee.zip is a2_ann.zip under another name"), "{said}");
    assert!(said.contains("1 of 2 submissions keep their earlier grades"), "{said}");
    let names: Vec<String> = rows(&report).into_iter().map(|(name, ..)| name).collect();
    assert_eq!(names, ["lee.zip", "a2_bo.zip"], "{said}");
    // Both are there: two of one content, of which one counts.
    place.put("in/copy.zip", &ann);
    let (said, report) = place.grade(&root, &["in"]);
    assert!(said.contains("lee.zip, not copy.zip"), "{said}");
    assert_eq!(rows(&report).len(), 2, "{said}");
}

#[test]
fn each_download_of_several_is_of_its_own_platform() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let own = |first: &str, number: &str| config(first, "Lee", number);
    place.put(
        "b.zip",
        &download(&[("1-9 - Ann Lee - Oct 7, 2019 1000 PM/a2.zip", &own("Ann", "260000104"))]),
    );
    place.put("c.zip", &download(&[("leebo_106_9001_a2.zip", &own("Bo", "260000106"))]));
    place.put("mail/a2_cy.zip", &submission(&own("Cy", "260000107")));
    place.put("mail/a2_di.zip", &submission(&own("Di", "260000108")));
    let (said, report) = place.grade(&root, &["b.zip", "c.zip", "mail"]);
    assert!(said.contains("recognized as downloads of Brightspace and Canvas"), "{said}");
    let late = report["submissions"].as_array().unwrap().iter();
    let late: Vec<(&str, &Value)> =
        late.map(|row| (text(&row["name"]), &row["standing"]["late"]["charged"])).collect();
    let of = |name: &str| late.iter().find(|own| own.0.contains(name)).unwrap().1.clone();
    assert_eq!(of("Ann Lee"), 1, "{said}");
    assert_eq!(of("leebo"), Value::Null);
    assert_eq!(report["class"]["undecided"], json!([]), "{said}");
}
