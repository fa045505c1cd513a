//! The zip that a learning platform gave, with many submissions in it.
//!
//! The platform made the zip, but students named what is in it. Names are checked before anything is written, and
//! what students uploaded is only copied: archives among it are opened later, in confined children.

use std::collections::{HashMap, HashSet};
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Seek as _, SeekFrom};
use std::path::{Component, Path, PathBuf};

use anyhow::Context as _;
use zip::ZipArchive;

use super::layout::{Platform, end_of, has_end_of_archive, label_of};
use crate::harmless::printable;
use crate::intake::{ArchiveLimits, TreeSpec};

/// The file that tells a Gradescope export.
pub const GRADESCOPE_METADATA: &str = "submission_metadata.yml";
/// More entries than a download of a large class has.
const MAX_ENTRIES: usize = 200_000;

/// A download that programs would unpack differently.
#[derive(Debug)]
pub struct Ambiguous(String);

impl std::fmt::Display for Ambiguous {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Ambiguous {}

impl Ambiguous {
    fn new(path: &Path, name: &str) -> Self {
        Self(format!(
            "{}: two files in it are called \"{}\", with other content each; expected names that differ; hint: \
             download it again, or unpack it, rename one, and name the folder",
            path.display(),
            printable(name)
        ))
    }
}

/// A name that two entries have with other content; the reader of zips shows only the last of them.
fn named_twice(path: &Path) -> io::Result<Option<String>> {
    let Some(zip) = open(path) else { return Ok(None) };
    let mut file = BufReader::new(File::open(path)?);
    file.seek(SeekFrom::Start(zip.central_directory_start()))?;
    let mut seen: HashMap<Vec<u8>, Vec<u8>> = HashMap::new();
    let mut head = [0; 46];
    // Each entry: 46 bytes, its name, and two fields that do not matter here.
    while file.read_exact(&mut head).is_ok() && head.starts_with(b"PK\x01\x02") {
        let length = |at: usize| usize::from(u16::from_le_bytes([head[at], head[at + 1]]));
        let mut name = vec![0; length(28)];
        file.read_exact(&mut name)?;
        file.seek_relative((length(30) + length(32)) as i64)?;
        // Checksum and size.
        let content = [&head[16..20], &head[24..28]].concat();
        if let Some(other) = seen.insert(name.clone(), content.clone())
            && other != content
        {
            return Ok(Some(String::from_utf8_lossy(&name).into_owned()));
        }
    }
    Ok(None)
}

/// The platform whose download a zip with these names looks like, beyond doubt.
pub fn platform(names: &[String], tree: &TreeSpec) -> Option<Platform> {
    if !is_download(names, tree, None) {
        return None;
    }
    let any = |kind: Platform| {
        names.iter().flat_map(|name| name.split('/')).any(|part| label_of(kind, part).is_some())
    };
    Platform::PLATFORMS.into_iter().find(|kind| any(*kind))
}

/// The one archive in a zip that holds nothing else but what systems add.
pub fn only_archive(names: &[String], tree: &TreeSpec) -> Option<String> {
    let is_junk = |name: &&String| {
        let mut parts = name.split('/');
        name.ends_with('/')
            || parts.any(|part| part.starts_with('.') || tree.ignored_by(part).is_some())
    };
    let files: Vec<&String> = names.iter().filter(|name| !is_junk(name)).collect();
    match files[..] {
        [only] if end_of(only) == "zip" && safe(only).is_some() => Some(only.clone()),
        _ => None,
    }
}

/// The names in a zip; `None` if it cannot be read.
pub fn names(path: &Path) -> Option<Vec<String>> {
    let mut zip = open(path)?;
    let mut names: Vec<String> = (0..zip.len())
        .map(|index| Some(name_of(&zip.by_index_raw(index).ok()?)))
        .collect::<Option<_>>()?;
    mend_backslashes(&mut names);
    Some(names)
}

fn open(path: &Path) -> Option<ZipArchive<BufReader<File>>> {
    let zip = ZipArchive::new(BufReader::new(File::open(path).ok()?)).ok()?;
    (zip.len() <= MAX_ENTRIES).then_some(zip)
}

/// As UTF-8 where it is, flagged or not; else by the code page of zips.
fn name_of(file: &zip::read::ZipFile<'_, BufReader<File>>) -> String {
    match std::str::from_utf8(file.name_raw()) {
        Ok(name) => name.to_owned(),
        Err(_) => file.name().map(|name| name.into_owned()).unwrap_or_default(),
    }
}

fn mend_backslashes(names: &mut [String]) {
    if !names.iter().any(|name| name.contains('/')) {
        for name in names {
            *name = name.replace('\\', "/");
        }
    }
}

/// Whether a zip with these names is a download of many submissions, not a submission. `from` is what the
/// instructor says that it is.
pub fn is_download(names: &[String], tree: &TreeSpec, from: Option<Platform>) -> bool {
    let tops = |depth: usize| names.iter().filter_map(move |name| name.split('/').nth(depth));
    let labeled = |kind: Platform| {
        let of = |depth| tops(depth).filter_map(|top| label_of(kind, top));
        of(0).chain(of(1)).map(|label| label.submission).collect::<HashSet<String>>().len()
    };
    if labeled(Platform::Brightspace) + labeled(Platform::Moodle) > 0 {
        return true;
    }
    if names.iter().any(|name| name.ends_with(GRADESCOPE_METADATA))
        || labeled(Platform::Gradescope) > 1
    {
        return true;
    }
    // The rest tells less: what looks like one submission is one.
    let is_part = |name: &String| {
        let components: Vec<&str> = name.split('/').collect();
        let folders = &components[..components.len() - 1];
        folders.iter().any(|folder| tree.is_top_folder(folder))
            || components.last().is_some_and(|file| *file == "config.json")
    };
    let archives: Vec<&String> = names.iter().filter(|name| has_end_of_archive(name)).collect();
    if archives.is_empty() || names.iter().any(is_part) {
        return false;
    }
    let file = |name: &&&String| {
        name.rsplit('/').next().is_some_and(|f| label_of(Platform::Canvas, f).is_some())
    };
    let canvas = archives.iter().filter(file).count();
    canvas == archives.len() || archives.len() > 1 || from.is_some()
}

/// Unpacks a download into the empty folder `into`. Returns the names that were left out, with the reason.
///
/// # Errors
/// When the zip cannot be read, or a file not be written.
pub fn unpack(path: &Path, into: &Path, limits: &ArchiveLimits) -> anyhow::Result<Vec<String>> {
    let cannot = || format!("cannot unpack {}", path.display());
    let mut zip = ZipArchive::new(BufReader::new(File::open(path).with_context(cannot)?))
        .with_context(cannot)?;
    let names = names(path).with_context(cannot)?;
    if let Some(name) = named_twice(path).with_context(cannot)? {
        return Err(Ambiguous::new(path, &name).into());
    }
    // What is larger than a submission may be is refused by intake, which only needs to see that it is.
    let most = (limits.max_total_mib << 20) + 1;
    let mut skipped = Vec::new();
    for (index, name) in names.iter().enumerate() {
        let mut file = zip.by_index(index).with_context(cannot)?;
        let mut skip = |why: &str| skipped.push(format!("{} ({why})", printable(name)));
        let Some(inside) = safe(name) else {
            skip("its name leaves the download");
            continue;
        };
        if file.is_symlink() {
            skip("a link");
            continue;
        }
        let to = into.join(&inside);
        if name.ends_with('/') || file.is_dir() {
            fs::create_dir_all(&to).with_context(|| format!("cannot make {}", to.display()))?;
            continue;
        }
        let folder = to.parent().unwrap_or(into);
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let mut out = match File::create_new(&to) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                let mut content = Vec::new();
                file.by_ref().take(most).read_to_end(&mut content).with_context(cannot)?;
                // Also names that only this file system takes for one.
                if !to.is_file() || fs::read(&to).with_context(cannot)? != content {
                    return Err(Ambiguous::new(path, name).into());
                }
                skip("it is there twice, with the same content");
                continue;
            }
            out => out.with_context(|| format!("cannot write {}", to.display()))?,
        };
        let mut content = Vec::new();
        match file.by_ref().take(most).read_to_end(&mut content) {
            Ok(_) => io::Write::write_all(&mut out, &content)
                .with_context(|| format!("cannot write {}", to.display()))?,
            Err(error) => {
                drop(out);
                fs::remove_file(&to).with_context(|| format!("cannot remove {}", to.display()))?;
                skip(&format!("cannot be unpacked: {error}"));
            }
        }
    }
    Ok(skipped)
}

/// A path that stays below the folder that it is joined to.
fn safe(name: &str) -> Option<PathBuf> {
    let path = Path::new(name);
    let is_plain = |part: Component| matches!(part, Component::Normal(_));
    let has_signs = name.chars().any(char::is_control);
    (!name.is_empty() && !has_signs && path.components().all(is_plain)).then(|| path.to_owned())
}

/// Whether a file may be a download by its name.
pub fn may_be(path: &Path) -> bool {
    end_of(&path.to_string_lossy()) == "zip"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is(names: &[&str]) -> bool {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        is_download(&names, &TreeSpec::default(), None)
    }

    #[test]
    fn downloads_are_told_from_submissions() {
        assert!(is(&["index.html", "1-2 - Ann Lee - Oct 5, 2019 1159 PM/a2.zip"]));
        assert!(is(&["Lab/1-2 - Ann Lee - Oct 5, 2019 1159 PM/"]));
        assert!(is(&["Ann Lee_1_assignsubmission_file/src/lib.rs"]));
        assert!(is(&["export/submission_1/config.json", "export/submission_metadata.yml"]));
        assert!(is(&["leeann_1_2_a2.zip"]));
        assert!(is(&["a2_ann.zip", "a2_bob.tar.gz"]));
        for own in [
            &["config.json", "src/lib.rs"][..],
            &["a2_ann_lee/config.json", "a2_ann_lee/old.zip", "a2_ann_lee/older.zip"],
            &["a2_ann_lee.zip"],
            &["submission_2/src/lib.rs"],
            &["notes.txt"],
            &[],
        ] {
            assert!(!is(own), "{own:?}");
        }
    }

    #[test]
    fn names_that_leave_the_download_are_not_written() {
        for name in ["../x", "/x", "a/../../x", "", "a\0b", "a\u{1b}b"] {
            assert_eq!(safe(name), None, "{name:?}");
        }
        assert_eq!(safe("Zoë - Oct 5/a2.zip"), Some(PathBuf::from("Zoë - Oct 5/a2.zip")));
    }
}
