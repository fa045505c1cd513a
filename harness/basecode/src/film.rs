//! The film: the pixels of an image while it is rendered.

use glam::Vec3;

/// The pixels of an image while it is rendered: linear radiance [W m^-2 sr^-1], row-major, row 0 on
/// top.
#[derive(Debug)]
pub struct Film<'a> {
    width: usize,
    pixels: &'a mut [Vec3],
}

impl<'a> Film<'a> {
    /// A film over `pixels`, rows of `width`.
    ///
    /// # Panics
    /// When the rows are not all full.
    pub fn new(width: usize, pixels: &'a mut [Vec3]) -> Self {
        assert!(width > 0 && pixels.len().is_multiple_of(width), "a film holds full rows");
        Self { width, pixels }
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.pixels.len() / self.width
    }

    /// Sets the pixel at column `x`, row `y`.
    ///
    /// # Panics
    /// When the position lies outside the film.
    pub fn set(&mut self, x: usize, y: usize, radiance: Vec3) {
        assert!(x < self.width, "column {x} of a film {} wide", self.width);
        self.pixels[y * self.width + x] = radiance;
    }

    /// All pixels, row by row.
    pub fn pixels_mut(&mut self) -> &mut [Vec3] {
        self.pixels
    }
}
