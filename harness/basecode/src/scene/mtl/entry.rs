//! The statements of one material.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{Vec2, Vec3};

use super::UsedFile;
use crate::scene::named_file::{existing, is_elsewhere, shown, taken_beside, why_missing};
use crate::scene::text::{split_keyword, unquoted, without_comment};
use crate::scene::texture::Mapping;
use crate::scene::{Material, MaterialModel, Texture};
use crate::{Error, Result};

/// A line of a file.
pub(super) struct Place<'a> {
    pub path: &'a Path,
    pub line: usize,
}

impl Place<'_> {
    pub fn wrong(&self, message: String) -> Error {
        Error::File { path: self.path.to_owned(), line: Some(self.line), message }
    }
}

/// A material as far as it is read.
pub(super) struct Entry {
    pub name: String,
    /// The name without a comment.
    pub plain: String,
    /// `Kd` and `Ks`, with their lines.
    colors: [Option<(usize, Vec3)>; 2],
    emission: Vec3,
    exponent: f32,
    illumination: Option<u32>,
    /// Line and text of `map_Kd` and `map_Ks`.
    maps: [Option<(usize, String)>; 2],
    /// The first statement that cannot be understood.
    pub broken: Option<Error>,
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
pub(super) enum Effect {
    /// What it says, or nothing that shows.
    Taken,
    /// Nothing, and it would change the picture elsewhere: what to say.
    None(String),
    /// Nothing: it is none of MTL.
    Unknown,
}

impl Entry {
    pub fn new(name: String, plain: String) -> Self {
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
    ///
    /// # Errors
    /// When the statement's values cannot be read.
    pub fn read(&mut self, at: &Place, keyword: &str, rest: &str) -> Result<Effect> {
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
                let color = color(keyword, rest).map_err(wrong)?;
                let which = usize::from(keyword.eq_ignore_ascii_case("ks"));
                self.colors[which] = Some((at.line, color));
                if color.max_element() > MAX_REFLECTANCE {
                    return Ok(Effect::None(format!(
                        "material \"{}\": {keyword} is {color}: a surface cannot reflect more than 1",
                        shown(&self.name)
                    )));
                }
            }
            "ke" => self.emission = color(keyword, rest).map_err(wrong)?,
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
    ///
    /// # Errors
    /// When a texture's statement is wrong, or its file cannot be read.
    pub fn material(
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
fn color(keyword: &str, rest: &str) -> std::result::Result<Vec3, String> {
    let mut values = Vec::with_capacity(3);
    for word in words(rest).take(3) {
        if ["spectral", "xyz"].contains(&word) {
            return Err(format!("{keyword} {word} is not supported, expected red, green, blue"));
        }
        let number = || format!("{keyword} has \"{word}\" where a number is expected");
        values.push(word.parse::<f32>().map_err(|_| number())?);
    }
    let value = match values[..] {
        [gray] => Vec3::splat(gray),
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
