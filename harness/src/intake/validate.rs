//! Whether a submission conforms to the expected tree, and what to do where it does not.

use std::fs;

use serde::{Deserialize, Serialize};

use super::check_config::check_config;
use super::encoding::text_of;
use super::finding::{Finding, Findings, Severity};
use super::lexer::tokens;
use super::source_paths::misspelt;
use super::submission::{Format, IntakeError, Refusal, Submission};
use super::submitted_config::SubmittedConfig;
use super::tree::{CONFIG_FILE, TreeSpec};
use super::tree_config::MAX_CONFIG;
use super::tree_lost::is_source;
use super::tree_match::{Mark, Matched, TreeLine, match_tree};
use super::unpack::is_cause;
use crate::columns::count;

/// What `validate` found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Validation {
    /// Name of the archive or folder.
    pub name: String,
    /// What it is.
    pub format: Option<Format>,
    /// Whether there is no error among the findings: neither the tree nor the student number.
    pub conforms: bool,
    /// The expected tree beside the found one; empty for a submission that was refused.
    pub tree: Vec<TreeLine>,
    /// What `config.json` says, where there is one.
    pub config: Option<SubmittedConfig>,
    /// Everything to say, errors first.
    pub findings: Vec<Finding>,
}

/// Validates a private copy that was already made.
///
/// # Errors
/// The copy cannot be read.
pub fn validate_submission(
    submission: &Submission,
    tree: &TreeSpec,
) -> Result<Validation, IntakeError> {
    let Matched { lines, findings: said } = match_tree(submission, tree)?;
    let mut findings = submission.findings.clone();
    // Where something is missing, what may hide it is said first.
    let is_missing =
        |finding: &Finding| ["tree_missing", "tree_language"].contains(&finding.code.as_str());
    if said.iter().any(is_missing) {
        for finding in findings.iter_mut().filter(|finding| is_cause(finding)) {
            finding.severity = Severity::Error;
        }
    }
    findings.extend(said);
    findings.extend(empty_source(submission, &lines)?);
    findings.extend(encoded_source(submission, tree)?);
    let mut config = None;
    // One in the wrong place says whose submission it is all the same.
    let config_line = lines.iter().find(|line| line.expected.as_deref() == Some(CONFIG_FILE));
    let name = config_line.and_then(|line| line.found.as_deref());
    if let Some((name, file)) = name.and_then(|name| Some((name, submission.file(name)?))) {
        if file.bytes > MAX_CONFIG {
            findings.push(
                Finding::error(
                    "config_shape",
                    format!("{} bytes, over the limit of {MAX_CONFIG}", file.bytes),
                )
                .at(name)
                .on_line(1)
                .hint("start from the template's config.json"),
            );
        } else {
            let path = submission.root.join(name);
            let bytes = fs::read(&path).map_err(|e| IntakeError::io("read", &path, e))?;
            let (parsed, said, is_whole) = SubmittedConfig::parse(&bytes);
            let (present, missing) = places(&lines);
            let mut more = check_config(&parsed, is_whole, &present, &missing, tree);
            if let Some(stop) = said.first().filter(|_| !is_whole && parsed.student_id.is_none()) {
                more.iter_mut().for_each(|finding| name_cause(finding, stop));
            }
            let text = text_of(&bytes);
            let more = more.into_iter().map(|finding| show(finding, &text));
            findings.extend(said.into_iter().chain(more).map(|finding| finding.at(name)));
            config = Some(parsed);
        }
    }
    // A hostile tree or config may say thousands of things.
    let mut kept = Findings::default();
    for finding in findings {
        kept.push(finding);
    }
    let findings = kept.into_vec();
    Ok(Validation {
        name: submission.name.clone(),
        format: Some(submission.format),
        conforms: findings.iter().all(|finding| finding.severity != Severity::Error),
        tree: lines,
        config,
        findings,
    })
}

/// Of a number that is not found because reading stopped before it, says where and why that was.
fn name_cause(finding: &mut Finding, stop: &Finding) {
    if finding.severity != Severity::Error {
        return;
    }
    finding.message = format!("{}; so no \"studentID\" is found", stop.message);
    finding.line = stop.line;
    finding.excerpt.clone_from(&stop.excerpt);
    finding.hint.clone_from(&stop.hint);
}

/// The warning on a source file of the tree that holds no code, but comments at most.
fn empty_source(submission: &Submission, lines: &[TreeLine]) -> Result<Vec<Finding>, IntakeError> {
    /// Files that hold nothing are small [bytes].
    const SMALL: u64 = 64 << 10;
    let mut findings = Vec::new();
    for path in lines.iter().filter(|line| line.expected.is_some()) {
        let Some(file) = path.found.as_deref().and_then(|path| submission.file(path)) else {
            continue;
        };
        if !file.path.to_lowercase().ends_with("lib.rs") || file.bytes > SMALL {
            continue;
        }
        let path = submission.root.join(&file.path);
        let bytes = fs::read(&path).map_err(|e| IntakeError::io("read", &path, e))?;
        if tokens(&text_of(&bytes)).is_empty() {
            let message = format!("it holds no code ({})", count(bytes.len(), "byte"));
            let finding = Finding::warning("source_empty", message).at(file.path.as_str());
            findings.push(finding.hint("save your source, then pack again"));
        }
    }
    Ok(findings)
}

/// The warnings on source files that the compiler cannot read or will not find.
fn encoded_source(submission: &Submission, tree: &TreeSpec) -> Result<Vec<Finding>, IntakeError> {
    let (mut findings, mut sources) = (Vec::new(), Vec::new());
    let paths: Vec<&str> = submission.files.iter().map(|file| file.path.as_str()).collect();
    let is_text = |path: &str| is_source(path) && tree.open_folder_of(path).is_some();
    for file in submission.files.iter().filter(|file| is_text(&file.path)) {
        let path = submission.root.join(&file.path);
        let bytes = fs::read(&path).map_err(|e| IntakeError::io("read", &path, e))?;
        let end = match std::str::from_utf8(&bytes) {
            // UTF-16 of plain text is UTF-8 with zeros.
            Ok(_) => bytes.iter().position(|byte| *byte == 0),
            Err(error) => Some(error.valid_up_to()),
        };
        let Some(end) = end else {
            if file.path.to_lowercase().ends_with(".rs") {
                sources.push((file.path.as_str(), text_of(&bytes)));
            }
            continue;
        };
        let line = 1 + bytes[..end].iter().filter(|b| **b == b'\n').count() as u32;
        let message = "expected UTF-8, found another encoding: it does not compile";
        let finding = Finding::warning("source_not_utf8", message).at(file.path.as_str());
        findings.push(finding.on_line(line).hint("save it as UTF-8"));
    }
    findings.extend(misspelt(&sources, &paths));
    Ok(findings)
}

impl Validation {
    /// With more findings, worst first.
    #[must_use]
    pub fn with(mut self, more: Vec<Finding>) -> Self {
        self.findings.extend(more);
        self.findings.sort_by_key(|finding| finding.severity);
        self.conforms = self.findings.iter().all(|f| f.severity != Severity::Error);
        self
    }

    /// Whether the tree is the handout's, whatever `config.json` says and wherever it lies. Of a refused one nothing
    /// is known.
    pub fn follows_tree(&self) -> bool {
        let is_config = |line: &TreeLine| line.expected.as_deref() == Some(CONFIG_FILE);
        let fits = |line: &TreeLine| match line.mark {
            Mark::Missing => false,
            Mark::WrongPlace => is_config(line),
            Mark::Ok | Mark::Absent | Mark::Unexpected => true,
        };
        !self.tree.is_empty() && self.tree.iter().all(fits)
    }
}

/// A finding with its line and the place of what it quotes, if that stands there.
fn show(finding: Finding, text: &str) -> Finding {
    let lines = finding.line.and_then(|line| text.lines().nth((line as usize).checked_sub(1)?));
    let Some(line) = lines.filter(|_| finding.excerpt.is_none()) else { return finding };
    // What is found is said last.
    let mut quoted = finding.message.split(['\'', '"']).skip(1).step_by(2).collect::<Vec<_>>();
    quoted.reverse();
    let place = quoted.iter().filter(|words| !words.is_empty()).find_map(|words| line.find(words));
    match place {
        Some(place) => {
            let column = line[..place].chars().count();
            finding.showing(line, column)
        }
        None => finding,
    }
}

/// Paths that are there once misplaced files are moved, and paths that are missing.
fn places(lines: &[TreeLine]) -> (Vec<&str>, Vec<&str>) {
    let mut present = Vec::new();
    let mut missing = Vec::new();
    for line in lines {
        match line.mark {
            Mark::Missing => missing.extend(line.expected.as_deref()),
            Mark::WrongPlace => present.extend(line.expected.as_deref()),
            Mark::Ok | Mark::Absent | Mark::Unexpected => present.extend(line.found.as_deref()),
        }
    }
    (present, missing)
}

/// The validation of a submission that was refused.
pub fn validate_refusal(refusal: &Refusal) -> Validation {
    Validation {
        name: refusal.name.clone(),
        format: refusal.format,
        conforms: false,
        tree: Vec::new(),
        config: None,
        findings: refusal.findings.clone(),
    }
}
