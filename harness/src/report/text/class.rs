//! What is known of a class as a whole: where it comes from, who is missing, what the instructor must decide.

use super::super::BatchReport;
use super::page::{Page, Style};
use crate::class::{Class, INCOMPARABLE, recognized};

/// Number of names that are listed of a kind.
const NAMED: usize = 30;

/// The lines below the table.
pub(super) fn class(page: &mut Page, report: &BatchReport, class: &Class) {
    let labels = report.entries.iter().filter_map(|entry| entry.standing.label.as_ref());
    if let Some(text) = recognized(class.kind, labels) {
        page.wrapped(&[], Style::Plain, &text);
    }
    let aside = report.entries.iter().filter(|entry| !entry.standing.set_aside.is_empty());
    let aside = aside
        .map(|entry| format!("{}, not {}", entry.record.name, entry.standing.set_aside.join(", ")));
    let missing = class.missing.iter().map(|missing| match missing.reason.as_str() {
        "" => missing.student.who(),
        reason => format!("{}: {reason}", missing.student.who()),
    });
    let undecided = class.undecided.iter().map(|own| format!("{}: {}", own.submission, own.reason));
    let list = if class.list.is_empty() { String::new() } else { format!(", by {}", class.list) };
    for (title, style, lines) in [
        ("attempts that count".to_owned(), Style::Plain, aside.collect::<Vec<_>>()),
        (
            "counting attempts that earn less than another attempt".to_owned(),
            Style::Open,
            class.worse.clone(),
        ),
        ("not counted, as matches.toml says".to_owned(), Style::Plain, class.not_counted.clone()),
        (format!("without a submission{list}"), Style::Open, missing.collect()),
        (INCOMPARABLE.to_owned(), Style::Bad, class.incomparable.clone()),
        ("decisions whose evidence has changed".to_owned(), Style::Bad, class.stale.clone()),
        (
            "decisions on submissions that are not in this report or do not count".to_owned(),
            Style::Bad,
            class.unused.clone(),
        ),
        ("neither opened nor graded".to_owned(), Style::Bad, class.unopened.clone()),
        ("to be decided in matches.toml".to_owned(), Style::Bad, undecided.collect()),
    ] {
        if lines.is_empty() {
            continue;
        }
        page.gap();
        page.wrapped(&[], Style::Heading, &format!("{title}: {}", lines.len()));
        for line in lines.iter().take(NAMED) {
            page.wrapped(&[(Style::Plain, "  ")], style, line);
        }
        if let more @ 1.. = lines.len().saturating_sub(NAMED) {
            let text = format!("and {more} more; report.html has them");
            page.wrapped(&[(Style::Plain, "  ")], Style::Faint, &text);
        }
    }
}
