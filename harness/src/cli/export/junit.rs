//! JUnit XML: a test suite for each submission, a test case for each part.

use std::path::Path;
use std::time::SystemTime;

use super::super::earlier::{ReportRow, StoredReport};
use crate::grading::RecordCache;
use crate::report::{self, harmless};
use crate::rubric::PartGrade;

/// What a part counts as.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Passed,
    /// Points were lost.
    Failure,
    /// The machine could not judge it: the points are a range.
    Error,
    /// A bonus that earned nothing: nobody had to do it.
    Skipped,
}

impl Outcome {
    fn of(part: &PartGrade) -> Self {
        match part {
            part if part.points < part.points_max => Self::Error,
            part if part.points >= part.out_of => Self::Passed,
            part if part.bonus && part.points == 0.0 => Self::Skipped,
            part if part.bonus => Self::Passed,
            _ => Self::Failure,
        }
    }
}

/// The report as XML. When a submission was graded is told by its record in the folder `output`.
pub fn junit(report: &StoredReport, output: &Path) -> String {
    let all = report.submissions.iter().flat_map(|row| &row.parts);
    let wall_s: f64 = report.submissions.iter().map(|row| wall_s(report, row)).sum();
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    xml += &format!(
        "<testsuites name=\"{}\"{} time=\"{wall_s:.3}\">\n",
        quoted(&report.assignment.title),
        counts(all),
    );
    for row in &report.submissions {
        xml += &suite(report, row, output);
    }
    xml + "</testsuites>\n"
}

fn suite(report: &StoredReport, row: &ReportRow, output: &Path) -> String {
    let name = quoted(&row.slug);
    let record = output.join(report::INSTRUCTOR).join(&row.slug);
    let graded = RecordCache::when(&record).and_then(timestamp);
    let graded = graded.map_or(String::new(), |at| format!(" timestamp=\"{at}\""));
    let mut xml = format!(
        "  <testsuite name=\"{name}\"{} time=\"{:.3}\"{graded}>\n",
        counts(row.parts.iter()),
        wall_s(report, row)
    );
    for part in &row.parts {
        let points = format!("{} of {} points", part.points, part.out_of);
        let said = quoted(&format!("{points}: {}", part.reason));
        let title = quoted(&format!("{} {}", part.id, part.title));
        xml += &format!("    <testcase classname=\"{name}\" name=\"{title}\"");
        xml += &match Outcome::of(part) {
            Outcome::Passed => "/>\n".to_owned(),
            Outcome::Failure => format!("><failure message=\"{said}\"/></testcase>\n"),
            Outcome::Error => format!("><error message=\"{said}\"/></testcase>\n"),
            Outcome::Skipped => format!("><skipped message=\"{said}\"/></testcase>\n"),
        };
    }
    let remarks = super::remarks(row, &report.assignment.rules);
    if !remarks.is_empty() {
        xml += &format!("    <system-out>{}</system-out>\n", quoted(&remarks));
    }
    xml + "  </testsuite>\n"
}

/// The attributes that count test cases.
fn counts<'a>(parts: impl Iterator<Item = &'a PartGrade>) -> String {
    let outcomes: Vec<Outcome> = parts.map(Outcome::of).collect();
    let of = |wanted: Outcome| outcomes.iter().filter(|own| **own == wanted).count();
    format!(
        " tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"{}\"",
        outcomes.len(),
        of(Outcome::Failure),
        of(Outcome::Error),
        of(Outcome::Skipped)
    )
}

/// What grading a submission took [s].
fn wall_s(report: &StoredReport, row: &ReportRow) -> f64 {
    report.timings.get(&row.slug).into_iter().flatten().map(|stage| stage.wall_s).sum()
}

/// In UTC, without a zone, as Jenkins reads it.
fn timestamp(at: SystemTime) -> Option<String> {
    let at = jiff::Timestamp::try_from(at).ok()?;
    Some(at.strftime("%Y-%m-%dT%H:%M:%S").to_string())
}

/// Text that XML 1.0 may hold.
fn quoted(text: &str) -> String {
    let text = harmless(text);
    [('&', "&amp;"), ('<', "&lt;"), ('>', "&gt;"), ('"', "&quot;")]
        .iter()
        .fold(text, |text, (sign, name)| text.replace(*sign, name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{report_json, sample};

    #[test]
    fn known_answer() {
        let report = report_json(&sample::report()).unwrap();
        let report: StoredReport = serde_json::from_str(&report).unwrap();
        let xml = junit(&report, Path::new("nowhere"));
        let first: Vec<&str> = xml.lines().take(3).collect();
        assert_eq!(
            first[1],
            "<testsuites name=\"Assignment 2: Point Lights &amp; Shadows\" tests=\"18\" failures=\"6\" errors=\"1\" \
             skipped=\"1\" time=\"11.415\">"
        );
        assert!(
            xml.contains("<testsuite name=\"two_cosines\" tests=\"6\" failures=\"1\" errors=\"1\""),
            "{xml}"
        );
        assert!(xml.contains("><error message=\"0 of 20 points: "), "{xml}");
        assert!(xml.contains("><failure message=\"9.85 of 20 points: "), "{xml}");
        assert!(xml.contains("><skipped message=\"0 of 20 points: "), "{xml}");
    }
}
