//! `umbra export` and `umbra grade --export`: the grades of a report in the formats of other programs.

mod junit;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use serde_json::json;
use sha2::{Digest as _, Sha256};

use super::assemble::Kept;
use super::chosen::one;
use super::class;
use super::earlier::{Report, Row};
use super::outputs::shell_path;
use super::report_folder::ReportFolder;
use crate::class::export::{Points, check_keys, grade_book};
use crate::class::feedback::{self, Feedback};
use crate::class::overrides::OVERRIDES;
use crate::class::{Class, INCOMPARABLE, Kind, MATCHES, Roster, Student};
use crate::columns::count;
use crate::files::{hex, write_whole};
use crate::report::{self, harmless};
use crate::rubric::Rules;

/// The column of a worksheet of Moodle that says whether it takes a grade.
const CHANGEABLE: &str = "Grade can be changed";

/// The file that says what was exported, in the instructor's folder.
const EXPORTS: &str = "exports.json";

/// What takes the grades.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
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

impl Format {
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
    fn platform(self) -> Option<Kind> {
        match self {
            Self::Brightspace => Some(Kind::Brightspace),
            Self::Canvas => Some(Kind::Canvas),
            Self::Moodle => Some(Kind::Moodle),
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
    format: Format,
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
pub fn export(arguments: &ExportArguments) -> anyhow::Result<u8> {
    let ExportArguments { file, format, report: ReportFolder { path: output }, item, only } =
        arguments;
    let mut report = Report::read(output)?;
    if let Some(only) = only {
        ensure!(
            !matches!(format, Format::Csv | Format::Json),
            "--only: expected a format that can hold one submission, such as gradescope or junit"
        );
        let slug = one(only, output, &Kept::read(output)?)?.entry.record.slug;
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
pub fn check(formats: &[Format], output: &Path, list: Option<&Path>) -> anyhow::Result<()> {
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
pub fn beside(formats: &[Format], output: &Path, item: &Item) -> anyhow::Result<()> {
    for format in formats {
        let report = Report::read(output)?;
        write(*format, &output.join(format.file()), output, item, &report).with_context(|| {
            format!("the report is there, but cannot be exported to {}", format.file())
        })?;
    }
    Ok(())
}

fn write(
    format: Format,
    file: &Path,
    output: &Path,
    item: &Item,
    report: &Report,
) -> anyhow::Result<()> {
    may_replace(file, format, output)?;
    let mut said = Vec::new();
    let bytes = match format {
        Format::Brightspace | Format::Canvas | Format::Moodle => {
            let kind = format.platform().unwrap_or_default();
            book(file, output, item, report, kind, &mut said)?.into_bytes()
        }
        Format::Feedback => feedback_archive(file, output, report, &mut said)?,
        Format::Gradescope | Format::Junit => {
            said.push(format!(
                "{}: {}",
                file.display(),
                count(report.submissions.len(), "submission")
            ));
            match format {
                Format::Junit => junit::junit(report, output).into_bytes(),
                _ => gradescope(report, output)?.into_bytes(),
            }
        }
        Format::Csv | Format::Json => {
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

/// Digests of what was exported, each with its size [bytes]: an export is known wherever it lies by now.
type Exports = BTreeMap<String, u64>;

/// What was exported from a report; nothing where that cannot be read.
fn exports(output: &Path) -> Exports {
    let file = output.join(report::INSTRUCTOR).join(EXPORTS);
    let bytes = std::fs::read(file).unwrap_or_default();
    serde_json::from_slice(&bytes).unwrap_or_default()
}

/// The path of a file that may not be there yet, by the folder that it lies in.
fn whole_path(file: &Path) -> PathBuf {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    file.file_name().map_or_else(|| folder.clone(), |name| folder.join(name))
}

fn is_same(a: &Path, b: &Path) -> bool {
    whole_path(a) == whole_path(b)
}

/// Makes sure that an export replaces nothing but an earlier export from this report, which nobody changed since.
///
/// # Errors
/// When it would.
fn may_replace(file: &Path, format: Format, output: &Path) -> anyhow::Result<()> {
    if matches!(format, Format::Csv | Format::Json) && is_same(file, &output.join(format.file())) {
        return Ok(());
    }
    let whole = whole_path(file);
    let inside =
        output.canonicalize().ok().and_then(|own| whole.strip_prefix(own).ok().map(Path::to_owned));
    let own = [report::HTML_FILE, report::JSON_FILE, report::CSV_FILE, MATCHES, OVERRIDES];
    if let Some(inside) = inside {
        let is_own = own.iter().any(|name| inside == Path::new(name));
        ensure!(
            !is_own && inside.components().count() == 1,
            "{} belongs to the report, so nothing is exported there; hint: name a file beside {}",
            file.display(),
            output.display()
        );
    }
    if file.symlink_metadata().is_err() {
        return Ok(());
    }
    ensure!(
        is_export(file, output),
        "{} is there already, and is no export from this report, or was changed since; nothing is written; hint: \
         name another file, or remove that one",
        file.display()
    );
    Ok(())
}

/// Whether a file is an export from a report, which nobody changed since.
pub fn is_export(file: &Path, output: &Path) -> bool {
    let Ok(meta) = file.symlink_metadata() else { return false };
    let exports = exports(output);
    meta.is_file()
        && exports.values().any(|size| *size == meta.len())
        && std::fs::read(file).is_ok_and(|bytes| exports.contains_key(&hex(&Sha256::digest(bytes))))
}

/// Notes what was exported, so that a later export may replace it.
fn note(bytes: &[u8], output: &Path) -> anyhow::Result<()> {
    let mut exports = exports(output);
    exports.insert(hex(&Sha256::digest(bytes)), bytes.len() as u64);
    let notes = output.join(report::INSTRUCTOR).join(EXPORTS);
    write_whole(&notes, &serde_json::to_vec_pretty(&exports)?)
        .with_context(|| format!("cannot write {}", notes.display()))
}

/// The class list, where it is this platform's.
fn of_platform(roster: Option<Roster>, kind: Kind, output: &Path) -> anyhow::Result<Roster> {
    let Some(roster) = roster else {
        bail!(
            "{} has no class list; hint: grade with --class LIST.csv, the file that {} exports",
            output.display(),
            kind.title()
        );
    };
    ensure!(
        roster.kind != Kind::Plain,
        "{}: not an export of {}: no platform that Umbra knows has these columns; hint: grade with --class and the file \
         that {} exports, unchanged. If its headings are not in English, switch {} to English first",
        roster.path.display(),
        kind.title(),
        kind.title(),
        kind.title()
    );
    let hint = match roster.kind {
        Kind::Brightspace | Kind::Canvas | Kind::Moodle => {
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

/// Why a submission is not handed back yet, if it is not.
fn waits(row: &Row, report: &Report) -> Option<&'static str> {
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

/// Whether a submission that is not decided yet may be a student's, beside their own.
fn may_have_another(student: &Student, report: &Report) -> bool {
    let undecided = report.class.iter().flat_map(|class| &class.undecided);
    undecided.flat_map(|own| &own.candidates).any(|candidate| candidate == student)
}

/// What each student may read.
fn feedback_archive(
    file: &Path,
    output: &Path,
    report: &Report,
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

/// The class list's own columns with the points in one of them.
fn book(
    file: &Path,
    output: &Path,
    item: &Item,
    report: &Report,
    kind: Kind,
    said: &mut Vec<String>,
) -> anyhow::Result<String> {
    let roster = of_platform(class::roster(None, output)?, kind, output)?;
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
    let list = roster.path.display();
    if let Some(others) = &book.others {
        let others = if others.is_empty() {
            "and no other grade".to_owned()
        } else {
            format!("only {}", others.join(", "))
        };
        said.push(harmless(&format!(
            "warning: {list} has no column \"{}\", {others}; {} may ignore it or make a new item; hint: --item \
             NAME, or make the item there first",
            book.column,
            kind.title()
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
            "warning: {} says that these grades cannot be changed, and may pass them over: {}",
            kind.title(),
            harmless(&locked.join(", "))
        ));
    }
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

/// What was said for the student's eyes about the whole.
fn remarks(row: &Row, rules: &Rules) -> String {
    let public = row.remarks.iter().filter(|remark| !report::is_private(remark, rules));
    public.map(|remark| harmless(remark)).collect::<Vec<_>>().join("; ")
}

/// `results.json` of Gradescope's autograders: a test for each part.
fn gradescope(report: &Report, output: &Path) -> anyhow::Result<String> {
    let [row] = report.submissions.as_slice() else {
        bail!(
            "Gradescope takes one submission at a time, and there are {}; hint: umbra export FILE --format gradescope \
             --only STUDENT --report {}",
            report.submissions.len(),
            shell_path(output)
        );
    };
    let tests = row.parts.iter().map(|part| {
        let is_said = part.title.contains("(bonus)");
        let bonus = if part.bonus && !is_said { " (bonus)" } else { "" };
        let reason = harmless(&part.reason);
        let is_open = part.points < part.points_max;
        let mut test = json!({
            "number": part.id,
            "name": format!("{}{bonus}", part.title),
            "score": part.points,
            "max_score": part.out_of,
            "output": if is_open {
                format!("not run here, worth {} to {} points: {reason}", part.points, part.points_max)
            } else {
                reason
            },
            "output_format": "text",
            "visibility": "visible",
        });
        // What was not run has neither passed nor failed.
        if !is_open {
            let is_lost = part.points < part.out_of && !part.bonus;
            test["status"] = json!(if is_lost { "failed" } else { "passed" });
        }
        test
    });
    let stages = report.timings.get(&row.slug).into_iter().flatten();
    let wall_s = (stages.map(|stage| stage.wall_s).sum::<f64>() * 100.0).round() / 100.0;
    let results = json!({
        "score": row.points,
        "execution_time": wall_s,
        "output": remarks(row, &report.assignment.rules),
        "output_format": "text",
        "tests": tests.collect::<Vec<_>>(),
    });
    Ok(serde_json::to_string_pretty(&results)? + "\n")
}
