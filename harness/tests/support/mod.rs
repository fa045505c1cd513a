//! Archives made byte by byte, able to lie in every field; a scratch place that shows whether anything was written
//! where it should not be; and an assignment on one scene.

// Each test file uses its part.
#![allow(dead_code)]

pub mod chromium;
pub mod made_exr;
pub mod scratch;
pub mod tar_bytes;
pub mod zip_bytes;

use std::path::{Path, PathBuf};

/// Copies a folder with all that is in it; what is there stays, or is replaced.
pub fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in from.read_dir().unwrap() {
        let (path, name) = entry.map(|entry| (entry.path(), entry.file_name())).unwrap();
        if path.is_dir() {
            copy_folder(&path, &to.join(name));
        } else {
            std::fs::copy(path, to.join(name)).unwrap();
        }
    }
}

/// The repository's assignment in `folder`, on one scene: what is graded there starts fast. Its files are links, but
/// for `config.json`, which is changed by `edit`.
#[cfg(unix)]
pub fn one_scene(folder: &Path, edit: impl Fn(&mut serde_json::Value)) -> PathBuf {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap();
    std::fs::create_dir_all(folder).unwrap();
    for entry in own.read_dir().unwrap() {
        let name = entry.unwrap().file_name();
        if name != "config.json" && !folder.join(&name).exists() {
            // Another test may make the same one meanwhile.
            let _ = std::os::unix::fs::symlink(own.join(&name), folder.join(&name));
        }
    }
    let text = std::fs::read_to_string(own.join("config.json")).unwrap();
    let mut config: serde_json::Value = serde_json::from_str(&text).unwrap();
    let scenes = config["scenes"].as_array_mut().unwrap();
    scenes.retain(|scene| scene["name"] == "sphere_phong");
    assert_eq!(scenes.len(), 1);
    edit(&mut config);
    let new = folder.join(format!("config.json-{}", std::process::id()));
    std::fs::write(&new, config.to_string()).unwrap();
    std::fs::rename(new, folder.join("config.json")).unwrap();
    folder.to_owned()
}
