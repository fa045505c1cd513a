//! A finding: one thing to say about a submission, with its place and what to do about it.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use unicode_width::UnicodeWidthStr as _;

use crate::harmless::reorders;

/// How much a finding weighs.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The submission is refused, or does not conform.
    Error,
    /// Somebody should look, but nothing is refused.
    Warning,
    /// Said for completeness.
    Note,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Note => "note",
        })
    }
}

/// One thing to say about a submission.
///
/// Text in `path`, `message` and `hint` holds no control and no bidirectional override characters.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Finding {
    /// How much it weighs.
    pub severity: Severity,
    /// A stable name such as `zip_encrypted`, for tests and tables.
    pub code: String,
    /// The entry or file it is about, as the archive or folder names it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub path: Option<String>,
    /// Line in that file, from 1.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub line: Option<u32>,
    /// What is the fault: expected and found.
    pub message: String,
    /// The place on the line.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub excerpt: Option<Box<Excerpt>>,
    /// What to do about it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub hint: Option<String>,
}

/// A line, or what stands around a place of a long one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Excerpt {
    /// The text, without control characters.
    pub text: String,
    /// Columns of the text before the place.
    pub caret: usize,
}

impl Finding {
    fn new(severity: Severity, code: &str, message: impl Into<String>) -> Self {
        Self {
            severity,
            code: code.to_owned(),
            path: None,
            line: None,
            message: message.into(),
            excerpt: None,
            hint: None,
        }
    }

    /// A finding that refuses the submission or keeps it from conforming.
    pub fn error(code: &str, message: impl Into<String>) -> Self {
        Self::new(Severity::Error, code, message)
    }

    /// A finding that somebody should look at.
    pub fn warning(code: &str, message: impl Into<String>) -> Self {
        Self::new(Severity::Warning, code, message)
    }

    /// A finding said for completeness.
    pub fn note(code: &str, message: impl Into<String>) -> Self {
        Self::new(Severity::Note, code, message)
    }

    /// Whether it says that the configuration lies under another name, where it is read all the same.
    pub fn is_misplaced_config(&self) -> bool {
        self.code == "tree_wrong_place" && self.severity == Severity::Warning
    }

    /// Names the entry or file.
    #[must_use]
    pub fn at(mut self, path: impl Into<String>) -> Self {
        self.path = Some(path.into());
        self
    }

    /// Names the line, from 1.
    #[must_use]
    pub fn on_line(mut self, line: u32) -> Self {
        self.line = Some(line);
        self
    }

    /// Shows the place on its line: `column` counts characters from 0.
    #[must_use]
    pub(super) fn showing(mut self, line: &str, column: usize) -> Self {
        /// Characters of a long line that are shown before and after the place.
        const AROUND: usize = 50;
        let visible = |c: char| if c.is_control() || reorders(c) { ' ' } else { c };
        let is_long = line.chars().nth(2 * AROUND).is_some();
        let begin = if is_long { column.saturating_sub(AROUND) } else { 0 };
        let shown: String =
            line.chars().skip(begin).take(2 * AROUND).map(visible).collect::<String>();
        let before: String = shown.chars().take(column - begin).collect();
        let text = shown.trim_end().to_owned();
        self.excerpt = Some(Box::new(Excerpt { text, caret: before.width() }));
        self
    }

    /// Says what to do.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

/// `error: config.json:3: studentID is empty (hint: write your student number)`
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.severity)?;
        if let Some(path) = &self.path {
            write!(f, "{path}:")?;
            if let Some(line) = self.line {
                write!(f, "{line}:")?;
            }
            f.write_str(" ")?;
        }
        f.write_str(&self.message)?;
        if let Some(hint) = &self.hint {
            write!(f, " (hint: {hint})")?;
        }
        Ok(())
    }
}

/// Collects findings and keeps at most [`Findings::KEPT`] of each severity, so that an archive
/// with a hundred thousand bad entries has a readable answer.
#[derive(Debug, Default)]
pub(super) struct Findings {
    list: Vec<Finding>,
    counts: [usize; 3],
}

impl Findings {
    /// Number of findings of each severity that are kept.
    pub(super) const KEPT: usize = 50;

    pub(super) fn push(&mut self, finding: Finding) {
        let count = &mut self.counts[finding.severity as usize];
        *count += 1;
        if *count <= Self::KEPT {
            self.list.push(finding);
        }
    }

    pub(super) fn has_errors(&self) -> bool {
        self.counts[Severity::Error as usize] > 0
    }

    /// Names a few entries of which the same is to be said, and counts the others.
    pub(super) fn without_repetition(self) -> Self {
        /// Number of entries that are named.
        const NAMED: usize = 3;
        let mut seen: Vec<(Finding, usize)> = Vec::new();
        let (mut kept, counts) = (Self::default(), self.counts);
        for finding in self.list {
            let plain = Finding { path: None, ..finding.clone() };
            let at = seen.iter().position(|(other, _)| *other == plain).unwrap_or_else(|| {
                seen.push((plain, 0));
                seen.len() - 1
            });
            seen[at].1 += 1;
            if seen[at].1 <= NAMED {
                kept.list.push(finding);
            }
        }
        for (mut plain, number) in seen.into_iter().filter(|(_, number)| *number > NAMED) {
            plain.message = format!("the same of {} more: {}", number - NAMED, plain.message);
            kept.list.push(plain);
        }
        kept.counts = counts;
        kept
    }

    /// The kept findings, worst first, then in the order they were found; ends with a note where
    /// some were left out.
    pub(super) fn into_vec(mut self) -> Vec<Finding> {
        self.list.sort_by_key(|finding| finding.severity);
        for (severity, count) in
            [Severity::Error, Severity::Warning, Severity::Note].into_iter().zip(self.counts)
        {
            if count > Self::KEPT {
                self.list.push(Finding::note(
                    "more_findings",
                    format!("{} more of severity {severity} are not shown", count - Self::KEPT),
                ));
            }
        }
        self.list
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prints_place_and_hint() {
        let finding = Finding::error("x", "studentID is empty")
            .at("config.json")
            .on_line(3)
            .hint("write your student number");
        assert_eq!(
            finding.to_string(),
            "error: config.json:3: studentID is empty (hint: write your student number)"
        );
    }

    #[test]
    fn many_notes_hide_no_error() {
        let mut findings = Findings::default();
        for _ in 0..500 {
            findings.push(Finding::note("n", "n"));
        }
        findings.push(Finding::error("e", "e"));
        let list = findings.into_vec();
        assert_eq!(list[0].code, "e");
        assert_eq!(list.len(), 1 + Findings::KEPT + 1);
        assert_eq!(
            list.last().map(|f| f.message.as_str()),
            Some("450 more of severity note are not shown")
        );
    }
}
