//! The files that a scene's other files name, looked for as exporters and other systems write names.

use std::path::{Path, PathBuf};

use unicode_normalization::UnicodeNormalization as _;

use super::text::{SECOND_BACKSLASH, unquoted, without_comment};

/// A name as a message shows it.
pub(super) fn shown(name: &str) -> String {
    name.replace(SECOND_BACKSLASH, "\\")
}

/// Whether a name is a place on the machine of whoever exported it.
fn is_absolute(name: &str) -> bool {
    let name = unquoted(name).as_bytes();
    matches!(name, [b'/' | b'\\', ..] | [b'a'..=b'z' | b'A'..=b'Z', b':', b'/' | b'\\', ..])
}

/// Whether a name leads out of the folder, where a renderer sees nothing.
fn leaves_folder(name: &str) -> bool {
    unquoted(name).split(['/', '\\']).any(|part| part == "..")
}

/// Whether a file is taken from elsewhere than its name says.
pub(super) fn is_elsewhere(folder: &Path, name: &str) -> bool {
    let is_there = || spellings(folder, without_comment(name)).iter().any(|path| path.is_file());
    is_absolute(name) || leaves_folder(name) && !is_there()
}

/// The remark on a file that is taken from beside the file that names it.
pub(super) fn taken_beside(path: &Path, line: usize, name: &str, file: &Path) -> String {
    let why = if is_absolute(name) { "is absolute" } else { "leads to no file" };
    let (name, path) = (shown(unquoted(name)), path.display());
    format!("{path}:{line}: {name} {why}; taken is {}", file.display())
}

/// A hint for the message about a missing file.
pub(super) fn why_missing(name: &str, file: &Path) -> String {
    // The first of its folders that is not there, or the file itself.
    let missing =
        file.ancestors().take_while(|path| !path.as_os_str().is_empty() && !path.exists());
    let Some(missing) = missing.last() else { return String::new() };
    let wanted = missing.file_name().unwrap_or_default();
    let folder = missing.parent().filter(|folder| !folder.as_os_str().is_empty());
    let entries = folder.unwrap_or(Path::new(".")).read_dir().into_iter().flatten().flatten();
    let mut alike = entries.map(|entry| entry.file_name());
    if let Some(other) = alike.find(|other| other.eq_ignore_ascii_case(wanted)) {
        return format!("; there is {}: upper and lower case count", other.display());
    }
    if is_absolute(name) {
        return format!("; {} is absolute, so it was looked for here", unquoted(name));
    }
    String::new()
}

/// The file that a statement names: as it stands if there is one, else without a comment behind it.
pub(super) fn existing(folder: &Path, name: &str) -> PathBuf {
    file_of(folder, &[name, without_comment(name)])
}

/// The file in `folder` of the first of these names that has one, else what the last says. Of an absolute name the
/// end that is there counts: the rest is another machine's, or none that a renderer sees. So it does where a name leads
/// out of the folder and no file is there.
pub(super) fn file_of(folder: &Path, names: &[&str]) -> PathBuf {
    let Some(&name) = names.first() else { return folder.to_owned() };
    let mut direct = names.iter().flat_map(|name| spellings(folder, name));
    if !is_absolute(name)
        && let Some(found) = direct.find(|path| path.is_file())
    {
        return found;
    }
    let plain = unquoted(names[names.len() - 1]).replace('\\', "/");
    let first = folder.join(shown(&plain));
    if is_absolute(name) || leaves_folder(name) {
        let ends = names.iter().flat_map(|name| {
            let name = unquoted(name);
            let separators = ['/', '\\', SECOND_BACKSLASH];
            let after = |(at, separator): (usize, &str)| &name[at + separator.len()..];
            name.match_indices(separators).map(after).collect::<Vec<_>>()
        });
        let mut ends = ends
            .filter(|end| !end.is_empty() && !is_absolute(end) && !leaves_folder(end))
            .collect::<Vec<_>>();
        ends.sort_by_key(|end| std::cmp::Reverse(end.len()));
        let found = ends.iter().flat_map(|end| spellings(folder, end)).find(|path| path.is_file());
        let last = ends.last().map(|end| folder.join(without_comment(end)));
        let other = || with_other_accents(&first).filter(|path| path.is_file());
        return match (found, is_absolute(name)) {
            (Some(found), _) => found,
            (None, true) => last.unwrap_or_else(|| folder.to_owned()),
            (None, false) => other().unwrap_or(first),
        };
    }
    with_other_accents(&first).unwrap_or(first)
}

/// The file or folder of that name, whose accents and its folders' may be written in another way: as characters of
/// their own, or not.
fn with_other_accents(path: &Path) -> Option<PathBuf> {
    if path.as_os_str().is_empty() || path.exists() {
        return Some(path.to_owned());
    }
    let folder = with_other_accents(path.parent()?)?;
    let wanted = path.file_name()?.to_str().filter(|name| !name.is_ascii())?;
    let listed = if folder.as_os_str().is_empty() { Path::new(".") } else { &folder };
    let entries = listed.read_dir().ok()?.flatten();
    let mut names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    names.find(|name| name.nfc().eq(wanted.nfc())).map(|name| folder.join(name))
}

/// A name with either kind of slash, and as it stands; in UTF-8 and, where the system has bytes for names, in the
/// bytes of the file that names it.
fn spellings(folder: &Path, name: &str) -> Vec<PathBuf> {
    let own = unquoted(name);
    if own.is_empty() {
        return Vec::new();
    }
    let slashes = own.replace('\\', "/");
    let mut names = vec![slashes.replace(SECOND_BACKSLASH, "/")];
    #[cfg(unix)]
    names.push(shown(own));
    let mut paths: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    #[cfg(unix)]
    if !own.is_ascii() {
        use std::os::unix::ffi::OsStrExt as _;
        let bytes = [slashes.as_str(), own].map(super::text::bytes_of);
        let bytes = bytes.into_iter().chain([super::text::bytes_of(&names[0])]).flatten();
        paths.extend(bytes.map(|bytes| folder.join(std::ffi::OsStr::from_bytes(&bytes))));
    }
    paths
}

/// The files of an `mtllib` statement: one whose name may hold spaces, if it is there; else several,
/// in quotes or each with the ending `.mtl`, or else one a word.
pub(super) fn library_files(folder: &Path, statement: &str) -> Vec<PathBuf> {
    let whole = existing(folder, statement);
    // Of several, the end that is beside is the last alone.
    let is_several = || statement.to_ascii_lowercase().matches(".mtl").count() > 1;
    let is_direct = || spellings(folder, statement).contains(&whole);
    if whole.is_file() && (is_direct() || !is_several()) {
        return vec![whole];
    }
    let mut names: Vec<String> = Vec::new();
    let mut rest = without_comment(statement).trim();
    while !rest.is_empty() {
        let quoted = rest.strip_prefix('"').and_then(|rest| rest.split_once('"'));
        let (name, after) = match quoted {
            Some((name, after)) => (name, after),
            None => {
                let lower = rest.to_ascii_lowercase();
                let mut ends = lower.match_indices(".mtl").map(|(at, ending)| at + ending.len());
                let is_end =
                    |end: &usize| rest[*end..].chars().next().is_none_or(char::is_whitespace);
                let word = rest.find(char::is_whitespace).unwrap_or(rest.len());
                let end = ends.find(is_end).unwrap_or(word);
                rest.split_at(end)
            }
        };
        names.push(name.trim().to_owned());
        rest = after.trim();
    }
    names.iter().filter(|name| !name.is_empty()).map(|name| existing(folder, name)).collect()
}
