//! The TOML file of a scene.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::de::DeTable;

use super::mesh::MeshFile;
use super::named_file::{file_of, is_elsewhere, taken_beside, why_missing};
use super::text::{decode, read};
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
struct File {
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

const KNOWN_KEYS: &[&str] = &[
    "input.objfile",
    "camera.eye",
    "camera.at",
    "camera.up",
    "camera.fov",
    "film.width",
    "film.height",
    "renderer.realtime",
    "renderer.type",
    "renderer.spp",
    "renderer.bonus",
];

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
        let wrong = |line, message: String| Error::File { path: path.to_owned(), line, message };
        let misread = |error: toml::de::Error| {
            let line = error.span().map(|span| line_at(text, span.start));
            // The parser names Rust's types.
            let mut message = error.message().to_owned();
            for (own, plain) in [
                ("expected i64", "expected a whole number"),
                ("expected f32", "expected a number"),
                ("expected a sequence of 3 f32 values", "expected 3 numbers: [x, y, z]"),
                (" as i128", ""),
                (" as u128", ""),
            ] {
                message = message.replace(own, plain);
            }
            if message.starts_with("invalid type: integer") && message.ends_with("number") {
                message = message.replace("invalid type: integer", "out of range: integer");
            }
            let statement =
                line.and_then(|line: usize| text.lines().nth(line - 1)).unwrap_or_default();
            match statement.split_once('=') {
                Some((key, value)) => {
                    if !message.contains(&format!("`{}`", key.trim())) {
                        message = format!("{}: {message}", key.trim());
                    }
                    message += slip(value);
                }
                // A value of several lines goes on here.
                None if statement.contains(',') => message += slip(statement),
                None => {}
            }
            if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("toml")) {
                message = format!("expected a scene's TOML file: {message}");
            }
            wrong(line, message)
        };
        let table = DeTable::parse(text).map_err(misread)?.into_inner();
        for (name, value) in &table {
            let name = name.get_ref();
            let is_section =
                KNOWN_KEYS.iter().any(|key| key.split('.').next() == Some(name.as_ref()));
            if is_section && !value.get_ref().is_table() {
                let line = Some(line_at(text, value.span().start));
                let found = value.get_ref().type_str();
                return Err(wrong(
                    line,
                    format!("{name} is of type {found}, expected a section [{name}]"),
                ));
            }
        }
        let file: File = toml::from_str(text).map_err(misread)?;
        let line_of_key =
            |section: &str, key: &str| key_at(&table, section, key).map(|at| line_at(text, at));
        let in_range = |section: &str, key: &str, value: i64, max: i64| {
            usize::try_from(value).ok().filter(|_| (1..=max).contains(&value)).ok_or_else(|| {
                let line = line_of_key(section, key);
                wrong(line, format!("{section}.{key} is {value} but must lie between 1 and {max}"))
            })
        };
        let camera = file.camera;
        for (key, value) in [("eye", camera.eye), ("at", camera.at), ("up", camera.up)] {
            if !value.is_finite() {
                let line = line_of_key("camera", key);
                return Err(wrong(line, format!("camera.{key} is {value} but must be finite")));
            }
        }
        let fov = camera.fov_y_deg;
        if !(fov > 0.0 && fov < 180.0) {
            let line = line_of_key("camera", "fov");
            let message = format!("camera.fov is {fov} but must lie between 0 and 180 degrees");
            return Err(wrong(line, message));
        }
        // Serde takes the first three of four.
        let numbers = |key| {
            let value = table.get("camera")?.get_ref().get(key)?;
            Some(value.get_ref().as_array()?.len())
        };
        for key in ["eye", "at", "up"] {
            if let Some(count) = numbers(key).filter(|count| *count != 3) {
                let line = line_of_key("camera", key);
                let message = format!("camera.{key} has {count} numbers, expected 3: [x, y, z]");
                return Err(wrong(line, message));
            }
        }
        if let Err(error) = Camera::new(camera, 1, 1) {
            let line = ["eye", "at", "up"].iter().find_map(|key| line_of_key("camera", key));
            return Err(wrong(line, error.to_string()));
        }
        let renderer = file.renderer;
        // Written on Windows, perhaps.
        let name = file.input.objfile.trim().replace('\\', "/");
        let wrong_mesh = |message| wrong(line_of_key("input", "objfile"), message);
        if name.is_empty() {
            return Err(wrong_mesh("input.objfile names no file".to_owned()));
        }
        if name.contains(|c: char| c.is_ascii_control()) {
            let message =
                "input.objfile holds a control character, which a \\ and a letter stand for";
            return Err(wrong_mesh(format!("{message}{SLASH}")));
        }
        // A worker sees the files under other names; so does whoever moves the folder.
        let on_drive = matches!(name.as_bytes(), [b'a'..=b'z' | b'A'..=b'Z', b':', ..]);
        if on_drive || name.starts_with('/') || Path::new(&name).is_absolute() {
            let message =
                format!("input.objfile is {name} but must be relative to the folder of this file");
            return Err(wrong_mesh(message));
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        let mesh = file_of(folder, &[file.input.objfile.trim()]);
        let unknown = unknown_keys(&table).into_iter().map(|(name, at)| {
            format!("{}:{}: unknown key {name}", path.display(), line_at(text, at))
        });
        let mut remarks: Vec<String> = unknown.collect();
        if is_elsewhere(folder, &name) && mesh.is_file() {
            let line = line_of_key("input", "objfile").unwrap_or_default();
            remarks.push(taken_beside(path, line, &name, &mesh));
        }
        let kind = match renderer.kind.as_deref() {
            None | Some("simple" | "direct") => ShadingKind::Simple,
            Some("normal") => ShadingKind::Normal,
            Some(other) => {
                let message = format!(
                    "renderer.type is \"{other}\" but must be \"simple\", \"direct\" or \"normal\""
                );
                return Err(wrong(line_of_key("renderer", "type"), message));
            }
        };
        let width = in_range("film", "width", file.film.width, MAX_SIDE as i64)?;
        let height = in_range("film", "height", file.film.height, MAX_SIDE as i64)?;
        if width * height > MAX_PIXELS {
            let line = line_of_key("film", "width");
            let message =
                format!("film has {} pixels but must have at most {MAX_PIXELS}", width * height);
            return Err(wrong(line, message));
        }
        Ok(Self {
            path: path.to_owned(),
            mesh,
            camera,
            width,
            height,
            realtime: renderer.realtime,
            kind,
            spp: in_range("renderer", "spp", renderer.spp, 1 << 20)?,
            bonus: renderer.bonus,
            remarks,
        })
    }
}

const SLASH: &str = "; hint: write / in a path";
const POINT: &str = "; hint: write a point in square brackets: [x, y, z]";

/// The hint on a value that was written as other languages, a calculator or a word processor have it.
fn slip(value: &str) -> &'static str {
    let value = value.split('#').next().unwrap_or_default().trim();
    if value.contains(['\u{201c}', '\u{201d}', '\u{201e}', '\u{2018}', '\u{2019}']) {
        return "; hint: write straight quotes: \"";
    }
    if value.contains(['"', '\'']) {
        return if value.contains('"') && value.contains('\\') { SLASH } else { "" };
    }
    if value.contains("//") {
        return "; hint: a comment begins with #";
    }
    if value.ends_with(';') {
        return "; hint: a line ends without ;";
    }
    if value.contains(['\u{2212}', '\u{2010}', '\u{2011}', '\u{2013}', '\u{2014}']) {
        return "; hint: write a minus sign as -";
    }
    match value.to_ascii_lowercase().as_str() {
        "true" | "on" | "yes" => return "; hint: write true",
        "false" | "off" | "no" => return "; hint: write false",
        _ => {}
    }
    if value.contains(['(', '<']) || value.contains('{') && !value.contains('=') {
        return POINT;
    }
    let words = || value.split([',', '[', ']', ' ', '\t']).filter(|word| !word.is_empty());
    let is_number = |word: &str| {
        word.trim_start_matches(['+', '-', '.']).starts_with(|c: char| c.is_ascii_digit())
    };
    // `50.0 deg`
    let has_unit = words().next().is_some_and(is_number)
        && words().skip(1).all(|word| word.chars().all(char::is_alphabetic));
    if has_unit && words().count() > 1 {
        return "; hint: write a number without letters or signs behind it";
    }
    if !words().all(is_number) {
        return "";
    }
    if words().any(|word| word.ends_with(|c: char| !c.is_ascii_digit() && c != '.')) {
        return "; hint: write a number without letters or signs behind it";
    }
    let has_bare_point = |word: &str| word.trim_start_matches(['+', '-']).starts_with('.');
    if words().any(|word| has_bare_point(word) || word.ends_with('.')) {
        return "; hint: write digits on both sides of a point, as in 0.5";
    }
    match (words().count(), value.matches(',').count(), value.contains('[')) {
        (3.., commas, true) if commas < 2 => "; hint: write commas between numbers: [x, y, z]",
        (3.., _, false) => POINT,
        (2, 1, false) => "; hint: write a point in a number, as in 50.0",
        _ => "",
    }
}

/// A text whose lines end with LF: TOML knows none that ends with CR alone.
fn plain_lines(bytes: &[u8]) -> String {
    let text = decode(bytes).replace("\r\n", "\n").replace('\r', "\n");
    // Joined files hold a byte order mark inside.
    text.replace("\n\u{feff}", "\n")
}

/// Keys that nobody knows, as `section.key`, and the byte that each stands at.
fn unknown_keys(table: &DeTable) -> Vec<(String, usize)> {
    let mut unknown = Vec::new();
    for (section, value) in table {
        let name = section.get_ref();
        match value.get_ref().as_table() {
            Some(keys) => unknown.extend(
                keys.keys()
                    .map(|key| (format!("{name}.{}", key.get_ref()), key.span().start))
                    .filter(|(key, _)| !KNOWN_KEYS.contains(&key.as_str())),
            ),
            None => unknown.push((name.to_string(), section.span().start)),
        }
    }
    unknown
}

/// The line (from 1) that holds byte `offset`.
pub(super) fn line_at(text: &str, offset: usize) -> usize {
    1 + text.as_bytes()[..offset.min(text.len())].iter().filter(|&&b| b == b'\n').count()
}

/// The byte where `key` of `section` stands, however it is written.
fn key_at(table: &DeTable, section: &str, key: &str) -> Option<usize> {
    let keys = table.get(section)?.get_ref().as_table()?;
    keys.keys().find(|own| own.get_ref() == key).map(|own| own.span().start)
}

#[cfg(test)]
mod tests;
