//! Every detail of one submission.

use super::super::number::{
    self, hints, is_failure, is_range, looks_like, of_part, points, seconds, total,
};
use super::super::{BatchReport, SubmissionReport};
use super::page::{Look, Page, Style, columns, left};
use crate::columns::count;
use crate::evidence::{Check, CheckId, Measure, Verdict};
use crate::harmless::harmless_lines;
use crate::intake::{Finding, Severity};
use crate::rubric::{BUILD, PartGrade};

/// Number of the compiler's lines that are shown.
const DIAGNOSTIC_LINES: usize = 60;
/// Wide enough for a verdict and two spaces.
const VERDICT_WIDTH: usize = 17;

/// One submission: parts with points, and a reason and a hint for parts that lost some; other remarks; findings;
/// compiler messages. With `verbose`, also every check with value, bound and verdict, and the conditions of grading.
pub fn detail(report: &BatchReport, entry: &SubmissionReport, look: Look, verbose: bool) -> String {
    let SubmissionReport { record, grade, .. } = entry;
    let mut page = Page::new(look.width, look.colors);
    page.wrapped(&[], Style::Heading, &report.title);
    page.wrapped(&[(Style::Plain, "checked  ")], Style::Plain, &record.name);
    let student = entry.student();
    let student = [student.full_name(), student.id];
    let student: Vec<String> = student.into_iter().filter(|text| !text.is_empty()).collect();
    let student = if student.is_empty() { "not said".to_owned() } else { student.join(", ") };
    page.wrapped(&[(Style::Plain, "student  ")], Style::Plain, &student);
    let style = Style::of_points(grade.points, grade.points_max, grade.out_of);
    page.wrapped(&[(Style::Plain, "total    ")], style, &total(grade));
    if is_range(grade.points, grade.points_max) {
        let text = "a range: not everything could be judged; the reasons are below";
        page.wrapped(&[(Style::Plain, "         ")], Style::Faint, text);
    }
    for remark in &grade.remarks {
        page.wrapped(&[(Style::Bad, "remark   ")], Style::Plain, remark);
    }
    parts(&mut page, entry, verbose);
    if verbose {
        checks(&mut page, &record.evidence.checks);
    } else {
        noticed(&mut page, report, entry);
    }
    let whole = |part: &PartGrade| part.bonus || points(part.points) == points(part.out_of);
    let busy = grade.parts.len() < report.rules.parts.len() || !grade.parts.iter().all(whole);
    findings(&mut page, &record.findings, verbose, busy);
    diagnostics(&mut page, &record.diagnostics);
    if verbose {
        costs(&mut page, entry);
    }
    page.finish()
}

fn heading(page: &mut Page, text: &str) {
    page.gap();
    page.line(&[(Style::Heading, text)]);
}

fn parts(
    page: &mut Page,
    SubmissionReport { record, grade, .. }: &SubmissionReport,
    verbose: bool,
) {
    heading(page, "parts");
    let worth = |part| format!("{}/{}", of_part(part), points(part.out_of));
    let ids = grade.parts.iter().map(|part| columns(&part.id)).max().unwrap_or(0);
    let worths = grade.parts.iter().map(|part| columns(&worth(part))).max().unwrap_or(0);
    for part in &grade.parts {
        let id = format!("  {}  ", left(&part.id, ids));
        let worth = format!("{}  ", left(&worth(part), worths));
        let style = Style::of_points(part.points, part.points_max, part.out_of);
        page.wrapped(&[(Style::Plain, &id), (style, &worth)], Style::Plain, &part.title);
        let indent = " ".repeat(columns(&id) + columns(&worth));
        let lost = style != Style::Good;
        if lost || verbose {
            page.wrapped(&[(Style::Plain, &indent)], Style::Faint, &part.reason);
        }
        if !lost {
            continue;
        }
        for words in looks_like(&part.id, &record.diagnoses) {
            let lead = [(Style::Plain, indent.as_str()), (Style::Heading, "looks like: ")];
            page.wrapped(&lead, Style::Plain, &words);
        }
        for hint in hints(part, &record.evidence.checks) {
            page.wrapped(
                &[(Style::Plain, &indent), (Style::Heading, "hint: ")],
                Style::Plain,
                hint,
            );
        }
        let decided = |check: &&Check| part.evidence.contains(&check.name()) && is_failure(check);
        let pictures = record.evidence.checks.iter().filter(decided).map(|check| &check.pictures);
        if let Some(pictures) = pictures.into_iter().find(|pictures| !pictures.is_empty()) {
            let files: Vec<&str> = pictures.iter().map(|picture| picture.file.as_str()).collect();
            let lead = [(Style::Plain, indent.as_str()), (Style::Heading, "pictures: ")];
            page.wrapped(&lead, Style::Faint, &files.join(", "));
        }
        if verbose && !part.evidence.is_empty() {
            let evidence = format!("decided by {}", part.evidence.join(", "));
            page.wrapped(&[(Style::Plain, &indent)], Style::Faint, &evidence);
        }
    }
    for words in looks_like("", &record.diagnoses) {
        page.wrapped(&[(Style::Heading, "  also looks like: ")], Style::Plain, &words);
    }
}

/// Failed checks that belong to no part: they cost nothing, but somebody should look.
fn noticed(
    page: &mut Page,
    report: &BatchReport,
    SubmissionReport { record, .. }: &SubmissionReport,
) {
    let rules = &report.rules;
    let of_part = |check: &Check| {
        let named = rules.parts.iter().flat_map(|part| part.evidence.iter().chain(&part.fallback));
        let proofs = rules.paths.values().map(|path| &path.proof);
        named.chain(proofs).any(|id| *id == check.id) || check.id == BUILD
    };
    // What images alone are worth is no matter where there is code.
    let image_alone = |check: &Check| {
        let mut parts = rules.parts.iter().flat_map(|part| &part.images_only);
        check.summary.is_empty() || (parts.any(|id| *id == check.id) && check.hint.is_empty())
    };
    let wanted =
        |check: &&Check| check.verdict == Verdict::Fail && !of_part(check) && !image_alone(check);
    let mut told: Vec<CheckId> = Vec::new();
    for check in record.evidence.checks.iter().filter(wanted) {
        // Once for each kind: the first scene stands for the others.
        if told.contains(&check.id) {
            continue;
        }
        if told.is_empty() {
            heading(page, "to be noticed, without cost");
        }
        told.push(check.id);
        page.wrapped(&[(Style::Open, "  ")], Style::Plain, &check.summary);
        if !check.hint.is_empty() {
            page.wrapped(&[(Style::Heading, "    hint: ")], Style::Plain, &check.hint);
        }
    }
}

/// What failed, then what could not be judged, then what passed; one entry for each question and
/// answer, whatever the number of scenes: the worst in full, the others by name. The page
/// `report.html` shows every one.
fn checks(page: &mut Page, checks: &[Check]) {
    heading(page, "checks");
    if checks.is_empty() {
        page.wrapped(&[(Style::Plain, "  ")], Style::Plain, "none were made");
    }
    let order = |check: &Check| match check.verdict {
        Verdict::Fail | Verdict::NotImplemented => 0,
        Verdict::NotJudged | Verdict::NotRun => 1,
        Verdict::Pass => 2,
    };
    let mut groups: Vec<Vec<&Check>> = Vec::new();
    for check in checks {
        let alike = |other: &Check| {
            (&other.id, other.verdict, other.held_back)
                == (&check.id, check.verdict, check.held_back)
        };
        match groups.iter_mut().find(|group| alike(group[0])) {
            Some(group) => group.push(check),
            None => groups.push(vec![check]),
        }
    }
    groups.sort_by_key(|group| order(group[0]));
    for group in &mut groups {
        // Stable: among equals the scenes keep the assignment's order.
        group.sort_by(|a, b| closeness(b).total_cmp(&closeness(a)));
        group_of_checks(page, group);
    }
}

/// How far a check is from passing or, when it passed, how near it came to failing.
fn closeness(check: &Check) -> f64 {
    let tightest = check.measures.iter().map(tightness).fold(0.0, f64::max);
    if is_failure(check) { check.error } else { tightest }
}

/// A measure's value as a fraction of its bound.
fn tightness(measure: &Measure) -> f64 {
    if measure.bound > 0.0 { (measure.value / measure.bound).abs() } else { 0.0 }
}

fn group_of_checks(page: &mut Page, group: &[&Check]) {
    let worst = group[0];
    let style = match worst.verdict {
        Verdict::Pass => Style::Good,
        Verdict::NotJudged | Verdict::NotRun => Style::Open,
        Verdict::Fail | Verdict::NotImplemented => Style::Bad,
    };
    let verdict = format!("  {}", left(worst.verdict.name(), VERDICT_WIDTH));
    let indent = " ".repeat(columns(&verdict));
    let held_back = if worst.held_back { " (held back)" } else { "" };
    let text = format!("{}{held_back}: {}", worst.name(), worst.summary);
    page.wrapped(&[(style, &verdict)], Style::Plain, &text);
    let passed = worst.verdict == Verdict::Pass;
    let tightest = worst.measures.iter().max_by(|a, b| tightness(a).total_cmp(&tightness(b)));
    let shown = worst.measures.iter().filter(|measure| !passed || Some(*measure) == tightest);
    for measure in shown {
        let (style, word) = match (measure.passed, passed) {
            _ if measure.only_informs() && !passed => {
                let text = format!("{}: {}", measure.name, number::value(measure.value));
                page.wrapped(&[(Style::Plain, &indent)], Style::Faint, &text);
                continue;
            }
            (true, true) => (Style::Faint, "closest: "),
            (true, false) => (Style::Faint, "pass: "),
            (false, _) => (Style::Bad, "fail: "),
        };
        let text = format!("{}: {}", measure.name, number::measure(measure));
        page.wrapped(&[(Style::Plain, &indent), (style, word)], Style::Faint, &text);
    }
    if !worst.hint.is_empty() {
        let lead = [(Style::Plain, indent.as_str()), (Style::Heading, "hint: ")];
        page.wrapped(&lead, Style::Plain, &worst.hint);
    }
    if is_failure(worst) && !worst.pictures.is_empty() {
        let files: Vec<&str> = worst.pictures.iter().map(|p| p.file.as_str()).collect();
        let text = format!("pictures: {}", files.join(", "));
        page.wrapped(&[(Style::Plain, &indent)], Style::Faint, &text);
    }
    let others: Vec<&str> = group[1..].iter().map(|check| check.scene.as_str()).collect();
    if !others.is_empty() {
        let text = format!("likewise on {}", others.join(", "));
        page.wrapped(&[(Style::Plain, &indent)], Style::Faint, &text);
    }
}

/// What intake found. Without `verbose` no notes, and while there is work to do (`busy`) only how much is
/// to be mended before submitting.
fn findings(page: &mut Page, findings: &[Finding], verbose: bool, busy: bool) {
    // Of a file that does not build, the part that it costs says all; `umbra validate` compiles nothing.
    let is_for_validate =
        |finding: &&Finding| finding.severity == Severity::Error && finding.code != "replaced";
    let errors = findings.iter().filter(is_for_validate).count();
    if busy && !verbose {
        if errors > 0 {
            page.gap();
            let text = format!("before you submit, {} to be mended", count(errors, "thing"));
            page.wrapped(
                &[],
                Style::Faint,
                &format!("{text}: the report lists them under Findings"),
            );
        }
        return;
    }
    let wanted = |finding: &&Finding| verbose || finding.severity != Severity::Note;
    if !findings.iter().any(|finding| wanted(&finding)) {
        return;
    }
    heading(page, if verbose { "findings" } else { "before you submit" });
    for finding in findings.iter().filter(wanted) {
        let style = match finding.severity {
            Severity::Error => Style::Bad,
            Severity::Warning => Style::Open,
            Severity::Note => Style::Faint,
        };
        let text = finding.to_string();
        let severity = finding.severity.to_string();
        let rest = text.strip_prefix(&format!("{severity}: ")).unwrap_or(&text);
        let lead = format!("  {}", left(&severity, 9));
        page.wrapped(&[(style, &lead)], Style::Plain, rest);
    }
}

fn diagnostics(page: &mut Page, diagnostics: &str) {
    let lines = harmless_lines(diagnostics, DIAGNOSTIC_LINES);
    if lines.is_empty() {
        return;
    }
    heading(page, "compiler");
    // Never wrapped: a caret stands below what it points at.
    for line in lines {
        page.verbatim(&line);
    }
}

fn costs(page: &mut Page, SubmissionReport { record, .. }: &SubmissionReport) {
    heading(page, "conditions");
    let conditions = &record.conditions;
    for (name, text) in [
        ("umbra", &conditions.umbra),
        ("isolation", &conditions.isolation),
        ("adapter", &conditions.adapter),
        ("compiler", &conditions.compiler),
    ] {
        if !text.is_empty() {
            page.wrapped(&[(Style::Faint, &format!("  {}", left(name, 11)))], Style::Plain, text);
        }
    }
    if record.stages.is_empty() {
        return;
    }
    let stages = record.stages.iter();
    let each: Vec<String> =
        stages.map(|stage| format!("{} {}", stage.name, seconds(stage.wall_s))).collect();
    let sum: f64 = record.stages.iter().map(|stage| stage.wall_s).sum();
    let text = format!("{}: {}", seconds(sum), each.join(", "));
    page.wrapped(&[(Style::Faint, "  took       ")], Style::Plain, &text);
}

#[cfg(test)]
mod tests {
    use similar_asserts::assert_eq;
    use unicode_width::UnicodeWidthStr;

    use super::super::super::sample;
    use super::*;

    #[test]
    fn known_answer() {
        let report = sample::report();
        let look = Look { width: 100, colors: false };
        insta::assert_snapshot!("detail", detail(&report, &report.entries[1], look, true));
        insta::assert_snapshot!("detail_plain", detail(&report, &report.entries[1], look, false));
    }

    #[test]
    fn what_does_not_build_shows_the_compiler() {
        let report = sample::report();
        let text = detail(&report, &report.entries[2], Look { width: 80, colors: false }, true);
        for line in [
            "total    0/75",
            "remark   the source does not build; the images alone earn 11.44 points once the",
            "compiler",
            "  error[E0308]: mismatched types",
            "  error    config.json:3: studentID is empty (hint: write your student number)",
        ] {
            assert!(text.lines().any(|found| found == line), "{line:?} is not in\n{text}");
        }
    }

    #[test]
    fn what_a_compiler_says_is_never_wrapped() {
        let mut report = sample::report();
        let line = format!("69 │ {}", "let shadow = visibility(world_position, n);".repeat(3));
        let caret = format!("   │ {}^ expected `;`", " ".repeat(100));
        report.entries[2].record.diagnostics = format!("{line}\n{caret}");
        for width in [20, 80] {
            let text = detail(&report, &report.entries[2], Look { width, colors: false }, true);
            assert!(text.contains(&format!("\n  {line}\n  {caret}\n")), "{text}");
        }
    }

    #[test]
    fn hostile_words_keep_their_place() {
        let mut report = sample::report();
        let evil = "\u{1b}[2J\u{202e}\0\r\nchecks\r\n";
        let entry = &mut report.entries[1];
        entry.record.name = evil.into();
        entry.record.student.first_name = evil.repeat(30);
        entry.record.diagnostics = format!("{evil}\u{9b}1m{}", "x".repeat(500));
        for check in &mut entry.record.evidence.checks {
            check.summary = evil.into();
            check.hint = evil.into();
            check.scene = evil.into();
        }
        for part in &mut entry.grade.parts {
            part.reason = evil.repeat(9);
        }
        let said = harmless_lines(&entry.record.diagnostics, DIAGNOSTIC_LINES);
        for width in [1, 7, 20, 33, 80, 200] {
            let look = Look { width, colors: false };
            let text = detail(&report, &report.entries[1], look, true);
            assert!(!text.chars().any(|c| c != '\n' && (c.is_control() || c == '\u{202e}')));
            // What a compiler says is shown as it is.
            let quoted = |line: &&str| said.iter().any(|said| *line == format!("  {said}"));
            for line in text.lines().filter(|line| !quoted(line)) {
                assert!(line.width() <= width.max(2), "{width}: {line:?}");
            }
        }
    }

    #[test]
    fn colors_do_not_change_the_words() {
        let report = sample::report();
        let look = |colors| Look { width: 80, colors };
        let mut text = detail(&report, &report.entries[1], look(true), true);
        assert!(text.contains("\u{1b}[31m"));
        for code in ["0", "1", "2", "31", "32", "33"] {
            text = text.replace(&format!("\u{1b}[{code}m"), "");
        }
        assert_eq!(text, detail(&report, &report.entries[1], look(false), true));
    }
}
