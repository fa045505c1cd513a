//! What a program of somebody else's calls.

use std::fs;
use std::path::Path;

use umbra::{GradeOptions, Verdict, grade_submission};

#[test]
fn a_program_grades_a_submission_and_gets_points_with_their_evidence() {
    let place = tempfile::tempdir().unwrap();
    let submission = place.path().join("a2");
    fs::create_dir_all(submission.join("src")).unwrap();
    fs::write(submission.join("src/lib.rs"), "fn main() { not_rust }").unwrap();
    let options = GradeOptions {
        root: Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap(),
        umbra: Path::new(env!("CARGO_BIN_EXE_umbra")),
        output: &place.path().join("report"),
        seed: None,
        reduced_isolation: true,
    };
    let graded = grade_submission(&submission, &options).unwrap();
    assert_eq!((graded.grade.parts.len(), graded.grade.out_of), (9, 100.0));
    assert_eq!((graded.grade.points, graded.grade.points_max), (0.0, 0.0));
    let checks = &graded.record.evidence.checks;
    let build = checks.iter().find(|check| check.id.name() == "submission.build").unwrap();
    assert_eq!(build.verdict, Verdict::Fail);
    assert!(graded.record.diagnostics.contains("not_rust"), "{}", graded.record.diagnostics);
    for file in ["report.html", "report.json", "grades.csv", "submission/report.html"] {
        assert!(options.output.join(file).is_file(), "{file}");
    }
    let error = grade_submission(&place.path().join("b2"), &options).unwrap_err();
    assert!(error.to_string().ends_with("b2 does not exist"), "{error}");
}
