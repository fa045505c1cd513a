//! Materials of MTL files.

mod entry;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::Vec3;
use unicode_normalization::UnicodeNormalization as _;

use self::entry::{Effect, Entry, Place};
use super::Material;
use super::named_file::{is_elsewhere, library_files, shown, taken_beside, why_missing};
use super::obj::Named;
use super::text::{
    Statements, begins_as, decode, ignored_remarks, read, split_keyword, unquoted, without_comment,
};
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
