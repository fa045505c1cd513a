//! The pure function from evidence to points.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::rules::{Part, Rules};
use crate::columns;
use crate::evidence::{Check, CheckId, Evidence, Verdict};

/// The check that says whether the source was built; images alone count when it failed.
pub const BUILD: CheckId = CheckId::SubmissionBuild;

/// The reason of a part that a private check decides.
const FOR_THE_INSTRUCTOR: &str = "what its images are worth is for the instructor to decide";

/// The part of a remark that says what images alone earn.
pub const IMAGES_EARN: &str = "; the images alone earn ";

/// The part of remarks and reasons that says that images wait for the instructor.
pub const ONCE_CONFIRMED: &str = " once the instructor confirms";

/// The points of one submission.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grade {
    /// The parts, in the handout's order.
    pub parts: Vec<PartGrade>,
    /// The least that the submission is worth, bonus included.
    pub points: f64,
    /// The most that it may be worth; equal to `points` when everything could be judged.
    pub points_max: f64,
    /// The points of all parts that are no bonus.
    pub out_of: f64,
    /// What the images alone are worth once the instructor confirms them; in neither of the two above.
    #[serde(default)]
    pub unconfirmed: f64,
    /// Gates that are closed, and other remarks on the whole.
    pub remarks: Vec<String>,
}

/// The points of one part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PartGrade {
    /// The handout's number.
    pub id: String,
    /// The handout's title.
    pub title: String,
    /// What it can earn.
    pub out_of: f64,
    /// Whether it is a bonus.
    pub bonus: bool,
    /// The least that it earned.
    pub points: f64,
    /// The most that it may have earned; equal to `points` unless it could not be judged.
    pub points_max: f64,
    /// What the images alone are worth once the instructor confirms them; in neither of the two above.
    #[serde(default)]
    pub unconfirmed: f64,
    /// What decided, in a sentence.
    pub reason: String,
    /// The checks that decided, as `id` or `id @ scene`.
    pub evidence: Vec<String>,
}

impl PartGrade {
    /// Whether nobody tried for it: a bonus that earned nothing.
    pub fn is_unearned(&self) -> bool {
        self.bonus && self.points_max == 0.0
    }

    /// Whether it did not earn everything. A bonus that nobody tried for is nothing lost.
    pub fn is_lost(&self) -> bool {
        self.points < self.out_of && !self.is_unearned()
    }
}

/// What one part is worth, as fractions of its points.
struct PartScore {
    least: f64,
    most: f64,
    unconfirmed: f64,
    reason: String,
    evidence: Vec<String>,
}

/// Grades a submission. Pure: depends only on its arguments, not on the order of the checks.
///
/// A part is worth the lower of what it is worth on public and on held-back scenes; checks without a
/// scene count in both.
pub fn grade(rules: &Rules, evidence: &Evidence) -> Grade {
    grade_settled(rules, &settle(rules, evidence))
}

/// The evidence under the conventions that are worth most: for each path one, the handout's where
/// another is worth no more. What was judged under others is left out.
pub fn settle(rules: &Rules, evidence: &Evidence) -> Evidence {
    let mut settled = evidence.clone();
    for path in rules.paths.keys() {
        let own = |part: &&Part| part.path == *path;
        let ids: BTreeSet<CheckId> =
            rules.parts.iter().filter(own).flat_map(|part| part.evidence.clone()).collect();
        let is_own = |check: &&Check| ids.contains(&check.id);
        let mut conventions: BTreeSet<&str> =
            evidence.checks.iter().filter(is_own).map(|check| check.convention.as_str()).collect();
        conventions.remove("");
        if conventions.is_empty() {
            continue;
        }
        // What was settled before has no checks under the handout's left.
        let judged_under_another = |check: &&Check| !check.convention.is_empty() && is_own(check);
        let hang: BTreeSet<CheckId> =
            evidence.checks.iter().filter(judged_under_another).map(|check| check.id).collect();
        let handouts = |check: &Check| check.convention.is_empty() && hang.contains(&check.id);
        if evidence.checks.iter().any(handouts) {
            conventions.insert("");
        }
        let under = |convention: &str| {
            // A check under this convention stands for the same one under the handout's.
            let stands: BTreeSet<_> = settled
                .checks
                .iter()
                .filter(|check| check.convention == convention)
                .map(|check| (check.id, &check.scene, check.held_back))
                .collect();
            let keep = |check: &&Check| {
                !ids.contains(&check.id)
                    || check.convention == convention
                    || (check.convention.is_empty()
                        && !stands.contains(&(check.id, &check.scene, check.held_back)))
            };
            Evidence { checks: settled.checks.iter().filter(keep).cloned().collect() }
        };
        let worth = |evidence: &Evidence| {
            let grade = grade_settled(rules, evidence);
            let parts = grade.parts.iter().zip(&rules.parts);
            let own = parts.filter(|(_, part)| own(part));
            own.map(|(graded, _)| graded.points_max).sum::<f64>()
        };
        let mut best: Option<(f64, Evidence)> = None;
        for convention in conventions {
            let candidate = under(convention);
            let worth = worth(&candidate);
            if best.as_ref().is_none_or(|(most, _)| worth > *most) {
                best = Some((worth, candidate));
            }
        }
        if let Some((_, evidence)) = best {
            settled = evidence;
        }
    }
    settled
}

/// Grades by evidence of one convention for each path.
fn grade_settled(rules: &Rules, evidence: &Evidence) -> Grade {
    let of = |wanted: &dyn Fn(&Check) -> bool| Evidence {
        checks: evidence.checks.iter().filter(|check| wanted(check)).cloned().collect(),
    };
    let public = grade_together(rules, &of(&|check| !check.held_back));
    if !evidence.checks.iter().any(|check| check.held_back) {
        return public;
    }
    let held_back = of(&|check| check.held_back || check.scene.is_empty());
    lower(public, grade_together(rules, &held_back))
}

/// The lower of two grades, part by part; what decided is the first's where both are equal.
fn lower(first: Grade, second: Grade) -> Grade {
    let parts = first.parts.into_iter().zip(second.parts).map(|(first, second)| {
        let points = first.points.min(second.points);
        let points_max = first.points_max.min(second.points_max);
        let worth = |part: &PartGrade| (part.points, part.points_max);
        // No image of a held-back scene is submitted.
        let unconfirmed = first.unconfirmed;
        // A reason that everybody may read comes first.
        let public = first.points_max < first.out_of;
        let decides = if worth(&second) < worth(&first) && !public { second } else { first };
        PartGrade { points, points_max, unconfirmed, ..decides }
    });
    let mut remarks = first.remarks;
    for remark in second.remarks {
        if !remarks.contains(&remark) {
            remarks.push(remark);
        }
    }
    sum(parts.collect(), first.out_of, remarks)
}

/// The grade of parts.
fn sum(parts: Vec<PartGrade>, out_of: f64, remarks: Vec<String>) -> Grade {
    Grade {
        points: round(parts.iter().map(|part| part.points).sum()),
        points_max: round(parts.iter().map(|part| part.points_max).sum()),
        unconfirmed: round(parts.iter().map(|part| part.unconfirmed).sum()),
        out_of,
        remarks,
        parts,
    }
}

/// Grades by all of the evidence, the worst scene counting wherever it is from.
fn grade_together(rules: &Rules, evidence: &Evidence) -> Grade {
    let built = evidence.named(BUILD).all(|check| check.verdict == Verdict::Pass);
    let mut worths: Vec<PartScore> =
        rules
            .parts
            .iter()
            .map(|part| {
                if built {
                    by_code(rules, evidence, part)
                } else {
                    by_images(rules, evidence, part)
                }
            })
            .collect();
    if built {
        charge_unexplained(rules, evidence, &mut worths);
    }
    let mut remarks = Vec::new();
    let ceiling = ceiling(rules, evidence);
    for gate in &rules.gates {
        let failed = |check: &&Check| check.verdict == Verdict::Fail;
        let hints = evidence.named(gate.check).filter(failed).map(|check| &check.hint);
        if let Some(hint) = hints.min() {
            remarks.push(if gate.private || hint.is_empty() {
                gate.reason.clone()
            } else {
                format!("{}: {hint}", gate.reason)
            });
        }
    }
    if !built {
        remarks.extend(without_code(rules, evidence, &worths, ceiling));
    }
    let not_run = |check: &&Check| check.verdict == Verdict::NotRun;
    if let Some(check) = evidence.checks.iter().filter(not_run).min_by_key(|check| check.name()) {
        let count = evidence.checks.iter().filter(not_run).count();
        remarks.push(format!(
            "ungraded in part, by the machine's fault: {count} of the checks, the first {}: {}; grade \
             it again",
            check.name(),
            check.summary
        ));
    }
    let parts: Vec<PartGrade> = rules
        .parts
        .iter()
        .zip(worths)
        .map(|(part, worth)| PartGrade {
            id: part.id.clone(),
            title: part.title.clone(),
            out_of: part.points,
            bonus: part.bonus,
            points: round(part.points * worth.least * ceiling),
            points_max: round(part.points * worth.most * ceiling),
            unconfirmed: round(part.points * worth.unconfirmed * ceiling),
            reason: worth.reason,
            evidence: worth.evidence,
        })
        .collect();
    sum(parts, rules.total_points(), remarks)
}

/// The share of the points that closed gates leave.
pub fn ceiling(rules: &Rules, evidence: &Evidence) -> f64 {
    let failed = |check: &Check| check.verdict == Verdict::Fail;
    let closed = rules.gates.iter().filter(|gate| evidence.named(gate.check).any(failed));
    closed.map(|gate| gate.ceiling).fold(1.0, f64::min)
}

impl Grade {
    /// Sets a part to some points, and sums up again.
    pub fn set_part(&mut self, id: &str, points: f64) {
        for part in self.parts.iter_mut().filter(|part| part.id == id) {
            (part.points, part.points_max, part.unconfirmed) = (points, points, 0.0);
        }
        let Self { parts, out_of, remarks, .. } = std::mem::take(self);
        *self = sum(parts, out_of, remarks);
    }
}

/// Points are published with two digits.
fn round(points: f64) -> f64 {
    (points * 100.0).round() / 100.0
}

/// A part of a submission that builds.
fn by_code(rules: &Rules, evidence: &Evidence, part: &Part) -> PartScore {
    if let Some(path) = rules.paths.get(&part.path) {
        let mut proof = evidence.named(path.proof).peekable();
        if proof.peek().is_some() && proof.all(|check| check.verdict == Verdict::Pass) {
            let own = |id: &&CheckId| part.evidence.contains(id);
            let unseen: Vec<CheckId> = path.unseen.iter().filter(own).copied().collect();
            let unseen = by_checks(rules, evidence, &unseen, part.any_scene);
            if let Some(worth) = unseen.filter(|worth| worth.least < 1.0) {
                return worth;
            }
            return in_full(
                format!("the {} images are right on every scene", part.path),
                path.proof,
            );
        }
    }
    if let Some(proof) = part.proof {
        let passed = |check: &Check| check.verdict == Verdict::Pass;
        let says_nothing = |check: &Check| check.verdict == Verdict::NotJudged;
        let mut checks = evidence.named(proof);
        let mut once = evidence.named(proof);
        if checks.all(|check| passed(check) || says_nothing(check)) && once.any(passed) {
            return in_full("what it draws is right on every scene".to_owned(), proof);
        }
    }
    by_checks(rules, evidence, &part.evidence, part.any_scene)
        .or_else(|| by_checks(rules, evidence, &part.fallback, part.any_scene))
        .unwrap_or_else(|| unjudged(evidence, part))
}

/// A part that the end result proves.
fn in_full(reason: String, proof: CheckId) -> PartScore {
    PartScore { least: 1.0, most: 1.0, unconfirmed: 0.0, reason, evidence: vec![proof.to_string()] }
}

/// A part of a submission without code to judge: nothing, until the instructor confirms what the images show.
fn by_images(rules: &Rules, evidence: &Evidence, part: &Part) -> PartScore {
    let nothing = |reason: String, evidence| PartScore {
        least: 0.0,
        most: 0.0,
        unconfirmed: 0.0,
        reason,
        evidence,
    };
    let Some(shown) = by_checks(rules, evidence, &part.images_only, part.any_scene) else {
        return nothing(
            "there is no code to judge, and no image shows this part".into(),
            Vec::new(),
        );
    };
    let trust = rules.images_only_trust.as_ref().filter(|trust| {
        let mut checks = evidence.named(trust.check).peekable();
        part.images_only.contains(&trust.check)
            && checks.peek().is_some()
            && checks.all(|check| check.verdict == Verdict::Pass)
    });
    let unconfirmed = shown.least * trust.map_or(rules.images_only_ceiling, |trust| trust.ceiling);
    let points = round(part.points * unconfirmed);
    let reason = if points == 0.0 {
        shown.reason
    } else if trust.is_some() {
        format!(
            "{points}{ONCE_CONFIRMED}: there is no code to judge, but an image with the noise of \
             the student's number: {}",
            shown.reason
        )
    } else {
        format!(
            "{points}{ONCE_CONFIRMED}: there is no code to judge, only an image, which anybody's \
             program may have drawn: {}",
            shown.reason
        )
    };
    PartScore { unconfirmed, ..nothing(reason, shown.evidence) }
}

/// Why there is no code to judge, and what is worth something all the same.
fn without_code(
    rules: &Rules,
    evidence: &Evidence,
    worths: &[PartScore],
    ceiling: f64,
) -> Option<String> {
    let failed = |check: &&Check| check.verdict != Verdict::Pass;
    let why = evidence.named(BUILD).filter(failed).map(|check| &check.summary).min()?;
    let parts = rules.parts.iter().zip(worths);
    let unconfirmed = parts.map(|(part, worth)| round(part.points * worth.unconfirmed * ceiling));
    let unconfirmed = round(unconfirmed.sum());
    Some(if unconfirmed == 0.0 {
        why.clone()
    } else {
        format!("{why}{IMAGES_EARN}{}{ONCE_CONFIRMED}", columns::points(unconfirmed))
    })
}

/// What the checks named `ids` say together: the worst counts, or the best where any scene will
/// do. `None` when none of them judges.
fn by_checks(
    rules: &Rules,
    evidence: &Evidence,
    ids: &[CheckId],
    any_scene: bool,
) -> Option<PartScore> {
    let judging = |check: &&Check| {
        matches!(check.verdict, Verdict::Pass | Verdict::Fail | Verdict::NotImplemented)
    };
    let checks: Vec<&Check> = ids.iter().flat_map(|id| evidence.named(*id)).collect();
    if checks.iter().any(|check| check.verdict == Verdict::NotRun) {
        return None;
    }
    let judged: Vec<&Check> = checks.into_iter().filter(judging).collect();
    // Ties are broken by the words, so that the order of the checks does not matter.
    let order = |a: &&Check, b: &&Check| {
        let (fa, fb) = (fraction(rules, a), fraction(rules, b));
        let words = |check: &Check| (check.name(), check.said().into_owned());
        fa.total_cmp(&fb).then_with(|| words(b).cmp(&words(a)))
    };
    let of = |id: CheckId| judged.iter().copied().filter(|check| check.id == id).collect();
    let deciding = ids.iter().filter_map(|&id| {
        let checks: Vec<&Check> = of(id);
        if any_scene { checks.into_iter().max_by(order) } else { checks.into_iter().min_by(order) }
    });
    let deciding = deciding.min_by(order)?;
    let least = fraction(rules, deciding);
    let mut evidence: Vec<String> = judged
        .iter()
        .filter(|check| check.verdict != Verdict::Pass || least == 1.0)
        .map(|check| check.name())
        .collect();
    evidence.sort();
    evidence.dedup();
    let reason = match deciding.verdict {
        // Students read the reasons of their parts.
        Verdict::Fail if rules.is_private(deciding.id) => FOR_THE_INSTRUCTOR.to_owned(),
        _ => deciding.said().into_owned(),
    };
    Some(PartScore { least, most: least, unconfirmed: 0.0, reason, evidence })
}

fn unjudged(evidence: &Evidence, part: &Part) -> PartScore {
    let ids = part.evidence.iter().chain(&part.fallback);
    let checks: Vec<&Check> = ids.flat_map(|id| evidence.named(*id)).collect();
    let silent = checks.iter().map(|check| check.said()).min();
    // Only what the machine could not ask is a range: the rest is the submission's own.
    let open = checks.is_empty() || checks.iter().any(|check| check.verdict == Verdict::NotRun);
    PartScore {
        least: 0.0,
        most: if open { 1.0 } else { 0.0 },
        unconfirmed: 0.0,
        reason: match silent {
            Some(why) => format!("could not be judged: {why}"),
            None => "could not be judged: no evidence was collected".into(),
        },
        evidence: Vec::new(),
    }
}

/// A wrong image that no part explains is paid by the path's `residual_part`.
fn charge_unexplained(rules: &Rules, evidence: &Evidence, worths: &mut [PartScore]) {
    for (name, path) in &rules.paths {
        let failed = evidence.named(path.proof).filter(|check| check.verdict == Verdict::Fail);
        let worst = failed.min_by(|a, b| {
            let (fa, fb) = (fraction(rules, a), fraction(rules, b));
            fa.total_cmp(&fb).then_with(|| (&a.scene, a.said()).cmp(&(&b.scene, b.said())))
        });
        let Some(worst) = worst else { continue };
        let own = |part: &Part| part.path == *name && !part.bonus;
        let explained = rules
            .parts
            .iter()
            .zip(worths.iter())
            .any(|(part, worth)| own(part) && worth.least < 1.0);
        if explained {
            continue;
        }
        for (part, worth) in rules.parts.iter().zip(worths.iter_mut()) {
            if part.id == path.residual_part {
                worth.least = fraction(rules, worst);
                worth.most = worth.least;
                worth.reason = format!("every part alone is right, but {}", worst.said());
                worth.evidence = vec![worst.name()];
            }
        }
    }
}

/// The fraction of points that a check leaves.
fn fraction(rules: &Rules, check: &Check) -> f64 {
    match check.verdict {
        Verdict::Pass => 1.0,
        Verdict::Fail => 1.0 - check.weight * (1.0 - rules.curve.fraction(check.error)),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests;
