//! Finds the submissions that a command line names: archives and folders anywhere below a folder or in a zip of many,
//! as learning platforms lay them out (`class/Ann_1_assignsubmission_file/a2.zip`).

mod labels;
mod search;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};

use self::labels::SearchResult;
use self::search::{MAX_DEPTH, Search, is_submission};
pub use super::download::Ambiguous;
use super::layout::{Label, Platform};
use super::slots::{content, slot};
use crate::harmless::printable;
use crate::intake::{ArchiveLimits, TreeSpec};
/// Number of skipped files that are named.
const NAMED: usize = 12;

/// A submission to be graded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// The archive or folder.
    pub path: PathBuf,
    /// What reports call it: its path from the folder that was given.
    pub name: String,
    /// Where it was found, the same from run to run: of one that was in a zip, the zip's path and its own in it.
    pub place: PathBuf,
    /// What a platform's names say of it.
    pub label: Option<Label>,
}

impl Source {
    /// A submission that the command line names itself.
    pub fn given(path: &Path) -> Self {
        let name = file_name(path);
        Self { path: path.to_owned(), name, place: path.to_owned(), label: None }
    }
}

/// A student whose submission holds nothing to grade.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Empty {
    /// Who.
    pub label: Label,
    /// What there is.
    pub files: Vec<String>,
}

impl Empty {
    /// Why there is nothing to grade.
    pub fn reason(&self) -> String {
        match &self.files[..] {
            [] => "an empty submission: it holds no file".to_owned(),
            files => format!("an empty submission: it holds only {}", files.join(", ")),
        }
    }
}

/// What was found.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Collected {
    /// Where it comes from; of several downloads, where most of it does.
    pub kind: Platform,
    /// The submissions, in the order of their names below each given path.
    pub sources: Vec<Source>,
    /// What is none.
    pub skipped: Vec<String>,
    /// Those of whom a platform has something, but nothing to grade.
    pub empty: Vec<Empty>,
    /// Zips that look like the download of a class, among other archives: neither opened nor graded.
    pub unopened: Vec<String>,
    /// What lies in several downloads with the same content, and is one submission.
    pub copies: Vec<String>,
}

impl Collected {
    /// Of what has one place in several downloads with the same content, keeps the first. What the command line names
    /// itself is always a submission of its own.
    fn leave_out_copies(&mut self, paths: &[PathBuf]) -> anyhow::Result<()> {
        let mut slots: BTreeMap<String, Vec<(usize, Option<String>)>> = BTreeMap::new();
        for (at, source) in self.sources.iter().enumerate() {
            if !paths.contains(&source.place) {
                let slot = slot(source.label.as_ref(), &source.name);
                slots.entry(slot).or_default().push((at, None));
            }
        }
        let mut copies = BTreeSet::new();
        for own in slots.values_mut().filter(|own| own.len() > 1) {
            for (at, digest) in own.iter_mut() {
                let path = &self.sources[*at].path;
                // A link is refused as a submission, so nothing is read through it.
                if !path.is_symlink() {
                    let failed = || format!("cannot read {}", path.display());
                    *digest = Some(content(path).with_context(failed)?);
                }
            }
            let mut seen = BTreeSet::new();
            for (at, digest) in own.iter() {
                if digest.as_ref().is_some_and(|digest| !seen.insert(digest)) {
                    copies.insert(*at);
                }
            }
        }
        self.copies = copies.iter().map(|at| self.sources[*at].name.clone()).collect();
        let mut at = 0..;
        self.sources.retain(|_| at.next().is_none_or(|at| !copies.contains(&at)));
        Ok(())
    }

    /// Where the submissions come from, in words; nothing where that is no platform.
    pub fn recognized(&self) -> Option<String> {
        let labels = self.sources.iter().filter_map(|source| source.label.as_ref());
        recognized(self.kind, labels)
    }

    /// What was skipped, in words; nothing when nothing was.
    pub fn skipped(&self) -> Option<String> {
        skipped(&self.skipped)
    }
}

/// As what downloads were recognised, in words; nothing where they are no platform's.
pub fn recognized<'a>(kind: Platform, labels: impl Iterator<Item = &'a Label>) -> Option<String> {
    let kinds: Vec<Platform> = labels.map(|label| label.kind).chain([kind]).collect();
    let titles =
        Platform::PLATFORMS.into_iter().filter(|kind| kinds.contains(kind)).map(Platform::title);
    match &titles.collect::<Vec<_>>()[..] {
        [] => None,
        [only] => Some(format!("recognized as a download of {only}")),
        several => Some(format!("recognized as downloads of {}", several.join(" and "))),
    }
}

/// What was skipped, in words; nothing when nothing was.
pub fn skipped(names: &[String]) -> Option<String> {
    let named = names.iter().take(NAMED).map(|name| printable(name));
    let named = named.collect::<Vec<_>>().join(", ");
    let more = names.len().saturating_sub(NAMED);
    match (names.is_empty(), more) {
        (true, _) => None,
        (_, 0) => Some(named),
        (_, more) => Some(format!("{named} and {more} more")),
    }
}

/// What is asked for.
pub struct CollectOptions<'a> {
    /// The tree of a submission.
    pub tree: &'a TreeSpec,
    /// The size of a submission.
    pub limits: &'a ArchiveLimits,
    /// What the instructor says the download is; else it is recognized.
    pub from: Option<Platform>,
    /// A folder that is no submission, should it lie there.
    pub output: Option<&'a Path>,
    /// An empty folder for what zips of many hold.
    pub scratch: &'a Path,
}

/// Finds the submissions at and below `paths`, and what the platform's names say of them.
///
/// # Errors
/// When a path leads nowhere or to no submission, or a zip of many cannot be unpacked.
pub fn collect(paths: &[PathBuf], wanted: &CollectOptions) -> anyhow::Result<Collected> {
    let output = wanted.output.and_then(|output| output.canonicalize().ok());
    let mut search = Search { wanted, output, unpacked: 0, found: SearchResult::default() };
    // Of each submission, with which others it was found: those of a folder, or those that the command line names.
    let mut groups: Vec<usize> = Vec::new();
    for (index, path) in paths.iter().enumerate() {
        let before = search.found.sources.len();
        let mut group = index + 1;
        let said = search.found.skipped.len();
        if path.is_dir() && !is_submission(path, wanted.tree)? {
            search.descend(path, path, "", 0)?;
        } else if !search.wrapped(path)? && !search.download(path, path, "", wanted.from)? {
            search.found.sources.push(Source::given(path));
            group = 0;
        }
        groups.resize(search.found.sources.len(), group);
        if search.found.sources.len() == before {
            let found = &search.found.skipped[said..];
            let other =
                skipped(found).map_or("it is empty".into(), |names| format!("it holds {names}"));
            let unopened = search.found.unopened.first().map(|(_, why)| why.clone());
            let other = unopened.unwrap_or(other);
            let platform = wanted.from.filter(|kind| *kind != Platform::Plain);
            let platform = platform.map_or(String::new(), |kind| {
                format!(", in {} named like {}", kind.title(), kind.pattern())
            });
            bail!(
                "{}: there is no submission: expected archives (.zip, .tar, .tar.gz) or folders with src/ or \
                 config.json, at most {MAX_DEPTH} folders deep{platform}; {other}",
                path.display()
            );
        }
    }
    let mut collected = search.found.labeled(wanted, &groups);
    collected.leave_out_copies(paths)?;
    Ok(collected)
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests;
