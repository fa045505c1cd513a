//! `grades.csv`: one row a submission, for a grade book.

use super::number::{is_range, of_part, points, range};
use super::{BatchReport, ReportError, SubmissionReport};
use crate::harmless::csv_cell;

/// The grades as CSV (UTF-8, comma, `\n`). The columns are student number, last and first name, name of the submission,
/// the parts, total, what it is out of, lowest and highest, unconfirmed, time, total before lateness, remarks.
///
/// `total` is empty if part of the submission could not be judged, so that nobody imports an undecided number; `lowest`
/// and `highest` are filled only then. `submitted` and `before_late` say when a submission came and what it earned
/// before the late penalty. `unconfirmed` is what images alone are worth once the instructor confirms them, and empty
/// if that is nothing. A part that is a range reads `0..20`.
///
/// # Errors
/// When there is no submission.
pub fn grades(report: &BatchReport) -> Result<String, ReportError> {
    if report.entries.is_empty() {
        return Err(ReportError::Empty);
    }
    let format = |reason: String| ReportError::Format { file: super::CSV_FILE, reason };
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let mut head = vec!["student_id", "last_name", "first_name", "submission"];
    head.extend(report.rules.parts.iter().map(|part| part.id.as_str()));
    head.extend(["total", "out_of", "lowest", "highest", "unconfirmed"]);
    head.extend(["submitted", "before_late", "remarks"]);
    let head = head.into_iter().map(csv_cell);
    writer.write_record(head).map_err(|error| format(error.to_string()))?;
    for entry in &report.entries {
        let row = row(report, entry).into_iter().map(|text| csv_cell(&text));
        writer.write_record(row).map_err(|error| format(error.to_string()))?;
    }
    let bytes = writer.into_inner().map_err(|error| format(error.to_string()))?;
    String::from_utf8(bytes).map_err(|error| format(error.to_string()))
}

fn row(report: &BatchReport, entry: &SubmissionReport) -> Vec<String> {
    let SubmissionReport { record, grade, standing } = entry;
    let student = entry.student();
    let mut row = vec![student.id, student.last_name, student.first_name, record.name.clone()];
    for part in &report.rules.parts {
        let own = grade.parts.iter().find(|own| own.id == part.id);
        row.push(own.map(of_part).unwrap_or_default());
    }
    let open = is_range(grade.points, grade.points_max);
    let only = |condition: bool, value: f64| if condition { points(value) } else { String::new() };
    row.push(only(!open, grade.points));
    row.push(points(grade.out_of));
    row.push(only(open, grade.points));
    row.push(only(open, grade.points_max));
    row.push(only(grade.unconfirmed > 0.0, grade.unconfirmed));
    let late = standing.late.as_ref();
    row.push(late.map(|late| late.submitted.clone()).unwrap_or_default());
    let charged = late.filter(|late| late.before != late.after);
    row.push(charged.map(|late| range(late.before[0], late.before[1])).unwrap_or_default());
    row.push(grade.remarks.join("; "));
    row
}

#[cfg(test)]
mod tests {
    use similar_asserts::assert_eq;

    use super::super::sample;
    use super::*;

    #[test]
    fn known_answer() {
        assert_eq!(
            grades(&sample::report()).unwrap(),
            "\
student_id,last_name,first_name,submission,1.1,1.2,1.3,1.4,2.4,2.5,total,out_of,lowest,highest,unconfirmed,submitted,before_late,remarks
260000001,Lampglow,Ada,a2_ada.zip,5,10,20,15,25,20,95,75,,,,,,
0260000002,Müller,Jörg,two_cosines.tar.gz,5,10,9.85,15,25,0..20,,75,64.85,84.85,,,,
260000003,山田,花子,山田_花子.zip,0,0,0,0,0,0,0,75,,,11.44,,,the source does not build; the images alone earn 11.44 points once the instructor confirms
"
        );
    }

    #[test]
    fn formulas_are_made_harmless_and_numbers_left() {
        for (text, expected) in [
            ("=1+1", "'=1+1"),
            ("+1-800", "'+1-800"),
            ("-cmd|' /C calc'!A0", "'-cmd|' /C calc'!A0"),
            ("@SUM(A1)", "'@SUM(A1)"),
            ("\t=1", "'\\t=1"),
            ("\r=1", "'\\r=1"),
            ("  =1", "'  =1"),
            ("\u{ff1d}1", "'\u{ff1d}1"),
            ("-12.5", "-12.5"),
            ("+3", "+3"),
            ("-inf", "'-inf"),
            ("-", "'-"),
            ("007", "007"),
            ("a=b", "a=b"),
        ] {
            assert_eq!(csv_cell(text), expected);
        }
    }

    #[test]
    fn hostile_words_stay_in_their_cell() {
        let mut report = sample::report();
        report.entries.truncate(1);
        let record = &mut report.entries[0].record;
        record.student.last_name = "=HYPERLINK(\"http://x\",\"y\")".into();
        record.name = "a,b\"c\r\n=2+2,\u{1b}[2J\u{202e}\0".into();
        let text = grades(&report).unwrap();
        assert_eq!(text.lines().count(), 2);
        assert!(!text.chars().any(|c| c != '\n' && (c.is_control() || c == '\u{202e}')));
        let mut reader = ::csv::Reader::from_reader(text.as_bytes());
        let row = reader.records().next().unwrap().unwrap();
        assert_eq!(&row[1], "'=HYPERLINK(\"http://x\",\"y\")");
        assert_eq!(&row[3], "a,b\"c\\r\\n=2+2,\\u{1b}[2J\\u{202e}\\u{0}");
    }

    #[test]
    fn an_empty_batch_is_an_error() {
        let report = BatchReport { entries: Vec::new(), ..sample::report() };
        assert!(matches!(grades(&report), Err(ReportError::Empty)));
    }
}
