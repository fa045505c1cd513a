//! Compiled shaders: what Mesa compiled in workers that run no foreign code is given to later ones.
//!
//! Compiling costs most of a small frame, and many workers compile the same. Only files of trusted
//! workers are passed on: each worker gets copies in its own scratch, where it may do with them as it
//! likes.

use std::path::{Path, PathBuf};
use std::{fs, io};

/// Mesa's folder below `MESA_SHADER_CACHE_DIR`.
const MESA: &str = "mesa_shader_cache";
/// Its table of keys: it only tells what need not be written again.
const INDEX: &str = "index";

/// The folder of a worker's private folder that holds those it is given, by number.
pub fn given(dir: &Path, number: usize) -> PathBuf {
    dir.join("shaders").join(number.to_string())
}

/// The folder that a trusted worker leaves its own in.
pub fn left(dir: &Path) -> PathBuf {
    dir.join("shaders-left")
}

/// In a worker, before the first request: copies all that is given to the current folder. What cannot be
/// copied is compiled again.
pub fn take(dir: &Path) {
    for number in 0.. {
        let from = given(dir, number);
        if !from.is_dir() {
            break;
        }
        let _ = copy(&from, Path::new(MESA));
    }
}

/// In a worker, after the last request: leaves what was compiled, if anybody wants it.
pub fn leave(dir: &Path) {
    let to = left(dir);
    if to.is_dir() {
        let _ = copy(Path::new(MESA), &to);
    }
}

/// Copies the files below a folder that are not there yet.
fn copy(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let to = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy(&entry.path(), &to)?;
        } else if entry.file_name() != INDEX && !to.exists() {
            fs::copy(entry.path(), to)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_copied_once_and_without_the_index() {
        let place = tempfile::tempdir().unwrap();
        let (from, to) = (place.path().join("from/llvmpipe/ab"), place.path().join("to"));
        fs::create_dir_all(&from).unwrap();
        fs::write(from.join("cd"), "compiled").unwrap();
        fs::write(from.parent().unwrap().join("index"), "keys").unwrap();
        copy(&place.path().join("from"), &to).unwrap();
        assert_eq!(fs::read_to_string(to.join("llvmpipe/ab/cd")).unwrap(), "compiled");
        assert!(!to.join("llvmpipe/index").exists());
        fs::write(to.join("llvmpipe/ab/cd"), "own").unwrap();
        copy(&place.path().join("from"), &to).unwrap();
        assert_eq!(fs::read_to_string(to.join("llvmpipe/ab/cd")).unwrap(), "own");
    }
}
