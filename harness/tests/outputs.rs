//! Where commands write: never into a submission that they read, never over a file that they read.

#![cfg(unix)]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use basecode::exr_io::{Precision, write_exr};
use basecode::{Image, Vec3};

use crate::support::scratch::listing;

/// Runs umbra in a folder: exit code, standard output and error.
fn umbra(folder: &Path, line: &[&str]) -> (Option<i32>, String, String) {
    let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
        .current_dir(folder)
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .args(line)
        .args(["--root", concat!(env!("CARGO_MANIFEST_DIR"), "/..")])
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (run.status.code(), text(&run.stdout), text(&run.stderr))
}

fn put(path: &Path, text: &str) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

const IMAGES: [&str; 4] = [
    "offline/teapot_simple_offline.exr",
    "offline/cbox_simple_offline.exr",
    "realtime/teapot_simple_realtime.exr",
    "realtime/cbox_simple_realtime.exr",
];

/// A working folder that can be packed.
fn work(folder: &Path) {
    let renders = IMAGES.map(|path| format!("{{\"scene\": \"x\", \"render\": \"{path}\"}}"));
    let config = format!(
        "{{\n  \"firstName\": \"Ada\",\n  \"lastName\": \"Lampglow\",\n  \"studentID\": \"260123456\",\n  \
         \"renders\": [{}]\n}}\n",
        renders.join(", ")
    );
    put(&folder.join("config.json"), &config);
    put(&folder.join("src/lib.rs"), "fn main() {}");
    for path in IMAGES {
        put(&folder.join(path), "");
        let image = Image { width: 4, height: 4, pixels: vec![Vec3::ONE; 16] };
        write_exr(folder.join(path), &image, Precision::Half, &[]).unwrap();
    }
}

/// A report, as far as it is known by its files.
fn report(folder: &Path) {
    for file in ["report.html", "report.json", "grades.csv", "a/report.html", "a/x.png", "a/y.rs"] {
        put(&folder.join(file), "{}");
    }
}

#[test]
fn nothing_is_written_into_a_submission_that_is_read() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    work(&at("mine"));
    fs::create_dir(at("class")).unwrap();
    work(&at("class/ann"));
    let before: BTreeMap<PathBuf, _> = listing(place.path());
    for line in [
        "check mine --report mine",
        "check mine --report mine/src",
        "check mine --report mine/new",
        "check mine --report mine/src/umbra-reports",
        // The report's folder of `mine` would be `mine` itself.
        "check mine --report .",
        "watch mine --report mine/src",
        "watch mine --report .",
        "grade mine --report mine/offline",
        "grade class --report class/ann/src --held-back off",
        "grade class --report class --held-back off",
        "pack mine -o mine/a.zip",
        "pack mine -o mine",
        "pack mine -o mine/../mine/src/a.zip",
        "validate mine --fix mine/a.zip",
    ] {
        let (code, out, said) = umbra(place.path(), &line.split(' ').collect::<Vec<_>>());
        assert_eq!(code, Some(2), "{line}: {out}{said}");
        assert!(said.contains("which is to be read; hint: "), "{line}: {said}");
        assert!(!said.contains("compil"), "{line}: it is said before any mine: {said}");
        assert!(before == listing(place.path()), "{line} wrote something");
    }
    // Whoever stands in the folder has the archive beside it.
    let (code, out, said) = umbra(&at("mine"), &["pack", "."]);
    assert!(code == Some(0) && out.contains("a2_ada_lampglow.zip"), "{out}{said}");
    assert!(at("a2_ada_lampglow.zip").is_file());
    assert!(!at("mine/a2_ada_lampglow.zip").exists());
}

#[test]
fn a_report_of_umbra_s_is_named_once_or_not_at_all() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    work(&at("work"));
    report(&at("work/umbra-report"));
    report(&at("work/old"));
    let (code, said, _) = umbra(&at("work"), &["validate", "."]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("warning: old/: a report of Umbra's"), "{said}");
    assert!(!said.contains("report.html") && !said.contains("x.png"), "{said}");
    assert!(!said.contains("warning: umbra-report"), "{said}");
    let (code, archive, _) = umbra(place.path(), &["pack", "work"]);
    assert_eq!(code, Some(0));
    let bytes = fs::read(at(archive.trim())).unwrap();
    let mut packed = zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let names: Vec<String> = packed.file_names().map(|name| name.unwrap().into_owned()).collect();
    assert_eq!(names.len(), 6, "{names:?}");
    assert!(packed.by_name("src/lib.rs").is_ok());

    // Among submissions likewise.
    fs::create_dir(at("class")).unwrap();
    fs::rename(at("work"), at("class/work")).unwrap();
    report(&at("class/r1"));
    report(&at("class/umbra-report"));
    let (_, said, _) = umbra(place.path(), &["validate", "class", "a2_ada_lampglow.zip"]);
    assert!(said.contains("r1/ (a report of Umbra's), umbra-report\n"), "{said}");
}

#[test]
fn a_working_folder_is_not_warned_of_the_template_s_own_files() {
    let place = tempfile::tempdir().unwrap();
    work(&place.path().join("work"));
    for file in ["Cargo.toml", "Cargo.lock", "README.md", "tests/bsdfs.rs", "notes.txt", "more.rs"]
    {
        put(&place.path().join("work").join(file), "x");
    }
    let (code, said, _) = umbra(place.path(), &["validate", "work"]);
    assert_eq!(code, Some(0), "{said}");
    let warned: Vec<&str> = said.lines().filter(|line| line.starts_with("warning: ")).collect();
    assert_eq!(warned.iter().filter(|line| !line.contains(".exr")).count(), 2, "{said}");
    for file in ["warning: notes.txt", "warning: more.rs", "note: tests/bsdfs.rs: of the template"]
    {
        assert!(said.contains(file), "{file}: {said}");
    }
}

#[test]
fn the_folder_above_a_working_folder_is_packed_as_it_is_checked() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    work(&at("par/deep/work"));
    put(&at("par/config.json"), "{}");
    let (code, out, said) = umbra(place.path(), &["pack", "par"]);
    assert_eq!(code, Some(0), "{out}{said}");
    assert!(said.contains("umbra: packing par/deep/work\n"), "{said}");
    assert!(at("a2_ada_lampglow.zip").is_file());
    work(&at("par/other"));
    let (code, _, said) = umbra(place.path(), &["pack", "par"]);
    assert!(code == Some(2) && said.contains("deep/work and other"), "{said}");
    fs::create_dir_all(at("none/at/all")).unwrap();
    let (code, _, said) = umbra(place.path(), &["pack", "none"]);
    assert!(code == Some(2) && said.contains("neither config.json nor src/"), "{said}");
}

#[test]
fn no_output_takes_the_place_of_an_input() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    put(
        &at("s.toml"),
        "[input]\nobjfile = \"s.obj\"\n[camera]\neye = [0.0, 3.0, 4.0]\nat = [0.0, 0.0, 0.0]\n\
         up = [0.0, 1.0, 0.0]\nfov = 50.0\n[film]\nwidth = 8\nheight = 6\n[renderer]\nspp = 1\n",
    );
    put(
        &at("s.obj"),
        "mtllib m.mtl\nv -2 0 2\nv 2 0 2\nv 2 0 -2\nv 0 2 0\nv 0.1 2 0\nv 0 2 0.1\nvt 0 0\n\
         usemtl floor\nf 1/1 2/1 3/1\nusemtl light\nf 4 5 6\n",
    );
    put(
        &at("m.mtl"),
        "newmtl floor\nillum 7\nKd 1 1 1\nmap_Kd t.png\nnewmtl light\nillum 7\nKd 0 0 0\nKe 20 20 20\n",
    );
    fs::write(at("t.png"), include_bytes!("golden/noise.png")).unwrap();
    for (name, value) in [("a.exr", 0.25), ("b.exr", 0.5)] {
        let image = Image { width: 2, height: 2, pixels: vec![Vec3::splat(value); 4] };
        write_exr(at(name), &image, Precision::Float, &[]).unwrap();
    }
    fs::create_dir(at("page")).unwrap();
    fs::copy(at("a.exr"), at("page/view.html")).unwrap();
    fs::copy(at("a.exr"), at("page/expected.png")).unwrap();
    std::os::unix::fs::symlink(at("t.png"), at("link.png")).unwrap();
    fs::hard_link(at("t.png"), at("hard.png")).unwrap();
    put(&at("r/grades.csv"), "Student ID,Name\n260123456,Ada\n");
    work(&at("work"));
    let before: BTreeMap<PathBuf, _> = listing(place.path());
    for (line, code) in [
        ("render s.toml --plugin reference -o t.png", 2),
        ("render s.toml --plugin reference -o link.png", 2),
        ("render s.toml --plugin reference -o hard.png", 2),
        ("compare --idiff -o a.exr a.exr b.exr", 4),
        ("compare --idiff -o ./b.exr a.exr b.exr", 4),
        ("compare page/view.html b.exr --html page", 2),
        ("compare a.exr page/expected.png --pictures page", 2),
        ("view page/view.html b.exr -o page", 2),
        ("grade work --class r/grades.csv --report r --held-back off", 2),
    ] {
        // The root goes before what idiff takes.
        let mut words: Vec<&str> = line.split(' ').collect();
        let run = if line.contains("--idiff") {
            words.splice(0..0, ["--root", "."]);
            let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
                .current_dir(place.path())
                .args(&words)
                .output()
                .unwrap();
            (run.status.code(), String::from_utf8_lossy(&run.stderr).into_owned())
        } else {
            let (code, _, said) = umbra(place.path(), &words);
            (code, said)
        };
        assert_eq!(run.0, Some(code), "{line}: {}", run.1);
        assert!(run.1.contains("so it is not written over; hint: "), "{line}: {}", run.1);
        assert!(before == listing(place.path()), "{line} wrote something");
    }
}

#[test]
fn a_path_that_cannot_be_used_is_the_command_line_s_matter() {
    let place = tempfile::tempdir().unwrap();
    work(&place.path().join("work"));
    let (code, out, said) = umbra(place.path(), &["check", "work", "--report", "/proc/x"]);
    assert!(code == Some(2) && out.is_empty(), "{said}");
    assert!(said.starts_with("umbra: cannot write to /proc/x: there is no such file"), "{said}");
    assert_eq!(said.lines().count(), 1, "it is said before any work: {said}");
    let (code, _, said) = umbra(place.path(), &["check", "/dev/null"]);
    assert!(code == Some(2) && said.contains("/dev/null is a pipe or device"), "{said}");
    let (code, _, said) = umbra(place.path(), &["explain", "nonsense"]);
    assert!(code == Some(2) && !said.contains("did you mean"), "{said}");
}

#[test]
fn a_broken_config_is_told_by_the_place_where_it_breaks() {
    let place = tempfile::tempdir().unwrap();
    let config = place.path().join("work/config.json");
    work(&place.path().join("work"));
    let cut = "{\n  \"firstName\": \"Ada\",\n  \"lastName\": \"Lampgl";
    fs::write(&config, cut).unwrap();
    let (code, said, _) = umbra(place.path(), &["validate", "work"]);
    assert_eq!(code, Some(1), "{said}");
    let error = "error: config.json:3: the text has no closing quote on its line; so no \"studentID\" is found";
    assert!(said.contains(error), "{said}");
    assert!(!said.contains("is missing"), "{said}");
}

#[test]
fn what_is_wrong_in_the_assignment_is_told_without_rust_s_words() {
    let place = tempfile::tempdir().unwrap();
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config.json");
    let own: serde_json::Value = serde_json::from_slice(&fs::read(own).unwrap()).unwrap();
    for (key, value, expected) in [
        ("late_days", "-1", "expected a whole number, 0 or more; found -1"),
        ("late_days", "1.5", "expected a whole number, 0 or more; found 1.5"),
        (
            "cut_off",
            "\"2030-01-01T10:00\"",
            "late.cut_off: expected a date such as \"2019-10-06T23:59:00-04:00\", found \"2030-01-01T10:00\" (without an \
             offset from UTC)",
        ),
    ] {
        let mut config = own.clone();
        config["late"] = serde_json::json!({"penalty": 1, "unit": "points", "per": "day"});
        config["late"][key] = serde_json::from_str(value).unwrap();
        put(&place.path().join("config.json"), &config.to_string());
        let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
            .args(["explain", "1.1", "--root"])
            .arg(place.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(run.status.code() == Some(2) && said.contains(expected), "{said}");
    }
}

#[test]
fn a_page_that_compares_names_both_files() {
    let place = tempfile::tempdir().unwrap();
    for (name, value) in [("one/r.exr", 0.25), ("two/r.exr", 0.5)] {
        put(&place.path().join(name), "");
        let image = Image { width: 2, height: 2, pixels: vec![Vec3::splat(value); 4] };
        write_exr(place.path().join(name), &image, Precision::Float, &[]).unwrap();
    }
    let (code, _, said) =
        umbra(place.path(), &["compare", "one/r.exr", "two/r.exr", "--html", "page"]);
    assert_eq!(code, Some(1), "{said}");
    let page = fs::read_to_string(place.path().join("page/view.html")).unwrap();
    let title = "<title>actual one/r.exr and expected two/r.exr</title>";
    assert!(page.contains(title), "{}", &page[..2000]);
    assert!(page.contains("\"actual one/r.exr - expected two/r.exr\""));
}
