//! The autograder for Gradescope, in the folders that Gradescope has, without its container.

#![cfg(unix)]

use std::fs;
use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::support::one_scene;

#[test]
fn the_autograder_grades_and_always_leaves_results() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let late = serde_json::json!({"penalty": 1, "unit": "points", "per": "day",
        "extensions": [{"student": "260000001", "late_days": 1}]});
    let root = one_scene(&at("assignment"), |config| config["late"] = late.clone());
    let output = Command::new(env!("CARGO_BIN_EXE_umbra"))
        .args(["gradescope-pack", "autograder.zip", "--held-back", "20191006", "--root"])
        .arg(&root)
        .current_dir(place.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    // Everything is at the root of the zip, and the scripts are programs.
    let mut zip = zip::ZipArchive::new(fs::File::open(at("autograder.zip")).unwrap()).unwrap();
    let source = at("autograder/source");
    zip.extract(&source).unwrap();
    for script in ["setup.sh", "run_autograder"] {
        let mode = source.join(script).metadata().unwrap().permissions().mode();
        assert_eq!(mode & 0o111, 0o111, "{script}");
        let checked = Command::new("bash").arg("-n").arg(source.join(script)).status().unwrap();
        assert!(checked.success(), "{script}");
    }
    for (path, is_there) in [
        ("umbra/harness/src/main.rs", true),
        ("umbra/expected", true),
        ("umbra/Cargo.lock", true),
        ("umbra/target", false),
        ("umbra/samples", false),
    ] {
        assert_eq!(source.join(path).exists(), is_there, "{path}");
    }
    let config = fs::read_to_string(source.join("umbra/config.json")).unwrap();
    assert!(!config.contains("late\"") && !config.contains("260000001"));

    // What setup.sh builds there is here already, for the template that is here.
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap();
    fs::remove_dir_all(source.join("umbra/student_template")).unwrap();
    for shared in ["target", "student_template"] {
        symlink(own.join(shared), source.join("umbra").join(shared)).unwrap();
    }
    let run = |submission: &[(&str, &str)]| -> Value {
        let folder = at("autograder/submission");
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        for (path, text) in submission {
            fs::create_dir_all(folder.join(path).parent().unwrap()).unwrap();
            fs::write(folder.join(path), text).unwrap();
        }
        let mut run = Command::new(source.join("run_autograder"));
        run.env("AUTOGRADER_DIR", at("autograder")).current_dir(at("autograder"));
        for (name, folder) in [("CARGO_HOME", ".cargo"), ("RUSTUP_HOME", ".rustup")] {
            if std::env::var_os(name).is_none() {
                run.env(name, Path::new(&std::env::var_os("HOME").unwrap()).join(folder));
            }
        }
        let output = run.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        let results = fs::read(at("autograder/results/results.json")).expect(&said);
        serde_json::from_slice(&results).expect(&said)
    };
    let wrong = [("config.json", "{}"), ("src/lib.rs", "fn main() { not_rust }")];
    let results = run(&wrong);
    assert_eq!(results["score"], 0.0, "{results}");
    let tests = results["tests"].as_array().unwrap();
    assert_eq!(tests.len(), 9, "{results}");
    assert_eq!((&tests[0]["number"], &tests[0]["status"]), (&"1.1".into(), &"failed".into()));
    assert!(results["execution_time"].as_f64().is_some_and(|time| time > 0.0), "{results}");
    // Nothing to grade.
    let results = run(&[("notes.txt", "sorry")]);
    assert!(
        results["output"].as_str().unwrap().contains("was not graded (exit code 2)"),
        "{results}"
    );
}
