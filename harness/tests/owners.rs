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

/// Messages name people as the list does, however they write themselves.
const TWO: &str = "Student ID,Last Name,First Name\n260000104,Lee,Ann\n260000106,Malône,Mallory\n";

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
    assert!(said.contains("Ann Lee (a2_ann): part 1.1 now has 1 point;"), "{said}");
    assert_eq!(points(&place), of(&[("a2_ann", 1.0), ("a2_mal", 3.0)]));
    let (code, said) = set("260000106", "1.1", "2");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("Mallory Malône (260000106) has no submission that is theirs"), "{said}");
    let (code, said) = umbra(&place, &root, &["defend", "260000106", "1.1"]);
    assert_eq!(code, Some(2), "{said}");
    // After it: each by the number of the list.
    let decided = "[[match]]\nsubmission = \"a2_mal.zip\"\nstudent = \"260000106\"\n";
    place.put("out/matches.toml", decided.as_bytes());
    let (code, said) = umbra(&place, &root, &["regrade", "--apply", "--reason", "x"]);
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = set("260000106", "1.4", "13");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("Mallory Malône (a2_mal): part 1.4 now has 13 points"), "{said}");
    assert_eq!(points(&place), of(&[("a2_ann", 1.0), ("a2_mal", 13.0)]));
    let (code, said) = umbra(&place, &root, &["confirm", "Malone, Mallory", "--reason", "x"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("Mallory Malône (a2_mal): confirmed"), "{said}");
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

const NAMES: [&str; 3] = ["Zoe Oz", "Ann Lee", "Bob Dim"];

/// The entries of a download of Brightspace, of its first students.
fn brightspace(students: usize) -> Vec<(String, Vec<u8>)> {
    let own = |(at, name): (usize, &&str)| {
        let (first, last) = name.split_once(' ').unwrap();
        let path = format!("10{at}-90{at} - {name} - Oct 5, 2019 1159 PM/a2.zip");
        (path, submission(&config(first, last, &format!("26000010{at}"))))
    };
    NAMES.iter().enumerate().take(students).map(own).collect()
}

fn download(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    zip(&files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect::<Vec<_>>())
}

#[test]
fn a_newer_download_of_a_class_holds_the_same_submissions() {
    let moodle = |students: usize| -> Vec<(String, Vec<u8>)> {
        let own = |(at, (_, bytes)): (usize, (String, Vec<u8>))| {
            (format!("{}_{at}_assignsubmission_file/a2.zip", NAMES[at]), bytes)
        };
        brightspace(students).into_iter().enumerate().map(own).collect()
    };
    let canvas = |students: usize| -> Vec<(String, Vec<u8>)> {
        let own = |(at, (_, bytes)): (usize, (String, Vec<u8>))| {
            (format!("{}_{at}_77{at}_a2.zip", NAMES[at].replace(' ', "").to_lowercase()), bytes)
        };
        brightspace(students).into_iter().enumerate().map(own).collect()
    };
    let plain = |students: usize| -> Vec<(String, Vec<u8>)> {
        let own = |(at, (_, bytes)): (usize, (String, Vec<u8>))| (format!("a2_{at}.zip"), bytes);
        brightspace(students).into_iter().enumerate().map(own).collect()
    };
    type Files<'a> = &'a dyn Fn(usize) -> Vec<(String, Vec<u8>)>;
    let layouts: [(&str, Files); 4] = [
        ("Brightspace", &brightspace),
        ("Moodle", &moodle),
        ("Canvas", &canvas),
        ("plain", &plain),
    ];
    for (title, files) in layouts {
        let place = Place::new();
        let root = place.assignment(LATE);
        let (mon, tue) = (files(2), files(3));
        place.put("mon.zip", &download(&mon));
        place.put("tue.zip", &download(&tue));
        place.put("moved/tue.zip", &download(&tue));
        tue.iter().for_each(|(name, bytes)| place.put(&format!("tue/{name}"), bytes));
        let names = |report: &Value| -> Vec<String> {
            rows(report).into_iter().map(|(name, ..)| name).collect()
        };
        let (_, report) = place.grade(&root, &["mon.zip"]);
        assert_eq!(names(&report).len(), 2, "{title}");
        for (given, kept) in [
            (&["tue.zip"][..], 2),
            (&["moved/tue.zip"], 3),
            (&["tue"], 3),
            (&["mon.zip", "tue.zip"], 3),
        ] {
            let (said, report) = place.grade(&root, given);
            assert_eq!(names(&report).len(), 3, "{title} {given:?}: {said}");
            assert!(
                said.contains(&format!("{kept} of 3 submissions keep their earlier grades")),
                "{title} {given:?}: {said}"
            );
            assert_eq!(
                report["class"]["undecided"].as_array().unwrap().len(),
                0,
                "{title}: {said}"
            );
        }
        // The older one again: nobody is lost.
        let (_, report) = place.grade(&root, &["mon.zip"]);
        assert_eq!(names(&report).len(), 3, "{title}");
    }
}

#[test]
fn another_content_under_one_name_is_said_and_each_has_an_address() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let name = "Ann Lee_7_assignsubmission_file/a2.zip".to_owned();
    let (first, second) = (config("Ann", "Lee", "260000104"), config("Ann", "Lee", "260000104 "));
    place.put("mon.zip", &download(&[(name.clone(), submission(&first))]));
    place.put("tue.zip", &download(&[(name.clone(), submission(&second))]));
    // In a newer download it replaces the older one, by name.
    place.grade(&root, &["mon.zip"]);
    let (said, report) = place.grade(&root, &["tue.zip"]);
    assert_eq!(rows(&report).len(), 1, "{said}");
    assert!(
        said.contains(&format!("{name} of Ann Lee is graded again: it replaces the one")),
        "{said}"
    );
    assert!(
        place.at("out/instructor/Ann-Lee_7_assignsubmission_file-a2/record.replaced.json").exists()
    );
    // Side by side both are there.
    fs::remove_dir_all(place.at("out")).unwrap();
    let (said, report) = place.grade(&root, &["mon.zip", "tue.zip"]);
    let slugs: Vec<String> = points(&place).into_iter().map(|(slug, _)| slug).collect();
    assert_eq!(slugs.len(), 2, "{said}");
    let asked: Vec<&str> = report["class"]["undecided"]
        .as_array()
        .unwrap()
        .iter()
        .map(|own| text(&own["submission"]))
        .collect();
    assert_eq!(asked, slugs);
    let (_, said) = umbra(&place, &root, &["status"]);
    assert!(said.contains(&format!("there is also {}", slugs[1])), "{said}");
    let decide = |submission: &str| {
        let text = format!("[[match]]\nsubmission = \"{submission}\"\nstudent = \"none\"\n");
        place.put("out/matches.toml", text.as_bytes());
        let (code, said) = umbra(&place, &root, &["regrade", "--apply", "--reason", "x"]);
        assert_eq!(code, Some(0), "{said}");
        points(&place).into_iter().map(|(slug, _)| slug).collect::<Vec<_>>()
    };
    assert_eq!(decide(&slugs[0]), [slugs[1].clone()]);
    // Their name is that of two, and nobody's grade vanishes.
    assert_eq!(decide(&name), slugs);
    let (code, said) = umbra(&place, &root, &["status"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("may be more than one submission, so it is on none"), "{said}");
    assert_eq!(decide("nobody/a2.zip"), slugs);
    let (_, said) = umbra(&place, &root, &["status"]);
    assert!(said.contains("there is no submission \"nobody/a2.zip\""), "{said}");
}

#[test]
fn a_download_among_other_archives_is_no_row_of_zero() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let late = submission(&config("Zed", "Late", "260000107"));
    let tue = download(&brightspace(3));
    place.put("f/late_by_mail.zip", &late);
    place.put("f/tue.zip", &tue);
    place.put("f/deeper/mon.zip", &download(&brightspace(2)));
    let (said, report) = place.grade_to(Some(1), &root, &["f"]);
    let names = |report: &Value| -> Vec<String> {
        rows(report).into_iter().map(|(name, ..)| name).collect()
    };
    assert_eq!(names(&report), ["late_by_mail.zip"], "{said}");
    let unopened = report["class"]["unopened"].as_array().unwrap();
    assert_eq!(unopened.len(), 2, "{said}");
    assert!(said.contains("tue.zip: it looks like a download of Brightspace"), "{said}");
    let (code, said) = umbra(&place, &root, &["status"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("neither opened nor graded: 2"), "{said}");
    // As the hint says.
    let (said, report) = place.grade(&root, &["f/tue.zip", "f/late_by_mail.zip"]);
    assert_eq!(names(&report).len(), 4, "{said}");
    // A zip of nothing but the download.
    fs::remove_dir_all(place.at("out")).unwrap();
    let junk = ("__MACOSX/._tue.zip".to_owned(), b"x".to_vec());
    place.put("outer.zip", &download(&[("tue.zip".to_owned(), tue), junk]));
    let (said, report) = place.grade(&root, &["outer.zip"]);
    assert_eq!(names(&report).len(), 3, "{said}");
    let (_, said, _) = place.run(&["validate", "outer.zip", "--root", root.to_str().unwrap()]);
    assert!(said.contains("3 submissions: "), "{said}");
}

#[test]
fn two_contents_under_one_name_of_a_download_are_refused() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let (name, ann) = brightspace(2).remove(1);
    let other = submission(&config("Ann", "Lee", "260000199"));
    let run = |command: &str| {
        let mut all = vec![command, "dup.zip", "--root", root.to_str().unwrap()];
        all.extend((command == "grade").then_some(["--report", "out"]).into_iter().flatten());
        let (code, said, errors) = place.run(&all);
        (code, said + &errors)
    };
    place.put("dup.zip", &download(&[(name.clone(), ann.clone()), (name.clone(), other)]));
    for command in ["validate", "grade"] {
        let (code, said) = run(command);
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(&format!("two files in it are called \"{name}\"")), "{said}");
    }
    assert!(!place.at("out").exists());
    // With one content they are one.
    place.put("dup.zip", &download(&[(name.clone(), ann.clone()), (name, ann)]));
    let (_, said) = run("validate");
    assert!(said.contains("1 submission: "), "{said}");
}
