//! Writing conforming archives: `pack` from a working folder, `fix` from a nearly right submission.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{self, Cursor, Write};
use std::path::{Path, PathBuf};

use ::zip::write::SimpleFileOptions;
use ::zip::{CompressionMethod, DateTime, ZipWriter};
use serde::{Deserialize, Serialize};

use super::copy::EntryKind;
use super::finding::{Finding, Severity};
use super::limits::ArchiveLimits;
use super::submission::{Format, IntakeError, Refusal, Submission};
use super::submitted_config::{Field, SubmittedConfig};
use super::tree::TreeSpec;
use super::tree_lost::is_source;
use super::tree_match::{Mark, Matched, TreeLine, is_choice, match_tree};
use super::unpack::{copy_folder, format_of_bytes, unpack_bytes};
use super::validate::{Validation, validate_submission};
use crate::columns::count;
use crate::files::{write_new, write_whole};

/// An archive that was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Packed {
    /// Where it lies.
    pub archive: PathBuf,
    /// Path in the source and path in the archive, sorted by the latter.
    pub files: Vec<(String, String)>,
    /// Paths in the source that are not in the archive, sorted.
    pub left_out: Vec<String>,
    /// The archive's own validation; its tree is the handout's.
    pub validation: Validation,
}

/// Packs a working folder: only what the tree asks for, the bonus images under their own name.
/// The same files give the same bytes. `out` is the archive to write, or a folder in which it is
/// named by the credentials ([`archive_name`]).
///
/// # Errors
/// [`IntakeError::Refused`] when the archive would not conform; nothing is then written.
pub fn pack(
    dir: &Path,
    out: &Path,
    tree: &TreeSpec,
    limits: &ArchiveLimits,
) -> Result<Packed, IntakeError> {
    let is_wanted = |path: &str, kind| tree.may_hold(path, kind == EntryKind::Folder);
    let scratch = scratch_folder()?;
    let submission = copy_folder(dir, &is_wanted, scratch.path(), tree, limits)?;
    write(&submission, out, tree, limits, &|validation| validation.conforms, write_over_archive)
}

fn scratch_folder() -> Result<tempfile::TempDir, IntakeError> {
    crate::files::private_folder("umbra-pack-")
        .map_err(|e| IntakeError::io("create a folder in", &std::env::temp_dir(), e))
}

/// `a2_first_last.zip` by the credentials: lower case, other signs than letters and digits as `-`.
pub fn archive_name(config: &SubmittedConfig, tree: &TreeSpec) -> String {
    let plain = |field: &Option<Field>| {
        let text = field.as_ref().map(|field| field.text.to_lowercase()).unwrap_or_default();
        let parts: Vec<&str> =
            text.split(|c: char| !c.is_alphanumeric()).filter(|part| !part.is_empty()).collect();
        let name: String = parts.join("-").chars().take(40).collect();
        if name.is_empty() { "unknown".to_owned() } else { name }
    };
    format!("{}_{}_{}.zip", tree.name_prefix, plain(&config.first_name), plain(&config.last_name))
}

/// Repacks a nearly right submission: wrong level, wrong folders, other names, junk and stray files, an archive
/// made in an odd way. What `config.json` says is the student's to mend. `out` is a new file: nothing is written over.
///
/// # Errors
/// [`IntakeError::Refused`] when something is missing that moving files cannot mend; nothing is
/// then written.
pub fn fix(
    submission: &Submission,
    out: &Path,
    tree: &TreeSpec,
    limits: &ArchiveLimits,
) -> Result<Packed, IntakeError> {
    let mut findings = match_tree(submission, tree)?.findings;
    findings.retain(is_choice);
    if !findings.is_empty() {
        // Nobody guesses whose it is, or which counts.
        findings.iter_mut().for_each(|finding| finding.severity = Severity::Error);
        return Err(refused(submission, findings));
    }
    write(submission, out, tree, limits, &Validation::follows_tree, write_new)
}

/// What [`fix`] would do to the tree, in words; nothing where it cannot mend it, or need not.
pub fn mends(submission: &Submission, validation: &Validation, tree: &TreeSpec) -> Option<String> {
    let places = places(submission, &validation.tree, &[], tree).ok()?;
    let moved: Vec<_> = places
        .iter()
        .filter(|(to, from)| to != from && !tree.file_at(to).is_some_and(|file| file.accepts(from)))
        .collect();
    let (to, from) = moved.first()?;
    let mut said = format!("moves {from} to {to}");
    if moved.len() > 1 {
        said += &format!(", and {} more", moved.len() - 1);
    }
    let source = left_out(submission, &places).filter(|path| is_source(path)).count();
    if source > 0 {
        said += &format!("; leaves out {} outside src/", count(source, "source file"));
    }
    Some(said)
}

/// The files of a submission that are not packed.
fn left_out<'a>(
    submission: &'a Submission,
    places: &BTreeMap<String, String>,
) -> impl Iterator<Item = &'a str> {
    let packed: BTreeSet<String> = places.values().cloned().collect();
    let paths = submission.files.iter().map(|file| file.path.as_str());
    paths.filter(move |path| !packed.contains(*path))
}

/// Writes an archive of what belongs to the tree, where its validation is good enough.
fn write(
    submission: &Submission,
    out: &Path,
    tree: &TreeSpec,
    limits: &ArchiveLimits,
    is_good: &dyn Fn(&Validation) -> bool,
    put: fn(&Path, &[u8]) -> io::Result<()>,
) -> Result<Packed, IntakeError> {
    let Matched { lines, findings } = match_tree(submission, tree)?;
    let places = places(submission, &lines, &findings, tree)?;
    let bytes = zip_bytes(submission, &places)?;
    let scratch = scratch_folder()?;
    // The archive as whoever grades it will see it.
    let copy = unpack_bytes(&bytes, "packed.zip", scratch.path(), tree, limits)?;
    let mut validation = validate_submission(&copy, tree)?;
    if !is_good(&validation) {
        return Err(refused(submission, validation.findings));
    }
    let archive = match &validation.config {
        Some(config) if out.is_dir() => out.join(archive_name(config, tree)),
        _ => out.to_owned(),
    };
    validation.name = archive.file_name().unwrap_or_default().to_string_lossy().into_owned();
    put(&archive, &bytes).map_err(|e| IntakeError::io("write", &archive, e))?;
    let left_out = left_out(submission, &places).map(str::to_owned).collect();
    Ok(Packed {
        archive,
        left_out,
        files: places.into_iter().map(|(to, from)| (from, to)).collect(),
        validation,
    })
}

/// Writes an archive, in place of an earlier one at most.
fn write_over_archive(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let other = |message| Err(io::Error::new(io::ErrorKind::AlreadyExists, message));
    match path.metadata() {
        Ok(there) if !there.is_file() => other("it is there, and no file"),
        Ok(_) if format_of_bytes(&fs::read(path)?) != Some(Format::Zip) => {
            other("it is there, and no zip archive")
        }
        // Folders are not made.
        Err(_) if path.parent().is_some_and(|folder| !folder.join(".").is_dir()) => {
            Err(io::Error::new(io::ErrorKind::NotFound, "there is no such folder"))
        }
        _ => write_whole(path, bytes),
    }
}

fn refused(submission: &Submission, mut findings: Vec<Finding>) -> IntakeError {
    findings.sort_by_key(|finding| finding.severity);
    IntakeError::Refused(Box::new(Refusal {
        name: submission.name.clone(),
        format: Some(submission.format),
        findings,
    }))
}

/// Path in the archive to path in the copy, for everything that belongs to the tree. `findings` say what is missing.
fn places(
    submission: &Submission,
    lines: &[TreeLine],
    findings: &[Finding],
    tree: &TreeSpec,
) -> Result<BTreeMap<String, String>, IntakeError> {
    let missing: Vec<&str> = lines
        .iter()
        .filter(|line| line.mark == Mark::Missing)
        .filter_map(|line| line.expected.as_deref())
        .collect();
    if !missing.is_empty() {
        let is_missing = |finding: &&Finding| {
            finding.path.as_deref().is_some_and(|path| missing.contains(&path))
        };
        return Err(refused(submission, findings.iter().filter(is_missing).cloned().collect()));
    }
    let mut moves: Vec<(&str, &str)> = Vec::new();
    for line in lines {
        if let (Some(expected), Some(found)) = (&line.expected, &line.found)
            && submission.file(found).is_some()
        {
            moves.push((expected, found));
        }
    }
    for path in submission.files.iter().map(|file| file.path.as_str()) {
        let is_moved = moves.iter().any(|(_, found)| *found == path);
        if !is_moved && tree.open_folder_of(path).is_some() {
            moves.push((path, path));
        }
    }
    let content = |path: &str| submission.file(path).map(|file| &file.sha256);
    let mut places = BTreeMap::new();
    for (to, from) in moves {
        if let Some(other) = places.insert(to.to_owned(), from.to_owned())
            && content(&other) != content(from)
        {
            let finding = Finding::error(
                "fix_collision",
                format!("'{from}' and '{other}' belong to the same place"),
            );
            return Err(refused(submission, vec![finding.at(to).hint("keep one of them")]));
        }
    }
    Ok(places)
}

/// A zip with fixed times, order and permissions.
fn zip_bytes(
    submission: &Submission,
    places: &BTreeMap<String, String>,
) -> Result<Vec<u8>, IntakeError> {
    let failed = |e: ::zip::result::ZipError| {
        refused(submission, vec![Finding::error("pack_failed", format!("cannot be packed: {e}"))])
    };
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(6))
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (to, from) in places {
        let path = submission.root.join(from);
        let content = fs::read(&path).map_err(|e| IntakeError::io("read", &path, e))?;
        writer.start_file(to.as_str(), options).map_err(failed)?;
        writer.write_all(&content).map_err(|e| IntakeError::io("pack", &path, e))?;
    }
    Ok(writer.finish().map_err(failed)?.into_inner())
}
