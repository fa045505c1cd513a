//! Materials of MTL files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};
use unicode_normalization::UnicodeNormalization as _;

use super::named_file::{existing, is_elsewhere, library_files, shown, taken_beside, why_missing};
use super::obj::Named;
use super::text::{
    Statements, begins_as, decode, ignored_remarks, read, split_keyword, unquoted, without_comment,
};
use super::texture::Mapping;
use super::{Material, MaterialModel, Texture};
use crate::{Error, Result};

/// A file of a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsedFile {
    /// The file.
    pub path: PathBuf,
    /// File and line that name it; none for the OBJ file.
    pub named_at: Option<(PathBuf, usize)>,
}

/// The materials of all MTL files that a mesh names.
#[derive(Debug, Default)]
pub(super) struct Library {
    /// In the order of the files.
    pub materials: Vec<Material>,
    /// The names of each material: as it stands, and without a comment behind it.
    names: Vec<[String; 2]>,
    /// What is wrong with each material. Only one that a face uses is an error.
    pub broken: Vec<Option<Error>>,
    /// The MTL files, as they are named.
    files: Vec<UsedFile>,
    /// The files of the textures, each with its material.
    textures: Vec<(usize, UsedFile)>,
    /// What was left out.
    pub remarks: Vec<String>,
    /// The remarks on statements that are not supported, and on files without a material.
    pub ignored: Vec<String>,
}

/// Names that a message lists at most.
const LISTED: usize = 12;

impl Library {
    /// Loads the files that the `mtllib` statements of the mesh at `obj` name, each once.
    ///
    /// # Errors
    /// When a file is missing or cannot be understood.
    pub(super) fn load(obj: &Path, statements: &[Named]) -> Result<Self> {
        let mut library = Self::default();
        let folder = obj.parent().unwrap_or(Path::new(""));
        for statement in statements {
            let wrong =
                |message| Error::File { path: obj.to_owned(), line: Some(statement.line), message };
            let files = library_files(folder, &statement.name);
            if files.is_empty() {
                return Err(wrong("mtllib names no file".to_owned()));
            }
            for file in files {
                if library.files.iter().any(|known| known.path == file) {
                    continue;
                }
                let bytes = read(&file).map_err(|error| {
                    let why = why_missing(&statement.name, &file);
                    wrong(format!("cannot read the material file {}: {error}{why}", file.display()))
                })?;
                if is_elsewhere(folder, &statement.name) {
                    library.remarks.push(taken_beside(obj, statement.line, &statement.name, &file));
                }
                library.read(&file, &bytes);
                let named_at = Some((obj.to_owned(), statement.line));
                library.files.push(UsedFile { path: file, named_at });
            }
        }
        Ok(library)
    }

    /// Settles what is wrong with materials: an error where faces use one, else a remark. Answers all
    /// files that are used: of materials, then of textures.
    ///
    /// # Errors
    /// When a used material cannot be understood.
    pub(super) fn settle(&mut self, used: &[usize]) -> Result<Vec<UsedFile>> {
        for &material in used {
            if let Some(error) = self.broken[material].take() {
                return Err(error);
            }
        }
        for error in self.broken.iter().flatten() {
            self.remarks.push(format!("{error}; no face uses this material"));
        }
        let textures = self.textures.iter().filter(|(material, _)| used.contains(material));
        Ok(self.files.iter().chain(textures.map(|(_, file)| file)).cloned().collect())
    }

    /// Index of the material of that name. Of several the first one counts, as the specification
    /// has it for several files.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        let plain = unquoted(without_comment(name));
        let named = |which: usize, name: &str| {
            self.names.iter().position(|names| names[which] == name && !name.is_empty())
        };
        // An accent may be a character of its own, as macOS writes names.
        let alike = || {
            let is_it = |own: &String| !own.is_empty() && own.nfc().eq(plain.nfc());
            self.names.iter().position(|names| names.iter().any(is_it))
        };
        let found = named(0, name).or_else(|| named(0, plain)).or_else(|| named(1, plain));
        found.or_else(|| alike().filter(|_| !plain.is_ascii()))
    }

    /// Whether an earlier material is found by the name of this one: `Material #1` and `Material #2` are two, while
    /// either is `Material` with a comment.
    fn hides(&self, name: &str, plain: &str) -> bool {
        let found = self.find(plain);
        found.is_some_and(|at| {
            let own = &self.names[at][0];
            let is_comment = |whole: &str| whole.contains('#');
            own.nfc().eq(name.nfc()) || !is_comment(own) || !is_comment(name)
        })
    }

    /// The message for a material name that is not found.
    pub(super) fn lacks(&self) -> String {
        let Some(UsedFile { path: first, .. }) = self.files.first() else {
            return "in no material file: the mesh names none (expected an mtllib statement)"
                .into();
        };
        let file = |path: &Path| path.file_name().unwrap_or_default().display().to_string();
        let named = self.names.iter().map(|[name, _]| name.as_str());
        let mut names: Vec<&str> = named.filter(|name| !name.is_empty()).collect();
        if names.len() > LISTED {
            names.truncate(LISTED);
            names.push("...");
        }
        let names = if names.is_empty() { "no material".into() } else { shown(&names.join(", ")) };
        match &self.files[1..] {
            [] => format!("not in {} (it has: {names})", file(first)),
            _ => {
                let files: Vec<String> = self.files.iter().map(|used| file(&used.path)).collect();
                format!("in none of {} (they have: {names})", files.join(", "))
            }
        }
    }

    /// Adds the materials of one file.
    fn read(&mut self, path: &Path, bytes: &[u8]) {
        let text = &decode(bytes);
        let before = self.materials.len();
        let mut current: Option<Entry> = None;
        let mut ignored: BTreeMap<String, (usize, usize)> = BTreeMap::new();
        for (line, statement) in Statements::new(text) {
            let (keyword, rest) = split_keyword(&statement);
            let at = Place { path, line };
            let mut ignore = || ignored.entry(keyword.to_owned()).or_insert((0, line)).0 += 1;
            if keyword.eq_ignore_ascii_case("newmtl") {
                self.add(path, current.take());
                let plain = unquoted(without_comment(rest)).to_owned();
                if self.hides(unquoted(rest), &plain) {
                    let message =
                        format!("material \"{plain}\" is there already: the first counts");
                    self.remarks.push(format!("{}:{line}: {message}", path.display()));
                }
                let mut entry = Entry::new(unquoted(rest).to_owned(), plain);
                if entry.name.is_empty() {
                    entry.broken = Some(at.wrong("newmtl names no material".to_owned()));
                }
                current = Some(entry);
            } else if let Some(entry) = &mut current {
                match entry.read(&at, keyword, rest) {
                    Ok(Effect::Taken) => {}
                    Ok(Effect::Unknown) => ignore(),
                    Ok(Effect::None(why)) => {
                        self.remarks.push(format!("{}:{line}: {why}", path.display()));
                    }
                    Err(error) => _ = entry.broken.get_or_insert(error),
                }
            } else {
                // It belongs to no material.
                ignore();
            }
        }
        self.add(path, current);
        if self.materials.len() > before || ignored.is_empty() {
            self.ignored.extend(ignored_remarks(path, &ignored));
        } else {
            let begins = begins_as(bytes, text);
            let file = path.display();
            self.ignored.push(format!("{file} has no newmtl and {begins}: is it an MTL file?"));
        }
    }

    fn add(&mut self, path: &Path, entry: Option<Entry>) {
        let Some(mut entry) = entry else { return };
        self.names.push([entry.name.clone(), entry.plain.clone()]);
        let mut files = Vec::new();
        let mut material = Material { name: entry.name.clone(), ..Material::diffuse(Vec3::ZERO) };
        let mut broken = entry.broken.take();
        if broken.is_none() {
            match entry.material(path, &mut files, &mut self.remarks) {
                Ok(read) => material = read,
                Err(error) => broken = Some(error),
            }
        }
        let index = self.materials.len();
        self.textures.extend(files.into_iter().map(|file| (index, file)));
        self.materials.push(material);
        self.broken.push(broken);
    }
}

/// A line of a file.
struct Place<'a> {
    path: &'a Path,
    line: usize,
}

impl Place<'_> {
    fn wrong(&self, message: String) -> Error {
        Error::File { path: self.path.to_owned(), line: Some(self.line), message }
    }
}

/// A material as far as it is read.
struct Entry {
    name: String,
    /// The name without a comment.
    plain: String,
    /// `Kd` and `Ks`, with their lines.
    colors: [Option<(usize, Vec3)>; 2],
    emission: Vec3,
    exponent: f32,
    illumination: Option<u32>,
    /// Line and text of `map_Kd` and `map_Ks`.
    maps: [Option<(usize, String)>; 2],
    /// The first statement that cannot be understood.
    broken: Option<Error>,
    /// Line and text of each statement of which the last counts, by its keyword.
    said: BTreeMap<String, (usize, String)>,
}

/// Statements of which the last counts.
const LAST_COUNTS: [&str; 7] = ["kd", "ks", "ke", "ns", "illum", "map_kd", "map_ks"];

/// Reflectances above this are remarked on: more than rounding.
const MAX_REFLECTANCE: f32 = 1.001;

/// The last illumination model of the MTL specification.
const LAST_MODEL: u32 = 10;

/// What a statement does.
enum Effect {
    /// What it says, or nothing that shows.
    Taken,
    /// Nothing, and it would change the picture elsewhere: what to say.
    None(String),
    /// Nothing: it is none of MTL.
    Unknown,
}

impl Entry {
    fn new(name: String, plain: String) -> Self {
        Self {
            name,
            plain,
            colors: [None, None],
            emission: Vec3::ZERO,
            exponent: 1.0,
            illumination: None,
            maps: [None, None],
            broken: None,
            said: BTreeMap::new(),
        }
    }

    /// Applies a statement, and says which earlier one it replaces.
    fn read(&mut self, at: &Place, keyword: &str, rest: &str) -> Result<Effect> {
        let effect = self.apply(at, keyword, rest)?;
        let lower = keyword.to_ascii_lowercase();
        if !LAST_COUNTS.contains(&lower.as_str()) {
            return Ok(effect);
        }
        let own = without_comment(rest).to_owned();
        let replaced = self.said.insert(lower, (at.line, own)).filter(|(_, before)| {
            before.split_whitespace().ne(without_comment(rest).split_whitespace())
        });
        Ok(match (replaced, effect) {
            (Some((line, _)), Effect::Taken) => Effect::None(format!(
                "material \"{}\": {keyword} replaces that of line {line}",
                shown(&self.name)
            )),
            (_, effect) => effect,
        })
    }

    fn apply(&mut self, at: &Place, keyword: &str, rest: &str) -> Result<Effect> {
        let wrong = |message: String| at.wrong(format!("material \"{}\": {message}", self.name));
        let none = || Ok(Effect::None(format!("{keyword} is ignored")));
        match keyword.to_ascii_lowercase().as_str() {
            "kd" | "ks" => {
                let color = colour(keyword, rest).map_err(wrong)?;
                let which = usize::from(keyword.eq_ignore_ascii_case("ks"));
                self.colors[which] = Some((at.line, color));
                if color.max_element() > MAX_REFLECTANCE {
                    return Ok(Effect::None(format!(
                        "material \"{}\": {keyword} is {color}: a surface cannot reflect more than 1",
                        shown(&self.name)
                    )));
                }
            }
            "ke" => self.emission = colour(keyword, rest).map_err(wrong)?,
            "ns" => {
                let word = words(rest).next().unwrap_or_default();
                let value =
                    word.parse().ok().filter(|value: &f32| value.is_finite() && *value >= 0.0);
                self.exponent = value.ok_or_else(|| {
                    wrong(format!("Ns is \"{word}\" but must be a finite number and at least 0"))
                })?;
            }
            "illum" => {
                let word = words(rest).next().unwrap_or_default();
                let model = word.parse().ok().filter(|model: &u32| *model <= u32::from(u8::MAX));
                let model = model.ok_or_else(|| {
                    wrong(format!("illum is \"{word}\" but must be a whole number from 0 to 255"))
                })?;
                self.illumination = Some(model);
                if model > LAST_MODEL {
                    return Ok(Effect::None(format!(
                        "illum {model} is no model of MTL (0 to {LAST_MODEL}): Phong is taken"
                    )));
                }
            }
            "map_kd" => self.maps[0] = Some((at.line, rest.to_owned())),
            "map_ks" => self.maps[1] = Some((at.line, rest.to_owned())),
            "bump" | "disp" | "decal" | "refl" | "norm" => return none(),
            other if other.starts_with("map_") => return none(),
            // Everything is opaque here. `-halo` may precede the number.
            "d" | "tr" => {
                let opaque = if keyword.eq_ignore_ascii_case("d") { 1.0 } else { 0.0 };
                let value = words(rest).last().and_then(|word| word.parse::<f32>().ok());
                if value.is_some_and(|value| value != opaque) {
                    return none();
                }
            }
            // Ambient light, refraction and the sharpness of reflections, which the assignment does not use.
            "ka" | "ni" | "tf" | "sharpness" => {}
            _ => return Ok(Effect::Unknown),
        }
        Ok(Effect::Taken)
    }

    /// Loads the textures, which lie beside the MTL file at `path`.
    fn material(
        self,
        path: &Path,
        files: &mut Vec<UsedFile>,
        remarks: &mut Vec<String>,
    ) -> Result<Material> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut texture = |index: usize, keyword: &str| {
            let color = self.colors[index];
            let Some((line, statement)) = &self.maps[index] else {
                return Ok(Texture::Constant(color.map_or(Vec3::ZERO, |(_, color)| color)));
            };
            let wrong = |message| {
                Place { path, line: *line }
                    .wrong(format!("material \"{}\": {keyword}: {message}", self.name))
            };
            let (mapping, name) = texture_statement(statement).map_err(wrong)?;
            let file = existing(folder, name);
            if !file.is_file()
                && let Some((before, options)) = name.split_once(" -")
                && existing(folder, before).is_file()
            {
                return Err(wrong(format!(
                    "-{options} stands behind the file, expected options before it"
                )));
            }
            let texture = Texture::load(&file, mapping)
                .map_err(|error| wrong(error + &why_missing(name, &file)))?;
            if is_elsewhere(folder, name) {
                remarks.push(taken_beside(path, *line, name, &file));
            }
            files.push(UsedFile { path: file, named_at: Some((path.to_owned(), *line)) });
            // Elsewhere it is a factor.
            if let Some((line, _)) = color.filter(|(_, color)| *color != Vec3::ONE) {
                let color = keyword.trim_start_matches("map_");
                remarks.push(format!(
                    "{}:{line}: material \"{}\": {color} is ignored: {keyword} takes its place",
                    path.display(),
                    self.name
                ));
            }
            Ok(texture)
        };
        Ok(Material {
            diffuse: texture(0, "map_Kd")?,
            specular: texture(1, "map_Ks")?,
            model: match self.illumination {
                Some(7) => MaterialModel::Diffuse,
                Some(5) => MaterialModel::Mirror,
                _ => MaterialModel::Phong,
            },
            exponent: self.exponent,
            emission: self.emission,
            name: self.name,
        })
    }
}

/// The words of a numeric statement, up to a comment.
fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split('#').next().unwrap_or_default().split_whitespace()
}

/// Three numbers, or one that counts for all.
fn colour(keyword: &str, rest: &str) -> std::result::Result<Vec3, String> {
    let mut values = Vec::with_capacity(3);
    for word in words(rest).take(3) {
        if ["spectral", "xyz"].contains(&word) {
            return Err(format!("{keyword} {word} is not supported, expected red, green, blue"));
        }
        let number = || format!("{keyword} has \"{word}\" where a number is expected");
        values.push(word.parse::<f32>().map_err(|_| number())?);
    }
    let value = match values[..] {
        [grey] => Vec3::splat(grey),
        [r, g, b] => Vec3::new(r, g, b),
        _ => {
            let found = values.len();
            return Err(format!("{keyword} has {found} numbers, expected 3: red, green, blue"));
        }
    };
    if value.is_finite() && value.min_element() >= 0.0 {
        return Ok(value);
    }
    Err(format!("{keyword} is {value} but must be finite and at least 0"))
}

/// Options and file of a `map_` statement. Options that would change the picture and are not
/// supported are refused.
fn texture_statement(statement: &str) -> std::result::Result<(Mapping, &str), String> {
    let mut mapping = Mapping::default();
    let mut rest = statement.trim();
    while rest.starts_with('-') {
        let (option, after) = split_keyword(rest);
        let name = option.to_ascii_lowercase();
        let unsupported =
            || format!("the option {option} is not supported; supported are -s, -o and -clamp");
        let numbers = match name.as_str() {
            "-s" | "-o" | "-t" => 1..=3,
            "-mm" => 2..=2,
            "-bm" | "-boost" | "-texres" => 1..=1,
            "-clamp" | "-cc" | "-blendu" | "-blendv" | "-imfchan" | "-type" => 0..=0,
            // A file's name may begin with a dash.
            _ if option.contains('.') => break,
            _ => return Err(unsupported()),
        };
        let (values, mut behind) = leading_numbers(after, *numbers.end());
        if values.len() < *numbers.start() {
            return Err(format!("{option} lacks its number"));
        }
        let or = |index: usize, default: f32| values.get(index).copied().unwrap_or(default);
        match name.as_str() {
            "-s" => mapping.scale = Vec2::new(or(0, 1.0), or(1, 1.0)),
            "-o" => mapping.offset = Vec2::new(or(0, 0.0), or(1, 0.0)),
            // Nothing changes.
            "-boost" => {}
            "-t" if values.iter().all(|value| *value == 0.0) => {}
            "-mm" if values == [0.0, 1.0] => {}
            _ if *numbers.end() > 0 => return Err(unsupported()),
            _ => {
                let (word, more) = split_keyword(behind);
                behind = more;
                let on = match word.to_ascii_lowercase().as_str() {
                    "on" => true,
                    "off" => false,
                    _ if name == "-imfchan" || name == "-type" => return Err(unsupported()),
                    _ => return Err(format!("{option} is \"{word}\", expected on or off")),
                };
                match name.as_str() {
                    "-clamp" => mapping.clamp = on,
                    // Lookups take the nearest texel: there is no blending to switch.
                    "-blendu" | "-blendv" => {}
                    "-cc" if !on => {}
                    _ => return Err(unsupported()),
                }
            }
        }
        rest = behind;
    }
    if unquoted(rest).is_empty() {
        return Err("names no file".to_owned());
    }
    Ok((mapping, rest))
}

/// Up to `most` finite numbers that a text begins with, and the rest. The last word is a file's name.
fn leading_numbers(text: &str, most: usize) -> (Vec<f32>, &str) {
    let (mut values, mut rest) = (Vec::new(), text.trim());
    while values.len() < most {
        let (word, after) = split_keyword(rest);
        let numeric = word.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
        match word.parse::<f32>() {
            Ok(value) if numeric && value.is_finite() && !after.is_empty() => values.push(value),
            _ => break,
        }
        rest = after;
    }
    (values, rest)
}

#[cfg(test)]
mod tests;
