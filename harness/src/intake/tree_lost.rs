//! Looks for files of the tree that lie elsewhere or have another name, and for the source that belongs to them.

use unicode_normalization::UnicodeNormalization as _;

use super::submission::SubmittedFile;
use super::tree::{TreeFile, TreeSpec};

/// What was found for an expected file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Lost<'a> {
    /// Nothing like it.
    None,
    /// The one file that it must be.
    One(&'a str),
    /// Several that it may be.
    Several(Vec<&'a str>),
}

/// The file that must be the expected one: the same path in another case, else the same name in another folder, else
/// a name made of it. `root` is the folder in which the configuration lies.
pub(super) fn find_lost<'a>(
    file: &TreeFile,
    free: &[&'a SubmittedFile],
    tree: &TreeSpec,
    root: &str,
) -> Lost<'a> {
    let names: Vec<&String> = names(file).collect();
    let same_path = |path: &str| names.iter().any(|name| name.eq_ignore_ascii_case(path));
    let same_name = |path: &str| names.iter().any(|name| base(name) == base(path));
    let made_of_it = |path: &str| named_after(path, tree) == Some(file);
    let ways: [&dyn Fn(&str) -> bool; 3] = [&same_path, &same_name, &made_of_it];
    for is_like in ways {
        let found: Vec<&SubmittedFile> =
            free.iter().copied().filter(|file| is_like(&file.path)).collect();
        if !found.is_empty() {
            return choose(found, file, root);
        }
    }
    Lost::None
}

/// One of several files: that in its place below `root`, else that in whose folder the others lie, else any of
/// images that are equal.
fn choose<'a>(mut found: Vec<&'a SubmittedFile>, file: &TreeFile, root: &str) -> Lost<'a> {
    let at_root = |path: &str| {
        let place = below(path, root);
        place.is_some_and(|place| names(file).any(|name| name.eq_ignore_ascii_case(place)))
    };
    let in_place: Vec<_> = found.iter().filter(|file| at_root(&file.path)).collect();
    if let [only] = in_place[..] {
        return Lost::One(&only.path);
    }
    let depth = |path: &str| path.matches('/').count();
    found.sort_by_key(|file| depth(&file.path));
    let (first, others) = match &found[..] {
        [] => return Lost::None,
        [first, others @ ..] => (*first, others),
    };
    let folder = first.path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let is_inside = |other: &&SubmittedFile| {
        depth(&other.path) > depth(&first.path) && below(&other.path, folder).is_some()
    };
    // Equal sources may have other modules beside them.
    let is_same = |other: &&SubmittedFile| !is_source(&file.path) && other.sha256 == first.sha256;
    if others.iter().all(is_inside) || others.iter().all(is_same) {
        return Lost::One(&first.path);
    }
    Lost::Several(found.into_iter().map(|file| file.path.as_str()).collect())
}

fn names(file: &TreeFile) -> impl Iterator<Item = &String> {
    std::iter::once(&file.path).chain(&file.aliases)
}

/// The last component in lower case.
pub(super) fn base(path: &str) -> String {
    path.rsplit('/').next().unwrap_or(path).to_lowercase()
}

/// The part of a path below a folder, whatever the case of the folder's letters.
fn below<'a>(path: &'a str, folder: &str) -> Option<&'a str> {
    if folder.is_empty() {
        return Some(path);
    }
    let (above, rest) = path.split_at_checked(folder.len())?;
    rest.strip_prefix('/').filter(|_| above.eq_ignore_ascii_case(folder))
}

/// Whether a file is surely source: Rust or WGSL.
pub(super) fn is_source(path: &str) -> bool {
    let name = base(path);
    [".rs", ".wgsl"].iter().any(|end| name.ends_with(end))
}

/// The expected file whose name is in this file's name: the longest, as one is the beginning of another.
fn named_after<'t>(path: &str, tree: &'t TreeSpec) -> Option<&'t TreeFile> {
    let names = tree.files.iter().flat_map(|file| names(file).map(move |name| (file, name)));
    let like = names.filter(|(_, name)| is_named_after(path, name));
    like.max_by_key(|(_, name)| name.len()).map(|(file, _)| file)
}

/// Whether a name was made of another by a system or a person: ` (1)`, ` - Copy`, `.txt`, spaces for underscores.
/// What stands beside a long name does not matter; a short one may stand in others by chance.
pub(super) fn is_named_after(path: &str, wanted: &str) -> bool {
    /// Letters and digits of a long name.
    const LONG: usize = 9;
    let (name, wanted) = (base(path), base(wanted));
    let Some((stem, end)) = wanted.rsplit_once('.') else { return false };
    let mut words: Vec<String> =
        name.split(|c: char| !c.is_alphanumeric()).map(plain).filter(|w| !w.is_empty()).collect();
    let all = words.len();
    words.retain(|word| word != end);
    if words.len() == all && name.contains('.') {
        return false;
    }
    let (name, stem) = (words.concat(), plain(stem));
    let beside = name.split_once(&stem).map(|(before, after)| format!("{before}{after}"));
    match beside {
        Some(_) if stem.len() >= LONG => true,
        Some(beside) => is_copy_mark(&beside),
        None => stem.len() >= LONG && strsim::osa_distance(&name, &stem) <= 2,
    }
}

/// Letters and digits in lower case, without accents.
fn plain(text: &str) -> String {
    text.nfd().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// What file managers write into the name of a copy, without its number.
const COPY_MARKS: [&str; 24] = [
    "copy",
    "copyof",
    "copie",
    "copiede",
    "kopie",
    "kopievon",
    "kopievan",
    "copia",
    "copiade",
    "copiadi",
    "kopia",
    "kopi",
    "kopiaf",
    "kopiav",
    "kopio",
    "kopya",
    "masolat",
    "txt",
    "\u{526f}\u{672c}",
    "\u{7684}\u{526f}\u{672c}",
    "\u{30b3}\u{30d4}\u{30fc}",
    "\u{306e}\u{30b3}\u{30d4}\u{30fc}",
    "\u{bcf5}\u{c0ac}\u{bcf8}",
    "\u{43a}\u{43e}\u{43f}\u{438}\u{44f}",
];

fn is_copy_mark(beside: &str) -> bool {
    let mark: String = beside.chars().filter(|c| !c.is_numeric()).collect();
    mark.is_empty() || COPY_MARKS.iter().any(|known| plain(known) == mark)
}

/// A source folder that lies elsewhere: that of a source file which the tree expects.
pub(super) struct MovedSource<'t> {
    /// The folder, empty for the root.
    from: String,
    /// The tree's own.
    folder: &'t str,
    /// Whether the case of names was lost on the way: `SRC/LIB.RS`.
    lost_case: bool,
}

impl<'t> MovedSource<'t> {
    /// By the expected and the found path of each file that lies elsewhere.
    pub(super) fn of<'p>(
        mut moved: impl Iterator<Item = (&'p str, &'p str)>,
        tree: &'t TreeSpec,
    ) -> Option<Self> {
        moved.find_map(|(expected, found)| {
            let folder = tree.open_folder_of(expected)?;
            let inside = &expected[folder.len() + 1..];
            let components: Vec<&str> = found.split('/').collect();
            let above = components.len().saturating_sub(inside.split('/').count());
            let own = components[above..].concat();
            let lost_case = own != inside && own.eq_ignore_ascii_case(inside);
            Some(Self { from: components[..above].join("/"), folder, lost_case })
        })
    }

    /// Where a file in the folder belongs: `code/bsdfs/phong.rs` is `src/bsdfs/phong.rs`.
    fn place(&self, path: &str) -> Option<String> {
        let inside = below(path, &self.from)?;
        let last = self.from.rsplit('/').next().unwrap_or_default();
        // The root of a crate beside its `src/`: both are the source.
        let in_source =
            below(inside, self.folder).filter(|_| !last.eq_ignore_ascii_case(self.folder));
        // At the root, other files are surely not source.
        let belongs = !self.from.is_empty() || in_source.is_some() || is_source(inside);
        let inside = in_source.unwrap_or(inside);
        let inside = if self.lost_case { inside.to_lowercase() } else { inside.to_owned() };
        belongs.then(|| format!("{}/{inside}", self.folder))
    }
}

/// Where a file belongs that lies in a source folder elsewhere, or in one whose name is written in another case.
pub(super) fn source_place(
    path: &str,
    moved: Option<&MovedSource<'_>>,
    tree: &TreeSpec,
) -> Option<String> {
    moved.and_then(|source| source.place(path)).or_else(|| {
        let spelled = |folder: &String| Some(format!("{folder}/{}", below(path, folder)?));
        tree.open_folders.iter().find_map(spelled)
    })
}
