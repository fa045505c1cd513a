//! The class list of a platform with the points in one of its columns.

use std::path::Path;

use anyhow::{bail, ensure};

use super::{Item, left_out, waits};
use crate::class::export::{Book, Points, check_keys, grade_book};
use crate::class::{ListedStudent, Platform, Roster};
use crate::cli::class;
use crate::cli::earlier::StoredReport;
use crate::columns::count;
use crate::report::harmless;

/// The column of a worksheet of Moodle that says whether it takes a grade.
const CHANGEABLE: &str = "Grade can be changed";

/// The class list, where it is this platform's.
pub(super) fn of_platform(
    roster: Option<Roster>,
    kind: Platform,
    output: &Path,
) -> anyhow::Result<Roster> {
    let Some(roster) = roster else {
        bail!(
            "{} has no class list; hint: grade with --class LIST.csv, the file that {} exports",
            output.display(),
            kind.title()
        );
    };
    ensure!(
        roster.kind != Platform::Plain,
        "{}: not an export of {}: no platform that Umbra knows has these columns; hint: grade with --class and the file \
         that {} exports, unchanged. If its headings are not in English, switch {} to English first",
        roster.path.display(),
        kind.title(),
        kind.title(),
        kind.title()
    );
    let hint = match roster.kind {
        Platform::Brightspace | Platform::Canvas | Platform::Moodle => {
            format!("the format {}", roster.kind.title().to_lowercase())
        }
        other => format!(
            "Umbra fills no grade book of {}; the format csv holds all points by student number",
            other.title()
        ),
    };
    ensure!(
        roster.kind == kind,
        "{}: expected the export of {}, found that of {}; hint: {hint}",
        roster.path.display(),
        kind.title(),
        roster.kind.title()
    );
    check_keys(&roster).map_err(anyhow::Error::msg)?;
    Ok(roster)
}

/// The class list's own columns with the points in one of them.
pub(super) fn book(
    file: &Path,
    output: &Path,
    item: &Item,
    report: &StoredReport,
    kind: Platform,
    said: &mut Vec<String>,
) -> anyhow::Result<String> {
    let roster = of_platform(class::roster(None, output)?, kind, output)?;
    let Sorted { graded, mut left, open } = sorted(report, &roster);
    ensure!(!graded.is_empty(), "no grade to export: {}", harmless(&left.join("; ")));
    let item = item.item.as_ref().unwrap_or(&report.assignment.name);
    let book = grade_book(&roster, item, &graded).map_err(anyhow::Error::msg)?;
    left.extend(book.excused.iter().map(|who| format!("{who}: excused, says {}", kind.title())));
    let no_key =
        |who: &String| format!("{who}: no column says by what {} knows them", kind.title());
    left.extend(book.unknown.iter().map(no_key));
    let is_written =
        |who: &String| ![&book.excused, &book.unknown].iter().any(|own| own.contains(who));
    let written = graded.iter().map(|own| own.student.who()).filter(is_written).count();
    ensure!(written > 0, "no grade to export: {}", harmless(&left.join("; ")));
    said.push(format!("{}: {} for {}", file.display(), count(written, "grade"), kind.title()));
    let out_of = report.submissions.first().map_or(0.0, |row| row.out_of);
    said.extend(warnings(&book, &roster, &graded, out_of));
    if !open.is_empty() {
        said.push(format!(
            "warning: {} with points that still wait for you; `umbra status` lists them:",
            count(open.len(), "grade")
        ));
        said.extend(open.iter().map(|line| format!("  {}", harmless(line))));
    }
    said.extend(left_out(&left));
    Ok(book.text)
}

/// The submissions of a report by whether they have a row in a grade book.
struct Sorted<'a> {
    graded: Vec<Points<'a>>,
    /// Those that are left out, with the reason.
    left: Vec<String>,
    /// Those with points that wait for the instructor.
    open: Vec<String>,
}

fn sorted<'a>(report: &StoredReport, roster: &'a Roster) -> Sorted<'a> {
    let (mut graded, mut left, mut open) = (Vec::new(), Vec::new(), Vec::new());
    for row in &report.submissions {
        let student = row.standing.student.as_ref();
        let student = student.and_then(|own| roster.students.iter().find(|other| *other == own));
        let why = match (student, waits(row, report)) {
            (_, Some(why)) => why,
            (None, _) => "nobody of the class list",
            (Some(_), None) if row.is_unread() => {
                "nobody could open it; hint: ask for another archive, or `umbra confirm` its points"
            }
            (Some(student), None) if may_have_another(student, report) => {
                "another submission may be theirs, which is not decided yet"
            }
            (Some(student), None) => {
                graded.push(Points { student, points: row.points });
                let waits = row.open(&report.assignment.rules);
                if !waits.is_empty() {
                    open.push(format!("{}: {}", student.who(), waits.join("; ")));
                }
                continue;
            }
        };
        left.push(format!("{}: {why}", row.name));
    }
    Sorted { graded, left, open }
}

/// What the platform may do with a grade book other than to take it as it is. The grades are out of `out_of`.
fn warnings(book: &Book, roster: &Roster, graded: &[Points], out_of: f64) -> Vec<String> {
    let (title, list) = (roster.kind.title(), roster.path.display());
    let mut said = Vec::new();
    if let Some(others) = &book.others {
        let others = if others.is_empty() {
            "and no other grade".to_owned()
        } else {
            format!("only {}", others.join(", "))
        };
        said.push(harmless(&format!(
            "warning: {list} has no column \"{}\", {others}; {title} may ignore it or make a new item; hint: --item \
             NAME, or make the item there first",
            book.column
        )));
    }
    let maximum = book.maximum.unwrap_or(out_of);
    if maximum != out_of {
        said.push(harmless(&format!(
            "warning: \"{}\" is out of {maximum} in {list}, and the grades are out of {out_of}: they are not scaled; \
             hint: set the maximum to {out_of} on the platform",
            book.column
        )));
    }
    let over = graded.iter().filter(|own| own.points > maximum);
    let over: Vec<String> = over.map(|own| own.student.who()).collect();
    if !over.is_empty() {
        said.push(format!(
            "warning: more than the maximum of {maximum}, which the platform may cut or refuse (Brightspace: turn on \
             \"Can Exceed\"): {}",
            harmless(&over.join(", "))
        ));
    }
    let column = roster.header.iter().position(|own| own.trim() == CHANGEABLE);
    let is_locked = |own: &&Points| {
        let cell = column.and_then(|at| roster.rows.get(own.student.row)?.get(at));
        cell.is_some_and(|cell| cell.trim() == "No")
    };
    let locked: Vec<String> =
        graded.iter().filter(is_locked).map(|own| own.student.who()).collect();
    if !locked.is_empty() {
        said.push(format!(
            "warning: {title} says that these grades cannot be changed, and may pass them over: {}",
            harmless(&locked.join(", "))
        ));
    }
    said
}

/// Whether a submission that is not decided yet may be a student's, beside their own.
fn may_have_another(student: &ListedStudent, report: &StoredReport) -> bool {
    let undecided = report.class.iter().flat_map(|class| &class.undecided);
    undecided.flat_map(|own| &own.candidates).any(|candidate| candidate == student)
}
