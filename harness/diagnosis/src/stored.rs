//! The stored answers of known mistakes: `expected/<assignment>/mistakes/<view>.exr`.
//!
//! A file is a column of thumbnails, named in order by its attribute `tiles`. The first one holds the right answers,
//! the second the material behind each value, the others the answers of mistakes that differ here.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use basecode::exr_io::{ExrLayers, ImageError, Precision, read_exr_layers, write_exr_layers};
use basecode::{Image, Vec3};

use super::nearest::{Comparison, from_right};
use super::thumbnail::{COLUMNS, LENGTH, Thumbnail};
use super::view::View;
use imaging::reference::RegionMask;

/// The first two thumbnails of every file.
const HEAD: [&str; 2] = ["right", "material"];
/// The digest of the scene that a file was made from.
const DIGEST: &str = "scene_sha256";
/// What to do about a file that cannot be used.
const HINT: &str = "hint: `umbra bless --mistakes` makes it anew";

/// What a value of a view shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Material {
    /// No surface, or none in particular.
    None,
    /// A diffuse material.
    Diffuse,
    /// A Phong material.
    Phong,
    /// An edge or an emitter: never compared.
    Ignored,
}

impl Material {
    /// What the values of a thumbnail show, whose image has this mask.
    pub fn of_mask(mask: &RegionMask) -> Vec<Self> {
        let code = |(index, &value): (usize, &u16)| {
            let material = match mask.region(value) {
                _ if value & (RegionMask::EDGE | RegionMask::EMITTER) != 0 => Self::Ignored,
                _ if value & RegionMask::INDEX == 0 => Self::None,
                region if region.exponent > 0.0 => Self::Phong,
                _ => Self::Diffuse,
            };
            (index, [f32::from(material as u8); 3])
        };
        let tile = Thumbnail::of_pixels(
            (mask.width, mask.height),
            mask.pixels.iter().enumerate().map(code),
        );
        tile.values().iter().map(|value| Self::ALL[value.x as usize % Self::ALL.len()]).collect()
    }

    const ALL: [Self; 4] = [Self::None, Self::Diffuse, Self::Phong, Self::Ignored];
}

/// What right and mistaken renderers answer to one question.
#[derive(Clone, Debug)]
pub struct StoredView {
    /// What is right.
    pub right: Thumbnail,
    /// What each value shows.
    pub materials: Vec<Material>,
    /// What mistakes answer; those that answer what is right are not here.
    pub mistakes: BTreeMap<String, Thumbnail>,
    /// SHA-256 of the scene; empty when there is none.
    pub digest: String,
}

/// All that is stored.
#[derive(Clone, Debug, Default)]
pub struct Stored {
    /// By question.
    pub views: BTreeMap<View, StoredView>,
}

/// Why stored answers cannot be used: never a submission's fault.
#[derive(Debug, thiserror::Error)]
pub enum StoredError {
    /// The folder cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file is no image.
    #[error("{0}; {HINT}")]
    Image(#[from] ImageError),
    /// A file is an image of something else.
    #[error("{}: {what}; {HINT}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Expected and found.
        what: String,
    },
}

impl Stored {
    /// Reads every file of a folder; nothing is stored where there is no folder.
    ///
    /// # Errors
    /// When a file is broken or is not what its name says.
    pub fn load(folder: &Path) -> Result<Self, StoredError> {
        let io = |source| StoredError::Io { path: folder.to_owned(), source };
        let entries = match folder.read_dir() {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Ok(Self::default());
            }
            Err(error) => return Err(io(error)),
        };
        let mut stored = Self::default();
        for entry in entries {
            let path = entry.map_err(io)?.path();
            if path.extension().is_none_or(|extension| extension != "exr") {
                continue;
            }
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            let view = View::named(&name).ok_or_else(|| StoredError::Content {
                path: path.clone(),
                what: format!("expected the name of a view, found \"{name}\""),
            })?;
            let content = read_exr_layers(&path)?;
            let content =
                StoredView::of(content).map_err(|what| StoredError::Content { path, what })?;
            stored.views.insert(view, content);
        }
        Ok(stored)
    }

    /// Writes one file for each view and removes those of views that are no more.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn save(&self, folder: &Path) -> Result<(), StoredError> {
        let io = |source| StoredError::Io { path: folder.to_owned(), source };
        std::fs::create_dir_all(folder).map_err(io)?;
        for entry in folder.read_dir().map_err(io)? {
            let path = entry.map_err(io)?.path();
            if path.extension().is_some_and(|extension| extension == "exr") {
                std::fs::remove_file(path).map_err(io)?;
            }
        }
        for (view, content) in &self.views {
            let file = folder.join(format!("{view}.exr"));
            write_exr_layers(file, &content.layers(), Precision::Half)?;
        }
        Ok(())
    }
}

impl StoredView {
    /// The mean difference of an answer from what is right: 0 is the same, 1 nothing alike.
    pub fn differs(&self, tile: &Thumbnail) -> f64 {
        let (right, mistakes) = (&self.right, &self.mistakes);
        let counts = |shown: &Material| *shown != Material::Ignored;
        let counts = self.materials.iter().map(counts).collect();
        from_right(&[Comparison { seen: tile, right, mistakes, counts }])
    }

    fn layers(&self) -> ExrLayers {
        let material = |material: &Material| Vec3::splat(*material as u8 as f32);
        let mut pixels = self.right.values().to_vec();
        pixels.extend(self.materials.iter().map(material));
        let mut names = HEAD.to_vec();
        for (name, tile) in &self.mistakes {
            pixels.extend(tile.values());
            names.push(name);
        }
        let image = Image { width: COLUMNS, height: pixels.len() / COLUMNS, pixels };
        let attribute = |key: &str, value: String| (key.to_owned(), value);
        ExrLayers {
            layers: [("tiles".to_owned(), image)].into(),
            attributes: [
                attribute("tiles", names.join(" ")),
                attribute(DIGEST, self.digest.clone()),
                attribute("umbra_version", env!("CARGO_PKG_VERSION").to_owned()),
            ]
            .into(),
            ..Default::default()
        }
    }

    fn of(mut content: ExrLayers) -> Result<Self, String> {
        let attribute = |key: &str| content.attributes.get(key).cloned();
        let names = attribute("tiles").ok_or("no attribute \"tiles\"")?;
        let names: Vec<&str> = names.split(' ').collect();
        let digest = attribute(DIGEST).unwrap_or_default();
        let image = content.layers.remove("tiles").ok_or("no layer \"tiles\"")?;
        if names.get(..2) != Some(&HEAD) {
            return Err(format!(
                "the first thumbnails are {}, expected {}",
                names.join(" "),
                HEAD.join(" ")
            ));
        }
        let expected = (COLUMNS, LENGTH / COLUMNS * names.len());
        if (image.width, image.height) != expected {
            return Err(format!(
                "{}x{} pixels, expected {}x{} for {} thumbnails",
                image.width,
                image.height,
                expected.0,
                expected.1,
                names.len()
            ));
        }
        let mut tiles =
            image.pixels.chunks_exact(LENGTH).map(|values| Thumbnail::of_stored(values.to_vec()));
        let mut next = || tiles.next().flatten().ok_or("a thumbnail is missing");
        let right = next()?;
        let materials = next()?;
        let materials = materials.values().iter().map(|value| Material::ALL.get(value.x as usize));
        let materials: Option<Vec<Material>> = materials.map(Option::<&_>::copied).collect();
        let materials = materials.ok_or("a material that is none")?;
        let mut mistakes = BTreeMap::new();
        for name in &names[2..] {
            if mistakes.insert((*name).to_owned(), next()?).is_some() {
                return Err(format!("the thumbnail \"{name}\" is there twice"));
            }
        }
        Ok(Self { right, materials, mistakes, digest })
    }
}

#[cfg(test)]
mod tests {
    use super::super::view::ViewKind;
    use super::*;

    fn view() -> StoredView {
        let tile = |f: f32| Thumbnail::of_list(&[[f, f + 1.0, f32::NAN]; 3]).map(|v| v);
        let right = Thumbnail::of_list(&[[0.25, 0.5, 1.0]; LENGTH]);
        let dark = right.map(|value| 0.5 * value);
        StoredView {
            mistakes: [("dark".to_owned(), dark), ("broken".to_owned(), tile(1.0))].into(),
            materials: (0..LENGTH).map(|i| Material::ALL[i % 4]).collect(),
            right,
            digest: "abc".into(),
        }
    }

    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let views = [(View::new(ViewKind::Lit, "cbox"), view())].into();
        Stored { views }.save(folder.path()).unwrap();
        folder
    }

    #[test]
    fn what_was_saved_is_loaded() {
        let folder = folder();
        let stored = Stored::load(folder.path()).unwrap();
        let (found, expected) = (&stored.views[&View::new(ViewKind::Lit, "cbox")], view());
        assert_eq!(found.materials, expected.materials);
        assert_eq!(found.digest, "abc");
        let bits = |tile: &Thumbnail| format!("{:?}", tile.values());
        assert_eq!(bits(&found.right), bits(&expected.right));
        assert_eq!(found.mistakes.len(), 2);
        for (name, tile) in &expected.mistakes {
            assert_eq!(bits(&found.mistakes[name]), bits(tile), "{name}");
        }
        assert!(Stored::load(&folder.path().join("none")).unwrap().views.is_empty());
        Stored::default().save(folder.path()).unwrap();
        assert!(Stored::load(folder.path()).unwrap().views.is_empty());
    }

    #[test]
    fn broken_files_say_what_is_wrong() {
        let said = |spoil: &dyn Fn(&Path)| {
            let folder = folder();
            spoil(&folder.path().join("lit-cbox.exr"));
            Stored::load(folder.path()).unwrap_err().to_string()
        };
        let rewrite = |file: &Path, change: &dyn Fn(&mut ExrLayers)| {
            let mut content = read_exr_layers(file).unwrap();
            change(&mut content);
            write_exr_layers(file, &content, Precision::Half).unwrap();
        };
        let cut = said(&|file| {
            let bytes = std::fs::read(file).unwrap();
            std::fs::write(file, &bytes[..bytes.len() / 2]).unwrap();
        });
        assert!(cut.contains("lit-cbox.exr") && cut.contains("umbra bless --mistakes"), "{cut}");
        let renamed = said(&|file| {
            std::fs::rename(file, file.with_file_name("light-cbox.exr")).unwrap();
        });
        assert!(renamed.contains("found \"light-cbox\""), "{renamed}");
        for (change, expected) in [
            ("right material dark", "32x96 pixels, expected 32x72 for 3 thumbnails"),
            ("material right dark broken", "expected right material"),
            ("right material dark dark", "\"dark\" is there twice"),
        ] {
            let text = said(&|file| {
                rewrite(file, &|content| {
                    content.attributes.insert("tiles".into(), change.into());
                });
            });
            assert!(text.contains(expected), "{text}");
        }
    }
}
