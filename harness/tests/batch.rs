//! A batch is ended in every way and goes on: what was found out is kept, and is worth the same.

#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use similar_asserts::assert_eq;

use crate::support::one_scene;

pub const WRONG: &str = "fn main() { not_rust }";
/// Compiles until it is ended.
const ENDLESS: &str = "#![allow(long_running_const_eval)]\n\
    pub const N: u64 = { let mut n = 0; while n < u64::MAX { n += 1; } n };\n";

/// Submissions and the folder that they are graded into.
pub struct Batch {
    pub place: tempfile::TempDir,
}

impl Batch {
    pub fn new(submissions: &[(&str, &str)]) -> Self {
        let batch = Self { place: tempfile::tempdir().unwrap() };
        submissions.iter().for_each(|(name, lib)| batch.submission(name, lib));
        // The seed that other suites use too: their scenes are there already.
        fs::create_dir_all(batch.instructor("")).unwrap();
        fs::write(batch.instructor("held-back-seed.txt"), "20191006\n").unwrap();
        batch
    }

    pub fn submission(&self, name: &str, lib: &str) {
        let src = self.place.path().join("submissions").join(name).join("src");
        fs::create_dir_all(&src).unwrap();
        fs::write(src.join("lib.rs"), lib).unwrap();
    }

    pub fn out(&self) -> PathBuf {
        self.place.path().join("out")
    }

    pub fn instructor(&self, path: &str) -> PathBuf {
        self.out().join("instructor").join(path)
    }

    fn start(&self) -> Child {
        self.start_with(&[self.place.path().join("submissions")], &[])
    }

    pub fn start_with(&self, paths: &[PathBuf], options: &[&str]) -> Child {
        self.command(paths, options).spawn().unwrap()
    }

    /// The command that grades some paths with more options.
    pub fn command(&self, paths: &[PathBuf], options: &[&str]) -> Command {
        let mut umbra = Command::new(env!("CARGO_BIN_EXE_umbra"));
        umbra.arg("grade").args(paths).args(options);
        umbra.args(["--isolation", "reduced", "--jobs", "1", "--output"]).arg(self.out());
        // Reports name its compiler's key, which holds its place: one place for all batches.
        let assignment =
            one_scene(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("one-scene"), |_| ());
        umbra.arg("--root").arg(assignment).current_dir(root());
        umbra.stdout(Stdio::piped()).stderr(Stdio::piped());
        umbra
    }

    /// The folder of all submissions.
    pub fn submissions(&self) -> PathBuf {
        self.place.path().join("submissions")
    }

    /// Grades to the end: the exit code and what was said on standard error.
    pub fn grade(&self) -> (Option<i32>, String) {
        said(&self.start().wait_with_output().unwrap())
    }

    /// Grades some submissions, named from the folder of all, with more options.
    pub fn grade_with(&self, names: &[&str], options: &[&str]) -> (Option<i32>, String) {
        let path = |name: &&str| self.place.path().join("submissions").join(name);
        let paths: Vec<PathBuf> = names.iter().map(path).collect();
        said(&self.start_with(&paths, options).wait_with_output().unwrap())
    }

    /// The rows of `grades.csv`: name of the submission, and remarks.
    fn rows(&self) -> Vec<(String, String)> {
        let mut csv = csv::Reader::from_path(self.out().join("grades.csv")).unwrap();
        let rows = csv.records().map(|row| {
            let row = row.unwrap();
            (row[3].to_owned(), row[row.len() - 1].to_owned())
        });
        rows.collect()
    }

    fn names(&self) -> Vec<String> {
        self.rows().into_iter().map(|(name, _)| name).collect()
    }

    /// Grades until a record is kept, ends it by a signal, and answers as `grade` does. Before that its
    /// process id, for [`scratch_of`].
    fn grade_until(&self, record: &str, signal: Signal) -> (u32, Option<i32>, String) {
        let mut umbra = self.start();
        let pid = umbra.id();
        let file = self.instructor(record).join("record.json");
        while !file.exists() {
            assert!(umbra.try_wait().unwrap().is_none(), "it ended before {record} was graded");
            std::thread::sleep(Duration::from_millis(10));
        }
        kill(Pid::from_raw(pid as i32), signal).unwrap();
        let (code, said) = said(&umbra.wait_with_output().unwrap());
        (pid, code, said)
    }

    /// All of `report.json` but what it cost.
    pub fn canonical(&self) -> String {
        let report = fs::read_to_string(self.out().join("report.json")).unwrap();
        report.split("\n  \"timings\":").next().unwrap().to_owned()
    }
}

pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// How many scratch folders of a process there are.
pub fn scratch_of(pid: u32) -> usize {
    let all = root().join("target/umbra/scratch").read_dir().unwrap();
    let own = format!("run-{pid}-");
    all.filter(|entry| entry.as_ref().unwrap().file_name().to_string_lossy().starts_with(&own))
        .count()
}

pub fn said(output: &Output) -> (Option<i32>, String) {
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn what_was_graded_before_the_end_is_kept_whatever_the_end() {
    let submissions = [("ada", WRONG), ("bob", ENDLESS), ("eve", "what?")];
    let batch = Batch::new(&submissions);
    let (killed, code, _) = batch.grade_until("ada", Signal::SIGKILL);
    assert_eq!(code, None);
    let kept = fs::read(batch.instructor("ada/record.json")).unwrap();
    batch.submission("abe", WRONG);
    let (interrupted, code, said) = batch.grade_until("abe", Signal::SIGINT);
    assert_eq!(code, Some(130), "{said}");
    assert_eq!((scratch_of(killed), scratch_of(interrupted)), (0, 0));
    assert!(said.contains("of 4 submissions are graded; the same command resumes"), "{said}");
    assert!(!batch.out().join("report.json").exists());

    batch.submission("bob", WRONG);
    let (code, said) = batch.grade();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("2 of 4 submissions keep their earlier grades"), "{said}");
    assert_eq!(fs::read(batch.instructor("ada/record.json")).unwrap(), kept);

    let fresh = Batch::new(&[("abe", WRONG), ("ada", WRONG), ("bob", WRONG), ("eve", "what?")]);
    assert_eq!(fresh.grade().0, Some(0));
    assert_eq!(batch.canonical(), fresh.canonical());
    assert!(batch.canonical().contains("\"seed\": \"20191006\""));
}

#[test]
fn a_submission_that_the_machine_fails_on_costs_the_others_nothing() {
    let batch = Batch::new(&[("ada", WRONG), ("bob", WRONG), ("eve", WRONG)]);
    // Bob's record cannot be written.
    fs::create_dir_all(batch.instructor("bob/record.json")).unwrap();
    let (code, said) = batch.grade();
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("bob: cannot keep "), "{said}");
    let csv = fs::read_to_string(batch.out().join("grades.csv")).unwrap();
    let line = |name: &str| csv.lines().find(|line| line.contains(name)).unwrap().to_owned();
    assert!(line("bob").contains("ungraded"), "{csv}");
    assert!(!line("ada").contains("ungraded") && !line("eve").contains("ungraded"), "{csv}");

    fs::remove_dir(batch.instructor("bob/record.json")).unwrap();
    let (code, said) = batch.grade();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("2 of 3 submissions keep their earlier grades"), "{said}");
    let csv = fs::read_to_string(batch.out().join("grades.csv")).unwrap();
    assert!(!csv.contains("ungraded"), "{csv}");

    // Another text is graded anew; the same one under other conditions too.
    batch.submission("bob", "fn main() { other }");
    let (_, said) = batch.grade();
    assert!(said.contains("2 of 3 submissions keep their earlier grades"), "{said}");
    assert!(batch.canonical().contains("`other`"));
    fs::write(batch.instructor("held-back-seed.txt"), "of").unwrap();
    let (code, said) = batch.grade();
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("held-back-seed.txt: expected the seed of held-back scenes or off"),
        "{said}"
    );
}

/// What Umbra keeps of a bug that it met with `submission`: the keys of the batch and of all files, see
/// `RecordCache::keep_bug`.
fn keep_bug(batch: &Batch, name: &str) {
    use sha2::{Digest as _, Sha256};
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<String>();
    let record = fs::read(batch.instructor(name).join("record.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    let own = record["batch"].as_str().unwrap().as_bytes();
    let nibble = |sign: u8| (sign as char).to_digit(16).unwrap() as u8;
    let own: Vec<u8> = own.chunks(2).map(|two| 16 * nibble(two[0]) + nibble(two[1])).collect();
    let mut hash = Sha256::new_with_prefix(own);
    let folder = batch.place.path().join("submissions").join(name);
    for path in [&folder, &folder.join("src"), &folder.join("src/lib.rs")] {
        let meta = path.symlink_metadata().unwrap();
        hash.update(path.as_os_str().as_encoded_bytes());
        hash.update(meta.len().to_le_bytes());
        hash.update(format!("{:?}", meta.modified().ok()));
    }
    let bug = serde_json::json!({"message": "a pixel of -0.0", "place": "srgb.rs:1:1"});
    let met = serde_json::json!({"key": hex(&hash.finalize()), "bug": bug});
    fs::write(batch.instructor(name).join("internal-error.json"), met.to_string()).unwrap();
}

#[test]
fn a_bug_that_one_submission_meets_ends_with_70_and_costs_the_others_nothing() {
    let batch = Batch::new(&[("ada", WRONG), ("bob", WRONG), ("eve", WRONG)]);
    assert_eq!(batch.grade().0, Some(0));
    keep_bug(&batch, "bob");
    fs::remove_file(batch.instructor("bob/record.json")).unwrap();
    batch.submission("fay", WRONG);
    for others in [2, 3] {
        // Neither is it met again, nor forgotten.
        let (code, said) = batch.grade();
        assert_eq!(code, Some(70), "{said}");
        assert!(said.contains(&format!("{others} of 4 submissions keep")), "{said}");
        let csv = fs::read_to_string(batch.out().join("grades.csv")).unwrap();
        let line = |name: &str| csv.lines().find(|line| line.contains(name)).unwrap().to_owned();
        assert!(
            line("bob").contains("ungraded") && line("bob").contains("internal error"),
            "{csv}"
        );
        for other in ["ada", "eve", "fay"] {
            assert!(!line(other).contains("ungraded"), "{csv}");
        }
        let page = fs::read_to_string(batch.out().join("bob/report.html")).unwrap();
        assert!(!page.contains("srgb.rs"), "what a bug says may hold anything");
    }
    // A changed submission, or --force, is tried again.
    let (code, said) = batch.grade_with(&["bob"], &["--force"]);
    assert_eq!(code, Some(0), "{said}");
    let csv = fs::read_to_string(batch.out().join("grades.csv")).unwrap();
    assert!(!csv.contains("ungraded"), "{csv}");
}

#[test]
fn a_class_grows_and_nobody_falls_out_of_it() {
    let batch = Batch::new(&[("a/ada", WRONG), ("a/bob", WRONG), ("b/eve", WRONG)]);
    let (code, said) = batch.grade_with(&["a"], &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("umbra: 1 of 2: ada: 0/100, ") && said.contains("; about "), "{said}");
    assert!(said.contains("umbra: 2 of 2: bob: 0/100, "), "{said}");
    let first = fs::read(batch.instructor("ada/record.json")).unwrap();

    // One more, named alone. A report of all three at once is the same.
    let (code, said) = batch.grade_with(&["b/eve"], &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("2 submissions stay in ") && said.contains(": ada, bob;"), "{said}");
    assert_eq!(batch.names(), ["ada", "bob", "eve"]);
    let fresh = Batch::new(&[("ada", WRONG), ("bob", WRONG), ("eve", WRONG)]);
    assert_eq!(fresh.grade().0, Some(0));
    assert_eq!(batch.canonical(), fresh.canonical());

    // Another one of the same name is somebody else's.
    batch.submission("c/ada", "fn main() { another }");
    let (_, said) = batch.grade_with(&["c/ada"], &[]);
    assert_eq!(batch.names(), ["ada", "ada", "bob", "eve"], "{said}");
    assert_eq!(fs::read(batch.instructor("ada/record.json")).unwrap(), first);

    // What is gone stays; what was taken out of the report is gone.
    fs::remove_dir_all(batch.place.path().join("submissions/a/bob")).unwrap();
    fs::remove_dir_all(batch.instructor("ada-2")).unwrap();
    let (code, said) = batch.grade_with(&["a", "b"], &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("1 submission stays in ") && said.contains(": bob;"), "{said}");
    assert_eq!(batch.names(), ["ada", "bob", "eve"]);

    // Records of other conditions are shown, and said to be such.
    let record = batch.instructor("bob/record.json");
    let text = fs::read_to_string(&record).unwrap();
    let at = text.find("\"batch\":\"").unwrap() + 9;
    fs::write(&record, format!("{}{}{}", &text[..at], "0".repeat(64), &text[at + 64..])).unwrap();
    let (_, said) = batch.grade_with(&["b"], &[]);
    let report = || -> serde_json::Value {
        serde_json::from_slice(&fs::read(batch.out().join("report.json")).unwrap()).unwrap()
    };
    assert_eq!(report()["class"]["incomparable"], serde_json::json!(["bob"]), "{said}");
    let umbra = |arguments: &[&str]| {
        let mut umbra = Command::new(env!("CARGO_BIN_EXE_umbra"));
        let output = umbra.args(arguments).arg("--output").arg(batch.out()).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let csv = batch.place.path().join("x.csv");
    let export = ["export", csv.to_str().unwrap(), "--format", "csv"];
    for (command, code) in [(&["status"][..], 1), (&export[..], 0)] {
        let (ended, said) = umbra(command);
        assert_eq!(ended, Some(code), "{said}");
        assert!(
            said.contains("so not comparable: grade them again:") && said.contains("\n  bob\n"),
            "{said}"
        );
    }
    // It is the instructor's matter.
    let page = fs::read_to_string(batch.out().join("bob/report.html")).unwrap();
    assert!(!page.contains("not comparable"));
    // The report keeps its held-back scenes.
    for other in ["off", "7"] {
        let (code, said) = batch.grade_with(&["b"], &["--held-back", other]);
        assert_eq!(code, Some(2), "{said}");
        assert!(
            said.contains("--held-back: ") && said.contains(" is graded with 20191006, and all"),
            "{said}"
        );
    }
}

#[test]
fn one_student_is_graded_alone_or_anew() {
    let batch = Batch::new(&[("ada", WRONG), ("bob", WRONG), ("eve", WRONG)]);
    let student = |name: &str, last: &str, id: &str| {
        let config = format!(
            r#"{{"firstName": "F", "lastName": "{last}", "studentID": "{id}", "renders": []}}"#
        );
        let folder = batch.place.path().join("submissions").join(name);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("config.json"), config).unwrap();
    };
    student("bob", "Bee", "260000123");
    let (code, said) = batch.grade_with(&[""], &["--only", "260000123"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("1 of 1: bob (F Bee)"), "{said}");
    assert!(
        said.contains("2 submissions are not graded yet") && said.contains(": ada, eve"),
        "{said}"
    );
    assert_eq!(batch.names(), ["bob"]);
    let (code, said) = batch.grade_with(&[""], &["--only", "eve", "--only", "f bee"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("1 of 2 submissions keep their earlier grades"), "{said}");
    assert_eq!(batch.names(), ["bob", "eve"]);
    let (_, said) = batch.grade_with(&[""], &["--only", "bob", "--force"]);
    assert!(!said.contains("as they were graded before"), "{said}");
    let (code, said) = batch.grade_with(&[""], &["--only", "mallory"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("nobody of 3 submissions is \"mallory\"; expected"), "{said}");

    // Submitted again: the same file name, the same student, in another place.
    batch.submission("late/bob", "fn main() { better }");
    student("late/bob", "Bee", "260000123");
    let (code, said) = batch.grade_with(&["late/bob"], &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("bob of F Bee is graded again as bob-2"), "{said}");
    for _ in 0..2 {
        assert_eq!(batch.names(), ["bob", "eve"]);
        assert!(batch.canonical().contains("`better`"));
        let (_, said) = batch.grade_with(&["eve"], &[]);
        assert!(said.contains("1 submission stays in "), "{said}");
    }
}
