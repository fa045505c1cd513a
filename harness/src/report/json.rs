//! `report.json`: the batch for programs.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io;

use schemars::JsonSchema;
use serde::ser::{Error as _, SerializeSeq as _};
use serde::{Serialize, Serializer};
use serde_json::ser::{CharEscape, Formatter, PrettyFormatter};

use super::number::significant;
use super::{BatchReport, ReportError, SubmissionReport, Whole, harmless};
use crate::class::{Class, Standing};
use crate::diagnosis::Diagnosis;
use crate::evidence::{Check, CheckInfo};
use crate::grading::{Conditions, StageCost, Student};
use crate::held_back::HeldBack;
use crate::intake::Finding;
use crate::rubric::{PartGrade, Rules};

/// The value of the key `schema`.
pub const SCHEMA: &str = "umbra.report";
/// The value of the key `version`: it rises when a key changes its meaning or goes away.
pub const VERSION: u32 = 1;

/// Numbers are published with so many significant digits, so that the last bits of a sum, which
/// depend on its order, do not show.
const DIGITS: usize = 6;

/// The report of a batch.
#[derive(Serialize, JsonSchema)]
pub(super) struct JsonReport<'a> {
    /// `umbra.report`.
    schema: &'static str,
    /// Rises when a key changes its meaning or goes away.
    version: u32,
    assignment: About<'a>,
    /// Every set of conditions that occurs; a submission names its own by index.
    conditions: Vec<&'a Conditions>,
    /// Seed and scenes; `null` when nothing was held back.
    held_back: Option<&'a HeldBack>,
    #[schemars(with = "Vec<Submission<'a>>")]
    submissions: Submissions<'a>,
    /// Who is missing, and what the instructor must decide; `null` where one submission was checked.
    class: Option<&'a Class>,
    /// By slug. Last, and the only thing that two runs over the same submissions do not share.
    timings: BTreeMap<&'a str, &'a [StageCost]>,
}

/// What was graded, and by which rules.
#[derive(Serialize, JsonSchema)]
struct About<'a> {
    name: &'a str,
    title: &'a str,
    course: &'a str,
    due: &'a str,
    rules: &'a Rules,
    /// What each check that occurs asks, and what its error and bound mean.
    checks: BTreeMap<&'static str, CheckInfo>,
}

/// The submissions, of which one at a time is whole.
struct Submissions<'a> {
    report: &'a BatchReport,
    conditions: Vec<&'a Conditions>,
    whole: &'a Whole<'a>,
}

impl Serialize for Submissions<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { report, conditions, whole } = self;
        let mut all = serializer.serialize_seq(Some(report.entries.len()))?;
        for entry in &report.entries {
            let entry = whole(entry).map_err(S::Error::custom)?;
            all.serialize_element(&submission(&entry, conditions))?;
        }
        all.end()
    }
}

/// A submission with its points and their evidence.
#[derive(Serialize, JsonSchema)]
struct Submission<'a> {
    name: &'a str,
    slug: &'a str,
    digest: &'a str,
    student: &'a Student,
    /// Whose it is by the class list, and when it came.
    standing: &'a Standing,
    conditions: usize,
    points: f64,
    points_max: f64,
    /// What the images alone are worth once the instructor confirms them.
    unconfirmed: f64,
    out_of: f64,
    remarks: &'a [String],
    parts: &'a [PartGrade],
    diagnoses: &'a [Diagnosis],
    findings: &'a [Finding],
    diagnostics: &'a str,
    checks: &'a [Check],
}

/// The batch as JSON, keys in a fixed order, ending with a newline. Everything outside the key
/// `timings` is the same, byte for byte, when the records and grades are. A number that is not
/// finite is `null`.
///
/// # Errors
/// When there is no submission.
pub fn report_json(report: &BatchReport) -> Result<String, ReportError> {
    if report.entries.is_empty() {
        return Err(ReportError::Empty);
    }
    let format = |reason: String| ReportError::Format { file: super::JSON_FILE, reason };
    let mut bytes = Vec::new();
    write(report, &|entry| Ok(Cow::Borrowed(entry)), &mut bytes)
        .map_err(|error| format(error.to_string()))?;
    String::from_utf8(bytes).map_err(|error| format(error.to_string()))
}

/// Writes it, for a report whose entries may be outlines.
///
/// # Errors
/// When an entry cannot be had, or `file` cannot be written.
pub(super) fn write(
    report: &BatchReport,
    whole: &Whole,
    mut file: impl io::Write,
) -> io::Result<()> {
    let mut conditions: Vec<&Conditions> = Vec::new();
    for SubmissionReport { record, .. } in &report.entries {
        if !conditions.contains(&&record.conditions) {
            conditions.push(&record.conditions);
        }
    }
    let timings = report
        .entries
        .iter()
        .map(|SubmissionReport { record, .. }| (record.slug.as_str(), record.stages.as_slice()))
        .collect();
    let checks = report.entries.iter().flat_map(|entry| &entry.record.evidence.checks);
    let checks = checks.map(|check| (check.id.name(), check.id.info())).collect();
    let report = JsonReport {
        schema: SCHEMA,
        version: VERSION,
        assignment: About {
            name: &report.assignment,
            title: &report.title,
            course: &report.course,
            due: &report.due,
            rules: &report.rules,
            checks,
        },
        conditions: conditions.clone(),
        held_back: report.held_back.as_ref(),
        submissions: Submissions { report, conditions, whole },
        class: report.class.as_ref(),
        timings,
    };
    let mut serializer =
        serde_json::Serializer::with_formatter(&mut file, Harmless(PrettyFormatter::new()));
    report.serialize(&mut serializer)?;
    file.write_all(b"\n")
}

fn submission<'a>(
    SubmissionReport { record, grade, standing }: &'a SubmissionReport,
    conditions: &[&Conditions],
) -> Submission<'a> {
    Submission {
        name: &record.name,
        slug: &record.slug,
        digest: &record.digest,
        student: &record.student,
        standing,
        conditions: conditions.iter().position(|&c| *c == record.conditions).unwrap_or_default(),
        points: grade.points,
        points_max: grade.points_max,
        unconfirmed: grade.unconfirmed,
        out_of: grade.out_of,
        remarks: &grade.remarks,
        parts: &grade.parts,
        diagnoses: &record.diagnoses,
        findings: &record.findings,
        diagnostics: &record.diagnostics,
        checks: &record.evidence.checks,
    }
}

/// Writes strings harmless, so that a program that prints them does no harm either, and numbers
/// with the published digits. Newlines stay: they are JSON's to escape.
struct Harmless<'a>(PrettyFormatter<'a>);

impl Formatter for Harmless<'_> {
    fn write_string_fragment<W: ?Sized + io::Write>(
        &mut self,
        writer: &mut W,
        fragment: &str,
    ) -> io::Result<()> {
        // A fragment holds no control character: what `harmless` adds are backslashes, which JSON
        // writes twice.
        writer.write_all(harmless(fragment).replace('\\', "\\\\").as_bytes())
    }

    fn write_char_escape<W: ?Sized + io::Write>(
        &mut self,
        writer: &mut W,
        escape: CharEscape,
    ) -> io::Result<()> {
        let control = match escape {
            CharEscape::AsciiControl(byte) => char::from(byte),
            CharEscape::Backspace => '\u{8}',
            CharEscape::FormFeed => '\u{c}',
            CharEscape::CarriageReturn => '\r',
            other => return self.0.write_char_escape(writer, other),
        };
        self.write_string_fragment(writer, &harmless(&control.to_string()))
    }

    fn write_f64<W: ?Sized + io::Write>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        self.0.write_f64(writer, significant(value, DIGITS))
    }

    fn begin_array<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.begin_array(writer)
    }

    fn end_array<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.end_array(writer)
    }

    fn begin_array_value<W: ?Sized + io::Write>(
        &mut self,
        writer: &mut W,
        first: bool,
    ) -> io::Result<()> {
        self.0.begin_array_value(writer, first)
    }

    fn end_array_value<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.end_array_value(writer)
    }

    fn begin_object<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.begin_object(writer)
    }

    fn end_object<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.end_object(writer)
    }

    fn begin_object_key<W: ?Sized + io::Write>(
        &mut self,
        writer: &mut W,
        first: bool,
    ) -> io::Result<()> {
        self.0.begin_object_key(writer, first)
    }

    fn begin_object_value<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.begin_object_value(writer)
    }

    fn end_object_value<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.end_object_value(writer)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;
    use similar_asserts::assert_eq;

    use super::super::sample;
    use super::*;

    fn parsed(report: &BatchReport) -> Value {
        serde_json::from_str(&report_json(report).unwrap()).unwrap()
    }

    #[test]
    fn known_answer() {
        insta::assert_snapshot!("report_json", report_json(&sample::report()).unwrap());
    }

    #[test]
    fn only_timings_differ_between_two_runs() {
        let first = sample::report();
        let mut second = first.clone();
        for entry in &mut second.entries {
            for stage in &mut entry.record.stages {
                stage.wall_s *= 1.5;
                stage.cpu_s += 0.25;
            }
        }
        let [first, second] = [first, second].map(|report| report_json(&report).unwrap());
        assert_ne!(first, second);
        let canonical = |text: &str| text.split("\n  \"timings\":").next().unwrap().to_owned();
        assert_eq!(canonical(&first), canonical(&second));
    }

    #[test]
    fn the_last_bits_do_not_show() {
        let mut report = sample::report();
        let before = report_json(&report).unwrap();
        for entry in &mut report.entries {
            for check in &mut entry.record.evidence.checks {
                check.error *= 1.0 + 1e-15;
            }
        }
        assert_eq!(report_json(&report).unwrap(), before);
    }

    #[test]
    fn hostile_words_are_harmless_in_the_file_and_when_parsed() {
        let mut report = sample::report();
        let record = &mut report.entries[0].record;
        record.name = "a\"b\\c\u{1b}[2J\0\u{8}\u{202e}</script>\r".into();
        record.diagnostics = "line one\nline two\u{9b}1m".into();
        record.evidence.checks[0].error = f64::NAN;
        let text = report_json(&report).unwrap();
        assert!(!text.chars().any(|c| c != '\n' && (c.is_control() || c == '\u{202e}')));
        let json = parsed(&report);
        let expected = "a\"b\\c\\u{1b}[2J\\u{0}\\u{8}\\u{202e}</script>\\r";
        assert_eq!(json["submissions"][0]["name"], expected);
        assert_eq!(json["submissions"][0]["diagnostics"], "line one\nline two\\u{9b}1m");
        assert_eq!(json["submissions"][0]["checks"][0]["error"], Value::Null);
    }

    #[test]
    fn an_empty_batch_is_an_error() {
        let report = BatchReport { entries: Vec::new(), ..sample::report() };
        assert!(matches!(report_json(&report), Err(ReportError::Empty)));
    }
}
