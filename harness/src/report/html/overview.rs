//! The class at a glance, in front of its table: what waits for the instructor, which mistakes were made, how points
//! are spread, and where errors lie.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::super::number::{is_failure, is_range, percent, points, range, value};
use super::super::{
    BatchReport, ERRORS, ErrorPicture, HTML_FILE, INSTRUCTOR, SubmissionReport, is_private,
    is_unread,
};
use super::likeness::LIKENESS;
use super::lost::is_lost_by_evidence;
use super::markup::Html;
use crate::class::{Class, INCOMPARABLE};
use crate::columns::{self, count};
use crate::evidence::{Check, CheckId, Verdict};
use crate::grading::{Shared, SharedFiles};
use crate::rubric::{Part, PartGrade};

/// Number of names in a list before the rest is collapsed.
const NAMES: usize = 12;
/// Bins of a distribution, and one for all points.
const BINS: usize = 10;

/// The text on submissions that have something in common.
const SHARE: &str = "share something with another: see their pages";

/// What a part that nobody began looks like.
const UNDONE: &str = "not implemented";
/// What every part looks like where the source does not build at all.
const NO_CODE: &str = "no code that builds";
/// What a part looks like whose mistake has no name.
const OTHER: &str = "wrong in a way that is not recognized";
/// What a check says of a renderer or a compiler that was ended for its time.
const OUT_OF_TIME: &str = "ran out of time";

/// Whether the class page uses a check.
pub fn is_read_by_class(check: &Check) -> bool {
    !check.private.is_empty()
        || check.verdict == Verdict::NotImplemented
        || (is_failure(check) && check.summary.contains(OUT_OF_TIME))
        || IMAGES.contains(&check.id)
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

/// What waits for the instructor in the class as a whole, each kind with its lines.
fn decisions(class: &Class) -> Vec<(String, Vec<String>)> {
    let undecided = class.undecided.iter().map(|own| format!("{}: {}", own.submission, own.reason));
    let again = class.stale.iter().chain(&class.unused).cloned().collect::<Vec<_>>();
    let kinds = [
        ("submission", "decide in matches.toml", undecided.collect()),
        ("download", "neither opened nor graded", class.unopened.clone()),
        ("submission", INCOMPARABLE, class.incomparable.clone()),
        ("decision", "to look at again", again),
    ];
    let kinds = kinds.into_iter().filter(|(.., lines)| !lines.is_empty());
    kinds
        .map(|(noun, what, lines)| (format!("{}: {what}", count(lines.len(), noun)), lines))
        .collect()
}

/// What the instructor must look at, each kind with its submissions; the page begins with it.
pub(super) fn waiting(html: &mut Html, report: &BatchReport) {
    let mut kinds: Vec<(&str, Vec<(&SubmissionReport, String)>)> = Vec::new();
    let mut add = |kind, of: &dyn Fn(&SubmissionReport) -> Option<String>| {
        let found = report.entries.iter().filter_map(|entry| Some((entry, of(entry)?)));
        let found: Vec<_> = found.collect();
        if !found.is_empty() {
            kinds.push((kind, found));
        }
    };
    add("not wholly judged: grade again, or decide", &|entry| {
        let (least, most) = (entry.grade.points, entry.grade.points_max);
        is_range(least, most).then(|| format!("{} points", range(least, most)))
    });
    add("nobody could open them: ask for other archives, or confirm", &|entry| {
        let (record, grade) = (&entry.record, &entry.grade);
        let unread = is_unread(&record.digest, [grade.points, grade.points_max], &entry.standing);
        unread.then(|| grade.remarks.first().cloned().unwrap_or_default())
    });
    add("images without code: confirm or refuse", &|entry| {
        let own = entry.grade.unconfirmed;
        (own > 0.0).then(|| format!("{} for images", columns::points(own)))
    });
    add("drafts, not submitted: ask, then confirm", &|entry| {
        let standing = &entry.standing;
        (standing.is_draft() && !standing.is_confirmed()).then(|| "a draft".to_owned())
    });
    add("to be looked at, then confirmed", &|entry| {
        // What the instructor confirmed, they have looked at.
        if entry.standing.is_confirmed() {
            return None;
        }
        let private = entry.grade.remarks.iter().filter(|r| is_private(r, &report.rules));
        let private: Vec<&str> = private.map(String::as_str).collect();
        (!private.is_empty()).then(|| private.join("; "))
    });
    // Which files are the same is said once for all that share them.
    let shared = Shared::of(report.entries.iter().map(|entry| &entry.record)).shared_files();
    let share_files: HashSet<&str> =
        shared.iter().flat_map(|group| &group.who).map(String::as_str).collect();
    add(SHARE, &|entry| {
        let checks = entry.record.evidence.checks.iter();
        let told: Vec<&Check> = checks.filter(|check| !check.private.is_empty()).collect();
        let grouped = share_files.contains(entry.record.slug.as_str());
        let own = told.iter().filter(|own| !grouped || own.id != CheckId::SubmissionLikeness);
        let words: Vec<&str> = own.map(|check| check.private.as_str()).collect();
        (!told.is_empty() && !entry.standing.is_confirmed()).then(|| words.join("; "))
    });
    add("ran out of time", &|entry| {
        let late = |check: &&Check| is_failure(check) && check.summary.contains(OUT_OF_TIME);
        entry.record.evidence.checks.iter().find(late).map(Check::name)
    });
    add("when it was submitted is not known", &|entry| {
        entry.standing.time_unknown.then(String::new)
    });
    let class = report.class.as_ref();
    let lines = class.map_or_else(Vec::new, decisions);
    if kinds.is_empty() && lines.is_empty() {
        return;
    }
    html.raw("<section>\n<h2>For you to decide</h2>\n");
    for (title, lines) in lines {
        html.raw("<details class=\"waiting\"><summary>").text(&title);
        html.raw("</summary>\n<ul class=\"names\">\n");
        for line in lines {
            html.raw("<li>").text(&line).raw("</li>\n");
        }
        html.raw("</ul></details>\n");
    }
    for (kind, found) in kinds {
        html.raw("<details class=\"waiting\"><summary>")
            .text(&count(found.len(), "submission"))
            .raw(": ");
        html.text(kind).raw("</summary>\n");
        if kind == SHARE && report.has_alike {
            html.raw("<p><a href=\"").address(&format!("{INSTRUCTOR}/{LIKENESS}/{HTML_FILE}"));
            html.raw("\">Sources side by side</a></p>\n");
        }
        if kind == SHARE {
            shared_files(html, report, &shared);
        }
        html.raw("<ul class=\"names\">\n");
        for (entry, why) in found {
            if kind == SHARE && why.is_empty() {
                continue;
            }
            html.raw("<li>");
            link(html, report, entry, "");
            html.text(&who(entry)).raw("</a> <small>").text(&why).raw("</small></li>\n");
        }
        html.raw("</ul></details>\n");
    }
    html.raw("</section>\n");
}

/// Files that several submissions share but for comments and blanks, each group of submissions once.
fn shared_files(html: &mut Html, report: &BatchReport, shared: &[SharedFiles]) {
    if shared.is_empty() {
        return;
    }
    let by_slug: HashMap<&str, &SubmissionReport> =
        report.entries.iter().map(|entry| (entry.record.slug.as_str(), entry)).collect();
    html.raw("<p>Files with a text of the students' own that are equal but for comments and blanks:</p>\n");
    html.raw("<ul class=\"groups\">\n");
    for SharedFiles { paths, who } in shared {
        let entries: Vec<_> =
            who.iter().filter_map(|slug| by_slug.get(slug.as_str())).copied().collect();
        html.raw("<li><strong>").text(&count(entries.len(), "submission")).raw("</strong> share ");
        html.text(&paths.join(", ")).raw(" <span class=\"names\">");
        some_names(html, report, "", &entries);
        html.raw("</span></li>\n");
    }
    html.raw("</ul>\n");
}

/// What a group of submissions has in common.
struct Group<'a> {
    parts: Vec<&'a str>,
    words: &'a str,
    entries: Vec<&'a SubmissionReport>,
}

impl Group<'_> {
    fn slugs(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| entry.record.slug.as_str())
    }
}

/// What ended the judgement of a part, from the sentence that says why it lost points.
fn what_happened(reason: &str) -> Option<&'static str> {
    const LATE: &[&str] =
        &["endless loop in", "too slow on", "stuck in", OUT_OF_TIME, "no answer within"];
    let says = |words: &[&str]| words.iter().any(|words| reason.contains(words));
    let is_place = |extension: &str| {
        reason
            .split_once(extension)
            .is_some_and(|(path, _)| path.starts_with("src/") && !path.contains(' '))
    };
    let kinds = [
        ("the renderer panics", says(&["panicked"])),
        ("endless loop, or far too slow", says(LATE)),
        ("the renderer crashes", says(&["crashed", "exited early", "out of memory"])),
        ("a shader does not compile", is_place(".wgsl:")),
        ("the code does not compile", is_place(".rs:")),
    ];
    kinds.into_iter().find(|(_, is_so)| *is_so).map(|(words, _)| words)
}

/// Groups by the mistake that a part looks like, the most frequent first; then what has no name, and what was not
/// begun.
pub(super) fn mistakes(html: &mut Html, report: &BatchReport) {
    let mut groups: BTreeMap<(&str, String), Group> = BTreeMap::new();
    for entry in &report.entries {
        for found in entry.record.diagnoses.iter().filter(|found| !found.part.is_empty()) {
            // A fitted number may stand in the words: the mistake's name is the same for all.
            let names: Vec<String> = found.mistakes.iter().map(|names| names.join("/")).collect();
            let key = if names.is_empty() { found.words.clone() } else { names.join(" and ") };
            let (part, words) = (found.part.as_str(), found.words.as_str());
            let group = groups.entry((part, key));
            let group = group.or_insert(Group { parts: vec![part], words, entries: Vec::new() });
            group.entries.push(entry);
        }
        // What no diagnosis names is grouped by what happened.
        let gated = report
            .rules
            .gates
            .iter()
            .any(|gate| gate.ceiling < 1.0 && entry.grade.remarks.contains(&gate.reason));
        let no_code =
            entry.record.evidence.checks.iter().any(|check| {
                check.id == CheckId::SubmissionBuild && check.verdict == Verdict::Fail
            });
        let judged = |own: &&PartGrade| !is_range(own.points, own.points_max);
        let lost = |own: &&PartGrade| is_lost_by_evidence(own, &entry.standing);
        for own in entry.grade.parts.iter().filter(lost).filter(judged) {
            if entry.record.diagnoses.iter().any(|found| found.part == own.id) {
                continue;
            }
            let rule = report.rules.parts.iter().find(|part| part.id == own.id);
            let undone = own.points_max == 0.0
                && entry.record.evidence.checks.iter().any(|check| {
                    check.verdict == Verdict::NotImplemented
                        && rule.is_some_and(|part| part.evidence.contains(&check.id))
                });
            let words = match what_happened(&own.reason) {
                _ if no_code => NO_CODE,
                Some(words) => words,
                None if undone => UNDONE,
                // What another thing took is no mistake of this part; the remark says it.
                None if gated => continue,
                None => OTHER,
            };
            let part = own.id.as_str();
            let group = groups.entry((part, words.to_owned()));
            group
                .or_insert(Group { parts: vec![part], words, entries: Vec::new() })
                .entries
                .push(entry);
        }
    }
    // What happened to the same submissions in several parts is one line.
    let mut merged: Vec<Group> = Vec::new();
    for group in groups.into_values() {
        let same = |own: &&mut Group| own.words == group.words && own.slugs().eq(group.slugs());
        match merged.iter_mut().find(same) {
            Some(own) => own.parts.extend(group.parts),
            None => merged.push(group),
        }
    }
    let mut groups = merged;
    if groups.is_empty() {
        return;
    }
    let last = |words| [OTHER, UNDONE].iter().position(|own| *own == words).map_or(0, |at| at + 1);
    groups.sort_by_key(|group| (last(group.words), std::cmp::Reverse(group.entries.len())));
    html.raw("<section>\n<h2>Mistakes in this class</h2>\n<ul class=\"groups\">\n");
    for Group { parts, words, entries } in groups {
        html.raw("<li><strong>").text(&percent(entries.len(), report.entries.len()));
        html.raw("</strong> <span class=\"id\">")
            .text(&parts.join(", "))
            .raw("</span> ")
            .text(words);
        html.raw(" <span class=\"names\">");
        some_names(html, report, parts[0], &entries);
        html.raw("</span></li>\n");
    }
    html.raw("</ul>\n</section>\n");
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
