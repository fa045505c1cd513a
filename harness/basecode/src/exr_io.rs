//! OpenEXR files in and out: linear radiance, row 0 on top, no clamping, no tone mapping.
//!
//! [`write_exr`] writes what the course has always asked for: one part, scan lines, no compression, channels B, G, R.
//! [`write_exr_layers`] stores several images of one size in one file as EXR layers (channels `mean.R`, `mean.G`, ...).
//!
//! Reading trusts nothing: sizes are checked before anything is allocated, every problem is an [`ImageError`] that
//! names the file, and NaN and infinity come through unchanged, for the caller to judge.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use exr::compression::Compression;
use thiserror::Error;

use crate::image::Image;

mod attributes;
mod blocks;
mod encode;
mod header;
mod luminance;
mod rows;
mod source;

pub(crate) use header::kind_of;
pub use rows::{Band, ExrRows};

/// The longest side that is read or written, in pixels.
pub const MAX_SIDE: usize = 16_384;
/// The most pixels that are read or written: 64 Mi, so 768 MiB as `Vec3`.
pub const MAX_PIXELS: usize = 64 << 20;
/// The largest file that is read, in bytes: [`MAX_PIXELS`] as three 32-bit floats, and room for a header.
pub const MAX_FILE_BYTES: u64 = 12 * MAX_PIXELS as u64 + (1 << 20);
/// How a color is stored in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 16-bit floats: 11 significant bits, largest finite value 65504; beyond it becomes infinite.
    Half,
    /// 32-bit floats: exactly what is in memory.
    Float,
}

/// Why an image file could not be read or written.
#[derive(Debug, Error)]
pub enum ImageError {
    /// The file system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file does not start as an EXR does.
    #[error("{}: not an EXR file: it starts with {found}, expected 76 2f 31 01", path.display())]
    NotExr {
        /// The file.
        path: PathBuf,
        /// Its first bytes, in hexadecimal or in words.
        found: String,
    },
    /// The file ends too early.
    #[error("{}: truncated: the file ends after {found_bytes} bytes, while reading {missing}", path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Its length in bytes.
        found_bytes: u64,
        /// What should have come.
        missing: String,
    },
    /// Too large, or without pixels.
    #[error("{}: {found}, expected {expected}", path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// The size in words.
        found: String,
        /// The limit in words.
        expected: String,
    },
    /// The data window is not the display window.
    #[error("{}: the pixels cover {data} but the picture is {display}; hint: write the whole film, uncropped", path.display())]
    Windows {
        /// The file.
        path: PathBuf,
        /// The data window.
        data: String,
        /// The display window.
        display: String,
    },
    /// A color channel is not there.
    #[error("{}: no channel {channel}; expected R, G and B, found {found}", path.display())]
    MissingChannel {
        /// The file.
        path: PathBuf,
        /// The full name of the missing channel.
        channel: String,
        /// The names that are there.
        found: String,
    },
    /// Only luminance is stored.
    #[error("{}: luminance only (channel Y); expected R, G and B", path.display())]
    LuminanceOnly {
        /// The file.
        path: PathBuf,
    },
    /// A valid file of a kind that is not accepted.
    #[error("{}: {what}, expected {expected}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it uses.
        what: String,
        /// What it should use.
        expected: String,
    },
    /// Contradicting or damaged content.
    #[error("{}: damaged: {what}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        what: String,
    },
    /// The caller asked to write something that has no valid form.
    #[error("{}: cannot be written: {what}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
}

/// Several images of one size in one file, with a text that says where they come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExrLayers {
    /// Images by layer name; the unnamed layer (plain R, G, B) has the name "".
    pub layers: BTreeMap<String, Image>,
    /// Provenance: one line of printable Latin-1 each; stored together in the standard attribute `comments`.
    pub attributes: BTreeMap<String, String>,
    /// What a reader may want to know about the file; not written.
    pub notes: Vec<String>,
    /// The primaries that the file declares: CIE xy of red, green, blue and white. Without any, EXR
    /// means [`REC_709`]. Not written, and values are not converted.
    pub chromaticities: Option<[[f32; 2]; 4]>,
}

/// CIE xy of red, green, blue and white of Rec. 709, which all images here are meant in.
pub const REC_709: [[f32; 2]; 4] = [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]];

/// Reads the R, G, B channels of an EXR file as linear radiance.
///
/// # Errors
/// See [`ImageError`]; nothing that a file can hold makes this panic.
pub fn read_exr(path: impl AsRef<Path>) -> Result<Image, ImageError> {
    ExrRows::open(path)?.image()
}

/// Reads every layer of an EXR file that has R, G and B.
///
/// # Errors
/// See [`ImageError`]; nothing that a file can hold makes this panic.
pub fn read_exr_layers(path: impl AsRef<Path>) -> Result<ExrLayers, ImageError> {
    ExrRows::open(path)?.images()
}

/// Writes `image` as the course's own files are: one part, scan lines, uncompressed, channels B, G, R.
///
/// `attributes` are (name, one line of text) pairs kept in the file's `comments`.
///
/// # Errors
/// When the image is empty or too large, a text cannot be stored, or the file system refuses.
pub fn write_exr(
    path: impl AsRef<Path>,
    image: &Image,
    precision: Precision,
    attributes: &[(&str, &str)],
) -> Result<(), ImageError> {
    let path = path.as_ref();
    let attributes = attributes.iter().map(|&(k, v)| (k.to_owned(), v.to_owned())).collect();
    let bytes =
        encode::encode(&[("", image)], &attributes, precision, Compression::Uncompressed, path)?;
    write_file(path, &bytes)
}

/// Writes all layers of `content` into one ZIP-compressed file; the same content gives the same bytes.
///
/// # Errors
/// When there is no layer, sizes differ, a name or text cannot be stored, or the file system refuses.
pub fn write_exr_layers(
    path: impl AsRef<Path>,
    content: &ExrLayers,
    precision: Precision,
) -> Result<(), ImageError> {
    let path = path.as_ref();
    let layers: Vec<_> =
        content.layers.iter().map(|(name, image)| (name.as_str(), image)).collect();
    let bytes = encode::encode(&layers, &content.attributes, precision, Compression::ZIP16, path)?;
    write_file(path, &bytes)
}

/// Writes channels of 32-bit floats, uncompressed: their names, and `width` values for each row. `origin` is the pixel
/// where both windows begin, as [`ExrRows::origin`] answers it.
///
/// # Errors
/// When there is none, they are not of one size, or the file system refuses.
pub fn write_exr_channels(
    path: impl AsRef<Path>,
    origin: [i32; 2],
    width: usize,
    channels: &[(&str, Vec<f32>)],
) -> Result<(), ImageError> {
    let path = path.as_ref();
    write_file(path, &encode::encode_channels(origin, width, channels, path)?)
}

/// Decodes a whole EXR file held in memory; `path` only names it in messages.
///
/// # Errors
/// See [`ImageError`]; no bytes make this panic, and memory stays within a fixed multiple of their number.
pub fn decode_exr(bytes: &[u8], path: &Path) -> Result<ExrLayers, ImageError> {
    ExrRows::of_bytes(bytes, path)?.images()
}

fn read_file(file: std::fs::File, path: &Path) -> Result<Vec<u8>, ImageError> {
    use std::io::Read;
    let mut bytes = Vec::new();
    // One byte past the limit tells a file that is too long, even if it grows meanwhile.
    file.take(MAX_FILE_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| ImageError::Io { path: path.into(), source })?;
    Ok(bytes)
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    std::fs::write(path, bytes).map_err(|source| ImageError::Io { path: path.into(), source })
}
