//! Colors that may vary over a surface.

use std::io::{Cursor, ErrorKind};
use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::text::read;
use crate::SurfaceInteraction;

/// A color, constant or looked up in a bitmap.
#[derive(Clone, Debug)]
pub enum Texture {
    /// The same everywhere.
    Constant(Vec3),
    /// Looked up at the texture coordinates.
    Bitmap(Arc<Bitmap>),
}

/// An image to look up colors in, linear RGB, row 0 on top.
#[derive(Debug)]
pub struct Bitmap {
    width: usize,
    height: usize,
    texels: Vec<Vec3>,
    mapping: Mapping,
    /// The largest value of each component.
    max: Vec3,
    average: Vec3,
}

/// How texture coordinates become coordinates of a bitmap: scaled, then moved; beyond [0, 1] they
/// wrap around, or stay at the border.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mapping {
    pub scale: Vec2,
    pub offset: Vec2,
    pub clamp: bool,
}

impl Default for Mapping {
    fn default() -> Self {
        Self { scale: Vec2::ONE, offset: Vec2::ZERO, clamp: false }
    }
}

/// Bitmaps larger than this in either direction are refused.
const MAX_SIDE: u32 = 8192;

impl Texture {
    /// The color at a surface point.
    pub fn eval(&self, i: &SurfaceInteraction) -> Vec3 {
        self.lookup(i.uv)
    }

    /// The color at texture coordinates.
    pub fn lookup(&self, uv: Vec2) -> Vec3 {
        match self {
            Self::Constant(colour) => *colour,
            Self::Bitmap(bitmap) => bitmap.lookup(uv),
        }
    }

    /// The largest value of each component anywhere.
    pub fn max(&self) -> Vec3 {
        match self {
            Self::Constant(colour) => *colour,
            Self::Bitmap(bitmap) => bitmap.max,
        }
    }

    /// The mean color: what realtime uses in the texture's place.
    pub fn average(&self) -> Vec3 {
        match self {
            Self::Constant(colour) => *colour,
            Self::Bitmap(bitmap) => bitmap.average,
        }
    }

    /// Loads a bitmap (PNG, JPEG, TGA or BMP). Its 8-bit values are decoded from sRGB.
    pub(super) fn load(path: &Path, mapping: Mapping) -> Result<Self, String> {
        let file = path.display();
        // The name tells a TGA file, which has no other mark.
        let named = image::ImageFormat::from_path(path).ok();
        let mut reader = read(path)
            .and_then(|bytes| {
                let mut reader = image::ImageReader::new(Cursor::new(bytes));
                named.into_iter().for_each(|format| reader.set_format(format));
                reader.with_guessed_format()
            })
            .map_err(|error| format!("cannot read the texture {file}: {error}"))?;
        let format = reader.format();
        let mut limits = image::Limits::default();
        limits.max_image_width = Some(MAX_SIDE);
        limits.max_image_height = Some(MAX_SIDE);
        reader.limits(limits);
        let picture = reader.decode().map_err(|error| match error {
            image::ImageError::IoError(error) if error.kind() != ErrorKind::UnexpectedEof => {
                format!("cannot read the texture {file}: {error}")
            }
            image::ImageError::Unsupported(_) => {
                let names = format.map(|format| format.extensions_str().first().copied());
                let found = names.flatten().map_or("something else".into(), str::to_uppercase);
                format!("cannot decode the texture {file}: expected PNG, JPEG, TGA or BMP, found {found}")
            }
            error => {
                // The decoder of PNG adds its own types to what it says.
                let error = error.to_string();
                let said = error.split(" while decoding ").next().unwrap_or_default();
                format!("cannot decode the texture {file}: {said}")
            }
        })?;
        let picture = picture.into_rgb8();
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        if width == 0 || height == 0 {
            return Err(format!(
                "the texture {file} is {width}x{height}, expected one texel or more"
            ));
        }
        let texels = picture
            .pixels()
            .map(|p| Vec3::from(p.0.map(|level| srgb_to_linear(f32::from(level) / 255.0))))
            .collect();
        Ok(Self::Bitmap(Arc::new(Bitmap::new(width, height, texels, mapping))))
    }
}

impl From<Vec3> for Texture {
    fn from(colour: Vec3) -> Self {
        Self::Constant(colour)
    }
}

impl Bitmap {
    fn new(width: usize, height: usize, texels: Vec<Vec3>, mapping: Mapping) -> Self {
        let max = texels.iter().fold(Vec3::ZERO, |max, texel| max.max(*texel));
        let sum = texels.iter().fold(glam::DVec3::ZERO, |sum, texel| sum + texel.as_dvec3());
        let average = (sum / texels.len() as f64).as_vec3();
        Self { width, height, texels, mapping, max, average }
    }

    /// The nearest texel; v = 0 is the bottom row.
    fn lookup(&self, uv: Vec2) -> Vec3 {
        let Mapping { scale, offset, clamp } = self.mapping;
        let uv = uv * scale + offset;
        let wrap = |coordinate: f32, size: usize| {
            let within =
                if clamp { coordinate.clamp(0.0, 1.0) } else { coordinate.rem_euclid(1.0) };
            // A coordinate that is not finite has no texel; take the first rather than fail.
            ((within * size as f32) as usize).min(size - 1)
        };
        let x = wrap(uv.x, self.width);
        let y = self.height - 1 - wrap(uv.y, self.height);
        self.texels[y * self.width + x]
    }
}

/// Decodes an sRGB value in [0, 1] (IEC 61966-2-1).
fn srgb_to_linear(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::vec2;

    #[test]
    fn lookups_wrap_and_v_points_up() {
        let texels = vec![Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE]; // top row: X Y
        let bitmap = Bitmap::new(2, 2, texels, Mapping::default());
        assert_eq!(bitmap.lookup(vec2(0.25, 0.75)), Vec3::X);
        assert_eq!(bitmap.lookup(vec2(1.75, -0.25)), Vec3::Y);
        assert_eq!(bitmap.lookup(vec2(0.0, 0.0)), Vec3::Z);
        assert_eq!(bitmap.lookup(vec2(-0.25, 0.25)), Vec3::ONE);
        bitmap.lookup(vec2(f32::NAN, f32::INFINITY));
        let mapped = |scale, offset, clamp| Bitmap {
            mapping: Mapping { scale, offset, clamp },
            texels: bitmap.texels.clone(),
            ..bitmap
        };
        let twice = mapped(vec2(2.0, 2.0), vec2(0.0, 0.0), false);
        assert_eq!(twice.lookup(vec2(0.625, 0.875)), Vec3::X, "the second repetition");
        let moved = mapped(vec2(1.0, 1.0), vec2(0.5, 0.0), false);
        assert_eq!(moved.lookup(vec2(0.25, 0.75)), Vec3::Y);
        let clamped = mapped(vec2(1.0, 1.0), vec2(0.0, 0.0), true);
        assert_eq!(clamped.lookup(vec2(1.25, -7.0)), Vec3::ONE);
        clamped.lookup(vec2(f32::NAN, f32::INFINITY));
        let texture = Texture::Bitmap(Arc::new(bitmap));
        assert_eq!(texture.average(), Vec3::splat(0.5));
        assert_eq!(texture.max(), Vec3::ONE);
    }
}
