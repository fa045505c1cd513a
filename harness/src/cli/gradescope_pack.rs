//! `umbra gradescope-pack`: an autograder for Gradescope, a zip with Umbra's source, the assignment, and two scripts.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{BufWriter, Read as _, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use zip::write::SimpleFileOptions;
use zip::{DateTime, ZipWriter};

use super::context::Context;
use crate::columns::count;
use crate::files::files_below;
use crate::held_back::secret_seed;
use crate::intake::text_of;

/// What runs when the image is built, and for each submission.
const SCRIPTS: [(&str, &str); 2] = [
    ("setup.sh", include_str!("../../../contrib/gradescope/setup.sh")),
    ("run_autograder", include_str!("../../../contrib/gradescope/run_autograder")),
];
/// What is not needed there, at the top of the repository.
const LEFT_OUT: [&str; 3] = ["docs", "samples", "target"];
/// What Umbra is built from; a student's kit lacks the first.
const NEEDED: [&str; 3] = ["harness/Cargo.toml", "Cargo.toml", "scenes"];
/// The file of the seed in the zip.
const SEED_FILE: &str = "held-back-seed.txt";
/// The folder of all but the scripts.
const FOLDER: &str = "umbra";

/// Options of `umbra gradescope-pack`.
#[derive(clap::Args)]
pub struct PackArguments {
    /// The zip to write, which Gradescope takes as an autograder
    #[arg(default_value = "autograder.zip")]
    out: PathBuf,
    /// Seed of the held-back scenes, such as that of another report [default: a new secret one]
    #[arg(long = "held-back", alias = "perturb", value_name = "SEED")]
    held_back_seed: Option<u64>,
}

/// Writes the zip and says what to do with it.
///
/// # Errors
/// When Umbra's repository is incomplete, or the zip cannot be read or written.
pub fn run(arguments: &PackArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let assignment = Context::assignment(root)?;
    for needed in NEEDED {
        ensure!(
            assignment.root.join(needed).exists(),
            "{} has no {needed}: an autograder is built from Umbra's repository; hint: --root REPOSITORY",
            assignment.root.display()
        );
    }
    let out = &arguments.out;
    // A new seed would give half of the class other scenes.
    let kept = if out.symlink_metadata().is_ok() { Some(seed_of(out)?) } else { None };
    let seed = arguments.held_back_seed.or(kept).map_or_else(secret_seed, Ok)?;
    match kept {
        Some(kept) if kept == seed => println!("it keeps the seed of the zip that it replaces"),
        Some(kept) => println!("warning: the zip that it replaces had another seed, {kept}"),
        None => {}
    }
    let written = write(&assignment.root, seed, out)
        .with_context(|| format!("cannot write {}", out.display()))?;
    println!(
        "{}: {}; held-back seed {seed}: `umbra grade --held-back {seed}` asks the same here",
        out.display(),
        count(written, "file")
    );
    println!(
        "in Gradescope: Configure Autograder, upload it, Ubuntu 22.04, a container of 3 GB or more. Its own late policy \
         counts: the one in config.json is left out. Students submit their archive, or what is in it"
    );
    Ok(super::EXIT_OK)
}

/// The seed in a zip that was packed before.
///
/// # Errors
/// When it is no such zip.
fn seed_of(out: &Path) -> anyhow::Result<u64> {
    let read = || -> Option<u64> {
        let mut zip = zip::ZipArchive::new(File::open(out).ok()?).ok()?;
        let mut text = String::new();
        zip.by_name(SEED_FILE).ok()?.take(64).read_to_string(&mut text).ok()?;
        text.trim().parse().ok()
    };
    read().with_context(|| {
        format!("{} is there already, and is no autograder; hint: name another file", out.display())
    })
}

/// Writes the zip under another name and renames it; answers how many files are in it.
fn write(root: &Path, seed: u64, out: &Path) -> anyhow::Result<usize> {
    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let partial = tempfile::Builder::new().prefix(".umbra-").tempfile_in(folder)?;
    let mut zip = ZipWriter::new(BufWriter::new(File::create(partial.path())?));
    let mut number = 0;
    let mut put = |path: &str, bytes: &[u8], is_program: bool| -> anyhow::Result<()> {
        let options = SimpleFileOptions::default().last_modified_time(DateTime::default());
        zip.start_file(path, options.unix_permissions(if is_program { 0o755 } else { 0o644 }))?;
        zip.write_all(bytes)?;
        number += 1;
        Ok(())
    };
    for (name, text) in SCRIPTS {
        put(name, text.as_bytes(), true)?;
    }
    put(SEED_FILE, format!("{seed}\n").as_bytes(), false)?;
    for path in content(root)? {
        let bytes =
            std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let below = path.strip_prefix(root).unwrap_or(&path);
        let bytes = if below == Path::new("config.json") { without_late(&bytes)? } else { bytes };
        let names: Vec<_> = below.iter().map(OsStr::to_string_lossy).collect();
        put(&format!("{FOLDER}/{}", names.join("/")), &bytes, is_program(&path))?;
    }
    zip.finish()?.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
    // As any other file, not private as a temporary one.
    #[cfg(unix)]
    std::fs::set_permissions(partial.path(), std::os::unix::fs::PermissionsExt::from_mode(0o644))?;
    partial.persist(out)?;
    Ok(number)
}

/// The files of the repository that Umbra is built from and grades with, sorted.
fn content(root: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in root.read_dir()? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name.starts_with('.') || LEFT_OUT.contains(&name.as_str()) {
            continue;
        }
        if path.is_dir() {
            files.extend(files_below(&path)?);
        } else if is_source(&path) {
            files.push(path);
        }
    }
    let is_built = |file: &PathBuf| {
        file.strip_prefix(root).is_ok_and(|below| below.iter().any(|name| name == "target"))
    };
    files.retain(|file| !is_built(file));
    files.sort();
    Ok(files)
}

/// Whether a file at the top belongs to the repository: not a download or an archive that lies there.
fn is_source(path: &Path) -> bool {
    let kinds = ["toml", "lock", "json", "md"];
    let ending = path.extension().and_then(OsStr::to_str);
    ending.is_none_or(|ending| kinds.contains(&ending))
}

/// Lateness is Gradescope's to judge, and extensions are nobody else's matter.
fn without_late(config: &[u8]) -> anyhow::Result<Vec<u8>> {
    let mut config: serde_json::Value = serde_json::from_str(&text_of(config))?;
    if let Some(config) = config.as_object_mut() {
        config.remove("late");
    }
    Ok(serde_json::to_vec_pretty(&config)?)
}

#[cfg(unix)]
fn is_program(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt as _;
    path.metadata().is_ok_and(|meta| meta.permissions().mode() & 0o100 != 0)
}

#[cfg(not(unix))]
fn is_program(_path: &Path) -> bool {
    false
}
