//! Small textures in closed form, written as PNG.

use anyhow::Result;
use image::{ImageFormat, Rgb, RgbImage};
use std::io::Cursor;

/// An 8-bit RGB image beside the mesh; row 0 is the top row.
#[derive(Clone, Debug)]
pub struct Texture {
    /// File name in the mesh folder.
    pub file: &'static str,
    pub image: RgbImage,
}

impl Texture {
    /// Fills a square image of `size` texels a side with `color(column, row)`.
    pub fn new(file: &'static str, size: u32, color: impl Fn(u32, u32) -> [u8; 3]) -> Self {
        Self { file, image: RgbImage::from_fn(size, size, |x, y| Rgb(color(x, y))) }
    }

    /// The bytes of the PNG file.
    ///
    /// # Errors
    /// When it cannot be encoded.
    pub fn png(&self) -> Result<Vec<u8>> {
        let mut bytes = Cursor::new(Vec::new());
        self.image.write_to(&mut bytes, ImageFormat::Png)?;
        Ok(bytes.into_inner())
    }
}
