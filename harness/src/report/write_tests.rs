//! Tests of what lies on the disk afterwards.

use std::fs;

use super::*;

#[test]
fn every_file_is_there_and_no_temporary_one() {
    let out = tempfile::tempdir().unwrap();
    let sheet = sample::sheet();
    // Twice: a second run replaces what the first one wrote.
    for _ in 0..2 {
        write(out.path(), &sheet).unwrap();
    }
    let mut names: Vec<String> = Vec::new();
    for folder in ["", "a2_ada", "two_cosines", "hand_in_3", "instructor/two_cosines"] {
        for file in fs::read_dir(out.path().join(folder)).unwrap() {
            names.push(format!("{folder}/{}", file.unwrap().file_name().display()));
        }
    }
    names.sort();
    assert_eq!(
        names,
        [
            "/a2_ada",
            "/grades.csv",
            "/hand_in_3",
            "/instructor",
            "/report.html",
            "/report.json",
            "/two_cosines",
            "a2_ada/report.html",
            "hand_in_3/report.html",
            "instructor/two_cosines/report.html",
            "two_cosines/report.html",
        ]
    );
    let json = fs::read_to_string(out.path().join(JSON_FILE)).unwrap();
    assert_eq!(json, json_report(&sheet).unwrap());
}

#[test]
fn an_empty_batch_writes_nothing() {
    let out = tempfile::tempdir().unwrap();
    let sheet = Sheet { entries: Vec::new(), ..sample::sheet() };
    assert!(matches!(write(out.path(), &sheet), Err(ReportError::Empty)));
    assert_eq!(fs::read_dir(out.path()).unwrap().count(), 0);
}

#[test]
fn a_slug_cannot_leave_the_folder_or_meet_another() {
    let out = tempfile::tempdir().unwrap();
    for slug in ["", "..", ".", "a/b", "/etc", "a/", "two_cosines", "report.html", "instructor"] {
        let mut sheet = sample::sheet();
        sheet.entries[0].record.slug = slug.into();
        let error = write(&out.path().join("out"), &sheet).unwrap_err();
        assert!(matches!(error, ReportError::Slug { .. }), "{slug:?}: {error}");
    }
    assert_eq!(fs::read_dir(out.path()).unwrap().count(), 0);
}

#[test]
fn what_cannot_be_written_names_its_file() {
    let out = tempfile::tempdir().unwrap();
    fs::write(out.path().join("a2_ada"), "a file where a folder must be").unwrap();
    let error = write(out.path(), &sample::sheet()).unwrap_err().to_string();
    assert!(error.contains("a2_ada") && error.contains("cannot write the report"), "{error}");
}
