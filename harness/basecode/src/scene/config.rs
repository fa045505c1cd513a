//! The TOML file of a scene.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::text::{decode, read};
use crate::exr_io::{MAX_PIXELS, MAX_SIDE};
use crate::{CameraConfig, Error, Result, ShadingKind};

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
    /// Keys that nobody knows, as `section.key`. Harmless, but perhaps misspelt.
    pub unknown_keys: Vec<String>,
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
        // TOML knows no line that ends with CR alone.
        let text = &decode(bytes).replace("\r\n", "\n").replace('\r', "\n");
        let wrong = |line, message: String| Error::File { path: path.to_owned(), line, message };
        let file: File = toml::from_str(text).map_err(|error| {
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
            wrong(line, message)
        })?;
        let in_range = |section: &str, key: &str, value: i64, max: i64| {
            usize::try_from(value).ok().filter(|_| (1..=max).contains(&value)).ok_or_else(|| {
                let line = line_of_key(text, section, key);
                wrong(line, format!("{section}.{key} is {value} but must lie between 1 and {max}"))
            })
        };
        let camera = file.camera;
        for (key, value) in [("eye", camera.eye), ("at", camera.at), ("up", camera.up)] {
            if !value.is_finite() {
                let line = line_of_key(text, "camera", key);
                return Err(wrong(line, format!("camera.{key} is {value} but must be finite")));
            }
        }
        let fov = camera.fov_y_deg;
        if !(fov > 0.0 && fov < 180.0) {
            let line = line_of_key(text, "camera", "fov");
            let message = format!("camera.fov is {fov} but must lie between 0 and 180 degrees");
            return Err(wrong(line, message));
        }
        // Serde takes the first three of four.
        let numbers = |key| {
            let table: toml::Table = text.parse().ok()?;
            Some(table.get("camera")?.get(key)?.as_array()?.len())
        };
        for key in ["eye", "at", "up"] {
            if let Some(count) = numbers(key).filter(|count| *count != 3) {
                let line = line_of_key(text, "camera", key);
                let message = format!("camera.{key} has {count} numbers, expected 3: [x, y, z]");
                return Err(wrong(line, message));
            }
        }
        let renderer = file.renderer;
        // Written on Windows, perhaps.
        let mesh = file.input.objfile.trim().replace('\\', "/");
        if mesh.is_empty() {
            let message = "input.objfile names no file".to_owned();
            return Err(wrong(line_of_key(text, "input", "objfile"), message));
        }
        // A worker sees the files under other names; so does whoever moves the folder.
        let on_drive = matches!(mesh.as_bytes(), [b'a'..=b'z' | b'A'..=b'Z', b':', ..]);
        if on_drive || mesh.starts_with('/') || Path::new(&mesh).is_absolute() {
            let message =
                format!("input.objfile is {mesh} but must be relative to the folder of this file");
            return Err(wrong(line_of_key(text, "input", "objfile"), message));
        }
        let kind = match renderer.kind.as_deref() {
            None | Some("simple" | "direct") => ShadingKind::Simple,
            Some("normal") => ShadingKind::Normal,
            Some(other) => {
                let message = format!(
                    "renderer.type is \"{other}\" but must be \"simple\", \"direct\" or \"normal\""
                );
                return Err(wrong(line_of_key(text, "renderer", "type"), message));
            }
        };
        let width = in_range("film", "width", file.film.width, MAX_SIDE as i64)?;
        let height = in_range("film", "height", file.film.height, MAX_SIDE as i64)?;
        if width * height > MAX_PIXELS {
            let line = line_of_key(text, "film", "width");
            let message =
                format!("film has {} pixels but must have at most {MAX_PIXELS}", width * height);
            return Err(wrong(line, message));
        }
        Ok(Self {
            path: path.to_owned(),
            mesh: path.parent().unwrap_or(Path::new("")).join(mesh),
            camera,
            width,
            height,
            realtime: renderer.realtime,
            kind,
            spp: in_range("renderer", "spp", renderer.spp, 1 << 20)?,
            bonus: renderer.bonus,
            unknown_keys: unknown_keys(text),
        })
    }
}

fn unknown_keys(text: &str) -> Vec<String> {
    let Ok(table) = text.parse::<toml::Table>() else { return Vec::new() };
    let mut unknown = Vec::new();
    for (section, value) in &table {
        match value.as_table() {
            Some(keys) => unknown.extend(
                keys.keys()
                    .map(|key| format!("{section}.{key}"))
                    .filter(|key| !KNOWN_KEYS.contains(&key.as_str())),
            ),
            None => unknown.push(section.clone()),
        }
    }
    unknown
}

/// The line (from 1) that holds byte `offset`.
pub(super) fn line_at(text: &str, offset: usize) -> usize {
    1 + text.as_bytes()[..offset.min(text.len())].iter().filter(|&&b| b == b'\n').count()
}

/// The line (from 1) where `key` is set in `[section]`, if it is written that way.
fn line_of_key(text: &str, section: &str, key: &str) -> Option<usize> {
    let mut current = String::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.split(']').next()) {
            current = name.trim().to_owned();
        } else if current == section
            && line.strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with('='))
        {
            return Some(index + 1);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<SceneConfig> {
        SceneConfig::parse(Path::new("a/tinyrender/b.toml"), text.as_bytes())
    }

    #[test]
    fn defaults_are_the_original_course_ones() {
        let config = parse("[input]\nobjfile = \"../mesh/b.obj\"\n").unwrap();
        assert_eq!((config.width, config.height, config.spp), (768, 576, 1));
        assert_eq!(config.mesh, Path::new("a/tinyrender/../mesh/b.obj"));
        assert_eq!(config.camera, CameraConfig::default());
        let found = (config.realtime, config.kind, config.bonus);
        assert_eq!(found, (false, ShadingKind::Simple, false));
    }

    #[test]
    fn simple_and_direct_are_the_same_kind_on_both_paths() {
        let base = "[input]\nobjfile = \"b.obj\"\n[renderer]\n";
        for realtime in ["", "realtime = true\n"] {
            for (line, expected) in [
                ("", ShadingKind::Simple),
                ("type = \"simple\"", ShadingKind::Simple),
                ("type = 'direct'", ShadingKind::Simple),
                ("type = \"normal\"", ShadingKind::Normal),
            ] {
                let config = parse(&format!("{base}{realtime}{line}\n")).unwrap();
                assert_eq!(config.kind, expected, "{realtime}{line}");
            }
        }
    }

    #[test]
    fn mistakes_name_file_line_and_key() {
        let base = "[input]\nobjfile = \"b.obj\"\n";
        for (text, expected) in [
            ("[input\n", "b.toml:1"),
            ("[camera]\nfov = 30\n", "missing field `input`"),
            (&format!("{base}[film]\nwidth = 0\n"), "b.toml:4: film.width is 0"),
            (&format!("{base}[film]\nheight = 99999\n"), "b.toml:4: film.height is 99999"),
            (
                &format!("{base}[film]\nwidth = 16384\nheight = 4097\n"),
                "b.toml:4: film has 67125248 pixels but must have at most 67108864",
            ),
            (&format!("{base}[renderer]\nspp = -1\n"), "b.toml:4: renderer.spp is -1"),
            (
                &format!("{base}[renderer]\nspp = 4\ntype = \"glass\"\n"),
                "b.toml:5: renderer.type is \"glass\" but must be \"simple\", \"direct\" or \"normal\"",
            ),
            (&format!("{base}[renderer]\ntype = \"Simple\"\n"), "b.toml:4: renderer.type is"),
            (&format!("{base}[renderer]\ntype = \"\"\n"), "b.toml:4: renderer.type is \"\""),
            (&format!("{base}[renderer]\ntype = 1\n"), "b.toml:4: invalid type: integer"),
            (&format!("{base}[camera]\neye = [0, nan, 0]\n"), "b.toml:4: camera.eye"),
            (
                &format!("{base}[camera]\nfov = \"wide\"\n"),
                "b.toml:4: invalid type: string \"wide\", expected a number",
            ),
            (&format!("{base}[film]\nwidth = \"7\"\n"), "expected a whole number"),
            (&format!("{base}[camera]\nfov = 180\n"), "b.toml:4: camera.fov is 180"),
            (&format!("{base}[camera]\nfov = nan\n"), "b.toml:4: camera.fov is NaN"),
            ("[input]\nobjfile = \"\"\n", "b.toml:2: input.objfile names no file"),
            (
                "[input]\nobjfile = \"/m/b.obj\"\n",
                "b.toml:2: input.objfile is /m/b.obj but must be relative",
            ),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text:?} gave {message:?}");
        }
    }

    #[test]
    fn every_encoding_and_line_end_is_read() {
        let plain = "# gr\u{fc}n\n[input]\nobjfile = '..\\mesh\\b.obj'\n[film]\nwidth = 7\n";
        let latin: Vec<u8> = plain.chars().map(|c| c as u8).collect();
        let utf16 = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<_>>();
        for bytes in [
            plain.as_bytes().to_vec(),
            format!("\u{feff}{plain}").into_bytes(),
            utf16(&format!("\u{feff}{plain}")),
            latin,
            plain.replace('\n', "\r\n").into_bytes(),
            plain.replace('\n', "\r").into_bytes(),
        ] {
            let config = SceneConfig::parse(Path::new("a/b.toml"), &bytes).unwrap();
            let found = (config.width, config.mesh);
            assert_eq!(found, (7, PathBuf::from("a/../mesh/b.obj")), "{bytes:?}");
        }
    }

    #[test]
    fn unknown_keys_are_listed_not_refused() {
        let config = parse("title = 1\n[input]\nobjfile = \"b.obj\"\n[film]\nwdth = 3\n").unwrap();
        assert_eq!(config.unknown_keys, ["film.wdth", "title"]);
    }
}
