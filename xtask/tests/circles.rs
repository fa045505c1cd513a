//! No circles: of two files or folders side by side, at most one uses the other, directly or by way of others.
//!
//! What is read are `use` lines and paths that begin with `crate` or `super`, outside of tests. A name that a
//! folder's `mod.rs` only passes on is looked for where it comes from.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A module's path below its crate: `["cli", "grade"]`.
type Module = Vec<String>;

/// The source of every module of a crate, without comments and tests.
struct Sources(BTreeMap<Module, String>);

impl Sources {
    fn read(src: &Path) -> Self {
        let mut sources = BTreeMap::new();
        for file in umbra::files::files_below(src).expect("a folder of sources") {
            let text = std::fs::read_to_string(&file).unwrap_or_default();
            let below = file.strip_prefix(src).expect("below it").with_extension("");
            let mut module: Module =
                below.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            let is_rust = file.extension().is_some_and(|extension| extension == "rs");
            if !is_rust || module.iter().any(|part| part == "tests") {
                continue;
            }
            match module.last().map(String::as_str) {
                Some("mod") => drop(module.pop()),
                Some("lib") => module.clear(),
                Some("main" | "worker_main") if module.len() == 1 => continue,
                _ => {}
            }
            sources.insert(module, without_tests(&text));
        }
        Self(sources)
    }

    /// The modules that one uses.
    fn used_by(&self, module: &Module) -> BTreeSet<Module> {
        let paths = paths(&self.0[module]);
        let mut used: BTreeSet<Module> =
            paths.iter().filter_map(|path| self.resolve(module, path)).collect();
        used.remove(module);
        used
    }

    /// The module in which a path ends that stands in `from`; none for other crates'.
    fn resolve(&self, from: &Module, path: &[String]) -> Option<Module> {
        let mut place = from.clone();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => place.clear(),
            "self" | "super" => {}
            first if self.0.contains_key(&joined(from, first)) => {}
            _ => return None,
        }
        while let Some((first, others)) = rest.split_first() {
            match first.as_str() {
                "super" => drop(place.pop()),
                "crate" | "self" => {}
                name if self.0.contains_key(&joined(&place, name)) => place = joined(&place, name),
                name if place != *from => {
                    let passed_on = exports(&self.0[&place]).into_iter();
                    let source = passed_on.filter(|path| path.last().is_some_and(|n| n == name));
                    let found = source.filter_map(|path| self.resolve(&place, &path)).next();
                    return Some(found.unwrap_or(place));
                }
                _ => return Some(place),
            }
            rest = others;
        }
        Some(place)
    }

    /// All circles, each as the names of its files or folders.
    fn circles(&self) -> Vec<Vec<String>> {
        let mut edges: BTreeMap<Module, BTreeSet<Module>> = BTreeMap::new();
        for from in self.0.keys() {
            for to in self.used_by(from) {
                // The two places where their paths part.
                let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
                if shared < from.len() && shared < to.len() {
                    let place = |module: &Module| module[..=shared].to_vec();
                    edges.entry(place(from)).or_default().insert(place(&to));
                }
            }
        }
        let reached = |from: &Module| {
            let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
            while let Some(next) = open.pop() {
                let others = edges.get(next).into_iter().flatten();
                open.extend(others.filter(|other| seen.insert((*other).clone())));
            }
            seen
        };
        let reach: BTreeMap<&Module, BTreeSet<Module>> =
            edges.keys().map(|from| (from, reached(from))).collect();
        let mut circles = BTreeSet::new();
        for (from, to) in &reach {
            if to.contains(*from) {
                let back = |other: &&Module| reach.get(*other).is_some_and(|r| r.contains(*from));
                circles.insert(to.iter().filter(back).map(|m| m.join("/")).collect::<Vec<_>>());
            }
        }
        circles.into_iter().collect()
    }
}

fn joined(module: &Module, name: &str) -> Module {
    module.iter().cloned().chain([name.to_owned()]).collect()
}

fn without_tests(text: &str) -> String {
    let code: Vec<&str> =
        text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect();
    let tests = |at: &usize| {
        code[*at].starts_with("#[cfg(") && code[*at].contains("test") && {
            code.get(at + 1).is_some_and(|next| next.starts_with("mod ") && next.ends_with('{'))
        }
    };
    let end = (0..code.len()).find(tests).unwrap_or(code.len());
    code[..end].join("\n")
}

/// The trees behind `use`, or behind `pub use` alone, as paths.
fn trees(text: &str, public: bool) -> Vec<Vec<String>> {
    let mut paths = Vec::new();
    for statement in text.split(';') {
        let Some((before, tree)) = statement.rsplit_once("use ") else { continue };
        let line = before.rsplit('\n').next().unwrap_or_default().trim();
        if line.is_empty() && !public || line.starts_with("pub") {
            flatten(&[], tree, &mut paths);
        }
    }
    paths
}

fn exports(text: &str) -> Vec<Vec<String>> {
    trees(text, true)
}

/// All paths of a text.
fn paths(text: &str) -> Vec<Vec<String>> {
    let mut paths = trees(text, false);
    for start in ["crate::", "super::"] {
        for (at, _) in text.match_indices(start) {
            let is_name = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
            if text[..at].ends_with(is_name) {
                continue;
            }
            let rest = &text[at..];
            let path = &rest[..rest.find(|c| !is_name(c)).unwrap_or(rest.len())];
            paths.push(path.split("::").filter(|n| !n.is_empty()).map(str::to_owned).collect());
        }
    }
    paths
}

/// Writes the paths of a `use` tree one by one.
fn flatten(before: &[String], tree: &str, paths: &mut Vec<Vec<String>>) {
    let names = |text: &str| {
        let names = text.split("::").map(|name| name.split(" as ").next().unwrap_or(name).trim());
        names.filter(|name| !name.is_empty()).map(str::to_owned).collect::<Vec<_>>()
    };
    let Some((head, rest)) = tree.split_once('{') else {
        return paths.push([before, &names(tree)].concat());
    };
    let before = [before, &names(head)].concat();
    let inside = &rest[..rest.rfind('}').unwrap_or(rest.len())];
    let (mut depth, mut begin) = (0, 0);
    for (at, c) in inside.char_indices().chain([(inside.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let item = inside[begin..at].trim();
                if !item.is_empty() {
                    flatten(&before, item, paths);
                }
                begin = at + 1;
            }
            _ => {}
        }
    }
}

#[test]
fn no_two_files_or_folders_use_each_other() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    // Not the reference: its mistakes are switches inside of what they spoil.
    let circles: Vec<_> = [
        "harness/src",
        "harness/basecode/src",
        "harness/evidence/src",
        "harness/imaging/src",
        "xtask/src",
    ]
    .iter()
    .flat_map(|src| {
        let circles = Sources::read(&root.join(src)).circles().into_iter();
        circles.map(move |circle| format!("{src}: {}", circle.join(", ")))
    })
    .collect();
    assert!(circles.is_empty(), "these use each other:\n{}", circles.join("\n"));
}

#[test]
fn a_circle_is_found_through_what_a_folder_passes_on() {
    let module =
        |path: &str| path.split('/').filter(|p| !p.is_empty()).map(str::to_owned).collect();
    let sources = |files: &[(&str, &str)]| {
        Sources(files.iter().map(|(path, text)| (module(path), without_tests(text))).collect())
    };
    let folder = ("a", "mod one;\npub use one::{One, Two as Three};\n");
    let one = ("a/one", "use crate::b::{self, deep::{Deep, Other}};\n");
    let circles = |b: &str| sources(&[folder, one, ("b", b), ("", "")]).circles();
    assert_eq!(circles("use crate::a::One;\n"), [["a", "b"]]);
    assert_eq!(circles("fn f() { super::a::One::new() }\n"), [["a", "b"]]);
    assert!(circles("// use crate::a::One;\nuse std::fmt;\n").is_empty());
    assert!(circles("#[cfg(test)]\nmod tests {\nuse crate::a::One;\n}\n").is_empty());
    // Inside of a folder, a name that its mod.rs passes on is the file's that it comes from.
    let two = ("a/two", "use super::One;\n");
    let one = ("a/one", "use super::two::Two;\n");
    assert_eq!(sources(&[folder, one, two, ("", "")]).circles(), [["a/one", "a/two"]]);
}
