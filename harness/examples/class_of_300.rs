//! A class as Brightspace gives it, graded to the end: submissions per minute, CPU time by stage, the parent's memory,
//! beside the loop that most courses have (build, render, compare) on some of the same submissions.
//!
//! ```sh
//! cargo build --release --workspace && target/release/xtask samples
//! cargo run --release --example class_of_300             # 30, then 300 submissions: most of an hour on two cores
//! cargo run --release --example class_of_300 -- 8 16     # other sizes
//! ```
#![cfg_attr(not(unix), allow(dead_code, unused_imports))]

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{Cursor, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use serde_json::Value;
use zip::write::SimpleFileOptions;

/// The samples that the class is made of, in turn: right, wrong, crashing, hanging, not compiling, wrong tree.
const SAMPLES: [&str; 10] = [
    "perfect",
    "no-falloff",
    "perfect-inlined",
    "panics",
    "diffuse-no-cosine",
    "does-not-compile",
    "perfect-merged",
    "hangs",
    "no-shadows",
    "wrong-tree",
];
/// Those that the loop is tried on: it waits for nobody that hangs, and unpacks no wrong tree.
const LOOPED: [&str; 3] = ["perfect", "no-falloff", "does-not-compile"];
/// Every so manyth submission is late, and every so manyth student has two attempts.
const LATE: usize = 10;
const TWICE: usize = 15;

/// Times classes of several sizes, beside a loop of build, render and compare.
#[derive(clap::Parser)]
#[command(name = "class_of_300")]
struct Arguments {
    /// Number of students of each class
    #[arg(default_values_t = [30, 300], value_parser = clap::value_parser!(u32).range(1..=10_000))]
    sizes: Vec<u32>,
}

#[cfg(not(unix))]
fn main() {
    println!("this example needs unzip, tar and /proc: it runs on Linux");
}

#[cfg(unix)]
fn main() -> anyhow::Result<()> {
    let Arguments { sizes } = clap::Parser::parse();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize()?;
    let place = tempfile::tempdir()?;
    for size in sizes {
        let size = size as usize;
        let download =
            place.path().join(format!("Assignment 2 Download Oct 9, 2019 {size} AM.zip"));
        make(&root, &download, size)?;
        println!(
            "{}",
            grade(&root, &download, &place.path().join(format!("report-{size}")), size)?
        );
    }
    println!("{}", loop_of_most_courses(&root, place.path())?);
    Ok(())
}

/// The archive of a sample, whatever its form.
fn archive(root: &Path, sample: &str) -> anyhow::Result<PathBuf> {
    let folder = root.join("target/umbra/samples");
    let found = ["zip", "tar.gz", "tar"].map(|form| folder.join(format!("{sample}.{form}")));
    found.into_iter().find(|path| path.is_file()).with_context(|| {
        format!("{}: no archive of {sample}; hint: target/release/xtask samples", folder.display())
    })
}

/// The download of a class of `size` students.
fn make(root: &Path, download: &Path, size: usize) -> anyhow::Result<()> {
    let mut zip = zip::ZipWriter::new(File::create(download)?);
    let stored = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    zip.start_file("index.html", stored)?;
    for student in 0..size {
        let path = archive(root, SAMPLES[student % SAMPLES.len()])?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let last =
            if student % LATE == LATE - 1 { "Oct 8, 2019 110 AM" } else { "Oct 6, 2019 830 PM" };
        let first = (student % TWICE == 0).then_some("Oct 5, 2019 415 PM");
        for when in first.into_iter().chain([last]) {
            zip.start_file(
                format!("{}-5150 - Student Number{student} - {when}/{name}", 1000 + student),
                stored,
            )?;
            zip.write_all(&of_student(&path, student)?)?;
        }
    }
    zip.finish()?;
    Ok(())
}

/// A sample's zip with a line of the student's own in `src/lib.rs`: none is served by another's library.
fn of_student(archive: &Path, student: usize) -> anyhow::Result<Vec<u8>> {
    let mut read = zip::ZipArchive::new(File::open(archive)?)?;
    let mut written = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for index in 0..read.len() {
        let mut file = read.by_index(index)?;
        let name = file.name()?.into_owned();
        if name.ends_with("src/lib.rs") {
            let mut text = String::new();
            file.read_to_string(&mut text)?;
            written.start_file(name, SimpleFileOptions::default())?;
            written.write_all(format!("{text}\n// Student {student}\n").as_bytes())?;
        } else {
            written.raw_copy_file(file)?;
        }
    }
    Ok(written.finish()?.into_inner())
}

/// Grades a download and says what it took.
fn grade(root: &Path, download: &Path, output: &Path, size: usize) -> anyhow::Result<String> {
    let begun = Instant::now();
    let mut umbra = Command::new(root.join("target/release/umbra"));
    umbra.arg("grade").arg(download).arg("--output").arg(output).arg("--root").arg(root);
    umbra.args(["--isolation", "reduced", "--held-back", "20191006"]);
    let mut child = umbra.stdout(Stdio::null()).spawn()?;
    let mut peak_kib = 0;
    let code = loop {
        let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let peak = peak.and_then(|text| text.trim().trim_end_matches(" kB").parse().ok());
        peak_kib = peak_kib.max(peak.unwrap_or(0_u64));
        if let Some(code) = child.try_wait()? {
            break code;
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    let took_s = begun.elapsed().as_secs_f64();
    ensure!(code.success(), "umbra grade ended with {code}");
    let report: Value = serde_json::from_slice(&fs::read(output.join("report.json"))?)?;
    let timings = report["timings"].as_object().context("timings")?;
    let mut stages: BTreeMap<String, f64> = BTreeMap::new();
    for stage in timings.values().filter_map(Value::as_array).flatten() {
        let name = stage["name"].as_str().unwrap_or_default();
        *stages.entry(name.to_owned()).or_default() += stage["cpu_s"].as_f64().unwrap_or_default();
    }
    let graded = timings.len();
    ensure!(graded == size, "{graded} of {size} students have a grade");
    let mut largest_mib = 0.0f64;
    for entry in output.read_dir()?.filter_map(Result::ok) {
        if entry.path().is_dir() && entry.file_name() != "instructor" {
            largest_mib = largest_mib.max(mib(&entry.path())?);
        }
    }
    let each: Vec<String> = stages
        .iter()
        .filter(|(_, cpu_s)| **cpu_s > 0.0)
        .map(|(name, cpu_s)| format!("{name} {:.2}", cpu_s / graded as f64))
        .collect();
    Ok(format!(
        "{size} students: {:.1} submissions a minute; CPU seconds each: {}; the parent's peak memory {:.0} MiB; the \
         report {:.0} MiB, of it the largest student's {:.1} MiB and expected images {:.1} MiB",
        graded as f64 / took_s * 60.0,
        each.join(", "),
        peak_kib as f64 / 1024.0,
        mib(output)?,
        largest_mib,
        mib(&output.join("instructor/viewer"))?
    ))
}

/// The size of all files below a folder; 0 where it is not.
fn mib(folder: &Path) -> anyhow::Result<f64> {
    let mut bytes = 0;
    if folder.is_dir() {
        for file in umbra::files::files_below(folder)? {
            bytes += fs::metadata(file)?.len();
        }
    }
    Ok(bytes as f64 / f64::from(1 << 20))
}

/// `cargo build`, render, compare for some submissions, one after the other, with a shared target folder and without
/// isolation.
fn loop_of_most_courses(root: &Path, place: &Path) -> anyhow::Result<String> {
    let work = place.join("loop");
    fs::create_dir_all(&work)?;
    #[cfg(unix)]
    std::os::unix::fs::symlink(root.join("harness"), work.join("harness"))?;
    // Copies: cargo leaves out of the lock file what is not here.
    for name in ["Cargo.lock", "rust-toolchain.toml"] {
        fs::copy(root.join(name), work.join(name))?;
    }
    let manifest = fs::read_to_string(root.join("Cargo.toml"))?;
    let manifest: Vec<&str> = manifest
        .lines()
        .map(|line| match line.split(" = ").next() {
            Some("members") => r#"members = ["student_template"]"#,
            Some("default-members") => r#"default-members = ["student_template"]"#,
            _ => line,
        })
        // Profiles of packages that are not there.
        .take_while(|line| !line.starts_with("[profile.release.package.umbra]"))
        .collect();
    fs::write(work.join("Cargo.toml"), manifest.join("\n"))?;
    let package = work.join("student_template");
    fs::create_dir_all(&package)?;
    fs::copy(root.join("student_template/Cargo.toml"), package.join("Cargo.toml"))?;
    let target = work.join("target");
    let build = |src: &Path| -> anyhow::Result<bool> {
        let _ = fs::remove_dir_all(package.join("src"));
        ensure!(
            Command::new("cp").arg("-r").arg(src).arg(package.join("src")).status()?.success(),
            "cp"
        );
        let mut cargo = Command::new("cargo");
        cargo.args(["build", "--release", "--quiet", "--offline"]).current_dir(&work);
        cargo.env("CARGO_TARGET_DIR", &target).stdout(Stdio::null()).stderr(Stdio::null());
        Ok(cargo.status()?.success())
    };
    // The base code is compiled for all.
    ensure!(build(&root.join("expected/a2/template"))?, "the template does not build in the loop");
    let umbra = root.join("target/release/umbra");
    let config: Value = serde_json::from_slice(&fs::read(root.join("config.json"))?)?;
    let begun = Instant::now();
    let (mut images, mut built) = (0, 0);
    for sample in LOOPED {
        let unpacked = work.join(sample);
        fs::create_dir_all(&unpacked)?;
        let archive = archive(root, sample)?;
        let mut unpack = if archive.extension().is_some_and(|end| end == "zip") {
            let mut unpack = Command::new("unzip");
            unpack.args(["-q", "-o"]).arg(&archive).arg("-d").arg(&unpacked);
            unpack
        } else {
            let mut unpack = Command::new("tar");
            unpack.arg("xf").arg(&archive).arg("-C").arg(&unpacked);
            unpack
        };
        ensure!(unpack.status().context("unzip or tar")?.success(), "{sample}: cannot be unpacked");
        let src = if unpacked.join("src").is_dir() { unpacked.join("src") } else { continue };
        if !build(&src)? {
            continue;
        }
        built += 1;
        let library = target.join("release").join(umbra::files::library_name("student_template"));
        let stored = |scene: &&Value| scene["stored"] == true;
        for scene in config["scenes"].as_array().context("scenes")?.iter().filter(stored) {
            for path in ["offline", "realtime"] {
                let image = unpacked.join(format!("{path}.exr"));
                let toml = root.join(scene[path].as_str().unwrap_or_default());
                let mut render = Command::new(&umbra);
                render
                    .arg("render")
                    .arg(toml)
                    .arg("--plugin")
                    .arg(&library)
                    .arg("--output")
                    .arg(&image);
                render.args(["--in-process", "--adapter", "software"]).arg("--root").arg(root);
                let drawn = render.stdout(Stdio::null()).stderr(Stdio::null()).status()?.success();
                if drawn && path == "offline" {
                    let name = scene["name"].as_str().unwrap_or_default();
                    let expected = root.join(format!("expected/a2/{name}.exr"));
                    let mut compare = Command::new(&umbra);
                    compare.arg("compare").arg(&image).arg(expected).args(["--layer", "mean"]);
                    compare.stdout(Stdio::null()).stderr(Stdio::null()).status()?;
                }
                images += usize::from(drawn);
            }
        }
    }
    let each_s = begun.elapsed().as_secs_f64() / LOOPED.len() as f64;
    Ok(format!(
        "cargo build, render, compare: {:.1} submissions a minute ({} of them, {built} built, {images} images of public \
         scenes); it isolates nothing, asks no part and explains nothing",
        60.0 / each_s,
        LOOPED.len()
    ))
}
