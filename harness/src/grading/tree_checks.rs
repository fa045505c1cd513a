//! Checks on the received files: whether they were unpacked, follow the tree, and hold a correct `config.json`.

use crate::evidence::{Check, CheckId, Verdict};
use crate::intake::{self, Submission, TreeSpec, Validation};
use crate::rubric::BUILD;

/// How a submission is to be looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// To be graded: its tree counts.
    Grade,
    /// A working folder, before submitting: its tree is only remarked on.
    Check,
}

/// The check that says whether the submission follows the tree.
pub const TREE: CheckId = CheckId::SubmissionTree;

/// The check that says whether `config.json` is as it should be; it costs nothing.
const CONFIG: CheckId = CheckId::SubmissionConfig;

/// What there is to say of a submission that was not unpacked: neither its tree nor its source was seen.
pub fn refused_checks(validation: &Validation) -> Vec<Check> {
    let error = validation.findings.iter().find(|f| f.severity == intake::Severity::Error);
    let why = error.map(|finding| match &finding.path {
        Some(path) => format!("{path}: {}", finding.message),
        None => finding.message.clone(),
    });
    let refused = match validation.format {
        Some(intake::Format::Folder) => "it was not read",
        _ => "it was not unpacked",
    };
    let hint = error.and_then(|finding| finding.hint.clone()).unwrap_or_default();
    let what_to_do = if hint.is_empty() { String::new() } else { format!(" (hint: {hint})") };
    let summary = format!("{refused}: {}{what_to_do}", why.unwrap_or_default());
    vec![
        Check::new(TREE, "", Verdict::NotJudged, summary.clone()),
        Check::new(BUILD, "", Verdict::Fail, summary),
    ]
}

pub fn tree_check(
    validation: &Validation,
    submission: &Submission,
    tree: &TreeSpec,
    mode: Mode,
) -> Check {
    if validation.follows_tree() {
        let summary = "the submission follows the tree of the handout";
        return Check::new(TREE, "", Verdict::Pass, summary);
    }
    let error = validation.findings.iter().find(|f| f.severity == intake::Severity::Error);
    let error = error.map(ToString::to_string).unwrap_or_default();
    match mode {
        Mode::Check => {
            let summary = format!("not ready to submit: {error}");
            Check::new(TREE, "", Verdict::NotJudged, summary)
                .with_hint("umbra validate shows the whole tree")
        }
        Mode::Grade => {
            let hint = match intake::mends(submission, validation, tree) {
                Some(mends) => format!("umbra validate --fix mends it: {mends}"),
                None => format!("umbra validate shows the whole tree; {error}"),
            };
            Check::new(TREE, "", Verdict::Fail, error).with_hint(hint)
        }
    }
}

/// The first thing that is wrong with `config.json`, if anything: it costs nothing.
pub fn config_check(validation: &Validation) -> Option<Check> {
    let own = |f: &&intake::Finding| {
        f.path.as_deref() == Some(intake::CONFIG_FILE) && f.severity != intake::Severity::Note
    };
    let slip = validation.findings.iter().find(|finding| own(finding) && finding.line.is_some());
    // One under another name is read all the same, and said to be.
    let misplaced = || validation.findings.iter().find(|finding| finding.is_misplaced_config());
    let words = match slip {
        Some(slip) => {
            format!("{}:{}: {}", intake::CONFIG_FILE, slip.line.unwrap_or(1), slip.message)
        }
        None => misplaced().map(|slip| {
            format!("{}: {}", slip.path.as_deref().unwrap_or_default(), slip.message)
        })?,
    };
    Some(Check::new(CONFIG, "", Verdict::Fail, "config.json has a slip").with_hint(words))
}
