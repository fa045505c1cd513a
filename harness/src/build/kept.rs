//! Libraries that were built before: the same source is not compiled again.
//!
//! Only the parent writes here. It stores what the compiler's sandbox produced for a source, under a digest of the
//! whole source and the compiler call. So a submission can only affect its own entry. Without full isolation, a plugin
//! could write here, and the compiler could read files that the digest does not cover
//! (`include_str!("../config.json")`). Nothing is kept then: see [`KeptLibraries::within`].

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{BuildOutcome, BuildReport, Diagnostic, Recording, TEMPLATE};
use crate::files::{files_below, hex, keep_newest, library_name, write_whole};
use crate::process::ProcessLimits;
use crate::sandbox::Isolation;
use crate::worker::Supervisor;

/// Number of libraries, of about 10 MB each, that are kept; the oldest are removed.
const KEPT: usize = 64;
/// What is known of a library beside it.
const NOTE: &str = "note.json";

/// The libraries that were built before, if any can be kept here.
pub struct KeptLibraries(Option<PathBuf>);

/// What is known of a kept library.
#[derive(Serialize, Deserialize)]
struct Note {
    sha256: String,
    warnings: Vec<Diagnostic>,
}

impl KeptLibraries {
    /// Libraries are kept within `cache` where isolation is full: where the compiler sees nothing but the source, and
    /// no plugin can write there.
    pub fn within(cache: &Path, isolation: Isolation) -> Self {
        Self((isolation == Isolation::Full).then(|| cache.join("built")))
    }

    /// The library of this source, as [`compile`](super::compile) makes it, or as it was made before.
    ///
    /// # Errors
    /// Those of `compile`, and when the source cannot be read. Where nothing can be written, nothing is kept.
    pub fn compile(
        &self,
        recording: &Recording,
        supervisor: &Supervisor,
        src: &Path,
        out: &Path,
        limits: &ProcessLimits,
        cancel: &AtomicBool,
    ) -> io::Result<BuildReport> {
        self.found_or(recording, src, out, || {
            super::compile(recording, supervisor, src, out, limits, cancel)
        })
    }

    fn found_or(
        &self,
        recording: &Recording,
        src: &Path,
        out: &Path,
        compile: impl FnOnce() -> io::Result<BuildReport>,
    ) -> io::Result<BuildReport> {
        let Some(all) = &self.0 else { return compile() };
        let folder = all.join(key(recording, src)?);
        if let Some(found) = found(&folder, out) {
            return Ok(found);
        }
        let report = compile()?;
        if let BuildOutcome::Built { library } = &report.outcome
            && keep(all, &folder, library, &report.warnings).is_err()
        {
            let _ = fs::remove_dir_all(&folder);
        }
        Ok(report)
    }
}

/// Keeps a library in `folder`, and no more than [`KEPT`] in `all`.
fn keep(all: &Path, folder: &Path, library: &Path, warnings: &[Diagnostic]) -> io::Result<()> {
    let bytes = fs::read(library)?;
    fs::create_dir_all(folder)?;
    write_whole(&folder.join(library_name(TEMPLATE)), &bytes)?;
    let note = Note { sha256: hex(&Sha256::digest(&bytes)), warnings: warnings.to_vec() };
    write_whole(&folder.join(NOTE), &serde_json::to_vec(&note)?)?;
    keep_newest(all, KEPT)
}

/// A library that was kept whole, copied to `out`.
fn found(folder: &Path, out: &Path) -> Option<BuildReport> {
    let name = library_name(TEMPLATE);
    let note: Note = serde_json::from_slice(&fs::read(folder.join(NOTE)).ok()?).ok()?;
    let bytes = fs::read(folder.join(&name)).ok()?;
    if hex(&Sha256::digest(&bytes)) != note.sha256 {
        return None;
    }
    let library = out.join(name);
    super::replay::make_empty(&library).and_then(|()| fs::write(&library, bytes)).ok()?;
    let outcome = BuildOutcome::Built { library };
    Some(BuildReport { outcome, warnings: note.warnings, wall_s: 0.0, cpu_s: 0.0 })
}

/// All that a library depends on: the base code and the compiler, its call, and every file below `src`.
fn key(recording: &Recording, src: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    let mut add = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    add(recording.key.as_bytes());
    add(&serde_json::to_vec(&(&recording.args, &recording.env))?);
    for file in files_below(src)? {
        add(file.strip_prefix(src).unwrap_or(&file).as_os_str().as_encoded_bytes());
        add(&fs::read(&file)?);
    }
    Ok(hex(&hash.finalize()))
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn the_same_source_is_compiled_once_and_another_anew() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let [src, out, folder] = ["src", "out", "built"].map(at);
        [&src, &out].iter().for_each(|folder| fs::create_dir(folder).unwrap());
        let mut recording = Recording {
            rustc: PathBuf::new(),
            sysroot: PathBuf::new(),
            args: Vec::new(),
            env: BTreeMap::new(),
            closure: PathBuf::new(),
            key: "one".into(),
            version: String::new(),
        };
        let calls = Cell::new(0);
        let built = |recording: &Recording| {
            let kept = KeptLibraries::within(place.path(), Isolation::Full);
            let report = kept.found_or(recording, &src, &out, || {
                calls.set(calls.get() + 1);
                let library = out.join(library_name(TEMPLATE));
                fs::write(&library, format!("library {}", calls.get()))?;
                let outcome = BuildOutcome::Built { library };
                Ok(BuildReport { outcome, warnings: Vec::new(), wall_s: 1.0, cpu_s: 1.0 })
            });
            let BuildOutcome::Built { library } = report.unwrap().outcome else { panic!() };
            fs::read_to_string(library).unwrap()
        };
        fs::write(src.join("lib.rs"), "fn a() {}").unwrap();
        assert_eq!([built(&recording), built(&recording)], ["library 1", "library 1"]);
        // A shader, a moved byte, another base code.
        fs::write(src.join("a.wgsl"), "").unwrap();
        assert_eq!([built(&recording), built(&recording)], ["library 2", "library 2"]);
        fs::write(src.join("lib.rs"), "fn a() {").unwrap();
        fs::write(src.join("a.wgsl"), "}").unwrap();
        assert_eq!(built(&recording), "library 3");
        recording.key = "another".into();
        assert_eq!(built(&recording), "library 4");
        // One that was changed is not believed.
        for entry in fs::read_dir(&folder).unwrap() {
            fs::write(entry.unwrap().path().join(library_name(TEMPLATE)), "evil").unwrap();
        }
        assert_eq!([built(&recording), built(&recording)], ["library 5", "library 5"]);
        for number in 0..KEPT + 2 {
            fs::write(src.join("lib.rs"), number.to_string()).unwrap();
            built(&recording);
        }
        assert_eq!(fs::read_dir(&folder).unwrap().count(), KEPT);
    }

    #[test]
    fn what_does_not_compile_or_is_open_to_others_is_not_kept() {
        let place = tempfile::tempdir().unwrap();
        let recording = Recording {
            rustc: PathBuf::new(),
            sysroot: PathBuf::new(),
            args: Vec::new(),
            env: BTreeMap::new(),
            closure: PathBuf::new(),
            key: String::new(),
            version: String::new(),
        };
        let kept = KeptLibraries::within(place.path(), Isolation::Full);
        let outcome = BuildOutcome::CompileError { errors: Vec::new() };
        let report = BuildReport { outcome, warnings: Vec::new(), wall_s: 1.0, cpu_s: 1.0 };
        let again = kept.found_or(&recording, place.path(), place.path(), || Ok(report.clone()));
        assert_eq!(again.unwrap(), report);
        assert_eq!(fs::read_dir(&place).unwrap().count(), 0);
        // Nor is what was compiled where others can write.
        let kept = KeptLibraries::within(place.path(), Isolation::None);
        let library = place.path().join("src.rs");
        fs::write(&library, "").unwrap();
        let built = BuildReport { outcome: BuildOutcome::Built { library }, ..report };
        kept.found_or(&recording, place.path(), place.path(), || Ok(built)).unwrap();
        assert_eq!(fs::read_dir(&place).unwrap().count(), 1);
    }
}
