//! The entry of intake: decides the format by content and makes the private copy.

use std::fs;
use std::io::Read;
use std::path::Path;

use super::copy::{EntryAction, EntryKind, PrivateCopy, Stop, clear};
use super::encoding::text_of;
use super::finding::{Finding, Severity};
use super::limits::{ArchiveLimits, mib};
use super::source_paths::lacks_files;
use super::submission::{Format, IntakeError, Refusal, Submission, archive_magic};
use super::tree::{TreeFile, TreeSpec};
use super::tree_lost::base;
use super::tree_match::is_source_of_any;
use super::{folder, gz, tar, zip};
use crate::harmless::printable;

/// Copies the submission at `source` (archive or folder) once, without following links, into the
/// empty folder `dest`.
///
/// # Errors
/// [`IntakeError::Refused`] with every reason found; `dest` is then empty again. The others are
/// matters of the machine or the caller.
pub fn unpack(
    source: &Path,
    dest: &Path,
    tree: &TreeSpec,
    limits: &ArchiveLimits,
) -> Result<Submission, IntakeError> {
    match read_archive(source, limits)? {
        Some(bytes) => unpack_bytes(&bytes, &name_of(source), dest, tree, limits),
        None => with_source(copy_working_folder(source, dest, tree, limits)?, dest, tree),
    }
}

/// What may keep the source from being seen.
pub(super) fn is_cause(finding: &Finding) -> bool {
    ["nested_archive", NO_END].contains(&finding.code.as_str())
}

/// The code of the warning on a tar without an end.
const NO_END: &str = "tar_no_end";

/// Refuses a submission without source where that may be in an archive that is not opened, and one that was cut off and
/// lacks files of the tree: then nobody has seen what was submitted.
fn with_source(
    submission: Submission,
    dest: &Path,
    tree: &TreeSpec,
) -> Result<Submission, IntakeError> {
    let paths = || submission.files.iter().map(|file| file.path.as_str());
    let lacks = |file: &TreeFile| !paths().any(|path| base(path) == base(&file.path));
    let required = || tree.files.iter().filter(|file| file.required);
    let mut sources = required().filter(|file| is_source_of_any(&file.path)).peekable();
    // A file or two of source beside an archive are not what was submitted.
    let has_source = match sources.peek() {
        Some(_) => !sources.any(lacks),
        None => paths().any(is_source_of_any),
    };
    let is_whole = !required().any(lacks) && !names_what_is_lost(&submission, dest);
    let hides = |finding: &Finding| match finding.code.as_str() {
        NO_END => !is_whole,
        _ => is_cause(finding) && !has_source,
    };
    if !submission.findings.iter().any(hides) {
        return Ok(submission);
    }
    let what =
        if has_source { "files of the tree are missing" } else { "no source is there besides" };
    clear(dest)?;
    let mut findings = submission.findings;
    for finding in findings.iter_mut().filter(|finding| is_cause(finding)) {
        finding.severity = Severity::Error;
        finding.message += &format!(", and {what}");
    }
    findings.sort_by_key(|finding| finding.severity);
    let Submission { name, format, .. } = submission;
    Err(IntakeError::Refused(Box::new(Refusal { name, format: Some(format), findings })))
}

/// Refuses an archive that holds nothing which belongs to the tree: it may hold the submission in a form that is not
/// known, and nobody has seen that.
///
/// # Errors
/// [`IntakeError::Refused`] for such a one; `dest`, its copy, is then empty again.
pub(crate) fn known(
    submission: Submission,
    dest: &Path,
    tree: &TreeSpec,
) -> Result<Submission, IntakeError> {
    let is_known = |path: &str| {
        let is_named = tree.files.iter().any(|file| base(path) == base(&file.path));
        is_named || is_source_of_any(path) || base(path).ends_with(".exr")
    };
    let files = &submission.files;
    if files.iter().any(|file| is_known(&file.path)) {
        return Ok(submission);
    }
    let named = files.iter().take(NAMED).map(|file| printable(&file.path)).collect::<Vec<_>>();
    let more = files.len().saturating_sub(NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let message =
        format!("nothing in it belongs to the tree; it holds only {}{more}", named.join(", "));
    let finding =
        Finding::error("nothing_known", message).hint("pack the folder that holds config.json");
    clear(dest)?;
    let Submission { name, format, mut findings, .. } = submission;
    findings.insert(0, finding);
    Err(IntakeError::Refused(Box::new(Refusal { name, format: Some(format), findings })))
}

/// Number of files that a message names.
const NAMED: usize = 3;

/// Whether the source names files that are not there.
fn names_what_is_lost(submission: &Submission, dest: &Path) -> bool {
    let paths: Vec<&str> = submission.files.iter().map(|file| file.path.as_str()).collect();
    let lacks = |path: &&str| {
        let text = fs::read(dest.join(path)).unwrap_or_default();
        path.ends_with(".rs") && lacks_files(path, &text_of(&text), &paths)
    };
    paths.iter().any(lacks)
}

/// Copies a folder; where that is refused for what is no part of the tree, without it, as `pack` would.
fn copy_working_folder(
    source: &Path,
    dest: &Path,
    tree: &TreeSpec,
    limits: &ArchiveLimits,
) -> Result<Submission, IntakeError> {
    let refusal = match copy_folder(source, &|_, _| true, dest, tree, limits) {
        Err(IntakeError::Refused(refusal)) => refusal,
        other => return other,
    };
    let wanted = |path: &str, kind| tree.may_hold(path, kind == EntryKind::Folder);
    match copy_folder(source, &wanted, dest, tree, limits) {
        Ok(mut submission)
            if submission.files.iter().any(|file| tree.open_folder_of(&file.path).is_some()) =>
        {
            let beyond = refusal.findings.into_iter().filter(|f| f.severity == Severity::Error);
            submission.findings.extend(beyond.map(|finding| {
                let message = format!("{}; only what belongs to the tree is read", finding.message);
                Finding { severity: Severity::Warning, message, ..finding }
            }));
            Ok(submission)
        }
        Ok(_) => {
            clear(dest)?;
            Err(IntakeError::Refused(refusal))
        }
        Err(IntakeError::Refused(_)) => Err(IntakeError::Refused(refusal)),
        other => other,
    }
}

/// The bytes of the archive at `source`, one more than is allowed at most; none of a folder.
///
/// # Errors
/// [`IntakeError::Refused`] when it is neither, a link among them: whoever submits may choose where it leads.
/// And when it cannot be read.
pub(crate) fn read_archive(
    source: &Path,
    limits: &ArchiveLimits,
) -> Result<Option<Vec<u8>>, IntakeError> {
    // Without a slash at the end, which would follow a link.
    let path = source.components().as_path();
    let refuse = |finding| refused(&name_of(source), None, finding);
    let metadata = path.symlink_metadata().map_err(|e| IntakeError::io("read", source, e))?;
    if metadata.is_dir() {
        return Ok(None);
    }
    if metadata.is_symlink() {
        let message = "expected an archive or a folder, found a symbolic link";
        return refuse(Finding::error("link", message).hint("name what it leads to"));
    }
    if !metadata.is_file() {
        let message = "expected an archive or a folder, found a device, fifo or socket";
        return refuse(Finding::error("not_a_file", message));
    }
    let file = folder::open_file(path).map_err(|e| IntakeError::io("read", source, e))?;
    if !file.metadata().is_ok_and(|opened| opened.is_file()) {
        let message = "it was exchanged while it was read";
        return refuse(Finding::error("changed_while_read", message));
    }
    let mut bytes = Vec::new();
    file.take(mib(limits.max_total_mib).saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(|e| IntakeError::io("read", source, e))?;
    Ok(Some(bytes))
}

/// Copies the files of an archive that was unpacked elsewhere: their paths and sizes, and their
/// contents one after the other. Neither is believed.
///
/// # Errors
/// As [`unpack`]; refused when paths, sizes and contents do not go together.
pub(crate) fn copy_unpacked(
    unpacked: &Submission,
    contents: &[u8],
    dest: &Path,
    tree: &TreeSpec,
    limits: &ArchiveLimits,
) -> Result<Submission, IntakeError> {
    let mut copy = PrivateCopy::new(dest, tree, limits)?;
    let result = write_unpacked(unpacked, contents, &mut copy);
    copy.finish(&unpacked.name, unpacked.format, result)
}

fn write_unpacked(
    unpacked: &Submission,
    mut contents: &[u8],
    copy: &mut PrivateCopy<'_>,
) -> Result<(), Stop> {
    let contradiction = |path: &str| {
        let message = "what was unpacked contradicts itself: a bug of Umbra's";
        Finding::error("decoder_answer", message).at(printable(path))
    };
    for file in &unpacked.files {
        copy.count_entry()?;
        // As it was in the archive.
        let folder = unpacked.wrapped_in.iter().map(|folder| format!("{folder}/"));
        let path = folder.collect::<String>() + &file.path;
        let size = usize::try_from(file.bytes).unwrap_or(usize::MAX);
        let Some((mut content, rest)) = contents.split_at_checked(size) else {
            return Err(copy.refuse(contradiction(&path)));
        };
        contents = rest;
        match copy.accept(path.as_bytes(), EntryKind::File) {
            EntryAction::File(admitted) if admitted == path => {
                copy.write(&path, &mut content, None)?
                    .map_err(|e| IntakeError::io("copy", Path::new(&path), e))?;
            }
            _ => return Err(copy.refuse(contradiction(&path))),
        }
    }
    if contents.is_empty() { Ok(()) } else { Err(copy.refuse(contradiction(""))) }
}

/// Copies the wanted part of a folder.
pub(super) fn copy_folder(
    source: &Path,
    is_wanted: &dyn Fn(&str, EntryKind) -> bool,
    dest: &Path,
    tree: &TreeSpec,
    limits: &ArchiveLimits,
) -> Result<Submission, IntakeError> {
    let mut copy = PrivateCopy::new(dest, tree, limits)?;
    let result = folder::read(source.components().as_path(), is_wanted, &mut copy);
    copy.finish(&name_of(source), Format::Folder, result)
}

/// The last component of a path, also of `.` and `..`.
pub(crate) fn name_of(source: &Path) -> String {
    let whole = source.canonicalize().unwrap_or_else(|_| source.to_owned());
    let name = source.file_name().or(whole.file_name()).unwrap_or(source.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Like [`unpack`], of the archive with these bytes. `name` only serves the messages. An archive that holds
/// nothing but another one is opened twice.
///
/// # Errors
/// As [`unpack`].
pub fn unpack_bytes(
    bytes: &[u8],
    name: &str,
    dest: &Path,
    tree: &TreeSpec,
    limits: &ArchiveLimits,
) -> Result<Submission, IntakeError> {
    with_source(unpack_twice(bytes, name, dest, tree, limits)?, dest, tree)
}

fn unpack_twice(
    bytes: &[u8],
    name: &str,
    dest: &Path,
    tree: &TreeSpec,
    limits: &ArchiveLimits,
) -> Result<Submission, IntakeError> {
    if format_of_bytes(bytes) == Some(Format::TarGz)
        && let Some(inner) = gz::packed_again(bytes, limits)
    {
        let found = Finding::warning("packed_twice", "compressed twice, one in the other");
        return within(found, unpack_once(&inner, name, dest, tree, limits));
    }
    let outer = unpack_once(bytes, name, dest, tree, limits)?;
    let [only] = &outer.files[..] else { return Ok(outer) };
    let path = outer.root.join(&only.path);
    let inner = fs::read(&path).map_err(|e| IntakeError::io("read", &path, e))?;
    if format_of_bytes(&inner).is_none() {
        return Ok(outer);
    }
    clear(dest)?;
    let mut message = format!("holds nothing but the archive '{}'", printable(&only.path));
    let inner = unpack_once(&inner, name, dest, tree, limits);
    if let Ok(Submission { files, root, .. }) = &inner
        && let [only] = &files[..]
        && fs::read(root.join(&only.path)).is_ok_and(|bytes| format_of_bytes(&bytes).is_some())
    {
        let third = printable(&only.path);
        message +=
            &format!(", and that nothing but '{third}', which is not opened: two are, not more");
    }
    within(Finding::warning("packed_twice", message), inner)
}

/// The result for the inner one of two archives, with the findings on the outer one.
fn within(
    found: Finding,
    inner: Result<Submission, IntakeError>,
) -> Result<Submission, IntakeError> {
    let found = found.hint("submit the inner archive itself");
    match inner {
        Ok(mut submission) => {
            submission.findings.retain(|finding| finding.code != "wrong_extension");
            submission.findings.insert(0, found);
            Ok(submission)
        }
        Err(IntakeError::Refused(mut refusal)) => {
            refusal.findings.push(found);
            Err(IntakeError::Refused(refusal))
        }
        error => error,
    }
}

/// Unpacks an archive; what is an archive in it stays one.
fn unpack_once(
    bytes: &[u8],
    name: &str,
    dest: &Path,
    tree: &TreeSpec,
    limits: &ArchiveLimits,
) -> Result<Submission, IntakeError> {
    let mut copy = PrivateCopy::new(dest, tree, limits)?;
    if bytes.len() as u64 > mib(limits.max_total_mib) {
        let message = format!("the archive exceeds the limit of {} MiB", limits.max_total_mib);
        return refused(name, None, Finding::error("limit_total", message));
    }
    let Some(format) = format_of_bytes(bytes) else {
        return refused(name, None, unknown_format(bytes));
    };
    let read = |copy: &mut PrivateCopy<'_>| {
        check_extension(name, format, copy);
        match format {
            Format::Zip => zip::read(bytes, copy),
            Format::Tar => tar::read(bytes, copy),
            Format::TarGz => gz::read(bytes, copy),
            Format::Folder => Err(Stop::Refused),
        }
    };
    let mut result = read(&mut copy);
    if copy.findings.has_errors()
        && let Some(backslashes) = copy.backslashes.other_reading()
    {
        clear(dest)?;
        copy = PrivateCopy::new(dest, tree, limits)?;
        copy.backslashes = backslashes;
        let (code, again) = match format {
            Format::Zip => ("zip_backslash", zip::AGAIN),
            _ => ("tar_backslash", tar::AGAIN),
        };
        let message = "names with a backslash between folders: read as '/'";
        copy.findings.push(Finding::warning(code, message).hint(again));
        result = read(&mut copy);
    }
    copy.finish(name, format, result)
}

fn refused<T>(name: &str, format: Option<Format>, finding: Finding) -> Result<T, IntakeError> {
    let refusal = Refusal { name: printable(name), format, findings: vec![finding] };
    Err(IntakeError::Refused(Box::new(refusal)))
}

/// The format of an archive by its content; never [`Format::Folder`].
pub fn format_of_bytes(bytes: &[u8]) -> Option<Format> {
    if bytes.starts_with(b"\x1f\x8b") {
        Some(Format::TarGz)
    } else if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06") {
        Some(Format::Zip)
    } else if tar::looks_like_tar(bytes) {
        Some(Format::Tar)
    } else if archive_magic(bytes).is_none() && zip::has_end_record(bytes) {
        // Something stands before the zip; its reader says so.
        Some(Format::Zip)
    } else {
        None
    }
}

fn unknown_format(bytes: &[u8]) -> Finding {
    const EXPECTED: &str = "expected a .zip, .tar or .tar.gz archive or a folder";
    const HINT: &str = "umbra pack makes the right archive from your working folder";
    match archive_magic(bytes) {
        Some(kind @ ("rar" | "7z" | "cab")) => Finding::error(
            "format_unsupported",
            format!("this is a {kind} archive, which we cannot open; {EXPECTED}"),
        )
        .hint(format!("your files are fine: unpack the {kind} and zip the folder; {HINT}")),
        Some(kind) => {
            Finding::error("format_unsupported", format!("this is {kind} data; {EXPECTED}"))
                .hint(format!("pack it again as .tar.gz or .zip; {HINT}"))
        }
        None if bytes.is_empty() => {
            Finding::error("empty", format!("the file is empty (0 bytes); {EXPECTED}"))
                .hint("the upload may have been cut off; submit it again")
        }
        None if bytes.iter().all(|byte| *byte == 0) => {
            let message = format!("the file holds only zeros ({} bytes); {EXPECTED}", bytes.len());
            Finding::error("format_unknown", message)
                .hint("the upload or the disk failed; submit it again")
        }
        None => {
            /// Bytes in which a text shows what it is.
            const HEAD: usize = 512;
            let start = text_of(bytes.get(..HEAD).unwrap_or(bytes)).to_lowercase();
            let start = start.trim_start_matches(|c: char| c.is_whitespace() || c == '\u{feff}');
            let is_markup = |rest: &str| {
                rest.starts_with(|c: char| "!?".contains(c) || c.is_ascii_alphabetic())
            };
            const KINDS: [(&[u8], &str); 6] = [
                (b"\x89PNG", "a PNG image"),
                (b"\xff\xd8\xff", "a JPEG image"),
                (b"MZ", "a program of Windows"),
                (b"\x7fELF", "a program of Linux"),
                (b"version https://git-lfs", "the pointer that Git LFS leaves in a file's place"),
                (b"{", "JSON"),
            ];
            let kind = KINDS.iter().find(|(magic, _)| bytes.starts_with(magic));
            let found = if let Some((_, kind)) = kind {
                kind
            } else if start.strip_prefix('<').is_some_and(is_markup) {
                "a web page"
            } else if start.starts_with("%pdf") {
                "a PDF"
            } else if bytes.starts_with(b"v/1\x01") {
                "a single EXR image"
            } else {
                "something else"
            };
            Finding::error("format_unknown", format!("{EXPECTED}, found {found}")).hint(HINT)
        }
    }
}

/// Notes an extension that does not belong to the content.
fn check_extension(name: &str, format: Format, copy: &mut PrivateCopy<'_>) {
    let lower = name.to_lowercase();
    let (fits, what) = match format {
        Format::Zip => (lower.ends_with(".zip"), "a zip archive"),
        Format::Tar => (lower.ends_with(".tar"), "a tar archive"),
        Format::TarGz => (lower.ends_with(".gz") || lower.ends_with(".tgz"), "gzip data"),
        Format::Folder => (true, "a folder"),
    };
    if !fits {
        copy.findings.push(
            Finding::warning(
                "wrong_extension",
                format!("the content is {what}, which '{}' does not say", printable(name)),
            )
            .hint("name it .zip, .tar or .tar.gz by what it is"),
        );
    }
}
