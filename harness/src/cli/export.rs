//! `umbra export`: the grades of a report as other programs take them.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use serde_json::json;

use super::class;
use super::context::Context;
use super::earlier::{Report, Row};
use crate::class::Kind;
use crate::class::export::{Points, grade_book};
use crate::columns::count;
use crate::files::write_whole;
use crate::report::{self, harmless};
use crate::rubric::{PartGrade, Rules};

/// What takes the grades.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// The grade book of Brightspace (D2L), as it was exported
    Brightspace,
    /// The grade book of Canvas, as it was exported
    Canvas,
    /// The grading worksheet of a Moodle assignment, as it was downloaded
    Moodle,
    /// `results.json` of Gradescope, for one submission
    Gradescope,
    /// JUnit XML, one test case for each part
    Junit,
}

/// Options of `umbra export`.
#[derive(clap::Args)]
pub struct ExportArguments {
    /// Where to write
    file: PathBuf,
    /// What takes the grades; brightspace, canvas and moodle fill the file that `umbra grade --class` was given
    #[arg(long, value_enum)]
    format: Format,
    /// The report's folder
    #[arg(long, short, value_name = "DIR", default_value = "umbra-report")]
    output: PathBuf,
    /// What the platform calls the assignment [default: its name in config.json]
    #[arg(long, value_name = "NAME")]
    item: Option<String>,
    /// Only this submission: the name of its folder in the report
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
}

/// Writes the grades and says who is not in them.
pub fn export(arguments: &ExportArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let mut report = Report::read(&arguments.output)?;
    if let Some(only) = &arguments.only {
        report.submissions.retain(|row| row.slug == *only);
        ensure!(
            !report.submissions.is_empty(),
            "{} has no submission \"{only}\"",
            arguments.output.display()
        );
    }
    let text = match arguments.format {
        Format::Brightspace => book(arguments, root, &report, Kind::Brightspace)?,
        Format::Canvas => book(arguments, root, &report, Kind::Canvas)?,
        Format::Moodle => book(arguments, root, &report, Kind::Moodle)?,
        Format::Gradescope => gradescope(&report)?,
        Format::Junit => junit(&report),
    };
    write_whole(&arguments.file, text.as_bytes())
        .with_context(|| format!("cannot write {}", arguments.file.display()))?;
    Ok(super::EXIT_OK)
}

/// The class list's own columns with the points in one of them.
fn book(
    arguments: &ExportArguments,
    root: Option<&Path>,
    report: &Report,
    kind: Kind,
) -> anyhow::Result<String> {
    let Some(roster) = class::roster(None, &arguments.output)? else {
        bail!(
            "{} has no class list; hint: grade with --class LIST.csv, the file that {} exports",
            arguments.output.display(),
            kind.title()
        );
    };
    ensure!(
        roster.kind == kind,
        "{}: expected the export of {}, found that of {}; hint: --format {}",
        roster.path.display(),
        kind.title(),
        roster.kind.title(),
        roster.kind.title().to_lowercase()
    );
    let undecided =
        report.class.as_ref().map(|class| class.undecided.as_slice()).unwrap_or_default();
    let (mut graded, mut left, mut over) = (Vec::new(), Vec::new(), Vec::new());
    for row in &report.submissions {
        let student = row.standing.student.as_ref();
        let student = student.and_then(|own| roster.students.iter().find(|other| *other == own));
        let why = match student {
            None => "nobody of the class list",
            Some(_) if undecided.iter().any(|own| own.submission == row.name) => "not decided yet",
            Some(_) if row.points < row.points_max => "not wholly judged",
            Some(student) => {
                if row.points > row.out_of {
                    over.push(student.who());
                }
                graded.push(Points { student, points: row.points });
                continue;
            }
        };
        left.push(format!("{}: {why}", row.name));
    }
    ensure!(!graded.is_empty(), "no grade to export: {}", harmless(&left.join("; ")));
    let item = match &arguments.item {
        Some(item) => item.clone(),
        None => Context::assignment(root)?.name,
    };
    let text = grade_book(&roster, &item, &graded).map_err(anyhow::Error::msg)?;
    println!("{}: {} for {}", arguments.file.display(), count(graded.len(), "grade"), kind.title());
    if !over.is_empty() {
        println!(
            "warning: more than the maximum, which the platform may cut (Brightspace: turn on \"Can Exceed\"): {}",
            harmless(&over.join(", "))
        );
    }
    for line in &left {
        println!("left out: {}", harmless(line));
    }
    Ok(text)
}

/// What was said for the student's eyes about the whole.
fn remarks(row: &Row, rules: &Rules) -> String {
    let public = row.remarks.iter().filter(|remark| !report::is_private(remark, rules));
    public.map(|remark| harmless(remark)).collect::<Vec<_>>().join("; ")
}

/// `results.json` of Gradescope's autograders: a test for each part.
fn gradescope(report: &Report) -> anyhow::Result<String> {
    let [row] = report.submissions.as_slice() else {
        bail!(
            "Gradescope takes one submission at a time, and there are {}; hint: --only NAME",
            report.submissions.len()
        );
    };
    let tests = row.parts.iter().map(|part| {
        let bonus = if part.bonus { " (bonus)" } else { "" };
        json!({
            "number": part.id,
            "name": format!("{}{bonus}", part.title),
            "score": part.points,
            "max_score": part.out_of,
            "status": if part.points < part.out_of && !part.bonus { "failed" } else { "passed" },
            "output": harmless(&part.reason),
            "output_format": "text",
            "visibility": "visible",
        })
    });
    let results = json!({
        "score": row.points,
        "output": remarks(row, &report.assignment.rules),
        "output_format": "text",
        "tests": tests.collect::<Vec<_>>(),
    });
    Ok(serde_json::to_string_pretty(&results)? + "\n")
}

/// A test suite for each submission, a test case for each part.
fn junit(report: &Report) -> String {
    let quoted = |text: &str| {
        let text = harmless(text);
        [('&', "&amp;"), ('<', "&lt;"), ('>', "&gt;"), ('"', "&quot;")]
            .iter()
            .fold(text, |text, (sign, name)| text.replace(*sign, name))
    };
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    xml += &format!("<testsuites name=\"{}\">\n", quoted(&report.assignment.title));
    for row in &report.submissions {
        let open = |part: &&PartGrade| part.points < part.points_max;
        let lost = |part: &&PartGrade| part.points < part.out_of && !part.bonus && !open(part);
        let number = |which: &dyn Fn(&&PartGrade) -> bool| row.parts.iter().filter(which).count();
        xml += &format!(
            "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\">\n",
            quoted(&row.slug),
            row.parts.len(),
            number(&lost),
            number(&open)
        );
        for part in &row.parts {
            let name = quoted(&format!("{} {}", part.id, part.title));
            let points = format!("{} of {} points", part.points, part.out_of);
            let said = quoted(&format!("{points}: {}", part.reason));
            xml += &format!("    <testcase classname=\"{}\" name=\"{name}\"", quoted(&row.slug));
            xml += &match part {
                part if open(&part) => format!("><error message=\"{said}\"/></testcase>\n"),
                part if lost(&part) => format!("><failure message=\"{said}\"/></testcase>\n"),
                _ => "/>\n".to_owned(),
            };
        }
        let remarks = remarks(row, &report.assignment.rules);
        if !remarks.is_empty() {
            xml += &format!("    <system-out>{}</system-out>\n", quoted(&remarks));
        }
        xml += "  </testsuite>\n";
    }
    xml + "</testsuites>\n"
}
