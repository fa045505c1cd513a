//! Proves that every rule is needed: without it, some row of the matrix is not what the catalogue says.

use std::collections::BTreeSet;
use std::fmt;

use umbra::evidence::{CheckId, Evidence, Measure, RuleId, Verdict};
use umbra::rubric::{self, Rules};

use super::figures::{Figure, Matrix};
use super::row::Row;

/// Deletes every rule in turn, prints what that changes, and complains of rules that change nothing.
/// Rules that only archives can break are proved by the samples.
pub fn figure(matrix: &Matrix, rules: &Rules) -> Figure {
    let all = EvidenceRule::all(rules);
    let all: Vec<&EvidenceRule> = all.iter().filter(|rule| !rule.is_of_submissions()).collect();
    let mut complaints = Vec::new();
    for rule in &all {
        let rows = matrix.variants.iter().chain(&matrix.singles).chain(&matrix.pairs);
        let wrong: Vec<String> = rows.filter_map(|row| without(rule, rules, row)).collect();
        match wrong.first() {
            None => complaints.push(format!("without {rule} every verdict is the same")),
            Some(first) => println!("without {rule}: {} rows are wrong: {first}", wrong.len()),
        }
    }
    Figure::right("rules", all.len(), complaints)
}

/// What is wrong with a row that was right, once the rule is gone.
fn without(rule: &EvidenceRule, rules: &Rules, row: &Row) -> Option<String> {
    if !row.as_declared() {
        return None;
    }
    let (rules, evidence) = rule.delete(rules, &row.evidence);
    let grade = rubric::grade(&rules, &evidence);
    let (subject, diagnoses) = (row.subject.clone(), Vec::new());
    let again = Row { subject, all_shown: row.all_shown, evidence, diagnoses, grade, seconds: 0.0 };
    let complaint = again.complaint();
    (!complaint.is_empty()).then(|| format!("{}: {complaint}", again.subject.name()))
}

/// A rule that decides, to be deleted.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum EvidenceRule {
    /// All checks of this name: evidence of a part, its fallback, a proof, a gate.
    Check(CheckId),
    /// What judges inside checks.
    Measure(RuleId),
    /// The path's `residual_part` pays for unexplained errors.
    Residual(String),
}

impl EvidenceRule {
    /// Every rule that the rubric and the checks know.
    fn all(rules: &Rules) -> BTreeSet<Self> {
        let parts = rules.parts.iter();
        let named = parts.flat_map(|part| [&part.evidence, &part.fallback, &part.images_only]);
        let checks = named.flatten().chain(rules.gates.iter().map(|gate| &gate.check));
        let checks = checks.chain(rules.paths.values().map(|path| &path.proof));
        let residuals = rules.paths.keys().map(|path| Self::Residual(path.clone()));
        let measures = RuleId::ALL.iter().map(|rule| Self::Measure(*rule));
        checks.map(|id| Self::Check(*id)).chain(residuals).chain(measures).collect()
    }

    /// Whether only a submission can break it: by its tree or its images.
    fn is_of_submissions(&self) -> bool {
        match self {
            Self::Check(id) => {
                id.name().starts_with("submission.") || id.name().starts_with("submitted.")
            }
            Self::Measure(rule) => *rule == RuleId::ImageSize,
            Self::Residual(_) => false,
        }
    }

    /// Rubric and evidence as they would be without this rule, with no new requests. A check that failed by this rule
    /// alone passes.
    fn delete(&self, rules: &Rules, evidence: &Evidence) -> (Rules, Evidence) {
        let (mut rules, mut evidence) = (rules.clone(), evidence.clone());
        match self {
            Self::Check(id) => evidence.checks.retain(|check| check.id != *id),
            Self::Measure(rule) => {
                let failed = evidence.checks.iter_mut().filter(|c| c.verdict == Verdict::Fail);
                for check in failed {
                    let broken = |m: &&mut Measure| !m.passed && m.rule.is_some();
                    let mut broken = check.measures.iter_mut().filter(broken).peekable();
                    if broken.peek().is_some() && broken.all(|measure| measure.rule == Some(*rule))
                    {
                        (check.verdict, check.error) = (Verdict::Pass, 0.0);
                    }
                }
            }
            Self::Residual(path) => {
                if let Some(path) = rules.paths.get_mut(path) {
                    path.residual_part.clear();
                }
            }
        }
        (rules, evidence)
    }
}

impl fmt::Display for EvidenceRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Check(id) => write!(f, "the check {id}"),
            Self::Measure(rule) => write!(f, "the rule {rule}"),
            Self::Residual(path) => write!(f, "the residual part of path {path}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use umbra::assignment::Assignment;
    use umbra::evidence::Check;
    use umbra::rubric::{BUILD, grade};

    use super::*;

    fn rules() -> Rules {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        Assignment::load(root).unwrap().rules
    }

    /// What a submission is worth, and what an instructor is told.
    fn worth(rules: &Rules, evidence: &Evidence) -> (f64, f64, f64, Vec<String>) {
        let mut grade = grade(rules, evidence);
        grade.remarks.extend(grade.parts.into_iter().map(|part| part.reason));
        (grade.points, grade.points_max, grade.unconfirmed, grade.remarks)
    }

    /// What only a submission can break: images without a source, a tree, an image's size, a crash.
    #[test]
    fn every_rule_of_submissions_is_needed() {
        let rules = rules();
        let all = EvidenceRule::all(&rules);
        let pass = |id: CheckId| Check::new(id, "teapot", Verdict::Pass, "right");
        let images = rules.parts.iter().flat_map(|part| &part.images_only);
        let gates = rules.gates.iter().map(|gate| &gate.check);
        let images: BTreeSet<CheckId> = images.chain(gates).copied().collect();
        let mut right: Vec<Check> = images.iter().map(|id| pass(*id)).collect();
        right.push(Check::new(BUILD, "", Verdict::Fail, "does not build"));
        let mut other_size = right.clone();
        for check in other_size.iter_mut().filter(|check| check.id != BUILD) {
            check.verdict = Verdict::Fail;
            check.measures = vec![Measure::at_most(RuleId::ImageSize, "is 2x4", 1.0, 0.0)];
        }
        // Wrong in one respect alone.
        let but = |id: &CheckId| {
            let mut checks = right.clone();
            let own = checks.iter_mut().filter(|check| check.id == *id);
            own.for_each(|check| (check.verdict, check.error) = (Verdict::Fail, 1.0));
            checks
        };
        let mut submissions: Vec<Vec<Check>> = images.iter().map(but).collect();
        submissions.push(other_size);
        let submissions: Vec<_> =
            submissions.into_iter().map(|checks| Evidence { checks }).collect();
        let mut counted = 0;
        for rule in all.iter().filter(|rule| rule.is_of_submissions()) {
            counted += 1;
            let changes = submissions.iter().any(|evidence| {
                let (less, rest) = rule.delete(&rules, evidence);
                worth(&less, &rest) != worth(&rules, evidence)
            });
            assert!(changes, "without {rule} nothing changes");
        }
        assert!(counted >= 9, "{counted}");
    }

    #[test]
    fn a_check_that_failed_by_one_rule_alone_passes_without_it() {
        let rules = rules();
        let mut check = Check::new(CheckId::ImageOffline, "cbox", Verdict::Fail, "wrong");
        let broken = |rule| Measure::at_most(rule, "", 2.0, 1.0);
        check.measures =
            vec![broken(RuleId::ImageBlob), Measure::at_most(RuleId::ImageEdge, "", 0.0, 1.0)];
        let verdict = |check: &Check, rule| {
            let evidence = Evidence { checks: vec![check.clone()] };
            EvidenceRule::Measure(rule).delete(&rules, &evidence).1.checks[0].verdict
        };
        assert_eq!(verdict(&check, RuleId::ImageBlob), Verdict::Pass);
        assert_eq!(verdict(&check, RuleId::ImageEdge), Verdict::Fail);
        check.measures.push(broken(RuleId::ImageBias));
        assert_eq!(verdict(&check, RuleId::ImageBlob), Verdict::Fail);
        // What failed without a measure (a crash) is no rule's matter.
        check.measures.clear();
        assert_eq!(verdict(&check, RuleId::ImageBlob), Verdict::Fail);
    }
}
