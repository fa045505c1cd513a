//! The page of one submission.

use super::super::number::{is_failure, is_range, looks_like, of_part, points, range, seconds};
use super::super::{BatchReport, HTML_FILE, INSTRUCTOR, MENDED, SubmissionReport};
use super::checks::{self, Placed};
use super::lost::{Lost, was_lost};
use super::markup::Html;
use super::pictures::Places;
use super::{Reader, begin, end, part_class, total_class};
use crate::class::mending::Mended;
use crate::columns::count;
use crate::evidence::{Check, Verdict};
use crate::grading::{Conditions, StageCost};
use crate::harmless::harmless_lines;
use crate::intake::{Finding, INCLUDE_INSIDE, Severity};
use crate::rubric::PartGrade;

/// Number of the compiler's lines that are shown.
const DIAGNOSTIC_LINES: usize = 400;

/// The page of one submission, most important first: the points; compiler messages; the lost points, with reasons and
/// likely mistakes; findings; in collapsed sections, the right parts and all other evidence.
pub fn submission(report: &BatchReport, entry: &SubmissionReport, reader: Reader) -> String {
    let known;
    let own = entry;
    let entry = match reader {
        Reader::Instructor => entry,
        Reader::Student => {
            known = entry.for_student(&report.rules, report.released);
            &known
        }
    };
    let SubmissionReport { record, grade, .. } = entry;
    let student = entry.student();
    let name = student.full_name();
    let name = if name.is_empty() { &record.name } else { &name };
    let mut html = begin(&format!("{name} - {}", report.title));
    html.raw("<header class=\"top\">\n");
    if reader == Reader::Instructor {
        neighbors(&mut html, report, own);
    }
    html.raw("<p class=\"course\">").text(&report.title);
    html.raw("</p>\n<h1>").text(name).raw("</h1>\n<p class=\"who\">");
    if !student.id.is_empty() {
        html.text(&student.id).raw(" · ");
    }
    html.text(&record.name);
    if let Some(digest) = record.digest.get(..12) {
        html.raw(" · <span title=\"SHA-256 over its paths and contents, first 12 digits\">");
        html.text(digest).raw("</span>");
    }
    html.raw("</p>\n<p class=\"sum ").raw(total_class(grade));
    html.raw("\"><strong>").text(&range(grade.points, grade.points_max)).raw("</strong> of ");
    html.text(&points(grade.out_of)).raw(" points");
    html.bar(grade.points, grade.points_max, grade.out_of).raw("</p>\n");
    notices(&mut html, entry, reader);
    released(&mut html, report);
    html.raw("</header>\n<main>\n");
    let public = match reader {
        Reader::Student => String::new(),
        Reader::Instructor => format!("{ROOT}/{}/", record.slug),
    };
    let places = Places { public: &public, views: &record.views };
    // An error of the compiler or a shader is why the rest is as it is.
    diagnostics(&mut html, &record.diagnostics);
    let mut lost = Lost::new(&report.rules, record, places);
    let was_lost = |part: &PartGrade| was_lost(part, &entry.standing);
    let losing: Vec<&PartGrade> = grade.parts.iter().filter(|part| was_lost(part)).collect();
    if !losing.is_empty() {
        // What the instructor gave is not lost, but wrong all the same.
        let any_lost = losing.iter().any(|part| part.is_lost());
        html.raw("<section>\n<h2>What was ").raw(if any_lost { "lost" } else { "wrong" });
        html.raw("</h2>\n");
        for part in losing {
            lost.part(&mut html, part);
        }
        html.raw("</section>\n");
    }
    for words in looks_like("", &record.diagnoses) {
        html.raw("<p class=\"hint\"><b>Also looks like</b> ").text(&words).raw("</p>\n");
    }
    mended(&mut html, entry.standing.mended.as_ref(), reader);
    findings(&mut html, &record.findings);
    html.raw("<section>\n<h2>Everything else</h2>\n");
    right(&mut html, &grade.parts, was_lost);
    notes(&mut html, &record.findings);
    let shown = std::mem::take(&mut lost.shown);
    rest(&mut html, &record.evidence.checks, &shown, &places);
    let marks: Vec<(f64, &str)> = grade.parts.iter().filter_map(|part| mark(part, entry)).collect();
    html.raw("<details>\n<summary>How an error becomes points</summary>\n");
    super::curve::curve(&mut html, &report.rules.curve, &marks);
    html.raw(
        "</details>\n<details>\n<summary>Conditions and costs</summary>\n<div class=\"columns\">\n",
    );
    conditions(&mut html, &record.conditions);
    stages(&mut html, &record.stages);
    html.raw("</div>\n</details>\n</section>\n</main>\n");
    end(html, report)
}

/// The report's folder, from the folder of an instructor's page. A student has the page's folder and nothing above it.
const ROOT: &str = "../..";

/// Links to all submissions, the one before and the one after.
fn neighbors(html: &mut Html, report: &BatchReport, own: &SubmissionReport) {
    html.raw("<nav><a href=\"").raw(ROOT).raw("/").raw(HTML_FILE).raw("\">All submissions</a>");
    let place = report.entries.iter().position(|entry| entry.record.slug == own.record.slug);
    let at = |place: Option<usize>| place.and_then(|place| report.entries.get(place));
    for (class, entry) in [
        ("previous", at(place.and_then(|place| place.checked_sub(1)))),
        ("next", at(place.map(|place| place + 1))),
    ] {
        let Some(entry) = entry else { continue };
        let slug = &entry.record.slug;
        html.raw(" <a class=\"").raw(class).raw("\" rel=\"");
        html.raw(if class == "next" { "next" } else { "prev" }).raw("\" href=\"");
        let folder = if entry.has_instructor_page(report) { INSTRUCTOR } else { "." };
        html.address(&format!("{ROOT}/{folder}/{slug}/{HTML_FILE}")).raw("\">");
        html.raw(if class == "next" { "Next" } else { "Previous" }).raw("</a>");
    }
    html.raw("</nav>\n");
}

/// What holds for the submission as a whole.
fn notices(html: &mut Html, entry: &SubmissionReport, reader: Reader) {
    let SubmissionReport { record, grade, standing } = entry;
    if is_range(grade.points, grade.points_max) {
        html.raw(
            "<p class=\"notice\">A range: not everything could be judged. The part says why.</p>\n",
        );
    }
    if !standing.set_aside.is_empty() {
        html.raw("<p class=\"notice\">Other attempts, which do not count: ");
        html.text(&standing.set_aside.join(", ")).raw("</p>\n");
    }
    for remark in &grade.remarks {
        html.raw("<p class=\"notice\">").text(remark).raw("</p>\n");
    }
    if reader == Reader::Instructor {
        html.raw("<p class=\"notice\">For the instructor: held-back scenes and other submissions are on this page. ");
        html.raw("The student gets <a href=\"");
        html.address(&format!("{ROOT}/{}/{HTML_FILE}", record.slug)).raw("\">another</a>.</p>\n");
    }
}

/// What the instructor mended.
fn mended(html: &mut Html, mended: Option<&Mended>, reader: Reader) {
    let Some(mended) = mended else { return };
    html.raw("<section>\n<h2>Mended by the instructor</h2>\n<p>").text(&mended.words);
    html.raw("</p>\n<pre tabindex=\"0\">");
    for line in harmless_lines(&mended.patch, DIAGNOSTIC_LINES) {
        html.text(&line).raw("\n");
    }
    html.raw("</pre>\n");
    if mended.counts {
        html.raw(
            "<p>Points and reasons of the parts are those of the mended source. All else on this page, its checks, \
             pictures and messages, is of the source as it was submitted.</p>\n",
        );
    }
    if reader == Reader::Instructor {
        html.raw("<p><a href=\"").raw(MENDED).raw("/").raw(HTML_FILE);
        html.raw("\">The evidence of the mended source</a></p>\n");
    }
    html.raw("</section>\n");
}

/// Which scenes are no longer held back.
fn released(html: &mut Html, report: &BatchReport) {
    let Some(held_back) = report.held_back.as_ref().filter(|_| report.released) else { return };
    let scenes: Vec<String> =
        held_back.scenes.iter().map(|(name, original)| format!("{name} ({original})")).collect();
    html.raw(
        "<p class=\"notice\">The scenes that were held back are released, each a changed copy: ",
    );
    html.text(&scenes.join(", ")).raw("</p>\n");
}

/// The parts that earned everything, and a bonus that nobody tried for.
fn right(html: &mut Html, parts: &[PartGrade], was_lost: impl Fn(&PartGrade) -> bool) {
    let of = |tried: bool| -> Vec<&PartGrade> {
        let kept = parts.iter().filter(|part| !was_lost(part));
        kept.filter(|part| part.is_unearned() != tried).collect()
    };
    let (right, untried) = (of(true), of(false));
    if right.is_empty() && untried.is_empty() {
        return;
    }
    let ids = |parts: &[&PartGrade]| {
        parts.iter().map(|part| part.id.as_str()).collect::<Vec<_>>().join(", ")
    };
    html.raw("<details>\n<summary>");
    if !right.is_empty() {
        html.text(&count(right.len(), "part")).raw(" right: ").text(&ids(&right));
    }
    if !untried.is_empty() {
        html.raw(if right.is_empty() { "Not tried: " } else { "; not tried: " });
        html.text(&ids(&untried));
    }
    html.raw("</summary>\n<table class=\"parts\">\n<tbody>\n");
    for part in right.into_iter().chain(untried) {
        html.raw("<tr class=\"").raw(part_class(part)).raw("\"><td><strong><span class=\"id\">");
        html.text(&part.id).raw("</span> ").text(&part.title).raw("</strong><p>");
        html.text(&part.reason).raw("</p></td><td class=\"worth\"><strong>").text(&of_part(part));
        html.raw("</strong> <span class=\"of\">of ").text(&points(part.out_of));
        html.raw("</span></td></tr>\n");
    }
    html.raw("</tbody>\n</table>\n</details>\n");
}

/// The checks that no part has shown.
fn rest(html: &mut Html, all: &[Check], shown: &[usize], places: &Places) {
    let pick = |wanted: fn(&Check) -> bool| -> Vec<Placed> {
        let rest = all.iter().enumerate().filter(|(place, _)| !shown.contains(place));
        rest.filter(|(_, check)| wanted(check)).collect()
    };
    let mut failed = pick(is_failure);
    failed.sort_by(|a, b| b.1.error.total_cmp(&a.1.error));
    let noun = if shown.is_empty() { "check" } else { "more check" };
    if !failed.is_empty() {
        html.raw("<details>\n<summary>").text(&count(failed.len(), noun));
        html.raw(" failed</summary>\n");
        checks::articles(html, &failed, places);
        html.raw("</details>\n");
    }
    let silent = |check: &Check| matches!(check.verdict, Verdict::NotJudged | Verdict::NotRun);
    checks::folded(html, ("check", "could not be judged"), &pick(silent), checks::line);
    let passed = |check: &Check| check.verdict == Verdict::Pass;
    checks::folded(html, ("check", "passed"), &pick(passed), checks::line);
}

/// The largest error among the failed checks that decided a part, for the curve.
fn mark<'a>(part: &'a PartGrade, entry: &SubmissionReport) -> Option<(f64, &'a str)> {
    let decided = |name: String, id: &str| part.evidence.iter().any(|e| *e == name || e == id);
    let checks = entry.record.evidence.checks.iter();
    let failed = checks.filter(|check| check.verdict == Verdict::Fail);
    let errors =
        failed.filter(|check| decided(check.name(), check.id.name())).map(|check| check.error);
    let worst = errors.filter(|error| error.is_finite()).max_by(f64::total_cmp)?;
    (part.points < part.out_of).then_some((worst, part.id.as_str()))
}

fn diagnostics(html: &mut Html, diagnostics: &str) {
    let lines = harmless_lines(diagnostics, DIAGNOSTIC_LINES);
    if lines.is_empty() {
        return;
    }
    html.raw("<section>\n<h2>The compiler says</h2>\n<pre tabindex=\"0\">");
    for line in lines {
        html.text(&line).raw("\n");
    }
    html.raw("</pre>\n</section>\n");
}

/// Errors and warnings.
fn findings(html: &mut Html, findings: &[Finding]) {
    let is_serious = |finding: &&Finding| finding.severity != Severity::Note;
    let serious: Vec<&Finding> = findings.iter().filter(is_serious).collect();
    if !serious.is_empty() {
        html.raw("<section>\n<h2>Findings</h2>\n");
        finding_list(html, &serious);
        html.raw("</section>\n");
    }
}

/// What is only noted, folded, but for what the template itself does: every submission has that. `report.json` has all.
fn notes(html: &mut Html, findings: &[Finding]) {
    let is_note =
        |finding: &&Finding| finding.severity == Severity::Note && finding.code != INCLUDE_INSIDE;
    let notes: Vec<&Finding> = findings.iter().filter(is_note).collect();
    if !notes.is_empty() {
        html.raw("<details>\n<summary>").text(&count(notes.len(), "note")).raw("</summary>\n");
        finding_list(html, &notes);
        html.raw("</details>\n");
    }
}

fn finding_list(html: &mut Html, findings: &[&Finding]) {
    html.raw("<ul class=\"findings\">\n");
    for finding in findings {
        let class = match finding.severity {
            Severity::Error => "badge bad",
            Severity::Warning => "badge unsure",
            Severity::Note => "badge",
        };
        html.raw("<li><span class=\"").raw(class).raw("\">").show(finding.severity);
        html.raw("</span> ");
        if let Some(path) = &finding.path {
            html.raw("<code>").text(path);
            if let Some(line) = finding.line {
                html.raw(":").show(line);
            }
            html.raw("</code> ");
        }
        html.text(&finding.message);
        if let Some(hint) = &finding.hint {
            html.raw("<p class=\"hint\"><b>Hint</b> ").text(hint).raw("</p>");
        }
        html.raw("</li>\n");
    }
    html.raw("</ul>\n");
}

/// Conditions as a list of terms.
pub(super) fn conditions(html: &mut Html, conditions: &Conditions) {
    html.raw("<dl>\n");
    for (name, text) in [
        ("Umbra", &conditions.umbra),
        ("Isolation", &conditions.isolation),
        ("Adapter", &conditions.adapter),
        ("Compiler", &conditions.compiler),
    ] {
        if !text.is_empty() {
            html.raw("<dt>").raw(name).raw("</dt><dd>").text(text).raw("</dd>\n");
        }
    }
    html.raw("</dl>\n");
}

fn stages(html: &mut Html, stages: &[StageCost]) {
    if stages.is_empty() {
        return;
    }
    html.raw("<table class=\"costs\">\n<thead><tr><th scope=\"col\">Stage</th>");
    html.raw("<th scope=\"col\" class=\"number\">Time</th>");
    html.raw("<th scope=\"col\" class=\"number\">CPU time</th></tr></thead>\n<tbody>\n");
    let row = |html: &mut Html, name: &str, wall_s: f64, cpu_s: f64| {
        html.raw("<tr><th scope=\"row\">").text(name).raw("</th><td class=\"number\">");
        html.text(&seconds(wall_s)).raw("</td><td class=\"number\">");
        html.text(&seconds(cpu_s)).raw("</td></tr>\n");
    };
    for stage in stages {
        row(html, &stage.name, stage.wall_s, stage.cpu_s);
    }
    html.raw("</tbody>\n<tfoot>\n");
    let sum = |of: fn(&StageCost) -> f64| stages.iter().map(of).sum();
    row(html, "all", sum(|stage| stage.wall_s), sum(|stage| stage.cpu_s));
    html.raw("</tfoot>\n</table>\n");
}
