//! `umbra override`, `umbra confirm` and `umbra status`: what a report leaves to the instructor.

use std::path::Path;

use anyhow::{Context as _, ensure};

use super::assemble::KeptReport;
use super::chosen::{Graded, one};
use super::earlier::{ReportRow, StoredReport};
use super::outputs::shell_path;
use super::report_folder::ReportFolder;
use crate::class::overrides::{Applied, Decision, OVERRIDES, entry, fingerprint};
use crate::class::{Decisions, INCOMPARABLE};
use crate::columns;
use crate::files::write_whole;
use crate::report::{self, BatchReport, harmless};

/// Options of `umbra override`.
#[derive(clap::Args)]
pub struct OverrideArguments {
    /// Student number, name, or the submission's folder in the report
    student: String,
    /// The part, such as 1.3
    part: String,
    /// The new points
    #[arg(value_parser = points)]
    points: f64,
    #[command(flatten)]
    decision: DecisionArguments,
}

/// Options of `umbra confirm`.
#[derive(clap::Args)]
pub struct ConfirmArguments {
    /// Student number, name, or the submission's folder in the report
    student: String,
    #[command(flatten)]
    decision: DecisionArguments,
}

/// What every decision says.
#[derive(clap::Args)]
pub struct DecisionArguments {
    /// The reason, shown to student and instructor
    #[arg(long, value_name = "TEXT")]
    reason: String,
    /// Who decided [default: your account name]
    #[arg(long, value_name = "NAME")]
    by: Option<String>,
    #[command(flatten)]
    pub report: ReportFolder,
}

/// Options of `umbra status`.
#[derive(clap::Args)]
pub struct StatusArguments {
    #[command(flatten)]
    report: ReportFolder,
}

fn points(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
    number.ok_or_else(|| "expected points, such as 12.5".to_owned())
}

/// Sets the points of a part.
///
/// # Errors
/// When there is no report, part or student of that name, the points are out of range, or the decision cannot be kept.
pub fn override_part(arguments: &OverrideArguments) -> anyhow::Result<u8> {
    let OverrideArguments { student, part, points, decision } = arguments;
    let kept = KeptReport::read(&decision.report.path)?;
    let parts = &kept.decided()?.assignment.rules.parts;
    let known = parts.iter().find(|own| own.id == *part).with_context(|| {
        let parts: Vec<&str> = parts.iter().map(|own| own.id.as_str()).collect();
        format!("there is no part {part}; expected one of {}", parts.join(", "))
    })?;
    ensure!(
        (0.0..=known.points).contains(points),
        "part {part} is worth 0 to {} points, found {points}",
        known.points
    );
    let graded = one(student, &decision.report.path, &kept)?;
    let own = graded.entry.grade.parts.iter().position(|own| own.id == *part);
    let own = own.map(|at| &graded.entry.grade.parts[at..=at]).unwrap_or_default();
    let evidence = fingerprint(&graded.subject(), own);
    let before = own.first().map(|own| [own.points, own.points_max]).unwrap_or_default();
    let made = decision.of(&graded, evidence)?;
    let made = Decision { part: Some(part.clone()), points: Some(*points), ..made };
    let report = decision.add(kept, &made)?;
    // What a fix of the instructor shows is the evidence, where that counts.
    let applied = applied(&graded, &report, Some(part));
    let [least, most] = applied.map_or(before, |own| own.before);
    println!(
        "{}: part {part} now has {}; the evidence gives {}",
        harmless(&graded.entry.who()),
        columns::points(*points),
        columns::range([least, most])
    );
    said(&decision.report.path, &graded, &report)
}

/// Confirms what was left to the instructor.
///
/// # Errors
/// When there is no report or no such student, or the decision cannot be kept.
pub fn confirm(arguments: &ConfirmArguments) -> anyhow::Result<u8> {
    let ConfirmArguments { student, decision } = arguments;
    let kept = KeptReport::read(&decision.report.path)?;
    let graded = one(student, &decision.report.path, &kept)?;
    let evidence = fingerprint(&graded.subject(), &graded.entry.grade.parts);
    let report = decision.add(kept, &decision.of(&graded, evidence)?)?;
    println!("{}: {}", harmless(&graded.entry.who()), confirmed(&graded, &report));
    said(&decision.report.path, &graded, &report)
}

/// The last decision on a part, or on the whole, as the report applies it beside all others; none where the submission
/// does not count.
fn applied<'a>(
    graded: &Graded,
    report: &'a BatchReport,
    part: Option<&str>,
) -> Option<&'a Applied> {
    let slug = &graded.entry.record.slug;
    let entry = report.entries.iter().find(|own| own.record.slug == *slug)?;
    entry.standing.decisions.iter().rfind(|own| own.decision.part.as_deref() == part)
}

/// What a confirmation is worth, beside all other decisions on the submission.
fn confirmed(graded: &Graded, report: &BatchReport) -> String {
    let (from, to) = match applied(graded, report, None) {
        Some(own) => (own.before[0], own.after[0]),
        None => (0.0, graded.entry.grade.unconfirmed),
    };
    let points = ((to - from) * 100.0).round() / 100.0;
    match points {
        0.0 => "confirmed; it changes no points".to_owned(),
        earned => format!("confirmed: {} for the images", columns::points(earned)),
    }
}

/// Says where a decision is kept, and whether the report that was made by it shows it.
pub fn said(output: &Path, graded: &Graded, report: &BatchReport) -> anyhow::Result<u8> {
    let shown = match graded.not_counting(report) {
        None => "; the reports show it".to_owned(),
        Some(why) => format!(", but no report shows it: {why}"),
    };
    println!(
        "kept in {}{shown}; `umbra regrade --undo --report {}` takes it back",
        output.join(OVERRIDES).display(),
        shell_path(output)
    );
    Ok(super::EXIT_OK)
}

impl DecisionArguments {
    /// Makes sure, before any work, that there is a reason.
    ///
    /// # Errors
    /// When there is none.
    pub fn check(&self) -> anyhow::Result<()> {
        ensure!(!self.reason.trim().is_empty(), "--reason: expected a reason, found nothing");
        Ok(())
    }

    /// A fix of a submission, which applies to exactly these files.
    ///
    /// # Errors
    /// When there is no reason.
    pub fn mend(&self, graded: &Graded, patch: String, penalty: f64) -> anyhow::Result<Decision> {
        let made = self.of(graded, graded.entry.record.digest.clone())?;
        Ok(Decision { patch: Some(patch), penalty: Some(penalty), ..made })
    }

    /// A decision on a submission as a whole.
    fn of(&self, graded: &Graded, evidence: String) -> anyhow::Result<Decision> {
        self.check()?;
        Ok(Decision {
            student: graded.key.clone(),
            part: None,
            points: None,
            patch: None,
            penalty: None,
            reason: self.reason.trim().to_owned(),
            by: self.by.clone().or_else(account).unwrap_or_default(),
            when: jiff::Timestamp::now().round(jiff::Unit::Second)?.to_string(),
            evidence,
        })
    }

    /// Adds a decision to the file, and writes the reports by it; answers the class's.
    ///
    /// # Errors
    /// When the file says what means nothing, or something cannot be written.
    pub fn add(&self, kept: KeptReport, decision: &Decision) -> anyhow::Result<BatchReport> {
        let file = self.report.path.join(OVERRIDES);
        // Two decisions at the same time follow each other, each on what is settled by then.
        let (_lock, mut kept) = kept.locked(&self.report.path)?;
        // What is there must be right before anything is added to it.
        let current = kept.decided()?.clone();
        let mut decided =
            Decisions::read(&self.report.path, current.assignment.clone(), current.attempt)?;
        decided.matches = current.matches;
        if decided.overrides.is_empty() {
            decided.overrides = String::from(
                "# What the instructor decided on points. Commands only add to this file; the last decision on\n\
                 # something counts. Delete one to take it back, and run `umbra regrade`.\n",
            );
        }
        decided.overrides += &entry(decision)?;
        decided.check(&self.report.path)?;
        write_whole(&file, decided.overrides.as_bytes())
            .with_context(|| format!("cannot write {}", file.display()))?;
        kept.apply(&self.report.path, decided, &decision.reason, false)
    }
}

/// The name of the account that runs this; nothing where the system knows none.
fn account() -> Option<String> {
    let named = ["USER", "LOGNAME", "USERNAME"].into_iter();
    let named = named.filter_map(|name| std::env::var(name).ok());
    let named = named.map(|name| name.trim().to_owned()).find(|name| !name.is_empty());
    #[cfg(unix)]
    let named = named.or_else(|| {
        let user = nix::unistd::User::from_uid(nix::unistd::Uid::current()).ok()??;
        Some(user.name).filter(|name| !name.is_empty())
    });
    named
}

/// Lists what waits for the instructor; exit 1 where anything does.
///
/// # Errors
/// When there is no report, or it cannot be read.
pub fn status(arguments: &StatusArguments) -> anyhow::Result<u8> {
    let report = StoredReport::read(&arguments.report.path)?;
    let class = report.class.unwrap_or_default();
    let rules = &report.assignment.rules;
    let row = |row: &ReportRow, what: &str| format!("{} ({}): {what}", row.name, row.slug);
    let open = || report.submissions.iter().filter(|row| !row.standing.is_confirmed());
    let images = open().filter(|own| own.unconfirmed > 0.0);
    let images: Vec<String> = images
        .map(|own| row(own, &format!("{} for its images", columns::points(own.unconfirmed))))
        .collect();
    let remarks = open().filter_map(|own| {
        let private = own.remarks.iter().filter(|remark| report::is_private(remark, rules));
        let private: Vec<&str> = private.map(String::as_str).collect();
        (!private.is_empty()).then(|| row(own, &private.join("; ")))
    });
    let drafts = open().filter(|own| own.standing.is_draft());
    let drafts = drafts.map(|own| row(own, "the student may still change it"));
    let unread = report.submissions.iter().filter(|own| own.is_unread());
    let unread = unread.map(|own| row(own, own.remarks.first().map_or("", String::as_str)));
    let late = report.submissions.iter().filter(|own| own.standing.time_unknown);
    let late = late.map(|own| row(own, "when it was submitted is not known"));
    let ranges = report.submissions.iter().filter(|own| own.points < own.points_max);
    let ranges =
        ranges.map(|own| row(own, &format!("{} to {} points", own.points, own.points_max)));
    let undecided = class.undecided.iter().map(|own| format!("{}: {}", own.submission, own.reason));
    let missing = class.missing.iter().map(|own| match own.reason.as_str() {
        "" => own.student.who(),
        reason => format!("{}: {reason}", own.student.who()),
    });
    let mut waits = false;
    for (title, lines) in [
        ("whose they are, to be decided in matches.toml", undecided.collect()),
        ("neither opened nor graded", class.unopened.clone()),
        ("nobody could open them: ask for other archives, or `umbra confirm`", unread.collect()),
        ("images without code, for `umbra confirm` or `umbra override`", images),
        ("drafts, not submitted: ask, then `umbra confirm`", drafts.collect()),
        ("to be looked at, then `umbra confirm` or `umbra override`", remarks.collect::<Vec<_>>()),
        (
            "decisions whose evidence has changed: make them again or delete them",
            class.stale.clone(),
        ),
        (
            "decisions on submissions that are not in this report or do not count",
            class.unused.clone(),
        ),
        ("lateness unknown: `submitted` in matches.toml says it", late.collect()),
        ("not wholly judged: grade again", ranges.collect()),
        (INCOMPARABLE, class.incomparable.clone()),
    ] {
        waits |= !lines.is_empty();
        list(title, &lines);
    }
    list("counting attempts that earn less than another attempt", &class.worse);
    list("without a submission", &missing.collect::<Vec<_>>());
    if !waits {
        println!("nothing waits for a decision");
    }
    Ok(if waits { super::EXIT_NOT_IN_ORDER } else { super::EXIT_OK })
}

fn list(title: &str, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    println!("{title}: {}", lines.len());
    for line in lines {
        println!("  {}", harmless(line));
    }
}
