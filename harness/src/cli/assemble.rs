//! Makes a report from the files in its folder: records, other results of the last run, and pins. It needs no
//! submission and renders nothing.

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Once;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::changes::changes;
use super::class::{self, WORK};
use super::outputs::shell_path;
use crate::class::jplag;
use crate::class::mending;
use crate::class::overrides::{Applied, Subject};
use crate::class::{
    Claim, Collected, Deciding, Decisions, Kind, Label, Owners, Pins, Roster, settle,
};
use crate::columns::count;
use crate::files::{files_below, hex, write_new, write_whole};
use crate::grading::{Record, RecordCache, Shared, StoredRecord};
use crate::held_back::HeldBack;
use crate::program::graded;
use crate::report::{self, BatchReport, ReportError, SubmissionReport, harmless, outline};
use crate::rubric::{self, Grade};

/// The file that is there once held-back scenes are released, in the instructor's folder.
pub const RELEASED: &str = "released.txt";

/// The file of [`Found`], in the instructor's folder.
const FILE: &str = "batch.json";

/// The file that says of which content the times in `matches.toml` were said, in the instructor's folder.
const TIMES: &str = "times.json";

/// How often something that takes long says how far it is.
const PACE: Duration = Duration::from_secs(2);

/// What is done once for each submission; said where it takes long.
struct Progress<'a> {
    what: &'a str,
    of: usize,
    done: Cell<usize>,
    said: Cell<Instant>,
}

impl<'a> Progress<'a> {
    fn new(what: &'a str, of: usize) -> Self {
        Self { what, of, done: Cell::new(0), said: Cell::new(Instant::now()) }
    }

    fn step(&self) {
        self.done.set(self.done.get() + 1);
        if self.said.get().elapsed() > PACE {
            self.said.set(Instant::now());
            eprintln!("umbra: {}: {} of {}", self.what, self.done.get(), self.of);
        }
    }
}

/// What is known of a batch beside its records.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Digest of what the last run judged by: records of another one are not comparable.
    pub conditions: String,
    /// Where the submissions come from.
    pub kind: Kind,
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

impl Found {
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
        if self.kind == Kind::default() {
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

    fn holds(&self, slug: &str) -> bool {
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
    fn add(&mut self, records: &[StoredRecord], output: &Path) {
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
    let begun = Found::begun(output)?;
    let Some((file, _)) = begun.first() else { return Ok(()) };
    bail!(
        "{}: the tasks of a partition are not merged yet; hint: umbra merge --report {}; if no task will run any more, \
         grade the same submissions without --partition, or delete {}",
        output.display(),
        shell_path(output),
        file.display()
    );
}

/// A report's folder, as it was kept.
pub struct Kept {
    /// What grades are settled by.
    pub pins: Pins,
    found: Found,
    roster: Option<Roster>,
    records: Vec<StoredRecord>,
}

impl Kept {
    /// Reads everything that a report is made from.
    ///
    /// # Errors
    /// When the folder holds no report, or one of another version.
    pub fn read(output: &Path) -> anyhow::Result<Self> {
        let instructor = output.join(report::INSTRUCTOR);
        ensure!(
            instructor.is_dir(),
            "{} holds no report; expected the --report of an earlier `umbra grade`",
            output.display()
        );
        let pins = Pins::read(&instructor)?;
        ensure_merged(output)?;
        let Some(found) = Found::read(output)?.filter(|_| pins.current().is_some()) else {
            bail!(
                "{}: expected the --report of an earlier `umbra grade` of this version; hint: grade once more",
                output.display()
            );
        };
        let mut records = Vec::new();
        for slug in class::folders(output).into_iter().filter(|slug| found.holds(slug)) {
            let earlier = RecordCache::earlier(&instructor.join(&slug), &found.conditions)
                .with_context(|| format!("{slug} cannot be settled; grade it again"))?;
            records.extend(earlier);
        }
        found.say_since(output);
        found.name(&mut records);
        let roster = class::roster(None, output)?;
        Ok(Self { pins, found, roster, records })
    }

    /// This, read again where another process changed meanwhile what it is settled by. Nobody else changes that as long
    /// as the lock is there.
    ///
    /// # Errors
    /// When it cannot be locked or read.
    pub fn locked(self, output: &Path) -> anyhow::Result<(File, Self)> {
        let lock = Pins::lock(&output.join(report::INSTRUCTOR))?;
        let now = Pins::read(&output.join(report::INSTRUCTOR))?;
        let is_same =
            now.current().map(|pin| pin.number) == self.pins.current().map(|pin| pin.number);
        Ok((lock, if is_same { self } else { Self::read(output)? }))
    }

    /// What is held back, if anything.
    pub fn held_back(&self) -> Option<&HeldBack> {
        self.found.held_back.as_ref()
    }

    /// Where the submissions come from.
    pub fn kind(&self) -> Kind {
        self.found.kind
    }

    /// Where the submissions were looked for.
    pub fn paths(&self) -> &[PathBuf] {
        &self.found.paths
    }

    /// What is pinned.
    pub fn decided(&self) -> anyhow::Result<&Decisions> {
        Ok(&self.pins.current().context("nothing is pinned")?.decided)
    }

    /// The report by what is decided.
    ///
    /// # Errors
    /// When a decision means nothing.
    pub fn report(&self, output: &Path, decided: &Decisions) -> anyhow::Result<Settled> {
        settled(output, decided, &self.found, self.roster.as_ref(), self.records.clone())
    }

    /// What reports call each submission, by its folder.
    pub fn names(&self) -> HashMap<String, String> {
        self.found.names()
    }

    /// The submissions that are graded, without what was found out about them.
    pub fn records(&self) -> impl Iterator<Item = &Record> {
        self.records.iter().map(|earlier| &earlier.record)
    }

    /// What each graded submission says of whose it is.
    pub fn claims(&self, output: &Path) -> Vec<Claim> {
        self.records().map(|record| class::claim(output, record)).collect()
    }

    /// Whose the graded submissions are, as decided.
    ///
    /// # Errors
    /// When a decision means nothing.
    pub fn owners<'a>(&'a self, claims: &'a [Claim], output: &Path) -> anyhow::Result<Owners<'a>> {
        let matches = self.decided()?.matches(output)?.among(claims);
        Owners::of(claims, self.roster.as_ref(), &matches)
    }

    /// A submission with what it is worth before anything is decided.
    ///
    /// # Errors
    /// When it is not there.
    pub fn graded(&self, output: &Path, slug: &str) -> anyhow::Result<SubmissionReport> {
        let mut record = whole(&self.records, slug)?;
        shared(output, &self.records)?.judge(&mut record);
        Ok(graded(record, &self.decided()?.assignment.rules))
    }

    /// Pins what is decided from now on, and writes the report by it, which is the answer.
    ///
    /// # Errors
    /// When it cannot be written, or a decision means nothing.
    pub fn apply(
        &mut self,
        output: &Path,
        decided: Decisions,
        reason: &str,
        undoes: bool,
    ) -> anyhow::Result<BatchReport> {
        let before = self.report(output, self.decided()?)?;
        let after = self.report(output, &decided)?;
        let changes = changes(&before.report, &after.report);
        self.pins.apply(decided, reason, changes, undoes)?;
        write(output, &after)?;
        Ok(after.report)
    }
}

/// Notes of which content each time in the pinned `matches.toml` was said, before a run grades other content.
///
/// # Errors
/// When a file cannot be read or written.
pub fn remember_times(output: &Path, pinned: &Decisions) -> anyhow::Result<()> {
    let matches = pinned.matches(output)?;
    if !matches.has_times() {
        return Ok(());
    }
    let instructor = output.join(report::INSTRUCTOR);
    let mut records = Vec::new();
    for slug in class::folders(output) {
        // What cannot be read is told where it is needed.
        records.extend(RecordCache::earlier(&instructor.join(slug), "").ok().flatten());
    }
    Found::read(output)?.unwrap_or_default().name(&mut records);
    let claims: Vec<Claim> = records.iter().map(|own| class::claim(output, &own.record)).collect();
    let mut known = times(output)?;
    let before = known.len();
    for (time, slugs) in matches.among(&claims).times() {
        let digests = || slugs.iter().map(|slug| digest(&records, slug)).collect();
        known.entry(time).or_insert_with(digests);
    }
    if known.len() > before {
        let file = instructor.join(TIMES);
        write_whole(&file, &serde_json::to_vec_pretty(&known)?)
            .with_context(|| format!("cannot write {}", file.display()))?;
    }
    Ok(())
}

/// Digests of the submissions that each time in `matches.toml` was said of.
fn times(output: &Path) -> anyhow::Result<BTreeMap<String, Vec<String>>> {
    let file = output.join(report::INSTRUCTOR).join(TIMES);
    match std::fs::read(&file) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(BTreeMap::new()),
        bytes => {
            let bytes = bytes.with_context(|| format!("cannot read {}", file.display()))?;
            serde_json::from_slice(&bytes)
                .with_context(|| format!("{}: expected digests", file.display()))
        }
    }
}

fn digest(records: &[StoredRecord], slug: &str) -> String {
    let own = records.iter().find(|own| own.record.slug == slug);
    own.map(|own| own.record.digest.clone()).unwrap_or_default()
}

/// The report of a run that graded all that it was given: keeps what it found, pins what is decided by now, and writes.
///
/// # Errors
/// When a file cannot be read or written, or a decision means nothing.
pub fn finish(
    output: &Path,
    pins: &mut Pins,
    decided: &Decisions,
    mut found: Found,
    records: Vec<StoredRecord>,
) -> anyhow::Result<BatchReport> {
    let instructor = output.join(report::INSTRUCTOR);
    let _lock = Pins::lock(&instructor)?;
    // Something may have been decided while this was graded.
    *pins = Pins::read(&instructor)?;
    let decided = &Decisions::read(output, decided.assignment.clone(), decided.attempt)?;
    found.join(Found::read(output)?.unwrap_or_default(), output);
    found.add(&records, output);
    found.keep(output)?;
    let roster = class::roster(None, output)?;
    let settled = settled(output, decided, &found, roster.as_ref(), records)?;
    let pinned = pins.current().map(|pin| pin.decided.differs(decided, output));
    if pinned.transpose()?.is_none_or(|differs| !differs.is_empty()) {
        pins.apply(decided.clone(), "graded", Vec::new(), false)?;
    }
    write(output, &settled)?;
    Ok(settled.report)
}

/// Writes a report with the questions that it leaves open.
///
/// # Errors
/// When it cannot be written.
pub fn write(output: &Path, settled: &Settled) -> anyhow::Result<()> {
    if let Some(class) = &settled.report.class {
        class::ask(class, output)?;
    }
    // Each is asked for twice: for its pages, and for the file with all.
    let progress = Progress::new("writing the reports", 2 * settled.report.entries.len());
    let written = report::write_outlined(output, &settled.report, &|entry| {
        progress.step();
        let slug = entry.record.slug.clone();
        let failed =
            |error: anyhow::Error| ReportError::Entry { slug, reason: format!("{error:#}") };
        settled.whole(entry).map(Cow::Owned).map_err(failed)
    });
    written?;
    mark_superseded(output, settled)
}

/// Says on the pages of attempts that count no more which one does.
fn mark_superseded(output: &Path, settled: &Settled) -> anyhow::Result<()> {
    let entries = &settled.report.entries;
    let counting: HashSet<&str> = entries.iter().map(|own| own.record.slug.as_str()).collect();
    let superseded = settled.records.iter().map(|own| &own.record);
    for Record { slug, name, .. } in superseded.filter(|own| !counting.contains(&*own.slug)) {
        let is = |own: &String| own == name || own.trim_end_matches('/') == slug;
        let instead = entries.iter().find(|own| own.standing.set_aside.iter().any(is));
        let instead = instead.map(|own| own.record.slug.as_str());
        let address = instead.map(|own| format!("../{own}/{}", report::HTML_FILE));
        let public = output.join(slug).join(report::HTML_FILE);
        let private = output.join(report::INSTRUCTOR).join(slug).join(report::HTML_FILE);
        // A student has their own folder alone.
        let link = address
            .as_deref()
            .filter(|own| private.parent().is_some_and(|f| f.join(own).is_file()));
        for (page, link) in [(public, None), (private, link)] {
            report::mark_superseded(&page, instead.map(|own| (own, link)))
                .with_context(|| format!("cannot mark {}", page.display()))?;
        }
    }
    Ok(())
}

/// The report of a class. Its entries are outlines: what was found out is in the files of records.
pub struct Settled {
    /// The report.
    pub report: BatchReport,
    records: Vec<StoredRecord>,
    shared: Shared,
}

impl Settled {
    /// The whole of an entry.
    ///
    /// # Errors
    /// When its record cannot be read any more.
    pub fn whole(&self, entry: &SubmissionReport) -> anyhow::Result<SubmissionReport> {
        let mut record = whole(&self.records, &entry.record.slug)?;
        self.shared.judge(&mut record);
        record.evidence = rubric::settle(&self.report.rules, &record.evidence);
        let SubmissionReport { grade, standing, .. } = entry.clone();
        Ok(SubmissionReport { record, grade, standing })
    }
}

/// What submissions share, also according to JPlag, where it compared what they hold now.
fn shared(output: &Path, records: &[StoredRecord]) -> anyhow::Result<Shared> {
    let near = jplag::kept(&output.join(report::INSTRUCTOR).join(report::LIKENESS))?;
    let own = |slug: &str| records.iter().find(|own| own.record.slug == slug);
    let near =
        near.iter().filter(|pair| pair.holds(|slug| Some(own(slug)?.record.digest.as_str())));
    let near = near.map(|pair| (&pair.who, pair.similarity));
    Ok(Shared::of(records.iter().map(|earlier| &earlier.record)).with_near(near))
}

/// The whole record of a submission.
fn whole(records: &[StoredRecord], slug: &str) -> anyhow::Result<Record> {
    let own = records.iter().find(|own| own.record.slug == slug);
    own.with_context(|| format!("there is no submission {slug}"))?.whole()
}

/// The report of some records: points by what is decided, whose each is, which of them count, what lateness costs.
///
/// # Errors
/// When a decision means nothing.
pub fn settled(
    output: &Path,
    decided: &Decisions,
    found: &Found,
    roster: Option<&Roster>,
    mut records: Vec<StoredRecord>,
) -> anyhow::Result<Settled> {
    let stated = &decided.assignment;
    found.name(&mut records);
    // In an order that does not depend on the order of grading.
    records.sort_by_key(|earlier| earlier.record.slug.to_lowercase());
    let shared = shared(output, &records)?;
    let claims: Vec<Claim> =
        records.iter().map(|earlier| class::claim(output, &earlier.record)).collect();
    let mut matches = decided.matches(output)?.among(&claims);
    let outdated = matches.without_outdated(&times(output)?, |slug| digest(&records, slug));
    let owners = Owners::of(&claims, roster, &matches)?;
    let deciding = Deciding {
        roster,
        matches: &matches,
        policy: stated.late.as_ref(),
        due: &stated.due,
        attempt: decided.attempt,
    };
    let overrides = decided.overrides(output)?.on(&owners);
    let mut entries: Vec<SubmissionReport> = Vec::new();
    let mut grades: Vec<Grade> = Vec::new();
    let mut decisions: Vec<Vec<Applied>> = Vec::new();
    let mut mends = Vec::new();
    // One at a time is whole.
    let progress = Progress::new("reading what was found out", records.len());
    for earlier in &records {
        progress.step();
        let mut record = earlier.whole()?;
        shared.judge(&mut record);
        let SubmissionReport { record, grade: original, standing } = graded(record, &stated.rules);
        let mut grade = original.clone();
        let subject =
            Subject { slug: &record.slug, digest: &record.digest, evidence: &record.evidence };
        decisions.push(overrides.apply(&subject, &mut grade));
        let mended = class::mended_record(output, subject.slug)?;
        mends.push(match (overrides.mend(&subject), mended) {
            (Some(decision), Some(record)) if decision.evidence == subject.digest => {
                let mut mended = graded(record, &stated.rules).grade;
                // What the instructor is to look at in the submission itself.
                let private = original.remarks.iter();
                let private = private.filter(|own| report::is_private(own, &stated.rules));
                mended.remarks.extend(private.cloned());
                let on_mended = overrides.apply(&subject, &mut mended);
                let made = mending::choose(decision, &mut grade, mended);
                if made.as_ref().is_some_and(|made| made.counts) {
                    // They were made on the submission's own evidence, and change points of the mended one.
                    let own = decisions.iter_mut().last().into_iter().flatten();
                    for (own, mended) in own.zip(on_mended) {
                        (own.before, own.after) = (mended.before, mended.after);
                    }
                }
                made.map(Ok)
            }
            (Some(decision), _) => Some(Err(mending::stale(decision))),
            (None, _) => None,
        });
        grades.push(grade);
        entries.push(outline(SubmissionReport { record, grade: Grade::default(), standing }));
    }
    let is_graded = |seen: &Seen| claims.iter().any(|claim| claim.slug == seen.slug);
    let open = found.seen.iter().filter(|seen| !seen.aside && !is_graded(seen));
    let absent: Vec<(Label, String)> = open
        .filter_map(|seen| {
            let reason = if seen.empty.is_empty() { "not graded yet" } else { &seen.empty };
            Some((seen.label.clone()?, reason.to_owned()))
        })
        .collect();
    let (standings, mut class) = settle(&claims, &mut grades, &absent, found.kind, &deciding)?;
    let parts: Vec<&str> = stated.rules.parts.iter().map(|part| part.id.as_str()).collect();
    let counts = |slug: &str| standings.iter().any(|(at, _)| claims[*at].slug == slug);
    class.unused.extend(overrides.unused(counts, &parts));
    let is_called = |seen: &Seen, word: &str| {
        let label = seen.label.as_ref().is_some_and(|own| own.submission == word);
        seen.slug == word || seen.name == word || label
    };
    class.unused.extend(matches.lost(
        |word| found.seen.iter().any(|seen| is_called(seen, word)),
        |word| found.seen.iter().any(|seen| seen.aside && is_called(seen, word)),
    ));
    class.unopened.clone_from(&found.unopened);
    class.stale.extend(outdated);
    if let (Some(roster), Some(policy)) = (roster, &stated.late) {
        let strangers = policy.strangers(roster.students.iter().map(|own| own.number.as_str()));
        class.unused.extend(strangers);
    }
    if !found.list.is_empty() {
        class.list.clone_from(&found.list);
    }
    let mut entries: Vec<Option<SubmissionReport>> = entries.into_iter().map(Some).collect();
    let mut counting = Vec::new();
    for (at, mut standing) in standings {
        // Attempts that were not graded are told, too.
        let own = standing.label.as_ref().map(Label::person);
        let others = found.seen.iter().filter(|seen| seen.aside && !is_graded(seen));
        let others = others.filter(|seen| seen.label.as_ref().map(Label::person) == own);
        let others = others.map(|seen| seen.name.clone());
        let known: Vec<String> = others.filter(|name| !standing.set_aside.contains(name)).collect();
        standing.set_aside.extend(known);
        if !records[at].comparable {
            class.incomparable.push(claims[at].name.clone());
        }
        let stale = decisions[at].iter().filter(|own| own.stale);
        class.stale.extend(stale.map(|own| format!("{}: {}", claims[at].name, own.words())));
        standing.decisions.clone_from(&decisions[at]);
        match &mends[at] {
            Some(Ok(mended)) => standing.mended = Some(mended.clone()),
            Some(Err(words)) => class.stale.push(format!("{}: {words}", claims[at].name)),
            None => {}
        }
        let Some(entry) = entries[at].take() else { continue };
        let grade = std::mem::take(&mut grades[at]);
        counting.push(SubmissionReport { grade, standing, ..entry });
    }
    let held_back = found.held_back.clone();
    let released = output.join(report::INSTRUCTOR).join(RELEASED).is_file();
    let settled = BatchReport::settled(stated.clone(), held_back, counting, class);
    let alike = output.join(report::INSTRUCTOR).join(report::LIKENESS);
    let has_alike = alike.join(report::HTML_FILE).is_file();
    Ok(Settled { report: BatchReport { released, has_alike, ..settled }, records, shared })
}
