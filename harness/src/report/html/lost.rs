//! The lost points of a submission, part by part: the reason in a sentence, where to look, the likely mistake, and the
//! evidence in collapsed sections.

use super::super::number::{hints, is_failure, looks_like, of_part, points};
use super::checks::{self, Placed};
use super::lobe::lobe;
use super::markup::Html;
use super::part_class;
use super::pictures::Places;
use crate::class::Standing;
use crate::class::overrides::Applied;
use crate::columns::count;
use crate::evidence::{Check, CheckId};
use crate::grading::Record;
use crate::rubric::{self, PartGrade, Rules};

/// The parts of a submission that lost points, and what was shown of its checks so far.
pub(super) struct Lost<'a> {
    pub rules: &'a Rules,
    pub record: &'a Record,
    pub places: Places<'a>,
    /// Places in the evidence of the checks that stand on the page already.
    pub shown: Vec<usize>,
    /// The checks whose pictures stand in front of a part, with that part.
    pictured: Vec<(usize, &'a str)>,
}

/// Whether it lost something before the instructor set its points by hand: then what was wrong still is.
pub(super) fn was_lost(part: &PartGrade, standing: &Standing) -> bool {
    let set = standing.decisions.iter();
    let mut set = set.filter(|own| own.decision.part.as_deref() == Some(part.id.as_str()));
    part.is_lost() || set.any(|own| own.before[0] < part.out_of)
}

/// Whether it lost what the evidence took, not the instructor alone.
pub(super) fn is_lost_by_evidence(part: &PartGrade, standing: &Standing) -> bool {
    let is_own = |own: &&Applied| own.decision.part.as_deref() == Some(part.id.as_str());
    let set = standing.decisions.iter().rfind(is_own);
    part.is_lost() && set.is_none_or(|own| own.before[0] < part.out_of)
}

impl<'a> Lost<'a> {
    pub(super) fn new(rules: &'a Rules, record: &'a Record, places: Places<'a>) -> Self {
        Self { rules, record, places, shown: Vec::new(), pictured: Vec::new() }
    }

    /// The part with everything that tells why.
    pub(super) fn part(&mut self, html: &mut Html, part: &'a PartGrade) {
        let rule = self.rules.parts.iter().find(|rule| rule.id == part.id);
        html.raw("<article class=\"part ").raw(part_class(part)).raw("\" id=\"part-");
        html.text(&part.id).raw("\">\n<h3><span class=\"id\">").text(&part.id).raw("</span> ");
        html.text(&part.title).raw(" <span class=\"worth\"><strong>").text(&of_part(part));
        html.raw("</strong> of ").text(&points(part.out_of)).raw("</span></h3>\n");
        self.why(html, part);
        if let Some(rule) = rule.filter(|rule| !rule.files.is_empty()) {
            html.raw("<p class=\"where\">Look in ");
            for (index, file) in rule.files.iter().enumerate() {
                html.raw(if index == 0 { "<code>src/" } else { ", <code>src/" }).text(file);
                html.raw("</code>");
            }
            html.raw("</p>\n");
        }
        let own = self.checks_of(part, rule);
        if let Some(found) = own.iter().find_map(|(_, check)| check.lobe.as_ref()) {
            lobe(html, found);
        }
        self.pictures(html, part, rule, &own);
        self.evidence(html, part, &own);
        html.raw("</article>\n");
    }

    /// Why, in one sentence, and hints.
    fn why(&self, html: &mut Html, part: &PartGrade) {
        let looks = looks_like(&part.id, &self.record.diagnoses);
        if looks.is_empty() {
            html.raw("<p class=\"why\">").text(&part.reason).raw("</p>\n");
        }
        for words in looks {
            html.raw("<p class=\"why\"><b>Looks like</b> ").text(&words).raw("</p>\n");
        }
        for hint in hints(part, &self.record.evidence.checks) {
            html.raw("<p class=\"hint\"><b>Hint</b> ").text(hint).raw("</p>\n");
        }
    }

    /// The failed checks that are about a part, the worst first.
    fn checks_of(&self, part: &PartGrade, rule: Option<&rubric::Part>) -> Vec<Placed<'a>> {
        let about = |check: &Check| {
            rule.is_some_and(|rule| rule.evidence.contains(&check.id))
                || part.evidence.iter().any(|e| *e == check.name() || *e == check.id.name())
        };
        let all = self.record.evidence.checks.iter().enumerate();
        let mut own: Vec<Placed> =
            all.filter(|(_, check)| is_failure(check) && about(check)).collect();
        own.sort_by(|a, b| b.1.error.total_cmp(&a.1.error));
        own
    }

    /// The worst picture of the part's own, and the worst image of its path, each once on the page.
    fn pictures(
        &mut self,
        html: &mut Html,
        part: &'a PartGrade,
        rule: Option<&rubric::Part>,
        own: &[Placed<'a>],
    ) {
        let proof = rule.and_then(|rule| self.rules.paths.get(&rule.path)).map(|path| path.proof);
        let images = self.failed(|id| Some(id) == proof);
        let shown = |(_, check): &&Placed<'a>| !check.pictures.is_empty();
        // What the viewer shows comes first: it is the worst.
        let first = |all: &[Placed<'a>]| {
            let viewed =
                |(_, check): &&Placed| self.places.views.iter().any(|view| view.id == check.name());
            let found = all.iter().filter(shown).find(viewed);
            found.or_else(|| all.iter().find(shown)).copied()
        };
        let mut found: Vec<Placed> = [first(own), first(&images)].into_iter().flatten().collect();
        found.dedup_by_key(|(place, _)| *place);
        for (place, check) in found {
            if let Some((_, other)) = self.pictured.iter().find(|(shown, _)| *shown == place) {
                html.raw("<p class=\"open\">What the image looks like: see <a href=\"#part-");
                html.text(other).raw("\">").text(other).raw("</a></p>\n");
                continue;
            }
            self.pictured.push((place, &part.id));
            self.places.of_check(html, check);
        }
        for diagnosis in self.record.diagnoses.iter().filter(|found| found.part == part.id) {
            if !diagnosis.pictures.is_empty() {
                html.raw("<details>\n<summary>The known mistake beside yours</summary>\n");
                self.places.of_diagnosis(html, diagnosis);
                html.raw("</details>\n");
            }
        }
    }

    fn failed(&self, wanted: impl Fn(CheckId) -> bool) -> Vec<Placed<'a>> {
        let all = self.record.evidence.checks.iter().enumerate();
        let mut found: Vec<Placed> =
            all.filter(|(_, check)| is_failure(check) && wanted(check.id)).collect();
        found.sort_by(|a, b| b.1.error.total_cmp(&a.1.error));
        found
    }

    /// Everything that decided, folded.
    fn evidence(&mut self, html: &mut Html, part: &PartGrade, own: &[Placed<'a>]) {
        html.raw("<details>\n<summary>Evidence");
        if !own.is_empty() {
            html.raw(": ").text(&count(own.len(), "failed check"));
        }
        html.raw("</summary>\n<p>").text(&part.reason).raw("</p>\n");
        decided_by(html, part, &self.record.evidence.checks);
        let shown = &mut self.shown;
        let new: Vec<Placed> =
            own.iter().filter(|check| !shown.contains(&check.0)).copied().collect();
        shown.extend(new.iter().map(|(place, _)| *place));
        checks::articles(html, &new, &self.places);
        html.raw("</details>\n");
    }
}

/// Links to the checks that decided a part.
fn decided_by(html: &mut Html, part: &PartGrade, all: &[Check]) {
    for (index, name) in part.evidence.iter().enumerate() {
        html.raw(if index == 0 { "<p class=\"decided\">Decisions by " } else { ", " });
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
    html.raw(if part.evidence.is_empty() { "" } else { "</p>\n" });
}
