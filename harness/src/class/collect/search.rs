//! The search for submissions in folders and in zips of many.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::Context as _;

use super::labels::{NOTHING, SearchResult};
use super::{CollectOptions, Source, file_name};
use crate::class::download::{self, GRADESCOPE_METADATA};
use crate::class::layout::{
    ARCHIVES, Platform, end_of, gradescope_metadata, has_end_of_archive, is_labeled,
};
use crate::intake::{REPORT_FILES, TreeSpec, format_of_bytes};

/// Depth of the search below the given folder, in folders.
pub(super) const MAX_DEPTH: usize = 8;
/// Largest metadata of a platform that is read [bytes].
const MAX_METADATA: u64 = 64 << 20;
/// Ends of names of files that are zips by content and hold something else.
const DOCUMENTS: [&str; 10] =
    ["docx", "xlsx", "pptx", "odt", "ods", "odp", "pages", "key", "jar", "epub"];
/// Ends of names of files that make a folder a submission, whatever its tree.
const PARTS: [&str; 8] = ["rs", "wgsl", "exr", "cpp", "hpp", "cc", "h", "py"];

pub(super) struct Search<'a> {
    pub(super) wanted: &'a CollectOptions<'a>,
    pub(super) output: Option<PathBuf>,
    /// Number of zips of many submissions that were unpacked.
    pub(super) unpacked: usize,
    pub(super) found: SearchResult,
}

impl Search<'_> {
    /// Searches a folder; it was found at `place`, and names of what is in it begin with `inside`.
    pub(super) fn descend(
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
                let all = |found: &SearchResult| {
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
                    && !is_labeled(&file_name(&path))
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
    pub(super) fn download(
        &mut self,
        path: &Path,
        place: &Path,
        inside: &str,
        from: Option<Platform>,
    ) -> anyhow::Result<bool> {
        let is_one = path.is_file()
            && !path.is_symlink()
            && download::may_be(path)
            && !is_labeled(&file_name(path))
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
    fn looks_like(&self, path: &Path, place: &Path) -> Option<Platform> {
        let is_student_s = place.iter().any(|part| is_labeled(&part.to_string_lossy()));
        if is_student_s || path.is_symlink() || !path.is_file() || !download::may_be(path) {
            return None;
        }
        download::platform(&download::names(path)?, self.wanted.tree)
    }

    /// Searches the download in a zip that was named and holds nothing else; false where it is none.
    pub(super) fn wrapped(&mut self, path: &Path) -> anyhow::Result<bool> {
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
fn unopened(name: &str, platform: Platform, place: &Path) -> String {
    format!(
        "{name}: it looks like a download of {}, so among other archives it is neither opened nor graded; hint: name it \
         itself, {}",
        platform.title(),
        place.display()
    )
}

fn entries(folder: &Path) -> anyhow::Result<Vec<fs::DirEntry>> {
    let read = || folder.read_dir()?.collect::<std::io::Result<Vec<_>>>();
    let mut entries = read().with_context(|| format!("cannot read {}", folder.display()))?;
    entries.sort_by_key(fs::DirEntry::file_name);
    Ok(entries)
}

/// Whether a folder is a submission itself: it holds a folder of the tree; or `config.json` or parts of one,
/// and no archive, which then is the submission.
pub(super) fn is_submission(folder: &Path, tree: &TreeSpec) -> anyhow::Result<bool> {
    let (mut is_part, mut holds_archive, mut has_top) = (false, false, false);
    for entry in entries(folder)? {
        let name = entry.file_name().to_string_lossy().into_owned();
        // A folder of many students' is none, whatever else lies there.
        if is_labeled(&name) {
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
