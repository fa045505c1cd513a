//! Whose a decision is, and which rows are one submission: a number that another student typed, newer downloads,
//! copies, and names that several submissions have.

#![cfg(unix)]

use std::fs;
use std::path::Path;

use serde_json::Value;
use similar_asserts::assert_eq;

use crate::downloads::{LATE, Place, config, rows, submission, text, zip};

fn umbra(place: &Place, root: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let fixed = ["--report", "out", "--root", root.to_str().unwrap()];
    let fixed = if arguments[0] == "status" { &fixed[..2] } else { &fixed[..] };
    let (code, said, errors) = place.run(&[arguments, fixed].concat());
    (code, said + &errors)
}

/// Of each row of the report: its folder and its points.
fn points(place: &Place) -> Vec<(String, f64)> {
    let report: Value =
        serde_json::from_slice(&fs::read(place.at("out/report.json")).unwrap()).unwrap();
    let row = |row: &Value| (text(&row["slug"]).to_owned(), row["points"].as_f64().unwrap());
    report["submissions"].as_array().unwrap().iter().map(row).collect()
}

fn of(rows: &[(&str, f64)]) -> Vec<(String, f64)> {
    rows.iter().map(|(slug, points)| ((*slug).to_owned(), *points)).collect()
}

const TWO: &str = "Student ID,Last Name,First Name\n260000104,Lee,Ann\n260000106,Malone,Mallory\n";

#[test]
fn a_decision_is_never_on_another_who_typed_the_same_number() {
    let place = Place::new();
    let root = place.assignment(LATE);
    place.put("in/a2_ann.zip", &submission(&config("Ann", "Lee", "260000104")));
    place.put("in/a2_mal.zip", &submission(&config("Mallory", "Malone", "260000104")));
    place.put("list.csv", TWO.as_bytes());
    place.grade(&root, &["in", "--class", "list.csv"]);
    let set = |student: &str, part: &str, points: &str| {
        umbra(&place, &root, &["override", student, part, points, "--reason", "x"])
    };
    // Before it is decided whose the second is: by its folder it is that one alone, and the number is Ann's.
    let (code, said) = set("a2_mal", "1.4", "3");
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(points(&place), of(&[("a2_ann", 0.0), ("a2_mal", 3.0)]));
    let (code, said) = set("260000104", "1.1", "1");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("Ann Lee (a2_ann): part 1.1 has 1 points"), "{said}");
    assert_eq!(points(&place), of(&[("a2_ann", 1.0), ("a2_mal", 3.0)]));
    let (code, said) = set("260000106", "1.1", "2");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("Mallory Malone (260000106) has no submission that is theirs"), "{said}");
    let (code, said) = umbra(&place, &root, &["defend", "260000106", "1.1"]);
    assert_eq!(code, Some(2), "{said}");
    // After it: each by the number of the list.
    let decided = "[[match]]\nsubmission = \"a2_mal.zip\"\nstudent = \"260000106\"\n";
    place.put("out/matches.toml", decided.as_bytes());
    let (code, said) = umbra(&place, &root, &["regrade", "--apply", "--reason", "x"]);
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = set("260000106", "1.4", "13");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("Mallory Malone (a2_mal): part 1.4 has 13 points"), "{said}");
    assert_eq!(points(&place), of(&[("a2_ann", 1.0), ("a2_mal", 13.0)]));
    let (code, said) = umbra(&place, &root, &["confirm", "Malone, Mallory", "--reason", "x"]);
    assert_eq!(code, Some(0), "{said}");
    let kept = fs::read_to_string(place.at("out/overrides.toml")).unwrap();
    let keys: Vec<&str> = kept.lines().filter_map(|line| line.strip_prefix("student = ")).collect();
    assert_eq!(keys, ["\"a2_mal\"", "\"260000104\"", "\"260000106\"", "\"260000106\""]);
    let report = fs::read(place.at("out/report.json")).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    let of_ann = report["submissions"][0]["standing"]["decisions"].as_array().unwrap();
    assert_eq!(of_ann.len(), 1, "{of_ann:?}");
    // `grade --only` means the same.
    let (said, _) = place.grade(&root, &["in", "--only", "260000104", "--force"]);
    assert!(said.contains("1 of 1: a2_ann") && !said.contains("a2_mal ("), "{said}");
}

#[test]
fn a_number_that_may_be_two_people_s_is_on_nobody_and_said() {
    let place = Place::new();
    let root = place.assignment(LATE);
    place.put("in/a2_ann.zip", &submission(&config("Ann", "Lee", "260000104")));
    place.put("in/a2_mal.zip", &submission(&config("Mallory", "Malone", "260000104")));
    place.grade(&root, &["in"]);
    let set = ["override", "260000104", "1.4", "13", "--reason", "x", "--by", ""];
    let (code, said) = umbra(&place, &root, &set);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("name the folder of one: a2_ann, a2_mal"), "{said}");
    // As an older version wrote it.
    let old =
        "[[override]]\nstudent = \"260000104\"\npart = \"1.4\"\npoints = 13\nreason = \"x\"\n";
    place.put("out/overrides.toml", old.as_bytes());
    let (code, said) = umbra(&place, &root, &["regrade", "--apply", "--reason", "x"]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(points(&place), of(&[("a2_ann", 0.0), ("a2_mal", 0.0)]));
    let (code, said) = umbra(&place, &root, &["status"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("overrides.toml:1: \"260000104\" may be more than one person"), "{said}");
    // Nobody's name is left out, not empty.
    let (_, said) =
        umbra(&place, &root, &["override", "a2_ann", "1.4", "2", "--reason", "x", "--by", ""]);
    assert!(
        !fs::read_to_string(place.at("out/overrides.toml")).unwrap().contains("by = \"\""),
        "{said}"
    );
    assert_eq!(points(&place), of(&[("a2_ann", 2.0), ("a2_mal", 0.0)]));
}
