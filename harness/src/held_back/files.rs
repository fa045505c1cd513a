//! Writes a changed scene as the original's files with the numbers replaced.
//!
//! Names, order and words stay, so that a renderer gets it under the same names as the original.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use basecode::{Scene, Vec3};

use crate::assignment::SceneEntry;
use crate::evidence::changed_scene::ChangedScene;

/// A file of a scene: its path below the scene's folder, and what is in it.
pub type NewFile = (PathBuf, Vec<u8>);

/// The files of `entry`'s scene as `draw` changes it, in the order of their paths. `folder` is the
/// original's, with `tinyrender/` and `mesh/` below it.
///
/// # Errors
/// When a file cannot be read, lies elsewhere, or lacks a number that is to be replaced.
pub fn changed(
    root: &Path,
    entry: &SceneEntry,
    scene: &Scene,
    draw: &ChangedScene,
) -> anyhow::Result<Vec<NewFile>> {
    let mut files = Vec::new();
    for toml in [Some(&entry.offline), Some(&entry.realtime), entry.bonus.as_ref()] {
        let Some(toml) = toml else { continue };
        let path = root.join(toml);
        let text = read(&path)?;
        let text = changed_toml(&text, draw).with_context(|| path.display().to_string())?;
        files.push((below(toml)?, text.into_bytes()));
    }
    let mesh = &scene.config().mesh;
    let folder = mesh.parent().unwrap_or(Path::new(""));
    for file in folder.read_dir().with_context(|| folder.display().to_string())? {
        let path = file?.path();
        let name = Path::new("mesh").join(path.file_name().unwrap_or_default());
        let bytes = if path.file_name() == mesh.file_name() {
            moved_light(&read(&path)?, scene, draw).into_bytes()
        } else if path.extension().is_some_and(|extension| extension == "mtl") {
            changed_mtl(&read(&path)?, scene, draw).into_bytes()
        } else {
            std::fs::read(&path).with_context(|| path.display().to_string())?
        };
        files.push((name, bytes));
    }
    files.sort();
    Ok(files)
}

/// A path of the assignment without the scene's folder: its last two names.
///
/// # Errors
/// When the scene does not lie in a folder `tinyrender`.
pub fn below(path: &Path) -> anyhow::Result<PathBuf> {
    let names: Vec<_> = path.iter().rev().take(2).collect();
    ensure!(
        names.len() == 2 && names[1] == "tinyrender",
        "{}: only a scene of the form SCENE/tinyrender/NAME.toml beside SCENE/mesh can be changed",
        path.display()
    );
    Ok(names.into_iter().rev().collect())
}

fn read(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| path.display().to_string())
}

/// Replaces camera and film.
fn changed_toml(text: &str, draw: &ChangedScene) -> anyhow::Result<String> {
    let vector = |v: Vec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    let camera = &draw.camera;
    let mut values = vec![
        ("camera", "eye", vector(camera.eye)),
        ("camera", "at", vector(camera.at)),
        ("camera", "fov", format!("{:?}", camera.fov_y_deg)),
        ("film", "width", draw.film[0].to_string()),
        ("film", "height", draw.film[1].to_string()),
    ];
    let mut section = String::new();
    let mut out = String::new();
    for line in text.lines() {
        if let Some(name) = line.strip_prefix('[') {
            section = name.trim_end_matches(']').to_owned();
        }
        let key = line.split('=').next().unwrap_or_default().trim();
        let found = values.iter().position(|(of, name, _)| *of == section && *name == key);
        match found {
            Some(index) => out += &format!("{key} = {}\n", values.remove(index).2),
            None => out += &format!("{line}\n"),
        }
    }
    let missing = values.first().map_or(String::new(), |(of, name, _)| format!("{of}.{name}"));
    ensure!(values.is_empty(), "{missing} is not stated on a line of its own");
    Ok(out)
}

/// Replaces albedos, exponents and the light's intensity.
fn changed_mtl(text: &str, scene: &Scene, draw: &ChangedScene) -> String {
    let triple = |key: &str, v: Vec3| format!("{key} {} {} {}", v.x, v.y, v.z);
    let light = light_material(scene);
    let mut current = None;
    let lines = text.lines().map(|line| {
        let mut words = line.split_whitespace();
        let (key, value) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        if key == "newmtl" {
            current = scene.materials().iter().position(|material| material.name == value);
        }
        let Some(index) = current else { return line.to_owned() };
        let surface = &draw.surfaces[index];
        match key {
            "Kd" if index != light => triple(key, surface.diffuse),
            "Ks" if index != light => triple(key, surface.specular),
            "Ns" if index != light => format!("{key} {}", surface.exponent),
            "Ke" if index == light => triple(key, draw.intensity),
            _ => line.to_owned(),
        }
    });
    lines.map(|line| line + "\n").collect()
}

/// Moves the vertices of the light.
fn moved_light(text: &str, scene: &Scene, draw: &ChangedScene) -> String {
    let by = draw.light.as_dvec3() - scene.first_light_position().as_dvec3();
    let light = &scene.materials()[light_material(scene)].name;
    let numbers = |line: &str| -> Vec<String> {
        line.split_whitespace().skip(1).map(str::to_owned).collect()
    };
    let (mut used, mut vertices, mut is_light) = (HashSet::new(), 0i64, false);
    for line in text.lines() {
        match line.split_whitespace().next() {
            Some("v") => vertices += 1,
            Some("usemtl") => is_light = numbers(line).first() == Some(light),
            Some("f") if is_light => {
                let corner = |word: &String| word.split('/').next()?.parse::<i64>().ok();
                // A negative index counts back from the latest vertex.
                let indices = numbers(line).iter().filter_map(corner).collect::<Vec<_>>();
                used.extend(indices.iter().map(|&i| if i < 0 { vertices + 1 + i } else { i }));
            }
            _ => {}
        }
    }
    let mut number = 0;
    let lines = text.lines().map(|line| {
        if line.split_whitespace().next() != Some("v") {
            return line.to_owned();
        }
        number += 1;
        let place: Vec<f64> = numbers(line).iter().filter_map(|word| word.parse().ok()).collect();
        match place[..] {
            [x, y, z, ..] if used.contains(&number) => {
                // The quad of a point light is 2e-6 wide.
                let moved = glam::dvec3(x, y, z) + by;
                format!("v {:.7} {:.7} {:.7}", moved.x, moved.y, moved.z)
            }
            _ => line.to_owned(),
        }
    });
    lines.map(|line| line + "\n").collect()
}

/// The material of the light: that of the first shape that emits.
fn light_material(scene: &Scene) -> usize {
    let emits = |shape: &&basecode::Shape| scene.materials()[shape.material].is_emitter();
    scene.shapes().iter().find(emits).map_or(0, |shape| shape.material)
}
