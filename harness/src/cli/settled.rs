//! The report of a class by what is decided: points, whose each submission is, which count, what lateness costs.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context as _;

use super::class;
use super::found::{BatchIndex, Seen};
use crate::class::jplag;
use crate::class::mending::{self, Mended};
use crate::class::overrides::{Applied, Overrides, Subject};
use crate::class::{Claim, Deciding, Decisions, Label, Matches, Owners, Roster, Standing, settle};
use crate::files::write_whole;
use crate::grading::{Record, RecordCache, Shared, StoredRecord};
use crate::program::graded;
use crate::report::{self, BatchReport, SubmissionReport, outline};
use crate::rubric::{self, Grade, Rules};

/// The file that is there once held-back scenes are released, in the instructor's folder.
pub const RELEASED: &str = "released.txt";

/// The file that says of which content the times in `matches.toml` were said, in the instructor's folder.
const TIMES: &str = "times.json";

/// How often something that takes long says how far it is.
const PACE: Duration = Duration::from_secs(2);

/// What is done once for each submission; said where it takes long.
pub struct StepCounter<'a> {
    what: &'a str,
    of: usize,
    done: Cell<usize>,
    said: Cell<Instant>,
}

impl<'a> StepCounter<'a> {
    pub fn new(what: &'a str, of: usize) -> Self {
        Self { what, of, done: Cell::new(0), said: Cell::new(Instant::now()) }
    }

    pub fn step(&self) {
        self.done.set(self.done.get() + 1);
        if self.said.get().elapsed() > PACE {
            self.said.set(Instant::now());
            eprintln!("umbra: {}: {} of {}", self.what, self.done.get(), self.of);
        }
    }
}

/// The report of a class. Its entries are outlines: what was found out is in the files of records.
pub struct Settled {
    /// The report.
    pub report: BatchReport,
    /// The records of all that is graded, whether it counts or not.
    pub records: Vec<StoredRecord>,
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

/// The report of some records: points by what is decided, whose each is, which of them count, what lateness costs.
///
/// # Errors
/// When a decision means nothing.
pub fn settled(
    output: &Path,
    decided: &Decisions,
    found: &BatchIndex,
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
    let overrides = decided.overrides(output)?.on(&owners);
    let (mut grades, mut regraded) = (Vec::new(), Vec::new());
    // One at a time is whole.
    let progress = StepCounter::new("reading what was found out", records.len());
    for earlier in &records {
        progress.step();
        let mut record = earlier.whole()?;
        shared.judge(&mut record);
        let (grade, own) = regrade(output, record, &overrides, &stated.rules)?;
        grades.push(grade);
        regraded.push(own);
    }
    let deciding = Deciding {
        roster,
        matches: &matches,
        policy: stated.late.as_ref(),
        due: &stated.due,
        attempt: decided.attempt,
    };
    let is_graded = |seen: &Seen| claims.iter().any(|claim| claim.slug == seen.slug);
    let absent = absent(found, is_graded);
    let (standings, mut class) = settle(&claims, &mut grades, &absent, found.kind, &deciding)?;
    let parts: Vec<&str> = stated.rules.parts.iter().map(|part| part.id.as_str()).collect();
    let counts = |slug: &str| standings.iter().any(|(at, _)| claims[*at].slug == slug);
    class.unused.extend(overrides.unused(counts, &parts));
    class.unused.extend(lost(&matches, found));
    class.unopened.clone_from(&found.unopened);
    class.stale.extend(outdated);
    if let (Some(roster), Some(policy)) = (roster, &stated.late) {
        let strangers = policy.strangers(roster.students.iter().map(|own| own.number.as_str()));
        class.unused.extend(strangers);
    }
    if !found.list.is_empty() {
        class.list.clone_from(&found.list);
    }
    let mut regraded: Vec<Option<Regraded>> = regraded.into_iter().map(Some).collect();
    let mut counting = Vec::new();
    for (at, mut standing) in standings {
        let Some(own) = regraded[at].take() else { continue };
        let name = &claims[at].name;
        // Attempts that were not graded are told, too.
        let mut aside = aside_of(&standing, found, is_graded);
        aside.retain(|name| !standing.set_aside.contains(name));
        standing.set_aside.extend(aside);
        if !records[at].comparable {
            class.incomparable.push(name.clone());
        }
        let stale = own.decisions.iter().filter(|own| own.stale);
        class.stale.extend(stale.map(|own| format!("{name}: {}", own.words())));
        standing.decisions = own.decisions;
        match own.mended {
            Some(Ok(mended)) => standing.mended = Some(mended),
            Some(Err(words)) => class.stale.push(format!("{name}: {words}")),
            None => {}
        }
        let grade = std::mem::take(&mut grades[at]);
        counting.push(SubmissionReport { grade, standing, ..own.outline });
    }
    let held_back = found.held_back.clone();
    let instructor = output.join(report::INSTRUCTOR);
    let released = instructor.join(RELEASED).is_file();
    let has_similarity = instructor.join(report::SIMILARITY).join(report::HTML_FILE).is_file();
    let settled = BatchReport::settled(stated.clone(), held_back, counting, class);
    Ok(Settled { report: BatchReport { released, has_similarity, ..settled }, records, shared })
}

/// A submission with what the instructor decided on its points, which are kept apart.
struct Regraded {
    outline: SubmissionReport,
    decisions: Vec<Applied>,
    /// What the instructor mended, or why that does not hold any more.
    mended: Option<Result<Mended, String>>,
}

/// The points of a submission by what is decided.
fn regrade(
    output: &Path,
    record: Record,
    overrides: &Overrides,
    rules: &Rules,
) -> anyhow::Result<(Grade, Regraded)> {
    let SubmissionReport { record, grade: original, standing } = graded(record, rules);
    let mut grade = original.clone();
    let subject =
        Subject { slug: &record.slug, digest: &record.digest, evidence: &record.evidence };
    let mut decisions = overrides.apply(&subject, &mut grade);
    let mended = match (overrides.mend(&subject), class::mended_record(output, subject.slug)?) {
        (Some(decision), Some(record)) if decision.evidence == subject.digest => {
            let mut mended = graded(record, rules).grade;
            // What the instructor is to look at in the submission itself.
            let private = original.remarks.iter().filter(|own| report::is_private(own, rules));
            mended.remarks.extend(private.cloned());
            let on_mended = overrides.apply(&subject, &mut mended);
            let made = mending::choose(decision, &mut grade, mended);
            if made.as_ref().is_some_and(|made| made.counts) {
                // They were made on the submission's own evidence, and change points of the mended one.
                for (own, mended) in decisions.iter_mut().zip(on_mended) {
                    (own.before, own.after) = (mended.before, mended.after);
                }
            }
            made.map(Ok)
        }
        (Some(decision), _) => Some(Err(mending::stale(decision))),
        (None, _) => None,
    };
    let outline = outline(SubmissionReport { record, grade: Grade::default(), standing });
    Ok((grade, Regraded { outline, decisions, mended }))
}

/// Those of whom the platform has something that is not graded, with the reason.
fn absent(found: &BatchIndex, is_graded: impl Fn(&Seen) -> bool) -> Vec<(Label, String)> {
    let open = found.seen.iter().filter(|seen| !seen.aside && !is_graded(seen));
    open.filter_map(|seen| {
        let reason = if seen.empty.is_empty() { "not graded yet" } else { &seen.empty };
        Some((seen.label.clone()?, reason.to_owned()))
    })
    .collect()
}

/// Decisions in `matches.toml` on nothing that is graded.
fn lost(matches: &Matches, found: &BatchIndex) -> Vec<String> {
    let is_called = |seen: &Seen, word: &str| {
        let label = seen.label.as_ref().is_some_and(|own| own.submission == word);
        seen.slug == word || seen.name == word || label
    };
    matches.lost(
        |word| found.seen.iter().any(|seen| is_called(seen, word)),
        |word| found.seen.iter().any(|seen| seen.aside && is_called(seen, word)),
    )
}

/// The names of a student's attempts that were not graded, as another one counts by its time.
fn aside_of(
    standing: &Standing,
    found: &BatchIndex,
    is_graded: impl Fn(&Seen) -> bool,
) -> Vec<String> {
    let own = standing.label.as_ref().map(Label::person);
    let others = found.seen.iter().filter(|seen| seen.aside && !is_graded(seen));
    let others = others.filter(|seen| seen.label.as_ref().map(Label::person) == own);
    others.map(|seen| seen.name.clone()).collect()
}

/// What submissions share, also according to JPlag, where it compared what they hold now.
///
/// # Errors
/// When the pairs that were kept of JPlag cannot be read.
pub fn shared(output: &Path, records: &[StoredRecord]) -> anyhow::Result<Shared> {
    let near = jplag::kept(&output.join(report::INSTRUCTOR).join(report::SIMILARITY))?;
    let own = |slug: &str| records.iter().find(|own| own.record.slug == slug);
    let near =
        near.iter().filter(|pair| pair.holds(|slug| Some(own(slug)?.record.digest.as_str())));
    let near = near.map(|pair| (&pair.who, pair.similarity));
    Ok(Shared::of(records.iter().map(|earlier| &earlier.record)).with_near(near))
}

/// The whole record of a submission.
///
/// # Errors
/// When there is no such submission, or its record cannot be read.
pub fn whole(records: &[StoredRecord], slug: &str) -> anyhow::Result<Record> {
    let own = records.iter().find(|own| own.record.slug == slug);
    own.with_context(|| format!("there is no submission {slug}"))?.whole()
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
    BatchIndex::read(output)?.unwrap_or_default().name(&mut records);
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
