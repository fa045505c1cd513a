//! What learning platforms give: bulk downloads as they name them, class lists, attempts and lateness, through the
//! real binary, which grades none of the sources: they do not compile.

#![cfg(unix)]

mod decisions;
mod grade_books;
mod platforms;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use similar_asserts::assert_eq;

use crate::support::one_scene;
use crate::support::zip_bytes::{Entry, Zip};

/// A submission of somebody: a zip that follows the tree, but for its images, and does not compile.
pub fn submission(config: &str) -> Vec<u8> {
    let images = ["cbox_simple_offline", "teapot_simple_offline"]
        .map(|name| format!("offline/{name}.exr"))
        .into_iter()
        .chain(
            ["cbox_simple_realtime", "teapot_simple_realtime"]
                .map(|name| format!("realtime/{name}.exr")),
        );
    let mut files = vec![
        ("config.json".to_owned(), config.as_bytes()),
        ("src/lib.rs".to_owned(), b"fn main() { not_rust }".as_slice()),
    ];
    files.extend(images.map(|path| (path, b"x".as_slice())));
    zip(&files)
}

pub fn zip(files: &[(String, &[u8])]) -> Vec<u8> {
    Zip::of(files.iter().map(|(path, bytes)| Entry::deflated(path, bytes))).bytes()
}

pub fn config(first: &str, last: &str, number: &str) -> String {
    format!(
        r#"{{"firstName": "{first}", "lastName": "{last}", "studentID": "{number}", "renders": []}}"#
    )
}

/// A place with a download, an assignment with a late policy, and a report.
pub struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn put(&self, name: &str, bytes: &[u8]) {
        let path = self.at(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }

    /// The repository's assignment on one scene, with a late policy.
    pub fn assignment(&self, late: &str) -> PathBuf {
        let late = serde_json::from_str::<Value>(late).unwrap();
        one_scene(&self.at("assignment"), |config| config["late"] = late.clone())
    }

    pub fn run(&self, arguments: &[&str]) -> (Option<i32>, String, String) {
        let output = Command::new(env!("CARGO_BIN_EXE_umbra"))
            .args(arguments)
            .current_dir(self.folder.path())
            .env("COLUMNS", "400")
            .output()
            .unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    }

    /// Runs it as under `| head -0`, standard error included; the signal that it ends by.
    pub fn run_unread(&self, arguments: &[&str]) -> Option<i32> {
        use std::os::unix::process::ExitStatusExt as _;
        let (reader, writer) = std::io::pipe().unwrap();
        let mut umbra = Command::new(env!("CARGO_BIN_EXE_umbra"));
        umbra.args(arguments).current_dir(self.folder.path());
        umbra.stdout(writer.try_clone().unwrap()).stderr(writer);
        drop(reader);
        umbra.status().unwrap().signal()
    }

    /// Grades into `out`, and answers what is said and `report.json`.
    pub fn grade(&self, root: &Path, arguments: &[&str]) -> (String, Value) {
        self.grade_to(Some(0), root, arguments)
    }

    /// The same with another exit code.
    pub fn grade_to(
        &self,
        expected: Option<i32>,
        root: &Path,
        arguments: &[&str],
    ) -> (String, Value) {
        let fixed = ["--held-back", "off", "--isolation", "reduced", "--output", "out", "--root"];
        let mut all = vec!["grade"];
        all.extend(fixed);
        let root = root.to_str().unwrap();
        all.push(root);
        all.extend(arguments);
        let (code, said, errors) = self.run(&all);
        assert_eq!(code, expected, "{said}{errors}");
        let report = fs::read(self.at("out/report.json")).unwrap();
        (said + &errors, serde_json::from_slice(&report).unwrap())
    }

    fn validate(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let root = root_of_repository();
        let mut all = vec!["validate", "--root", root.to_str().unwrap()];
        all.extend(arguments);
        let (code, said, errors) = self.run(&all);
        (code, said + &errors)
    }
}

fn root_of_repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

pub fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

/// Of each submission in a report: its name, whose it is by the class list, and its remarks.
pub fn rows(report: &Value) -> Vec<(String, String, String)> {
    let rows = report["submissions"].as_array().unwrap().iter();
    let row = |row: &Value| {
        let remarks = row["remarks"].as_array().unwrap().iter().map(text).collect::<Vec<_>>();
        (
            text(&row["name"]).to_owned(),
            text(&row["standing"]["student"]["number"]).to_owned(),
            remarks.join("\n"),
        )
    };
    rows.map(row).collect()
}

/// The download of a class on Brightspace, as the platform names it.
pub fn brightspace() -> Vec<(String, Vec<u8>)> {
    let folder = |id: u32, name: &str, when: &str| format!("{id}-5150 - {name} - Oct {when}");
    vec![
        ("index.html".to_owned(), b"<html>".to_vec()),
        // A number with a zero in front, a name with accents, an apostrophe and a comma on the list.
        (
            folder(101, "Zoë O'Neil", "6, 2019 1158 PM/a2_zoë_o'neil.zip"),
            submission(&config("Zoe", "ONeil", "0260000001")),
        ),
        // Two attempts, the second one late; `firstlast` in the configuration.
        (folder(102, "Bo Ode", "6, 2019 1000 PM/a2.zip"), submission("{}")),
        (
            folder(102, "Bo Ode", "8, 2019 110 AM/a2.zip"),
            submission(r#"{"firstlast": "Bo Ode", "studentID": 260000002, "renders": []}"#),
        ),
        // Two students of one name: the number tells.
        (
            folder(103, "Ann Lee", "6, 2019 800 PM/a2.zip"),
            submission(&config("Ann", "Lee", "260000004")),
        ),
        (
            folder(104, "Ann Lee", "6, 2019 900 PM/a2.zip"),
            submission(&config("Ann", "Lee", "260000003")),
        ),
        // Nothing in it but a note; nothing at all.
        (folder(105, "Cy Poe", "6, 2019 700 PM/notes.txt"), b"sorry".to_vec()),
        (folder(106, "Di Rue", "6, 2019 700 PM/"), Vec::new()),
        // Of another course, by somebody who is not in this one.
        (
            folder(107, "Max Other", "6, 2019 600 PM/cs101_hw3.zip"),
            zip(&[("main.py".to_owned(), b"print()".as_slice())]),
        ),
        // An archive without a byte.
        (folder(108, "Eve Sol", "6, 2019 500 PM/a2.zip"), Vec::new()),
    ]
}

pub const LIST: &str = "\u{feff}OrgDefinedId,Username,Last Name,First Name,Email,End-of-Line Indicator\r\n\
    #0260000001,#zoneil,\"O'Neil, \",Zoë,z@example.org,#\r\n#260000002,#bode,Ode,Bo,b@example.org,#\r\n\
    #260000003,#alee,Lee,Ann,a@example.org,#\r\n#260000004,#alee2,Lee,Ann,a2@example.org,#\r\n\
    #260000005,#cpoe,Poe,Cy,c@example.org,#\r\n#260000006,#drue,Rue,Di,d@example.org,#\r\n\
    #260000007,#gtam,Tam,Gil,g@example.org,#\r\n#260000008,#esol,Sol,Eve,e@example.org,#\r\n";

pub const LATE: &str =
    r#"{"penalty": 10, "unit": "percent", "of": "maximum", "per": "day", "grace_min": 5}"#;
