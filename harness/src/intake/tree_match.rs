//! Compares the found files with the expected tree.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::finding::Finding;
use super::tree::{CONFIG_FILE, TreeFile, TreeSpec};
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

/// Lays `paths` (sorted, relative to the root) beside the tree.
pub(super) fn match_tree(paths: &[&str], tree: &TreeSpec) -> Vec<TreeLine> {
    let mut taken: BTreeSet<&str> = BTreeSet::new();
    let mut lines = Vec::new();
    // Files in their place first, so that no search for a lost file takes them.
    let placed: Vec<Option<&str>> = tree
        .files
        .iter()
        .map(|file| {
            let found = std::iter::once(&file.path)
                .chain(&file.aliases)
                .find_map(|wanted| paths.iter().copied().find(|path| path == wanted));
            taken.extend(found);
            found
        })
        .collect();
    for (file, found) in tree.files.iter().zip(placed) {
        let found = found.or_else(|| {
            let lost = find_lost(file, paths, &taken);
            taken.extend(lost);
            lost
        });
        lines.push(line_of(file, found));
    }
    for folder in &tree.open_folders {
        let inside = |path: &&&str| {
            path.strip_prefix(folder.as_str()).is_some_and(|rest| rest.starts_with('/'))
        };
        let count = paths.iter().filter(inside).filter(|path| !taken.contains(**path)).count();
        taken.extend(paths.iter().filter(inside));
        if count > 0 {
            lines.push(TreeLine {
                expected: Some(format!("{folder}/")),
                found: Some(format!("{folder}/")),
                mark: Mark::Ok,
                advice: format!("{count} further {}", if count == 1 { "file" } else { "files" }),
            });
        }
    }
    // Files beside a lost source folder belong to it.
    for path in paths.iter().filter(|path| !taken.contains(**path)) {
        let place = source_place(path, &lines, tree);
        lines.push(match place {
            Some(place) => TreeLine {
                advice: format!("move it to {place}"),
                expected: Some(place),
                found: Some((*path).to_owned()),
                mark: Mark::WrongPlace,
            },
            None => TreeLine {
                expected: None,
                found: Some((*path).to_owned()),
                mark: Mark::Unexpected,
                advice: "leave it out; it is not looked at".to_owned(),
            },
        });
    }
    lines
}

fn line_of(file: &TreeFile, found: Option<&str>) -> TreeLine {
    let (mark, advice) = match found {
        Some(path) if path == file.path => (Mark::Ok, String::new()),
        Some(path) if file.accepts(path) => (Mark::Ok, "accepted under this name too".to_owned()),
        Some(_) => (Mark::WrongPlace, format!("move it to {}", file.path)),
        None if file.required => (Mark::Missing, "add it".to_owned()),
        None => (Mark::Absent, "optional".to_owned()),
    };
    TreeLine { expected: Some(file.path.clone()), found: found.map(str::to_owned), mark, advice }
}

/// A file that is probably the expected one: the same path in another case, else the same name in
/// another folder, else a name that a system made of it; the shallowest one, and never one of two that
/// are equally likely.
fn find_lost<'a>(file: &TreeFile, paths: &[&'a str], taken: &BTreeSet<&str>) -> Option<&'a str> {
    let free = || paths.iter().copied().filter(|path| !taken.contains(path));
    let names: Vec<&String> = std::iter::once(&file.path).chain(&file.aliases).collect();
    if let Some(path) = free().find(|path| names.iter().any(|name| name.eq_ignore_ascii_case(path)))
    {
        return Some(path);
    }
    let base = |path: &str| path.rsplit('/').next().unwrap_or(path).to_lowercase();
    let named = |of: &dyn Fn(&str) -> String| -> Vec<&'a str> {
        free().filter(|path| names.iter().any(|name| base(name) == of(path))).collect()
    };
    let mut candidates = named(&base);
    if candidates.is_empty() {
        candidates = named(&|path| as_it_was(&base(path)));
    }
    let is_config = file.path == CONFIG_FILE;
    if candidates.is_empty() && is_config {
        candidates = free().filter(|path| may_be_config(&base(path))).collect();
    }
    candidates.sort_by_key(|path| path.matches('/').count());
    match candidates.as_slice() {
        [one] => Some(one),
        // It decides no points, and says whose submission it is.
        [first, ..] if is_config => Some(first),
        [first, second, ..] if first.matches('/').count() < second.matches('/').count() => {
            Some(first)
        }
        _ => None,
    }
}

/// Whether a file is probably the configuration under a name of its own: `config`, `my_config.json`, `conifg.json`.
fn may_be_config(name: &str) -> bool {
    let (stem, end) = name.rsplit_once('.').unwrap_or((name, ""));
    let is_text = ["", "json", "jsonc", "json5", "txt", "yaml", "yml", "toml"].contains(&end);
    let near = strsim::osa_distance(stem.trim_start_matches('.'), "config") <= 2;
    is_text && (near || stem.contains("config")) || name == ".config"
}

/// A name without what systems add to it: the `.txt` of an editor that hides it, the ` (1)` of a second
/// download, the ` - Copy` of a file manager.
fn as_it_was(name: &str) -> String {
    let name = name.strip_suffix(".txt").unwrap_or(name);
    let (stem, end) = name.rsplit_once('.').unwrap_or((name, ""));
    let numbered = stem.strip_suffix(')').and_then(|stem| stem.rsplit_once('('));
    let stem = match numbered {
        Some((before, number)) if number.bytes().all(|c| c.is_ascii_digit()) => before.trim_end(),
        _ => stem.strip_suffix(" - copy").or(stem.strip_suffix(" copy")).unwrap_or(stem),
    };
    format!("{stem}.{end}")
}

/// Where a file belongs that lies beside a source file in the wrong place: `code/lib.rs` found for
/// `src/lib.rs` means that `code/bsdfs/phong.rs` is `src/bsdfs/phong.rs`.
fn source_place(path: &str, lines: &[TreeLine], tree: &TreeSpec) -> Option<String> {
    lines.iter().filter(|line| line.mark == Mark::WrongPlace).find_map(|line| {
        let (expected, found) = (line.expected.as_ref()?, line.found.as_ref()?);
        let folder = tree.open_folder_of(expected)?;
        let rest = &expected[folder.len()..];
        // Where the whole folder moved, the part after it is the same in both.
        let moved = found.strip_suffix(rest).or_else(|| found.strip_suffix(&rest[1..]))?;
        let inside =
            if moved.is_empty() { path } else { path.strip_prefix(moved)?.strip_prefix('/')? };
        // At the root only Rust and shader files are surely source.
        let is_source =
            !moved.is_empty() || [".rs", ".wgsl"].iter().any(|end| inside.ends_with(end));
        is_source.then(|| format!("{folder}/{inside}"))
    })
}

/// What the comparison means for the verdict; `paths` are all that was found.
pub(super) fn tree_findings(lines: &[TreeLine], paths: &[&str]) -> Vec<Finding> {
    lines
        .iter()
        .filter_map(|line| {
            let expected = line.expected.clone().unwrap_or_default();
            let found = line.found.clone().unwrap_or_default();
            match line.mark {
                // An alias is as good as the name; the tree beside it shows both.
                Mark::Ok | Mark::Absent => None,
                Mark::Missing => Some(missing(expected, paths)),
                Mark::WrongPlace => {
                    let message = format!("expected at '{expected}'");
                    let finding = if expected == CONFIG_FILE {
                        // It is read all the same.
                        Finding::warning("tree_wrong_place", message)
                    } else {
                        Finding::error("tree_wrong_place", message)
                    };
                    Some(finding.at(found).hint("move it there, or let umbra validate --fix do it"))
                }
                Mark::Unexpected => Some(
                    Finding::warning("tree_unexpected", "not part of the expected tree")
                        .at(found)
                        .hint("leave it out; it is not looked at"),
                ),
            }
        })
        .collect()
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

/// The finding on a missing file; for a source file, it says whether the source is in another language.
fn missing(expected: String, paths: &[&str]) -> Finding {
    let end = |path: &str| path.rsplit_once('.').map(|(_, end)| end.to_lowercase());
    let ends: Vec<String> = paths.iter().filter_map(|path| end(path)).collect();
    let base = |path: &str| path.rsplit('/').next().unwrap_or(path).to_lowercase();
    let alike: Vec<&str> = paths.iter().copied().filter(|p| base(p) == base(&expected)).collect();
    if alike.len() > 1 {
        let named = alike.iter().take(3).map(|path| printable(path)).collect::<Vec<_>>().join(", ");
        let more = if alike.len() > 3 { ", ..." } else { "" };
        let message = format!(
            "expected once in the submission, found {} files of this name: {named}{more}",
            alike.len()
        );
        return Finding::error("tree_ambiguous", message)
            .at(expected)
            .hint("submit only one of them");
    }
    let own = end(&expected).filter(|end| end == "rs" && !ends.contains(end));
    let count = |own: &[&str]| ends.iter().filter(|end| own.contains(&end.as_str())).count();
    let other = LANGUAGES.iter().map(|(name, ends)| (count(ends), name)).max_by_key(|(n, _)| *n);
    match other.filter(|(count, _)| own.is_some() && *count > 0) {
        Some((count, name)) => Finding::error(
            "tree_language",
            format!("expected a renderer in Rust, found none; {count} files look like {name}"),
        )
        .hint("the renderer must be written in Rust: start from the template"),
        None => Finding::error("tree_missing", "expected in the submission, found nothing like it")
            .hint("add it, then pack again"),
    }
    .at(expected)
}
