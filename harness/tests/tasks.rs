//! A batch that several tasks grade into one folder, as on a cluster: whatever becomes of them, the merged report is
//! that of one machine.

#![cfg(unix)]

use std::fs;
use std::process::Command;

use similar_asserts::assert_eq;

use crate::batch::{Batch, WRONG, root, said};

const FIVE: [(&str, &str); 5] =
    [("ada", WRONG), ("bob", "what?"), ("cem", WRONG), ("dan", "no"), ("eve", WRONG)];

fn task(batch: &Batch, slice: &str, options: &[&str]) -> (Option<i32>, String) {
    let slice = ["--partition", slice];
    let all = [&slice[..], options].concat();
    let output = batch.command(&[batch.submissions()], &all).output().unwrap();
    let (code, errors) = said(&output);
    (code, String::from_utf8_lossy(&output.stdout).into_owned() + &errors)
}

fn merge(batch: &Batch, options: &[&str]) -> (Option<i32>, String) {
    let assignment = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("one-scene");
    let mut umbra = Command::new(env!("CARGO_BIN_EXE_umbra"));
    umbra.arg("merge").args(options).arg("--output").arg(batch.out()).arg("--root").arg(assignment);
    let output = umbra.current_dir(root()).output().unwrap();
    let (code, errors) = said(&output);
    (code, String::from_utf8_lossy(&output.stdout).into_owned() + &errors)
}

#[test]
fn the_merged_report_is_that_of_one_machine_whatever_becomes_of_the_tasks() {
    let batch = Batch::new(&FIVE);
    let (code, text) = merge(&batch, &[]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("nothing to merge"), "{text}");

    // One runs twice at the same time, one is killed with its record in the making.
    let again = |_| batch.start_with(&[batch.submissions()], &["--partition", "slice:1/3"]);
    let twice: Vec<_> = (0..2).map(again).collect();
    for child in twice {
        let (code, text) = said(&child.wait_with_output().unwrap());
        assert_eq!(code, Some(0), "{text}");
    }
    let options = ["--partition", "slice:2/3"];
    let mut killed = batch.command(&[batch.submissions()], &options);
    let killed = killed.env("UMBRA_KILL_AT", "record.json:written").output().unwrap();
    assert_eq!(killed.status.code(), None);
    let (code, text) = merge(&batch, &[]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("3 of 5 submissions not graded yet: bob, cem, eve;"), "{text}");
    assert!(!batch.out().join("report.json").exists());

    let (code, text) = task(&batch, "slice:2/3", &[]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("2 submissions of 5 graded; `umbra merge --report "), "{text}");
    assert_eq!(task(&batch, "slice:3/3", &[]).0, Some(0));
    let first = fs::read(batch.instructor("ada/record.json")).unwrap();
    assert_eq!(task(&batch, "slice:1/3", &[]).0, Some(0));
    assert_eq!(fs::read(batch.instructor("ada/record.json")).unwrap(), first);
    let (code, text) = merge(&batch, &[]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("report: "), "{text}");
    let alone = Batch::new(&FIVE);
    assert_eq!(alone.grade().0, Some(0));
    assert_eq!(batch.canonical(), alone.canonical());
    // What was merged is a report like any other.
    assert_eq!(merge(&batch, &[]).0, Some(0));
    assert_eq!(batch.canonical(), alone.canonical());
    batch.submission("fay", WRONG);
    assert_eq!(task(&batch, "slice:2/2", &[]).0, Some(0));
    let umbra = |command: &str| {
        let mut umbra = Command::new(env!("CARGO_BIN_EXE_umbra"));
        umbra.args(command.split(' ')).arg("--output").arg(batch.out());
        let output = umbra.current_dir(batch.place.path()).output().unwrap();
        let (code, errors) = said(&output);
        (code, String::from_utf8_lossy(&output.stdout).into_owned() + &errors)
    };
    // As long as they are not merged, nothing is made of the half that is there.
    let decide = "override ada 1.1 0 --reason x";
    for command in ["status", decide, "export x.csv --format csv"] {
        let (code, text) = umbra(command);
        assert_eq!(code, Some(2), "{text}");
        assert!(text.contains("the tasks of a partition are not merged yet; hint"), "{text}");
    }
    // A run that was interrupted leaves no such file: the report is that of the last one that was not.
    fs::remove_dir_all(batch.instructor("work")).unwrap();
    let (code, text) = umbra(decide);
    assert_eq!(code, Some(0), "{text}");
    assert!(
        text.contains(
            "1 submission graded since by a run that did not end, and not in the report: fay;"
        ),
        "{text}"
    );
    assert!(!batch.canonical().contains("fay"));
    for command in ["status", "export x.csv --format csv"] {
        let (_, text) = umbra(command);
        assert!(text.contains("not in the report: fay;"), "{text}");
    }
    assert_eq!(task(&batch, "slice:1/2", &[]).0, Some(0));
    let (code, text) = batch.grade();
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("6 of 6 submissions keep their earlier grades"), "{text}");
    // It graded all that the tasks were given.
    assert_eq!(umbra("export x.csv --format csv").0, Some(0));
    assert!(batch.canonical().contains("fay"));
}

#[test]
fn what_was_judged_otherwise_is_refused_by_name() {
    let batch = Batch::new(&FIVE[..3]);
    assert_eq!(task(&batch, "slice:1/2", &[]).0, Some(0));
    // Said before it grades; a task on a machine that does not see the others' files yet goes on.
    let (code, text) = task(&batch, "slice:2/2", &["--held-back", "off"]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("all tasks of a partition use the same seed"), "{text}");
    let (work, aside) = (batch.instructor("work"), batch.out().join("aside"));
    fs::rename(&work, &aside).unwrap();
    assert_eq!(task(&batch, "slice:2/2", &["--held-back", "off"]).0, Some(0));
    for file in aside.read_dir().unwrap().flatten() {
        fs::rename(file.path(), work.join(file.file_name())).unwrap();
    }
    fs::remove_dir(&aside).unwrap();
    let (code, text) = merge(&batch, &[]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("judged by different programs, scenes, limits or seeds"), "{text}");
    assert!(text.contains("seed 20191006): ada, cem"), "{text}");
    assert!(text.contains("no held-back scenes): bob"), "{text}");
    // The task runs again as the others do: nothing of the wrong one is left.
    assert_eq!(task(&batch, "slice:2/2", &[]).0, Some(0));

    // Another kind of machine.
    let record = batch.instructor("cem/record.json");
    let text = fs::read_to_string(&record).unwrap();
    let at = text.find("\"adapter\":\"").unwrap() + 11;
    fs::write(&record, format!("{}Another {}", &text[..at], &text[at..])).unwrap();
    let (code, text) = merge(&batch, &[]);
    assert_eq!(code, Some(2), "{text}");
    assert!(
        text.contains("machines that may judge differently") && text.contains("Another "),
        "{text}"
    );
    assert!(text.contains(": ada, bob; ") && text.contains(": cem; hint"), "{text}");
    let (code, text) = merge(&batch, &["--allow-mixed"]);
    assert_eq!(code, Some(0), "{text}");
    for name in ["ada", "cem"] {
        assert!(text.contains(&format!("{name}: the same verdicts on this machine")), "{text}");
    }
    assert!(batch.canonical().contains("Another "));

    // Tasks of other submissions.
    let other = Batch::new(&FIVE[..2]);
    let path = |name: &str| other.submissions().join(name);
    for name in ["ada", "bob"] {
        let options = ["--partition", "slice:1/1"];
        let (code, text) =
            said(&other.start_with(&[path(name)], &options).wait_with_output().unwrap());
        assert_eq!(code, Some(0), "{text}");
    }
    let (code, text) = merge(&other, &[]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("the tasks were given different submissions: "), "{text}");
}
