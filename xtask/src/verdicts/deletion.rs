//! Every rule is needed: without it some row of the matrix is not what the catalogue says.

use umbra::rubric::{self, EvidenceRule, Rules};

use super::figures::{Figure, Matrix};
use super::row::Row;

/// Deletes every rule in turn, prints what that changes, and complains of rules that change nothing.
/// Rules that only archives can break are proved by the samples.
pub fn figure(matrix: &Matrix, rules: &Rules) -> Figure {
    let all = EvidenceRule::all(rules);
    let all: Vec<&EvidenceRule> = all.iter().filter(|rule| !rule.is_of_hand_ins()).collect();
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
