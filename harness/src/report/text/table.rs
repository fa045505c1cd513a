//! The table of many submissions.

use super::super::number::{due, is_range, of_part, points, total};
use super::super::{BatchReport, ReportError, SubmissionReport, harmless};
use super::page::{Page, Style, columns, left};
use crate::columns::{count, right};
use crate::grading::Record;
use crate::rubric::Grade;

/// Columns between two columns.
const GAP: &str = "  ";
/// The least that is left for a name before the parts give way.
const NAME_MIN: usize = 8;

/// A table with one row for each submission: name, student, points per part, total, and the numbers
/// of the remarks that stand below it. `width` in terminal columns; no line is wider. `colors`
/// allows ANSI colors.
///
/// # Errors
/// When there is no submission.
pub fn table(report: &BatchReport, width: usize, colors: bool) -> Result<String, ReportError> {
    if report.entries.is_empty() {
        return Err(ReportError::Empty);
    }
    let mut page = Page::new(width, colors);
    page.wrapped(&[], Style::Heading, &format!("{}, due {}", report.title, due(&report.due)));
    page.gap();
    let remarks = remarks(report);
    let layout = Layout::new(report, &remarks, page.width);
    layout.head(&mut page, report);
    for entry in &report.entries {
        layout.row(&mut page, report, entry, &remarks);
    }
    if layout.parts.is_none() {
        page.gap();
        let text = "the points of each part need a wider terminal; grades.csv has them";
        page.wrapped(&[], Style::Faint, text);
    }
    if !remarks.is_empty() {
        page.gap();
        page.line(&[(Style::Heading, "remarks")]);
        for (index, remark) in remarks.iter().enumerate() {
            let lead = format!("{:>3}  ", index + 1);
            page.wrapped(&[(Style::Plain, &lead)], Style::Plain, remark);
        }
    }
    page.gap();
    let open = |entry: &&SubmissionReport| is_range(entry.grade.points, entry.grade.points_max);
    let mut summary = count(report.entries.len(), "submission");
    match report.entries.iter().filter(open).count() {
        0 => {}
        open => summary.push_str(&format!(", {open} not wholly judged (a range of points)")),
    }
    page.wrapped(&[], Style::Plain, &summary);
    if let Some(class) = &report.class {
        super::class::class(&mut page, report, class);
    }
    Ok(page.finish())
}

/// One submission in a line: `a2_ada.zip (Ada Lampglow): 95/75`.
pub fn in_a_line(record: &Record, grade: &Grade) -> String {
    let student = record.student.full_name();
    let student = if student.is_empty() { String::new() } else { format!(" ({student})") };
    harmless(&format!("{}{student}: {}", record.name, total(grade)))
}

/// Every remark, once.
fn remarks(report: &BatchReport) -> Vec<&str> {
    let mut remarks: Vec<&str> = Vec::new();
    for remark in report.entries.iter().flat_map(|entry| &entry.grade.remarks) {
        if !remarks.contains(&remark.as_str()) {
            remarks.push(remark);
        }
    }
    remarks
}

/// The numbers of a submission's remarks: `1, 3`.
fn numbers(entry: &SubmissionReport, remarks: &[&str]) -> String {
    let number = |remark: &String| remarks.iter().position(|other| other == remark);
    let numbers = entry.grade.remarks.iter().filter_map(number);
    numbers.map(|index| (index + 1).to_string()).collect::<Vec<_>>().join(", ")
}

/// Widths in terminal columns.
struct Layout {
    name: usize,
    student: usize,
    /// Of each part; `None` when there is no room.
    parts: Option<Vec<usize>>,
    total: usize,
    remarks: usize,
}

impl Layout {
    fn new(report: &BatchReport, remarks: &[&str], width: usize) -> Self {
        let widest = |head: &str, text: &dyn Fn(&SubmissionReport) -> String| {
            let texts = report.entries.iter().map(|entry| columns(&text(entry)));
            texts.max().unwrap_or(0).max(columns(head))
        };
        let total = widest("total", &|entry| total(&entry.grade));
        let noted = widest("", &|entry| numbers(entry, remarks));
        let noted = if noted > 0 { noted.max("remarks".len()) } else { 0 };
        let parts: Vec<usize> = report
            .rules
            .parts
            .iter()
            .map(|part| {
                let own = |entry: &SubmissionReport| part_points(entry, &part.id);
                widest(&part.id, &own).max(most(part).len())
            })
            .collect();
        let name = widest("submission", &|entry| entry.record.name.clone());
        let student = widest("student", &|entry| entry.student().full_name());
        let fixed = GAP.len() * 2 + total + if noted > 0 { noted + GAP.len() } else { 0 };
        let with_parts = fixed + parts.iter().map(|part| part + GAP.len()).sum::<usize>();
        let fits = with_parts + 2 * NAME_MIN <= width;
        let room = width.saturating_sub(if fits { with_parts } else { fixed });
        // What there is not room for is taken from the wider of the two.
        let student = student.min((room / 2).max(room.saturating_sub(name)));
        let name = name.min(room.saturating_sub(student));
        Self { name, student, parts: fits.then_some(parts), total, remarks: noted }
    }

    fn head(&self, page: &mut Page, report: &BatchReport) {
        let mut head =
            format!("{}{GAP}{}", left("submission", self.name), left("student", self.student));
        let mut best = right("out of", columns(&head));
        if let Some(parts) = &self.parts {
            for (part, &width) in report.rules.parts.iter().zip(parts) {
                head.push_str(&format!("{GAP}{}", right(&part.id, width)));
                best.push_str(&format!("{GAP}{}", right(&most(part), width)));
            }
        }
        head.push_str(&format!("{GAP}{}", right("total", self.total)));
        if self.remarks > 0 {
            head.push_str(&format!("{GAP}remarks"));
        }
        page.line(&[(Style::Heading, &head)]);
        if self.parts.is_some() {
            page.line(&[(Style::Faint, &best)]);
        }
    }

    fn row(
        &self,
        page: &mut Page,
        report: &BatchReport,
        entry: &SubmissionReport,
        remarks: &[&str],
    ) {
        let SubmissionReport { record, grade, .. } = entry;
        let names = format!(
            "{}{GAP}{}",
            left(&record.name, self.name),
            left(&entry.student().full_name(), self.student)
        );
        let mut cells = vec![(Style::Plain, names)];
        if let Some(parts) = &self.parts {
            for (part, &width) in report.rules.parts.iter().zip(parts) {
                let own = grade.parts.iter().find(|own| own.id == part.id);
                let style = match own {
                    Some(own) if own.bonus && own.points_max == 0.0 => Style::Faint,
                    Some(own) => Style::of_points(own.points, own.points_max, own.out_of),
                    None => Style::Plain,
                };
                cells.push((Style::Plain, GAP.to_owned()));
                cells.push((style, right(&part_points(entry, &part.id), width)));
            }
        }
        cells.push((Style::Plain, GAP.to_owned()));
        let style = Style::of_points(grade.points, grade.points_max, grade.out_of);
        cells.push((style, right(&total(grade), self.total)));
        cells.push((Style::Plain, format!("{GAP}{}", numbers(entry, remarks))));
        let cells: Vec<(Style, &str)> =
            cells.iter().map(|(style, text)| (*style, text.as_str())).collect();
        page.line(&cells);
    }
}

/// What a part can earn: `20`, and `+20` on top of the total.
fn most(part: &crate::rubric::Part) -> String {
    format!("{}{}", if part.bonus { "+" } else { "" }, points(part.points))
}

fn part_points(entry: &SubmissionReport, id: &str) -> String {
    entry.grade.parts.iter().find(|own| own.id == id).map(of_part).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use similar_asserts::assert_eq;
    use unicode_width::UnicodeWidthStr;

    use super::super::super::sample;
    use super::*;

    #[test]
    fn known_answer() {
        insta::assert_snapshot!("table", table(&sample::report(), 110, false).unwrap());
    }

    #[test]
    fn a_narrow_terminal_shortens_names_and_then_leaves_the_parts_out() {
        for (width, row) in [
            (82, "two_cosine…  Jörg Müll…    5   10  9.85   15   25  0..20  64.85..84.85/75"),
            (50, "two_cosine…  Jörg Müller  64.85..84.85/75"),
        ] {
            let text = table(&sample::report(), width, false).unwrap();
            assert_eq!(text.lines().find(|line| line.starts_with("two_")), Some(row));
        }
    }

    #[test]
    fn no_line_is_wider_than_the_terminal() {
        let mut report = sample::report();
        report.entries[0].record.name = "a_very_long_name_".repeat(20);
        report.entries[1].record.student.first_name = "\u{1b}[2J花子".repeat(20);
        report.entries[1].grade.remarks.push("x".repeat(300));
        for width in 1..200 {
            let text = table(&report, width, false).unwrap();
            for line in text.lines() {
                assert!(line.width() <= width.max(2), "{width}: {line:?}");
            }
        }
    }

    #[test]
    fn hostile_words_do_nothing_to_a_terminal() {
        let mut report = sample::report();
        report.entries[0].record.name = "\u{1b}]0;owned\u{7}\u{202e}\0\r\nfake.zip".into();
        let text = table(&report, 140, false).unwrap();
        assert!(!text.chars().any(|c| c != '\n' && (c.is_control() || c == '\u{202e}')));
        assert!(text.contains("\\u{1b}]0;owned\\u{7}\\u{202e}\\u{0}\\r\\nfake.zip"), "{text}");
        assert_eq!(
            text.lines().count(),
            table(&sample::report(), 140, false).unwrap().lines().count()
        );
    }

    #[test]
    fn an_empty_batch_is_an_error() {
        let report = BatchReport { entries: Vec::new(), ..sample::report() };
        let error = table(&report, 80, false).unwrap_err();
        assert!(error.to_string().starts_with("no submission to report: expected at least one"));
    }
}
