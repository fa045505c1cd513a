//! Files that are written atomically, temporary folders, and digests as text.

use std::fs::File;
use std::io::{self, BufWriter, Read as _, Write};
use std::path::{Path, PathBuf};

use sha2::Digest;
use tempfile::{NamedTempFile, TempDir};

/// Prefix of process folders.
const RUN: &str = "run-";
/// The file in such a folder that its process holds locked.
const LOCK: &str = "lock";

/// A private temporary folder of this process. It is removed when this is dropped or, if the process was killed, by the
/// next process that makes one beside it.
pub struct Scratch {
    folder: TempDir,
    /// Released by whatever ends the process.
    _lock: File,
}

impl Scratch {
    /// A folder in `parent`, which is made when missing. Removes those of processes that are gone.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn new(parent: &Path) -> io::Result<Self> {
        std::fs::create_dir_all(parent)?;
        // One at a time, so that nobody takes a folder that is not locked yet for a left one.
        let turn = File::create(parent.join(LOCK))?;
        turn.lock()?;
        for entry in parent.read_dir()? {
            let left = entry?;
            let is_run = left.file_name().as_encoded_bytes().starts_with(RUN.as_bytes());
            if is_run
                && File::create(left.path().join(LOCK)).is_ok_and(|lock| lock.try_lock().is_ok())
            {
                // What cannot be removed now may be by the next.
                let _ = std::fs::remove_dir_all(left.path());
            }
        }
        let prefix = format!("{RUN}{}-", std::process::id());
        let folder = tempfile::Builder::new().prefix(&prefix).tempdir_in(parent)?;
        let lock = File::create(folder.path().join(LOCK))?;
        lock.lock()?;
        Ok(Self { folder, _lock: lock })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// A new folder among the system's temporary ones that only its owner can look into.
///
/// # Errors
/// When it cannot be made.
pub fn private_folder(prefix: &str) -> io::Result<TempDir> {
    let mut builder = tempfile::Builder::new();
    // The default is what the umask allows, as for any folder.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o700));
    builder.prefix(prefix).tempdir()
}

/// Writes a file under another name, syncs and renames it: whoever looks sees the old content or the new.
/// Folders above it are made when missing.
///
/// # Errors
/// When it cannot be written; the old content is still there then.
pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_whole_by(path, |file| file.write_all(bytes))
}

/// The same for what is too long to be held: `write` writes it.
///
/// # Errors
/// When it cannot be written.
pub fn write_whole_by(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let file = draft(path, write)?;
    end_at(path, "written");
    file.persist(path)?;
    end_at(path, "named");
    Ok(())
}

/// The same for a file that is not there yet: of several that write it at the same time one succeeds.
///
/// # Errors
/// When it is there (`AlreadyExists`), or cannot be written.
pub fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let file = draft(path, |file| file.write_all(bytes))?;
    end_at(path, "written");
    file.persist_noclobber(path)?;
    end_at(path, "named");
    Ok(())
}

/// Removes the oldest files and folders in a folder, so that at most `most` stay. Others may use and remove them
/// meanwhile.
///
/// # Errors
/// When the folder cannot be read, or an entry cannot be removed.
pub fn keep_newest(folder: &Path, most: usize) -> io::Result<()> {
    keep_newest_of(folder, most, |_| true)
}

/// The same among those that are `wanted`.
///
/// # Errors
/// As [`keep_newest`].
pub fn keep_newest_of(
    folder: &Path,
    most: usize,
    wanted: impl Fn(&Path) -> bool,
) -> io::Result<()> {
    let age = |path: &PathBuf| path.metadata().and_then(|meta| meta.modified()).ok();
    let mut all: Vec<_> = std::fs::read_dir(folder)?.flatten().map(|entry| entry.path()).collect();
    all.retain(|path| wanted(path));
    // Each age is asked once: it may change while they are sorted.
    all.sort_by_cached_key(age);
    for old in all.iter().take(all.len().saturating_sub(most)) {
        let removed = match old.is_dir() {
            true => std::fs::remove_dir_all(old),
            false => std::fs::remove_file(old),
        };
        removed.or_else(|error| match error.kind() {
            io::ErrorKind::NotFound => Ok(()),
            _ => Err(error),
        })?;
    }
    Ok(())
}

/// Adds what a file holds to a digest, piece by piece.
///
/// # Errors
/// When it cannot be read.
pub fn feed(hash: &mut impl Digest, file: &Path) -> io::Result<()> {
    let mut file = File::open(file)?;
    let mut piece = vec![0; 1 << 16];
    loop {
        match file.read(&mut piece)? {
            0 => return Ok(()),
            read => hash.update(&piece[..read]),
        }
    }
}

fn end_at(path: &Path, stage: &str) {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    step(&name, stage);
}

/// For tests of what an ended process leaves: with `UMBRA_KILL_AT=record.json:written` in its environment this process
/// ends itself before the file has its name, with `record.json:named` after; with `submission:copied` and the like once
/// that is done.
pub fn step(name: &str, stage: &str) {
    let Some(at) = std::env::var_os("UMBRA_KILL_AT") else { return };
    if at.to_str() == Some(format!("{name}:{stage}").as_str()) {
        #[cfg(unix)]
        let _ = nix::sys::signal::raise(nix::sys::signal::Signal::SIGKILL);
        std::process::abort();
    }
}

/// A complete, synced file under a temporary name; it is removed unless it is renamed.
fn draft(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<NamedTempFile> {
    let folder = path.parent().unwrap_or(Path::new(""));
    std::fs::create_dir_all(folder)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(".umbra-").suffix(".partial");
    // What the user's umask allows, as for any other file; the default would be private.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    let mut buffered = BufWriter::new(&mut file);
    write(&mut buffered)?;
    buffered.flush()?;
    drop(buffered);
    file.as_file().sync_all()?;
    Ok(file)
}

/// All files below a folder, sorted by path. Links are followed: for folders of ours.
///
/// # Errors
/// When a folder cannot be read.
pub fn files_below(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = folder.read_dir()?.map(|entry| Ok(entry?.path()));
    let mut entries = entries.collect::<io::Result<Vec<_>>>()?;
    entries.sort();
    let mut files = Vec::new();
    for entry in entries {
        if entry.is_dir() {
            files.append(&mut files_below(&entry)?);
        } else {
            files.push(entry);
        }
    }
    Ok(files)
}

/// Copies the files below a folder.
///
/// # Errors
/// When one cannot be read or written.
pub fn copy_tree(from: &Path, to: &Path) -> io::Result<()> {
    std::fs::create_dir_all(to)?;
    for file in files_below(from)? {
        let Ok(rest) = file.strip_prefix(from) else { continue };
        let to = to.join(rest);
        if let Some(parent) = to.parent() {
            std::fs::create_dir_all(parent)?;
        }
        std::fs::copy(&file, to)?;
    }
    Ok(())
}

/// The file name of a crate's dynamic library on this system, such as `libplugin.so`.
pub fn library_name(crate_name: &str) -> String {
    format!("{}{crate_name}{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX)
}

/// Bytes as lower-case hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Paths in JSON, which has no bytes: a text where a path is UTF-8, else its bytes as numbers. For `serde(with)`.
pub mod path_json {
    use std::path::{Path, PathBuf};

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    #[serde(untagged)]
    enum Written {
        Text(String),
        Bytes(Vec<u8>),
    }

    impl Written {
        fn of(path: &Path) -> Self {
            match path.to_str() {
                Some(text) => Self::Text(text.to_owned()),
                None => Self::Bytes(path.as_os_str().as_encoded_bytes().to_vec()),
            }
        }

        fn path(self) -> PathBuf {
            match self {
                Self::Text(text) => text.into(),
                #[cfg(unix)]
                Self::Bytes(bytes) => {
                    use std::os::unix::ffi::OsStringExt as _;
                    std::ffi::OsString::from_vec(bytes).into()
                }
                #[cfg(not(unix))]
                Self::Bytes(bytes) => String::from_utf8_lossy(&bytes).into_owned().into(),
            }
        }
    }

    /// Writes a path.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
        Written::of(path).serialize(serializer)
    }

    /// Reads a path.
    ///
    /// # Errors
    /// Those of the deserializer.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<PathBuf, D::Error> {
        Ok(Written::deserialize(deserializer)?.path())
    }

    /// The same for a path that may be missing.
    pub mod optional {
        use super::{Deserialize, Deserializer, PathBuf, Serialize, Serializer, Written};

        /// Writes a path or `null`.
        ///
        /// # Errors
        /// Those of the serializer.
        pub fn serialize<S: Serializer>(
            path: &Option<PathBuf>,
            serializer: S,
        ) -> Result<S::Ok, S::Error> {
            path.as_deref().map(Written::of).serialize(serializer)
        }

        /// Reads a path or `null`.
        ///
        /// # Errors
        /// Those of the deserializer.
        pub fn deserialize<'de, D: Deserializer<'de>>(
            deserializer: D,
        ) -> Result<Option<PathBuf>, D::Error> {
            Ok(Option::<Written>::deserialize(deserializer)?.map(Written::path))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_stay_while_others_use_them() {
        let folder = tempfile::tempdir().unwrap();
        let files: Vec<_> = (0..200).map(|i| folder.path().join(i.to_string())).collect();
        files.iter().for_each(|file| std::fs::write(file, "").unwrap());
        let stop = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for i in (0..files.len()).cycle() {
                    let file = std::fs::File::options().append(true).open(&files[i * 7 % 200]);
                    let _ = file.and_then(|file| file.set_modified(std::time::SystemTime::now()));
                    if stop.load(std::sync::atomic::Ordering::Relaxed) {
                        break;
                    }
                }
            });
            for most in (50..200).rev() {
                keep_newest(folder.path(), most).unwrap();
                assert_eq!(folder.path().read_dir().unwrap().count(), most);
            }
            stop.store(true, std::sync::atomic::Ordering::Relaxed);
        });
    }

    #[test]
    fn the_next_scratch_removes_what_a_killed_process_left_and_nothing_else() {
        let parent = tempfile::tempdir().unwrap();
        let there = |name: &str| parent.path().join(name).is_dir();
        for left in ["run-1-killed/deep", "run-2-killed-at-once", "of another kind"] {
            std::fs::create_dir_all(parent.path().join(left)).unwrap();
        }
        std::fs::write(parent.path().join("run-1-killed/lock"), "").unwrap();
        let first = Scratch::new(parent.path()).unwrap();
        std::fs::write(first.path().join("mine"), "").unwrap();
        let second = Scratch::new(parent.path()).unwrap();
        assert!(first.path().join("mine").is_file() && second.path() != first.path());
        assert!(
            !there("run-1-killed") && !there("run-2-killed-at-once") && there("of another kind")
        );
        let gone = first.path().to_owned();
        drop(first);
        assert!(!gone.exists() && second.path().is_dir());
    }

    #[test]
    fn a_file_keeps_its_content_until_the_new_one_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/file");
        for content in ["one", "two"] {
            write_whole(&path, content.as_bytes()).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), content);
        }
        let error = write_new(&path, b"three").unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "two");
        assert_eq!(folder.path().join("new").read_dir().unwrap().count(), 1);
        std::fs::create_dir(folder.path().join("taken")).unwrap();
        write_whole(&folder.path().join("taken"), b"x").unwrap_err();
        assert_eq!(folder.path().read_dir().unwrap().count(), 2);
    }
}
