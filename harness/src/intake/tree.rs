//! The tree that a submission must have, as data.

use std::path::Path;

use serde::{Deserialize, Serialize};

/// The expected tree of a submission.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TreeSpec {
    /// First part of the archive's name: `a2` in `a2_first_last.zip`.
    pub name_prefix: String,
    /// Single files, required and optional, in the order they are shown.
    pub files: Vec<TreeFile>,
    /// Folders that may hold any further files; required files inside them are listed in `files`.
    pub open_folders: Vec<String>,
    /// Files and folders at the root of the template that `pack` leaves out: nobody needs to take them out of a working
    /// folder.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kept_back: Vec<String>,
    /// What is ignored wherever it lies: one or more whole components (`target/release`), where
    /// a `*` at the end stands for anything.
    pub ignored: Vec<String>,
}

/// One file of the expected tree.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TreeFile {
    /// Path from the root of the submission.
    pub path: String,
    /// Whether the submission must hold it.
    pub required: bool,
    /// Other paths at which it is accepted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub aliases: Vec<String>,
}

/// The files at the top of a report that Umbra writes, by which it is known again.
pub const REPORT_FILES: [&str; 3] = ["report.html", "report.json", "grades.csv"];

/// The configuration file of a submission.
pub(crate) const CONFIG_FILE: &str = "config.json";

/// The tree of the handout *Point Lights & Shadows*. The aliases of the bonus images are the three
/// paths that the handout and the course's own template name.
impl Default for TreeSpec {
    fn default() -> Self {
        let file =
            |path: &str| TreeFile { path: path.to_owned(), required: true, aliases: Vec::new() };
        let bonus = |scene: &str| TreeFile {
            path: format!("realtime/{scene}_bonus.exr"),
            required: false,
            aliases: vec![
                format!("renders/{scene}_bonus.exr"),
                format!("realtime/{scene}_simple_realtime_bonus.exr"),
            ],
        };
        Self {
            name_prefix: "a2".to_owned(),
            files: vec![
                file(CONFIG_FILE),
                file("src/lib.rs"),
                file("offline/teapot_simple_offline.exr"),
                file("offline/cbox_simple_offline.exr"),
                file("realtime/teapot_simple_realtime.exr"),
                file("realtime/cbox_simple_realtime.exr"),
                bonus("teapot"),
                bonus("cbox"),
            ],
            open_folders: vec!["src".to_owned()],
            kept_back: ["Cargo.toml", "Cargo.lock", "README.md", "tests"]
                .map(str::to_owned)
                .to_vec(),
            ignored: [
                "__MACOSX",
                ".DS_Store",
                "Thumbs.db",
                "._*",
                "desktop.ini",
                "Icon\r",
                ".git",
                "umbra-report",
                "target/debug",
                "target/release",
                "target/CACHEDIR.TAG",
                "target/.rustc_info.json",
                "umbra-report",
            ]
            .map(str::to_owned)
            .to_vec(),
        }
    }
}

impl TreeSpec {
    /// The pattern by which `path` is ignored.
    pub fn ignored_by(&self, path: &str) -> Option<&str> {
        let components: Vec<&str> = path.split('/').collect();
        self.ignored.iter().map(String::as_str).find(|pattern| {
            let wanted: Vec<&str> = pattern.split('/').collect();
            components.windows(wanted.len()).any(|window| {
                window.iter().zip(&wanted).all(|(component, want)| match want.strip_suffix('*') {
                    Some(start) => component.starts_with(start),
                    None => component.eq_ignore_ascii_case(want),
                })
            })
        })
    }

    /// Whether the template has `path` beside what is submitted.
    pub(crate) fn is_kept_back(&self, path: &str) -> bool {
        let top = path.split('/').next().unwrap_or_default();
        self.kept_back.iter().any(|own| own == top)
    }

    /// The expected file that lies at `path`, by its own path or an alias.
    pub fn file_at(&self, path: &str) -> Option<&TreeFile> {
        self.files.iter().find(|file| file.accepts(path))
    }

    /// Where the expected file `path` lies below `root`: there, or at one of its aliases.
    pub fn found_in<'a>(&'a self, root: &Path, path: &'a str) -> Option<&'a str> {
        let aliases = self.file_at(path).into_iter().flat_map(|file| &file.aliases);
        let mut names = std::iter::once(path).chain(aliases.map(String::as_str));
        names.find(|name| root.join(name).is_file())
    }

    /// The open folder that holds `path`.
    pub fn open_folder_of(&self, path: &str) -> Option<&str> {
        self.open_folders
            .iter()
            .map(String::as_str)
            .find(|folder| path.strip_prefix(folder).is_some_and(|rest| rest.starts_with('/')))
    }

    /// Whether a file at `path` belongs to the tree, or one in the folder at `path` may.
    pub(crate) fn may_hold(&self, path: &str, is_folder: bool) -> bool {
        let below = |file: &str| file.strip_prefix(path).is_some_and(|rest| rest.starts_with('/'));
        let holds = |file: &TreeFile| below(&file.path) || file.aliases.iter().any(|a| below(a));
        self.open_folder_of(path).is_some()
            || match is_folder {
                true => {
                    self.open_folders.iter().any(|folder| folder == path)
                        || self.files.iter().any(holds)
                }
                false => self.file_at(path).is_some(),
            }
    }

    /// Whether a folder of this name may stand at the root, so that it is no wrapping folder.
    pub(crate) fn is_top_folder(&self, name: &str) -> bool {
        let starts = |path: &str| {
            path.split_once('/').is_some_and(|(top, _)| top.eq_ignore_ascii_case(name))
        };
        self.open_folders.iter().any(|folder| folder.eq_ignore_ascii_case(name))
            || self
                .files
                .iter()
                .any(|file| starts(&file.path) || file.aliases.iter().any(|a| starts(a)))
    }
}

impl TreeFile {
    /// Whether the file may lie at `path`.
    pub fn accepts(&self, path: &str) -> bool {
        self.path == path || self.aliases.iter().any(|alias| alias == path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignores_junk_but_no_module_named_target() {
        let tree = TreeSpec::default();
        for junk in [
            "__MACOSX/a/._b",
            "src/.DS_Store",
            "a/thumbs.DB",
            "._config.json",
            "Desktop.ini",
            ".git/HEAD",
            "x/target/release/deps/a.o",
            "src/Icon\r",
            "umbra-report/work/report.html",
        ] {
            assert!(tree.ignored_by(junk).is_some(), "{junk}");
        }
        for wanted in [
            "src/target/mod.rs",
            "src/target.rs",
            "src/_x.rs",
            "x.DS_Store",
            "src/.github",
            "src/umbra-report.rs",
        ] {
            assert_eq!(tree.ignored_by(wanted), None, "{wanted}");
        }
    }

    #[test]
    fn finds_files_by_alias() {
        let tree = TreeSpec::default();
        for path in [
            "realtime/cbox_bonus.exr",
            "renders/cbox_bonus.exr",
            "realtime/cbox_simple_realtime_bonus.exr",
        ] {
            assert_eq!(
                tree.file_at(path).map(|f| f.path.as_str()),
                Some("realtime/cbox_bonus.exr")
            );
        }
        assert!(
            tree.is_top_folder("renders")
                && tree.is_top_folder("Src")
                && !tree.is_top_folder("a2_x_y")
        );
        assert_eq!(tree.open_folder_of("src/a/b.rs"), Some("src"));
        assert_eq!(tree.open_folder_of("srcs/a"), None);
    }

    #[test]
    fn round_trips_through_json() {
        let tree = TreeSpec::default();
        let text = serde_json::to_string(&tree).unwrap();
        assert_eq!(serde_json::from_str::<TreeSpec>(&text).unwrap(), tree);
    }
}
