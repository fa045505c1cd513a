//! Appeals, through the real binary: the defence of a grade, a fix of a line by the instructor, and the release of what
//! was held back.

#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use similar_asserts::assert_eq;

use crate::support::{copy_folder, one_scene};

/// A forgotten semicolon costs two parts: the file does not compile.
const RIGHT: &str =
    "    let incident = scene.first_light_intensity() / to_light.length_squared();\n";
const PATCH: &str = "--- a/src/integrators/simple.rs\n+++ b/src/integrators/simple.rs\n@@ -26,3 +26,3 @@\n     \
                     i.wi = i.frame_ns.to_local(to_light.normalize());\n\
                     -    let incident = scene.first_light_intensity() / to_light.length_squared()\n\
                     +    let incident = scene.first_light_intensity() / to_light.length_squared();\n     \
                     // eval() holds the cosine already.\n";

struct Place {
    folder: tempfile::TempDir,
    root: PathBuf,
}

impl Place {
    /// A submission that follows the tree and is right, but for one sign.
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let submission = folder.path().join("class/a2_ada");
        for source in ["student_template/src", "samples/perfect/src"] {
            copy_folder(&own.join(source), &submission.join("src"));
        }
        let path = submission.join("src/integrators/simple.rs");
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(RIGHT));
        fs::write(path, text.replace(RIGHT, &RIGHT.replace(";\n", "\n"))).unwrap();
        let config = r#"{"firstName": "Ada", "lastName": "Lampglow", "studentID": "260181512", "renders": []}"#;
        fs::write(submission.join("config.json"), config).unwrap();
        for image in ["offline/cbox_simple_offline", "offline/teapot_simple_offline"]
            .into_iter()
            .chain(["realtime/cbox_simple_realtime", "realtime/teapot_simple_realtime"])
        {
            let path = submission.join(format!("{image}.exr"));
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "x").unwrap();
        }
        let root = folder.path().join("assignment");
        let place = Self { folder, root };
        place.assignment("2999-01-01T00:00:00Z");
        place
    }

    /// The repository's assignment on one scene, where a fix costs ten points.
    fn assignment(&self, cut_off: &str) {
        one_scene(&self.root, |config| {
            config["mend"] = serde_json::json!({"lines": 2, "penalty": 10});
            config["late"] = serde_json::json!({
                "penalty": 1, "unit": "points", "per": "day", "cut_off": cut_off,
            });
        });
    }

    fn run(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let output = Command::new(env!("CARGO_BIN_EXE_umbra"))
            .args(arguments)
            .args(["--output", "out", "--root"])
            .arg(&self.root)
            .current_dir(self.folder.path())
            .env("COLUMNS", "400")
            .output()
            .unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout) + &text(&output.stderr))
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.folder.path().join(name)).unwrap()
    }

    /// The first submission of the report.
    fn row(&self) -> Value {
        let report: Value = serde_json::from_str(&self.read("out/report.json")).unwrap();
        report["submissions"][0].clone()
    }
}

#[test]
fn a_grade_is_defended_mended_and_what_was_held_back_released() {
    let place = Place::new();
    fs::create_dir_all(place.folder.path().join("out/instructor")).unwrap();
    // The seed that other suites use too.
    fs::write(place.folder.path().join("out/instructor/held-back-seed.txt"), "20191006\n").unwrap();
    // Nobody asks for the bonus on this scene: its points are a range.
    let (code, said) = place.run(&["grade", "class", "--isolation", "reduced"]);
    assert_eq!(code, Some(3), "{said}");
    let before = place.row();
    let points = before["points"].as_f64().unwrap();
    assert_eq!(before["parts"][2]["points"], 0.0, "{said}");
    assert_eq!(points, 65.0, "{said}");

    let (code, said) = place.run(&["defend", "260181512", "1.3"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.starts_with("1.3 Unshadowed direct illumination: 0 of 20 points\nAda Lampglow"),
        "{said}"
    );
    for words in [
        "What decided\n",
        "(not implemented)",
        "umbra check DIR --part 1.3",
        "--held-back 20191006 --report ANOTHER",
        "held back from the student until `umbra release`",
        "(at most 2 lines, less 10 points), never fewer",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }

    // A fix of somebody else's file, and one of too many lines.
    let file = place.folder.path().join("fix.patch");
    let mend = ["mend", "260181512", "fix.patch", "--reason", "a semicolon", "--by", "Eve"];
    for (text, expected) in [
        (PATCH.replace("simple.rs", "none.rs"), "which the submission does not have"),
        (PATCH.replace("+26,3", "+26,5") + "+x\n+y\n", "changes 3 lines; expected at most 2"),
    ] {
        fs::write(&file, text).unwrap();
        let (code, said) = place.run(&[&mend[..], &["--isolation", "reduced"]].concat());
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(expected), "{said}");
    }
    fs::write(&file, PATCH).unwrap();
    let (code, said) = place.run(&[&mend[..], &["--isolation", "reduced"]].concat());
    assert_eq!(code, Some(0), "{said}");
    let after = place.row();
    assert_eq!(after["parts"][2]["points"], 20.0, "{said}");
    let mended = &after["standing"]["mended"];
    let full = mended["after"][0].as_f64().unwrap();
    assert!(full > points, "{said}");
    // All other parts count as they are now, and the penalty is taken from the whole.
    let parts = after["parts"].as_array().unwrap().iter();
    let sum: f64 = parts.map(|part| part["points"].as_f64().unwrap()).sum();
    let total = after["points"].as_f64().unwrap();
    assert!((total - (sum - 10.0)).abs() < 0.006, "{total} {sum}");
    let words = "mended by the instructor, 1 line, less 10 points: ";
    assert!(said.contains(words), "{said}");
    for page in ["out/a2_ada/report.html", "out/instructor/a2_ada/report.html"] {
        let page = place.read(page);
        assert!(page.contains(words) && page.contains("a semicolon (Eve, 2"), "{page}");
        assert!(page.contains("to_light.length_squared()\n+"), "{page}");
        assert!(page.contains("is of the source as it was submitted"), "{page}");
    }
    let page = place.read("out/instructor/a2_ada/report.html");
    assert!(page.contains("href=\"mended/report.html\""), "{page}");
    assert!(place.read("out/instructor/a2_ada/mended/report.html").contains("Lampglow"));
    assert!(!place.read("out/a2_ada/report.html").contains("mended/report.html"));
    // A part set by hand takes the place of what the fix shows.
    let (code, said) = place.run(&["override", "260181512", "1.3", "12", "--reason", "half"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("now has 12 points; the evidence gives 20"), "{said}");
    let decided = &place.row()["standing"]["decisions"][0];
    assert_eq!(decided["before"], serde_json::json!([20.0, 20.0]));
    let (code, said) = place.run(&["regrade", "--undo"]);
    assert_eq!(code, Some(0), "{said}");
    // Graded again the fix is there; another submission makes it stale.
    let (code, said) = place.run(&["grade", "class", "--isolation", "reduced"]);
    assert_eq!((code, &place.row()), (Some(3), &after), "{said}");

    let (code, said) = place.run(&["release"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("nothing is released before 2998-12-31 20:00 -04:00"), "{said}");
    place.assignment("2019-10-10T00:00:00Z");
    let (code, said) = place.run(&["regrade", "--apply", "--reason", "the cut-off was a slip"]);
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = place.run(&["release"]);
    assert_eq!(code, Some(0), "{said}");
    let scenes = fs::File::open(place.folder.path().join("out/held-back-scenes.zip")).unwrap();
    let scenes = zip::ZipArchive::new(scenes).unwrap();
    let names: Vec<String> = scenes.file_names().map(|name| name.unwrap().into_owned()).collect();
    assert!(names.iter().any(|name| name.starts_with("held-back-1/tinyrender/")), "{names:?}");
    assert!(place.read("out/a2_ada/report.html").contains("are released, each a changed copy"));

    fs::write(place.folder.path().join("class/a2_ada/src/other.rs"), "// new\n").unwrap();
    let (_, said) = place.run(&["grade", "class", "--isolation", "reduced"]);
    assert_eq!(place.row()["points"].as_f64(), Some(points), "{said}");
    let (code, said) = place.run(&["status"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("was of another submission and does not count"), "{said}");

    // What the instructor gives does not hide what was wrong.
    let set = ["override", "260181512", "1.3", "20", "--reason", "a semicolon", "--by", "Eve"];
    let (code, said) = place.run(&set);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(place.row()["parts"][2]["points"], 20.0, "{said}");
    for page in ["out/a2_ada/report.html", "out/instructor/a2_ada/report.html"] {
        let page = place.read(page);
        assert!(page.contains("id=\"part-1.3\""), "{page}");
        let right = page.split(" right: ").nth(1).and_then(|rest| rest.split('<').next());
        assert!(right.is_some_and(|right| !right.contains("1.3")), "{right:?}");
    }
}
