//! The last lines of a check: the verdict, and the next step.

use std::collections::BTreeMap;

use super::super::number::{earned, points, range};
use super::super::{BatchReport, SubmissionReport};
use super::page::{Look, Page, Style};
use crate::evidence::{Check, Verdict};
use crate::intake::Severity;
use crate::rubric::{BUILD, PartGrade};

/// What the last lines are made from, besides the submission itself.
pub struct Closing<'a> {
    /// The working folder as the student calls it, as a shell takes it.
    pub folder: &'a str,
    /// Umbra as the student calls it, likewise.
    pub umbra: &'a str,
    /// Whether it is an archive and no folder.
    pub is_archive: bool,
    /// Where the page with the pictures is.
    pub page: &'a str,
    /// In which files the work for a part is done: `src/bsdfs/phong.rs`.
    pub files: &'a BTreeMap<String, String>,
    /// The points of each part when it was checked last, least and most.
    pub last: &'a BTreeMap<String, (f64, f64)>,
    /// What alone was asked: `part 2.3 on scene cbox`; empty when everything was.
    pub asked: &'a str,
}

/// The last lines: where the page is, what changed since the last time, how many points there are, and
/// what is next to do.
pub fn closing(
    report: &BatchReport,
    entry: &SubmissionReport,
    closing: &Closing,
    look: Look,
) -> String {
    let grade = &entry.grade;
    let mut page = Page::new(look.width, look.colors);
    page.gap();
    page.wrapped(&[(Style::Faint, "report: ")], Style::Plain, closing.page);
    let changes = changes(&grade.parts, closing.last);
    if !changes.is_empty() {
        page.wrapped(&[(Style::Heading, "since last time: ")], Style::Plain, &changes.join(", "));
    }
    let mut verdict = earned(&grade.parts);
    verdict.push_str(" on the public scenes");
    if !closing.asked.is_empty() {
        verdict.push_str(&format!("; {}", checked_only(closing.asked)));
    }
    let mut plain = grade.parts.iter().filter(|part| !part.bonus);
    let whole = plain.all(is_whole) && !grade.parts.is_empty();
    let style = if whole { Style::Good } else { Style::Bad };
    page.wrapped(&[(style, "verdict: ")], Style::Plain, &verdict);
    page.wrapped(&[(Style::Heading, "next: ")], Style::Plain, &next(report, entry, closing));
    page.finish()
}

/// What of an assignment was checked, from its words: `parts 1.1, 2.3 on scene cbox`.
pub fn checked_only(asked: &str) -> String {
    let several = asked.starts_with("parts ") || asked.starts_with("scenes ");
    format!("only {asked} {} checked", if several { "were" } else { "was" })
}

/// `2.2 0 -> 5` for each part that is worth something else now.
fn changes(parts: &[PartGrade], last: &BTreeMap<String, (f64, f64)>) -> Vec<String> {
    let change = |part: &PartGrade| {
        let &(least, most) = last.get(&part.id)?;
        let (old, new) = (range(least, most), range(part.points, part.points_max));
        (old != new).then(|| format!("{} {old} -> {new}", part.id))
    };
    parts.iter().filter_map(change).collect()
}

fn is_whole(part: &PartGrade) -> bool {
    points(part.points) == points(part.out_of)
}

/// The next step: the worst obstacle first, then the parts in the handout's order, then submitting.
fn next(report: &BatchReport, entry: &SubmissionReport, closing: &Closing) -> String {
    let Closing { folder, umbra, .. } = closing;
    let checks = &entry.record.evidence.checks;
    let failed = |check: &&Check| check.verdict == Verdict::Fail;
    if let Some(check) = checks.iter().filter(failed).find(|check| check.id == BUILD) {
        // Of a submission that was refused, the compiler saw nothing.
        return match entry.record.diagnostics.is_empty() {
            true => check.said().into_owned(),
            false => format!("{}; the compiler's words are above", check.summary),
        };
    }
    let open = |bonus: bool| {
        let mut parts = entry.grade.parts.iter();
        parts.find(|part| part.bonus == bonus && !is_whole(part))
    };
    if let Some(part) = open(false) {
        return work_on(part, closing);
    }
    if !closing.asked.is_empty() {
        return match open(true) {
            Some(part) => work_on(part, closing),
            None => format!("this part is right; `{umbra} check {folder}` checks everything"),
        };
    }
    // Images that are not what the code draws.
    let stale =
        checks.iter().filter(failed).find(|check| check.id.name().starts_with("submitted."));
    let error = entry.record.findings.iter().find(|found| found.severity == Severity::Error);
    let ready = match (error, stale) {
        (Some(finding), _) => {
            let text = finding.to_string();
            format!("make it ready to submit: {}", text.trim_start_matches("error: "))
        }
        (None, Some(check)) => format!("make it ready to submit: {}", check.summary),
        (None, None) if closing.is_archive => format!("submit {folder}"),
        (None, None) => format!("`{umbra} pack {folder}` makes the archive to submit"),
    };
    match open(true).filter(|_| report.rules.parts.iter().any(|part| part.bonus)) {
        Some(part) => format!("{ready}; or the bonus, {} {}", part.id, part.title),
        None => ready,
    }
}

/// `1.2 Phong reflectance model, in src/bsdfs/phong.rs: wrong at ...`
fn work_on(part: &PartGrade, closing: &Closing) -> String {
    let place = closing.files.get(&part.id).map(|file| format!(", in {file}"));
    format!("{} {}{}: {}", part.id, part.title, place.unwrap_or_default(), part.reason)
}

#[cfg(test)]
mod tests {
    use similar_asserts::assert_eq;

    use super::super::super::sample;
    use super::*;

    fn closed(
        report: &BatchReport,
        index: usize,
        asked: &str,
        last: &[(&str, f64)],
    ) -> Vec<String> {
        closed_of(report, index, asked, last, false)
    }

    fn closed_of(
        report: &BatchReport,
        index: usize,
        asked: &str,
        last: &[(&str, f64)],
        is_archive: bool,
    ) -> Vec<String> {
        let files = BTreeMap::from([("1.3".to_owned(), "src/integrators/simple.rs".to_owned())]);
        let last = last.iter().map(|&(id, points)| (id.to_owned(), (points, points))).collect();
        let made_of = Closing {
            folder: "student_template",
            umbra: "./umbra",
            is_archive,
            page: "umbra-report/a/report.html",
            files: &files,
            last: &last,
            asked,
        };
        let look = Look { width: 400, colors: false };
        let text = closing(report, &report.entries[index], &made_of, look);
        text.lines().map(str::to_owned).collect()
    }

    #[test]
    fn the_last_lines_are_the_verdict_and_the_next_thing_to_do() {
        let mut report = sample::report();
        let lines = closed(&report, 1, "", &[("1.1", 5.0), ("1.3", 0.0), ("1.4", 2.5), ("9", 1.0)]);
        assert_eq!(lines[1], "report: umbra-report/a/report.html");
        assert_eq!(lines[2], "since last time: 1.3 0 -> 9.85, 1.4 2.5 -> 15");
        assert_eq!(
            lines[3],
            "verdict: 64.85 of 75 points, 0..20 of 20 bonus points on the public scenes"
        );
        assert!(
            lines[4].starts_with(
                "next: 1.3 Unshadowed direct illumination, in src/integrators/simple.rs: unshadowed"
            ),
            "{lines:?}"
        );
        assert!(!lines[4].contains("witness"), "{lines:?}");
        // What does not build comes first, whatever the parts are worth.
        let lines = closed(&report, 2, "", &[]);
        assert!(lines[3].starts_with("next: the source does not build; "), "{lines:?}");
        // All is right: a file is missing, then nothing is.
        let ready = closed(&report, 0, "", &[]);
        let pack = "next: `./umbra pack student_template` makes the archive to submit";
        assert_eq!(ready[3], pack);
        // What is packed already is not packed again.
        assert_eq!(closed_of(&report, 0, "", &[], true)[3], "next: submit student_template");
        let mistake = report.entries[2].record.findings[0].clone();
        report.entries[0].record.findings.push(mistake);
        let lines = closed(&report, 0, "", &[]);
        assert!(
            lines[3].starts_with("next: make it ready to submit: config.json:3: "),
            "{lines:?}"
        );
    }

    #[test]
    fn what_was_not_asked_is_said() {
        let mut report = sample::report();
        report.entries[1].grade.parts.retain(|part| part.id == "2.4");
        let lines = closed(&report, 1, "part 2.4 on scene cbox", &[]);
        assert_eq!(
            lines[2],
            "verdict: 25 of 25 points on the public scenes; only part 2.4 on scene cbox was \
             checked"
        );
        assert_eq!(
            lines[3],
            "next: this part is right; `./umbra check student_template` checks everything"
        );
    }
}
