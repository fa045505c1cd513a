//! `umbra defend`: the evidence for the points of one part, with its bounds.

use super::super::number::{measure as in_words, of_part, range};
use super::super::{BatchReport, SubmissionReport};
use super::page::{Look, Page, Style};
use crate::columns::of_points;
use crate::evidence::{Check, Verdict};

/// Explains the points of a part of a submission, for the instructor.
///
/// # Errors
/// When there is no such part; the message names those that there are.
pub fn defend(
    report: &BatchReport,
    entry: &SubmissionReport,
    part: &str,
    look: Look,
) -> Result<String, String> {
    let graded = entry.grade.parts.iter().find(|own| own.id == part).ok_or_else(|| {
        let parts: Vec<&str> = entry.grade.parts.iter().map(|own| own.id.as_str()).collect();
        format!("there is no part {part}; expected one of {}", parts.join(", "))
    })?;
    let mut page = Page::new(look.width, look.colors);
    let out_of = of_points(&graded.out_of.to_string());
    let title = format!("{part} {}: {} of {out_of}", graded.title, of_part(graded));
    page.line(&[(Style::Heading, &title)]);
    let student = entry.student();
    let name = student.full_name();
    let who = if name.is_empty() { entry.record.name.clone() } else { name };
    let total = range(entry.grade.points, entry.grade.points_max);
    let total = of_points(&total);
    page.wrapped(&[], Style::Plain, &format!("{who} ({}), {total} in all", student.id));
    page.wrapped(&[], Style::Plain, &graded.reason);
    for applied in &entry.standing.decisions {
        if applied.decision.part.as_deref().is_none_or(|own| own == part) {
            page.wrapped(&[], Style::Plain, &applied.words());
        }
    }
    let standing = &entry.standing;
    let late = standing.late.as_ref().map(|late| late.words.as_str());
    let mended = standing.mended.as_ref();
    for words in late.into_iter().chain(mended.map(|mended| mended.words.as_str())) {
        if !words.is_empty() {
            page.wrapped(&[], Style::Plain, words);
        }
    }
    if mended.is_some_and(|mended| mended.counts) {
        let words = "All below is of the mended source.";
        page.wrapped(&[], Style::Plain, words);
    }
    let rule = report.rules.parts.iter().find(|own| own.id == part);
    let decides = |check: &&Check| graded.evidence.contains(&check.name());
    let asked = |check: &&Check| {
        rule.is_some_and(|rule| {
            rule.evidence.iter().chain(&rule.fallback).any(|id| *id == check.id)
        })
    };
    let checks = &entry.record.evidence.checks;
    let heading = |page: &mut Page, words: &str, is_empty: bool| {
        page.gap();
        if is_empty {
            page.wrapped(&[], Style::Plain, &format!("{words}: nothing"));
        } else {
            page.line(&[(Style::Heading, words)]);
        }
    };
    heading(&mut page, "What decided", !checks.iter().any(|own| decides(&own)));
    for own in checks.iter().filter(decides) {
        check(&mut page, report, own);
    }
    heading(&mut page, "All that was asked about it", !checks.iter().any(|own| asked(&own)));
    for own in checks.iter().filter(asked) {
        let held_back = if own.held_back { ", held back" } else { "" };
        let line = format!("{} ({}{held_back}): {}", own.name(), own.verdict.name(), own.summary);
        page.wrapped(&[(Style::Plain, "  ")], style(own), &line);
    }
    Ok(page.finish())
}

/// One check in full: what was found, each value with its bound, and what that costs.
fn check(page: &mut Page, report: &BatchReport, check: &Check) {
    let info = check.id.info();
    page.wrapped(&[(Style::Plain, "  ")], style(check), &check.name());
    let plain = |text: &str| text.replace(['`', '*'], "");
    page.wrapped(&[(Style::Plain, "    ")], Style::Plain, &plain(info.question));
    page.wrapped(&[(Style::Plain, "    ")], Style::Plain, &check.summary);
    for measure in &check.measures {
        let rule = measure.rule.map_or(String::new(), |rule| format!(" [{rule}]"));
        let passed = if measure.passed { "passed" } else { "failed" };
        let line = format!("{}: {}{rule}: {passed}", measure.name, in_words(measure));
        let style = if measure.passed { Style::Plain } else { Style::Bad };
        page.wrapped(&[(Style::Plain, "    ")], style, &line);
    }
    for (title, text) in
        [("error", info.error), ("bound", info.bound), ("hint", check.hint.as_str())]
    {
        if !text.is_empty() {
            page.wrapped(&[(Style::Open, &format!("    {title}  "))], Style::Plain, &plain(text));
        }
    }
    if !check.mistake.is_empty() {
        let words = format!("the single mistake \"{}\" explains it best", check.mistake);
        page.wrapped(&[(Style::Plain, "    ")], Style::Plain, &words);
    }
    if check.verdict == Verdict::Fail {
        let kept = report.rules.curve.fraction(check.error);
        let cost = 100.0 * check.weight * (1.0 - kept);
        let words = format!(
            "an error of {:.4} keeps {:.1} % by the curve, and this scene weighs {:.2}: it costs {cost:.2} % of the part",
            check.error,
            100.0 * kept,
            check.weight
        );
        page.wrapped(&[(Style::Plain, "    ")], Style::Plain, &words);
    }
}

fn style(check: &Check) -> Style {
    match check.verdict {
        Verdict::Pass => Style::Good,
        Verdict::NotRun => Style::Open,
        Verdict::NotJudged => Style::Faint,
        Verdict::Fail | Verdict::NotImplemented => Style::Bad,
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::sample;
    use super::*;

    #[test]
    fn the_evidence_stands_with_its_bounds_and_costs() {
        let report = sample::report();
        let look = Look { width: 100, colors: false };
        let text = defend(&report, &report.entries[1], "1.3", look).unwrap();
        assert!(
            text.starts_with("1.3 Unshadowed direct illumination: 9.85 of 20 points\n"),
            "{text}"
        );
        assert!(text.contains(", at most 0.002: failed"), "{text}");
        assert!(text.contains("it costs 50.25 %"), "{text}");
        let error = defend(&report, &report.entries[1], "9.9", look).unwrap_err();
        assert!(error.starts_with("there is no part 9.9; expected one of 1.1, 1.2"), "{error}");
    }
}
