//! Where a command writes: never over what it reads, and never into a submission that it reads.

use std::path::{Path, PathBuf};

use anyhow::ensure;

use crate::intake::TreeSpec;

/// Where a path leads that need not exist yet: what exists of it without links, the rest as it is written.
fn place(path: &Path) -> PathBuf {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let existing = whole.ancestors().find_map(|above| {
        let rest = whole.strip_prefix(above).ok()?;
        let above = above.canonicalize().ok()?;
        Some(if rest.as_os_str().is_empty() { above } else { above.join(rest) })
    });
    existing.unwrap_or(whole)
}

/// Where `out` lies inside the folder `folder`, if it does; empty when it is the folder itself.
pub fn place_inside(out: &Path, folder: &Path) -> Option<PathBuf> {
    let own = folder.canonicalize().ok().filter(|own| own.is_dir())?;
    place(out).strip_prefix(own).ok().map(Path::to_owned)
}

/// Refuses to write to `out` where that lies in a submission's folder, which is to be read.
///
/// # Errors
/// When it does.
pub fn ensure_outside(out: &Path, submission: &Path) -> anyhow::Result<()> {
    ensure!(
        place_inside(out, submission).is_none(),
        "{} lies inside {}, which is to be read; hint: write it beside that folder",
        out.display(),
        submission.display()
    );
    Ok(())
}

/// Likewise for a report's folder: it may lie where nothing is read, such as `umbra-report`.
///
/// # Errors
/// When the report would be part of the submission.
fn ensure_report_outside(out: &Path, submission: &Path, tree: &TreeSpec) -> anyhow::Result<()> {
    let is_ignored =
        |inside: &Path| tree.ignored_by(&inside.to_string_lossy().replace('\\', "/")).is_some();
    match place_inside(out, submission) {
        Some(inside) if !is_ignored(&inside) => ensure_outside(out, submission),
        _ => Ok(()),
    }
}

/// Refuses a report at `output`, in which a submission has the folder `slug`, that would lie in the submission.
///
/// # Errors
/// When it would.
pub fn ensure_apart(
    output: &Path,
    submission: &Path,
    slug: &str,
    tree: &TreeSpec,
) -> anyhow::Result<()> {
    ensure_report_outside(output, submission, tree)?;
    // The report has a folder for each submission, which may be the submission's own.
    let own = output.join(slug);
    ensure!(
        ensure_report_outside(&own, submission, tree).is_ok(),
        "--report {}: the report would be written into {}, which is to be read; hint: --report with the name of a new \
         folder",
        output.display(),
        submission.display()
    );
    Ok(())
}

/// A word of a command line as a shell takes it: quoted where it must be.
pub fn shell_word(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./:,+@%=\\".contains(c);
    // `cmd` and PowerShell take double quotes.
    if cfg!(windows) {
        let plain = !text.is_empty() && text.chars().all(is_plain);
        return if plain { text.to_owned() } else { format!("\"{text}\"") };
    }
    let plain = !text.is_empty() && text.chars().all(|c| is_plain(c) && c != '\\');
    if plain { text.to_owned() } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

/// A path as a word of a command line.
pub fn shell_path(path: &Path) -> String {
    shell_word(&path.to_string_lossy())
}

/// The option ` --root DIR` for a command line, where one was given.
pub fn at_root(root: Option<&Path>) -> String {
    root.map_or(String::new(), |root| format!(" --root {}", shell_path(root)))
}

/// Whether two paths lead to one file that exists.
fn is_same_file(one: &Path, other: &Path) -> bool {
    let (Ok(one), Ok(other)) = (one.canonicalize(), other.canonicalize()) else { return false };
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        // A hard link is the same file under another name.
        let identity = |path: &Path| path.metadata().ok().map(|about| (about.dev(), about.ino()));
        identity(&one).is_some_and(|own| identity(&other) == Some(own))
    }
    #[cfg(not(unix))]
    {
        one == other
    }
}

/// Refuses to write to the file `out` where the command reads that file too.
///
/// # Errors
/// When it does.
pub fn ensure_not_read<'a>(
    out: &Path,
    read: impl IntoIterator<Item = &'a Path>,
) -> anyhow::Result<()> {
    let same = read.into_iter().find(|path| is_same_file(out, path));
    if let Some(read) = same {
        let name = if read == out { String::new() } else { format!(" ({})", read.display()) };
        anyhow::bail!(
            "{}{name} is read by this command, so it is not written over; hint: name another file",
            out.display()
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_place_is_known_before_it_exists() {
        let folder = tempfile::tempdir().unwrap();
        let work = folder.path().join("work");
        fs::create_dir_all(work.join("src")).unwrap();
        let tree = TreeSpec::default();
        for (out, inside, part) in [
            ("work", true, true),
            ("work/src", true, true),
            ("work/new/deep", true, true),
            ("work/../work/x.zip", true, true),
            ("work/umbra-report", true, false),
            ("work2", false, false),
            ("work.zip", false, false),
            ("new", false, false),
        ] {
            let out = folder.path().join(out);
            assert_eq!(ensure_outside(&out, &work).is_err(), inside, "{}", out.display());
            let report = ensure_report_outside(&out, &work, &tree);
            assert_eq!(report.is_err(), part, "{}", out.display());
        }
        // An archive holds nothing that is written.
        fs::write(folder.path().join("a.zip"), "").unwrap();
        assert!(ensure_outside(folder.path(), &folder.path().join("a.zip")).is_ok());
    }

    #[cfg(not(windows))]
    #[test]
    fn words_are_quoted_where_a_shell_wants_it() {
        for (text, quoted) in [
            ("./umbra", "./umbra"),
            ("a2_né.zip", "a2_né.zip"),
            ("my work", "'my work'"),
            ("it's", r"'it'\''s'"),
            ("a\\b", r"'a\b'"),
            ("$HOME", "'$HOME'"),
            ("", "''"),
        ] {
            assert_eq!(shell_word(text), quoted);
        }
    }

    #[cfg(unix)]
    #[test]
    fn one_file_under_two_names_is_one_file() {
        let folder = tempfile::tempdir().unwrap();
        let [a, link, hard, b] = ["a", "link", "hard", "b"].map(|name| folder.path().join(name));
        fs::write(&a, "").unwrap();
        fs::write(&b, "").unwrap();
        std::os::unix::fs::symlink(&a, &link).unwrap();
        fs::hard_link(&a, &hard).unwrap();
        for other in [&a, &link, &hard] {
            assert!(ensure_not_read(other, [b.as_path(), &a]).is_err(), "{}", other.display());
        }
        assert!(ensure_not_read(&b, [a.as_path()]).is_ok());
        assert!(ensure_not_read(&folder.path().join("new"), [a.as_path()]).is_ok());
    }
}
