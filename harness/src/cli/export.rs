//! `umbra export` and `umbra grade --export`: the grades of a report in the formats of other programs.

mod grade_book;
mod gradescope;
mod junit;
mod noted;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};

use self::grade_book::{book, of_platform};
use self::gradescope::gradescope;
pub use self::noted::is_export;
use self::noted::{is_same, may_replace, note};
use super::assemble::KeptReport;
use super::chosen::one;
use super::class;
use super::earlier::{ReportRow, StoredReport};
use super::report_folder::ReportFolder;
use crate::class::feedback::{self, Feedback};
use crate::class::{Class, INCOMPARABLE, Platform, Roster};
use crate::columns::count;
use crate::files::write_whole;
use crate::report::{self, harmless};
use crate::rubric::Rules;

/// What takes the grades.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ExportFormat {
    /// The grade book of Brightspace (D2L), as it was exported
    Brightspace,
    /// The grade book of Canvas, as it was exported
    Canvas,
    /// The grading worksheet of a Moodle assignment, as it was downloaded
    Moodle,
    /// A zip of what each student may read, in the layout that the platform of the download takes back
    Feedback,
    /// `results.json` of Gradescope, for one submission
    Gradescope,
    /// JUnit XML, one test case for each part
    Junit,
    /// `grades.csv`, for a spreadsheet
    Csv,
    /// `report.json`, for programs
    Json,
}

impl ExportFormat {
    /// The file that `umbra grade --export` writes into the report.
    fn file(self) -> &'static str {
        match self {
            Self::Brightspace => "brightspace.csv",
            Self::Canvas => "canvas.csv",
            Self::Moodle => "moodle.csv",
            Self::Feedback => "feedback.zip",
            Self::Gradescope => "results.json",
            Self::Junit => "junit.xml",
            Self::Csv => report::CSV_FILE,
            Self::Json => report::JSON_FILE,
        }
    }

    /// The platform whose grade book it fills, if it does.
    fn platform(self) -> Option<Platform> {
        match self {
            Self::Brightspace => Some(Platform::Brightspace),
            Self::Canvas => Some(Platform::Canvas),
            Self::Moodle => Some(Platform::Moodle),
            _ => None,
        }
    }
}

/// Options of `umbra export`.
#[derive(clap::Args)]
pub struct ExportArguments {
    /// Where to write
    file: PathBuf,
    /// What takes the grades; brightspace, canvas and moodle fill the file that `umbra grade --class` was given
    #[arg(long, value_enum)]
    format: ExportFormat,
    #[command(flatten)]
    report: ReportFolder,
    #[command(flatten)]
    item: Item,
    /// Only this student's submission: a number, a name, or its folder in the report
    #[arg(long, value_name = "STUDENT")]
    only: Option<String>,
}

/// The column of a grade book.
#[derive(clap::Args, Clone, Debug)]
pub struct Item {
    /// What the platform calls the assignment in its grade book [default: its name in config.json]
    #[arg(long, value_name = "NAME")]
    item: Option<String>,
}

/// Writes the grades and says who is not in them.
///
/// # Errors
/// When there is no report, the format cannot hold what is asked, or the file cannot be written.
pub fn export(arguments: &ExportArguments) -> anyhow::Result<u8> {
    let ExportArguments { file, format, report: ReportFolder { path: output }, item, only } =
        arguments;
    let mut report = StoredReport::read(output)?;
    if let Some(only) = only {
        ensure!(
            !matches!(format, ExportFormat::Csv | ExportFormat::Json),
            "--only: expected a format that can hold one submission, such as gradescope or junit"
        );
        let slug = one(only, output, &KeptReport::read(output)?)?.entry.record.slug;
        report.submissions.retain(|row| row.slug == slug);
        ensure!(
            !report.submissions.is_empty(),
            "the submission {slug} does not count, so there is nothing to export"
        );
        let own = |line: &String| report.submissions.iter().any(|row| line.starts_with(&row.name));
        if let Some(class) = &mut report.class {
            class.incomparable.retain(own);
            class.stale.retain(own);
            class.unused.clear();
        }
    }
    write(*format, file, output, item, &report)?;
    Ok(super::EXIT_OK)
}

/// Makes sure, before any work, that a report can be exported in some formats. `list` is the class list, where one is
/// given.
///
/// # Errors
/// When there is no class list, or it is another platform's.
pub fn check(formats: &[ExportFormat], output: &Path, list: Option<&Path>) -> anyhow::Result<()> {
    for kind in formats.iter().filter_map(|format| format.platform()) {
        let roster = match list {
            Some(list) => Some(Roster::read(list)?),
            None => class::roster(None, output)?,
        };
        of_platform(roster, kind, output)?;
    }
    formats.iter().try_for_each(|format| may_replace(&output.join(format.file()), *format, output))
}

/// Writes a report that was just made in some formats, into its folder.
///
/// # Errors
/// As [`export`].
pub fn beside(formats: &[ExportFormat], output: &Path, item: &Item) -> anyhow::Result<()> {
    for format in formats {
        let report = StoredReport::read(output)?;
        write(*format, &output.join(format.file()), output, item, &report).with_context(|| {
            format!("the report is there, but cannot be exported to {}", format.file())
        })?;
    }
    Ok(())
}

fn write(
    format: ExportFormat,
    file: &Path,
    output: &Path,
    item: &Item,
    report: &StoredReport,
) -> anyhow::Result<()> {
    may_replace(file, format, output)?;
    let mut said = Vec::new();
    let bytes = match format {
        ExportFormat::Brightspace | ExportFormat::Canvas | ExportFormat::Moodle => {
            let kind = format.platform().unwrap_or_default();
            book(file, output, item, report, kind, &mut said)?.into_bytes()
        }
        ExportFormat::Feedback => feedback_archive(file, output, report, &mut said)?,
        ExportFormat::Gradescope | ExportFormat::Junit => {
            said.push(format!(
                "{}: {}",
                file.display(),
                count(report.submissions.len(), "submission")
            ));
            match format {
                ExportFormat::Junit => junit::junit(report, output).into_bytes(),
                _ => gradescope(report, output)?.into_bytes(),
            }
        }
        ExportFormat::Csv | ExportFormat::Json => {
            let own = output.join(format.file());
            if is_same(&own, file) {
                println!("{}: the report keeps it there already", file.display());
                return Ok(());
            }
            let all = count(report.submissions.len(), "submission");
            said.push(format!("{}: {all}, as {}", file.display(), own.display()));
            std::fs::read(&own).with_context(|| format!("cannot read {}", own.display()))?
        }
    };
    write_whole(file, &bytes).with_context(|| format!("cannot write {}", file.display()))?;
    note(&bytes, output)?;
    said.extend(report.class.iter().flat_map(to_look_at));
    said.iter().for_each(|line| println!("{line}"));
    Ok(())
}

/// What the instructor decided and may have to decide again, whatever takes the grades.
fn to_look_at(class: &Class) -> Vec<String> {
    let unused = "on what is not in this report or does not count";
    let kinds = [
        ("submission", INCOMPARABLE, &class.incomparable),
        ("decision", "whose evidence has changed since", &class.stale),
        ("decision", unused, &class.unused),
    ];
    let mut said = Vec::new();
    for (noun, what, lines) in kinds.into_iter().filter(|(.., lines)| !lines.is_empty()) {
        said.push(format!("warning: {} {what}:", count(lines.len(), noun)));
        said.extend(lines.iter().map(|line| format!("  {}", harmless(line))));
    }
    said
}

/// Why a submission is not handed back yet, if it is not.
fn waits(row: &ReportRow, report: &StoredReport) -> Option<&'static str> {
    let undecided = report.class.as_ref().map(|class| class.undecided.as_slice());
    if undecided
        .unwrap_or_default()
        .iter()
        .any(|own| [&row.name, &row.slug].contains(&&own.submission))
    {
        return Some("not decided yet");
    }
    (row.points < row.points_max).then_some("not wholly judged")
}

/// What each student may read.
fn feedback_archive(
    file: &Path,
    output: &Path,
    report: &StoredReport,
    said: &mut Vec<String>,
) -> anyhow::Result<Vec<u8>> {
    let (mut all, mut left) = (Vec::new(), Vec::new());
    let folders: Vec<PathBuf> =
        report.submissions.iter().map(|row| output.join(&row.slug)).collect();
    for (row, folder) in report.submissions.iter().zip(&folders) {
        match waits(row, report) {
            Some(why) => left.push(format!("{}: {why}", row.name)),
            None => all.push(Feedback {
                label: row.standing.label.as_ref(),
                name: &row.name,
                slug: &row.slug,
                folder,
            }),
        }
    }
    ensure!(!all.is_empty(), "no feedback to export: {}", harmless(&left.join("; ")));
    let bytes = feedback::archive(&all)
        .with_context(|| format!("cannot pack the pages in {}", output.display()))?;
    said.push(format!("{}: feedback on {}", file.display(), count(all.len(), "submission")));
    said.extend(left_out(&left));
    Ok(bytes)
}

fn left_out(left: &[String]) -> impl Iterator<Item = String> {
    left.iter().map(|line| format!("left out: {}", harmless(line)))
}

/// What was said for the student's eyes about the whole.
fn remarks(row: &ReportRow, rules: &Rules) -> String {
    let public = row.remarks.iter().filter(|remark| !report::is_private(remark, rules));
    public.map(|remark| harmless(remark)).collect::<Vec<_>>().join("; ")
}
