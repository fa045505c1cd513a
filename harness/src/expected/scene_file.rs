//! A scene's files: loaded for what they show, and told from other versions of them.

use std::path::Path;

use anyhow::Context;
use basecode::{Scene, Vec3};
use sha2::{Digest, Sha256};

use crate::files::hex;

/// Loads a scene for its geometry and its light.
///
/// # Errors
/// As [`Scene::load`], and when the scene has no light: there is nothing to grade in it.
pub fn load_scene(toml: &Path) -> basecode::Result<Scene> {
    struct NoBsdf;
    impl basecode::Bsdf for NoBsdf {
        fn eval(&self, _: &basecode::SurfaceInteraction) -> Vec3 {
            Vec3::ZERO
        }
    }
    let scene = Scene::load(toml, &|_| Box::new(NoBsdf))?;
    if scene.light().is_none() {
        let message = "the scene has no light: no shape has a material with a Ke above 0";
        return Err(basecode::Error::file(&scene.config().mesh, message));
    }
    Ok(scene)
}

/// SHA-256 over all that an image of a scene depends on: the TOML file and the files beside its mesh.
pub(crate) fn scene_digest(toml: &Path) -> anyhow::Result<String> {
    let config = basecode::scene::SceneConfig::load(toml)?;
    let mut hash = Sha256::new();
    hash.update(std::fs::read(toml)?);
    let folder = config.mesh.parent().unwrap_or(Path::new(""));
    let mut files = Vec::new();
    for entry in folder.read_dir().with_context(|| format!("{}", folder.display()))? {
        let entry = entry?;
        if entry.file_type()?.is_file() {
            files.push(entry.path());
        }
    }
    files.sort();
    for file in files {
        hash.update(file.file_name().unwrap_or_default().as_encoded_bytes());
        hash.update(std::fs::read(&file)?);
    }
    Ok(hex(&hash.finalize()))
}
