//! The data that an image is compared with: mean, variance, pixel-center image, and a mask of regions.

use basecode::Vec3;
use basecode::image::Image;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A set of pixels that are judged together: one material, lit or shadowed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// What a report calls it, such as `floor, lit`.
    pub name: String,
    /// Whether the light reaches it. An unlit region is expected to be black.
    pub lit: bool,
    /// The Phong exponent of its material, 0 if diffuse: high powers lose digits in a shader.
    pub exponent: f32,
}

/// For every pixel the region it belongs to, and three flags.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegionMask {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The regions; entry 0 is the background, where no surface is seen.
    pub regions: Vec<Region>,
    /// Row by row, an index into `regions` in the low bits, and [`Self::EDGE`], [`Self::EMITTER`], [`Self::HIGHLIGHT`].
    pub pixels: Vec<u16>,
}

impl RegionMask {
    /// A silhouette, a shadow edge or the contour cos(theta_o) = 0 passes within reach of this pixel.
    pub const EDGE: u16 = 0x8000;
    /// An emitter is seen here: never compared.
    pub const EMITTER: u16 = 0x4000;
    /// The specular peak: its bias is judged apart from the rest of its region.
    pub const HIGHLIGHT: u16 = 0x2000;
    /// The bits of the region's index.
    pub const INDEX: u16 = 0x1fff;

    /// A mask that is background everywhere.
    pub fn background(width: usize, height: usize) -> Self {
        let background = Region { name: "background".into(), lit: false, exponent: 0.0 };
        Self { width, height, regions: vec![background], pixels: vec![0; width * height] }
    }

    /// The region of a pixel's mask value.
    pub fn region(&self, value: u16) -> &Region {
        &self.regions[usize::from(value & Self::INDEX)]
    }

    /// Whether a mask value is that of a lit pixel that is compared strictly.
    pub fn is_lit_interior(&self, value: u16) -> bool {
        value & (Self::EDGE | Self::EMITTER) == 0 && self.region(value).lit
    }

    /// The mask as an image, to be stored: the values in red, which floats hold exactly.
    pub fn to_image(&self) -> Image {
        let pixels = self.pixels.iter().map(|&value| Vec3::new(f32::from(value), 0.0, 0.0));
        Image { width: self.width, height: self.height, pixels: pixels.collect() }
    }

    /// The mask with these regions and the values of such an image.
    pub fn of_image(regions: Vec<Region>, image: &Image) -> Self {
        let pixels = image.pixels.iter().map(|pixel| pixel.x as u16).collect();
        Self { width: image.width, height: image.height, regions, pixels }
    }

    /// Where an image that is not black shows surfaces; edges, emitters and what is unlit do not count.
    pub fn coverage(&self, image: &Image) -> Coverage {
        let mut coverage = Coverage::default();
        for (pixel, &value) in image.pixels.iter().zip(&self.pixels) {
            let background = value & Self::INDEX == 0;
            if value & (Self::EDGE | Self::EMITTER) != 0 || !(background || self.region(value).lit)
            {
                continue;
            }
            let covered = *pixel != Vec3::ZERO;
            coverage.counted += 1;
            coverage.missing += usize::from(!covered && !background);
            coverage.extra += usize::from(covered && (background || !pixel.is_finite()));
        }
        coverage
    }
}

/// Numbers of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Those that count.
    pub counted: usize,
    /// Black where a surface is.
    pub missing: usize,
    /// Not black where none is, or not finite.
    pub extra: usize,
}

/// The expected image of a scene, with all that is needed to judge another image of it at any spp.
#[derive(Clone, Debug)]
pub struct ReferenceImage {
    /// Mean of `n` jittered samples a pixel, linear radiance.
    pub mean: Image,
    /// Variance of a *single* sample, per channel; the variance of `mean` is this over `n`.
    pub variance: Image,
    /// Samples per pixel of `mean`.
    pub n: u32,
    /// The image with one sample at every pixel's center.
    pub center: Image,
    /// Which pixel shows what.
    pub mask: RegionMask,
    /// Median over lit interior pixels of the mean of the three channels: the scene's own scale.
    pub median_lit: f32,
}

/// Why a reference cannot be used: always our own fault, never a submission's.
#[derive(Debug, Error, PartialEq)]
pub enum ReferenceError {
    /// The parts do not fit together.
    #[error("reference: {part} is {}x{}, expected {}x{} as the mean", found.0, found.1, expected.0, expected.1)]
    Size {
        /// Which part.
        part: &'static str,
        /// Its width and height.
        found: (usize, usize),
        /// Those of the mean.
        expected: (usize, usize),
    },
    /// A value that no correct render has.
    #[error("reference: the {part} holds {value} at ({x}, {y})")]
    Value {
        /// Which part.
        part: &'static str,
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// The color found.
        value: glam::Vec3,
    },
    /// A mask value without a region.
    #[error("reference: the mask names region {index} at ({x}, {y}), but there are {regions}")]
    Region {
        /// The index found.
        index: usize,
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// How many regions there are.
        regions: usize,
    },
    /// A mean without samples.
    #[error("reference: 0 samples per pixel")]
    NoSamples,
    /// A black reference would let a black image pass.
    #[error("reference: no lit pixel away from edges; it can prove nothing")]
    NothingLit,
}

impl ReferenceImage {
    /// Checks that the parts fit together and prove something.
    ///
    /// # Errors
    /// See [`ReferenceError`].
    pub fn new(
        mean: Image,
        variance: Image,
        n: u32,
        center: Image,
        mask: RegionMask,
    ) -> Result<Self, ReferenceError> {
        if n == 0 {
            return Err(ReferenceError::NoSamples);
        }
        let expected = (mean.width, mean.height);
        let sizes = [
            ("variance", (variance.width, variance.height)),
            ("centre", (center.width, center.height)),
            ("mask", (mask.width, mask.height)),
        ];
        if let Some(&(part, found)) = sizes.iter().find(|(_, size)| *size != expected) {
            return Err(ReferenceError::Size { part, found, expected });
        }
        for (part, image) in [("mean", &mean), ("variance", &variance), ("centre", &center)] {
            let bad = image.pixels.iter().position(|p| !p.is_finite() || p.min_element() < 0.0);
            if let Some(i) = bad {
                let (x, y, value) = (i % image.width, i / image.width, image.pixels[i]);
                return Err(ReferenceError::Value { part, x, y, value });
            }
        }
        let median_lit = check_mask(&mask, &mean)?;
        Ok(Self { mean, variance, n, center, mask, median_lit })
    }
}

/// Checks a mask against its table and returns the median lit value of `image` under it.
///
/// # Errors
/// When an index has no region, the sizes differ, or no interior pixel is lit.
pub(super) fn check_mask(mask: &RegionMask, image: &Image) -> Result<f32, ReferenceError> {
    let sizes = [(mask.width, mask.height), (mask.pixels.len(), 1), (image.pixels.len(), 1)];
    let pixels = image.width * image.height;
    if sizes != [(image.width, image.height), (pixels, 1), (pixels, 1)] {
        return Err(ReferenceError::Size {
            part: "mask",
            found: sizes[0],
            expected: (image.width, image.height),
        });
    }
    let index = |value: u16| usize::from(value & RegionMask::INDEX);
    if let Some(i) = mask.pixels.iter().position(|&m| index(m) >= mask.regions.len()) {
        return Err(ReferenceError::Region {
            index: index(mask.pixels[i]),
            x: i % mask.width,
            y: i / mask.width,
            regions: mask.regions.len(),
        });
    }
    let mut lit: Vec<f32> = mask
        .pixels
        .iter()
        .zip(&image.pixels)
        .filter(|(m, _)| mask.is_lit_interior(**m))
        .map(|(_, p)| p.element_sum() / 3.0)
        .collect();
    let middle = lit.len() / 2;
    if lit.is_empty() {
        return Err(ReferenceError::NothingLit);
    }
    let median = *lit.select_nth_unstable_by(middle, f32::total_cmp).1;
    if median > 0.0 { Ok(median) } else { Err(ReferenceError::NothingLit) }
}
