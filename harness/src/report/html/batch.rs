//! The page of the batch.

use super::super::number::{due, is_range, of_part, points, range};
use super::super::{BatchReport, ErrorPicture, INSTRUCTOR, ReportError, SubmissionReport};
use super::markup::Html;
use super::{CLASS, begin, end, overview, part_class, total_class};
use crate::class::Class;
use crate::columns::count;
use crate::evidence::CheckId;
use crate::grading::Conditions;
use crate::intake::Severity;

/// The page of the batch: one row for each submission, which leads to its own page; `errors` shows where errors lie.
///
/// # Errors
/// When there is no submission.
pub fn batch(report: &BatchReport, errors: &[ErrorPicture]) -> Result<String, ReportError> {
    if report.entries.is_empty() {
        return Err(ReportError::Empty);
    }
    let mut html = begin(&report.title);
    html.raw("<header class=\"top\">\n<p class=\"course\">").text(&report.course);
    html.raw("</p>\n<h1>").text(&report.title).raw("</h1>\n<p>");
    html.text(&count(report.entries.len(), "submission"));
    let open = |entry: &&SubmissionReport| is_range(entry.grade.points, entry.grade.points_max);
    match report.entries.iter().filter(open).count() {
        0 => {}
        open => {
            html.raw(", ").show(open).raw(" not wholly judged (a range of points)");
        }
    }
    html.raw("; due <time>").text(&due(&report.due)).raw("</time></p>\n</header>\n<main>\n");
    overview::waiting(&mut html, report);
    table(&mut html, report);
    if report.entries.len() > 1 {
        overview::mistakes(&mut html, report);
        overview::distribution(&mut html, report);
        overview::errors(&mut html, report, errors);
    }
    if let Some(class) = &report.class {
        about(&mut html, report, class);
    }
    parts(&mut html, report);
    conditions(&mut html, report);
    html.raw("</main>\n<script>").raw(CLASS).raw("</script>\n");
    Ok(end(html, report))
}

fn table(html: &mut Html, report: &BatchReport) {
    html.raw("<div class=\"scroll\" role=\"region\" aria-label=\"Grades\" tabindex=\"0\">\n");
    html.raw(
        "<table class=\"grades sortable\">\n<thead><tr><th scope=\"col\">Student, submission</th>",
    );
    html.raw("<th scope=\"col\" class=\"number\">Total<small>of ");
    html.text(&points(report.rules.total_points())).raw("</small></th>");
    html.raw("<th scope=\"col\">Number</th>");
    for part in &report.rules.parts {
        html.raw("<th scope=\"col\" class=\"number\" data-part=\"").text(&part.id);
        html.raw("\" title=\"").text(&part.title).raw("\">");
        html.text(&part.id).raw("<small>").raw(if part.bonus { "+" } else { "of " });
        html.text(&points(part.points)).raw("</small></th>");
    }
    html.raw(
        "<th scope=\"col\">Findings</th><th scope=\"col\">Remarks</th></tr></thead>\n<tbody>\n",
    );
    for entry in &report.entries {
        row(html, report, entry);
    }
    html.raw("</tbody>\n</table>\n</div>\n");
}

fn row(html: &mut Html, report: &BatchReport, entry: &SubmissionReport) {
    let SubmissionReport { record, grade, .. } = entry;
    let student = entry.student();
    let name = student.full_name();
    let shown = if name.is_empty() { "(no name)" } else { &name };
    let key = format!("{} {}", student.last_name, student.first_name);
    html.raw("<tr><th scope=\"row\" data-sort=\"").text(&key).raw("\">");
    overview::link(html, report, entry, "");
    html.text(shown);
    html.raw("</a><small>").text(&record.name).raw("</small></th>");
    html.raw("<td class=\"number total ");
    html.raw(total_class(grade)).raw("\" data-sort=\"");
    html.show(grade.points).raw("\">").text(&range(grade.points, grade.points_max));
    html.raw("</td><td>").text(&student.id).raw("</td>");
    for part in &report.rules.parts {
        match grade.parts.iter().find(|own| own.id == part.id) {
            Some(own) => {
                html.raw("<td class=\"number ").raw(part_class(own)).raw("\" data-sort=\"");
                html.show(own.points).raw("\">");
                // The page of a part that lost points, one click away.
                if own.is_lost() {
                    overview::link(html, report, entry, &own.id);
                    html.text(&of_part(own)).raw("</a></td>");
                } else {
                    html.text(&of_part(own)).raw("</td>");
                }
            }
            None => {
                html.raw("<td></td>");
            }
        }
    }
    html.raw("<td class=\"findings\">");
    let mut several = false;
    // Notes are what most submissions have.
    for severity in [Severity::Error, Severity::Warning] {
        let number = record.findings.iter().filter(|found| found.severity == severity).count();
        if number > 0 {
            html.raw(if several { ", " } else { "" });
            html.text(&count(number, &severity.to_string()));
            several = true;
        }
    }
    html.raw("</td><td class=\"remarks\">").text(&grade.remarks.join("; ")).raw("</td></tr>\n");
}

/// Where the class comes from, who is missing, and what the instructor must decide.
fn about(html: &mut Html, report: &BatchReport, class: &Class) {
    let aside: Vec<&SubmissionReport> =
        report.entries.iter().filter(|entry| !entry.standing.set_aside.is_empty()).collect();
    if class.is_quiet() && aside.is_empty() {
        return;
    }
    html.raw("<section>\n<h2>The class</h2>\n");
    if !class.missing.is_empty() {
        html.raw("<p>").text(&count(class.missing.len(), "student")).raw(" of ");
        html.text(&class.list).raw(" without a submission:</p>\n<ul>\n");
        for missing in &class.missing {
            html.raw("<li>").text(&missing.student.who());
            html.raw(if missing.reason.is_empty() { "" } else { ": " }).text(&missing.reason);
            html.raw("</li>\n");
        }
        html.raw("</ul>\n");
    }
    if !aside.is_empty() {
        html.raw("<p>Attempts that count:</p>\n<ul>\n");
        for SubmissionReport { record, standing, .. } in aside {
            html.raw("<li>").text(&record.name).raw(", not ");
            html.text(&standing.set_aside.join(", ")).raw("</li>\n");
        }
        html.raw("</ul>\n");
    }
    if !class.worse.is_empty() {
        html.raw("<p>Counting attempts that earn less than another attempt:</p>\n<ul>\n");
        for line in &class.worse {
            html.raw("<li>").text(line).raw("</li>\n");
        }
        html.raw("</ul>\n");
    }
    if !class.not_counted.is_empty() {
        html.raw("<p>Not counted, as <code>matches.toml</code> says: ");
        html.text(&class.not_counted.join(", ")).raw("</p>\n");
    }
    html.raw("</section>\n");
}

fn parts(html: &mut Html, report: &BatchReport) {
    html.raw("<details>\n<summary>The parts and what decides them</summary>\n");
    html.raw(
        "<div class=\"scroll\" role=\"region\" aria-label=\"Parts\" tabindex=\"0\">\n<table>\n",
    );
    html.raw("<thead><tr><th scope=\"col\">Part</th><th scope=\"col\">Title</th>");
    html.raw("<th scope=\"col\" class=\"number\">Points</th><th scope=\"col\">Checks</th></tr></thead>\n<tbody>\n");
    for part in &report.rules.parts {
        html.raw("<tr><th scope=\"row\">").text(&part.id).raw("</th><td>").text(&part.title);
        html.raw("</td><td class=\"number\">").raw(if part.bonus { "+" } else { "" });
        html.text(&points(part.points)).raw("</td><td>").text(&names(&part.evidence));
        if !part.fallback.is_empty() {
            html.raw("; when they do not apply: ").text(&names(&part.fallback));
        }
        html.raw("</td></tr>\n");
    }
    html.raw("</tbody>\n</table>\n</div>\n");
    super::curve::curve(html, &report.rules.curve, &[]);
    html.raw("</details>\n");
}

fn conditions(html: &mut Html, report: &BatchReport) {
    let mut seen: Vec<(&Conditions, usize)> = Vec::new();
    for SubmissionReport { record, .. } in &report.entries {
        match seen.iter_mut().find(|(other, _)| **other == record.conditions) {
            Some((_, number)) => *number += 1,
            None => seen.push((&record.conditions, 1)),
        }
    }
    html.raw("<section>\n<h2>Conditions</h2>\n");
    if seen.len() > 1 {
        html.raw(
            "<p class=\"notice\">These submissions were not graded under the same conditions: ",
        );
        html.raw("their points are not strictly comparable.</p>\n");
    }
    for (conditions, number) in &seen {
        if seen.len() > 1 {
            html.raw("<p>").text(&count(*number, "submission")).raw(":</p>\n");
        }
        super::submission::conditions(html, conditions);
    }
    if let Some(held_back) = &report.held_back {
        let original = |(name, original): &(String, String)| format!("{name} ({original})");
        let scenes: Vec<String> = held_back.scenes.iter().map(original).collect();
        html.raw("<p>Held-back scenes: ").text(&scenes.join(", ")).raw("; seed ");
        html.show(held_back.seed).raw(", <code>--held-back ").show(held_back.seed);
        html.raw(
            "</code> reproduces them. Give students nothing but the folders of their submissions: ",
        );
        html.raw("this page, report.json, grades.csv and the folder <code>").raw(INSTRUCTOR);
        html.raw("</code> are for the instructor.</p>\n");
    }
    html.raw("</section>\n");
}
/// Names of checks, for a cell of the table.
fn names(checks: &[CheckId]) -> String {
    let names: Vec<&str> = checks.iter().map(|check| check.name()).collect();
    names.join(", ")
}
