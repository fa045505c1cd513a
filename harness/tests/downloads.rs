//! What learning platforms give: bulk downloads as they name them, class lists, attempts and lateness, through the
//! real binary, which grades none of the sources: they do not compile.

#![cfg(unix)]

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
        let fixed = ["--perturb", "off", "--isolation", "reduced", "--output", "out", "--root"];
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

#[test]
fn grades_go_back_where_the_class_list_came_from() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let files = brightspace();
    let entries: Vec<(String, &[u8])> =
        files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
    place.put("Lab 02 Download Oct 9, 2019 905 AM.zip", &zip(&entries));
    place.put("list.csv", LIST.as_bytes());
    let download = "Lab 02 Download Oct 9, 2019 905 AM.zip";
    let also = ["--class", "list.csv", "--export", "feedback", "--export", "brightspace"];
    place.grade(&root, &[&[download][..], &also].concat());
    let book = fs::read_to_string(place.at("out/brightspace.csv")).unwrap();
    assert!(book.starts_with("OrgDefinedId,Username,a2 Points Grade,End-of-Line"), "{book}");
    let root = root.to_str().unwrap().to_owned();
    // What cannot be exported is said before any work.
    let other = ["grade", download, "--root", &root, "--class", "list.csv", "--export", "canvas"];
    let (code, _, errors) = place.run(&[&other[..], &["--output", "other"]].concat());
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("expected the export of Canvas"), "{errors}");
    assert!(!place.at("other").exists());
    // Feedback in the folders of the download: each student's own page, and nothing else.
    let open = |bytes: Vec<u8>| zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let mut feedback = open(fs::read(place.at("out/feedback.zip")).unwrap());
    let names: Vec<String> = feedback.file_names().map(|name| name.unwrap().into_owned()).collect();
    assert_eq!(names.len(), 5, "{names:?}");
    let own = "101-5150 - Zoë O'Neil - Oct 6, 2019 1158 PM/feedback.zip";
    assert!(names.iter().any(|name| name == own), "{names:?}");
    assert!(!names.iter().any(|name| name.contains("Max Other")), "{names:?}");
    let mut bytes = Vec::new();
    std::io::Read::read_to_end(&mut feedback.by_name(own).unwrap(), &mut bytes).unwrap();
    let inner = open(bytes);
    let names: Vec<String> = inner.file_names().map(|name| name.unwrap().into_owned()).collect();
    assert_eq!(names, ["report.html"]);
    let export = |format: &str, more: &[&str]| {
        let mut all =
            vec!["export", "grades", "--output", "out", "--root", &root, "--format", format];
        all.extend(more);
        let (code, said, errors) = place.run(&all);
        (code, said + &errors, fs::read_to_string(place.at("grades")).unwrap_or_default())
    };
    let (code, said, book) = export("brightspace", &["--item", "A2, lights"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("grades: 4 grades for Brightspace"), "{said}");
    assert!(
        said.contains("107-5150 - Max Other - Oct 6, 2019 600 PM/cs101_hw3.zip: not decided yet"),
        "{said}"
    );
    // The platform's own columns and keys, zeros in front too; nobody who is missing.
    assert_eq!(
        book,
        "OrgDefinedId,Username,\"A2, lights Points Grade\",End-of-Line Indicator\n\
         #0260000001,#zoneil,0.00,#\n#260000002,#bode,0.00,#\n#260000004,#alee2,0.00,#\n\
         #260000003,#alee,0.00,#\n"
    );
    let (code, said, _) = export("canvas", &[]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("expected the export of Canvas, found that of Brightspace"), "{said}");

    let (code, said, _) = export("gradescope", &[]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("takes one submission at a time, and there are 6"), "{said}");
    let report: Value =
        serde_json::from_slice(&fs::read(place.at("out/report.json")).unwrap()).unwrap();
    let slug = text(&report["submissions"][0]["slug"]).to_owned();
    let (_, _, results) = export("gradescope", &["--only", &slug]);
    let results: Value = serde_json::from_str(&results).unwrap();
    assert_eq!(results["score"], 0.0);
    assert_eq!(results["tests"].as_array().unwrap().len(), 9);
    assert_eq!(results["tests"][0]["number"], "1.1");
    assert_eq!(results["tests"][0]["status"], "failed");

    let (_, _, xml) = export("junit", &[]);
    assert_eq!(xml.matches("<testsuite name=").count(), 6, "{xml}");
    assert_eq!(xml.matches("<testcase ").count(), 6 * 9);
    assert!(xml.contains("tests=\"9\" failures=\"8\" errors=\"0\""), "{xml}");
}

#[test]
fn a_class_of_brightspace_zipped_and_unpacked() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let files = brightspace();
    let entries: Vec<(String, &[u8])> =
        files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
    let name = "Lab 02 Download Oct 9, 2019 905 AM";
    place.put(&format!("{name}.zip"), &zip(&entries));
    for (file, bytes) in &files {
        if file.ends_with('/') {
            fs::create_dir_all(place.at(&format!("{name}/{file}"))).unwrap();
        } else {
            place.put(&format!("{name}/{file}"), bytes);
        }
    }
    place.put("list.csv", LIST.as_bytes());
    let mut reports = Vec::new();
    for given in [format!("{name}.zip"), name.to_owned()] {
        let _ = fs::remove_dir_all(place.at("out"));
        let (said, report) = place.grade(&root, &[&given, "--class", "list.csv"]);
        assert!(said.contains("recognized as a download of Brightspace"), "{said}");
        assert!(said.contains("skipped, not submissions: 105-5150 - Cy Poe"), "{said}");
        assert!(said.contains("index.html"), "{said}");
        let rows = rows(&report);
        let of = |who: &str| rows.iter().find(|(name, ..)| name.contains(who)).unwrap().clone();
        let numbers: Vec<(String, String)> =
            rows.iter().map(|(name, number, _)| (name[..3].to_owned(), number.clone())).collect();
        let expected = [
            ("101", "0260000001"),
            ("102", "260000002"),
            ("103", "260000004"),
            ("104", "260000003"),
            ("107", ""),
            ("108", "260000008"),
        ];
        assert_eq!(numbers, expected.map(|(id, number)| (id.to_owned(), number.to_owned())));
        let (name, _, remarks) = of("Bo Ode");
        assert!(name.contains("Oct 8, 2019 110 AM"), "{name}");
        assert!(
            remarks.contains(
                "1 d 1 h 11 min after it was due (2019-10-06 23:59 -04:00): 2 started days; it earned nothing"
            ),
            "{remarks}"
        );
        assert!(!of("Zoë").2.contains("due"), "{}", of("Zoë").2);
        // Names and numbers of the grade book are the class list's, whatever config.json says.
        let book = fs::read_to_string(place.at("out/grades.csv")).unwrap();
        assert!(book.contains("\n260000002,Ode,Bo,"), "{book}");
        let bo = report["submissions"]
            .as_array()
            .unwrap()
            .iter()
            .find(|row| row["slug"] == "102-5150---Bo-Ode---Oct-8--2019-110-AM-a2")
            .unwrap();
        assert_eq!(
            bo["standing"]["set_aside"][0],
            "102-5150 - Bo Ode - Oct 6, 2019 1000 PM/a2.zip"
        );
        let missing: Vec<(&str, &str)> = report["class"]["missing"]
            .as_array()
            .unwrap()
            .iter()
            .map(|own| (text(&own["student"]["number"]), text(&own["reason"])))
            .collect();
        let expected = [
            ("260000005", "an empty submission: it holds only notes.txt"),
            ("260000006", "an empty submission: it holds no file"),
            ("260000007", ""),
        ];
        assert_eq!(missing, expected);
        let undecided = report["class"]["undecided"].as_array().unwrap();
        assert_eq!(undecided.len(), 1);
        assert_eq!(text(&undecided[0]["reason"]), "nobody on the list is Max Other");
        assert!(said.contains("decide in out/matches.toml"), "{said}");
        reports.push(text(&report["submissions"].to_string().into()).to_owned());
    }
    assert_eq!(reports[0], reports[1]);

    // The instructor decides; the class list was kept, and nothing is graded again.
    let questions = fs::read_to_string(place.at("out/matches.toml")).unwrap();
    let own = "submission = \"107-5150 - Max Other - Oct 6, 2019 600 PM/cs101_hw3.zip\"";
    assert!(questions.contains(&format!("# {own}\n# student = \"none\"")), "{questions}");
    place
        .put("out/matches.toml", format!("[[match]]\n{own}\nstudent = \"260000007\"\n").as_bytes());
    let (said, report) = place.grade(&root, &[name]);
    // An empty archive costs nothing to look at again. Beside a late attempt the one in time is graded, too.
    assert!(said.contains("6 of 7 submissions keep their earlier grades"), "{said}");
    assert_eq!(report["class"]["undecided"].as_array().unwrap().len(), 0);
    assert!(
        rows(&report)
            .iter()
            .any(|(name, number, _)| name.starts_with("107") && number == "260000007")
    );
    // What students get names no other and no platform's number.
    let page =
        fs::read_to_string(place.at("out/104-5150---Ann-Lee---Oct-6--2019-900-PM-a2/report.html"))
            .unwrap();
    assert!(!page.contains("260000004") && !page.contains("Bo Ode"), "{page}");
}

#[test]
fn the_best_and_the_first_attempt() {
    let place = Place::new();
    let root = place.assignment(LATE);
    for (file, bytes) in brightspace().iter().filter(|(name, _)| name.contains("Bo Ode")) {
        place.put(&format!("class/{file}"), bytes);
    }
    for (attempt, day) in [("first", "Oct 6"), ("best", "Oct 6"), ("latest", "Oct 8")] {
        let (said, report) = place.grade(&root, &["class", "--attempt", attempt]);
        let rows = rows(&report);
        assert_eq!(rows.len(), 1, "{said}");
        assert!(rows[0].0.contains(day), "{attempt}: {said}");
    }
}

#[test]
fn downloads_of_other_platforms() {
    let zoe = submission(&config("Zoë", "O'Neil", "0260000001"));
    let ann = submission(&config("Ann", "Lee", "260000003"));
    let metadata = "---\nsubmission_11:\n  :submitters:\n  - :name: Zoë O'Neil\n    :sid: '0260000001'\n    \
                    :email: z@example.org\n  :created_at: 2019-10-07 03:00:00.5 Z\nsubmission_12:\n  :submitters:\n  \
                    - :name: Ann Lee\n    :sid: '260000003'\n  :created_at: 2019-10-08 03:59:30 Z\n";
    let unpacked = |folder: &str, number: &str| {
        vec![
            (format!("{folder}/config.json"), config("X", "Y", number).into_bytes()),
            (format!("{folder}/src/lib.rs"), b"fn main() { not_rust }".to_vec()),
        ]
    };
    let gradescope = [
        unpacked("assignment_9_export/submission_11", ""),
        unpacked("assignment_9_export/submission_12", ""),
        vec![(
            "assignment_9_export/submission_metadata.yml".to_owned(),
            metadata.as_bytes().to_vec(),
        )],
    ];
    let moodle = "Identifier,Full name,ID number,Status,Grade,Maximum Grade,Last modified (submission),Last modified (grade)\n\
                  Participant 7,Zoë O'Neil,0260000001,Draft (not submitted),,100,\"Sunday, 6 October 2019, 11:58 PM\",-\n\
                  Participant 8,Ann Lee,260000003,Submitted for grading - 1 day late,,100,\"Tuesday, 8 October 2019, 12:30 AM\",-\n\
                  Participant 9,Gil Tam,260000007,No submission,,100,-,-\n";
    let canvas = "Student,ID,SIS User ID,SIS Login ID,Section,A2 (77)\n    Points Possible,,,,,100\n\
                  \"O'Neil, Zoë\",501,0260000001,zo,1,\n\"Lee, Ann\",502,260000003,al,1,\n\"Tam, Gil\",503,260000007,gt,1,\n";
    let github = "identifier,github_username,github_id,name\n0260000001,zo,1,\n260000003,ann-l,2,\n260000007,gt,3,\n";
    let git = |folder: &str, number: &str| {
        let mut files = unpacked(folder, number);
        files.push((format!("{folder}/.git/HEAD"), b"ref: refs/heads/main\n".to_vec()));
        files
    };
    let unknown = "when it was submitted is not known";
    for (title, files, zipped, list, late) in [
        (
            "Moodle",
            vec![
                ("Zoë O'Neil_7_assignsubmission_file/a2.zip".to_owned(), zoe.clone()),
                ("Ann Lee_8_assignsubmission_file/a2.zip".to_owned(), ann.clone()),
                (
                    "Ann Lee_8_assignsubmission_onlinetext/onlinetext.html".to_owned(),
                    b"hi".to_vec(),
                ),
            ],
            true,
            moodle,
            "2 started days",
        ),
        (
            "Canvas",
            vec![
                ("oneilzoë_501_9001_a2.zip".to_owned(), submission("{}")),
                ("leeann_LATE_502_9002_a2_7_8-1.zip".to_owned(), submission("{}")),
            ],
            true,
            canvas,
            "late, says Canvas, but not by how much",
        ),
        ("Gradescope", gradescope.concat(), true, LIST, "2 started days"),
        (
            "GitHub Classroom",
            [git("a2-submissions/a2-zo", ""), git("a2-submissions/a2-ann-l", "")].concat(),
            false,
            github,
            unknown,
        ),
    ] {
        let place = Place::new();
        let root = place.assignment(LATE);
        place.put("list.csv", list.as_bytes());
        let entries: Vec<(String, &[u8])> =
            files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
        place.put("download.zip", &zip(&entries));
        files.iter().for_each(|(name, bytes)| place.put(&format!("download/{name}"), bytes));
        for given in ["download", "download.zip"].into_iter().take(1 + usize::from(zipped)) {
            let (said, report) = place.grade(&root, &[given, "--class", "list.csv"]);
            assert!(said.contains(&format!("recognized as a download of {title}")), "{said}");
            let mut rows = rows(&report);
            rows.sort_by_key(|(_, number, _)| number.clone());
            let numbers: Vec<&str> = rows.iter().map(|(_, number, _)| number.as_str()).collect();
            assert_eq!(numbers, ["0260000001", "260000003"], "{title} {given}: {said}");
            assert!(rows[1].2.contains(late), "{title} {given}: {}", rows[1].2);
            assert_eq!(rows[0].2.contains(unknown), late == unknown, "{title}: {}", rows[0].2);
            let drafts = [0, 1]
                .map(|at| rows[at].2.contains("says that it is a draft, which was not submitted"));
            assert_eq!(drafts, [title == "Moodle", false], "{title}: {}", rows[0].2);
            let (_, status, _) = place.run(&["status", "--output", "out"]);
            let line = "drafts, not submitted: ask, then `umbra confirm`: 1\n";
            assert_eq!(status.contains(line), drafts[0], "{status}");
            let missing = report["class"]["missing"].as_array().unwrap();
            assert!(missing.iter().any(|own| own["student"]["number"] == "260000007"), "{title}");
            fs::remove_dir_all(place.at("out")).unwrap();
        }
    }
}

/// Names that break a naive import or grade book: signs of other scripts, a comma, an apostrophe, two of one name,
/// zeros in front. Also an empty archive, and a submission to another course by somebody who is not on the list.
#[test]
fn odd_names_come_back_in_the_grade_books_of_canvas_and_moodle() {
    let own = |first: &str, last: &str, number: &str| submission(&config(first, last, number));
    let other = zip(&[("main.py".to_owned(), b"print()".as_slice())]);
    let moodle =
        |name: &str, bytes: Vec<u8>| (format!("{name}_assignsubmission_file/a2.zip"), bytes);
    let canvas = |name: &str, bytes: Vec<u8>| (format!("{name}_a2.zip"), bytes);
    let (hanako, jr) = (own("花子", "山田", "007"), own("Bo", "Smith, Jr", "260000002"));
    let (ann, ann2) = (own("Ann", "Lee", "260000003"), own("Ann", "Lee", "260000004"));
    let moodle_list = "Identifier,Full name,ID number,Grade,Maximum Grade,Last modified (grade)\n\
                       Participant 1,花子 山田,007,,100,-\nParticipant 2,\"Bo Smith, Jr\",260000002,,100,-\n\
                       Participant 3,Ann Lee,260000003,,100,-\nParticipant 4,Ann Lee,260000004,,100,-\n\
                       Participant 5,Eve Sol,260000005,,100,-\nParticipant 6,Gil Tam,260000006,,100,-\n";
    let canvas_list = "Student,ID,SIS User ID,SIS Login ID,Section,a2 (77)\n    Points Possible,,,,,100\n\
                       \"山田, 花子\",1,007,hanako,1,\n\"Smith, Jr, Bo\",2,260000002,bo,1,\n\
                       \"Lee, Ann\",3,260000003,al,1,\n\"Lee, Ann\",4,260000004,al2,1,\n\
                       \"Sol, Eve\",5,260000005,es,1,\n\"Tam, Gil\",6,260000006,gt,1,\n";
    for (format, list, files, book) in [
        (
            "moodle",
            moodle_list,
            [
                moodle("花子 山田_1", hanako.clone()),
                moodle("Bo Smith, Jr_2", jr.clone()),
                moodle("Ann Lee_3", ann.clone()),
                moodle("Ann Lee_4", ann2.clone()),
                moodle("Eve Sol_5", Vec::new()),
                moodle("Max Other_9", other.clone()),
            ],
            "Identifier,Full name,ID number,Maximum Grade,Last modified (grade),Grade\n\
             Participant 1,花子 山田,007,100,-,0.00\nParticipant 2,\"Bo Smith, Jr\",260000002,100,-,0.00\n\
             Participant 3,Ann Lee,260000003,100,-,0.00\nParticipant 4,Ann Lee,260000004,100,-,0.00\n",
        ),
        (
            "canvas",
            canvas_list,
            [
                canvas("山田花子_1_901", hanako),
                canvas("smithjrbo_2_902", jr),
                canvas("leeann_3_903", ann),
                canvas("leeann_4_904", ann2),
                canvas("soleve_5_905", Vec::new()),
                canvas("othermax_9_909", other),
            ],
            "Student,ID,SIS User ID,SIS Login ID,Section,a2 (77)\n\"山田, 花子\",1,007,hanako,1,0.00\n\
             \"Smith, Jr, Bo\",2,260000002,bo,1,0.00\n\"Lee, Ann\",3,260000003,al,1,0.00\n\
             \"Lee, Ann\",4,260000004,al2,1,0.00\n",
        ),
    ] {
        let place = Place::new();
        let root = place.assignment(LATE);
        place.put("list.csv", list.as_bytes());
        let entries: Vec<(String, &[u8])> =
            files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
        place.put("download.zip", &zip(&entries));
        let (said, report) = place.grade(
            &root,
            &["download.zip", "--class", "list.csv", "--export", format, "--export", "feedback"],
        );
        let exported = fs::read_to_string(place.at(&format!("out/{format}.csv"))).unwrap();
        let sorted = |text: &str| {
            let (head, rows) = text.split_once('\n').unwrap();
            let mut rows: Vec<String> = rows.lines().map(str::to_owned).collect();
            rows.sort();
            (head.to_owned(), rows)
        };
        assert_eq!(sorted(&exported), sorted(book), "{said}");
        // Nobody could open Eve's, and nobody knows whose Max's is.
        assert!(said.contains("a2.zip: nobody could open it"), "{said}");
        assert!(said.contains("a2.zip: not decided yet"), "{said}");
        let missing = report["class"]["missing"].as_array().unwrap();
        assert_eq!(missing.len(), 1, "{missing:?}");
        assert_eq!(missing[0]["student"]["number"], "260000006");
        // Feedback goes back under the names that the platform gave.
        let feedback = fs::File::open(place.at("out/feedback.zip")).unwrap();
        let feedback = zip::ZipArchive::new(feedback).unwrap();
        let names: Vec<String> =
            feedback.file_names().map(|name| name.unwrap().into_owned()).collect();
        for (name, _) in &files {
            let own = name.split("_a").next().unwrap();
            let is_there = names.iter().any(|name| name.starts_with(own));
            assert_eq!(is_there, !own.to_lowercase().contains("other"), "{own}: {names:?}");
        }
    }
}

#[test]
fn one_who_dresses_up_an_archive_as_a_download_is_one_student() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let own = submission(&config("Ann", "Lee", "260000003"));
    place.put("class/a2_ann.zip", &own);
    let name = "1-2 - Bo Ode - Oct 5, 2019 1159 PM/a2.zip".to_owned();
    place.put("class/a2_eve.zip", &zip(&[(name.clone(), &own)]));
    let folder = "7-5150 - Eve Sol - Oct 5, 2019 1159 PM";
    let (said, report) = place.grade_to(Some(1), &root, &["class"]);
    let names: Vec<String> = rows(&report).into_iter().map(|(name, ..)| name).collect();
    assert_eq!(names, ["a2_ann.zip"], "{said}");
    assert!(said.contains("a2_eve.zip: it looks like a download of Brightspace"), "{said}");
    fs::remove_dir_all(place.at("out")).unwrap();
    place.put("download.zip", &zip(&[(format!("{folder}/a2.zip"), &zip(&[(name, &own)]))]));
    let (said, report) = place.grade(&root, &["download.zip"]);
    assert_eq!(rows(&report).len(), 1, "{said}");
    assert_eq!(rows(&report)[0].0, format!("{folder}/a2.zip"));
}

#[test]
fn what_holds_no_submission_is_said_and_nothing_is_written() {
    let place = Place::new();
    place.put("class/notes.txt", b"x");
    place.put("class.zip", &zip(&[("index.html".to_owned(), b"".as_slice())]));
    let root = root_of_repository();
    for (given, said) in [
        (&["class"][..], "it holds notes.txt"),
        (
            &["class", "--from", "moodle"],
            "in Moodle named like \"First Last_123_assignsubmission_file/\"",
        ),
        (&["nowhere"], "nowhere does not exist"),
    ] {
        let mut all = vec!["grade", "--output", "out", "--root", root.to_str().unwrap()];
        all.extend(given);
        let (code, _, errors) = place.run(&all);
        assert_eq!(code, Some(2), "{errors}");
        assert!(errors.contains(said), "{errors}");
        assert!(!place.at("out").exists());
    }
    // A list that is none, a policy that says too little: the user's own file and line.
    place.put("list.csv", b"a,b\n1,2\n");
    place.put("class/a2.zip", &submission("{}"));
    let mut all = vec!["grade", "class", "--class", "list.csv", "--root", root.to_str().unwrap()];
    all.extend(["--isolation", "reduced", "--perturb", "off", "--output", "out"]);
    let (code, _, errors) = place.run(&all);
    assert_eq!(code, Some(2), "{errors}");
    assert!(
        errors.contains("list.csv:1: expected a header with a column of student numbers"),
        "{errors}"
    );
    let late = place.assignment(r#"{"penalty": 10, "unit": "percent", "per": "day"}"#);
    let (code, _, errors) = place.run(&["grade", "class", "--root", late.to_str().unwrap()]);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("config.json:1: late: percent of what?"), "{errors}");
}

#[test]
fn validate_takes_what_grade_takes() {
    let place = Place::new();
    let files = brightspace();
    let entries: Vec<(String, &[u8])> =
        files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
    place.put("download.zip", &zip(&entries));
    let (code, said) = place.validate(&["download.zip"]);
    assert_eq!(code, Some(1), "{said}");
    let line = |who: &str| said.lines().find(|line| line.contains(who)).unwrap();
    assert!(line("101-5150 - Zoë").contains("a2_zoë_o'neil.zip"), "{said}");
    assert!(line("107-5150").contains("error: "), "{said}");
    assert!(line("108-5150").contains("error: "), "{said}");
    assert!(said.contains("recognized as a download of Brightspace\n7 submissions: "), "{said}");
    assert!(said.contains("Cy Poe: an empty submission: it holds only notes.txt"), "{said}");
    let (code, json) = place.validate(&["download.zip", "--json"]);
    assert_eq!(code, Some(1));
    let json: Value = serde_json::from_str(&json[..=json.rfind(']').unwrap()]).unwrap();
    assert_eq!(json.as_array().unwrap().len(), 7);

    // Several that are named, all in order but for their images, which are warnings.
    let renders = [
        "offline/cbox_simple_offline",
        "offline/teapot_simple_offline",
        "realtime/cbox_simple_realtime",
        "realtime/teapot_simple_realtime",
    ]
    .map(|path| format!(r#"{{"scene": "", "render": "{path}.exr"}}"#));
    let good = config("Ann", "Lee", "260000003").replace("[]", &format!("[{}]", renders.join(",")));
    place.put("a2_ann_lee.zip", &submission(&good));
    place.put("b/a2_ann_lee.zip", &submission(&good));
    let (code, said) = place.validate(&["a2_ann_lee.zip", "b/a2_ann_lee.zip"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("a2_ann_lee.zip  conforms, 4 warnings\n"), "{said}");
    assert!(said.contains("2 submissions: 2 conforming, 0 not"), "{said}");
    let (code, said) = place.validate(&["a2_ann_lee.zip", "b", "--fix", "out.zip"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("--fix repacks one submission, found 2"), "{said}");
    // One alone shows its tree as before.
    let (code, said) = place.validate(&["a2_ann_lee.zip"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.starts_with("a2_ann_lee.zip: conforms (0 errors, 4 warnings)"), "{said}");
}

#[test]
fn what_the_instructor_decides_survives_and_is_flagged_when_the_evidence_changes() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let own = |name: &str, id: u32| format!("class/{id}-9 - {name} - Oct 6, 2019 1000 PM/a2.zip");
    place.put(&own("Bo Ode", 1), &submission(&config("Bo", "Ode", "260000002")));
    place.put(&own("Ann Lee", 2), &submission(&config("Ann", "Lee", "0260000003")));
    let (_, report) = place.grade(&root, &["class"]);
    assert_eq!(report["submissions"][0]["points"], 0.0);
    let run = |arguments: &[&str]| {
        let mut all = arguments.to_vec();
        if arguments[0] != "status" {
            all.extend(["--root", root.to_str().unwrap()]);
        }
        let (code, said, errors) = place.run(&[&all[..], &["--output", "out"]].concat());
        (code, said + &errors)
    };
    let (code, said) = run(&["status"]);
    assert_eq!((code, said.as_str()), (Some(0), "nothing waits for a decision\n"));

    let reason = ["--reason", "compiler of another year", "--by", "Eve"];
    let set = |student: &str, part: &str, points: &str| {
        run(&[&["override", student, part, points][..], &reason].concat())
    };
    let (code, said) = set("260000002", "1.3", "15");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("part 1.3 now has 15 points; the evidence gives 0"), "{said}");
    let (code, said) = run(&[&["confirm", "lee, ANN"][..], &reason].concat());
    assert_eq!(code, Some(0), "{said}");
    for (student, part, points, expected) in [
        ("260000009", "1.3", "1", "nobody in out is \"260000009\""),
        ("260000002", "9.9", "1", "there is no part 9.9; expected one of 1.1, 1.2"),
        ("260000002", "1.3", "21", "part 1.3 is worth 0 to 20 points, found 21"),
    ] {
        let (code, said) = set(student, part, points);
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(expected), "{said}");
    }
    let words = "part 1.3 was set by the instructor to 15 points instead of 0: compiler of another year (Eve, 2";
    let check = |arguments: &[&str], stale: usize| {
        let (said, report) = place.grade(&root, arguments);
        let rows = rows(&report);
        let bo = rows.iter().position(|(name, ..)| name.contains("Bo Ode")).unwrap();
        assert_eq!(report["submissions"][bo]["points"], 15.0, "{said}");
        assert!(rows[bo].2.contains(words), "{}", rows[bo].2);
        assert!(rows[1 - bo].2.contains("the instructor looked at it"), "{}", rows[1 - bo].2);
        let page =
            place.at("out").join(text(&report["submissions"][bo]["slug"])).join("report.html");
        assert!(fs::read_to_string(page).unwrap().contains(words));
        assert_eq!(report["class"]["stale"].as_array().unwrap().len(), stale, "{said}");
        let (code, said) = run(&["status"]);
        assert_eq!(code, Some(i32::from(stale > 0)), "{said}");
        assert_eq!(said.contains("decisions whose evidence has changed"), stale > 0, "{said}");
    };
    check(&["class"], 0);
    check(&["class", "--force"], 0);
    // Another submission in its place.
    let changed = config("Bo", "Ode", "260000002").replace("[]", "[ ]");
    place.put(&own("Bo Ode", 1), &submission(&changed));
    check(&["class"], 1);
    // A slip in the file has a line.
    let file = place.at("out/overrides.toml");
    let kept = fs::read_to_string(&file).unwrap();
    fs::write(&file, kept.replace("points = 15.0", "points = -1.0")).unwrap();
    let (code, said) = set("260000002", "1.3", "10");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("overrides.toml:4: expected points of 0 or more"), "{said}");
}

#[test]
fn decisions_at_the_same_time_are_all_kept() {
    let place = Place::new();
    let root = place.assignment(LATE);
    place.put("class/a2_bo.zip", &submission(&config("Bo", "Ode", "260000002")));
    place.grade(&root, &["class"]);
    let parts = ["1.1", "1.2", "1.3", "1.4"];
    std::thread::scope(|scope| {
        let place = &place;
        let decide = |part| {
            let own = ["override", "260000002", part, "1", "--reason", part, "--output", "out"];
            scope.spawn(move || place.run(&own))
        };
        for one in parts.map(decide) {
            let (code, said, errors) = one.join().unwrap();
            assert_eq!(code, Some(0), "{said}{errors}");
        }
    });
    let kept = fs::read_to_string(place.at("out/overrides.toml")).unwrap();
    for part in parts {
        assert_eq!(kept.matches(&format!("reason = \"{part}\"")).count(), 1, "{kept}");
    }
    let (_, report) = place.grade(&root, &["class"]);
    assert_eq!(report["submissions"][0]["points"], 4.0);
}

#[test]
fn a_grade_waits_where_another_submission_may_be_the_students() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let of = |id: u32| format!("class/{id}-5150 - Ann Lee - Oct 6, 2019 1000 PM/a2.zip");
    place.put(&of(1), &submission(&config("Ann", "Lee", "0260000003")));
    // One of two who are called so.
    place.put(&of(2), &submission(&config("Ann", "Lee", "")));
    place.put("list.csv", LIST.as_bytes());
    place.grade(&root, &["class", "--class", "list.csv"]);
    let export = ["export", "book.csv", "--format", "brightspace", "--output", "out"];
    let (code, said, errors) = place.run(&export);
    assert_eq!(code, Some(2), "{said}{errors}");
    assert!(errors.contains("another submission may be theirs"), "{errors}");
    let decided = format!(
        "[[match]]\nsubmission = \"{}\"\nstudent = \"260000004\"\n",
        of(2).trim_start_matches("class/")
    );
    place.put("out/matches.toml", decided.as_bytes());
    // It is a student's who had none.
    let regrade = ["regrade", "--output", "out", "--root", root.to_str().unwrap()];
    let (code, said, errors) = place.run(&regrade);
    assert_eq!(code, Some(0), "{said}{errors}");
    assert!(said.contains("0 fall, 1 stay, 1 more now count"), "{said}");
    place.grade(&root, &["class"]);
    let (code, said, errors) = place.run(&export);
    assert_eq!(code, Some(0), "{said}{errors}");
    assert!(said.contains("book.csv: 2 grades for Brightspace"), "{said}");
}

#[test]
fn an_export_among_the_submissions_is_none() {
    let place = Place::new();
    let root = place.assignment(LATE);
    place.put("class/a2_ann.zip", &submission(&config("Ann", "Lee", "0260000003")));
    let (_, report) = place.grade(&root, &["class"]);
    assert_eq!(report["submissions"].as_array().unwrap().len(), 1);
    let export = ["export", "class/fb.zip", "--format", "feedback", "--output", "out"];
    let (code, said, errors) = place.run(&export);
    assert_eq!(code, Some(0), "{said}{errors}");
    // A copy that a browser made of it is one, too.
    place.put("class/sub/fb (1).zip", &fs::read(place.at("class/fb.zip")).unwrap());
    let (said, report) = place.grade(&root, &["class"]);
    assert_eq!(report["submissions"].as_array().unwrap().len(), 1, "{said}");
    for file in ["fb.zip", "fb (1).zip"] {
        assert!(said.contains(&format!("{file} (an export of this report)")), "{said}");
    }
    fs::remove_dir_all(place.at("class/sub")).unwrap();
    // Another file of that name is somebody's.
    place.put("class/fb.zip", &submission(&config("Bo", "Ode", "260000002")));
    let (said, report) = place.grade(&root, &["class"]);
    assert_eq!(report["submissions"].as_array().unwrap().len(), 2, "{said}");
}

#[test]
fn no_report_is_lost_when_nobody_reads_what_is_printed() {
    let place = Place::new();
    let root = place.assignment(LATE);
    place.put("class/a2.zip", &submission(&config("Ann", "Lee", "0260000003")));
    let root = root.to_str().unwrap();
    let grade = ["grade", "class", "--perturb", "off", "--isolation", "reduced", "--output", "out"];
    let pipe = Some(nix::sys::signal::Signal::SIGPIPE as i32);
    assert_eq!(place.run_unread(&[&grade[..], &["--root", root]].concat()), pipe);
    for file in ["report.json", "grades.csv", "report.html", "a2/report.html"] {
        assert!(place.at("out").join(file).is_file(), "{file}");
    }
    let check = ["check", "class/a2.zip", "--output", "own", "--root", root];
    assert_eq!(place.run_unread(&check), pipe);
    for file in ["report.html", "a2/report.html", "a2/last-check.json"] {
        assert!(place.at("own").join(file).is_file(), "{file}");
    }
    assert_eq!(place.run_unread(&["status", "--output", "out"]), pipe);
}
