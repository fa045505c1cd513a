//! The mistakes of a class, the most frequent first.

use std::collections::BTreeMap;

use super::{OUT_OF_TIME, says_its_mistake, some_names};
use crate::evidence::{Check, CheckId, Verdict};
use crate::report::html::lost::is_lost_by_evidence;
use crate::report::html::markup::Html;
use crate::report::number::{is_range, percent};
use crate::report::{BatchReport, SubmissionReport};
use crate::rubric::{Gate, PartGrade};

/// What a part that nobody began looks like.
const UNDONE: &str = "not implemented";
/// What every part looks like where the source does not build at all.
pub(super) const NO_CODE: &str = "no code that builds";
/// What a part looks like whose mistake has no name.
pub(super) const OTHER: &str = "wrong in a way that is not recognized";

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
pub fn mistakes(html: &mut Html, report: &BatchReport) {
    let mut groups = groups(report);
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

/// The groups by part and mistake, the same submissions in several parts once.
fn groups(report: &BatchReport) -> Vec<Group<'_>> {
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
        let judged = |own: &&PartGrade| !is_range(own.points, own.points_max);
        let lost = |own: &&PartGrade| is_lost_by_evidence(own, &entry.standing);
        for own in entry.grade.parts.iter().filter(lost).filter(judged) {
            if entry.record.diagnoses.iter().any(|found| found.part == own.id) {
                continue;
            }
            let Some(words) = words_of(own, entry, report) else { continue };
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
    merged
}

/// The mistake that the sentence on a part names, where one explains its answers.
fn named_in<'a>(reason: &str, checks: &'a [Check]) -> Option<&'a str> {
    let decides = |check: &&Check| check.summary == reason && says_its_mistake(check);
    checks.iter().find(decides).map(|check| check.mistake.as_str())
}

/// What happened to a part that no diagnosis names. Nothing where the remark on the whole says why it lost points.
fn words_of<'a>(
    own: &PartGrade,
    entry: &'a SubmissionReport,
    report: &BatchReport,
) -> Option<&'a str> {
    let checks = &entry.record.evidence.checks;
    let is_no_code =
        |check: &Check| check.id == CheckId::SubmissionBuild && check.verdict == Verdict::Fail;
    if checks.iter().any(is_no_code) {
        return Some(NO_CODE);
    }
    if let Some(words) = what_happened(&own.reason) {
        return Some(words);
    }
    let rule = report.rules.parts.iter().find(|part| part.id == own.id);
    let is_undone = |check: &Check| {
        check.verdict == Verdict::NotImplemented
            && rule.is_some_and(|part| part.evidence.contains(&check.id))
    };
    if own.points_max == 0.0 && checks.iter().any(is_undone) {
        return Some(UNDONE);
    }
    if let Some(mistake) = named_in(&own.reason, checks) {
        return Some(mistake);
    }
    let is_gated = |gate: &Gate| gate.ceiling < 1.0 && entry.grade.remarks.contains(&gate.reason);
    (!report.rules.gates.iter().any(is_gated)).then_some(OTHER)
}
