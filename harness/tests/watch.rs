//! `umbra watch` in a real browser: a save, a compiler error, a shader error, a panic, a hang, and the recovery from
//! each, in the report and in the live view.

#![cfg(unix)]

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::support::chromium::{Chromium, SHIFT};
use crate::support::one_scene;

/// The watch, ended as Ctrl-C does.
struct Watch(Child);

impl Drop for Watch {
    fn drop(&mut self) {
        let _ = kill(Pid::from_raw(self.0.id() as i32), Signal::SIGTERM);
        let _ = self.0.wait();
    }
}

/// How often any thread of it was woken so far; 0 where that is not told.
fn wakes(watch: &Watch) -> u64 {
    let tasks =
        fs::read_dir(format!("/proc/{}/task", watch.0.id())).into_iter().flatten().flatten();
    let status = tasks.filter_map(|task| fs::read_to_string(task.path().join("status")).ok());
    let switches = |status: String| {
        let lines = status.lines().filter(|line| line.contains("voluntary_ctxt_switches"));
        lines.filter_map(|line| line.split('\t').nth(1)?.parse::<u64>().ok()).sum::<u64>()
    };
    status.map(switches).sum()
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

/// Waits until the live view shows a picture of what was saved last, in both frames.
fn until_drawn(browser: &mut Chromium) {
    for path in ["realtime", "offline"] {
        browser.until(&format!(
            "(({{ problem, picture, figure }}) => problem.hidden && picture && !figure.classList.contains('earlier'))(live.views.{path})"
        ));
    }
    browser.until("live.views.offline.figure.dataset.spp === '16' && !live.views.realtime.under");
}

/// What a frame shows.
fn picture(browser: &mut Chromium, path: &str) -> String {
    let url = format!("live.views.{path}.canvas.toDataURL()");
    browser.value(&url).as_str().unwrap().to_owned()
}

/// What is said in the place of a picture.
fn problem(path: &str, words: &str) -> String {
    format!(
        "((view) => !view.problem.hidden && view.problem.textContent.includes('{words}'))(live.views.{path})"
    )
}

/// Turns the camera, moves it and comes nearer; then goes back to where it was.
fn looks_around(browser: &mut Chromium) {
    let [realtime, offline] = ["realtime", "offline"].map(|path| picture(browser, path));
    let middle = browser.value(
        "(({ left, top, width, height }) => [left + width / 2, top + height / 2])(live.views.realtime.canvas.getBoundingClientRect())",
    );
    let [x, y] = [0, 1].map(|axis| middle[axis].as_f64().unwrap());
    let differs = |path: &str, from: &str| {
        format!("live.views.{path}.canvas.toDataURL() !== '{from}' && !live.views.realtime.under")
    };
    let distance = "Math.hypot(...sub(live.camera.eye, live.camera.at))";
    let far = browser.value(distance).as_f64().unwrap();
    let at = browser.value("live.camera.at");

    browser.mouse("mousePressed", x, y);
    browser.mouse("mouseMoved", x + 40.0, y + 25.0);
    browser.mouse("mouseReleased", x + 40.0, y + 25.0);
    browser.until(&differs("realtime", &realtime));
    browser.until(&differs("offline", &offline));
    assert_eq!(browser.value("live.camera.at"), at, "the target stays");
    assert!((browser.value(distance).as_f64().unwrap() / far - 1.0).abs() < 1e-6);

    let turned = picture(browser, "realtime");
    browser.wheel(x, y, -200.0);
    assert!(browser.value(distance).as_f64().unwrap() < 0.9 * far);
    browser.until(&differs("realtime", &turned));
    browser.value("live.views.realtime.canvas.focus()");
    let near = picture(browser, "realtime");
    browser.key("ArrowLeft", SHIFT);
    assert_ne!(browser.value("live.camera.at"), at, "moved");
    browser.until(&differs("realtime", &near));

    // From the same place everything looks the same.
    browser.key("r", 0);
    for (path, was) in [("realtime", &realtime), ("offline", &offline)] {
        browser.until(&format!("live.views.{path}.canvas.toDataURL() === '{was}'"));
    }

    // Exposure asks nobody.
    let asked = browser.value("live.views.realtime.asked");
    browser.value(
        "control('exposure').value = 2, control('exposure').dispatchEvent(new Event('input'))",
    );
    assert_ne!(picture(browser, "realtime"), realtime);
    browser.value(
        "control('exposure').value = 0, control('exposure').dispatchEvent(new Event('input'))",
    );
    assert_eq!(picture(browser, "realtime"), realtime);
    assert_eq!(browser.value("live.views.realtime.asked"), asked);
}

/// A page that asks for a picture takes no picture from another one; its own older one it does.
fn several_pages_share_it(browser: &mut Chromium) {
    let asked = |pages: [u32; 2]| {
        format!(
            "Promise.all({pages:?}.map((page, turn) => new Promise((done) => setTimeout(done, 50 * turn)).then(() => \
             fetch(address('offline', 64).replace(/viewer=\\d+/, `viewer=${{page}}`).replace('camera=', turn ? 'camera=' : 'camera=1'))) \
             .then((answer) => answer.status)))"
        )
    };
    assert_eq!(browser.value(&asked([1, 2])), serde_json::json!([200, 200]));
    assert_eq!(browser.value(&asked([3, 3])), serde_json::json!([204, 200]));

    // Nearer and further than any camera can be.
    for (way, times) in [("+", 200), ("-", 400)] {
        browser.value(&format!(
            "for (let i = 0; i < {times}; i++) zoom('{way}' === '+' ? 0.8 : 1.25)"
        ));
        browser.until("!live.views.realtime.under && !live.views.realtime.dirty");
        assert_eq!(
            browser.value(
                "live.views.realtime.problem.hidden && Math.hypot(...live.camera.eye) < 1e6"
            ),
            true
        );
    }
    browser.value("reset()");
    assert_eq!(
        browser.value("[...document.body.children].map((one) => one.localName).join() + document.querySelectorAll('h1').length"),
        "main,script1"
    );
    until_drawn(browser);
}

/// A watch of a folder, for some parts on one scene, and the lines that it prints.
fn watching(
    work: &Path,
    parts: &[&str],
    out: &Path,
) -> (Watch, std::io::Lines<BufReader<std::process::ChildStdout>>) {
    let assignment = one_scene(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("one-scene"), |_| ());
    let mut command = Command::new(env!("CARGO_BIN_EXE_umbra"));
    command.arg("watch").arg(work).args(parts.iter().flat_map(|part| ["--part", part]));
    command.arg("--report").arg(out).arg("--root").arg(assignment);
    command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    let mut watch = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let said = BufReader::new(watch.stdout.take().unwrap()).lines();
    (Watch(watch), said)
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
    let (watch, mut said) = watching(&work, &["1.1", "2.4"], &place.path().join("out"));
    let door = said.next().unwrap().unwrap();

    // The file leads to the page; no address with the secret was in a command line.
    browser.call("Page.navigate", serde_json::json!({"url": format!("file://{door}")}));
    browser.until("location.protocol === 'http:' && document.body.className === 'done'");
    let report = "document.getElementById('report').contentDocument";
    let points = format!("{report}.querySelector('.sum strong').textContent === '30'");
    browser.until(&points);

    until_drawn(&mut browser);
    looks_around(&mut browser);
    several_pages_share_it(&mut browser);

    let file = work.join("src/bsdfs/diffuse.rs");
    let right = fs::read_to_string(&file).unwrap();
    fs::write(&file, format!("{right}\nfn broken() -> f32 {{ \"words\" }}\n")).unwrap();
    browser.until("document.body.className === 'running'");
    // The compiler's words come before anything else is checked.
    browser.until(
        "document.body.className === 'running' && document.getElementById('status').textContent.startsWith('Checking: does not compile: src/bsdfs/diffuse.rs:')",
    );
    browser
        .until(&format!("{report}.querySelector('pre').textContent.includes('mismatched types')"));
    // It is not said to be done: title and status line carry the verdict.
    assert_eq!(browser.value("document.body.className"), "refused");
    assert_eq!(browser.value("document.title"), "does not compile - umbra watch");
    browser.until("document.getElementById('status').textContent.includes('mismatched types')");
    let shown = browser.value(&format!("{report}.querySelector('main h2').textContent"));
    assert_eq!(shown, "The compiler says", "the error comes first");
    browser.until("live.views.realtime.figure.classList.contains('earlier')");

    // A panic is shown in its own words.
    let eval = "-> Vec3 {";
    assert_eq!(right.matches(eval).count(), 1);
    let pass = work.join("src/renderpasses/simple.rs");
    let right_pass = fs::read_to_string(&pass).unwrap();
    let draw = "let mut frame = FrameUniforms::new(camera);";
    assert_eq!(right_pass.matches(draw).count(), 1);
    fs::write(&pass, right_pass.replace(draw, &format!("panic!(\"in a frame\"); {draw}"))).unwrap();
    fs::write(&file, right.replace(eval, "-> Vec3 { panic!(\"on purpose\");")).unwrap();
    browser.until(&problem("realtime", "the renderer panicked: in a frame"));
    browser.until(&format!("{report}.body.textContent.includes('on purpose')"));
    browser.until("document.body.className === 'lost' && document.title.includes('of 30 points')");
    browser.until("document.getElementById('status').textContent.includes('panicked: on purpose')");

    // A frame that hangs is given up by the next save, whatever it would have said.
    fs::write(&file, &right).unwrap();
    browser.value("window.before = live.libraries");
    fs::write(&pass, right_pass.replace(draw, &format!("loop {{}} {draw}"))).unwrap();
    browser.until("live.libraries > before && live.views.realtime.under > 0");
    fs::write(&pass, &right_pass).unwrap();
    browser.until("live.libraries > before + 1");
    until_drawn(&mut browser);
    browser.until("document.body.className === 'done'");
    std::thread::sleep(std::time::Duration::from_secs(6));
    assert_eq!(browser.value("live.views.realtime.problem.hidden"), true);
    // So is another scene, here one with a shadow map, of the same page.
    let new = "let camera = scene.camera(1, 1)?;";
    assert_eq!(right_pass.matches(new).count(), 1);
    let plain = format!("if !shadow_map {{ loop {{}} }} {new}");
    fs::write(&pass, right_pass.replace(new, &plain)).unwrap();
    browser.until("live.libraries > before + 2 && live.views.realtime.under > 0");
    browser.value(
        "window.frames = +live.views.realtime.figure.dataset.frames; control('map').click()",
    );
    browser.until(
        "+live.views.realtime.figure.dataset.frames > frames && live.views.realtime.problem.hidden",
    );
    browser.value("control('map').click()");
    fs::write(&pass, &right_pass).unwrap();
    browser.until("live.libraries > before + 3 && document.body.className === 'done'");

    // One that hangs is ended by the next save; a frame that hangs, after a while.
    let second = "static DRAWN: std::sync::atomic::AtomicBool = std::sync::atomic::AtomicBool::new(false); \
                  if DRAWN.swap(true, std::sync::atomic::Ordering::Relaxed) { loop {} }";
    fs::write(&pass, right_pass.replace(draw, &format!("{second} {draw}"))).unwrap();
    fs::write(&file, right.replace(eval, "-> Vec3 { loop {}")).unwrap();
    browser.until("document.getElementById('status').textContent.includes('rendering offline')");
    browser.until("live.views.realtime.problem.hidden && !live.views.realtime.under");
    browser.value("orbit(0.1, 0)");
    browser.until(&problem("realtime", "no answer within 2 s of CPU time"));

    // A shader error, at its line.
    let shader = work.join("src/shaders/phong.fs.wgsl");
    let right_shader = fs::read_to_string(&shader).unwrap();
    let line = right_shader.lines().count() + 2;
    fs::write(&shader, format!("{right_shader}\nfn broken() -> f32 {{ return words; }}\n"))
        .unwrap();
    fs::write(&pass, &right_pass).unwrap();
    fs::write(&file, right).unwrap();
    let at = format!("src/shaders/phong.fs.wgsl:{line}:");
    browser.until(&problem("realtime", &at));
    // The report says the same, and what else is right.
    browser.until(&format!(
        "{report}.body.textContent.includes('{at}') && {report}.querySelector('.sum strong').textContent === '5'"
    ));

    fs::write(&shader, right_shader).unwrap();
    // What was found offline stays, marked, until it was run again; what changed is judged first.
    browser.until("mark.textContent.includes('offline results hold') && !mark.hidden");
    browser.until(
        "document.body.className === 'running' && status.textContent.includes('points so far: 2.1 5 of 5') \
         && !status.textContent.includes('1.1 ')",
    );
    until_drawn(&mut browser);
    browser.until("mark.hidden && document.body.className === 'done'");
    browser.until(&points);
    assert!(browser.value(&format!("{report}.querySelector('pre')")).is_null());

    assert_eq!(browser.serious_findings(), Vec::<String>::new());

    drop(watch);
    browser.until("document.getElementById('status').textContent === 'umbra watch has ended'");
    assert!(!Path::new(&door).exists());
}

/// Waits until the report tells of some words in the source.
fn until_told(report: &Path, words: &str) {
    let begun = std::time::Instant::now();
    while !fs::read_to_string(report).is_ok_and(|page| page.contains(words)) {
        assert!(begun.elapsed().as_secs() < 100, "{words} was not seen");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
}

#[test]
fn a_folder_that_is_replaced_is_watched_again() {
    let place = tempfile::tempdir().unwrap();
    let work = place.path().join("mine");
    let write = |word: &str| {
        fs::create_dir_all(work.join("src")).unwrap();
        fs::write(work.join("src/lib.rs"), format!("fn main() {{ {word} }}")).unwrap();
    };
    write("first_word");
    let out = place.path().join("out");
    let (_watch, _said) = watching(&work, &["1.1"], &out);
    let report = out.join("mine/report.html");
    until_told(&report, "first_word");
    let pause = std::time::Duration::from_millis;
    for (turn, [apart, moved]) in [[0, 0], [1500, 0], [0, 1]].into_iter().enumerate() {
        match moved {
            0 => fs::remove_dir_all(&work).unwrap(),
            _ => fs::rename(&work, place.path().join("away")).unwrap(),
        }
        std::thread::sleep(pause(apart));
        write(&format!("back_{turn}"));
        until_told(&report, &format!("back_{turn}"));
        write(&format!("saved_{turn}"));
        until_told(&report, &format!("saved_{turn}"));
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_terminal_that_closes_leaves_nothing_behind() {
    let place = tempfile::tempdir().unwrap();
    let work = place.path().join("work");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    copy(&root.join("student_template/src"), &work.join("src"));
    let (mut watch, mut said) = watching(&work, &["1.1"], &place.path().join("out"));
    let door = said.next().unwrap().unwrap();
    let own = work.display().to_string();
    let running = || {
        let all = fs::read_dir("/proc").unwrap().flatten();
        let lines = all.filter_map(|entry| fs::read_to_string(entry.path().join("cmdline")).ok());
        lines.filter(|line| line.contains(&own)).count()
    };
    let begun = std::time::Instant::now();
    while running() < 2 {
        assert!(begun.elapsed().as_secs() < 20, "no check was begun");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    // The shell and the system may both tell it.
    for _ in 0..2 {
        kill(Pid::from_raw(watch.0.id() as i32), Signal::SIGHUP).unwrap();
    }
    assert!(watch.0.wait().unwrap().success());
    assert!(!Path::new(&door).parent().unwrap().exists());
    assert_eq!(running(), 0);
}

#[test]
#[cfg(target_os = "linux")]
fn an_idle_watch_is_not_woken() {
    let place = tempfile::tempdir().unwrap();
    let work = place.path().join("work");
    fs::create_dir_all(work.join("src")).unwrap();
    fs::write(work.join("src/lib.rs"), "fn main() { not_rust }").unwrap();
    let (watch, said) = watching(&work, &["1.1"], &place.path().join("out"));
    // A check ends with where its page is.
    let page = "report.html";
    let mut said = said.map_while(Result::ok).filter(|line| line.contains(page));
    assert!(said.next().is_some());
    // It has ended, and so have the threads that heard it.
    std::thread::sleep(std::time::Duration::from_secs(2));
    let before = wakes(&watch);
    std::thread::sleep(std::time::Duration::from_secs(3));
    assert_eq!(wakes(&watch), before);
    // It still hears a save.
    fs::write(work.join("src/lib.rs"), "fn main() { nothing_else }").unwrap();
    assert!(said.next().is_some());
}
