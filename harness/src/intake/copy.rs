//! The private copy: admits entries one by one, writes their bytes below the destination, counts
//! and hashes what really comes. Shared by zip, tar and folder.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::Path;

use flate2::Crc;
use sha2::{Digest, Sha256};
use unicode_normalization::UnicodeNormalization as _;

use super::finding::{Finding, Findings};
use super::limits::{ArchiveLimits, mib};
use super::name::{Backslashes, safe_path};
use super::submission::{
    Format, IntakeError, Refusal, Submission, SubmittedFile, archive_by_name, archive_magic,
};
use super::tree::{CONFIG_FILE, TreeSpec};
use crate::files::hex;
use crate::harmless::printable;

/// Why reading stops before the end.
pub(super) enum Stop {
    /// The submission is refused; the findings say why.
    Refused,
    /// The destination or the source cannot be used; not the submission's fault.
    Io(IntakeError),
}

impl From<IntakeError> for Stop {
    fn from(error: IntakeError) -> Self {
        Self::Io(error)
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum EntryKind {
    File,
    Folder,
}

/// What becomes of an entry.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum EntryAction {
    /// To be written at this path.
    File(String),
    /// Nothing to write; folders are made when a file needs them.
    Folder,
    /// Junk that is left out.
    Ignored,
    /// A finding was recorded; the submission as a whole will be refused.
    Refused,
}

/// What was written of one file.
pub(super) struct Written {
    pub(super) bytes: u64,
    pub(super) crc32: u32,
}

pub(super) struct PrivateCopy<'a> {
    dest: &'a Path,
    tree: &'a TreeSpec,
    pub(super) limits: &'a ArchiveLimits,
    pub(super) findings: Findings,
    pub(super) backslashes: Backslashes,
    /// The bytes of names that are not UTF-8, by what they are written as.
    replaced: HashMap<String, Option<Vec<u8>>>,
    files: BTreeMap<String, Option<SubmittedFile>>,
    folders: BTreeSet<String>,
    /// Lower-cased path to the first spelling seen.
    spellings: HashMap<String, String>,
    ignored: BTreeMap<String, u64>,
    headers: u64,
    entries: u64,
    total_bytes: u64,
}

impl<'a> PrivateCopy<'a> {
    /// Starts a copy into `dest`, which must be an empty folder.
    pub(super) fn new(
        dest: &'a Path,
        tree: &'a TreeSpec,
        limits: &'a ArchiveLimits,
    ) -> Result<Self, IntakeError> {
        let mut entries = fs::read_dir(dest).map_err(|e| IntakeError::io("list", dest, e))?;
        if entries.next().is_some() {
            return Err(IntakeError::DestinationNotEmpty { path: dest.to_owned() });
        }
        Ok(Self {
            dest,
            tree,
            limits,
            findings: Findings::default(),
            backslashes: Backslashes::default(),
            replaced: HashMap::new(),
            files: BTreeMap::new(),
            folders: BTreeSet::new(),
            spellings: HashMap::new(),
            ignored: BTreeMap::new(),
            headers: 0,
            entries: 0,
            total_bytes: 0,
        })
    }

    /// Records an error about the entry of that raw name.
    pub(super) fn refuse(&mut self, finding: Finding) -> Stop {
        self.findings.push(finding);
        Stop::Refused
    }

    /// Counts one entry, its name unread (links, extended headers and the like count too).
    pub(super) fn count_entry(&mut self) -> Result<(), Stop> {
        self.headers += 1;
        if self.headers > self.limits.most_headers() {
            return Err(self.refuse(too_many(self.limits.most_headers())));
        }
        Ok(())
    }

    /// Counts what is not ignored.
    pub(super) fn count_kept(&mut self) -> Result<(), Stop> {
        self.entries += 1;
        match self.entries.cmp(&self.limits.max_entries.saturating_add(1)) {
            Ordering::Less => Ok(()),
            Ordering::Equal => Err(self.refuse(too_many(self.limits.max_entries))),
            // It was said.
            Ordering::Greater => Err(Stop::Refused),
        }
    }

    /// Whether an entry that is neither a file nor a folder lies where all is ignored; counts it then.
    pub(super) fn is_ignored(&mut self, raw: &[u8]) -> bool {
        let Ok(safe) = safe_path(raw, self.limits) else { return false };
        let Some(pattern) = self.tree.ignored_by(&safe.path) else { return false };
        *self.ignored.entry(printable(pattern)).or_default() += 1;
        true
    }

    /// Checks the name of an entry that was counted, and its place beside the others.
    pub(super) fn accept(&mut self, raw: &[u8], kind: EntryKind) -> EntryAction {
        let safe = match safe_path(raw, self.limits) {
            Ok(safe) => safe,
            Err(finding) => {
                self.findings.push(finding);
                return EntryAction::Refused;
            }
        };
        let path = safe.path;
        if path.is_empty() {
            if kind == EntryKind::Folder {
                return EntryAction::Folder;
            }
            self.findings.push(Finding::error("name_empty", "a file without a name"));
            return EntryAction::Refused;
        }
        if let Some(pattern) = self.tree.ignored_by(&path) {
            *self.ignored.entry(printable(pattern)).or_default() += 1;
            return EntryAction::Ignored;
        }
        if self.count_kept().is_err() {
            return EntryAction::Refused;
        }
        let first = self.replaced.entry(path.clone()).or_insert_with(|| safe.replaced.clone());
        if *first != safe.replaced {
            let message =
                "two names are written so, one with bytes that are not UTF-8: shown as _xHH";
            let finding = Finding::error("name_written_alike", message).at(path);
            self.findings.push(finding.hint("use plain letters in file names"));
            return EntryAction::Refused;
        }
        if safe.replaced.is_some() {
            self.findings.push(
                Finding::warning(
                    "name_not_utf8",
                    "the name is not UTF-8; other bytes are shown as _xHH",
                )
                .at(path.as_str())
                .hint("use plain letters in file names"),
            );
        }
        self.note_spelling(&path);
        let parents: Vec<&str> = path.match_indices('/').map(|(i, _)| &path[..i]).collect();
        let is_both = parents.iter().any(|parent| self.files.contains_key(*parent))
            || match kind {
                EntryKind::File => self.folders.contains(&path),
                EntryKind::Folder => self.files.contains_key(&path),
            };
        if is_both {
            self.findings.push(
                Finding::error("file_and_folder", "the same path is a file and a folder").at(path),
            );
            return EntryAction::Refused;
        }
        self.folders.extend(parents.into_iter().map(str::to_owned));
        match kind {
            EntryKind::Folder => {
                self.folders.insert(path);
                EntryAction::Folder
            }
            EntryKind::File => {
                // A second of this name must hold the same, see `write`.
                self.files.entry(path.clone()).or_default();
                EntryAction::File(path)
            }
        }
    }

    /// Warns where two paths differ only in case: they are one path on Windows and macOS.
    fn note_spelling(&mut self, path: &str) {
        let ends = path.match_indices('/').map(|(i, _)| i).chain([path.len()]);
        for end in ends {
            let part = &path[..end];
            // A letter with an accent is one character or two.
            let plain: String = part.to_lowercase().nfc().collect();
            let Some(first) = self.spellings.get(&plain) else {
                self.spellings.insert(plain, part.to_owned());
                continue;
            };
            if first != part {
                let message = if first.to_lowercase() == part.to_lowercase() {
                    format!("differs only in case from '{first}'")
                } else {
                    format!("looks like '{first}': its accents are written in another way")
                };
                self.findings.push(
                    Finding::warning("case_collision", message)
                        .at(part)
                        .hint("use one spelling; both are the same file on Windows and macOS"),
                );
                // The parts below it follow from this one.
                return;
            }
        }
    }

    /// Counts `n` more bytes of content towards the total.
    pub(super) fn count_bytes(&mut self, n: u64, path: &str) -> Result<(), Stop> {
        self.total_bytes += n;
        if self.total_bytes > mib(self.limits.max_total_mib) {
            let message =
                format!("contents exceed the limit of {} MiB in total", self.limits.max_total_mib);
            return Err(self.refuse(
                Finding::error("limit_total", message)
                    .at(path)
                    .hint("submit only the files of the tree"),
            ));
        }
        Ok(())
    }

    /// The content of a file that came before, by its raw name; none where none came, or nothing is kept.
    pub(super) fn earlier(&self, raw: &[u8]) -> Result<Option<File>, Stop> {
        let Ok(safe) = safe_path(raw, self.limits) else { return Ok(None) };
        let came = self.files.get(&safe.path).is_some_and(Option::is_some);
        if !came || self.findings.has_errors() {
            return Ok(None);
        }
        let path = self.dest.join(&safe.path);
        Ok(Some(File::open(&path).map_err(|e| IntakeError::io("read", &path, e))?))
    }

    /// Writes one admitted file from `reader` up to its end, and counts what comes.
    ///
    /// `packed_bytes` is the size of what `reader` unpacks, for the ratio. Once the submission is
    /// refused the bytes are read and counted, but not kept.
    ///
    /// The inner error is `reader`'s.
    pub(super) fn write(
        &mut self,
        path: &str,
        reader: &mut dyn Read,
        packed_bytes: Option<u64>,
    ) -> Result<io::Result<Written>, Stop> {
        let first = self.files.get(path).cloned().flatten();
        let is_kept = first.is_none() && !self.findings.has_errors();
        let mut out = if is_kept { self.create(path)? } else { None };
        let mut sha256 = Sha256::new();
        let mut crc = Crc::new();
        let mut bytes = 0u64;
        let mut buffer = vec![0u8; 64 * 1024];
        loop {
            let n = match reader.read(&mut buffer) {
                Ok(0) => break,
                Ok(n) => n,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                Err(e) => return Ok(Err(e)),
            };
            let chunk = &buffer[..n];
            if bytes == 0
                && let Some(kind) = archive_magic(chunk).or_else(|| archive_by_name(path))
            {
                self.findings.push(
                    Finding::warning(
                        "nested_archive",
                        format!("an archive ({kind}) inside the submission is not opened"),
                    )
                    .at(path)
                    .hint("put its files into the tree themselves"),
                );
            }
            bytes += n as u64;
            if bytes > mib(self.limits.max_file_mib) {
                let message =
                    format!("the file exceeds the limit of {} MiB", self.limits.max_file_mib);
                return Err(self.refuse(Finding::error("limit_file", message).at(path)));
            }
            if packed_bytes.is_some_and(|packed| self.limits.ratio_exceeded(bytes, packed)) {
                let message =
                    format!("unpacks to more than {} times its packed size", self.limits.max_ratio);
                return Err(self.refuse(Finding::error("limit_ratio", message).at(path)));
            }
            self.count_bytes(n as u64, path)?;
            sha256.update(chunk);
            crc.update(chunk);
            if let Some(file) = &mut out {
                file.write_all(chunk)
                    .map_err(|e| IntakeError::io("write", &self.dest.join(path), e))?;
            }
        }
        let sha256 = hex(&sha256.finalize());
        if let Some(first) = first {
            self.findings.push(second(path, first.sha256 == sha256));
            return Ok(Ok(Written { bytes, crc32: crc.sum() }));
        }
        self.files
            .insert(path.to_owned(), Some(SubmittedFile { path: path.to_owned(), bytes, sha256 }));
        Ok(Ok(Written { bytes, crc32: crc.sum() }))
    }

    /// Creates a new file; `None` where its name is taken (a file system that ignores case).
    fn create(&mut self, path: &str) -> Result<Option<File>, Stop> {
        let full = self.dest.join(path);
        if let Some(parent) = full.parent() {
            fs::create_dir_all(parent).map_err(|e| IntakeError::io("create folder", parent, e))?;
        }
        match File::create_new(&full) {
            Ok(file) => Ok(Some(file)),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {
                self.findings.push(
                    Finding::error(
                        "case_collision",
                        "the name is taken by one that differs only in case",
                    )
                    .at(path),
                );
                Ok(None)
            }
            Err(e) => Err(IntakeError::io("create", &full, e).into()),
        }
    }

    /// Ends the copy after reading ended with `result`: lists it, or empties the destination.
    pub(super) fn finish(
        mut self,
        name: &str,
        format: Format,
        result: Result<(), Stop>,
    ) -> Result<Submission, IntakeError> {
        if let Err(Stop::Io(error)) = result {
            clear(self.dest)?;
            return Err(error);
        }
        for (pattern, count) in std::mem::take(&mut self.ignored) {
            self.findings.push(Finding::note("ignored", format!("{count} ignored: {pattern}")));
        }
        let mut files: Vec<SubmittedFile> = self.files.into_values().flatten().collect();
        if files.is_empty() && !self.findings.has_errors() {
            self.findings.push(
                Finding::error("empty", "the submission holds no files")
                    .hint("archive the folder that holds config.json"),
            );
        }
        if self.findings.has_errors() {
            clear(self.dest)?;
            return Err(IntakeError::Refused(Box::new(Refusal {
                name: printable(name),
                format: Some(format),
                findings: self.findings.without_repetition().into_vec(),
            })));
        }
        open_to_readers(self.dest, &self.folders, &files)?;
        let wrapped_in = wrapping_folder(&files, self.tree);
        let mut root = self.dest.to_owned();
        if let Some(folder) = &wrapped_in {
            root.push(folder);
            for file in &mut files {
                file.path.drain(..=folder.len());
            }
            self.findings.push(
                Finding::note(
                    "wrapped",
                    "one wrapping folder: taken as the root of the submission",
                )
                .at(format!("{folder}/")),
            );
        }
        files.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(Submission {
            name: printable(name),
            format,
            root,
            wrapped_in,
            digest: digest(&files),
            files,
            findings: self.findings.without_repetition().into_vec(),
        })
    }
}

fn too_many(limit: u64) -> Finding {
    Finding::error("limit_entries", format!("more than {limit} entries"))
        .hint("submit only the files of the tree, no build folder")
}

/// What to say of a second entry of one name: programs differ in which of the two they take.
fn second(path: &str, is_same: bool) -> Finding {
    let finding = if is_same {
        Finding::warning("duplicate_entry", "it stands twice in the archive, with the same content")
    } else {
        let message = "expected one entry of this name, found a second with another content";
        Finding::error("duplicate_entry", message)
    };
    finding.at(path).hint("make a new archive instead of adding to an old one")
}

/// Lets everybody read a copy, whatever the user's umask is: under root, whoever looks at it
/// (decoders, the compiler) is another user. The folder around it keeps others out.
fn open_to_readers(
    dest: &Path,
    folders: &BTreeSet<String>,
    files: &[SubmittedFile],
) -> Result<(), IntakeError> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let open = |path: &Path, mode| {
            let mode = fs::Permissions::from_mode(mode);
            fs::set_permissions(path, mode).map_err(|e| IntakeError::io("open", path, e))
        };
        open(dest, 0o755)?;
        // A folder without a file in it was not made.
        let mut made = folders.iter().map(|folder| dest.join(folder)).filter(|path| path.is_dir());
        made.try_for_each(|path| open(&path, 0o755))?;
        files.iter().try_for_each(|file| open(&dest.join(&file.path), 0o644))?;
    }
    Ok(())
}

/// The single folder that holds everything, unless it is one of the tree's own.
fn wrapping_folder(files: &[SubmittedFile], tree: &TreeSpec) -> Option<String> {
    let (top, _) = files.first()?.path.split_once('/')?;
    let inside = |path: &str| path.strip_prefix(top).is_some_and(|rest| rest.starts_with('/'));
    if !files.iter().all(|file| inside(&file.path)) {
        return None;
    }
    let config = format!("{top}/{CONFIG_FILE}");
    (!tree.is_top_folder(top) || files.iter().any(|file| file.path == config))
        .then(|| top.to_owned())
}

/// SHA-256 over the sorted files: for each the length of its path (u64, little endian), the path
/// and the SHA-256 of its content. The same for a zip, a tar and a folder with the same files.
fn digest(files: &[SubmittedFile]) -> String {
    let mut sha256 = Sha256::new();
    for file in files {
        sha256.update((file.path.len() as u64).to_le_bytes());
        sha256.update(&file.path);
        sha256.update(&file.sha256);
    }
    hex(&sha256.finalize())
}

/// Removes what was written; the destination was empty before.
pub(super) fn clear(dest: &Path) -> Result<(), IntakeError> {
    let entries = fs::read_dir(dest).map_err(|e| IntakeError::io("list", dest, e))?;
    for entry in entries {
        let path = entry.map_err(|e| IntakeError::io("list", dest, e))?.path();
        let is_dir = path.symlink_metadata().is_ok_and(|m| m.is_dir());
        let removed = if is_dir { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
        removed.map_err(|e| IntakeError::io("remove", &path, e))?;
    }
    Ok(())
}
