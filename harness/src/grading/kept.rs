//! Records that are kept while a batch goes on: whatever ends it, the same command does only what
//! is missing. Points are made from records anew each time.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::Context;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::pipeline::{Folders, Grading};
use super::record::Record;
use crate::evidence::{Check, Verdict};
use crate::expected::scene_digest;
use crate::files::{hex, write_whole};

/// The record's file, beside the instructor's report on the hand-in.
const FILE: &str = "record.json";

/// Keeps records and finds them again.
pub struct Kept {
    /// SHA-256 over all that a record depends on, but for the hand-in.
    batch: [u8; 32],
    found: AtomicUsize,
}

/// What is in the file.
#[derive(Serialize, Deserialize)]
struct File<R> {
    /// SHA-256 over all that the record depends on.
    key: String,
    record: R,
}

impl Kept {
    /// For the records that `grading` makes.
    ///
    /// # Errors
    /// When something that they depend on cannot be read.
    pub fn of(grading: &Grading) -> anyhow::Result<Self> {
        let mut hash = Sha256::new();
        let assignment = grading.assignment;
        hash.update(serde_json::to_vec(&(
            (&assignment.scenes, &assignment.tree, &assignment.tolerances, &assignment.limits),
            grading.held_back.as_ref(),
        ))?);
        let expected = grading.cases.iter().filter(|case| case.entry.stored);
        let files = expected.map(|case| assignment.expected_file(&case.entry));
        let programs = grading.reference.iter().chain([&grading.supervisor.umbra]);
        for file in files.chain(programs.cloned()) {
            let bytes =
                fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
            hash.update(Sha256::digest(bytes));
        }
        hash.update(scene_digest(&assignment.root.join(&assignment.sampler_scene))?);
        for case in &grading.cases {
            for scene in [&case.offline, &case.realtime].into_iter().chain(&case.bonus) {
                hash.update(scene_digest(scene)?);
            }
        }
        Ok(Self { batch: hash.finalize().into(), found: AtomicUsize::new(0) })
    }

    /// How many records were found again.
    pub fn found(&self) -> usize {
        self.found.load(Ordering::Relaxed)
    }

    /// The key of a record that intake has begun: what was handed in, what is to be said of it so
    /// far, and all that the rest depends on.
    pub(super) fn key(&self, begun: &Record, checks: &[Check]) -> anyhow::Result<String> {
        let mut hash = Sha256::new();
        hash.update(self.batch);
        hash.update(serde_json::to_vec(&(begun, checks))?);
        Ok(hex(&hash.finalize()))
    }

    /// The record with this key, when its pictures are still there too.
    pub(super) fn find(&self, key: &str, out: &Folders) -> Option<Record> {
        let bytes = fs::read(out.instructor.join(FILE)).ok()?;
        let File { record, .. } =
            serde_json::from_slice(&bytes).ok().filter(|file: &File<Record>| file.key == key)?;
        if !pictures(&record, out).all(|picture| picture.is_file()) {
            return None;
        }
        self.found.fetch_add(1, Ordering::Relaxed);
        Some(record)
    }

    /// Keeps a record, unless the machine left something of it unjudged. Answers what will be found.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(super) fn keep(&self, key: &str, record: Record, out: &Folders) -> anyhow::Result<Record> {
        if record.evidence.checks.iter().any(|check| check.verdict == Verdict::NotRun) {
            return Ok(record);
        }
        let path = out.instructor.join(FILE);
        let failed = || format!("cannot keep {}", path.display());
        let bytes = serde_json::to_vec(&File { key: key.to_owned(), record })?;
        write_whole(&path, &bytes).with_context(failed)?;
        let file: File<Record> = serde_json::from_slice(&bytes).with_context(failed)?;
        Ok(file.record)
    }
}

/// The files of a record's pictures.
fn pictures<'a>(record: &'a Record, out: &'a Folders) -> impl Iterator<Item = PathBuf> + 'a {
    let at =
        |folder: &'a Path| move |picture: &crate::evidence::Picture| folder.join(&picture.file);
    let of_checks = record.evidence.checks.iter().flat_map(move |check| {
        let folder = if check.held_back { &out.instructor } else { &out.student };
        check.pictures.iter().map(at(folder))
    });
    let of_diagnoses = record.diagnoses.iter().flat_map(|found| &found.pictures);
    of_checks.chain(of_diagnoses.map(at(&out.student)))
}
