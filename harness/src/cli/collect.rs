//! Which submissions a command line means: archives and folders, found wherever they lie below a folder, as
//! learning platforms lay them out (`class/Ann_1_assignsubmission_file/a2.zip`).

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};

use crate::intake::{TreeSpec, format_of_bytes};
use crate::report::harmless;

/// So many folders below the one that is given.
const MAX_DEPTH: usize = 8;
/// So many skipped files are named.
const NAMED: usize = 12;
/// Ends of names of archives, also of those that are refused with a reason.
const ARCHIVES: [&str; 11] =
    ["zip", "tar", "gz", "tgz", "rar", "7z", "bz2", "tbz", "xz", "txz", "zst"];
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
}

impl Source {
    /// A submission that was named itself.
    pub fn given(path: &Path) -> Self {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        Self { path: path.to_owned(), name }
    }
}

/// What was found.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Collected {
    /// The submissions, in the order of their names below each given path.
    pub sources: Vec<Source>,
    /// What is none.
    pub skipped: Vec<String>,
}

impl Collected {
    /// What was skipped, in words; nothing when nothing was.
    pub fn skipped(&self) -> Option<String> {
        let named = self.skipped.iter().take(NAMED).map(|name| harmless(name));
        let named = named.collect::<Vec<_>>().join(", ");
        let more = self.skipped.len().saturating_sub(NAMED);
        match (self.skipped.is_empty(), more) {
            (true, _) => None,
            (_, 0) => Some(named),
            (_, more) => Some(format!("{named} and {more} more")),
        }
    }
}

/// Finds the submissions at and below `paths`. `output` is left out, should it lie there.
///
/// # Errors
/// When a path leads nowhere or to no submission.
pub fn collect(paths: &[PathBuf], output: &Path, tree: &TreeSpec) -> anyhow::Result<Collected> {
    let mut collected = Collected::default();
    let output = output.canonicalize().ok();
    for path in paths {
        if path.is_file() || is_submission(path, tree)? {
            collected.sources.push(Source::given(path));
            continue;
        }
        let mut search =
            Search { tree, output: output.as_deref(), collected: Collected::default() };
        search.descend(path, "", 0)?;
        let found = search.collected;
        if found.sources.is_empty() {
            let other =
                found.skipped().map_or("it is empty".into(), |names| format!("it holds {names}"));
            bail!(
                "{}: there is no submission: expected archives (.zip, .tar, .tar.gz) or folders with src/ or \
                 config.json, at most {MAX_DEPTH} folders deep; {other}",
                path.display()
            );
        }
        collected.sources.extend(found.sources);
        collected.skipped.extend(found.skipped);
    }
    Ok(collected)
}

struct Search<'a> {
    tree: &'a TreeSpec,
    output: Option<&'a Path>,
    collected: Collected,
}

impl Search<'_> {
    fn descend(&mut self, folder: &Path, inside: &str, depth: usize) -> anyhow::Result<()> {
        for entry in entries(folder)? {
            let path = entry.path();
            let file_name = entry.file_name().to_string_lossy().into_owned();
            let name = format!("{inside}{file_name}");
            let kind =
                entry.file_type().with_context(|| format!("cannot read {}", path.display()))?;
            let is_hidden =
                file_name.starts_with('.') || self.tree.ignored_by(&file_name).is_some();
            if is_hidden {
                self.collected.skipped.push(name);
            } else if kind.is_dir() {
                if self.output.is_some_and(|output| path.canonicalize().is_ok_and(|p| p == output))
                {
                    continue;
                }
                if is_submission(&path, self.tree)? {
                    self.collected.sources.push(Source { path, name });
                    continue;
                }
                let before = (self.collected.sources.len(), self.collected.skipped.len());
                if depth < MAX_DEPTH {
                    self.descend(&path, &format!("{name}/"), depth + 1)?;
                }
                if before == (self.collected.sources.len(), self.collected.skipped.len()) {
                    self.collected.skipped.push(format!("{name}/ (nothing in it)"));
                }
            } else if kind.is_symlink() || (kind.is_file() && is_archive(&path)) {
                // A link is refused as a submission, so that somebody looks at it.
                self.collected.sources.push(Source { path, name });
            } else {
                self.collected.skipped.push(name);
            }
        }
        Ok(())
    }
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
    let (mut is_part, mut holds_archive) = (false, false);
    for entry in entries(folder)? {
        let name = entry.file_name().to_string_lossy().into_owned();
        let kind =
            entry.file_type().with_context(|| format!("cannot read {}", folder.display()))?;
        if kind.is_dir() && tree.is_top_folder(&name) {
            return Ok(true);
        }
        if kind.is_file() {
            let is_expected = tree.files.iter().any(|file| file.path.eq_ignore_ascii_case(&name));
            is_part |= is_expected || PARTS.contains(&end_of(&name).as_str());
            holds_archive |= is_archive(&entry.path());
        }
    }
    Ok(is_part && !holds_archive)
}

/// What follows the last dot of a name, in lower case.
fn end_of(name: &str) -> String {
    name.rsplit_once('.').map(|(_, end)| end.to_lowercase()).unwrap_or_default()
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
mod tests {
    use super::*;

    fn class(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            if file.ends_with('/') {
                fs::create_dir_all(path).unwrap();
                continue;
            }
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "x").unwrap();
        }
        folder
    }

    fn found(folder: &tempfile::TempDir) -> (Vec<String>, Vec<String>) {
        let paths = [folder.path().to_owned()];
        let found = collect(&paths, &folder.path().join("out"), &TreeSpec::default()).unwrap();
        (found.sources.into_iter().map(|source| source.name).collect(), found.skipped)
    }

    #[test]
    fn submissions_are_found_however_deep_and_junk_is_named() {
        let class = class(&[
            "Ann_1_assignsubmission_file/a2.zip",
            "Bob_2_assignsubmission_file/a2/src/lib.rs",
            "Bob_2_assignsubmission_onlinetext/onlinetext.html",
            "Cem_3/config.json",
            "Dan_4/config.json",
            "Dan_4/a2_dan.tar.gz",
            "Eve_5/",
            "Fay_6/code/lib.rs",
            "group/of/Gil_7.rar",
            "Hal_8/Src/lib.rs",
            "Hal_8/old.zip",
            "__MACOSX/a2.zip",
            "out/Ann/report.html",
            ".DS_Store",
            "index.html",
            "notes.txt",
            "rules.docx",
        ]);
        fs::write(class.path().join("no-extension"), [b"\x1f\x8b".as_slice(), &[0; 9]].concat())
            .unwrap();
        let (sources, skipped) = found(&class);
        let expected = [
            "Ann_1_assignsubmission_file/a2.zip",
            "Bob_2_assignsubmission_file/a2",
            "Cem_3",
            "Dan_4/a2_dan.tar.gz",
            "Fay_6/code",
            "Hal_8",
            "group/of/Gil_7.rar",
            "no-extension",
        ];
        assert_eq!(sources, expected);
        let expected = [
            ".DS_Store",
            "Bob_2_assignsubmission_onlinetext/onlinetext.html",
            "Dan_4/config.json",
            "Eve_5/ (nothing in it)",
            "__MACOSX",
            "index.html",
            "notes.txt",
            "rules.docx",
        ];
        assert_eq!(skipped, expected);
    }

    #[test]
    fn what_is_named_itself_is_a_submission_whatever_it_is() {
        let class = class(&["notes.txt", "a/config.json"]);
        let paths = ["notes.txt", "a"].map(|name| class.path().join(name));
        let found = collect(&paths, Path::new("out"), &TreeSpec::default()).unwrap();
        assert_eq!(found.sources, paths.map(|path| Source::given(&path)));
    }

    #[test]
    fn a_folder_without_any_says_what_was_looked_for() {
        for (files, said) in
            [(&["a.txt", "b/"][..], "it holds a.txt, b/ (nothing in it)"), (&[][..], "it is empty")]
        {
            let class = class(files);
            let paths = [class.path().to_owned()];
            let error =
                collect(&paths, Path::new("out"), &TreeSpec::default()).unwrap_err().to_string();
            assert!(error.contains("there is no submission: expected archives (.zip"), "{error}");
            assert!(error.ends_with(said), "{error}");
        }
    }

    #[test]
    fn many_skipped_files_are_counted() {
        let skipped = (0..20).map(|i| format!("{i}.txt")).collect();
        let collected = Collected { sources: Vec::new(), skipped };
        assert!(collected.skipped().unwrap().ends_with("11.txt and 8 more"));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_among_submissions_is_one_and_a_link_to_a_class_is_followed() {
        let class = class(&["class/ann.zip", "secret/src/lib.rs"]);
        std::os::unix::fs::symlink(class.path().join("secret"), class.path().join("class/eve"))
            .unwrap();
        std::os::unix::fs::symlink(class.path().join("class"), class.path().join("link")).unwrap();
        let paths = [class.path().join("link")];
        let found = collect(&paths, Path::new("out"), &TreeSpec::default()).unwrap();
        let names: Vec<&str> = found.sources.iter().map(|source| source.name.as_str()).collect();
        assert_eq!(names, ["ann.zip", "eve"]);
    }
}
