//! `umbra watch` in a real browser: a save, a compiler error, a panic, a hang, and the recovery from each.

#![cfg(unix)]

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::support::chromium::Chromium;
use crate::support::one_scene;

/// The watch, ended as Ctrl-C does.
struct Watch(Child);

impl Drop for Watch {
    fn drop(&mut self) {
        let _ = kill(Pid::from_raw(self.0.id() as i32), Signal::SIGTERM);
        let _ = self.0.wait();
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in from.read_dir().unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

#[test]
fn every_save_is_checked_and_what_went_wrong_is_shown_until_the_next_one() {
    let Some(mut browser) = Chromium::start() else { return };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let place = tempfile::tempdir().unwrap();
    let work = place.path().join("work");
    for source in ["student_template/src", "samples/perfect/src"] {
        copy(&root.join(source), &work.join("src"));
    }
    let assignment = one_scene(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("one-scene"), |_| ());
    let mut watch = Command::new(env!("CARGO_BIN_EXE_umbra"))
        .arg("watch")
        .arg(&work)
        .args(["--part", "1.1", "--output"])
        .arg(place.path().join("out"))
        .arg("--root")
        .arg(assignment)
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(watch.stdout.take().unwrap()).lines();
    let watch = Watch(watch);
    let door = said.next().unwrap().unwrap();

    // The file leads to the page; no address with the secret was in a command line.
    browser.call("Page.navigate", serde_json::json!({"url": format!("file://{door}")}));
    browser.until("location.protocol === 'http:' && document.body.className === 'done'");
    let report = "document.getElementById('report').contentDocument";
    let points = format!("{report}.querySelector('.sum strong').textContent === '5'");
    browser.until(&points);

    let file = work.join("src/bsdfs/diffuse.rs");
    let right = fs::read_to_string(&file).unwrap();
    fs::write(&file, format!("{right}\nfn broken() -> f32 {{ \"words\" }}\n")).unwrap();
    browser.until("document.body.className === 'running'");
    browser
        .until(&format!("{report}.querySelector('pre').textContent.includes('mismatched types')"));
    assert_eq!(browser.value("document.body.className"), "done");
    let shown = browser.value(&format!("{report}.querySelector('main h2').textContent"));
    assert_eq!(shown, "The compiler says", "the error comes first");

    // A panic is shown in its own words.
    let eval = "-> Vec3 {";
    assert_eq!(right.matches(eval).count(), 1);
    fs::write(&file, right.replace(eval, "-> Vec3 { panic!(\"on purpose\");")).unwrap();
    browser.until(&format!("{report}.body.textContent.includes('on purpose')"));

    // One that hangs is ended by the next save.
    fs::write(&file, right.replace(eval, "-> Vec3 { loop {}")).unwrap();
    browser.until("document.getElementById('status').textContent.includes('rendering offline')");
    fs::write(&file, right).unwrap();
    browser.until(&points);
    assert!(browser.value(&format!("{report}.querySelector('pre')")).is_null());

    drop(watch);
    browser.until("document.getElementById('status').textContent === 'umbra watch has ended'");
    assert!(!Path::new(&door).exists());
}
