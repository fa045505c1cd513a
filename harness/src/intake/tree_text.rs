//! A validation as text: the expected tree beside the found one, then what to do.

use std::fmt::Write;

use super::finding::{Finding, Severity};
use super::tree_match::{Mark, TreeLine};
use super::validate::Validation;

/// Lines of the tree that are printed; a wrong folder may hold thousands.
const SHOWN: usize = 60;

impl Validation {
    /// The whole validation as text for a terminal, without colours.
    pub fn to_text(&self) -> String {
        let mut out = String::new();
        let verdict = if self.conforms { "conforms" } else { "does not conform" };
        let count = |severity| self.findings.iter().filter(|f| f.severity == severity).count();
        let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{}: {verdict} ({}, {})",
            self.name,
            plural(errors, "error"),
            plural(warnings, "warning")
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

fn plural(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

fn write_tree(out: &mut String, lines: &[TreeLine]) {
    let rows: Vec<[String; 3]> = lines.iter().take(SHOWN).map(row).collect();
    let header = ["expected", "found", ""].map(str::to_owned);
    let width = |column: usize| {
        rows.iter().chain([&header]).map(|row| row[column].chars().count()).max().unwrap_or(0)
    };
    let (left, middle) = (width(0), width(1));
    let _ = writeln!(out);
    for [expected, found, mark] in std::iter::once(&header).chain(&rows) {
        let line = format!("  {expected:<left$}  {found:<middle$}  {mark}");
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
    if let Some(hint) = &finding.hint {
        let _ = writeln!(out, "  hint: {hint}");
    }
}
