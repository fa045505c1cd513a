//! A folder as a hand-in: walked without following links.

use std::fs::{File, Metadata, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use super::copy::{Admitted, Halt, Kind, PrivateCopy};
use super::finding::{Finding, printable_bytes};
use super::unpack::IntakeError;

/// Copies what lies below `source` and is wanted, in the order of names. `is_wanted` gets the path
/// from `source`, and for a folder whether anything in it may be wanted.
pub(super) fn read(
    source: &Path,
    is_wanted: &dyn Fn(&str, Kind) -> bool,
    copy: &mut PrivateCopy<'_>,
) -> Result<(), Halt> {
    // Folders still to be listed, with their path in the hand-in.
    let mut open: Vec<(PathBuf, Vec<u8>)> = vec![(source.to_owned(), Vec::new())];
    while let Some((folder, relative)) = open.pop() {
        let mut names = Vec::new();
        for entry in folder.read_dir().map_err(|e| IntakeError::io("list", &folder, e))? {
            copy.count_entry()?;
            names.push(entry.map_err(|e| IntakeError::io("list", &folder, e))?.file_name());
        }
        names.sort();
        for name in names {
            let path = folder.join(&name);
            let mut raw = relative.clone();
            raw.extend_from_slice(name.as_encoded_bytes());
            let metadata =
                path.symlink_metadata().map_err(|e| IntakeError::io("read", &path, e))?;
            let kind = if metadata.is_dir() { Kind::Folder } else { Kind::File };
            if !is_wanted(&String::from_utf8_lossy(&raw), kind) {
                continue;
            }
            if metadata.is_dir() {
                if copy.admit(&raw, Kind::Folder) == Admitted::Folder {
                    raw.push(b'/');
                    open.push((path, raw));
                }
            } else if metadata.is_file() {
                if let Admitted::File(admitted) = copy.admit(&raw, Kind::File) {
                    copy_file(&path, &metadata, &raw, &admitted, copy)?;
                }
            } else {
                copy.findings.push(special(&metadata, &raw));
            }
        }
    }
    Ok(())
}

fn copy_file(
    path: &Path,
    listed: &Metadata,
    raw: &[u8],
    admitted: &str,
    copy: &mut PrivateCopy<'_>,
) -> Result<(), Halt> {
    let mut file = open_unfollowed(path).map_err(|e| IntakeError::io("read", path, e))?;
    // What was opened must be what was looked at: a folder can change under our feet.
    let opened = file.metadata().map_err(|e| IntakeError::io("read", path, e))?;
    if !opened.is_file() || !same_file(listed, &opened) {
        let finding =
            Finding::error("changed_while_read", "the file was exchanged while it was read");
        return Err(copy.refuse(finding.at(printable_bytes(raw))));
    }
    copy.write(admitted, &mut file, None)?.map_err(|e| IntakeError::io("read", path, e))?;
    Ok(())
}

#[cfg(unix)]
fn open_unfollowed(path: &Path) -> io::Result<File> {
    use std::os::unix::fs::OpenOptionsExt;
    // Non-blocking, so that a fifo put in its place cannot hold us.
    OpenOptions::new()
        .read(true)
        .custom_flags(nix::libc::O_NOFOLLOW | nix::libc::O_NONBLOCK)
        .open(path)
}

#[cfg(not(unix))]
fn open_unfollowed(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).open(path)
}

#[cfg(unix)]
fn same_file(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

#[cfg(not(unix))]
fn same_file(_: &Metadata, _: &Metadata) -> bool {
    true
}

fn special(metadata: &Metadata, raw: &[u8]) -> Finding {
    let finding = if metadata.is_symlink() {
        Finding::error("link", "expected a file or folder, found a symbolic link")
            .hint("put the file itself there")
    } else {
        Finding::error("special_file", "expected a file or folder, found a device, fifo or socket")
            .hint("remove it")
    };
    finding.at(printable_bytes(raw))
}
