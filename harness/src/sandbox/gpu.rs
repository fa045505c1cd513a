//! The additional files and devices that a worker with a hardware adapter sees.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

/// What `--adapter gpu` adds.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gpu {
    /// Device nodes (`/dev/dri/renderD128`, `/dev/nvidia0`, ...), under their own paths.
    pub nodes: Vec<PathBuf>,
    /// Driver files and folders to read, under their own paths.
    pub files: Vec<PathBuf>,
}

/// Where drivers look for devices, and for their own settings.
const FILES: [&str; 6] = [
    "/sys/dev/char",
    "/sys/devices",
    "/proc/driver/nvidia",
    "/etc/vulkan",
    "/etc/glvnd",
    "/usr/share/nvidia",
];

/// Where drivers describe themselves to the loaders of Vulkan and EGL: NVIDIA's Vulkan finds no
/// device without its EGL.
const MANIFESTS: [&str; 5] = [
    "/etc/vulkan/icd.d",
    "/usr/local/share/vulkan/icd.d",
    "/usr/share/vulkan/icd.d",
    "/etc/glvnd/egl_vendor.d",
    "/usr/share/glvnd/egl_vendor.d",
];

impl Gpu {
    /// What this machine has of the usual drivers', but for what a worker sees anyway; `None` without a device.
    pub fn of_this_machine(is_seen: &dyn Fn(&Path) -> bool) -> Option<Self> {
        static FOUND: OnceLock<Option<Gpu>> = OnceLock::new();
        FOUND.get_or_init(|| Self::find(is_seen)).clone()
    }

    fn find(is_seen: &dyn Fn(&Path) -> bool) -> Option<Self> {
        let nodes = [("/dev/dri", "renderD"), ("/dev", "nvidia")];
        let nodes: Vec<_> =
            nodes.into_iter().flat_map(|(folder, start)| named(folder, start)).collect();
        if nodes.is_empty() {
            return None;
        }
        let manifests = MANIFESTS.iter().flat_map(|folder| named(folder, ""));
        let mut files: BTreeSet<PathBuf> =
            FILES.iter().map(PathBuf::from).filter(|path| path.exists()).collect();
        for manifest in manifests {
            // The loader's folders hold links to drivers that lie elsewhere.
            let Ok(manifest) = fs::canonicalize(manifest) else { continue };
            let libraries = library(&manifest).map(|library| places(&library)).unwrap_or_default();
            // A driver's library loads others from beside it.
            let folders = libraries.iter().filter_map(|library| library.parent());
            files.extend(
                folders.map(Path::to_owned).chain([manifest]).filter(|path| !is_seen(path)),
            );
        }
        Some(Self { nodes, files: files.into_iter().collect() })
    }
}

/// The entries of a folder, folders left out, whose name starts so; none when there is no folder.
fn named(folder: &str, start: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let fits = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(start) && !path.is_dir()
    };
    entries.map(|entry| entry.path()).filter(fits).collect()
}

/// What a driver's manifest names as its library: a path, or a name for the dynamic loader.
fn library(manifest: &Path) -> Option<PathBuf> {
    let manifest: serde_json::Value = serde_json::from_slice(&fs::read(manifest).ok()?).ok()?;
    manifest["ICD"]["library_path"].as_str().map(PathBuf::from)
}

/// Where the library really lies: as the dynamic loader's cache says, when it is only a name.
fn places(library: &Path) -> Vec<PathBuf> {
    if library.components().count() > 1 {
        return fs::canonicalize(library).into_iter().collect();
    }
    let ldconfig = if Path::new("/sbin/ldconfig").exists() { "/sbin/ldconfig" } else { "ldconfig" };
    let Ok(cache) = Command::new(ldconfig).arg("-p").output() else { return Vec::new() };
    let lines = String::from_utf8_lossy(&cache.stdout).into_owned();
    let of = |line: &str| {
        let (name, path) = line.split_once(" => ")?;
        let name = name.split_whitespace().next()?;
        (Path::new(name) == library).then(|| fs::canonicalize(path).ok()).flatten()
    };
    lines.lines().filter_map(of).collect()
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::super::{ChildKind, Policy};
    use super::*;

    #[test]
    fn manifests_lead_to_libraries() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().canonicalize().unwrap().join(name);
        let usual = Policy::new(ChildKind::Worker).read_only;
        let is_seen = |path: &Path| usual.iter().any(|bind| path.starts_with(&bind.host));
        fs::write(at("driver.so"), "").unwrap();
        let named = |library: &Path| {
            let manifest = serde_json::json!({"ICD": {"library_path": library}});
            fs::write(at("icd.json"), manifest.to_string()).unwrap();
            places(&super::library(&at("icd.json")).unwrap())
        };
        assert_eq!(named(&at("driver.so")), [at("driver.so")]);
        assert_eq!(named(&at("missing.so")), [] as [PathBuf; 0]);
        // Every program's; the cache may know more than one architecture's.
        let found = named(Path::new("libc.so.6"));
        assert!(!found.is_empty() && found.iter().all(|path| path.is_file()), "{found:?}");
        assert!(found.iter().all(|path| is_seen(path)));
        assert!(!is_seen(&at("driver.so")));
        fs::write(at("icd.json"), "{").unwrap();
        assert_eq!(super::library(&at("icd.json")), None);
    }
}
