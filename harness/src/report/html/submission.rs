//! The page of one submission.

use super::super::harmless::harmless_lines;
use super::super::number::{hints, is_range, looks_like, of_part, points, range, seconds};
use super::super::{BatchReport, HTML_FILE, SubmissionReport};
use super::markup::Html;
use super::{Reader, begin, checks, class, end, part_class};
use crate::evidence::{Check, Verdict};
use crate::grading::{Conditions, StageCost};
use crate::intake::{Finding, Severity};
use crate::rubric::PartGrade;

/// So many lines of the compiler's are shown.
const DIAGNOSTIC_LINES: usize = 400;

/// The page of one submission: its parts with points and reasons, what failed with pictures, what
/// could not be judged, what passed, findings, conditions and costs.
pub fn submission(report: &BatchReport, entry: &SubmissionReport, reader: Reader) -> String {
    let known;
    // A student has the page's folder and nothing above it.
    let root = "../..";
    let entry = match reader {
        Reader::Instructor => entry,
        Reader::Student => {
            known = entry.for_student(&report.rules);
            &known
        }
    };
    let SubmissionReport { record, grade, standing } = entry;
    let student = entry.student();
    let name = student.full_name();
    let name = if name.is_empty() { &record.name } else { &name };
    let mut html = begin(&format!("{name} - {}", report.title));
    html.raw("<header class=\"top\">\n");
    if reader == Reader::Instructor {
        html.raw("<nav><a href=\"")
            .raw(root)
            .raw("/")
            .raw(HTML_FILE)
            .raw("\">All submissions</a></nav>\n");
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
    html.raw("</p>\n<p class=\"sum ").raw(class(grade.points, grade.points_max, grade.out_of));
    html.raw("\"><strong>").text(&range(grade.points, grade.points_max)).raw("</strong> of ");
    html.text(&points(grade.out_of)).raw(" points");
    html.bar(grade.points, grade.points_max, grade.out_of).raw("</p>\n");
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
        html.raw("<p class=\"notice\">This page shows what students must not see (held-back scenes, other ");
        html.raw(
            "submissions): it is for the instructor, not for the student, who gets <a href=\"",
        );
        html.address(&format!("{root}/{}/{HTML_FILE}", record.slug)).raw("\">another</a>.</p>\n");
    }
    html.raw("</header>\n<main>\n");
    let public_pictures = match reader {
        Reader::Student => String::new(),
        Reader::Instructor => format!("{root}/{}/", record.slug),
    };
    parts(&mut html, entry, &public_pictures);
    checks::checks(&mut html, &record.evidence.checks, &public_pictures);
    diagnostics(&mut html, &record.diagnostics);
    findings(&mut html, &record.findings);
    let marks: Vec<(f64, &str)> = grade.parts.iter().filter_map(|part| mark(part, entry)).collect();
    html.raw("<section>\n<h2>How an error becomes points</h2>\n");
    super::curve::curve(&mut html, &report.rules.curve, &marks);
    html.raw("</section>\n<section>\n<h2>Conditions and costs</h2>\n<div class=\"columns\">\n");
    conditions(&mut html, &record.conditions);
    stages(&mut html, &record.stages);
    html.raw("</div>\n</section>\n</main>\n");
    end(html, report)
}

fn parts(
    html: &mut Html,
    SubmissionReport { record, grade, .. }: &SubmissionReport,
    public_pictures: &str,
) {
    html.raw("<section>\n<h2>Parts</h2>\n<table class=\"parts\">\n<thead><tr>");
    html.raw("<th scope=\"col\">Part</th><th scope=\"col\">Points</th></tr></thead>\n<tbody>\n");
    for part in &grade.parts {
        html.raw("<tr class=\"").raw(part_class(part)).raw("\"><td><strong><span class=\"id\">");
        html.text(&part.id).raw("</span> ").text(&part.title).raw("</strong><p>");
        html.text(&part.reason).raw("</p>");
        if part.points < part.out_of {
            for words in looks_like(&part.id, &record.diagnoses) {
                html.raw("<p class=\"hint\"><b>Looks like</b> ").text(&words).raw("</p>");
            }
            for diagnosis in record.diagnoses.iter().filter(|found| found.part == part.id) {
                checks::pictures(html, "looks like", public_pictures, &diagnosis.pictures);
            }
            for hint in hints(part, &record.evidence.checks) {
                html.raw("<p class=\"hint\"><b>Hint</b> ").text(hint).raw("</p>");
            }
            decided_by(html, part, &record.evidence.checks);
        }
        html.raw("</td><td class=\"worth\"><strong>").text(&of_part(part));
        html.raw("</strong> <span class=\"of\">of ").text(&points(part.out_of)).raw("</span>");
        html.bar(part.points, part.points_max, part.out_of).raw("</td></tr>\n");
    }
    html.raw("</tbody>\n</table>\n");
    for words in looks_like("", &record.diagnoses) {
        html.raw("<p class=\"hint\"><b>Also looks like</b> ").text(&words).raw("</p>\n");
    }
    html.raw("</section>\n");
}

/// Links to the checks that decided a part.
fn decided_by(html: &mut Html, part: &PartGrade, all: &[Check]) {
    for (index, name) in part.evidence.iter().enumerate() {
        html.raw(if index == 0 { "<p class=\"decided\">Decided by " } else { ", " });
        let place = all.iter().position(|check| check.name() == *name || check.id.name() == name);
        match place {
            Some(place) => {
                html.raw("<a href=\"#check-").show(place).raw("\">").text(name).raw("</a>");
            }
            None => {
                html.text(name);
            }
        }
    }
    html.raw(if part.evidence.is_empty() { "" } else { "</p>" });
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

fn findings(html: &mut Html, findings: &[Finding]) {
    if findings.is_empty() {
        return;
    }
    html.raw("<section>\n<h2>Findings</h2>\n<ul class=\"findings\">\n");
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
    html.raw("</ul>\n</section>\n");
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
