//! What the instructor decides in `matches.toml` and by `umbra set`.

use std::fs;

use similar_asserts::assert_eq;

use super::{LATE, LIST, Place, config, rows, submission, text};

#[test]
fn what_the_instructor_decides_survives_and_is_flagged_when_the_evidence_changes() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let own = |name: &str, id: u32| format!("class/{id}-9 - {name} - Oct 6, 2019 1000 PM/a2.zip");
    place.put(&own("Bo Ode", 1), &submission(&config("Bo", "Ode", "260000002")));
    place.put(&own("Ann Lee", 2), &submission(&config("Ann", "Lee", "0260000003")));
    let (_, report) = place.grade(&root, &["class"]);
    assert_eq!(report["submissions"][0]["points"], 0.0);
    let run = |arguments: &[&str]| {
        let mut all = arguments.to_vec();
        if arguments[0] != "status" {
            all.extend(["--root", root.to_str().unwrap()]);
        }
        let (code, said, errors) = place.run(&[&all[..], &["--output", "out"]].concat());
        (code, said + &errors)
    };
    let (code, said) = run(&["status"]);
    assert_eq!((code, said.as_str()), (Some(0), "nothing waits for a decision\n"));

    let reason = ["--reason", "compiler of another year", "--by", "Eve"];
    let set = |student: &str, part: &str, points: &str| {
        run(&[&["override", student, part, points][..], &reason].concat())
    };
    let (code, said) = set("260000002", "1.3", "15");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("part 1.3 now has 15 points; the evidence gives 0"), "{said}");
    let (code, said) = run(&[&["confirm", "lee, ANN"][..], &reason].concat());
    assert_eq!(code, Some(0), "{said}");
    for (student, part, points, expected) in [
        ("260000009", "1.3", "1", "nobody in out is \"260000009\""),
        ("260000002", "9.9", "1", "there is no part 9.9; expected one of 1.1, 1.2"),
        ("260000002", "1.3", "21", "part 1.3 is worth 0 to 20 points, found 21"),
    ] {
        let (code, said) = set(student, part, points);
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(expected), "{said}");
    }
    let words = "part 1.3 was set by the instructor to 15 points instead of 0: compiler of another year (Eve, 2";
    let check = |arguments: &[&str], stale: usize| {
        let (said, report) = place.grade(&root, arguments);
        let rows = rows(&report);
        let bo = rows.iter().position(|(name, ..)| name.contains("Bo Ode")).unwrap();
        assert_eq!(report["submissions"][bo]["points"], 15.0, "{said}");
        assert!(rows[bo].2.contains(words), "{}", rows[bo].2);
        assert!(rows[1 - bo].2.contains("the instructor looked at it"), "{}", rows[1 - bo].2);
        let page =
            place.at("out").join(text(&report["submissions"][bo]["slug"])).join("report.html");
        assert!(fs::read_to_string(page).unwrap().contains(words));
        assert_eq!(report["class"]["stale"].as_array().unwrap().len(), stale, "{said}");
        let (code, said) = run(&["status"]);
        assert_eq!(code, Some(i32::from(stale > 0)), "{said}");
        assert_eq!(said.contains("decisions whose evidence has changed"), stale > 0, "{said}");
    };
    check(&["class"], 0);
    check(&["class", "--force"], 0);
    // Another submission in its place.
    let changed = config("Bo", "Ode", "260000002").replace("[]", "[ ]");
    place.put(&own("Bo Ode", 1), &submission(&changed));
    check(&["class"], 1);
    // A slip in the file has a line.
    let file = place.at("out/overrides.toml");
    let kept = fs::read_to_string(&file).unwrap();
    fs::write(&file, kept.replace("points = 15.0", "points = -1.0")).unwrap();
    let (code, said) = set("260000002", "1.3", "10");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("overrides.toml:4: expected points of 0 or more"), "{said}");
}

#[test]
fn decisions_at_the_same_time_are_all_kept() {
    let place = Place::new();
    let root = place.assignment(LATE);
    place.put("class/a2_bo.zip", &submission(&config("Bo", "Ode", "260000002")));
    place.grade(&root, &["class"]);
    let parts = ["1.1", "1.2", "1.3", "1.4"];
    std::thread::scope(|scope| {
        let place = &place;
        let decide = |part| {
            let own = ["override", "260000002", part, "1", "--reason", part, "--output", "out"];
            scope.spawn(move || place.run(&own))
        };
        for one in parts.map(decide) {
            let (code, said, errors) = one.join().unwrap();
            assert_eq!(code, Some(0), "{said}{errors}");
        }
    });
    let kept = fs::read_to_string(place.at("out/overrides.toml")).unwrap();
    for part in parts {
        assert_eq!(kept.matches(&format!("reason = \"{part}\"")).count(), 1, "{kept}");
    }
    let (_, report) = place.grade(&root, &["class"]);
    assert_eq!(report["submissions"][0]["points"], 4.0);
}

#[test]
fn a_grade_waits_where_another_submission_may_be_the_students() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let of = |id: u32| format!("class/{id}-5150 - Ann Lee - Oct 6, 2019 1000 PM/a2.zip");
    place.put(&of(1), &submission(&config("Ann", "Lee", "0260000003")));
    // One of two who are called so.
    place.put(&of(2), &submission(&config("Ann", "Lee", "")));
    place.put("list.csv", LIST.as_bytes());
    place.grade(&root, &["class", "--class", "list.csv"]);
    let export = ["export", "book.csv", "--format", "brightspace", "--output", "out"];
    let (code, said, errors) = place.run(&export);
    assert_eq!(code, Some(2), "{said}{errors}");
    assert!(errors.contains("another submission may be theirs"), "{errors}");
    let decided = format!(
        "[[match]]\nsubmission = \"{}\"\nstudent = \"260000004\"\n",
        of(2).trim_start_matches("class/")
    );
    place.put("out/matches.toml", decided.as_bytes());
    // It is a student's who had none.
    let regrade = ["regrade", "--output", "out", "--root", root.to_str().unwrap()];
    let (code, said, errors) = place.run(&regrade);
    assert_eq!(code, Some(0), "{said}{errors}");
    assert!(said.contains("0 fall, 1 stay, 1 more now count"), "{said}");
    place.grade(&root, &["class"]);
    let (code, said, errors) = place.run(&export);
    assert_eq!(code, Some(0), "{said}{errors}");
    assert!(said.contains("book.csv: 2 grades for Brightspace"), "{said}");
}
