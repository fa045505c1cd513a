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
        hash.update(srgb::levels_of_halves(image));
        let sha256 = hex(&hash.finalize());
        Self { scene: scene.to_owned(), path: path.to_owned(), sha256 }
    }
}
