//! Colors that may vary over a surface.

use std::io::{Cursor, ErrorKind};
use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::text::read;
use crate::SurfaceInteraction;
use crate::exr_io::kind_of;

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
            Self::Constant(color) => *color,
            Self::Bitmap(bitmap) => bitmap.lookup(uv),
        }
    }

    /// The largest value of each component anywhere.
    pub fn max(&self) -> Vec3 {
        match self {
            Self::Constant(color) => *color,
            Self::Bitmap(bitmap) => bitmap.max,
        }
    }

    /// The mean color: what realtime uses in the texture's place.
    pub fn average(&self) -> Vec3 {
        match self {
            Self::Constant(color) => *color,
            Self::Bitmap(bitmap) => bitmap.average,
        }
    }

    /// Loads a bitmap (PNG, JPEG, TGA or BMP). Its 8-bit values are decoded from sRGB.
    pub(super) fn load(path: &Path, mapping: Mapping) -> Result<Self, String> {
        let file = path.display();
        let bytes =
            read(path).map_err(|error| format!("cannot read the texture {file}: {error}"))?;
        let cannot = |why: String| format!("cannot decode the texture {file}: {why}");
        // The name tells a TGA file, which has no other mark.
        let guess = image::guess_format(&bytes).ok();
        let format = guess.or_else(|| image::ImageFormat::from_path(path).ok());
        let Some(format) = format.filter(|format| FORMATS.contains(format)) else {
            return Err(cannot(format!("expected {EXPECTED}, found {}", found(&bytes, guess))));
        };
        let is_marked = guess.is_some() || format == image::ImageFormat::Tga;
        if !is_marked {
            return Err(cannot(format!("expected {EXPECTED}, found {}", found(&bytes, None))));
        }
        // The decoder makes up what is missing.
        if format == image::ImageFormat::Jpeg && !has_end(&bytes) {
            return Err(cannot(ends_early("JPG")));
        }
        let mut reader = image::ImageReader::with_format(Cursor::new(&bytes), format);
        let mut limits = image::Limits::default();
        limits.max_image_width = Some(MAX_SIDE);
        limits.max_image_height = Some(MAX_SIDE);
        reader.limits(limits);
        let picture =
            reader.decode().map_err(|error| cannot(why_not_decoded(&error, &bytes, format)))?;
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

/// What is read.
const FORMATS: [image::ImageFormat; 4] = [
    image::ImageFormat::Png,
    image::ImageFormat::Jpeg,
    image::ImageFormat::Tga,
    image::ImageFormat::Bmp,
];
const EXPECTED: &str = "PNG, JPEG, TGA or BMP";

/// What a file is that is no texture: by its format, or by what it begins with.
fn found(bytes: &[u8], format: Option<image::ImageFormat>) -> String {
    if bytes.is_empty() {
        return "an empty file".to_owned();
    }
    match (format, kind_of(bytes)) {
        (Some(format), _) => format
            .extensions_str()
            .first()
            .map_or("something else".into(), |end| end.to_uppercase()),
        (None, Some(kind)) => format!("a file that begins as {kind}"),
        (None, None) => "something else".to_owned(),
    }
}

/// Whether the last scan of a JPEG has an end: the marker SOS (0xFFDA) with EOI (0xFFD9) somewhere behind it.
fn has_end(jpeg: &[u8]) -> bool {
    let last = |marker| jpeg.windows(2).rposition(|bytes| bytes == [0xff, marker]);
    last(0xda).is_some_and(|scan| last(0xd9).is_some_and(|end| end > scan))
}

fn ends_early(name: &str) -> String {
    format!("the {name} ends early; was it cut off?")
}

/// Why a decoder gave up, in words: the crates' own messages hold their types.
fn why_not_decoded(error: &image::ImageError, bytes: &[u8], format: image::ImageFormat) -> String {
    let name = found(&[0], Some(format));
    match error {
        image::ImageError::Limits(_) => {
            let reader = image::ImageReader::with_format(Cursor::new(bytes), format);
            let size = reader
                .into_dimensions()
                .map_or(String::new(), |(width, height)| format!("it is {width}x{height}, "));
            format!("{size}expected at most {MAX_SIDE} texels a side")
        }
        image::ImageError::Unsupported(_) => format!("this kind of {name} is not supported"),
        _ if bytes.get(12..16) == Some(b"CgBI") => {
            "it is a PNG as Xcode rewrites it for iOS, which others cannot read; save it anew"
                .to_owned()
        }
        image::ImageError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof => {
            ends_early(&name)
        }
        other => {
            let said = other.to_string();
            let said = said.rsplit(": ").next().unwrap_or_default().trim_end_matches('.');
            // As the decoder of JPEG has it.
            if said.starts_with("I/O errors") || said.contains("Not enough bytes") {
                return ends_early(&name);
            }
            let is_code = said.is_empty() || said.contains(['{', '}', '(', ')', '"', '`']);
            if is_code || said.contains("::") || said.starts_with("Format error") {
                format!("the {name} is damaged")
            } else {
                format!("the {name} is damaged: {said}")
            }
        }
    }
}

impl From<Vec3> for Texture {
    fn from(color: Vec3) -> Self {
        Self::Constant(color)
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

    #[test]
    fn a_texture_that_is_not_read_says_why_in_words() {
        let folder = std::env::temp_dir().join(format!("basecode-texture-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let encoded = |width, height, format| {
            let mut bytes = Cursor::new(Vec::new());
            image::RgbImage::new(width, height).write_to(&mut bytes, format).unwrap();
            bytes.into_inner()
        };
        let png = encoded(2, 2, image::ImageFormat::Png);
        let jpg = encoded(64, 64, image::ImageFormat::Jpeg);
        let mut xcode = png.clone();
        xcode.splice(8..8, *b"\0\0\0\x04CgBI\x50\0\x20\x02\x2b\xd5\xb3\x7f");
        let mut broken = png.clone();
        broken[29] ^= 0xff;
        let bmp = encoded(2, 2, image::ImageFormat::Bmp);
        let git_lfs = b"version https://git-lfs.github.com/spec/v1\n".to_vec();
        for (name, bytes, expected) in [
            ("t.png", xcode, "a PNG as Xcode rewrites it for iOS"),
            ("t.png", png[..40].to_vec(), "the PNG"),
            ("t.png", broken, "the PNG is damaged"),
            (
                "t.png",
                encoded(9000, 1, image::ImageFormat::Png),
                "it is 9000x1, expected at most 8192",
            ),
            ("t.png", git_lfs.clone(), "found a file that begins as the pointer does that Git LFS"),
            ("t.jpg", git_lfs, "found a file that begins as the pointer does that Git LFS"),
            ("t.png", b"<!DOCTYPE html>".to_vec(), "begins as a web page does"),
            ("t.bmp", bmp[..20].to_vec(), "the BMP"),
            ("t.tga", b"\0\0\x02".to_vec(), "the TGA ends early"),
            ("t.png", Vec::new(), "found an empty file"),
            ("t.png", b"abc".to_vec(), "found something else"),
            ("t.jpg", jpg[..30].to_vec(), "the JPG ends early"),
            ("t.jpg", jpg[..jpg.len() / 2].to_vec(), "the JPG ends early"),
            ("t.jpg", jpg[..jpg.len() - 2].to_vec(), "the JPG ends early"),
            ("t.webp", b"RIFF\0\0\0\0WEBPVP8 ".to_vec(), "found WEBP"),
        ] {
            let path = folder.join(name);
            std::fs::write(&path, bytes).unwrap();
            let said = Texture::load(&path, Mapping::default()).unwrap_err();
            assert!(said.contains(expected), "{expected}: {said}");
            let why = said.split_once(&format!("{}: ", path.display())).expect(&said).1;
            assert!(!why.contains(['{', '}', '"']) && !why.contains("::"), "{said}");
        }
        // Cameras write more behind the end.
        let path = folder.join("t.jpg");
        std::fs::write(&path, [jpg, vec![0; 9]].concat()).unwrap();
        Texture::load(&path, Mapping::default()).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
