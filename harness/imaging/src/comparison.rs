//! What a comparison found, as plain data.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// One rule with its value, its bound and its verdict; passed ones are listed too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RuleCheck {
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
    #[serde(rename = "centre")]
    Center,
    /// One sample at every pixel's center, in 8-bit sRGB levels.
    #[serde(rename = "centre_srgb8")]
    CenterSrgb8,
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
    pub checks: Vec<RuleCheck>,
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
    pub fn check(&self, id: &str) -> Option<&RuleCheck> {
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
