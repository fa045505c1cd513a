//! One row of the matrix: what one renderer lost, and whether that is what the catalogue says.

use umbra::assignment::Assignment;
use umbra::diagnosis::Diagnosis;
use umbra::evidence::{Check, Evidence, Measure, Verdict};
use umbra::rubric::Grade;

use super::choice::Subject;

/// What one renderer lost, and by which evidence.
pub struct Row {
    /// Which renderer, and what it must lose.
    pub subject: Subject,
    /// Whether the scenes show every mistake.
    pub all_shown: bool,
    /// What was found out about it.
    pub evidence: Evidence,
    /// What it looks like.
    pub diagnoses: Vec<Diagnosis>,
    /// What it earned by the assignment's rules.
    pub grade: Grade,
    /// Wall-clock seconds that it took.
    pub seconds: f64,
}

impl Row {
    /// Whether it lost points in every part that it declares where the scenes show them all, in no
    /// other, and all was judged.
    pub fn as_declared(&self) -> bool {
        self.complaint().is_empty()
    }

    /// What differs from the declaration; empty when nothing does.
    pub fn complaint(&self) -> String {
        let mut complaints = Vec::new();
        for part in &self.grade.parts {
            let declared = self.subject.parts.contains(&part.id);
            if part.points_max < part.out_of && !declared {
                complaints.push(format!(
                    "{} loses {:.2} ({})",
                    part.id,
                    part.out_of - part.points_max,
                    part.reason
                ));
            } else if part.points_max == part.out_of && declared && self.all_shown {
                complaints.push(format!("{} loses nothing ({})", part.id, part.reason));
            } else if part.points < part.points_max {
                complaints.push(format!("{} is not judged ({})", part.id, part.reason));
            }
        }
        let fails = |check: &Check| check.verdict == Verdict::Fail;
        let declared = self.subject.findings.iter().filter(|_| self.all_shown);
        let unfound = declared.filter(|id| !self.evidence.named(**id).any(fails));
        complaints.extend(unfound.map(|id| format!("{id} finds nothing")));
        complaints.join("; ")
    }

    /// Whether the diagnosis says all there is to say: a single mistake by its name in some part, a
    /// right renderer by silence; and nothing else.
    pub fn well_diagnosed(&self) -> bool {
        let names = &self.subject.mistakes;
        let right = self.subject.parts.is_empty() && self.subject.findings.is_empty();
        // A finding, such as a seed that makes no difference, belongs to no part.
        let of_parts = || self.diagnoses.iter().filter(|found| !found.part.is_empty());
        if right {
            return of_parts().count() == 0;
        }
        // What is fitted is said in words of its own.
        let fitted = of_parts().any(|found| found.mistakes.is_empty() && found.factor.is_none());
        let said = |found: &Diagnosis| {
            let named = |alike: &Vec<String>| alike.iter().any(|name| names.contains(name));
            found.factor.is_none() && found.mistakes.iter().all(named)
        };
        let is_mentioned = |name: &String| {
            let found = self.diagnoses.iter().flat_map(|found| found.mistakes.iter().flatten());
            found.into_iter().any(|known| known == name)
        };
        let mentioned = fitted || names.iter().all(is_mentioned);
        self.diagnoses.iter().all(said) && mentioned
    }

    /// The diagnosis in one line.
    pub fn said(&self) -> String {
        let each = self.diagnoses.iter().map(|found| format!("{} {}", found.part, found.words));
        let said = each.collect::<Vec<_>>().join(" | ");
        let said = if said.is_empty() { "nothing" } else { &said };
        format!("{} looks like: {said}", self.subject.name())
    }

    /// Prints it: the points of each part, `.` for all of them.
    pub fn print(&self, explain: bool) {
        let cells = self.grade.parts.iter().map(|part| {
            let cell = match (part.points == part.out_of, part.points < part.points_max) {
                (_, true) => "?".to_owned(),
                (true, _) => ".".to_owned(),
                _ => format!("{:.1}", part.points),
            };
            format!("{cell:>5}")
        });
        let verdict =
            if self.subject.judged_alone() && !self.as_declared() { "  WRONG" } else { "" };
        let line = format!(
            "{:<56}{}  {:4.1} s{verdict}",
            self.subject.name(),
            cells.collect::<String>(),
            self.seconds
        );
        println!("{line}");
        if explain {
            for part in self.grade.parts.iter().filter(|part| part.points < part.out_of) {
                println!("    {}: {} [{}]", part.id, part.reason, part.evidence.join(", "));
                let checks = self.evidence.checks.iter();
                for check in checks.filter(|check| part.evidence.contains(&check.name())) {
                    let values = check.measures.iter().filter(|m| !m.passed || m.rule.is_none());
                    let rule = |m: &Measure| m.rule.map_or("", |rule| rule.name());
                    let values = values.map(|m| format!("{} {:.4} ({})", rule(m), m.value, m.name));
                    let values = values.collect::<Vec<_>>().join("; ");
                    println!("        {} error {:.4}: {values}", check.name(), check.error);
                }
            }
            for found in &self.diagnoses {
                let (words, left, next) = (&found.words, found.unexplained, found.runner_up);
                println!(
                    "    {} looks like: {words} (leaves {left:.3}, next {next:.3})",
                    found.part
                );
            }
        }
    }
}

/// Prints what the columns are.
pub fn print_header(assignment: &Assignment) {
    let parts = assignment.rules.parts.iter().map(|part| format!("{:>5}", part.id));
    println!("{:<56}{}", "points left, . for all", parts.collect::<String>());
}
