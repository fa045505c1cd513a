//! The process that grades is ended by SIGKILL, at every step that lasts and at many moments between, and begun again:
//! the results are those of a run that nobody disturbed.

#![cfg(target_os = "linux")]

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use similar_asserts::assert_eq;

use crate::batch::{Batch, WRONG, root};
use crate::support::copy_folder;

/// Nobody's source builds: a run takes a second.
const CLASS: [(&str, &str); 3] = [("ada", WRONG), ("bob", "what?"), ("eve", WRONG)];

/// The same, but the last one builds and is run.
fn with_one_that_runs() -> Batch {
    let batch = Batch::new(&CLASS);
    let src = batch.submissions().join("eve/src");
    for source in ["student_template/src", "samples/perfect/src"] {
        copy_folder(&root().join(source), &src);
    }
    batch
}

/// What a batch leaves that counts, but for what it cost: `report.json`, the grade book, and what students get.
fn results(batch: &Batch) -> BTreeMap<PathBuf, String> {
    let out = batch.out();
    let mut results = BTreeMap::from([(PathBuf::from("report.json"), batch.canonical())]);
    for name in ["grades.csv", "ada/report.html", "bob/report.html", "eve/report.html"] {
        let mut text = fs::read_to_string(out.join(name)).unwrap();
        if let Some(begin) = text.find("<table class=\"costs\">") {
            let end = begin + text[begin..].find("</table>").unwrap();
            text.replace_range(begin..end, "");
        }
        results.insert(name.into(), text);
    }
    results
}

/// Waits until no process is left that works for a graders' process.
fn nobody_is_left_of(pid: u32) {
    let own = format!("run-{pid}-");
    let works_for = |process: &Path| {
        ["cmdline", "environ"].iter().any(|file| {
            let bytes = fs::read(process.join(file)).unwrap_or_default();
            String::from_utf8_lossy(&bytes).contains(&own)
        })
    };
    let begun = Instant::now();
    loop {
        let all = Path::new("/proc").read_dir().unwrap().flatten();
        let left: Vec<_> = all.map(|entry| entry.path()).filter(|path| works_for(path)).collect();
        if left.is_empty() {
            return;
        }
        assert!(begun.elapsed() < Duration::from_secs(10), "{left:?} outlive process {pid}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn kill(mut child: Child) -> bool {
    let pid = child.id();
    child.kill().unwrap();
    let ended = child.wait_with_output().unwrap();
    nobody_is_left_of(pid);
    ended.status.signal() == Some(9)
}

#[test]
fn ended_at_every_step_that_lasts_a_batch_goes_on_from_there() {
    let undisturbed = with_one_that_runs();
    let (code, said) = undisturbed.grade();
    assert_eq!(code, Some(0), "{said}");
    let batch = with_one_that_runs();
    let seed = batch.instructor("held-back-seed.txt");
    let known = fs::read_to_string(&seed).unwrap();
    fs::remove_file(&seed).unwrap();
    // Of a file before and after it has its name. The pin comes before the seed. Of the first submission all but what
    // comes of a build, which is the last one's; at the end of that its record is there.
    let files = |names: &[&str]| -> Vec<String> {
        let both = |name: &&str| ["written", "named"].map(|stage| format!("{name}:{stage}"));
        names.iter().flat_map(both).collect()
    };
    let steps = [
        files(&["0001.json", "held-back-seed.txt", "source.txt", "label.json"]),
        vec!["submission:copied".into()],
        files(&["record.json"]),
        vec!["submission:built".into(), "record.json:named".into()],
        files(&["batch.json", "report.html", "grades.csv", "report.json"]),
    ];
    for at in steps.into_iter().flatten() {
        let mut umbra = batch.command(&[batch.submissions()], &[]);
        let child = umbra.env("UMBRA_KILL_AT", &at).spawn().unwrap();
        let pid = child.id();
        let ended = child.wait_with_output().unwrap();
        assert_eq!(ended.status.signal(), Some(9), "{at}: it was never there");
        nobody_is_left_of(pid);
        if at == "held-back-seed.txt:named" {
            let made: u64 = fs::read_to_string(&seed).unwrap().trim().parse().unwrap();
            assert_ne!(made, 20191006);
            // That of the undisturbed run, for the same scenes.
            fs::write(&seed, &known).unwrap();
        }
    }
    let (code, said) = batch.grade();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("3 of 3 submissions keep their earlier grades"), "{said}");
    assert_eq!(results(&batch), results(&undisturbed));
}

#[test]
fn ended_at_any_moment_a_batch_goes_on_from_there() {
    let moments = std::env::var("UMBRA_KILL_MOMENTS").ok();
    let moments: usize = moments.map_or(50, |text| text.parse().unwrap());
    end_at_moments(moments, &|| Batch::new(&CLASS));
}

#[test]
#[ignore = "takes minutes: `./run kill` asks for it"]
fn ended_at_any_moment_while_code_runs_a_batch_goes_on_from_there() {
    let moments = std::env::var("UMBRA_KILL_MOMENTS").ok();
    let moments: usize = moments.map_or(50, |text| text.parse().unwrap());
    end_at_moments(moments.div_ceil(10), &with_one_that_runs);
}

/// Ends batches of a class at so many moments.
fn end_at_moments(moments: usize, class: &dyn Fn() -> Batch) {
    // What is made once and kept, such as the compiler's call, would count as the batch's time.
    assert_eq!(class().grade().0, Some(0));
    let undisturbed = class();
    let begun = Instant::now();
    assert_eq!(undisturbed.grade().0, Some(0));
    let whole = begun.elapsed();
    let expected = results(&undisturbed);
    let mut batch = class();
    let (mut killed, mut batches) = (0, 1);
    // A sequence that spreads evenly, whatever its length; where it met nobody alive, the next one counts.
    for moment in 0..4 * moments {
        if killed == moments {
            break;
        }
        let share = (moment as f64 * 0.618_033_988_749_895).fract();
        let mut child = batch.start_with(&[batch.submissions()], &[]);
        let until = Instant::now() + whole.mul_f64(share);
        while Instant::now() < until && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(2));
        }
        killed += usize::from(kill(child));
        if batch.out().join("report.html").exists() {
            let (code, said) = batch.grade();
            assert_eq!(code, Some(0), "{said}");
            assert_eq!(results(&batch), expected);
            batch = class();
            batches += 1;
        }
    }
    let (code, said) = batch.grade();
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(results(&batch), expected);
    assert_eq!(killed, moments, "so few moments met it alive");
    println!(
        "killed at {killed} moments of {:.2} s, in {batches} batches: all results are those of a run undisturbed",
        whole.as_secs_f64()
    );
}

/// A process in a grader's tree that answers as a worker, or is about to unless it must be locked.
fn worker_of(grader: u32, must_be_locked: bool) -> Option<i32> {
    let processes = Path::new("/proc").read_dir().unwrap().flatten().filter_map(|entry| {
        let stat = fs::read_to_string(entry.path().join("stat")).ok()?;
        let command = fs::read(entry.path().join("cmdline")).ok()?;
        let (head, rest) = stat.rsplit_once(") ")?;
        let (pid, _) = head.split_once(' ')?;
        let parent: i32 = rest.split(' ').nth(1)?.parse().ok()?;
        let status = fs::read_to_string(entry.path().join("status")).ok()?;
        let is_locked = !must_be_locked || status.contains("\nSeccomp:\t2");
        Some((pid.parse::<i32>().ok()?, parent, command.starts_with(b"worker\0") && is_locked))
    });
    let processes: Vec<_> = processes.collect();
    let mut own = vec![i32::try_from(grader).unwrap()];
    for at in 0.. {
        let Some(&parent) = own.get(at) else { break };
        own.extend(processes.iter().filter(|(_, of, _)| *of == parent).map(|(pid, ..)| *pid));
    }
    processes.iter().find(|(pid, _, wanted)| *wanted && own.contains(pid)).map(|(pid, ..)| *pid)
}

#[test]
fn a_worker_that_somebody_ends_costs_nothing() {
    let undisturbed = with_one_that_runs();
    assert_eq!(undisturbed.grade().0, Some(0));
    use Signal::{SIGKILL, SIGTERM};
    for (signal, must_be_locked) in [(SIGKILL, true), (SIGTERM, true), (SIGKILL, false)] {
        let batch = with_one_that_runs();
        let mut grader = batch.start_with(&[batch.submissions()], &[]);
        // Those that make scenes ready run no code of a student.
        while !batch.instructor("bob/record.json").exists() {
            assert!(grader.try_wait().unwrap().is_none());
            std::thread::sleep(Duration::from_millis(1));
        }
        loop {
            assert!(grader.try_wait().unwrap().is_none(), "no worker was met");
            let own = worker_of(grader.id(), must_be_locked).map(nix::unistd::Pid::from_raw);
            if own.is_some_and(|own| nix::sys::signal::kill(own, signal).is_ok()) {
                break;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        let output = grader.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{signal}: {output:?}");
        assert_eq!(batch.canonical(), undisturbed.canonical(), "{signal}");
    }
}

#[test]
fn two_graders_on_one_folder_and_a_submission_that_goes_away() {
    let undisturbed = Batch::new(&CLASS);
    assert_eq!(undisturbed.grade().0, Some(0));
    let batch = Batch::new(&CLASS);
    let both: Vec<Child> = (0..2).map(|_| batch.start_with(&[batch.submissions()], &[])).collect();
    for child in both {
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{output:?}");
    }
    assert_eq!(results(&batch), results(&undisturbed));

    let batch = Batch::new(&CLASS);
    let mut child = batch.start_with(&[batch.submissions()], &[]);
    while !batch.instructor("ada/record.json").exists() {
        assert!(child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(1));
    }
    fs::remove_dir_all(batch.submissions().join("eve")).unwrap();
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("eve is not there any more"), "{said}");
    assert!(said.contains("not graded yet, and not in the report: eve"), "{said}");
    let canonical = batch.canonical();
    assert!(canonical.contains("\"slug\": \"bob\"") && !canonical.contains("\"slug\": \"eve\""));
}
