//! One row of the matrix: what one renderer lost, and whether that is what the catalogue says.

use umbra::assignment::Assignment;
use umbra::evidence::{Evidence, Verdict};
use umbra::rubric::Grade;

use super::choice::Subject;

/// What one renderer lost.
pub struct Row {
    name: String,
    grade: Grade,
    /// The parts in which it must lose points.
    declared: Vec<String>,
    /// Findings that it must lead to and did not.
    unfound: Vec<String>,
    seconds: f64,
}

impl Row {
    /// Compares a grade with what was declared.
    pub fn new(subject: &Subject, grade: Grade, evidence: &Evidence, seconds: f64) -> Self {
        let found = |id: &&String| evidence.named(id).any(|check| check.verdict == Verdict::Fail);
        let unfound = subject.findings.iter().filter(|id| !found(id)).cloned().collect();
        Self { name: subject.name(), grade, declared: subject.parts.clone(), unfound, seconds }
    }

    /// Whether it lost points in every part that it declares, in no other, and all was judged.
    pub fn as_declared(&self) -> bool {
        self.complaint().is_empty()
    }

    /// What differs from the declaration; empty when nothing does.
    fn complaint(&self) -> String {
        let mut complaints = Vec::new();
        for part in &self.grade.parts {
            let declared = self.declared.contains(&part.id);
            if part.points_max < part.out_of && !declared {
                complaints.push(format!("{} loses {:.2} ({})", part.id, part.out_of - part.points_max, part.reason));
            } else if part.points_max == part.out_of && declared {
                complaints.push(format!("{} loses nothing ({})", part.id, part.reason));
            } else if part.points < part.points_max {
                complaints.push(format!("{} is not judged ({})", part.id, part.reason));
            }
        }
        complaints.extend(self.unfound.iter().map(|id| format!("{id} finds nothing")));
        complaints.join("; ")
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
        let verdict = if self.as_declared() { "" } else { "  WRONG" };
        let line = format!("{:<56}{}  {:4.1} s{verdict}", self.name, cells.collect::<String>(), self.seconds);
        println!("{line}");
        if explain {
            for part in self.grade.parts.iter().filter(|part| part.points < part.out_of) {
                println!("    {}: {} [{}]", part.id, part.reason, part.evidence.join(", "));
            }
        }
    }
}

/// Prints what the columns are.
pub fn print_header(assignment: &Assignment) {
    let parts = assignment.rules.parts.iter().map(|part| format!("{:>5}", part.id));
    println!("{:<56}{}", "points left, . for all", parts.collect::<String>());
}

/// Everything that differs from the declarations, one line each.
pub fn complaints<'a>(rows: impl Iterator<Item = &'a Row>) -> String {
    let wrong = rows.filter(|row| !row.as_declared());
    wrong.map(|row| format!("{}: {}", row.name, row.complaint())).collect::<Vec<_>>().join("\n")
}
