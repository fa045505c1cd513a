//! Makes a report from the files in its folder: records, other results of the last run, and pins. It needs no
//! submission and renders nothing.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};

use super::changes::changes;
use super::class;
use super::found::{BatchIndex, ensure_merged};
use super::settled::{Settled, StepCounter, settled, shared, whole};
use crate::class::{Claim, Decisions, Owners, Pins, Platform, Roster};
use crate::grading::{Record, RecordCache, StoredRecord};
use crate::held_back::HeldBack;
use crate::program::graded;
use crate::report::{self, BatchReport, ReportError, SubmissionReport};

/// A report's folder, as it was kept.
pub struct KeptReport {
    /// What grades are settled by.
    pub pins: Pins,
    found: BatchIndex,
    roster: Option<Roster>,
    records: Vec<StoredRecord>,
}

impl KeptReport {
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
        let Some(found) = BatchIndex::read(output)?.filter(|_| pins.current().is_some()) else {
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
    pub fn kind(&self) -> Platform {
        self.found.kind
    }

    /// Where the submissions were looked for.
    pub fn paths(&self) -> &[PathBuf] {
        &self.found.paths
    }

    /// What is pinned.
    ///
    /// # Errors
    /// When nothing is pinned.
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

/// The report of a run that graded all that it was given: keeps what it found, pins what is decided by now, and writes.
///
/// # Errors
/// When a file cannot be read or written, or a decision means nothing.
pub fn finish(
    output: &Path,
    pins: &mut Pins,
    decided: &Decisions,
    mut found: BatchIndex,
    records: Vec<StoredRecord>,
) -> anyhow::Result<BatchReport> {
    let instructor = output.join(report::INSTRUCTOR);
    let _lock = Pins::lock(&instructor)?;
    // Something may have been decided while this was graded.
    *pins = Pins::read(&instructor)?;
    let decided = &Decisions::read(output, decided.assignment.clone(), decided.attempt)?;
    found.join(BatchIndex::read(output)?.unwrap_or_default(), output);
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
    let progress = StepCounter::new("writing the reports", 2 * settled.report.entries.len());
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
