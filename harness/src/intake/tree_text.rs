//! A validation as text: the expected tree beside the found one, then what to do.

use std::fmt::Write;

use unicode_width::UnicodeWidthStr;

use super::finding::{Finding, Severity};
use super::tree_match::{Mark, TreeLine};
use super::validate::Validation;
use crate::columns::{count, left};

/// Lines of the tree that are printed; a wrong folder may hold thousands.
const SHOWN: usize = 60;

impl Validation {
    /// The whole validation as text for a terminal, without colors.
    pub fn to_text(&self) -> String {
        let mut out = String::new();
        let verdict = if self.conforms { "conforms" } else { "does not conform" };
        let of = |severity| self.findings.iter().filter(|f| f.severity == severity).count();
        let (errors, warnings) = (of(Severity::Error), of(Severity::Warning));
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{}: {verdict} ({}, {})",
            self.name,
            count(errors, "error"),
            count(warnings, "warning")
        );
        if !self.tree.is_empty() {
            write_tree(&mut out, &self.tree);
        }
        for severity in [Severity::Error, Severity::Warning, Severity::Note] {
            for finding in self.findings.iter().filter(|f| f.severity == severity) {
                write_finding(&mut out, finding);
            }
        }
        out
    }
}

fn write_tree(out: &mut String, lines: &[TreeLine]) {
    let rows: Vec<[String; 3]> = lines.iter().take(SHOWN).map(row).collect();
    let header = ["expected", "found", ""].map(str::to_owned);
    let width = |column: usize| {
        rows.iter().chain([&header]).map(|row| row[column].width()).max().unwrap_or(0)
    };
    let (first, second) = (width(0), width(1));
    let _ = writeln!(out);
    for [expected, found, mark] in std::iter::once(&header).chain(&rows) {
        let line = format!("  {}  {}  {mark}", left(expected, first), left(found, second));
        let _ = writeln!(out, "{}", line.trim_end());
    }
    if lines.len() > SHOWN {
        let _ = writeln!(out, "  ... and {} more", lines.len() - SHOWN);
    }
}

fn row(line: &TreeLine) -> [String; 3] {
    let mark = match line.mark {
        Mark::Ok | Mark::Absent => "ok",
        Mark::Missing => "missing",
        Mark::WrongPlace => "wrong place",
        Mark::Unexpected => "unexpected",
    };
    let mark =
        if line.advice.is_empty() { mark.to_owned() } else { format!("{mark}: {}", line.advice) };
    let shown = |path: &Option<String>| path.clone().unwrap_or_else(|| "-".to_owned());
    [shown(&line.expected), shown(&line.found), mark]
}

fn write_finding(out: &mut String, finding: &Finding) {
    let place = match (&finding.path, finding.line) {
        (Some(path), Some(line)) => format!("{path}:{line}: "),
        (Some(path), None) => format!("{path}: "),
        _ => String::new(),
    };
    let _ = writeln!(out, "\n{}: {place}{}", finding.severity, finding.message);
    if let Some(excerpt) = &finding.excerpt {
        let number = finding.line.unwrap_or_default().to_string();
        let gap = " ".repeat(number.len());
        let _ = writeln!(out, "  {number} | {}", excerpt.text);
        let _ = writeln!(out, "  {gap} | {}^", " ".repeat(excerpt.caret));
    }
    if let Some(hint) = &finding.hint {
        let _ = writeln!(out, "  hint: {hint}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_stand_below_each_other_in_every_script() {
        let lines = ["山田.exr", "e\u{301}tude.exr", "a.exr"].map(|found| TreeLine {
            expected: None,
            found: Some(found.to_owned()),
            mark: Mark::Unexpected,
            advice: String::new(),
        });
        let mut out = String::new();
        write_tree(&mut out, &lines);
        let places: Vec<_> =
            out.split("unexpected\n").map(|line| line.lines().last().map(str::width)).collect();
        assert_eq!(places[..3], [places[0]; 3], "{out}");
        assert!(places[0] > Some(8), "{out}");
    }
}
