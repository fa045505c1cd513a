//! Which compiled libraries the template's compiler call needs.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

use serde::Deserialize;

/// What `cargo metadata` says, as far as it matters here.
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
    dep_kinds: Vec<Kind>,
}

#[derive(Deserialize)]
struct Kind {
    kind: Option<String>,
}

impl Metadata {
    /// The ids of all packages that the template is linked with or whose macros it loads, itself
    /// left out. What only tests or build scripts need is left out too.
    pub fn closure_of(&self, template: &str) -> HashSet<&str> {
        let nodes: HashMap<&str, &Node> =
            self.resolve.nodes.iter().map(|node| (node.id.as_str(), node)).collect();
        let mut found = HashSet::new();
        let mut open: Vec<&str> =
            nodes.keys().copied().filter(|id| is_package(id, template)).collect();
        while let Some(node) = open.pop().and_then(|id| nodes.get(id)) {
            for dependency in &node.deps {
                let linked = dependency.dep_kinds.iter().any(|kind| kind.kind.is_none());
                if linked && found.insert(dependency.pkg.as_str()) {
                    open.push(&dependency.pkg);
                }
            }
        }
        found
    }
}

/// Whether a package id (`path+file:///work/student_template#0.1.0`) is a workspace member's.
fn is_package(id: &str, name: &str) -> bool {
    let folder = id.split('#').next().unwrap_or_default();
    folder.starts_with("path+") && folder.rsplit('/').next() == Some(name)
}

/// A `compiler-artifact` message of cargo's.
#[derive(Deserialize)]
struct Message {
    reason: String,
    #[serde(default)]
    package_id: String,
    #[serde(default)]
    filenames: Vec<PathBuf>,
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
    }
}
