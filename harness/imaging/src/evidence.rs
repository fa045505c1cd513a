//! What a comparison found, as plain data, and the tolerances it was judged by.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Where "different" begins; each default says which measurement set it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Tolerances {
    /// A pixel fails when it lies further off than this many standard errors.
    /// Measured: correct images have 2e-5 to 6e-5 of their pixels above 4, wrong ones 1e-3 to 0.8.
    pub z_limit: f64,
    /// The largest fraction of interior pixels that may fail: the geometric mean of 6e-5 and 1e-3.
    pub interior_fraction: f64,
    /// Number of further pixels that may fail, in the interior and on edges, on any film. Gaussian noise puts 6e-5 of
    /// the pixels above 4: on 6,000 pixels 6 or more come once in 300,000 images, 3 or more once in 150.
    pub spare_pixels: u32,
    /// The largest fraction of the edge mask that may fail. A correct image has under 1 % there (binomial coverage at
    /// 16 spp, this module's tests); an image half a pixel off at 1 spp has 16 % of a mask three pixels wide.
    pub edge_fraction: f64,
    /// The part of the standard error that does not shrink with samples, as a fraction of the median lit value:
    /// measured on right renderers (5e-4), made relative.
    pub floor_of_median: f64,
    /// The same as a fraction of the expected value: measured on right renderers (0.002 b).
    pub floor_relative: f64,
    /// The largest signed bias of a region, relative to its mean. Measured: correct under 0.03 %, weakest mistake
    /// (n + 1 for n + 2) 1.56 %.
    pub bias_relative: f64,
    /// Or so many standard errors of the region's mean, if that is more: small regions and few samples are noisy.
    pub bias_standard_errors: f64,
    /// Regions with fewer interior pixels than this are judged pixel by pixel only: their variance is not well known.
    pub min_region_pixels: u32,
    /// Below minus this a value is negative. Measured: a missing test of `wi` goes far below, rounding does not.
    pub negative_limit: f64,
    /// Realtime, interior: the largest relative difference.
    pub realtime_relative: f64,
    /// More of it per unit of Phong exponent n. WGSL's pow is exp2(n log2 x) with log2 good to 2^-21, that is 3.3e-7 n,
    /// and cos(alpha) itself carries about 1e-6 from the interpolated normal; three times their sum.
    pub realtime_per_exponent: f64,
    /// And more of it where neighbors differ: this part of a pixel's way to them. Graphics hardware snaps vertices to
    /// 1/256 of a pixel and interpolates from there (lavapipe does not); an H100 was 0.73 of that off in a highlight
    /// one pixel wide. Twice that, for room.
    pub realtime_snap_px: f64,
    /// Realtime in 8-bit sRGB levels: a pixel fails when it is this many levels off. One level is rounding (2.5 to 45 %
    /// of pixels by driver).
    pub srgb_levels: u32,
    /// The largest fraction of interior pixels that may fail by levels: the geometric mean of 0.115 % (normal not
    /// renormalized, accepted) and 0.54 % (weakest real mistake). Correct images have 0 to 2 such pixels.
    pub srgb_fraction: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            z_limit: 4.0,
            interior_fraction: 2.5e-4,
            spare_pixels: 4,
            edge_fraction: 0.05,
            floor_of_median: 5e-4,
            floor_relative: 2e-3,
            bias_relative: 3e-3,
            bias_standard_errors: 10.0,
            min_region_pixels: 16,
            negative_limit: 1e-6,
            realtime_relative: 2e-3,
            realtime_per_exponent: 4e-6,
            realtime_snap_px: 1.0 / 128.0,
            srgb_levels: 2,
            srgb_fraction: 2.5e-3,
        }
    }
}

/// One rule with its value, its bound and its verdict; passed ones are listed too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// A stable name: `non_finite`, `negative`, `interior`, `blob`, `edge`, or `bias: <region>`.
    pub id: String,
    /// What was measured; always finite ([`f64::MAX`] if it could not be measured).
    pub value: f64,
    /// The largest magnitude of `value` that passes.
    pub bound: f64,
    /// The verdict.
    pub passed: bool,
    /// A sentence for the reader: where, expected, found.
    pub detail: String,
}

/// A contiguous area of failing interior pixels.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailingArea {
    /// Leftmost column.
    pub x: usize,
    /// Top row.
    pub y: usize,
    /// Width of its bounding box in pixels.
    pub width: usize,
    /// Height of its bounding box in pixels.
    pub height: usize,
    /// Failing pixels in it.
    pub pixels: usize,
}

/// The pixel that is furthest off, away from edges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorstPixel {
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// What the renderer drew there; values that are not finite are written as text in JSON.
    #[serde(with = "any_float")]
    pub actual: [f32; 3],
    /// What is expected there.
    #[serde(with = "any_float")]
    pub expected: [f32; 3],
    /// Its difference over the largest difference allowed there; above 1 fails.
    pub excess: f64,
}

/// The mean of a region in both images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegionBias {
    /// The region's name.
    pub region: String,
    /// Whether this is the region's highlight.
    pub highlight: bool,
    /// Interior pixels.
    pub pixels: u32,
    /// Mean of the actual image over them, per channel.
    pub actual: [f64; 3],
    /// Mean of the expected image over them, per channel.
    pub expected: [f64; 3],
    /// Relative bias of the channel that is worst against its bound.
    pub bias: f64,
    /// The bound of that channel.
    pub bound: f64,
}

/// What the actual image was compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ComparedWith {
    /// The mean of many jittered samples, with its variance.
    Mean,
    /// One sample at every pixel's center, linear.
    Centre,
    /// One sample at every pixel's center, in 8-bit sRGB levels.
    CentreSrgb8,
}

/// All that the comparison of one image found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageEvidence {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// What it was compared with.
    pub compared_with: ComparedWith,
    /// Every rule, in the order of `docs/evidence.md`.
    pub checks: Vec<Check>,
    /// The mean of every region with interior pixels.
    pub regions: Vec<RegionBias>,
    /// The largest contiguous area of failing interior pixels.
    pub largest_failing: Option<FailingArea>,
    /// The pixel furthest off, if any differs at all.
    pub worst: Option<WorstPixel>,
    /// Root of (squared difference over the difference that noise predicts), over all compared pixels: about 1 for an
    /// independent image of the spp it claims, 0 for a copy. `None` where no noise is expected. It decides nothing
    /// here.
    pub noise_ratio: Option<f64>,
}

impl ImageEvidence {
    /// Whether every rule holds.
    pub fn passed(&self) -> bool {
        !self.checks.is_empty() && self.checks.iter().all(|check| check.passed)
    }

    /// The check with this name.
    pub fn check(&self, id: &str) -> Option<&Check> {
        self.checks.iter().find(|check| check.id == id)
    }
}

/// Why two images could not be compared at all.
#[derive(Clone, Debug, Error, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CompareError {
    /// The submission's image has another size.
    #[error("image is {}x{} but {}x{} is expected{}", actual.0, actual.1, expected.0, expected.1,
        if (actual.0, actual.1) == (expected.1, expected.0) { "; hint: width comes first" } else { "" })]
    Size {
        /// Width and height of the actual image.
        actual: (usize, usize),
        /// Width and height of the expected image.
        expected: (usize, usize),
    },
    /// The image claims to have no samples.
    #[error("image has 0 samples per pixel, expected 1 or more")]
    NoSamples,
    /// The reference itself cannot be used: our own fault.
    #[error("{0}")]
    Reference(String),
}

/// Floats in JSON that need not be finite: `NaN` and `inf` become text.
mod any_float {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    #[derive(Serialize, Deserialize)]
    #[serde(untagged)]
    enum Written {
        Number(f32),
        Text(String),
    }

    pub fn serialize<S: Serializer>(values: &[f32; 3], serializer: S) -> Result<S::Ok, S::Error> {
        let write = |v: f32| match v.is_finite() {
            true => Written::Number(v),
            false => Written::Text(v.to_string()),
        };
        values.map(write).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f32; 3], D::Error> {
        let mut values = [0.0; 3];
        for (value, written) in values.iter_mut().zip(<[Written; 3]>::deserialize(deserializer)?) {
            *value = match written {
                Written::Number(v) => v,
                Written::Text(text) => text.parse().map_err(D::Error::custom)?,
            };
        }
        Ok(values)
    }
}
