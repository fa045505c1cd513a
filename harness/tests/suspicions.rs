//! What is for the instructor alone to look at, until they have: on pages, in lists and in exports.

#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::json;
use similar_asserts::assert_eq;

use crate::downloads::{LATE, Place, config, submission, text, zip};

fn umbra(place: &Place, root: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let fixed = ["--report", "out", "--root", root.to_str().unwrap()];
    let without_root = ["status", "export"].contains(&arguments[0]);
    let fixed = if without_root { &fixed[..2] } else { &fixed[..] };
    let (code, said, errors) = place.run(&[arguments, fixed].concat());
    (code, said + &errors)
}

fn read(place: &Place, name: &str) -> String {
    fs::read_to_string(place.at(name)).unwrap()
}

const LIST: &str = "OrgDefinedId,Last Name,First Name,End-of-Line Indicator\n\
                    #260000104,Lee,Ann,#\n#260000106,Malone,Mallory,#\n";

/// Ann, and Mallory who typed Ann's number.
fn one_number() -> (Place, PathBuf) {
    let place = Place::new();
    let root = place.assignment(LATE);
    place.put("in/a2_ann.zip", &submission(&config("Ann", "Lee", "260000104")));
    place.put("in/a2_mal.zip", &submission(&config("Mallory", "Malone", "260000104")));
    place.put("list.csv", LIST.as_bytes());
    place.grade(&root, &["in", "--class", "list.csv"]);
    let decided = "[[match]]\nsubmission = \"a2_mal.zip\"\nstudent = \"260000106\"\n";
    place.put("out/matches.toml", decided.as_bytes());
    place.grade(&root, &["in", "--export", "junit"]);
    (place, root)
}

#[test]
fn a_suspicion_is_the_instructor_s_until_they_have_looked_at_it() {
    let (place, root) = one_number();
    let private = ["stands under two names", "submission.number", "another submission"];
    for slug in ["a2_ann", "a2_mal"] {
        let page = read(&place, &format!("out/instructor/{slug}/report.html"));
        assert!(private.iter().any(|words| page.contains(words)), "{page}");
        let page = read(&place, &format!("out/{slug}/report.html"));
        for words in private {
            assert!(!page.contains(words), "{slug}: {words}");
        }
    }
    for words in private {
        assert!(!read(&place, "out/junit.xml").contains(words), "{words}");
    }
    // It waits, here and there, until it is confirmed.
    let waits = "to be looked at, then confirmed";
    let page = || read(&place, "out/report.html");
    let waiting =
        |status: &str| status.lines().filter(|line| line.contains("under another name")).count();
    let (_, said) = umbra(&place, &root, &["status"]);
    assert_eq!(waiting(&said), 2, "{said}");
    assert!(page().contains(&format!("2 submissions: {waits}")), "{}", page());
    for (student, rest) in [("260000104", 1), ("260000106", 0)] {
        let (code, said) = umbra(&place, &root, &["confirm", student, "--reason", "a slip"]);
        assert_eq!(code, Some(0), "{said}");
        let (_, said) = umbra(&place, &root, &["status"]);
        assert_eq!(waiting(&said), rest, "{said}");
        assert_eq!(page().contains(&format!("1 submission: {waits}")), rest == 1);
    }
    assert!(!page().contains(waits), "{}", page());
}

#[test]
fn an_export_says_what_still_waits() {
    let (place, root) = one_number();
    let export = ["export", "grades.csv", "--format", "brightspace"];
    let (code, said) = umbra(&place, &root, &export);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("warning: 2 grades with points that still wait for you"), "{said}");
    assert!(
        said.contains("Ann Lee (260000104): for the instructor: another submission has the same student number"),
        "{said}"
    );
    assert!(said.contains("no penalty, since nobody knows when it was submitted"), "{said}");
    // A grade that Moodle has locked.
    let moodle = Place::new();
    let root_of_moodle = moodle.assignment(LATE);
    let own = submission(&config("Ann", "Lee", "260000104"));
    moodle.put("in/Ann Lee_7_assignsubmission_file/a2.zip", &own);
    let list = "Identifier,\"Full name\",\"ID number\",Status,Grade,\"Maximum grade\",\"Grade can be changed\"\n\
                \"Participant 7\",\"Ann Lee\",260000104,x,,100.00,No\n";
    moodle.put("list.csv", list.as_bytes());
    moodle.grade(&root_of_moodle, &["in", "--class", "list.csv"]);
    let export = ["export", "grades.csv", "--format", "moodle"];
    let (_, said) = umbra(&moodle, &root_of_moodle, &export);
    assert!(
        said.contains("cannot be changed, and may pass them over: Ann Lee (260000104)"),
        "{said}"
    );
    for format in ["junit", "csv", "json"] {
        let file = format!("own.{format}");
        let (code, said) = umbra(&place, &root, &["export", &file, "--format", format]);
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains(&format!("{file}: 2 submissions")), "{said}");
    }
}

#[test]
fn two_students_of_one_name_are_told_of_both_submissions() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let entries: Vec<(String, Vec<u8>)> = [("15", "x"), ("16", "y")]
        .map(|(id, number)| {
            let name = format!("{id}-1 - John Smith - Oct 5, 2019 1000 PM/a2.zip");
            (name, submission(&config("John", "Smith", number)))
        })
        .to_vec();
    let entries: Vec<(String, &[u8])> =
        entries.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
    place.put("in.zip", &zip(&entries));
    place.put("list.csv", b"OrgDefinedId,Last Name,First Name\n#1,Smith,John\n#2,Smith,John\n");
    let (said, report) = place.grade(&root, &["in.zip", "--class", "list.csv"]);
    let missing = report["class"]["missing"].as_array().unwrap();
    assert_eq!(missing.len(), 2, "{said}");
    for own in missing {
        let reason = text(&own["reason"]);
        assert!(reason.contains("15-1 - ") && reason.contains(" or 16-1 - "), "{reason}");
    }
    // The page begins with what is to be decided.
    let page = read(&place, "out/report.html");
    let (decide, table) = (page.find("2 submissions: decide in matches.toml"), page.find("<table"));
    assert!(decide.is_some() && decide < table, "{decide:?} {table:?}");
}

#[test]
fn merging_again_takes_what_was_decided() {
    let place = Place::new();
    let root = place.assignment(LATE);
    place.put("in/a2_ann.zip", &submission(&config("Ann", "Lee", "260000104")));
    place.put("in/a2_mal.zip", &submission(&config("Mallory", "Malone", "260000104")));
    place.put("in/notes.pdf", b"x");
    place.put("list.csv", LIST.as_bytes());
    let grade = ["grade", "in", "--class", "list.csv", "--partition", "slice:1/1"];
    let options = ["--held-back", "off", "--isolation", "reduced"];
    let (code, said) = umbra(&place, &root, &[&grade[..], &options].concat());
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = umbra(&place, &root, &["merge"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("skipped, not submissions: notes.pdf"), "{said}");
    assert!(said.contains("decide in out/matches.toml, and run the same command again"), "{said}");
    let decided = "[[match]]\nsubmission = \"a2_mal.zip\"\nstudent = \"260000106\"\n";
    place.put("out/matches.toml", decided.as_bytes());
    for _ in 0..2 {
        let (code, said) = umbra(&place, &root, &["merge"]);
        assert_eq!(code, Some(0), "{said}");
        let report: serde_json::Value =
            serde_json::from_str(&read(&place, "out/report.json")).unwrap();
        assert_eq!(report["class"]["undecided"], json!([]), "{said}");
    }
}
