//! Which compiled libraries the template's compiler call needs.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

use serde::Deserialize;

/// The part of `cargo metadata` that matters here.
#[derive(Deserialize)]
pub struct Metadata {
    resolve: Resolve,
}

#[derive(Deserialize)]
struct Resolve {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    id: String,
    deps: Vec<Dependency>,
}

#[derive(Deserialize)]
struct Dependency {
    pkg: String,
    dep_kinds: Vec<DependencyKind>,
}

#[derive(Deserialize)]
struct DependencyKind {
    kind: Option<String>,
}

impl Metadata {
    /// The ids of all packages that the template is linked with or whose macros it loads, itself
    /// left out. What only tests or build scripts need is left out too.
    pub fn closure_of(&self, template: &str) -> HashSet<&str> {
        self.reached_from(&[template], &|kind| kind.kind.is_none())
    }

    /// How many packages cargo compiles to build the named ones: these, and all that they or a build
    /// script of theirs are linked with.
    pub fn compiled_for(&self, packages: &[&str]) -> usize {
        let needed = |kind: &DependencyKind| kind.kind.as_deref() != Some("dev");
        let named = |node: &&Node| packages.iter().any(|name| is_package(&node.id, name));
        let named: HashSet<&str> =
            self.resolve.nodes.iter().filter(named).map(|node| node.id.as_str()).collect();
        self.reached_from(packages, &needed).union(&named).count()
    }

    fn reached_from(
        &self,
        packages: &[&str],
        wanted: &dyn Fn(&DependencyKind) -> bool,
    ) -> HashSet<&str> {
        let nodes: HashMap<&str, &Node> =
            self.resolve.nodes.iter().map(|node| (node.id.as_str(), node)).collect();
        let mut found = HashSet::new();
        let named = |id: &&str| packages.iter().any(|name| is_package(id, name));
        let mut open: Vec<&str> = nodes.keys().copied().filter(named).collect();
        while let Some(id) = open.pop() {
            let Some(node) = nodes.get(id) else { continue };
            for dependency in &node.deps {
                if dependency.dep_kinds.iter().any(wanted) && found.insert(dependency.pkg.as_str())
                {
                    open.push(&dependency.pkg);
                }
            }
        }
        found
    }
}

/// Whether a package id (`path+file:///w/student_template#0.1.0`, `path+file:///w/harness#umbra@0.1.0`)
/// is that of a workspace member.
fn is_package(id: &str, name: &str) -> bool {
    let (folder, version) = id.split_once('#').unwrap_or((id, ""));
    let own = match version.split_once('@') {
        Some((own, _)) => Some(own),
        None => folder.rsplit('/').next(),
    };
    folder.starts_with("path+") && own == Some(name)
}

/// A `compiler-artifact` message of cargo's.
#[derive(Deserialize)]
struct Message {
    reason: String,
    #[serde(default)]
    package_id: String,
    #[serde(default)]
    filenames: Vec<PathBuf>,
    target: Option<Target>,
}

#[derive(Deserialize)]
struct Target {
    kind: Vec<String>,
}

/// The package that a message of cargo's says to be compiled, if it is such a message. Build scripts
/// are no packages.
pub fn compiled_package(message: &str) -> Option<String> {
    let message: Message = serde_json::from_str(message).ok()?;
    let script = message.target.is_some_and(|target| target.kind == ["custom-build"]);
    (message.reason == "compiler-artifact" && !script).then_some(message.package_id)
}

/// The libraries of `packages` in cargo's messages: `.rlib` files, and procedural macros.
pub fn libraries(messages: &str, packages: &HashSet<&str>) -> Vec<PathBuf> {
    let mut libraries: Vec<PathBuf> = messages
        .lines()
        .filter_map(|line| serde_json::from_str::<Message>(line).ok())
        .filter(|message| {
            message.reason == "compiler-artifact" && packages.contains(&*message.package_id)
        })
        .flat_map(|message| message.filenames)
        .filter(|file| {
            let extension = file.extension().and_then(|extension| extension.to_str());
            extension == Some("rlib") || extension == Some(std::env::consts::DLL_EXTENSION)
        })
        .collect();
    libraries.sort();
    libraries.dedup();
    libraries
}

#[cfg(test)]
mod tests {
    use super::*;

    const METADATA: &str = r#"{"resolve": {"nodes": [
        {"id": "path+file:///w/student_template#0.1.0", "deps": [
            {"pkg": "base", "dep_kinds": [{"kind": null}]},
            {"pkg": "tests", "dep_kinds": [{"kind": "dev"}]}]},
        {"id": "base", "deps": [
            {"pkg": "math", "dep_kinds": [{"kind": "build"}, {"kind": null}]},
            {"pkg": "script", "dep_kinds": [{"kind": "build"}]}]},
        {"id": "math", "deps": []}, {"id": "tests", "deps": []}, {"id": "script", "deps": []},
        {"id": "path+file:///w/harness#umbra@0.1.0", "deps": [
            {"pkg": "clap", "dep_kinds": [{"kind": null}]}]}]}}"#;

    #[test]
    fn only_what_is_linked_belongs_to_the_closure() {
        let metadata: Metadata = serde_json::from_str(METADATA).unwrap();
        let closure = metadata.closure_of("student_template");
        assert_eq!(closure, HashSet::from(["base", "math"]));
        let messages = r#"{"reason":"compiler-artifact","package_id":"math","filenames":["/d/libmath.rlib","/d/libmath.rmeta"]}
{"reason":"compiler-artifact","package_id":"clap","filenames":["/d/libclap.rlib"]}
not json
{"reason":"build-finished","success":true}"#;
        assert_eq!(libraries(messages, &closure), [PathBuf::from("/d/libmath.rlib")]);
        // With the build script's, without the tests'.
        assert_eq!(metadata.compiled_for(&["student_template"]), 4);
        assert_eq!(metadata.compiled_for(&["student_template", "umbra"]), 6);
    }

    #[test]
    fn a_package_counts_as_compiled_when_more_than_its_build_script_is() {
        let message = |kind: &str| {
            format!(
                r#"{{"reason":"compiler-artifact","package_id":"p","target":{{"kind":["{kind}"]}}}}"#
            )
        };
        assert_eq!(compiled_package(&message("lib")).as_deref(), Some("p"));
        assert_eq!(compiled_package(&message("proc-macro")).as_deref(), Some("p"));
        assert_eq!(compiled_package(&message("custom-build")), None);
        assert_eq!(compiled_package(r#"{"reason":"build-finished","success":true}"#), None);
    }
}
