//! Folders by descriptor.

use std::ffi::{OsStr, OsString};
use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

use nix::dir::Dir;
use nix::errno::Errno;
use nix::fcntl::{AtFlags, OFlag, openat};
use nix::sys::stat::{FileStat, Mode, SFlag, fstat, fstatat};

use super::{Found, Id};

/// Nothing is followed, nothing waits (for a fifo's other end), nothing is left to children.
const FLAGS: OFlag =
    OFlag::O_NOFOLLOW.union(OFlag::O_NONBLOCK).union(OFlag::O_CLOEXEC).union(OFlag::O_NOCTTY);

/// An open folder.
pub(super) struct OpenFolder(Dir);

impl OpenFolder {
    /// Opens a folder, unless its path ends in a link.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        Ok(Self(Dir::open(path, FLAGS | OFlag::O_DIRECTORY, Mode::empty())?))
    }

    /// The names in it, at most so many.
    pub(super) fn names(&mut self, most: usize) -> io::Result<Vec<OsString>> {
        let mut names = Vec::new();
        for entry in self.0.iter() {
            let entry = entry?;
            let name = entry.file_name().to_bytes();
            if name != b"." && name != b".." {
                names.push(OsStr::from_bytes(name).to_owned());
            }
            if names.len() >= most {
                break;
            }
        }
        Ok(names)
    }

    pub(super) fn look(&self, name: &OsStr) -> io::Result<Found> {
        let found = fstatat(&self.0, name, AtFlags::AT_SYMLINK_NOFOLLOW)?;
        let kind = SFlag::from_bits_truncate(found.st_mode) & SFlag::S_IFMT;
        Ok(if kind == SFlag::S_IFDIR {
            Found::Folder(id(&found))
        } else if kind == SFlag::S_IFREG {
            Found::File(id(&found))
        } else if kind == SFlag::S_IFLNK {
            Found::Link
        } else {
            Found::Special
        })
    }

    pub(super) fn id(&self) -> io::Result<Id> {
        Ok(id(&fstat(&self.0)?))
    }

    /// Opens a folder in it.
    pub(super) fn folder(&self, name: &OsStr) -> io::Result<Self> {
        Ok(Self(Dir::openat(&self.0, name, FLAGS | OFlag::O_DIRECTORY, Mode::empty())?))
    }

    /// Opens a file in it; nothing when it is none by now.
    pub(super) fn file(&self, name: &OsStr) -> io::Result<Option<(File, Id)>> {
        let file = match openat(&self.0, name, FLAGS, Mode::empty()) {
            // A socket.
            Err(Errno::ENXIO) => return Ok(None),
            opened => File::from(opened?),
        };
        let found = file.metadata()?;
        Ok(found.is_file().then(|| (file, (found.dev(), found.ino()))))
    }
}

#[allow(clippy::unnecessary_cast)] // the types differ between systems
fn id(stat: &FileStat) -> Id {
    (stat.st_dev as u64, stat.st_ino as u64)
}

/// Opens a file, unless its path ends in a link.
pub(super) fn file(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).custom_flags(FLAGS.bits()).open(path)
}

/// Whether opening failed because a link was not followed.
pub(super) fn is_link(error: &io::Error) -> bool {
    error.raw_os_error() == Some(Errno::ELOOP as i32)
}
