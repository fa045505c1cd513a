//! Mistakes between the pixels and the image.

use basecode::{Film, Vec3};

use super::{Mistake as M, Mistakes};

/// Spoils an image that was rendered right.
pub fn spoil(mistakes: &Mistakes, film: &mut Film) {
    let (width, height) = (film.width(), film.height());
    let pixels = film.pixels_mut();
    if mistakes.has(M::FlippedRows) || mistakes.has(M::Rotated) {
        let original = pixels.to_vec();
        for (row, from) in pixels.chunks_mut(width).zip(original.chunks(width).rev()) {
            row.copy_from_slice(from);
        }
    }
    if mistakes.has(M::MirroredColumns) || mistakes.has(M::Rotated) {
        pixels.chunks_mut(width).for_each(<[Vec3]>::reverse);
    }
    if mistakes.has(M::Transposed) {
        let original = pixels.to_vec();
        for (index, pixel) in original.into_iter().enumerate() {
            pixels[(index % width) * height + index / width] = pixel;
        }
    }
    for pixel in pixels.iter_mut() {
        *pixel = value(mistakes, *pixel);
    }
    if mistakes.has(M::LastPixelMissing)
        && let Some(last) = pixels.last_mut()
    {
        *last = Vec3::NAN;
    }
    if mistakes.has(M::DebugMark) {
        for index in [0, 1, width, width + 1] {
            pixels[index] *= 1.1;
        }
    }
    if mistakes.has(M::Dithered) {
        const HALF_LEVEL: f32 = 0.5 / 65535.0;
        for (index, pixel) in pixels.iter_mut().enumerate() {
            *pixel += if index % 2 == 0 { HALF_LEVEL } else { -HALF_LEVEL };
        }
    }
}

/// What becomes of a pixel, wherever it lies.
fn value(mistakes: &Mistakes, mut pixel: Vec3) -> Vec3 {
    let has = |mistake| mistakes.has(mistake);
    if has(M::Clamped) || has(M::EightBit) || has(M::Srgb) {
        pixel = pixel.clamp(Vec3::ZERO, Vec3::ONE);
    }
    if has(M::Gamma) {
        pixel = pixel.powf(1.0 / 2.2);
    }
    if has(M::GammaDecoded) {
        pixel = pixel.powf(2.2);
    }
    if has(M::Srgb) {
        let curve = |x: f32| {
            if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
        };
        pixel = pixel.to_array().map(curve).into();
    }
    if has(M::EightBit) {
        pixel = (255.0 * pixel).round() / 255.0;
    }
    if has(M::Times255) {
        pixel *= 255.0;
    }
    if has(M::ToneMapped) {
        pixel /= Vec3::ONE + pixel;
    }
    if has(M::FilmChannelsSwapped) { super::bsdfs::blue_first(pixel) } else { pixel }
}
