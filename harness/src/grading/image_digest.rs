//! Digests that tell whether two submitted images are the same.

use basecode::Image;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::files::hex;
use crate::imaging::srgb;

/// What is kept of an image that was submitted, to find it again in another submission.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageDigest {
    /// The scene.
    pub scene: String,
    /// Its path in the submission.
    pub path: String,
    /// SHA-256 over size and 8-bit sRGB levels, in hexadecimal: no rounding to half precision or to
    /// levels changes it.
    pub sha256: String,
}

impl ImageDigest {
    /// The digest of an image.
    pub fn new(scene: &str, path: &str, image: &Image) -> Self {
        let mut hash = Sha256::new();
        hash.update((image.width as u64).to_le_bytes());
        hash.update((image.height as u64).to_le_bytes());
        let channels = image.pixels.iter().flat_map(|pixel| pixel.to_array());
        hash.update(channels.map(|value| srgb::level(to_half(value))).collect::<Vec<u8>>());
        let sha256 = hex(&hash.finalize());
        Self { scene: scene.to_owned(), path: path.to_owned(), sha256 }
    }
}

/// The nearest value with the ten fraction bits of half precision, ties to even. What half
/// precision cannot hold (below 6e-5, above 65,504) has level 0 or 255 either way.
fn to_half(value: f32) -> f32 {
    let bits = value.to_bits();
    if !value.is_finite() {
        return value;
    }
    f32::from_bits((bits + 0x0fff + ((bits >> 13) & 1)) & !0x1fff)
}
