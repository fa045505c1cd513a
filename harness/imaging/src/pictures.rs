//! Pictures that explain: a render as a display shows it, its error in colors, an enlarged detail.
//!
//! A picture says in its caption what its colors mean. Values that are not finite are magenta everywhere.

use std::io::Cursor;

use basecode::image::Image;
use glam::Vec3;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use thiserror::Error;

use super::comparison::FailingArea;
use super::reference::RegionMask;
use super::srgb;

/// What is not a number.
const MAGENTA: [u8; 3] = [255, 0, 255];
/// What is not compared.
const GRAY: [u8; 3] = [128, 128, 128];
/// The median lit value of the expected image comes to this linear value before tone mapping.
const MIDDLE: f32 = 0.25;
/// This linear value becomes white.
const WHITE: f32 = 8.0;
/// Errors are relative to the expected value, but to no less than this fraction of the median lit value.
pub(super) const DARKEST: f32 = 0.05;
/// The largest side of an enlarged detail in pixels.
const DETAIL_SIDE: usize = 384;

/// An 8-bit sRGB picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Row by row, row 0 on top.
    pub pixels: Vec<[u8; 3]>,
    /// What the colors mean, with numbers.
    pub caption: String,
}

/// A picture that no PNG can hold, such as an empty one.
#[derive(Debug, Error)]
#[error("picture of {width}x{height} cannot be written as PNG: {reason}")]
pub struct PictureError {
    width: usize,
    height: usize,
    reason: String,
}

impl Picture {
    /// The bytes of a PNG file.
    ///
    /// # Errors
    /// When the picture is empty or too large for the format.
    pub fn png(&self) -> Result<Vec<u8>, PictureError> {
        let fail = |reason: String| PictureError { width: self.width, height: self.height, reason };
        if self.pixels.is_empty() {
            return Err(fail("it is empty".into()));
        }
        let side = |n: usize| u32::try_from(n).map_err(|e| fail(e.to_string()));
        let mut file = Cursor::new(Vec::new());
        PngEncoder::new(&mut file)
            .write_image(
                self.pixels.as_flattened(),
                side(self.width)?,
                side(self.height)?,
                ExtendedColorType::Rgb8,
            )
            .map_err(|e| fail(e.to_string()))?;
        Ok(file.into_inner())
    }

    /// The surroundings of an area, every pixel a square: a third more on each side, at least 12 pixels a side, as
    /// large as fits in 384 pixels, cut at the picture's borders.
    pub fn detail(&self, area: &FailingArea) -> Self {
        let (left, right) = surroundings(area.x, area.width, self.width);
        let (top, bottom) = surroundings(area.y, area.height, self.height);
        let (width, height) = (right - left, bottom - top);
        let zoom = (DETAIL_SIDE / width.max(height).max(1)).max(1);
        let mut pixels = Vec::with_capacity(width * height * zoom * zoom);
        for y in 0..height * zoom {
            let row = &self.pixels[(top + y / zoom) * self.width..];
            pixels.extend((0..width * zoom).map(|x| row[left + x / zoom]));
        }
        Self {
            width: width * zoom,
            height: height * zoom,
            pixels,
            caption: format!(
                "{}; {zoom} times enlarged, columns {left} to {}, rows {top} to {}",
                self.caption,
                right.max(1) - 1,
                bottom.max(1) - 1
            ),
        }
    }
}

/// The range of an axis that shows an area of `size` at `start`, within 0..limit.
fn surroundings(start: usize, size: usize, limit: usize) -> (usize, usize) {
    let (start, end) = (start.min(limit), (start + size).min(limit));
    let margin = (size / 3).max(12usize.saturating_sub(size).div_ceil(2));
    (start.saturating_sub(margin), (end + margin).min(limit))
}

/// A picture of a render: exposed so that `median_lit` (the expected image's) comes to a middle gray, highlights
/// compressed by Reinhard's curve (Reinhard et al. 2002, equation 4), encoded as sRGB. Negative values are black.
///
/// Use one `median_lit` for all pictures of a scene: a render that is too dark must look so.
pub fn tone_mapped(image: &Image, median_lit: f32) -> Picture {
    let gain = MIDDLE / median_lit.max(f32::MIN_POSITIVE);
    let show = |p: &Vec3| {
        if !p.is_finite() {
            return MAGENTA;
        }
        let curve = |x: f32| {
            let x = (gain * x).clamp(0.0, WHITE);
            srgb::level(x * (1.0 + x / (WHITE * WHITE)) / (1.0 + x))
        };
        p.to_array().map(curve)
    };
    let pixels = image.pixels.iter().map(show).collect();
    Picture {
        width: image.width,
        height: image.height,
        pixels,
        caption: format!(
            "exposure {:+.1} stops, Reinhard curve, white at {:.3}",
            gain.log2(),
            WHITE / gain
        ),
    }
}

/// A picture of a render without exposure or curve: linear values clamped to [0, 1] and encoded as
/// sRGB, as the original course shows images.
pub fn clamped(image: &Image) -> Picture {
    let show = |p: &Vec3| match p.is_finite() {
        true => p.to_array().map(|x| srgb::level(x.clamp(0.0, 1.0))),
        false => MAGENTA,
    };
    Picture {
        width: image.width,
        height: image.height,
        pixels: image.pixels.iter().map(show).collect(),
        caption: "8-bit sRGB, linear values clamped to [0, 1]; not finite is magenta".into(),
    }
}

/// Stops of a diverging map whose lightness falls evenly to both sides (ColorBrewer's RdBu with 5 classes).
const DIVERGING: [[u8; 3]; 5] =
    [[5, 113, 176], [146, 197, 222], [247, 247, 247], [244, 165, 130], [202, 0, 32]];

/// The color of a value in -1 (blue) to 1 (red).
fn diverging(value: f32) -> [u8; 3] {
    let position = (value.clamp(-1.0, 1.0) + 1.0) * 2.0;
    let below = (position as usize).min(3);
    mix(DIVERGING[below], DIVERGING[below + 1], position - below as f32)
}

fn mix(a: [u8; 3], b: [u8; 3], t: f32) -> [u8; 3] {
    [0, 1, 2].map(|c| (f32::from(a[c]) + t * (f32::from(b[c]) - f32::from(a[c]))).round() as u8)
}

/// The signed relative error, mean of the channels: blue where the actual image is darker than expected, red where it
/// is brighter, full color at +-`full_scale` (0.1 is 10 %). Emitters are gray, edges, which are judged leniently,
/// half gray. `None` when the sizes differ.
pub fn signed_error(
    actual: &Image,
    expected: &Image,
    mask: &RegionMask,
    median_lit: f32,
    full_scale: f32,
) -> Option<Picture> {
    let size = (expected.width, expected.height);
    if (actual.width, actual.height) != size || (mask.width, mask.height) != size {
        return None;
    }
    let darkest = (DARKEST * median_lit).max(f32::MIN_POSITIVE);
    let color = |((a, b), flags): ((&Vec3, &Vec3), &u16)| {
        if flags & RegionMask::EMITTER != 0 {
            return GRAY;
        }
        if !a.is_finite() {
            return MAGENTA;
        }
        let (a, b) = (a.element_sum() / 3.0, b.element_sum() / 3.0);
        let color = diverging((a - b) / b.max(darkest) / full_scale);
        if flags & RegionMask::EDGE != 0 { mix(color, GRAY, 0.5) } else { color }
    };
    let pixels = actual.pixels.iter().zip(&expected.pixels).zip(&mask.pixels).map(color).collect();
    Some(Picture {
        width: size.0,
        height: size.1,
        pixels,
        caption: format!(
            "relative error: blue {0} % darker or more, white equal, red {0} % brighter or more; \
             edges half grey, emitters grey, not a number magenta",
            (1e4 * full_scale).round() / 100.0
        ),
    })
}

/// The relative error that a difference picture should show in full color: of the steps 1, 2, 5 the first that all but
/// one in a hundred compared pixels stay below, from 1 % to 500 %.
pub fn full_scale(actual: &Image, expected: &Image, mask: &RegionMask, median_lit: f32) -> f32 {
    const STEPS: [f32; 9] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0];
    let darkest = (DARKEST * median_lit).max(f32::MIN_POSITIVE);
    let pixels = actual.pixels.iter().zip(&expected.pixels).zip(&mask.pixels);
    let compared = pixels.filter(|((a, _), flags)| {
        *flags & (RegionMask::EDGE | RegionMask::EMITTER) == 0 && a.is_finite()
    });
    let mut sizes: Vec<f32> = compared
        .map(|((a, b), _)| {
            (a.element_sum() - b.element_sum()).abs() / 3.0 / (b.element_sum() / 3.0).max(darkest)
        })
        .collect();
    if sizes.is_empty() {
        return STEPS[3];
    }
    let most = sizes.len() * 99 / 100;
    let (_, &mut size, _) = sizes.select_nth_unstable_by(most, f32::total_cmp);
    STEPS.into_iter().find(|&step| step >= size).unwrap_or(STEPS[8])
}

/// Width and height of a ray's square in its map, in pixels.
const RAY_SIDE: usize = 6;
/// Lit, though it should be in shadow; and the other way round (Okabe and Ito 2008: told apart by the color-blind).
const RAY_COLORS: [[u8; 3]; 2] = [[230, 159, 0], [86, 180, 233]];

/// A film without shadows in gray, and on it the rays that were judged wrongly: the pixel of each, and whether it
/// should be lit.
pub fn ray_map(film: &Image, rays: &[(usize, bool)], median_lit: f32) -> Picture {
    let mut small = tone_mapped(film, median_lit);
    for pixel in &mut small.pixels {
        let gray = pixel.iter().map(|&level| u16::from(level)).sum::<u16>() / 6;
        *pixel = [gray as u8; 3];
    }
    for &(index, should_be_lit) in rays {
        if let Some(pixel) = small.pixels.get_mut(index) {
            *pixel = RAY_COLORS[usize::from(should_be_lit)];
        }
    }
    let (width, height) = (small.width * RAY_SIDE, small.height * RAY_SIDE);
    let at = |index: usize| {
        small.pixels[index / width / RAY_SIDE * small.width + index % width / RAY_SIDE]
    };
    Picture {
        width,
        height,
        pixels: (0..width * height).map(at).collect(),
        caption: "orange: lit, but should be in shadow; blue: dark, but should be lit".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::vec3;

    fn row(pixels: &[Vec3]) -> Image {
        Image { width: pixels.len(), height: 1, pixels: pixels.to_vec() }
    }

    #[test]
    fn tones() {
        let image = row(&[
            Vec3::ZERO,
            Vec3::splat(-3.0),
            vec3(0.1, 3.2, 100.0),
            vec3(0.0, f32::NAN, 0.0),
            Vec3::INFINITY,
        ]);
        let picture = tone_mapped(&image, 0.1);
        // 0.25 becomes 0.25 (1 + 0.25/64) / 1.25 = 0.20078, sRGB level 124; white is 8 / 2.5 = 3.2.
        let expected = [[0; 3], [0; 3], [124, 255, 255], MAGENTA, MAGENTA];
        assert_eq!(picture.pixels, expected);
        assert_eq!(picture.caption, "exposure +1.3 stops, Reinhard curve, white at 3.200");
    }

    #[test]
    fn clamped_values_are_srgb() {
        let image = row(&[vec3(-1.0, 0.0, 0.5), vec3(1.0, 7.0, 0.216), Vec3::INFINITY]);
        // 0.5 is level 187.5 of 255 (IEC 61966-2-1), 0.216 is level 128.0.
        assert_eq!(clamped(&image).pixels, [[0, 0, 188], [255, 255, 128], MAGENTA]);
    }

    #[test]
    fn errors_have_their_colors() {
        let expected = row(&[Vec3::ONE; 8]);
        let mut actual = expected.clone();
        let mut mask = RegionMask::background(8, 1);
        for (i, factor) in [1.0, 1.1, 0.9, 1.05, 5.0].into_iter().enumerate() {
            actual.pixels[i] *= factor;
        }
        actual.pixels[5].z = f32::NAN;
        (actual.pixels[6], mask.pixels[6]) = (Vec3::NAN, RegionMask::EMITTER);
        mask.pixels[7] = RegionMask::EDGE;
        let picture = signed_error(&actual, &expected, &mask, 1.0, 0.1).unwrap();
        let [blue, _, white, pink, red] = DIVERGING;
        let half = [188; 3];
        assert_eq!(picture.pixels, [white, red, blue, pink, red, MAGENTA, GRAY, half]);
        assert!(picture.caption.contains("blue 10 % darker"), "{}", picture.caption);

        // Where black is expected, errors are relative to a twentieth of the scene's median.
        let dark = signed_error(
            &row(&[Vec3::splat(0.005)]),
            &row(&[Vec3::ZERO]),
            &RegionMask::background(1, 1),
            1.0,
            0.1,
        );
        assert_eq!(dark.unwrap().pixels, [red]);
        assert_eq!(signed_error(&actual, &row(&[Vec3::ONE]), &mask, 1.0, 0.1), None);
    }

    #[test]
    fn the_scale_holds_almost_all_differences() {
        let expected = Image { width: 200, height: 1, pixels: vec![Vec3::ONE; 200] };
        let mask = RegionMask::background(200, 1);
        let of = |size: f32| {
            let mut actual = expected.clone();
            actual.pixels.fill(Vec3::splat(1.0 + size));
            actual.pixels[7] = Vec3::splat(1e9);
            actual.pixels[8] = Vec3::NAN;
            full_scale(&actual, &expected, &mask, 1.0)
        };
        assert_eq!([0.0, 0.015, 0.3, 77.0].map(of), [0.01, 0.02, 0.5, 5.0]);
    }

    #[test]
    fn wrong_rays_stand_out_from_the_film() {
        let film = Image { width: 3, height: 1, pixels: vec![Vec3::ONE; 3] };
        let map = ray_map(&film, &[(0, false), (2, true), (99, true)], 1.0);
        assert_eq!((map.width, map.height), (18, 6));
        assert_eq!([map.pixels[0], map.pixels[18 * 6 - 1]], RAY_COLORS);
        let [r, g, b] = map.pixels[8];
        assert!(r == g && g == b);
    }

    #[test]
    fn png_comes_back() {
        let image = row(&[Vec3::ZERO, vec3(1.0, 0.5, 0.25), Vec3::splat(9.0)]);
        let picture = tone_mapped(&image, 0.3);
        let back = image::load_from_memory(&picture.png().unwrap()).unwrap().into_rgb8();
        assert_eq!(back.dimensions(), (3, 1));
        assert_eq!(back.into_raw(), picture.pixels.as_flattened());
        let error = tone_mapped(&Image::new(0, 0), 1.0).png().unwrap_err().to_string();
        assert_eq!(error, "picture of 0x0 cannot be written as PNG: it is empty");
    }

    #[test]
    fn details_are_enlarged_and_stay_inside() {
        let (width, height) = (40, 30);
        let pixels =
            (0..width * height).map(|i| [(i % width) as u8, (i / width) as u8, 0]).collect();
        let picture = Picture { width, height, pixels, caption: "x".into() };
        let area = |x, y, width, height| FailingArea { x, y, width, height, pixels: 1 };

        let detail = picture.detail(&area(20, 10, 2, 2));
        assert_eq!((detail.width, detail.height), (12 * 32, 12 * 32));
        assert_eq!(detail.pixels[0], [15, 5, 0]);
        assert_eq!(detail.pixels[31], [15, 5, 0]);
        assert_eq!(detail.pixels[32], [16, 5, 0]);
        assert_eq!(detail.pixels.last(), Some(&[26, 16, 0]));
        assert_eq!(detail.caption, "x; 32 times enlarged, columns 15 to 26, rows 5 to 16");

        let corner = picture.detail(&area(0, 29, 1, 1));
        assert_eq!((corner.width, corner.height), (7 * 54, 7 * 54));
        assert_eq!(corner.pixels[0], [0, 23, 0]);
        let all = picture.detail(&area(0, 0, 40, 30));
        assert_eq!((all.width, all.height), (360, 270));
        assert!(picture.detail(&area(100, 100, 5, 5)).png().is_ok());
    }
}
