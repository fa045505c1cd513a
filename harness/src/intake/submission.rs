//! The result of intake: the private copy of a submission, or why there is none.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::finding::Finding;

/// What a submission is, by its content.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// A folder.
    Folder,
    /// A `.zip`.
    Zip,
    /// A `.tar`.
    Tar,
    /// A `.tar.gz` or `.tgz`.
    TarGz,
}

/// One file of the private copy.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SubmittedFile {
    /// Path from the root of the submission.
    pub path: String,
    /// Size in bytes.
    pub bytes: u64,
    /// SHA-256 of the content, lower-case hexadecimal.
    pub sha256: String,
}

/// The private copy of a submission.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Submission {
    /// Name of the archive or folder as it was submitted.
    pub name: String,
    /// What it was.
    pub format: Format,
    /// Folder of the copy that corresponds to the root of the expected tree.
    pub root: PathBuf,
    /// The one wrapping folder, already part of `root`.
    pub wrapped_in: Option<String>,
    /// The files, sorted by path.
    pub files: Vec<SubmittedFile>,
    /// SHA-256 over sorted paths and contents; independent of the format and of wrapping.
    pub digest: String,
    /// What was seen on the way; no errors.
    pub findings: Vec<Finding>,
}

impl Submission {
    /// The file at `path`.
    pub fn file(&self, path: &str) -> Option<&SubmittedFile> {
        self.files.iter().find(|file| file.path == path)
    }
}

/// A submission that was refused as a whole; nothing of it was kept.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refusal {
    /// Name of the archive or folder as it was submitted.
    pub name: String,
    /// What it was, where that was told apart.
    pub format: Option<Format>,
    /// Why: at least one error.
    pub findings: Vec<Finding>,
}

/// Why there is no private copy.
#[derive(Debug, thiserror::Error)]
pub enum IntakeError {
    /// The submission's matter.
    #[error("submission '{}' refused: {}", .0.name, .0.findings.first().map(ToString::to_string).unwrap_or_default())]
    Refused(Box<Refusal>),
    /// The environment's matter.
    #[error("cannot {doing} '{path}': {source}")]
    Io {
        /// What was tried, such as `read`.
        doing: &'static str,
        /// On which path.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// The caller's fault: the copy must be alone in its folder.
    #[error("destination '{path}' is not empty")]
    DestinationNotEmpty {
        /// The destination.
        path: PathBuf,
    },
}

impl IntakeError {
    pub(crate) fn io(doing: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io { doing, path: path.to_owned(), source }
    }
}

/// The kind of a packed file by its first bytes.
pub(super) fn archive_magic(bytes: &[u8]) -> Option<&'static str> {
    const MAGIC: [(&[u8], &str); 14] = [
        (b"PK\x03\x04", "zip"),
        (b"\x1f\x8b", "gzip"),
        (b"Rar!\x1a\x07", "rar"),
        (b"7z\xbc\xaf\x27\x1c", "7z"),
        (b"BZh", "bzip2"),
        (b"\xfd7zXZ\0", "xz"),
        (b"\x28\xb5\x2f\xfd", "zstd"),
        (b"MSCF", "cab"),
        (b"\x1f\x9d", "compress"),
        (b"LZIP", "lzip"),
        (b"\x04\x22\x4d\x18", "lz4"),
        (b"!<arch>\n", "ar"),
        (b"070701", "cpio"),
        (b"070707", "cpio"),
    ];
    MAGIC.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|(_, kind)| *kind)
}

/// The kind of archive that a file is by its name alone: one without magic bytes at its begin, or a part of a split
/// one.
pub(super) fn archive_by_name(path: &str) -> Option<&'static str> {
    const ENDS: [&str; 12] =
        ["iso", "dmg", "egg", "alz", "lzh", "lha", "arj", "wim", "xar", "lzma", "sit", "sitx"];
    let end = path.rsplit_once('.')?.1.to_lowercase();
    // `a2.7z.002`, `a2.z01`, `a2.r00`
    let digits = end.trim_start_matches(['z', 'r']);
    let is_part = (end.len() == 3 && digits.len() >= 2 && end.len() - digits.len() <= 1)
        && digits.bytes().all(|byte| byte.is_ascii_digit());
    if is_part {
        return Some("a part of one");
    }
    ENDS.into_iter().find(|own| *own == end)
}
