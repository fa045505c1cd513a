//! The program as its callers meet it: as a library, and in an odd environment.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use basecode::Image;
use basecode::exr_io::{Precision, write_exr};
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

/// Without a temporary folder the message is one line about that folder, and nothing is said of the rest.
#[test]
fn a_temporary_folder_that_is_not_there_is_named() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("file");
    fs::write(&file, "").unwrap();
    let image = place.path().join("a.exr");
    write_exr(&image, &Image::new(2, 2), Precision::Float, &[]).unwrap();
    let run = |temporary: &Path, arguments: &[&str]| {
        let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
            .env("TMPDIR", temporary)
            .current_dir(place.path())
            .args(arguments)
            .output()
            .unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (run.status.code(), text(&run.stdout), text(&run.stderr))
    };
    for (temporary, what) in [(place.path().join("gone"), "not there"), (file, "not a folder")] {
        let line = format!("umbra: TMPDIR is {}, which is {what}\n", temporary.display());
        for arguments in [&["doctor"][..], &["view", "a.exr"], &["pack", "."], &["watch", "."]] {
            let expected = (Some(3), String::new(), line.clone());
            assert_eq!(run(&temporary, arguments), expected, "{arguments:?}");
        }
        let (code, _, said) = run(&temporary, &["view", "a.exr", "-o", "page"]);
        assert_eq!(code, Some(0), "needs none: {said}");
    }
    let (code, out, said) = run(Path::new("/proc"), &["doctor"]);
    assert!(code == Some(3) && out.is_empty(), "{out}");
    assert!(said.starts_with("umbra: cannot write to /proc: "), "{said}");
    assert!(said.lines().count() == 1 && !said.contains("at path"), "{said}");
}

/// Words that a full disk swallows are an error, and under `--idiff` every error has idiff's code.
#[cfg(target_os = "linux")]
#[test]
fn what_cannot_be_printed_or_parsed_has_its_exit_code() {
    let place = tempfile::tempdir().unwrap();
    write_exr(place.path().join("a.exr"), &Image::new(2, 2), Precision::Float, &[]).unwrap();
    let run = |line: &str, out: Stdio| {
        let arguments = line.split(' ').filter(|argument| !argument.is_empty());
        let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
            .current_dir(place.path())
            .args(arguments)
            .stdout(out)
            .output()
            .unwrap();
        (run.status.code(), String::from_utf8_lossy(&run.stderr).into_owned())
    };
    let full = || Stdio::from(fs::File::options().write(true).open("/dev/full").unwrap());
    for (line, code) in [
        ("--help", 3),
        ("--version", 3),
        ("help compare", 3),
        ("compare --help", 3),
        ("compare a.exr a.exr", 3),
        ("completions bash", 3),
        ("compare --idiff a.exr a.exr", 4),
        ("compare a.exr a.exr --idiff", 4),
        ("compare --idiff -help", 4),
        ("--root . compare --idiff a.exr a.exr", 4),
    ] {
        let (found, said) = run(line, full());
        assert_eq!(found, Some(code), "{line}: {said}");
        assert!(said.starts_with("umbra: cannot write to standard output: "), "{line}: {said}");
    }
    for (line, code) in [
        ("", 2),
        ("--help", 0),
        ("--version", 0),
        ("compare --unknown a.exr a.exr", 2),
        ("compare --json --idiff a.exr a.exr", 4),
        ("compare --idiff=-fail 1 a.exr a.exr", 4),
        ("compare --unknown --idiff a.exr a.exr", 4),
        ("compare a.exr a.exr a.exr --idiff", 4),
        ("compare --idiff", 4),
        ("compare --idiff -q a.exr a.exr", 0),
    ] {
        let (found, said) = run(line, Stdio::null());
        assert_eq!(found, Some(code), "{line}: {said}");
        assert_eq!(said.is_empty(), code == 0, "{line}: {said}");
    }
}

/// A graphics driver prints an error of its own for a desktop's folder that is not there; the rows say all there is.
#[cfg(target_os = "linux")]
#[test]
fn doctor_prints_nothing_among_its_rows() {
    let run = |folder: Option<&str>| {
        let mut doctor = Command::new(env!("CARGO_BIN_EXE_umbra"));
        match folder {
            Some(folder) => doctor.env("XDG_RUNTIME_DIR", folder),
            None => doctor.env_remove("XDG_RUNTIME_DIR"),
        };
        let run = doctor.arg("doctor").output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (run.status.code(), text(&run.stdout), text(&run.stderr))
    };
    let (code, rows, _) = run(Some("/"));
    assert!(rows.contains("graphics adapters"), "{rows}");
    for folder in [None, Some(""), Some("not/absolute"), Some("/"), Some("/nonexistent")] {
        assert_eq!(run(folder), (code, rows.clone(), String::new()), "{folder:?}");
    }
}
