//! Batches and archives as they arrive, through the real binary: what becomes a row, what is said of it, and
//! that what is said is true.

#![cfg(unix)]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::zip_bytes::{Entry, Zip};
use serde_json::Value;
use similar_asserts::assert_eq;

const IMAGES: [&str; 4] = [
    "offline/cbox_simple_offline.exr",
    "offline/teapot_simple_offline.exr",
    "realtime/cbox_simple_realtime.exr",
    "realtime/teapot_simple_realtime.exr",
];

fn config(first: &str, last: &str, number: &str) -> String {
    let renders = IMAGES.map(|path| format!(r#"{{"scene": "", "render": "{path}"}}"#)).join(", ");
    format!(
        r#"{{"firstName": "{first}", "lastName": "{last}", "studentID": "{number}", "renders": [{renders}]}}"#
    )
}

/// A zip of these files.
fn zip(files: &[(&str, &str)]) -> Vec<u8> {
    Zip::of(files.iter().map(|(path, text)| Entry::deflated(path, text.as_bytes()))).bytes()
}

/// `config.json`, a source file at `lib`, and the images, all with this content.
fn submission<'a>(config: &'a str, lib: &'a str, image: &'a str) -> Vec<(&'a str, &'a str)> {
    let mut files = vec![("config.json", config), (lib, "fn main() { not_rust }")];
    files.extend(IMAGES.map(|path| (path, image)));
    files
}

fn umbra(arguments: &[&str], paths: &[&Path]) -> (Option<i32>, String, String) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let output = Command::new(env!("CARGO_BIN_EXE_umbra"))
        .args(arguments)
        .args(paths)
        .args(["--root", "."])
        .current_dir(root)
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

fn put(path: PathBuf, bytes: &[u8]) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_class_as_a_learning_platform_lays_it_out() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join("class").join(name);
    let own = |student: &str| at(&format!("{student}_assignsubmission_file/a2.zip"));
    let (ann, bob, dan) = (
        config("Ann", "Able", "260 000 101"),
        config("Bob", "Baker", "260000102"),
        format!("\u{feff}{}", config("Dan", "Delta", "260000104")),
    );
    put(own("Ann_1"), &zip(&submission(&ann, "src/lib.rs", "x")));
    put(own("Bob_2"), &zip(&[("config.json", &bob)]));
    put(own("Cem_3"), &zip(&[("config.json", "{}"), ("../x", "x")]));
    put(own("Dan_4"), &zip(&submission(&dan, "code/lib.rs", "")));
    put(at("Fay_6/a2.zip"), b"<!DOCTYPE html><html>");
    put(place.path().join("secret/src/lib.rs"), b"fn main() {}");
    symlink(place.path().join("secret"), at("Eve_5")).unwrap();
    put(at("index.html"), b"<html>");
    put(at(".DS_Store"), b"\0");
    put(at("Gil_7/onlinetext.txt"), b"I forgot");

    let out = place.path().join("out");
    let arguments = ["grade", "--held-back", "off", "--isolation", "reduced", "--output"];
    let (code, said, errors) = umbra(&arguments, &[&out, &at("")]);
    assert_eq!(code, Some(0), "{said}{errors}");
    assert!(
        said.contains("skipped, not submissions: .DS_Store, Gil_7/onlinetext.txt, index.html"),
        "{said}"
    );
    let report: Value =
        serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    let rows = report["submissions"].as_array().unwrap();
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let names: Vec<String> = rows.iter().map(|row| text(&row["name"])).collect();
    let expected =
        ["Ann_1", "Bob_2", "Cem_3", "Dan_4"].map(|n| format!("{n}_assignsubmission_file/a2.zip"));
    assert!(names[..4] == expected && names[4..] == ["Eve_5", "Fay_6/a2.zip"], "{names:?}");

    let remarks = |row: usize| {
        let remarks = rows[row]["remarks"].as_array().unwrap().iter();
        remarks.map(text).collect::<Vec<_>>().join("\n")
    };
    let codes = |row: usize| {
        let findings = rows[row]["findings"].as_array().unwrap().iter();
        findings.map(|finding| text(&finding["code"])).collect::<Vec<_>>()
    };
    // Only a compiler refuses a source.
    for (row, name) in names.iter().enumerate().skip(1) {
        assert!(!remarks(row).contains("does not build"), "{}: {}", name, remarks(row));
    }
    // Ann: a number with spaces costs nothing.
    assert_eq!(rows[0]["student"]["id"], "260000101");
    assert!(remarks(0).contains("config.json has a slip, which costs nothing: config.json:1: "));
    assert!(!remarks(0).contains("tree"), "{}", remarks(0));
    assert_eq!(codes(0).iter().filter(|code| *code == "image_unreadable").count(), 4);
    // Bob: only config.json.
    assert!(remarks(1).contains("there is no src/lib.rs"), "{}", remarks(1));
    assert!(remarks(1).contains("does not follow the tree"), "{}", remarks(1));
    // Cem: refused, for its own reason.
    assert_eq!(
        remarks(2),
        "it was not unpacked: ../x: entry name refused: expected a plain relative path, found '..' (hint: archive the \
         folder itself, without '..')"
    );
    // Dan: what --fix would do.
    assert!(
        remarks(3).contains("umbra validate --fix mends it: moves code/lib.rs to src/lib.rs"),
        "{}",
        remarks(3)
    );
    assert_eq!(codes(3).iter().filter(|code| *code == "image_empty").count(), 4);
    assert_eq!(rows[3]["student"]["first_name"], "Dan");
    // Eve: a link. Fay: no archive.
    assert!(remarks(4).contains("found a symbolic link"), "{}", remarks(4));
    assert!(remarks(5).contains("found a web page"), "{}", remarks(5));
    for row in rows {
        assert_eq!((&row["points"], &row["points_max"]), (&0.0.into(), &0.0.into()));
    }
}

#[test]
fn a_folder_without_submissions_is_an_error_and_nothing_is_written() {
    let place = tempfile::tempdir().unwrap();
    put(place.path().join("class/notes.txt"), b"x");
    let out = place.path().join("out");
    let (code, _, said) = umbra(&["grade", "--output"], &[&out, &place.path().join("class")]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains(
        "there is no submission: expected archives (.zip, .tar, .tar.gz) or folders with src/"
    ));
    assert!(said.trim_end().ends_with("it holds notes.txt"), "{said}");
    assert!(!out.exists());
}

#[test]
fn validate_and_pack_say_which_images_are_no_images() {
    let place = tempfile::tempdir().unwrap();
    let config = config("Ada", "Lampglow", "260123456");
    for (image, word) in [("", "the image is empty (0 bytes)"), ("x", "the image cannot be read: ")]
    {
        let files = submission(&config, "src/lib.rs", image);
        let archive = place.path().join("a2.zip");
        put(archive.clone(), &zip(&files));
        let (code, said, errors) = umbra(&["validate"], &[&archive]);
        assert_eq!(code, Some(0), "{said}{errors}");
        assert!(said.starts_with("a2.zip: conforms (0 errors, 4 warnings)"), "{said}");
        for path in IMAGES {
            assert!(said.contains(&format!("warning: {path}: {word}")), "{said}");
        }
        let work = place.path().join("work");
        for (path, text) in files {
            put(work.join(path), text.as_bytes());
        }
        let out = place.path().join("packed.zip");
        let (code, _, said) = umbra(&["pack"], &[&work, Path::new("--output"), &out]);
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains(&format!("warning: {}: {word}", IMAGES[0])), "{said}");
        assert!(out.is_file());
    }
}

#[test]
fn a_submission_that_is_a_link_is_refused_with_and_without_a_slash() {
    let place = tempfile::tempdir().unwrap();
    put(place.path().join("secret/src/lib.rs"), b"secret");
    put(place.path().join("secret.zip"), &zip(&[("config.json", "secret")]));
    for target in ["secret", "secret.zip"] {
        let link = place.path().join(format!("link-to-{target}"));
        symlink(place.path().join(target), &link).unwrap();
        let (code, said, _) = umbra(&["validate"], &[&link]);
        assert_eq!(code, Some(1), "{said}");
        assert!(
            said.contains("found a symbolic link") && said.contains("name what it leads to"),
            "{said}"
        );
    }
    let with_slash = place.path().join("link-to-secret").join("");
    let (_, said, _) = umbra(&["validate"], &[&with_slash]);
    assert!(said.contains("found a symbolic link"), "{said}");
}

#[test]
fn images_that_cannot_be_their_scenes_are_warned_of() {
    let place = tempfile::tempdir().unwrap();
    let work = place.path().join("work");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let film = |scene: &str| {
        let toml = format!("scenes/a2/{scene}/tinyrender/{scene}_simple_offline.toml");
        let config = basecode::scene::SceneConfig::load(&root.join(toml)).unwrap();
        (config.width, config.height)
    };
    let (width, height) = film("teapot");
    let config = config("Ada", "Lampglow", "260123456");
    for (path, text) in submission(&config, "src/lib.rs", "") {
        put(work.join(path), text.as_bytes());
    }
    let write = |path: &str, (width, height): (usize, usize), values: &[f32]| {
        let mut image = basecode::Image::new(width, height);
        image.pixels.fill(basecode::Vec3::splat(values[0]));
        image.pixels[0] = basecode::Vec3::splat(values[values.len() - 1]);
        let precision = basecode::exr_io::Precision::Half;
        basecode::exr_io::write_exr(work.join(path), &image, precision, &[]).unwrap();
    };
    write(IMAGES[0], (1, 1), &[0.5]);
    write(IMAGES[1], (width, height), &[f32::NAN]);
    write(IMAGES[2], film("cbox"), &[0.0]);
    write(IMAGES[3], (width, height), &[0.5, f32::NAN]);
    let expected = [
        format!(
            "the image is 1x1, expected {}x{}, the film of its scene",
            film("cbox").0,
            film("cbox").1
        ),
        "no pixel of the image is finite".to_owned(),
        "every pixel of the image is black".to_owned(),
        "a pixel of the image is not finite: that at (0, 0)".to_owned(),
    ];
    let (code, said, _) = umbra(&["validate"], &[&work]);
    assert_eq!(code, Some(0), "{said}");
    let out = place.path().join("out.zip");
    let (code, _, warned) = umbra(&["pack", "-o"], &[&out, &work]);
    assert_eq!(code, Some(0), "{warned}");
    for said in [said, warned] {
        for (path, expected) in IMAGES.iter().zip(&expected) {
            assert!(said.contains(&format!("{path}: {expected}")), "{said}");
        }
    }
}

#[test]
fn fix_repacks_names_with_backslashes() {
    let place = tempfile::tempdir().unwrap();
    let config = config("Ada", "Lampglow", "260123456");
    let files = submission(&config, "src/lib.rs", "x");
    let backslash = |path: &str| path.replace('/', "\\");
    let entries =
        files.iter().map(|(path, text)| Entry::deflated(&backslash(path), text.as_bytes()));
    let (archive, out) = (place.path().join("ps5.zip"), place.path().join("out.zip"));
    put(archive.clone(), &Zip::of(entries).bytes());
    let (code, said, errors) = umbra(&["validate", "--fix"], &[&out, &archive]);
    assert_eq!(code, Some(0), "{said}{errors}");
    assert!(said.contains("warning: names with a backslash between folders"), "{said}");
    let (code, said, _) = umbra(&["validate"], &[&out]);
    assert_eq!(code, Some(0));
    assert!(!said.contains("backslash"), "{said}");
}

#[test]
fn what_cannot_be_packed_or_written_is_named_with_its_reason() {
    let place = tempfile::tempdir().unwrap();
    put(place.path().join("file"), b"x");
    let at = |name: &str| place.path().join(name);
    for (folder, expected) in
        [("gone", "gone does not exist"), ("file", "is a file, expected your")]
    {
        let (code, _, said) = umbra(&["pack"], &[&at(folder)]);
        assert!(code == Some(2) && said.contains(expected), "{said}");
        let (code, _, said) = umbra(&["check"], &[&at(folder)]);
        let expected = expected.replace("a file, expected your", "no archive, expected your");
        assert!(code == Some(2) && said.contains(&expected), "{said}");
        assert!(!said.contains("compil"), "it is said before any work: {said}");
    }
    let (code, _, said) = umbra(&["check", "--part", "2.6"], &[place.path()]);
    assert!(code == Some(2) && said.starts_with("umbra: there is no part 2.6"), "{said}");
}

#[test]
fn fix_writes_a_new_zip_and_nothing_else() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let config = config("Ada", "Lampglow", "260123456");
    let files = submission(&config, "code/lib.rs", "x");
    put(at("mine.zip"), &zip(&files));
    put(at("thesis.txt"), b"precious");
    for (path, text) in &files {
        put(at("wd").join(path), text.as_bytes());
    }
    symlink(at("mine.zip"), at("link.zip")).unwrap();
    symlink(at("nowhere"), at("dangling.zip")).unwrap();
    for (input, out, said) in [
        ("mine.zip", "mine.zip", "is there already"),
        ("mine.zip", "link.zip", "is there already"),
        ("mine.zip", "dangling.zip", "is there already"),
        ("mine.zip", "thesis.txt", "is there already"),
        ("mine.zip", "wd", "is there already"),
        ("wd", "wd/code/lib.rs", "is there already"),
        ("wd", "wd/new.zip", "lies inside"),
        ("wd", "wd/../wd/code/new.zip", "lies inside"),
        ("mine.zip", "out.tar.gz", "ends in .zip"),
        ("mine.zip", "out", "ends in .zip"),
        ("mine.zip", "nonexist/out.zip", "nonexist/out.zip: there is no folder"),
    ] {
        let before: Vec<_> = crate::support::scratch::listing(place.path()).into_iter().collect();
        let (code, _, errors) = umbra(&["validate"], &[&at(input), Path::new("--fix"), &at(out)]);
        assert!(code == Some(2) && errors.contains(said), "{input} {out}: {errors}");
        let after: Vec<_> = crate::support::scratch::listing(place.path()).into_iter().collect();
        assert!(before == after, "{input} {out}");
    }
    // A download with one archive is that archive, as is a folder that holds one.
    let own = zip(&files);
    let download =
        [Entry::stored("a2/a2_ada.zip", &own), Entry::stored("__MACOSX/a2/._a2_ada.zip", b"x")];
    put(at("m.zip"), &Zip::of(download).bytes());
    put(at("one/a2_ada.zip"), &own);
    for (input, out) in
        [("mine.zip", "1.zip"), ("m.zip", "2.zip"), ("one", "3.zip"), ("wd", "4.zip")]
    {
        let (code, said, errors) =
            umbra(&["validate"], &[&at(input), Path::new("--fix"), &at(out)]);
        assert!(
            code == Some(1) && said.contains("moved code/lib.rs to src/lib.rs"),
            "{said}{errors}"
        );
        let (code, said, _) = umbra(&["validate"], &[&at(out)]);
        assert_eq!(code, Some(0), "{said}");
    }
    // Nor does pack write over what is no archive.
    let work = at("work");
    for (path, text) in submission(&config, "src/lib.rs", "x") {
        put(work.join(path), text.as_bytes());
    }
    let (code, _, errors) = umbra(&["pack"], &[&work, Path::new("--output"), &at("thesis.txt")]);
    assert!(code == Some(2) && errors.contains("no zip archive"), "{errors}");
    assert_eq!(fs::read(at("thesis.txt")).unwrap(), b"precious");
}

/// What is renamed onto a device would take its place.
#[cfg(unix)]
#[test]
fn an_archive_is_not_written_over_what_is_no_file() {
    let place = tempfile::tempdir().unwrap();
    let config = config("Ada", "Lampglow", "260123456");
    put(place.path().join("a.zip"), &zip(&submission(&config, "src/lib.rs", "x")));
    let fifo = place.path().join("fifo.zip");
    nix::unistd::mkfifo(&fifo, nix::sys::stat::Mode::from_bits_truncate(0o600)).unwrap();
    let archive = place.path().join("a.zip");
    let (code, _, said) = umbra(&["validate"], &[&archive, Path::new("--fix"), &fifo]);
    assert!(code == Some(2) && said.contains("fifo.zip is there already"), "{said}");
    use std::os::unix::fs::FileTypeExt as _;
    assert!(fifo.symlink_metadata().unwrap().file_type().is_fifo());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_under_standard_output_is_no_bug() {
    for arguments in [&["explain"][..], &["completions", "bash"]] {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let run = Command::new(env!("CARGO_BIN_EXE_umbra")).args(arguments).stdout(full).output();
        let run = run.unwrap();
        let said = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(3), "{said}");
        assert!(
            said.starts_with("umbra: cannot write to standard output: No space left"),
            "{said}"
        );
    }
}
