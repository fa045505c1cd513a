//! A linear color image in memory.

use glam::Vec3;

/// A row-major image of linear RGB values (Rec. 709 primaries); row 0 is the top row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// `width * height` colors.
    pub pixels: Vec<Vec3>,
}

impl Image {
    /// A black image.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![Vec3::ZERO; width * height] }
    }

    /// The color at column `x`, row `y` (0 is the top).
    ///
    /// # Panics
    /// When the position lies outside the image.
    pub fn at(&self, x: usize, y: usize) -> Vec3 {
        assert!(x < self.width, "column {x} of an image {} wide", self.width);
        self.pixels[y * self.width + x]
    }
}
