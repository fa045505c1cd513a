//! The data of the viewer: images in separate files, and their descriptions. The page itself is in `report`.

mod pack;

use serde::{Deserialize, Serialize};

pub use pack::{
    remove_others, write_channels, write_excess, write_image, write_mask, write_shared,
};

/// The folder of the data files, beside the page.
pub const DATA_FOLDER: &str = "viewer";

/// Images that belong together: all of one size, pixel over pixel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ViewedCase {
    /// Unique among the cases of a page; stands in its address.
    pub id: String,
    /// What the list of cases calls it.
    pub title: String,
    /// A sentence about it; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub note: String,
    /// Whether its scene is held back from the student.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub held_back: bool,
    /// The images, in the order of their numbers.
    pub layers: Vec<Layer>,
    /// The layer whose values set the exposure of all images where it is found from values; the first if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<usize>,
    /// The exposure to begin with, in stops; found from the values if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure: Option<f64>,
    /// Relative differences are relative to no less than this value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<f32>,
    /// What the values are, with their unit; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// The names of regions, by the index in the mask.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<String>,
    /// Column and row of the pixel that is furthest off, if something judged that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worst: Option<[usize; 2]>,
    /// The largest area of failing pixels: left column, top row, width, height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area: Option<[usize; 4]>,
}

/// One image of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Layer {
    /// Its name.
    pub name: String,
    /// What its values are.
    pub kind: LayerKind,
    /// Its values.
    pub image: ImageFile,
    /// Of a difference: what is subtracted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against: Option<ImageFile>,
}

/// What the values of a layer are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LayerKind {
    /// An image, as it came.
    Image,
    /// One image less another; the viewer subtracts.
    Difference,
    /// A pixel's difference over the largest that is allowed there.
    Excess,
    /// A mask of regions ([`crate::imaging::reference::RegionMask`]).
    Regions,
}

/// A data file, and what is needed to read it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageFile {
    /// Its path from the page's folder: below it, or below the one above where several pages share it.
    pub file: String,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Samples of a pixel.
    pub channels: usize,
    /// What a sample is.
    #[serde(rename = "type")]
    pub samples: Samples,
}

/// What a sample in a data file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Samples {
    /// A 16-bit float.
    Half,
    /// A 32-bit float.
    Float,
    /// A 16-bit number.
    Uint16,
}

impl Layer {
    /// An image as it came.
    pub fn image(name: impl Into<String>, image: &ImageFile) -> Self {
        Self { name: name.into(), kind: LayerKind::Image, image: image.clone(), against: None }
    }

    /// `image` less `against`.
    pub fn difference(name: impl Into<String>, image: &ImageFile, against: &ImageFile) -> Self {
        let (image, against) = (image.clone(), Some(against.clone()));
        Self { name: name.into(), kind: LayerKind::Difference, image, against }
    }
}

impl ViewedCase {
    /// All strings of it, for whoever must make them harmless.
    pub fn strings_mut(&mut self) -> impl Iterator<Item = &mut String> {
        let names = self.layers.iter_mut().map(|layer| &mut layer.name);
        [&mut self.id, &mut self.title, &mut self.note, &mut self.unit]
            .into_iter()
            .chain(&mut self.regions)
            .chain(names)
    }

    /// The data files that it needs, each once.
    pub fn files(&self) -> Vec<&str> {
        let layers = self.layers.iter();
        let files = layers.flat_map(|layer| [Some(&layer.image), layer.against.as_ref()]);
        let mut files: Vec<&str> = files.flatten().map(|image| image.file.as_str()).collect();
        files.sort_unstable();
        files.dedup();
        files
    }
}
