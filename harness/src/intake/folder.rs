//! A folder as a submission. It may change while it is read, so no path is looked up twice. Each folder and file is
//! opened by its name in the open folder above it. No link is followed, and what is read is what was opened.

#[cfg_attr(unix, path = "folder/unix.rs")]
#[cfg_attr(not(unix), path = "folder/other.rs")]
mod open;

use std::io;
use std::path::Path;

use super::copy::{EntryAction, EntryKind, PrivateCopy, Stop};
use super::finding::Finding;
use super::submission::IntakeError;
use crate::harmless::printable_bytes;
use open::OpenFolder;

/// What lies under a name, not followed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Found {
    Folder(Id),
    File(Id),
    Link,
    Special,
}

/// By what a file or folder is known again: device and inode.
type Id = (u64, u64);

/// Copies what lies below `source` and is wanted, in the order of names. `is_wanted` gets the path
/// from `source`, and for a folder whether anything in it may be wanted.
pub(super) fn read(
    source: &Path,
    is_wanted: &dyn Fn(&str, EntryKind) -> bool,
    copy: &mut PrivateCopy<'_>,
) -> Result<(), Stop> {
    let folder = match OpenFolder::open(source) {
        Ok(folder) => folder,
        Err(error) if is_gone(&error) => return Err(copy.refuse(changed(b"."))),
        Err(error) => return Err(IntakeError::io("list", source, error).into()),
    };
    Walk { source, is_wanted, copy }.folder(folder, &[])
}

/// Opens a file that is no link, without waiting for one that is a fifo.
pub(super) fn open_file(path: &Path) -> io::Result<std::fs::File> {
    open::file(path)
}

struct Walk<'a, 'b> {
    source: &'a Path,
    is_wanted: &'a dyn Fn(&str, EntryKind) -> bool,
    copy: &'a mut PrivateCopy<'b>,
}

impl Walk<'_, '_> {
    /// Copies from an open folder, whose path ends with a slash. Folders that are deeper than allowed are not
    /// admitted, so that neither the stack nor open folders pile up.
    fn folder(&mut self, mut folder: OpenFolder, path: &[u8]) -> Result<(), Stop> {
        let most = usize::try_from(self.copy.limits.most_headers()).unwrap_or(usize::MAX);
        let names = folder.names(most.saturating_add(1));
        let mut names = self.known("list", path, names)?;
        for _ in &names {
            self.copy.count_entry()?;
        }
        names.sort();
        for name in names {
            let raw = [path, name.as_encoded_bytes()].concat();
            let found = self.known("read", &raw, folder.look(&name))?;
            let kind =
                if matches!(found, Found::Folder(_)) { EntryKind::Folder } else { EntryKind::File };
            if !(self.is_wanted)(&String::from_utf8_lossy(&raw), kind) {
                continue;
            }
            match found {
                Found::Folder(id) => {
                    if self.copy.accept(&raw, EntryKind::Folder) == EntryAction::Folder {
                        let inner = self.known("list", &raw, folder.folder(&name))?;
                        self.is_same(&raw, inner.id(), id)?;
                        self.folder(inner, &[raw.as_slice(), b"/"].concat())?;
                    }
                }
                Found::File(id) => {
                    if let EntryAction::File(admitted) = self.copy.accept(&raw, EntryKind::File) {
                        let opened = self.known("read", &raw, folder.file(&name))?;
                        let Some((mut file, opened)) = opened else {
                            return Err(self.copy.refuse(changed(&raw)));
                        };
                        self.is_same(&raw, Ok(opened), id)?;
                        let written = self.copy.write(&admitted, &mut file, None)?;
                        self.known("read", &raw, written)?;
                    }
                }
                Found::Link | Found::Special if self.copy.is_ignored(&raw) => {}
                Found::Link | Found::Special => {
                    let finding = special(found).at(printable_bytes(&raw));
                    self.copy.findings.push(finding);
                }
            }
        }
        Ok(())
    }

    /// The answer; refused where what was there a moment ago is gone.
    fn known<T>(
        &mut self,
        doing: &'static str,
        raw: &[u8],
        answer: io::Result<T>,
    ) -> Result<T, Stop> {
        answer.map_err(|error| {
            if is_gone(&error) {
                return self.copy.refuse(changed(raw));
            }
            let path = self.source.join(String::from_utf8_lossy(raw).as_ref());
            IntakeError::io(doing, &path, error).into()
        })
    }

    /// What was opened must be what was looked at.
    fn is_same(&mut self, raw: &[u8], opened: io::Result<Id>, looked_at: Id) -> Result<(), Stop> {
        let opened = self.known("read", raw, opened)?;
        if opened == looked_at { Ok(()) } else { Err(self.copy.refuse(changed(raw))) }
    }
}

/// Errors of something that is no longer there, or no longer what it was.
fn is_gone(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory)
        || open::is_link(error)
}

fn changed(raw: &[u8]) -> Finding {
    Finding::error("changed_while_read", "it was exchanged or removed while it was read")
        .at(printable_bytes(raw))
}

fn special(found: Found) -> Finding {
    if found == Found::Link {
        Finding::error("link", "expected a file or folder, found a symbolic link")
            .hint("put the file itself there")
    } else {
        Finding::error("special_file", "expected a file or folder, found a device, fifo or socket")
            .hint("remove it")
    }
}
