//! Frames of Umbra's own pass are drawn once for the same stages, and whatever lies in their files is looked at.

#![cfg(target_os = "linux")]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use sha2::{Digest, Sha256};

use crate::support::one_scene;

/// A folder with links to all that another one holds, but for `own`.
fn links(from: &Path, to: &Path, own: &[&str]) {
    fs::create_dir_all(to).unwrap();
    for entry in from.read_dir().unwrap().map(Result::unwrap) {
        if !own.iter().any(|own| entry.file_name() == *own) {
            symlink(entry.path(), to.join(entry.file_name())).unwrap();
        }
    }
}

#[test]
fn unchanged_stages_are_not_drawn_again_and_a_broken_file_is() {
    let place = tempfile::tempdir().unwrap();
    let root = one_scene(&place.path().join("root"), |_| ());
    let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target").canonicalize().unwrap();
    fs::remove_file(root.join("target")).unwrap();
    links(&target, &root.join("target"), &["umbra"]);
    links(&target.join("umbra"), &root.join("target/umbra"), &["frames", "scratch"]);
    let frames = root.join("target/umbra/frames");

    let src = place.path().join("work/src");
    for from in ["student_template/src", "samples/perfect/src"] {
        let from = root.join(from).canonicalize().unwrap();
        for file in umbra::files::files_below(&from).unwrap() {
            let to = src.join(file.strip_prefix(&from).unwrap());
            fs::create_dir_all(to.parent().unwrap()).unwrap();
            fs::copy(&file, to).unwrap();
        }
    }
    let phong = src.join("shaders/phong.fs.wgsl");
    let right = fs::read_to_string(&phong).unwrap();
    assert_eq!(right.matches("incident * f * cos_i").count(), 1);
    let wrong = |factor: &str| {
        let text = right.replace("incident * f * cos_i", &format!("incident * f * {factor}"));
        fs::write(&phong, text).unwrap();
    };
    let checked = || {
        let mut check = Command::new(env!("CARGO_BIN_EXE_umbra"));
        check.arg("check").arg(src.parent().unwrap()).args(["--verbose", "--part", "2.4"]);
        check.arg("--root").arg(&root).arg("--report").arg(place.path().join("report"));
        let said = check.output().unwrap();
        assert_eq!(said.status.code(), Some(1), "{said:?}");
        // What comes after are times.
        let said = String::from_utf8(said.stdout).unwrap();
        said.split("\nconditions\n").next().unwrap().to_owned()
    };
    let kept = || umbra::files::files_below(&frames).unwrap();
    let change = |change: &dyn Fn(&mut Vec<u8>)| {
        for file in kept() {
            let mut bytes = fs::read(&file).unwrap();
            change(&mut bytes);
            fs::write(file, bytes).unwrap();
        }
    };

    wrong("cos_i * cos_i");
    let first = checked();
    assert!(first.contains("stage.phong"), "{first}");
    // The vertex stage in two ways, the diffuse one, the Phong one.
    assert_eq!(kept().len(), 4);
    assert_eq!(checked(), first);

    // One byte more or less is not what was kept.
    change(&|bytes| *bytes.last_mut().unwrap() ^= 1);
    assert_eq!(checked(), first);
    change(&|bytes| bytes.truncate(bytes.len() - 1));
    assert_eq!(checked(), first);

    // What is whole is used: a file of black frames is believed, until the stage is another.
    change(&|bytes| {
        let (digest, floats) = bytes.split_at_mut(32);
        floats.fill(0);
        digest.copy_from_slice(&Sha256::digest(floats));
    });
    assert_ne!(checked(), first);
    wrong("(cos_i * cos_i)");
    checked();
    assert_eq!(kept().len(), 5, "one stage changed");
}
