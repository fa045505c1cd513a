//! The class at a glance, in front of its table: what waits for the instructor, which mistakes were made, how points
//! are spread, and where errors lie.

mod mistakes;
mod waiting;

use std::collections::BTreeMap;

pub(super) use self::mistakes::mistakes;
pub(super) use self::waiting::waiting;
use super::super::number::{is_failure, percent, points, value};
use super::super::{BatchReport, ERRORS, ErrorPicture, HTML_FILE, INSTRUCTOR, SubmissionReport};
use super::markup::Html;
use crate::columns::count;
use crate::evidence::{Check, CheckId, Verdict, price};
use crate::rubric::Part;

/// Number of names in a list before the rest is collapsed.
const NAMES: usize = 12;
/// Bins of a distribution, and one for all points.
const BINS: usize = 10;
/// What a check says of a renderer or a compiler that was ended for its time.
const OUT_OF_TIME: &str = "ran out of time";

/// Whether the class page uses a check.
pub fn is_read_by_class(check: &Check) -> bool {
    !check.private.is_empty()
        || check.verdict == Verdict::NotImplemented
        || (is_failure(check) && check.summary.contains(OUT_OF_TIME))
        || IMAGES.contains(&check.id)
}

/// Whether a check says which mistake explains its answers.
pub fn says_its_mistake(check: &Check) -> bool {
    price::is_explained(check) && check.summary.contains(&check.mistake)
}

/// Who a submission is by, for lists.
pub(super) fn who(entry: &SubmissionReport) -> String {
    let name = entry.student().full_name();
    if name.is_empty() { entry.record.name.clone() } else { name }
}

/// A link to a submission's page, at a part of it if one is named.
pub(super) fn link(html: &mut Html, report: &BatchReport, entry: &SubmissionReport, part: &str) {
    let folder =
        if entry.has_instructor_page(report) { format!("{INSTRUCTOR}/") } else { String::new() };
    html.raw("<a href=\"").address(&format!("{folder}{}/{HTML_FILE}", entry.record.slug));
    if !part.is_empty() {
        html.raw("#part-").text(part);
    }
    html.raw("\">");
}

/// The first names of a list, and the others collapsed.
fn some_names(html: &mut Html, report: &BatchReport, part: &str, entries: &[&SubmissionReport]) {
    let (first, others) = entries.split_at(entries.len().min(NAMES));
    names(html, report, part, first);
    if !others.is_empty() {
        html.raw("<details><summary>and ").text(&count(others.len(), "other"));
        html.raw("</summary>");
        names(html, report, part, others);
        html.raw("</details>");
    }
}

fn names(html: &mut Html, report: &BatchReport, part: &str, entries: &[&SubmissionReport]) {
    for (index, entry) in entries.iter().enumerate() {
        html.raw(if index == 0 { "" } else { ", " });
        link(html, report, entry, part);
        html.text(&who(entry)).raw("</a>");
    }
}

/// How the points of each part are spread: a bar for each tenth of them, and one for all.
pub(super) fn distribution(html: &mut Html, report: &BatchReport) {
    html.raw("<section>\n<h2>Points by part</h2>\n<div class=\"spread\">\n");
    for part in &report.rules.parts {
        let (bins, mean) = spread(report, part);
        let most = bins.iter().copied().max().unwrap_or_default().max(1);
        html.raw("<figure><svg viewBox=\"0 0 112 42\" width=\"168\" height=\"63\" role=\"img\" aria-label=\"");
        html.text(&format!(
            "Part {}: {} of {} with all points, {} with none, mean {}",
            part.id,
            bins[BINS],
            report.entries.len(),
            bins[0],
            value(mean)
        ));
        html.raw("\">");
        for (bin, &number) in bins.iter().enumerate() {
            if number > 0 {
                // At least a line, so that one among a thousand is seen.
                let height = (40.0 * number as f64 / most as f64).max(1.0);
                html.raw("<rect class=\"").raw(if bin == BINS { "full" } else { "some" });
                html.raw("\" x=\"").show(10 * bin + 1).raw("\" width=\"8\" y=\"");
                html.text(&format!("{:.1}", 41.0 - height)).raw("\" height=\"");
                html.text(&format!("{height:.1}")).raw("\"><title>").show(number);
                html.raw("</title></rect>");
            }
        }
        html.raw("<path class=\"grid\" d=\"M0 41.5H112\"/></svg><figcaption><b>").text(&part.id);
        html.raw("</b> ").text(&part.title).raw("<br>mean ").text(&value(mean)).raw(" of ");
        html.text(&points(part.points)).raw("; all points: ");
        html.text(&percent(bins[BINS], report.entries.len())).raw("</figcaption></figure>\n");
    }
    html.raw("</div>\n</section>\n");
}

/// How many submissions have so many tenths of a part's points, and the mean.
fn spread(report: &BatchReport, part: &Part) -> ([usize; BINS + 1], f64) {
    let mut bins = [0; BINS + 1];
    let mut sum = 0.0;
    for entry in &report.entries {
        let own = entry.grade.parts.iter().find(|own| own.id == part.id);
        let earned = own.map_or(0.0, |own| own.points);
        sum += earned;
        let fraction = if part.points > 0.0 { earned / part.points } else { 1.0 };
        let bin = if fraction >= 1.0 { BINS } else { (fraction * BINS as f64) as usize };
        bins[bin.min(BINS)] += 1;
    }
    (bins, sum / report.entries.len().max(1) as f64)
}

/// The checks of images whose errors are shown by scene.
const IMAGES: [CheckId; 4] =
    [CheckId::ImageOffline, CheckId::ImageRealtime, CheckId::BonusImage, CheckId::ShadowRays];

/// The mean error of images and shadows by scene: which scenes tell mistakes apart.
pub(super) fn errors(html: &mut Html, report: &BatchReport, pictures: &[ErrorPicture]) {
    /// Sum of errors and how many there are.
    type Sum = (f64, usize);
    let mut scenes: BTreeMap<(bool, &str), [Sum; IMAGES.len()]> = BTreeMap::new();
    for check in report.entries.iter().flat_map(|entry| &entry.record.evidence.checks) {
        let Some(column) = IMAGES.iter().position(|id| *id == check.id) else { continue };
        let judged =
            matches!(check.verdict, Verdict::Pass | Verdict::Fail | Verdict::NotImplemented);
        if judged && check.error.is_finite() && !check.scene.is_empty() {
            let row = scenes.entry((check.held_back, &check.scene)).or_default();
            row[column].0 += check.error.clamp(0.0, 1.0);
            row[column].1 += 1;
        }
    }
    if scenes.is_empty() {
        return;
    }
    html.raw("<details>\n<summary>Mean error by scene, and where it lies</summary>\n<div class=\"scroll\" role=\"region\" aria-label=\"Mean error by scene\" tabindex=\"0\">\n");
    html.raw("<table class=\"heat\">\n<thead><tr><th scope=\"col\">Scene</th>");
    for id in IMAGES {
        html.raw("<th scope=\"col\" class=\"number\">").text(id.name()).raw("</th>");
    }
    html.raw("</tr></thead>\n<tbody>\n");
    for ((held_back, scene), row) in scenes {
        html.raw("<tr><th scope=\"row\">").text(scene);
        html.raw(if held_back { " <small>held back</small></th>" } else { "</th>" });
        for (sum, number) in row {
            if number == 0 {
                html.raw("<td></td>");
                continue;
            }
            let mean = sum / number as f64;
            html.raw("<td class=\"number ").raw(heat(mean)).raw("\">").text(&value(mean));
            html.raw("</td>");
        }
        html.raw("</tr>\n");
    }
    html.raw("</tbody>\n</table>\n</div>\n");
    if !pictures.is_empty() {
        html.raw("<div class=\"pictures\">\n");
    }
    for ErrorPicture { scene, held_back, check, file, width, height, caption } in pictures {
        let back = if *held_back { " (held back)" } else { "" };
        let title = format!("{}, {scene}{back}", check.name());
        html.raw("<figure><img loading=\"lazy\" alt=\"").text(&format!("{title}: {caption}"));
        html.raw("\" src=\"").address(&format!("{INSTRUCTOR}/{ERRORS}/{file}"));
        html.raw("\" width=\"").show(width).raw("\" height=\"").show(height);
        html.raw("\"><figcaption><b>").text(&title).raw("</b><br>").text(caption);
        html.raw("</figcaption></figure>\n");
    }
    html.raw(if pictures.is_empty() { "</details>\n" } else { "</div>\n</details>\n" });
}

/// The class of a mean error: how dark its cell is.
fn heat(mean: f64) -> &'static str {
    match mean {
        m if m <= 0.0 => "h0",
        m if m < 0.01 => "h1",
        m if m < 0.05 => "h2",
        m if m < 0.2 => "h3",
        _ => "h4",
    }
}

#[cfg(test)]
mod tests;
