//! Stores records while a batch runs, so that the same command resumes it, whatever ended it. Every run recomputes
//! points from the records.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::{fs, io};

use anyhow::Context;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::record::{Folders, Record, Student};
use super::session::BUDGET;
use crate::evidence::{Check, Evidence, Picture, Verdict};
use crate::files::{hex, write_whole};
use crate::panics::Bug;

/// The record's file, beside the instructor's report on the submission.
const FILE: &str = "record.json";
/// The file of a bug of Umbra's that a submission met.
const BUG: &str = "internal-error.json";
/// Name of a record's file once a newer submission has replaced it.
const REPLACED: &str = "record.replaced.json";

/// Keeps records and finds them again.
pub struct RecordCache {
    /// SHA-256 over all that a record depends on, but for the submission.
    batch: [u8; 32],
    /// Whether to ignore stored records.
    force: bool,
    /// The records of this run that are in their files, by slug: whether they were there before.
    settled: Mutex<HashMap<String, bool>>,
}

/// A record with its place among others. A class may have hundreds, so long parts stay in the file.
#[derive(Clone)]
pub struct StoredRecord {
    /// The record; without its evidence if that is in its file.
    pub record: Record,
    /// Whether it was made with the same scenes, limits and program.
    pub comparable: bool,
    /// The instructor's folder with its file; nothing where it could not be kept.
    folder: Option<PathBuf>,
}

impl StoredRecord {
    /// A record that is in its file, in an instructor's folder.
    pub fn kept(record: Record, comparable: bool, instructor: &Path) -> Self {
        let record = Record {
            findings: Vec::new(),
            diagnostics: String::new(),
            evidence: Evidence::default(),
            diagnoses: Vec::new(),
            views: Vec::new(),
            error_maps: Vec::new(),
            ..record
        };
        Self { record, comparable, folder: Some(instructor.to_owned()) }
    }

    /// A record of this run that has no file.
    pub fn held(record: Record) -> Self {
        Self { record, comparable: true, folder: None }
    }

    /// The whole record, under the name that it has here.
    ///
    /// # Errors
    /// When its file is gone or cannot be read.
    pub fn whole(&self) -> anyhow::Result<Record> {
        let Some(folder) = &self.folder else { return Ok(self.record.clone()) };
        let record = RecordCache::record(folder)?;
        let record = record.with_context(|| format!("{} is gone", folder.join(FILE).display()))?;
        Ok(Record { name: self.record.name.clone(), ..record })
    }
}

/// What is in the file of a bug.
#[derive(Serialize, Deserialize)]
struct Met {
    /// SHA-256 over all that it depends on.
    key: String,
    bug: Bug,
}

/// What is in the file of a record.
#[derive(Serialize, Deserialize)]
struct RecordFile<R> {
    /// SHA-256 over all that the record depends on, but for the rules; empty when it is not to be found
    /// again, but only listed.
    key: String,
    /// The same, but for the submission.
    #[serde(default)]
    batch: String,
    /// The parts that were diagnosed, by the rules of then.
    failing: Vec<String>,
    record: R,
}

impl RecordCache {
    /// For records that depend on what has this SHA-256; `force` finds none again.
    pub(super) fn new(batch: [u8; 32], force: bool) -> Self {
        Self { batch, force, settled: Mutex::default() }
    }

    /// The bug that this program met with the submission at `source` before.
    pub(super) fn bug_of(&self, source: &Path, out: &Folders) -> Option<Bug> {
        if self.force {
            return None;
        }
        let bytes = fs::read(out.instructor.join(BUG)).ok()?;
        let met: Met = serde_json::from_slice(&bytes).ok()?;
        (met.key == self.key_of_source(source)).then_some(met.bug)
    }

    /// Keeps a bug that was met with the submission at `source`.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(super) fn keep_bug(&self, bug: &Bug, source: &Path, out: &Folders) -> std::io::Result<()> {
        let met = Met { key: self.key_of_source(source), bug: bug.clone() };
        write_whole(&out.instructor.join(BUG), &serde_json::to_vec(&met)?)
    }

    /// The key of a submission of which nothing is known but its files' names, sizes and times: a bug
    /// may lie in whatever looks further.
    fn key_of_source(&self, source: &Path) -> String {
        let mut hash = Sha256::new();
        hash.update(self.batch);
        let mut open = vec![source.to_owned()];
        while let Some(path) = open.pop() {
            hash.update(path.as_os_str().as_encoded_bytes());
            // No link is followed.
            let Ok(meta) = path.symlink_metadata() else { continue };
            hash.update(meta.len().to_le_bytes());
            hash.update(format!("{:?}", meta.modified().ok()));
            if meta.is_dir() {
                let entries = fs::read_dir(&path).into_iter().flatten().flatten();
                let mut entries: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
                entries.sort();
                open.append(&mut entries);
            }
        }
        hex(&hash.finalize())
    }

    /// How many records were found again.
    pub fn found(&self) -> usize {
        self.settled.lock().map_or(0, |settled| settled.values().filter(|found| **found).count())
    }

    /// Whether the record of `slug` was found again.
    pub fn was_found(&self, slug: &str) -> bool {
        self.settled.lock().is_ok_and(|settled| settled.get(slug) == Some(&true))
    }

    fn settle(&self, record: &Record, found: bool) {
        if let Ok(mut settled) = self.settled.lock() {
            settled.insert(record.slug.clone(), found);
        }
    }

    /// Keeps a record of this run that is not kept yet, so that the class is complete: it is listed by
    /// later runs, but not found again.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn list(&self, record: &Record, out: &Folders) -> anyhow::Result<()> {
        if self.settled.lock().is_ok_and(|settled| settled.contains_key(&record.slug)) {
            return Ok(());
        }
        self.write("", Vec::new(), record, out)?;
        self.settle(record, false);
        Ok(())
    }

    /// Digest of all that a record depends on, but for the submission: records of another one are not comparable.
    pub fn conditions(&self) -> String {
        hex(&self.batch)
    }

    /// The record that a run kept in an instructor's folder, if any; comparable to those of some `conditions`.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn earlier(instructor: &Path, conditions: &str) -> anyhow::Result<Option<StoredRecord>> {
        let earlier = |file: RecordFile<Record>| {
            StoredRecord::kept(file.record, file.batch == conditions, instructor)
        };
        Ok(Self::file(instructor)?.map(earlier))
    }

    /// The whole record that a run kept in an instructor's folder, if any.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn record(instructor: &Path) -> anyhow::Result<Option<Record>> {
        Ok(Self::file(instructor)?.map(|file| file.record))
    }

    /// The conditions of the record in an instructor's folder, if there is one.
    pub fn conditions_of(instructor: &Path) -> Option<String> {
        Self::file(instructor).ok()?.map(|file| file.batch)
    }

    fn file(instructor: &Path) -> anyhow::Result<Option<RecordFile<Record>>> {
        let path = instructor.join(FILE);
        let bytes = match fs::read(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            bytes => bytes.with_context(|| format!("cannot read {}", path.display()))?,
        };
        let file = serde_json::from_slice(&bytes).with_context(|| {
            format!("{}: not a record of this version of Umbra", path.display())
        })?;
        Ok(Some(file))
    }

    /// When the record in an instructor's folder was kept.
    pub fn when(instructor: &Path) -> Option<std::time::SystemTime> {
        fs::metadata(instructor.join(FILE)).ok()?.modified().ok()
    }

    /// Whose record an earlier run kept in an instructor's folder.
    pub fn student(instructor: &Path) -> Option<Student> {
        let bytes = fs::read(instructor.join(FILE)).ok()?;
        let file: RecordFile<Record> = serde_json::from_slice(&bytes).ok()?;
        Some(file.record.student).filter(|student| *student != Student::default())
    }

    /// Sets the record in an instructor's folder aside: a newer submission takes its place.
    ///
    /// # Errors
    /// When its file cannot be renamed.
    pub fn replace(instructor: &Path) -> io::Result<()> {
        fs::rename(instructor.join(FILE), instructor.join(REPLACED))
    }

    /// The record in an instructor's folder as it is kept, if there is one.
    pub fn text(instructor: &Path) -> Option<Vec<u8>> {
        fs::read(instructor.join(FILE)).ok()
    }

    /// Sets an older record aside, unless `record` is of the same submission; returns whether it did.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn keep_replaced(instructor: &Path, older: &[u8], record: &Record) -> anyhow::Result<bool> {
        let kept: Result<RecordFile<Record>, _> = serde_json::from_slice(older);
        if kept.is_ok_and(|kept| kept.record.digest == record.digest) {
            return Ok(false);
        }
        let path = instructor.join(REPLACED);
        write_whole(&path, older).with_context(|| format!("cannot keep {}", path.display()))?;
        Ok(true)
    }

    fn write(
        &self,
        key: &str,
        failing: Vec<String>,
        record: &Record,
        out: &Folders,
    ) -> anyhow::Result<Vec<u8>> {
        let path = out.instructor.join(FILE);
        let batch = hex(&self.batch);
        let bytes =
            serde_json::to_vec(&RecordFile { key: key.to_owned(), batch, failing, record })?;
        let failed = || format!("cannot keep {}", path.display());
        write_whole(&path, &bytes).with_context(failed)?;
        Ok(bytes)
    }

    /// The key of a record that intake has begun: what was submitted, what is to be said of it so
    /// far, and all that the rest depends on. What its file is called is none of that.
    pub(super) fn key(&self, begun: &Record, checks: &[Check]) -> anyhow::Result<String> {
        let mut hash = Sha256::new();
        hash.update(self.batch);
        let content = Record { name: String::new(), ..begun.clone() };
        hash.update(serde_json::to_vec(&(&content, checks))?);
        Ok(hex(&hash.finalize()))
    }

    /// The record with this key, when its pictures are still there too, and `failing` names the
    /// parts that were diagnosed. One that used up its budget counts only where there is one (`budget`).
    pub(super) fn find(
        &self,
        key: &str,
        failing: impl Fn(&Evidence) -> Vec<String>,
        budget: bool,
        out: &Folders,
    ) -> Option<Record> {
        if self.force {
            return None;
        }
        let found = Self::kept(key, failing, budget, out)?;
        self.settle(&found, true);
        Some(found)
    }

    fn kept(
        key: &str,
        failing: impl Fn(&Evidence) -> Vec<String>,
        budget: bool,
        out: &Folders,
    ) -> Option<Record> {
        let bytes = fs::read(out.instructor.join(FILE)).ok()?;
        let file: RecordFile<Record> = serde_json::from_slice(&bytes).ok()?;
        let same = file.key == key
            && file.failing == failing(&file.record.evidence)
            && (budget || file.record.evidence.named(BUDGET).next().is_none())
            && pictures(&file.record, out).all(|picture| picture.is_file())
            && views(&file.record, out).all(|data| data.is_file());
        same.then_some(file.record)
    }

    /// Keeps a record, unless the machine left something of it unjudged. Answers what will be found: where another
    /// process has kept one with the same key meanwhile, that one stays.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(super) fn keep(
        &self,
        key: &str,
        failing: impl Fn(&Evidence) -> Vec<String>,
        record: Record,
        out: &Folders,
    ) -> anyhow::Result<Record> {
        let budget = record.evidence.named(BUDGET).next().is_some();
        let first = Self::kept(key, &failing, budget, out).filter(|_| !self.force);
        if let Some(first) = first {
            self.settle(&first, false);
            return Ok(first);
        }
        if record.evidence.checks.iter().any(|check| check.verdict == Verdict::NotRun) {
            return Ok(record);
        }
        let bytes = self.write(key, failing(&record.evidence), &record, out)?;
        self.settle(&record, false);
        let file: RecordFile<Record> =
            serde_json::from_slice(&bytes).context("a record just kept")?;
        Ok(file.record)
    }
}

/// The files of a record's pictures.
fn pictures<'a>(record: &'a Record, out: &'a Folders) -> impl Iterator<Item = PathBuf> + 'a {
    let at = |folder: &'a Path| move |picture: &Picture| folder.join(&picture.file);
    let of_checks = record.evidence.checks.iter().flat_map(move |check| {
        let folder = if check.held_back { &out.instructor } else { &out.student };
        check.pictures.iter().map(at(folder))
    });
    let of_diagnoses = record.diagnoses.iter().flat_map(|found| &found.pictures);
    of_checks.chain(of_diagnoses.map(at(&out.student)))
}

/// The data files of a record's images.
fn views<'a>(record: &'a Record, out: &'a Folders) -> impl Iterator<Item = PathBuf> + 'a {
    record.views.iter().flat_map(move |case| {
        let folder = if case.held_back { &out.instructor } else { &out.student };
        case.files().into_iter().map(move |file| folder.join(file))
    })
}

#[cfg(test)]
impl RecordCache {
    /// For the records of a made-up batch.
    pub(super) fn with(batch: [u8; 32]) -> Self {
        Self { batch, force: false, settled: Mutex::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::CheckId;
    use crate::report::sample;

    #[test]
    fn a_record_is_found_as_long_as_nothing_that_it_hangs_on_has_changed() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let out = Folders { student: at("student"), instructor: at("instructor") };
        let cache = RecordCache::with([1; 32]);
        let mut record = sample::report().entries.remove(1).record;
        record.evidence.checks.retain(|check| check.verdict != Verdict::NotRun);
        record.evidence.checks[0].error = f64::NAN;
        record.evidence.checks[1].error = 0.1 + 0.2;
        for picture in pictures(&record, &out) {
            fs::create_dir_all(picture.parent().unwrap()).unwrap();
            fs::write(picture, "").unwrap();
        }
        let failing = |_: &Evidence| vec!["1.3".to_owned()];
        let found = || cache.find("key", failing, true, &out);
        assert!(found().is_none());
        let first = cache.keep("key", failing, record.clone(), &out).unwrap();
        // Another process's with the same key stays.
        let later = Record { diagnostics: "later".into(), ..record.clone() };
        let kept = RecordCache::with([1; 32]).keep("key", failing, later.clone(), &out).unwrap();
        assert_eq!(format!("{kept:?}"), format!("{record:?}"));
        let forced = RecordCache { force: true, ..RecordCache::with([1; 32]) };
        assert_eq!(forced.keep("key", failing, later, &out).unwrap().diagnostics, "later");
        assert!(forced.keep("key", failing, record.clone(), &out).is_ok());
        // NaN equals nothing, itself included.
        assert_eq!(format!("{first:?}"), format!("{record:?}"));
        assert_eq!(format!("{:?}", found().unwrap()), format!("{record:?}"));
        assert_eq!(cache.found(), 1);

        assert!(cache.find("another key", failing, true, &out).is_none());
        assert!(cache.find("key", |_| Vec::new(), true, &out).is_none());
        let picture = pictures(&record, &out).next().unwrap();
        fs::remove_file(&picture).unwrap();
        assert!(found().is_none());
        fs::write(&picture, "").unwrap();
        assert!(found().is_some());
        fs::write(out.instructor.join(FILE), "{").unwrap();
        assert!(found().is_none());

        record.evidence.checks.push(Check::new(BUDGET, "", Verdict::Fail, ""));
        cache.keep("key", failing, record, &out).unwrap();
        assert!(found().is_some());
        assert!(cache.find("key", failing, false, &out).is_none(), "grades it without a budget");
    }

    #[test]
    fn what_the_machine_left_open_is_not_kept() {
        let place = tempfile::tempdir().unwrap();
        let out = || place.path().to_owned();
        let out = Folders { student: out(), instructor: out() };
        let cache = RecordCache::with([1; 32]);
        let mut record = sample::report().entries.remove(0).record;
        let not_run = Check::new(CheckId::BonusImage, "", Verdict::NotRun, "no adapter");
        record.evidence.checks.push(not_run);
        assert_eq!(cache.keep("key", |_| Vec::new(), record.clone(), &out).unwrap(), record);
        assert_eq!(place.path().read_dir().unwrap().count(), 0);
    }

    #[test]
    fn another_submission_batch_or_word_of_intake_has_another_key() {
        let record = sample::report().entries.remove(0).record;
        let key = |batch: u8, record: &Record, checks: &[Check]| {
            RecordCache::with([batch; 32]).key(record, checks).unwrap()
        };
        let own = key(1, &record, &[]);
        assert_eq!(own, key(1, &record.clone(), &[]));
        let other = Record { digest: "other".into(), ..record.clone() };
        let tree = Check::new(CheckId::SubmissionTree, "", Verdict::Fail, "");
        let others = [key(2, &record, &[]), key(1, &other, &[]), key(1, &record, &[tree])];
        assert!(!others.contains(&own), "{others:?}");
    }
}
