//! Compares the found files with the expected tree.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::finding::{Finding, Severity};
use super::submission::{Format, IntakeError, Submission, SubmittedFile};
use super::tree::{CONFIG_FILE, REPORT_FILES, TreeFile, TreeSpec};
use super::tree_config::find_config;
use super::tree_lost::{Lost, MovedSource, find_lost, is_source, source_place};
use crate::columns::count;
use crate::harmless::printable;

/// The status of one line of the tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mark {
    /// Where it must be.
    Ok,
    /// Optional and not submitted.
    Absent,
    /// Required and not submitted.
    Missing,
    /// Submitted under another path.
    WrongPlace,
    /// Not part of the tree.
    Unexpected,
}

/// One line of the comparison.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TreeLine {
    /// The expected path; none for files that are not part of the tree.
    pub expected: Option<String>,
    /// The found path.
    pub found: Option<String>,
    /// Its status.
    pub mark: Mark,
    /// What to do, or what is special.
    pub advice: String,
}

/// The code of the warning on a configuration of somebody else.
const OTHER_PERSON: &str = "config_other_person";
/// The code of the warning on two images for one place.
const TWO_IMAGES: &str = "tree_two_images";

/// Whether a warning says that somebody must choose.
pub(super) fn is_choice(finding: &Finding) -> bool {
    [OTHER_PERSON, TWO_IMAGES].contains(&finding.code.as_str())
}

/// The comparison, and what it means for the verdict.
pub(super) struct Matched {
    pub(super) lines: Vec<TreeLine>,
    pub(super) findings: Vec<Finding>,
}

/// Lays a submission's files beside the tree.
///
/// # Errors
/// One of several configurations cannot be read.
pub(super) fn match_tree(submission: &Submission, tree: &TreeSpec) -> Result<Matched, IntakeError> {
    let files = &submission.files;
    let config = find_config(submission)?;
    // What lies beside the configuration comes before what lies elsewhere, unless another submission is as good.
    let root = match config.found {
        Lost::One(path) if !config.has_rival => {
            path.rsplit_once('/').map_or("", |(folder, _)| folder)
        }
        Lost::None | Lost::One(_) | Lost::Several(_) => "",
    };
    // Files in their place first, so that no search for a lost file takes them.
    let placed: Vec<Vec<&str>> = tree.files.iter().map(|file| placed(file, submission)).collect();
    let mut taken: BTreeSet<&str> =
        placed.iter().filter_map(|found| found.first()).copied().collect();
    // Of these the finding on the expected file says all.
    let mut unclear: BTreeSet<&str> = BTreeSet::new();
    let mut matched = Matched { lines: Vec::new(), findings: Vec::new() };
    for (file, placed) in tree.files.iter().zip(placed) {
        let found = match placed[..] {
            [found] => Lost::One(found),
            // It is optional: to refuse it would cost more than it is worth.
            [found, ..] => {
                matched.findings.push(Finding {
                    severity: Severity::Warning,
                    code: TWO_IMAGES.to_owned(),
                    ..ambiguous(&file.path, &placed)
                });
                unclear.extend(&placed[1..]);
                Lost::One(found)
            }
            [] if file.path == CONFIG_FILE => config.found.clone(),
            [] => {
                let free: Vec<&SubmittedFile> =
                    files.iter().filter(|file| !taken.contains(file.path.as_str())).collect();
                match find_lost(file, &free, tree, root) {
                    Lost::One(path) => with_others(path, root, &config.beside, submission),
                    found => found,
                }
            }
        };
        matched.take(file, &found, files);
        match found {
            Lost::One(path) => taken.extend([path]),
            Lost::Several(paths) => unclear.extend(paths),
            Lost::None => {}
        }
    }
    let places = matched.places_of_sources(files, &taken, tree);
    for folder in &tree.open_folders {
        let inside = |path: &&str| tree.open_folder_of(path) == Some(folder);
        let free = |path: &&str| !taken.contains(path) && !places.contains_key(path);
        let further: Vec<&str> =
            files.iter().map(|file| file.path.as_str()).filter(inside).filter(free).collect();
        if !further.is_empty() {
            matched.further_files(folder, further.len());
        }
        taken.extend(further);
    }
    let reports = reports(submission, tree);
    for report in &reports {
        matched.report(report);
    }
    let is_reported = |path: &str| {
        reports.iter().any(|own| path.strip_prefix(own).is_some_and(|rest| rest.starts_with('/')))
    };
    for path in files.iter().map(|file| file.path.as_str()).filter(|path| !taken.contains(path)) {
        match places.get(path) {
            None if is_reported(path) => {}
            None if submission.format == Format::Folder && tree.is_kept_back(path) => {
                matched.kept_back(path);
            }
            Some(place) => matched.wrong_place(place, path),
            None if unclear.contains(path) => matched.lines.push(TreeLine {
                expected: None,
                found: Some(path.to_owned()),
                mark: Mark::Unexpected,
                advice: "one of several that may be it".to_owned(),
            }),
            None => matched.unexpected(path),
        }
    }
    matched.findings.extend(config.others.iter().map(|(path, message)| {
        Finding::warning(OTHER_PERSON, message.as_str())
            .at(*path)
            .hint("leave it out if it is not yours")
    }));
    Ok(matched)
}

/// A file that was found below the root, or several: an image may differ from that in the same place of another
/// submission of the same person. Whether their sources differ is known by then.
fn with_others<'a>(
    path: &'a str,
    root: &str,
    beside: &[&str],
    submission: &'a Submission,
) -> Lost<'a> {
    let own = submission.file(path).filter(|_| !is_source(path));
    let place = path.strip_prefix(root).map(|rest| rest.trim_start_matches('/'));
    let (Some(own), Some(place)) = (own, place.filter(|_| !root.is_empty())) else {
        return Lost::One(path);
    };
    let others = beside.iter().filter_map(|folder| submission.file(&format!("{folder}{place}")));
    let others = others.filter(|other| other.sha256 != own.sha256);
    let mut all = vec![path];
    all.extend(others.map(|other| other.path.as_str()));
    if all.len() == 1 { Lost::One(path) } else { Lost::Several(all) }
}

/// The folders that are reports of Umbra's, beside what is submitted.
fn reports<'a>(submission: &'a Submission, tree: &TreeSpec) -> Vec<&'a str> {
    let [first, others @ ..] = REPORT_FILES;
    let folder = |file: &'a SubmittedFile| file.path.strip_suffix(first)?.strip_suffix('/');
    let is_one = |folder: &&str| {
        !tree.is_top_folder(folder.split('/').next().unwrap_or_default())
            && others.iter().all(|name| submission.file(&format!("{folder}/{name}")).is_some())
    };
    submission.files.iter().filter_map(folder).filter(is_one).collect()
}

/// Where an expected file lies: by its own name, or by names that are as good, where their contents differ. The
/// configuration is looked for otherwise.
fn placed<'a>(file: &TreeFile, submission: &'a Submission) -> Vec<&'a str> {
    if file.path == CONFIG_FILE {
        return Vec::new();
    }
    if let Some(own) = submission.file(&file.path) {
        return vec![&own.path];
    }
    let mut found: Vec<&SubmittedFile> =
        file.aliases.iter().filter_map(|alias| submission.file(alias)).collect();
    if let Some(first) = found.first().map(|first| &first.sha256)
        && found.iter().all(|other| other.sha256 == *first)
    {
        found.truncate(1);
    }
    found.into_iter().map(|file| file.path.as_str()).collect()
}

impl Matched {
    /// Takes what was found for an expected file.
    fn take(&mut self, file: &TreeFile, found: &Lost<'_>, files: &[SubmittedFile]) {
        let (found, mark, advice) = match found {
            Lost::One(path) if *path == file.path => (Some(*path), Mark::Ok, String::new()),
            // An alias is as good as the name; the tree shows both.
            Lost::One(path) if file.accepts(path) => {
                (Some(*path), Mark::Ok, "accepted under this name too".to_owned())
            }
            Lost::One(path) => return self.wrong_place(&file.path, path),
            Lost::Several(paths) => {
                self.findings.push(ambiguous(&file.path, paths));
                (None, Mark::Missing, "keep one of those that may be it".to_owned())
            }
            Lost::None if file.required => {
                self.findings.push(missing(&file.path, files));
                (None, Mark::Missing, "add it".to_owned())
            }
            Lost::None => (None, Mark::Absent, "optional".to_owned()),
        };
        let expected = Some(file.path.clone());
        self.lines.push(TreeLine { expected, found: found.map(str::to_owned), mark, advice });
    }

    fn wrong_place(&mut self, expected: &str, found: &str) {
        let message = format!("expected at '{expected}'");
        let finding = if expected == CONFIG_FILE {
            // It is read all the same.
            Finding::warning("tree_wrong_place", message)
        } else {
            Finding::error("tree_wrong_place", message)
        };
        self.findings
            .push(finding.at(found).hint("move it there, or let umbra validate --fix do it"));
        self.lines.push(TreeLine {
            advice: format!("move it to {expected}"),
            expected: Some(expected.to_owned()),
            found: Some(found.to_owned()),
            mark: Mark::WrongPlace,
        });
    }

    /// Of a working folder, what the template has beside the submission.
    fn kept_back(&mut self, found: &str) {
        let advice = "of the template; umbra pack leaves it out";
        self.findings.push(Finding::note("tree_kept_back", advice).at(found));
        self.lines.push(TreeLine {
            expected: None,
            found: Some(found.to_owned()),
            mark: Mark::Unexpected,
            advice: advice.to_owned(),
        });
    }

    /// A report of Umbra's, said once for all its files.
    fn report(&mut self, folder: &str) {
        let (message, hint) = ("a report of Umbra's, no part of the tree", "leave it out");
        let found = format!("{folder}/");
        self.findings.push(Finding::warning("tree_report", message).at(&*found).hint(hint));
        self.lines.push(TreeLine {
            expected: None,
            found: Some(found),
            mark: Mark::Unexpected,
            advice: hint.to_owned(),
        });
    }

    fn unexpected(&mut self, found: &str) {
        let (message, hint) = if is_source(found) {
            (
                "a source file outside src/: it is not compiled",
                "move it into src/ if the renderer needs it, else leave it out",
            )
        } else {
            ("not part of the expected tree", "leave it out; it is not looked at")
        };
        self.findings.push(Finding::warning("tree_unexpected", message).at(found).hint(hint));
        self.lines.push(TreeLine {
            expected: None,
            found: Some(found.to_owned()),
            mark: Mark::Unexpected,
            advice: hint.to_owned(),
        });
    }

    /// The sources outside of their place that belong to a folder of the tree, with their places there.
    fn places_of_sources<'a>(
        &self,
        files: &'a [SubmittedFile],
        taken: &BTreeSet<&str>,
        tree: &TreeSpec,
    ) -> BTreeMap<&'a str, String> {
        let moved = self.lines.iter().filter(|line| line.mark == Mark::WrongPlace);
        let source = MovedSource::of(
            moved.filter_map(|line| Some((line.expected.as_deref()?, line.found.as_deref()?))),
            tree,
        );
        files
            .iter()
            .map(|file| file.path.as_str())
            .filter(|path| !taken.contains(path))
            .filter_map(|path| Some((path, source_place(path, source.as_ref(), tree)?)))
            .filter(|(path, place)| path != place)
            .collect()
    }

    fn further_files(&mut self, folder: &str, number: usize) {
        self.lines.push(TreeLine {
            expected: Some(format!("{folder}/")),
            found: Some(format!("{folder}/")),
            mark: Mark::Ok,
            advice: count(number, "further file"),
        });
    }
}

/// The finding on an expected file of which several may be the one.
fn ambiguous(expected: &str, paths: &[&str]) -> Finding {
    let named = paths.iter().take(3).map(|path| printable(path)).collect::<Vec<_>>().join(", ");
    let more = if paths.len() > 3 { ", ..." } else { "" };
    let message = format!(
        "expected once in the submission, found {} files that may be it: {named}{more}",
        paths.len()
    );
    Finding::error("tree_ambiguous", message).at(expected).hint("submit only one of them")
}

/// Other languages than Rust, by the ends of file names.
const LANGUAGES: [(&str, &[&str]); 7] = [
    ("C++", &["cpp", "cc", "cxx", "hpp", "hh", "hxx", "h", "inl"]),
    ("C", &["c"]),
    ("C#", &["cs"]),
    ("Python", &["py", "ipynb"]),
    ("Java", &["java"]),
    ("JavaScript", &["js", "ts"]),
    ("Go", &["go"]),
];

/// Whether a file is source in whatever language.
pub(super) fn is_source_of_any(path: &str) -> bool {
    let end = path.rsplit_once('.').map(|(_, end)| end.to_lowercase()).unwrap_or_default();
    is_source(path) || LANGUAGES.iter().any(|(_, ends)| ends.contains(&end.as_str()))
}

/// The finding on a missing file; for a source file, it says whether the source is in another language.
fn missing(expected: &str, files: &[SubmittedFile]) -> Finding {
    let end = |path: &str| path.rsplit_once('.').map(|(_, end)| end.to_lowercase());
    let ends: Vec<String> = files.iter().filter_map(|file| end(&file.path)).collect();
    let own = end(expected).filter(|end| end == "rs" && !ends.contains(end));
    let of = |own: &[&str]| ends.iter().filter(|end| own.contains(&end.as_str())).count();
    let other = LANGUAGES.iter().map(|(name, ends)| (of(ends), name)).max_by_key(|(n, _)| *n);
    match other.filter(|(count, _)| own.is_some() && *count > 0) {
        Some((number, name)) => {
            let look = if number == 1 { "looks" } else { "look" };
            let message = format!(
                "expected a renderer in Rust, found none; {} {look} like {name}",
                count(number, "file")
            );
            Finding::error("tree_language", message)
                .hint("the renderer must be written in Rust: start from the template")
        }
        None => Finding::error("tree_missing", "expected in the submission, found nothing like it")
            .hint("add it, then pack again"),
    }
    .at(expected)
}
