//! What waits for the instructor, in front of everything else.

use std::collections::{HashMap, HashSet};

use super::{OUT_OF_TIME, link, some_names, who};
use crate::class::{Class, INCOMPARABLE};
use crate::columns::{self, count};
use crate::evidence::{Check, CheckId};
use crate::grading::{Shared, SharedFiles};
use crate::report::html::markup::Html;
use crate::report::html::similarity::SIMILARITY;
use crate::report::number::{is_failure, is_range, range};
use crate::report::{BatchReport, HTML_FILE, INSTRUCTOR, SubmissionReport, is_private, is_unread};

/// The text on submissions that have something in common.
const SHARE: &str = "share something with another: see their pages";

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
pub fn waiting(html: &mut Html, report: &BatchReport) {
    let shared = Shared::of(report.entries.iter().map(|entry| &entry.record)).shared_files();
    let kinds = kinds(report, &shared);
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
        if kind == SHARE && report.has_similarity {
            html.raw("<p><a href=\"").address(&format!("{INSTRUCTOR}/{SIMILARITY}/{HTML_FILE}"));
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

/// A kind of what waits, and the submissions with the reason for each.
type Waiting<'a> = (&'static str, Vec<(&'a SubmissionReport, String)>);

/// What waits in single submissions. Which files are the same is said once for all that share them.
fn kinds<'a>(report: &'a BatchReport, shared: &[SharedFiles]) -> Vec<Waiting<'a>> {
    let mut kinds: Vec<Waiting> = Vec::new();
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
    let share_files: HashSet<&str> =
        shared.iter().flat_map(|group| &group.who).map(String::as_str).collect();
    add(SHARE, &|entry| {
        let checks = entry.record.evidence.checks.iter();
        let told: Vec<&Check> = checks.filter(|check| !check.private.is_empty()).collect();
        let grouped = share_files.contains(entry.record.slug.as_str());
        let own = told.iter().filter(|own| !grouped || own.id != CheckId::SubmissionSimilarity);
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
    kinds
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
