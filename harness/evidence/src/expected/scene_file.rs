//! A scene's files, loaded for what they show.

use std::path::Path;

use basecode::{Scene, Vec3};

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
