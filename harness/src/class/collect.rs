//! Finds the submissions that a command line names: archives and folders anywhere below a folder or in a zip of many,
//! as learning platforms lay them out (`class/Ann_1_assignsubmission_file/a2.zip`).

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};

pub use super::download::Ambiguous;
use super::download::{self, GRADESCOPE_METADATA};
use super::layout::{
    self, ARCHIVES, Kind, Label, end_of, gradescope_metadata, has_end_of_archive, is_labelled,
    label_of,
};
use super::slots::{content, slot};
use crate::harmless::printable;
use crate::intake::{Limits, REPORT_FILES, TreeSpec, format_of_bytes};

/// Depth of the search below the given folder, in folders.
const MAX_DEPTH: usize = 8;
/// What stands in place of the files of an empty folder.
const NOTHING: &str = " (nothing in it)";
/// Number of skipped files that are named.
const NAMED: usize = 12;
/// Largest metadata of a platform that is read [bytes].
const MAX_METADATA: u64 = 64 << 20;
/// Ends of names of files that are zips by content and hold something else.
const DOCUMENTS: [&str; 10] =
    ["docx", "xlsx", "pptx", "odt", "ods", "odp", "pages", "key", "jar", "epub"];
/// Ends of names of files that make a folder a submission, whatever its tree.
const PARTS: [&str; 8] = ["rs", "wgsl", "exr", "cpp", "hpp", "cc", "h", "py"];

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
    pub kind: Kind,
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
    pub fn recognised(&self) -> Option<String> {
        let labels = self.sources.iter().filter_map(|source| source.label.as_ref());
        recognised(self.kind, labels)
    }

    /// What was skipped, in words; nothing when nothing was.
    pub fn skipped(&self) -> Option<String> {
        skipped(&self.skipped)
    }
}

/// As what downloads were recognised, in words; nothing where they are no platform's.
pub fn recognised<'a>(kind: Kind, labels: impl Iterator<Item = &'a Label>) -> Option<String> {
    let kinds: Vec<Kind> = labels.map(|label| label.kind).chain([kind]).collect();
    let titles = Kind::PLATFORMS.into_iter().filter(|kind| kinds.contains(kind)).map(Kind::title);
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
pub struct Wanted<'a> {
    /// The tree of a submission.
    pub tree: &'a TreeSpec,
    /// The size of a submission.
    pub limits: &'a Limits,
    /// What the instructor says the download is; else it is recognized.
    pub from: Option<Kind>,
    /// A folder that is no submission, should it lie there.
    pub output: Option<&'a Path>,
    /// An empty folder for what zips of many hold.
    pub scratch: &'a Path,
}

/// Finds the submissions at and below `paths`, and what the platform's names say of them.
///
/// # Errors
/// When a path leads nowhere or to no submission, or a zip of many cannot be unpacked.
pub fn collect(paths: &[PathBuf], wanted: &Wanted) -> anyhow::Result<Collected> {
    let output = wanted.output.and_then(|output| output.canonicalize().ok());
    let mut search = Search { wanted, output, unpacked: 0, found: Found::default() };
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
            let platform = wanted.from.filter(|kind| *kind != Kind::Plain);
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
    let mut collected = search.found.labelled(wanted, &groups);
    collected.leave_out_copies(paths)?;
    Ok(collected)
}

/// What a search has found so far.
#[derive(Default)]
struct Found {
    sources: Vec<Source>,
    skipped: Vec<String>,
    /// Names with the reason.
    unopened: Vec<(String, String)>,
    /// Of clones: their names below the given path.
    clones: Vec<String>,
    /// What Gradescope says of its folders.
    metadata: Vec<Label>,
}

impl Found {
    /// Recognizes the kinds and reads all names by them. Each download has its own, and so has each of the `groups`,
    /// which are of the submissions in their order.
    fn labelled(mut self, wanted: &Wanted, groups: &[usize]) -> Collected {
        // The path that was given may itself be a student's folder.
        let full = |source: &Source| match source.place.to_string_lossy() {
            place if place.ends_with(&source.name) => {
                let above = place[..place.len() - source.name.len()].trim_end_matches('/');
                let above = above.rsplit('/').next().unwrap_or_default();
                format!("{above}/{}", source.name)
            }
            _ => source.name.clone(),
        };
        let names: Vec<String> = self.sources.iter().map(full).collect();
        let last = |name: &str| name.rsplit('/').next().unwrap_or_default().to_owned();
        let clones: Vec<String> = self.clones.iter().map(|name| last(name)).collect();
        let prefix =
            layout::prefix_of_clones(&clones.iter().map(String::as_str).collect::<Vec<_>>());
        let metadata: HashMap<String, Label> =
            self.metadata.drain(..).map(|label| (label.submission.clone(), label)).collect();
        let label = |kind: Kind, name: &str| match kind {
            Kind::Github => self
                .clones
                .iter()
                .find(|clone| name.split('/').any(|part| part == last(clone)))
                .map(|clone| layout::clone(&last(clone), &prefix)),
            // Canvas names files alone.
            Kind::Canvas => label_of(kind, &last(name)),
            Kind::Gradescope => name
                .split('/')
                .find_map(|part| label_of(kind, part))
                .map(|label| metadata.get(&label.submission).cloned().unwrap_or(label)),
            kind => name.split('/').find_map(|part| label_of(kind, part)),
        };
        let recognised = |names: &[&str]| {
            let votes =
                |kind: &Kind| names.iter().filter(|name| label(*kind, name).is_some()).count();
            // The first of those with most.
            let best = Kind::PLATFORMS.into_iter().rev().max_by_key(votes);
            let most_are = |kind: &Kind| votes(kind) > 0 && 2 * votes(kind) >= names.len();
            best.filter(most_are).unwrap_or_default()
        };
        // What is unpacked lies below the scratch folder, each download in one of its own.
        let download = |source: &Source| {
            let below = source.path.strip_prefix(wanted.scratch).ok()?;
            Some(below.iter().next()?.to_owned())
        };
        let together: Vec<_> = self.sources.iter().map(download).zip(groups).collect();
        let mut kinds: BTreeMap<_, Kind> = BTreeMap::new();
        for own in &together {
            if !kinds.contains_key(own) {
                let all = together.iter().zip(&names).filter(|(other, _)| *other == own);
                let all: Vec<&str> = all.map(|(_, name)| name.as_str()).collect();
                kinds.insert(own, wanted.from.unwrap_or_else(|| recognised(&all)));
            }
        }
        let of_each: Vec<Kind> = together.iter().map(|own| kinds[own]).collect();
        let number = |kind: &Kind| of_each.iter().filter(|own| *own == kind).count();
        let found = Kind::PLATFORMS.into_iter().filter(|kind| number(kind) > 0).collect::<Vec<_>>();
        let most = found.iter().rev().max_by_key(|kind| number(kind)).copied();
        let kind = wanted.from.or(most).unwrap_or_default();
        let own = names.iter().zip(&of_each);
        let labels: Vec<Option<Label>> = own.map(|(name, kind)| label(*kind, name)).collect();
        let kinds = if found.is_empty() { vec![kind] } else { found };
        let any_label = |name: &str| kinds.iter().find_map(|kind| label(*kind, name));
        let mut empty: BTreeMap<String, Empty> = BTreeMap::new();
        let unopened: Vec<Label> =
            self.unopened.iter().filter_map(|(name, _)| any_label(name)).collect();
        let is_known = |own: &Label| {
            labels.iter().flatten().chain(&unopened).any(|label| label.submission == own.submission)
        };
        for name in &self.skipped {
            if let Some(label) = any_label(name).filter(|label| !is_known(label)) {
                let entry = empty.entry(label.submission.clone());
                let files = &mut entry.or_insert(Empty { label, files: Vec::new() }).files;
                files.extend(Some(last(name)).filter(|file| file != NOTHING));
            }
        }
        let empty = empty.into_values().collect();
        for (source, label) in self.sources.iter_mut().zip(labels) {
            source.label = label;
        }
        let copies = Vec::new();
        let unopened = self.unopened.into_iter().map(|(_, why)| why).collect();
        Collected { kind, sources: self.sources, skipped: self.skipped, empty, copies, unopened }
    }
}

struct Search<'a> {
    wanted: &'a Wanted<'a>,
    output: Option<PathBuf>,
    /// Number of zips of many submissions that were unpacked.
    unpacked: usize,
    found: Found,
}

impl Search<'_> {
    /// Searches a folder; it was found at `place`, and names of what is in it begin with `inside`.
    fn descend(
        &mut self,
        folder: &Path,
        place: &Path,
        inside: &str,
        depth: usize,
    ) -> anyhow::Result<()> {
        let tree = self.wanted.tree;
        let downloads = self.downloads(folder, depth)?;
        for entry in entries(folder)? {
            let path = entry.path();
            let file_name = entry.file_name().to_string_lossy().into_owned();
            let name = format!("{inside}{file_name}");
            let place = place.join(entry.file_name());
            let kind =
                entry.file_type().with_context(|| format!("cannot read {}", path.display()))?;
            let is_hidden = file_name.starts_with('.') || tree.ignored_by(&file_name).is_some();
            if is_hidden {
                self.found.skipped.push(name);
            } else if kind.is_dir() {
                let is_output = |output: &PathBuf| path.canonicalize().is_ok_and(|p| p == *output);
                if self.output.as_ref().is_some_and(is_output) {
                    continue;
                }
                if is_report(&path) {
                    self.found.skipped.push(format!("{name}/ (a report of Umbra's)"));
                    continue;
                }
                if path.join(".git").exists() {
                    self.found.clones.push(name.clone());
                }
                if is_submission(&path, tree)? {
                    self.found.sources.push(Source { path, name, place, label: None });
                    continue;
                }
                let all = |found: &Found| {
                    (found.sources.len(), found.skipped.len(), found.unopened.len())
                };
                let before = all(&self.found);
                if depth < MAX_DEPTH {
                    self.descend(&path, &place, &format!("{name}/"), depth + 1)?;
                }
                if before == all(&self.found) {
                    self.found.skipped.push(format!("{name}/{NOTHING}"));
                }
            } else if downloads && self.download(&path, &place, &format!("{name}/"), None)? {
                // Its submissions are found.
            } else if let Some(platform) = self.looks_like(&path, &place) {
                let why = unopened(&name, platform, &place);
                self.found.unopened.push((name, why));
            } else if kind.is_symlink() || (kind.is_file() && is_archive(&path)) {
                // A link is refused as a submission, so that somebody looks at it.
                self.found.sources.push(Source { path, name, place, label: None });
            } else {
                if file_name == GRADESCOPE_METADATA {
                    self.read_metadata(&path)?;
                }
                self.found.skipped.push(name);
            }
        }
        Ok(())
    }

    /// Whether all submissions in a folder that was given are zips of many. One among others, which may lie in folders,
    /// may be a student's that is made to look like one.
    fn downloads(&self, folder: &Path, depth: usize) -> anyhow::Result<bool> {
        if depth > 0 {
            return Ok(false);
        }
        let mut several = false;
        for entry in entries(folder)? {
            let path = entry.path();
            if path.is_dir() && self.holds_any(&path, depth)? {
                return Ok(false);
            }
            if has_end_of_archive(&path.to_string_lossy()) && path.is_file() {
                let is_one = download::may_be(&path)
                    && !is_labelled(&file_name(&path))
                    && download::names(&path)
                        .is_some_and(|names| download::is_download(&names, self.wanted.tree, None));
                if !is_one {
                    return Ok(false);
                }
                several = true;
            }
        }
        Ok(several)
    }

    /// Whether a folder is a submission or holds one.
    fn holds_any(&self, folder: &Path, depth: usize) -> anyhow::Result<bool> {
        let tree = self.wanted.tree;
        let name = file_name(folder);
        let is_output = self
            .output
            .as_ref()
            .is_some_and(|output| folder.canonicalize().is_ok_and(|own| own == *output));
        if name.starts_with('.')
            || tree.ignored_by(&name).is_some()
            || is_output
            || is_report(folder)
        {
            return Ok(false);
        }
        if is_submission(folder, tree)? {
            return Ok(true);
        }
        for entry in entries(folder)? {
            let path = entry.path();
            let is_own = path.is_file() && is_archive(&path);
            let is_link = path.is_symlink();
            if is_own
                || (!is_link
                    && path.is_dir()
                    && depth < MAX_DEPTH
                    && self.holds_any(&path, depth + 1)?)
            {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Unpacks a zip of many and searches it; false where it is none.
    fn download(
        &mut self,
        path: &Path,
        place: &Path,
        inside: &str,
        from: Option<Kind>,
    ) -> anyhow::Result<bool> {
        let is_one = path.is_file()
            && !path.is_symlink()
            && download::may_be(path)
            && !is_labelled(&file_name(path))
            && download::names(path)
                .is_some_and(|names| download::is_download(&names, self.wanted.tree, from));
        if !is_one {
            return Ok(false);
        }
        self.unpacked += 1;
        let into = self.wanted.scratch.join(self.unpacked.to_string());
        fs::create_dir_all(&into).with_context(|| format!("cannot make {}", into.display()))?;
        let skipped = download::unpack(path, &into, self.wanted.limits)?;
        self.found.skipped.extend(skipped.into_iter().map(|name| format!("{inside}{name}")));
        // A zip in it is a submission, even where it looks like another zip of many.
        self.descend(&into, place, inside, 1)?;
        Ok(true)
    }

    /// Whose download an archive among others looks like. What lies in a student's folder, or is named as a
    /// student's, is the student's.
    fn looks_like(&self, path: &Path, place: &Path) -> Option<Kind> {
        let is_student_s = place.iter().any(|part| is_labelled(&part.to_string_lossy()));
        if is_student_s || path.is_symlink() || !path.is_file() || !download::may_be(path) {
            return None;
        }
        download::platform(&download::names(path)?, self.wanted.tree)
    }

    /// Searches the download in a zip that was named and holds nothing else; false where it is none.
    fn wrapped(&mut self, path: &Path) -> anyhow::Result<bool> {
        let names = Some(path).filter(|path| download::may_be(path) && !path.is_symlink());
        let names = names.and_then(download::names).unwrap_or_default();
        let Some(only) = download::only_archive(&names, self.wanted.tree) else { return Ok(false) };
        self.unpacked += 1;
        let into = self.wanted.scratch.join(self.unpacked.to_string());
        fs::create_dir_all(&into).with_context(|| format!("cannot make {}", into.display()))?;
        download::unpack(path, &into, self.wanted.limits)?;
        let place = path.join(&only);
        match self.looks_like(&into.join(&only), &place) {
            Some(_) => self.download(&into.join(&only), &place, "", None),
            None => Ok(false),
        }
    }

    fn read_metadata(&mut self, path: &Path) -> anyhow::Result<()> {
        let cannot = || format!("cannot read {}", path.display());
        let file = fs::File::open(path).with_context(cannot)?;
        let mut bytes = Vec::new();
        file.take(MAX_METADATA).read_to_end(&mut bytes).with_context(cannot)?;
        self.found.metadata.extend(gradescope_metadata(&String::from_utf8_lossy(&bytes)));
        Ok(())
    }
}

/// Why a zip that looks like a download is no submission.
fn unopened(name: &str, platform: Kind, place: &Path) -> String {
    format!(
        "{name}: it looks like a download of {}, so among other archives it is neither opened nor graded; hint: name it \
         itself, {}",
        platform.title(),
        place.display()
    )
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

fn entries(folder: &Path) -> anyhow::Result<Vec<fs::DirEntry>> {
    let read = || folder.read_dir()?.collect::<std::io::Result<Vec<_>>>();
    let mut entries = read().with_context(|| format!("cannot read {}", folder.display()))?;
    entries.sort_by_key(fs::DirEntry::file_name);
    Ok(entries)
}

/// Whether a folder is a submission itself: it holds a folder of the tree; or `config.json` or parts of one,
/// and no archive, which then is the submission.
fn is_submission(folder: &Path, tree: &TreeSpec) -> anyhow::Result<bool> {
    let (mut is_part, mut holds_archive, mut has_top) = (false, false, false);
    for entry in entries(folder)? {
        let name = entry.file_name().to_string_lossy().into_owned();
        // A folder of many students' is none, whatever else lies there.
        if is_labelled(&name) {
            return Ok(false);
        }
        let kind =
            entry.file_type().with_context(|| format!("cannot read {}", folder.display()))?;
        has_top |= kind.is_dir() && tree.is_top_folder(&name);
        if kind.is_file() {
            let is_expected = tree.files.iter().any(|file| file.path.eq_ignore_ascii_case(&name));
            is_part |= is_expected || PARTS.contains(&end_of(&name).as_str());
            holds_archive |= is_archive(&entry.path());
        }
    }
    Ok(has_top || (is_part && !holds_archive))
}

/// Whether a folder is a report that Umbra wrote.
fn is_report(folder: &Path) -> bool {
    REPORT_FILES.iter().all(|name| folder.join(name).is_file())
}

/// Whether a file is an archive by its name or, when that says nothing, by its content.
fn is_archive(path: &Path) -> bool {
    let end = end_of(&path.to_string_lossy());
    if ARCHIVES.contains(&end.as_str()) {
        return true;
    }
    if DOCUMENTS.contains(&end.as_str()) || PARTS.contains(&end.as_str()) {
        return false;
    }
    let mut head = Vec::new();
    let read = fs::File::open(path).and_then(|file| file.take(1 << 10).read_to_end(&mut head));
    // Nothing but zeros would be an empty tar.
    read.is_ok() && head.iter().any(|byte| *byte != 0) && format_of_bytes(&head).is_some()
}

#[cfg(test)]
mod tests;
