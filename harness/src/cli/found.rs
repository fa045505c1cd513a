//! What a run found beside the records of submissions, as later runs and `umbra merge` read it.

use std::collections::HashMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Once;

use anyhow::{Context as _, bail};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::class::{self, WORK};
use super::outputs::shell_path;
use crate::class::{Collected, Label, Platform};
use crate::columns::count;
use crate::files::{files_below, hex, write_new, write_whole};
use crate::grading::{RecordCache, StoredRecord};
use crate::held_back::HeldBack;
use crate::report::{self, harmless};

/// The file of [`BatchIndex`], in the instructor's folder.
const FILE: &str = "batch.json";

/// What is known of a batch beside its records.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BatchIndex {
    /// Digest of what the last run judged by: records of another one are not comparable.
    pub conditions: String,
    /// Where the submissions come from.
    pub kind: Platform,
    /// File name of the class list; empty without one.
    pub list: String,
    /// What is held back, if anything.
    pub held_back: Option<HeldBack>,
    /// What was there, graded or not.
    pub seen: Vec<Seen>,
    /// Zips that look like the download of a class, among other archives.
    #[serde(default)]
    pub unopened: Vec<String>,
    /// What is no submission.
    #[serde(default)]
    pub skipped: Vec<String>,
    /// The version of Umbra.
    pub umbra: String,
    /// Where the submissions were looked for.
    pub paths: Vec<PathBuf>,
}

/// Something that was submitted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// Its folder in the report; empty where there is nothing to grade.
    pub slug: String,
    /// What reports call it.
    pub name: String,
    /// What the platform says.
    pub label: Option<Label>,
    /// Whether another attempt of the same student counts by its time.
    pub aside: bool,
    /// Why there is nothing to grade; empty where there is something.
    pub empty: String,
}

impl BatchIndex {
    /// What one run found: submissions `all`, of which those in `aside` do not count, and what is none.
    pub fn new(
        collected: &Collected,
        all: &[class::Source],
        aside: impl Fn(&class::Source) -> bool,
    ) -> Self {
        let mut seen: Vec<Seen> = Vec::new();
        for source in all {
            let (name, label) = (source.name.clone(), source.label.clone());
            let slug = source.slug.clone();
            seen.push(Seen { slug, name, label, aside: aside(source), empty: String::new() });
        }
        seen.extend(collected.empty.iter().map(|empty| Seen {
            name: empty.label.submission.clone(),
            label: Some(empty.label.clone()),
            empty: empty.reason(),
            ..Seen::default()
        }));
        let umbra = env!("CARGO_PKG_VERSION").to_owned();
        let unopened = collected.unopened.clone();
        let skipped = collected.skipped.clone();
        Self { kind: collected.kind, seen, unopened, skipped, umbra, ..Self::default() }
    }

    /// Adds what an earlier run into `output` found of those that this one was not given.
    pub fn join(&mut self, earlier: Self, output: &Path) {
        let instructor = output.join(report::INSTRUCTOR);
        if self.kind == Platform::default() {
            self.kind = earlier.kind;
        }
        if self.list.is_empty() {
            self.list = earlier.list;
        }
        for old in earlier.seen {
            let same = |new: &Seen| {
                if old.slug.is_empty() { new.label == old.label } else { new.slug == old.slug }
            };
            let stays = old.aside || !old.empty.is_empty() || instructor.join(&old.slug).is_dir();
            if stays && !self.seen.iter().any(same) {
                self.seen.push(old);
            }
        }
    }

    /// What reports call each submission, by its folder.
    pub fn names(&self) -> HashMap<String, String> {
        self.seen.iter().map(|seen| (seen.slug.clone(), seen.name.clone())).collect()
    }

    /// Gives records the names that reports call them by; in their files they have that of the archive alone.
    pub fn name(&self, records: &mut [StoredRecord]) {
        for StoredRecord { record, .. } in records {
            if let Some(seen) = self.seen.iter().find(|seen| seen.slug == record.slug) {
                record.name.clone_from(&seen.name);
            }
        }
    }

    /// Reads what the last run into a report found.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn read(output: &Path) -> anyhow::Result<Option<Self>> {
        let file = output.join(report::INSTRUCTOR).join(FILE);
        match std::fs::read(&file) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            bytes => {
                let bytes = bytes.with_context(|| format!("cannot read {}", file.display()))?;
                let found = serde_json::from_slice(&bytes);
                found.map(Some).with_context(|| {
                    format!("{}: not of this version of Umbra; grade again", file.display())
                })
            }
        }
    }

    /// Keeps it for `umbra merge`, as long as tasks of a partition are at work: those that found the same keep one
    /// file.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn begin(&self, output: &Path) -> anyhow::Result<()> {
        let bytes = serde_json::to_vec_pretty(self)?;
        let name = format!("{}.json", &hex(&Sha256::digest(&bytes))[..12]);
        let file = output.join(report::INSTRUCTOR).join(WORK).join(name);
        match write_new(&file, &bytes) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(()),
            written => written.with_context(|| format!("cannot write {}", file.display())),
        }
    }

    /// What tasks of a partition found, each with its file.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn begun(output: &Path) -> anyhow::Result<Vec<(PathBuf, Self)>> {
        let folder = output.join(report::INSTRUCTOR).join(WORK);
        let mut begun = Vec::new();
        for file in files_below(&folder).unwrap_or_default() {
            // What a killed task left has no such name.
            if file.extension().is_none_or(|extension| extension != "json") {
                continue;
            }
            let bytes =
                std::fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
            let found = serde_json::from_slice(&bytes).with_context(|| {
                format!("{}: not of this version of Umbra; delete it", file.display())
            })?;
            begun.push((file, found));
        }
        Ok(begun)
    }

    /// Removes what tasks of a partition found where all of that is graded under the same conditions.
    ///
    /// # Errors
    /// When a file cannot be read or removed.
    pub fn supersede(output: &Path, conditions: &str) -> anyhow::Result<()> {
        let instructor = output.join(report::INSTRUCTOR);
        let is_graded = |seen: &Seen| {
            RecordCache::conditions_of(&instructor.join(&seen.slug)).as_deref() == Some(conditions)
        };
        for (file, begun) in Self::begun(output)? {
            if begun.counting().all(is_graded) {
                std::fs::remove_file(&file)
                    .with_context(|| format!("cannot remove {}", file.display()))?;
            }
        }
        Ok(())
    }

    /// The submissions that must have a record.
    pub fn counting(&self) -> impl Iterator<Item = &Seen> {
        self.seen.iter().filter(|seen| !seen.aside && seen.empty.is_empty())
    }

    pub fn holds(&self, slug: &str) -> bool {
        self.seen.iter().any(|seen| seen.slug == slug)
    }

    /// Says once what was graded since by runs that did not end, and is not in the report.
    pub fn say_since(&self, output: &Path) {
        static SAID: Once = Once::new();
        let instructor = output.join(report::INSTRUCTOR);
        let is_graded =
            |slug: &String| RecordCache::conditions_of(&instructor.join(slug)).is_some();
        let since = class::folders(output).into_iter().filter(|slug| !self.holds(slug));
        let since: Vec<String> = since.filter(is_graded).collect();
        if !since.is_empty() {
            SAID.call_once(|| {
                eprintln!(
                    "umbra: {} graded since by a run that did not end, and not in the report: {}; the same `umbra grade` \
                     as then adds them",
                    count(since.len(), "submission"),
                    harmless(&class::some(&since))
                );
            });
        }
    }

    /// Adds submissions that were graded by runs that did not end.
    pub fn add(&mut self, records: &[StoredRecord], output: &Path) {
        for StoredRecord { record, .. } in records {
            if self.holds(&record.slug) {
                continue;
            }
            let (label, slug) = (class::label(output, &record.slug), record.slug.clone());
            let folder = label.as_ref().map_or("", |own| own.submission.as_str());
            let name = match record.name.starts_with(folder) {
                true => record.name.clone(),
                false => format!("{folder}/{}", record.name),
            };
            self.seen.push(Seen { slug, name, label, ..Seen::default() });
        }
    }

    /// Keeps it for later runs.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn keep(&self, output: &Path) -> anyhow::Result<()> {
        let file = output.join(report::INSTRUCTOR).join(FILE);
        write_whole(&file, &serde_json::to_vec_pretty(self)?)
            .with_context(|| format!("cannot write {}", file.display()))
    }
}

/// Makes sure that no tasks of a partition graded what the report lacks.
///
/// # Errors
/// When some did, or that cannot be told.
pub fn ensure_merged(output: &Path) -> anyhow::Result<()> {
    let begun = BatchIndex::begun(output)?;
    let Some((file, _)) = begun.first() else { return Ok(()) };
    bail!(
        "{}: the tasks of a partition are not merged yet; hint: umbra merge --report {}; if no task will run any more, \
         grade the same submissions without --partition, or delete {}",
        output.display(),
        shell_path(output),
        file.display()
    );
}
