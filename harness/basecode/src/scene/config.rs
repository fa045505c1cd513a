//! The TOML file of a scene.

mod written;

use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::de::DeTable;

use self::written::{SLASH, Written, key_at, line_at, misread, plain_lines};
use super::mesh::MeshFile;
use super::named_file::{file_of, is_elsewhere, taken_beside, why_missing};
use super::text::read;
use crate::exr_io::{MAX_PIXELS, MAX_SIDE};
use crate::{Camera, CameraConfig, Error, Result, ShadingKind};

/// A scene file as it was written, defaults filled in.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneConfig {
    /// The TOML file itself.
    pub path: PathBuf,
    /// The mesh, already resolved against the folder of the TOML file.
    pub mesh: PathBuf,
    /// Where the scene is looked at from.
    pub camera: CameraConfig,
    /// Film width in pixels.
    pub width: usize,
    /// Film height in pixels.
    pub height: usize,
    /// Offline (false) or realtime (true).
    pub realtime: bool,
    /// Which integrator or render pass draws it.
    pub kind: ShadingKind,
    /// Samples per pixel, offline.
    pub spp: usize,
    /// Whether realtime draws shadows (the bonus).
    pub bonus: bool,
    /// Keys that nobody knows, with file and line. Harmless, but perhaps misspelt.
    pub remarks: Vec<String>,
}

#[derive(Deserialize)]
struct SceneFile {
    input: Input,
    #[serde(default)]
    camera: CameraConfig,
    #[serde(default)]
    film: FilmSection,
    #[serde(default)]
    renderer: RendererSection,
}

#[derive(Deserialize)]
struct Input {
    objfile: String,
}

#[derive(Deserialize)]
#[serde(default)]
struct FilmSection {
    width: i64,
    height: i64,
}

impl Default for FilmSection {
    fn default() -> Self {
        Self { width: 768, height: 576 }
    }
}

#[derive(Deserialize)]
#[serde(default)]
struct RendererSection {
    realtime: bool,
    #[serde(rename = "type")]
    kind: Option<String>,
    spp: i64,
    bonus: bool,
}

impl Default for RendererSection {
    fn default() -> Self {
        Self { realtime: false, kind: None, spp: 1, bonus: false }
    }
}

impl SceneConfig {
    /// Loads the scene's mesh.
    ///
    /// # Errors
    /// As [`MeshFile::load`]; when there is no mesh file, names the line that asks for it.
    pub fn load_mesh(&self) -> Result<MeshFile> {
        let found = std::fs::metadata(&self.mesh).and_then(|found| match found.is_dir() {
            true => Err(std::io::Error::other("expected a file, found a folder")),
            false => Ok(()),
        });
        if let Err(error) = found {
            let bytes = read(&self.path).unwrap_or_default();
            let text = plain_lines(&bytes);
            let table = DeTable::parse(&text).ok();
            let at = table.and_then(|table| key_at(table.get_ref(), "input", "objfile"));
            let why = why_missing("", &self.mesh);
            return Err(Error::File {
                path: self.path.clone(),
                line: at.map(|at| line_at(&text, at)),
                message: format!("cannot read the mesh {}: {error}{why}", self.mesh.display()),
            });
        }
        MeshFile::load(&self.mesh)
    }

    /// Reads a scene file.
    ///
    /// # Errors
    /// When the file cannot be read, is not TOML, lacks `input.objfile`, or holds a value outside
    /// its range; names file, line and key.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = read(path)
            .map_err(|error| Error::file(path, format!("cannot read the scene: {error}")))?;
        Self::parse(path, &bytes)
    }

    /// Reads the bytes of a scene file that lies at `path`.
    ///
    /// # Errors
    /// As [`SceneConfig::load`].
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let text = &plain_lines(bytes);
        let written = Written::read(path, text)?;
        let file: SceneFile = toml::from_str(text).map_err(|error| misread(path, text, &error))?;
        let camera = camera(file.camera, &written)?;
        let name = mesh_name(&file.input.objfile, &written)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mesh = file_of(folder, &[file.input.objfile.trim()]);
        let mut remarks = written.unknown_keys();
        if is_elsewhere(folder, &name) && mesh.is_file() {
            let line = written.line_of_key("input", "objfile").unwrap_or_default();
            remarks.push(taken_beside(path, line, &name, &mesh));
        }
        let renderer = file.renderer;
        let kind = match renderer.kind.as_deref() {
            None | Some("simple" | "direct") => ShadingKind::Simple,
            Some("normal") => ShadingKind::Normal,
            Some(other) => {
                let message = format!(
                    "renderer.type is \"{other}\" but must be \"simple\", \"direct\" or \"normal\""
                );
                return Err(written.wrong("renderer", "type", message));
            }
        };
        let width = written.in_range("film", "width", file.film.width, MAX_SIDE as i64)?;
        let height = written.in_range("film", "height", file.film.height, MAX_SIDE as i64)?;
        if width * height > MAX_PIXELS {
            let message =
                format!("film has {} pixels but must have at most {MAX_PIXELS}", width * height);
            return Err(written.wrong("film", "width", message));
        }
        Ok(Self {
            path: path.to_owned(),
            mesh,
            camera,
            width,
            height,
            realtime: renderer.realtime,
            kind,
            spp: written.in_range("renderer", "spp", renderer.spp, 1 << 20)?,
            bonus: renderer.bonus,
            remarks,
        })
    }
}

/// The camera, if one can look so.
fn camera(camera: CameraConfig, written: &Written) -> Result<CameraConfig> {
    for (key, value) in [("eye", camera.eye), ("at", camera.at), ("up", camera.up)] {
        if !value.is_finite() {
            let message = format!("camera.{key} is {value} but must be finite");
            return Err(written.wrong("camera", key, message));
        }
    }
    let fov = camera.fov_y_deg;
    if !(fov > 0.0 && fov < 180.0) {
        let message = format!("camera.fov is {fov} but must lie between 0 and 180 degrees");
        return Err(written.wrong("camera", "fov", message));
    }
    // Serde takes the first three of four.
    for key in ["eye", "at", "up"] {
        if let Some(count) = written.numbers("camera", key).filter(|count| *count != 3) {
            let message = format!("camera.{key} has {count} numbers, expected 3: [x, y, z]");
            return Err(written.wrong("camera", key, message));
        }
    }
    if let Err(error) = Camera::new(camera, 1, 1) {
        let keys = ["eye", "at", "up"];
        let key = keys.into_iter().find(|key| written.line_of_key("camera", key).is_some());
        return Err(written.wrong("camera", key.unwrap_or_default(), error.to_string()));
    }
    Ok(camera)
}

/// The mesh as it is named, with `/` between folders.
fn mesh_name(objfile: &str, written: &Written) -> Result<String> {
    let wrong = |message| Err(written.wrong("input", "objfile", message));
    // Written on Windows, perhaps.
    let name = objfile.trim().replace('\\', "/");
    if name.is_empty() {
        return wrong("input.objfile names no file".to_owned());
    }
    if name.contains(|c: char| c.is_ascii_control()) {
        let message = "input.objfile holds a control character, which a \\ and a letter stand for";
        return wrong(format!("{message}{SLASH}"));
    }
    // A worker sees the files under other names; so does whoever moves the folder.
    let on_drive = matches!(name.as_bytes(), [b'a'..=b'z' | b'A'..=b'Z', b':', ..]);
    if on_drive || name.starts_with('/') || Path::new(&name).is_absolute() {
        return wrong(format!(
            "input.objfile is {name} but must be relative to the folder of this file"
        ));
    }
    Ok(name)
}

#[cfg(test)]
mod tests;
