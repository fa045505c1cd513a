//! Times `umbra check` and `umbra watch`: a first check, one after an edit, from a save to the first image and to the
//! report, frames per second of the live view, and from a key to its picture. Also prints the size of the kit.
//!
//! ```sh
//! cargo build --release --workspace && cargo run --release --example watching    # minutes; it needs Chromium
//! ```
#![cfg_attr(not(unix), allow(dead_code, unused_imports))]

#[allow(dead_code, clippy::unwrap_used)] // of the tests, which use the rest
#[path = "../tests/support/chromium.rs"]
mod chromium;

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use anyhow::{Context as _, ensure};
use chromium::Chromium;
use serde_json::json;

/// A live view is measured for so long [ms].
const TURNED_MS: u32 = 4000;
/// Keys of which the median time is told.
const KEYS: u32 = 15;

/// What is edited.
const EDITS: [(&str, &str); 2] =
    [("Rust", "src/integrators/simple.rs"), ("a shader", "src/shaders/phong.fs.wgsl")];

/// Another text each time, which means the same.
fn edit(file: &Path) -> std::io::Result<()> {
    let text = fs::read_to_string(file)?;
    fs::write(file, format!("{text}// {}\n", text.len()))
}

#[cfg(not(unix))]
fn main() {
    println!("the live view needs Linux or macOS");
}

#[cfg(unix)]
fn main() -> anyhow::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize()?;
    let umbra = root.join("target/release/umbra");
    ensure!(umbra.is_file(), "{}: hint: cargo build --release --workspace", umbra.display());
    let place = tempfile::tempdir()?;
    let work = place.path().join("work");
    for source in ["student_template/src", "samples/perfect/src"] {
        copy(&root.join(source), &work.join("src"))?;
    }
    let check = |what: &str| -> anyhow::Result<f64> {
        let mut check = Command::new(&umbra);
        check.arg("check").arg(&work).arg("--root").arg(&root);
        check.arg("--output").arg(place.path().join("checked"));
        let begun = Instant::now();
        let mut check = check.stdout(Stdio::null()).stderr(Stdio::piped()).spawn()?;
        let said = BufReader::new(check.stderr.take().context("what it says")?).lines();
        let mut first_s = f64::NAN;
        for line in said.map_while(Result::ok) {
            if line.starts_with("umbra: first verdict") {
                first_s = begun.elapsed().as_secs_f64();
            }
        }
        check.wait()?;
        let whole_s = begun.elapsed().as_secs_f64();
        println!("umbra check {what}: {first_s:.1} s to the first verdict, {whole_s:.1} s to all");
        Ok(whole_s)
    };
    check("for what an assignment makes once")?;
    // What is known of sources. Dependencies and expected images stay, as a student's kit has them.
    for kept in ["built", "shaders"] {
        fs::remove_dir_all(root.join("target/umbra").join(kept))?;
    }
    fs::remove_dir_all(place.path().join("checked"))?;
    let nothing_s = check("of which nothing is kept")?;
    let mut edited_s = Vec::new();
    for (what, file) in EDITS {
        edit(&work.join(file))?;
        edited_s.push(check(&format!("after an edit of {what}"))?);
    }
    check("without an edit")?;

    let mut browser = Chromium::start().context("there is no Chromium on PATH")?;
    let out = place.path().join("out");
    let mut watch = Command::new(&umbra);
    watch.arg("watch").arg(&work).arg("--root").arg(&root).arg("--output").arg(&out);
    watch.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    let mut watch = Watch(watch.stdout(Stdio::piped()).stderr(Stdio::null()).spawn()?);
    let said = watch.0.stdout.take().context("its output")?;
    // Open to the end: each check prints there.
    let mut said = BufReader::new(said).lines();
    let door = said.next().context("it says where its page is")??;
    browser.call("Page.navigate", json!({"url": format!("file://{door}")}));
    browser.until("location.protocol === 'http:' && live.scenes.length > 0");
    until_checked(&mut browser);

    for ((what, file), edited_s) in EDITS.into_iter().zip(edited_s) {
        browser.value("window.before = { libraries: live.libraries, reports, pictures: +live.views.realtime.figure.dataset.frames }");
        let begun = Instant::now();
        edit(&work.join(file))?;
        browser.until(
            "live.libraries > before.libraries && +live.views.realtime.figure.dataset.frames > before.pictures",
        );
        let image_s = begun.elapsed().as_secs_f64();
        // What a save of shaders alone can change is judged first.
        let judged =
            "status.textContent.includes('points so far: 2.1') || reports > before.reports";
        browser.until(judged);
        let judged_s = begun.elapsed().as_secs_f64();
        browser.until("reports > before.reports");
        until_checked(&mut browser);
        let whole_s = begun.elapsed().as_secs_f64();
        println!(
            "a save of {what}: {image_s:.1} s to the first image, {judged_s:.1} s to the points of 2.1 to 2.5 ({:.0} % of \
             a check from nothing), {whole_s:.1} s to the whole ({:.0} %; {:.0} % of one after the same edit)",
            100.0 * judged_s / nothing_s,
            100.0 * whole_s / nothing_s,
            100.0 * whole_s / edited_s
        );
    }

    for scene in ["cbox", "teapot"] {
        browser.value(&format!(
            "(control('spp').value = 0, control('scene').value = '{scene}', control('scene').dispatchEvent(new Event('change')))"
        ));
        browser.until("live.views.realtime.picture?.width > 128 && !live.views.realtime.under && live.views.offline.figure.dataset.spp");
        let frames = browser.value(&format!(
            "new Promise((done) => {{ const view = live.views.realtime, first = +view.figure.dataset.frames, begun = performance.now(); \
             const step = () => {{ orbit(0.01, 0); const ms = performance.now() - begun; \
             if (ms < {TURNED_MS}) requestAnimationFrame(step); else done((+view.figure.dataset.frames - first) / ms * 1000); }}; step(); }})"
        ));
        browser.until("!live.views.realtime.under && !live.views.realtime.dirty");
        let size = browser
            .value("`${live.views.realtime.picture.width}x${live.views.realtime.picture.height}`");
        let mut waits = Vec::new();
        for _ in 0..KEYS {
            let ms = browser.value(
                "new Promise((done) => { const view = live.views.realtime, first = view.figure.dataset.frames, begun = performance.now(); \
                 view.canvas.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft' })); \
                 const look = () => requestAnimationFrame(() => +view.figure.dataset.frames > +first ? requestAnimationFrame(() => done(performance.now() - begun)) : look()); look(); })",
            );
            waits.push(ms.as_f64().context("milliseconds")?);
        }
        waits.sort_by(f64::total_cmp);
        println!(
            "{scene} at {}: {:.0} frames a second; {:.0} ms from a key to the picture",
            size.as_str().unwrap_or_default(),
            frames.as_f64().context("a rate")?,
            waits[waits.len() / 2]
        );
    }
    println!("the student's folder, all right: {:.1} MiB", mib(&out)?);
    Ok(())
}

/// Ended as Ctrl-C does.
struct Watch(Child);

impl Drop for Watch {
    fn drop(&mut self) {
        #[cfg(unix)]
        if let Ok(id) = i32::try_from(self.0.id()) {
            use nix::sys::signal::{Signal, kill};
            let _ = kill(nix::unistd::Pid::from_raw(id), Signal::SIGTERM);
        }
        let _ = self.0.wait();
    }
}

/// A whole check takes longer than a test may wait for anything.
fn until_checked(browser: &mut Chromium) {
    let done = "document.body.className === 'done' && mark.hidden";
    while browser.value(done) != true {
        assert_ne!(browser.value("document.body.className"), "failed", "there is no report");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
}

fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in from.read_dir()? {
        let entry = entry?;
        let to = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &to)?;
        } else {
            fs::copy(entry.path(), to)?;
        }
    }
    Ok(())
}

fn mib(folder: &Path) -> std::io::Result<f64> {
    let mut bytes = 0;
    for file in umbra::files::files_below(folder)? {
        bytes += fs::metadata(file)?.len();
    }
    Ok(bytes as f64 / f64::from(1 << 20))
}
