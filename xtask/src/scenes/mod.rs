//! The scenes of the second assignment, made from closed forms and published data.
//!
//! Everything is a pure function: [`files`] returns every file with its bytes, [`write()`] puts them on disk, [`check`]
//! compares them with what is committed. World space is right-handed with y up; lengths have no unit.

mod bezier;
mod cbox;
mod exporting;
mod mesh;
mod newell;
mod probes;
mod scene;
mod shapes;
mod spheres;
mod teapot;
#[cfg(test)]
mod tests;
mod textures;

use anyhow::{Context, Result, bail};
use exporting::ExportedFile;
use scene::Scene;
use std::fs;
use std::path::PathBuf;

/// Every scene, the four of the assignment first.
fn all() -> Vec<Scene> {
    let mut scenes = vec![spheres::diffuse(), spheres::phong(), cbox::cbox(), teapot::teapot()];
    scenes.extend(probes::all());
    scenes
}

/// Every file of every scene; paths are relative to `scenes/a2`.
fn files() -> Result<Vec<ExportedFile>> {
    let mut files = Vec::new();
    for scene in all() {
        files.extend(
            exporting::scene_files(&scene)
                .with_context(|| format!("scene \"{}\"", scene.folder))?,
        );
    }
    files.push(probes::readme());
    Ok(files)
}

/// The folder `scenes/a2` of this checkout.
fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scenes/a2")
}

/// Writes every file and returns one line that says what was written.
///
/// # Errors
/// When a file cannot be made or written.
pub fn write() -> Result<String> {
    let (root, files) = (root(), files()?);
    for file in &files {
        let path = root.join(&file.path);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)
                .with_context(|| format!("cannot make {}", folder.display()))?;
        }
        fs::write(&path, &file.bytes)
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    let bytes: usize = files.iter().map(|file| file.bytes.len()).sum();
    Ok(format!("wrote {} files, {:.1} MB, to scenes/a2", files.len(), bytes as f64 / 1e6))
}

/// Compares the committed files with freshly made ones, byte for byte, in memory.
///
/// # Errors
/// When a file is missing or differs; all of them are named.
pub fn check() -> Result<String> {
    let (root, files) = (root(), files()?);
    let mut faults = Vec::new();
    for file in &files {
        match fs::read(root.join(&file.path)) {
            Ok(bytes) if bytes == file.bytes => {}
            Ok(_) => faults.push(format!("scenes/a2/{} differs", file.path)),
            Err(error) => faults.push(format!("scenes/a2/{}: {error}", file.path)),
        }
    }
    if !faults.is_empty() {
        bail!(
            "{}\nhint: `cargo run --release -p xtask -- scenes` writes them anew",
            faults.join("\n")
        );
    }
    Ok(format!("{} files of scenes/a2 are what xtask makes", files.len()))
}
