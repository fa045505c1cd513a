//! The comparison that decides: is this image what a correct renderer draws?
//!
//! Rules in this order (`docs/evidence.md`, "Images"): size; non-finite; negative; differing interior pixels; no
//! failing 2x2 block in the interior; differing pixels of the edge mask, as a fraction of the mask; signed bias of
//! every region, its highlight apart. Pixels that show an emitter never count. One pass over the pixels serves all
//! rules.

use basecode::image::Image;
use glam::Vec3;

use super::comparison::{CompareError, ComparedWith, ImageEvidence};
use super::reference::{ReferenceImage, RegionMask, check_mask};
use super::srgb;
use super::stats::{Scale, accumulate};
use super::tolerances::Tolerances;

/// Judges an offline render with `spp` jittered samples per pixel, any seed.
///
/// With several samples z = |a - b| / sqrt(v/n + v/N + floor^2) must not exceed `z_limit`, v being the reference's
/// variance of one sample, dilated 3x3 (the largest of the nine). At 1 spp samples are at pixel centers and the image
/// is compared with the pixel-center reference, the floor alone allowing for rounding.
///
/// # Errors
/// When the sizes differ or `spp` is 0.
pub fn compare_offline(
    actual: &Image,
    reference: &ReferenceImage,
    spp: u32,
    tolerances: &Tolerances,
) -> Result<ImageEvidence, CompareError> {
    offline(actual, reference, spp, tolerances, None)
}

/// [`compare_offline`]; `excess` takes what each pixel's difference is over the allowed one, above 1 it fails.
///
/// # Errors
/// When the images differ in size, or `spp` is 0.
pub fn offline(
    actual: &Image,
    reference: &ReferenceImage,
    spp: u32,
    tolerances: &Tolerances,
    excess: Option<&mut Vec<f32>>,
) -> Result<ImageEvidence, CompareError> {
    check_size(actual, &reference.mean)?;
    let (expected, with, samples) = match spp {
        0 => return Err(CompareError::NoSamples),
        1 => (&reference.center, ComparedWith::Center, None),
        n => (&reference.mean, ComparedWith::Mean, Some(1.0 / n as f32 + 1.0 / reference.n as f32)),
    };
    let floor = (tolerances.floor_of_median * f64::from(reference.median_lit)) as f32;
    let relative = tolerances.floor_relative as f32;
    let limit2 = tolerances.z_limit.powi(2) as f32;
    let width = reference.mean.width;
    let mut tallest = vec![Vec3::ZERO; width];

    let stats = accumulate(actual, expected, &reference.mask, tolerances, excess, |y, row| {
        if let Some(inverse) = samples {
            let own = &reference.variance.pixels[y * width..][..width];
            for (out, v) in row.variance.iter_mut().zip(own) {
                *out = *v * inverse;
            }
            highest_of_rows(&reference.variance, y, &mut tallest);
        }
        for x in 0..width {
            let v = match samples {
                Some(inverse) => {
                    let near = tallest[x.saturating_sub(1)].max(tallest[(x + 1).min(width - 1)]);
                    near.max(tallest[x]) * inverse
                }
                None => Vec3::ZERO,
            };
            let floor = Vec3::splat(floor) + relative * row.expected[x];
            let d = row.actual[x] - row.expected[x];
            row.excess2[x] = (d * d / (limit2 * (v + floor * floor))).max_element();
        }
    });
    let scale =
        Scale { median_lit: reference.median_lit, interior_fraction: tolerances.interior_fraction };
    Ok(stats.judge(&reference.mask, with, &scale, tolerances))
}

/// Judges a realtime frame drawn from code, as unclamped linear floats, against the pixel-center reference.
///
/// In the interior |a - b| <= (relative + per_exponent n) b + snap (dx + dy) + floor, n being the region's Phong
/// exponent, dx and dy the larger of the differences to the two neighbors in b's row and column.
///
/// # Errors
/// When the sizes differ, or the mask does not fit the reference.
pub fn compare_realtime_linear(
    actual: &Image,
    center: &Image,
    mask: &RegionMask,
    tolerances: &Tolerances,
) -> Result<ImageEvidence, CompareError> {
    realtime_linear(actual, center, mask, tolerances, None)
}

/// [`compare_realtime_linear`]; `excess` takes what each pixel's difference is over the allowed one, above 1 it fails.
///
/// # Errors
/// When the images differ in size, or the mask does not fit them.
pub fn realtime_linear(
    actual: &Image,
    center: &Image,
    mask: &RegionMask,
    tolerances: &Tolerances,
    excess: Option<&mut Vec<f32>>,
) -> Result<ImageEvidence, CompareError> {
    let (width, scale) = realtime_scale(actual, center, mask, tolerances.interior_fraction)?;
    let floor = Vec3::splat((tolerances.floor_of_median * f64::from(scale.median_lit)) as f32);
    let relative: Vec<f32> = mask
        .regions
        .iter()
        .map(|r| {
            tolerances.realtime_relative + tolerances.realtime_per_exponent * f64::from(r.exponent)
        })
        .map(|r| r as f32)
        .collect();
    let snap = tolerances.realtime_snap_px as f32;
    let stats = accumulate(actual, center, mask, tolerances, excess, |y, row| {
        let other = |y: usize| &center.pixels[y * width..][..width];
        let (above, below) = (other(y.saturating_sub(1)), other((y + 1).min(center.height - 1)));
        for x in 0..width {
            let relative = relative[usize::from(row.mask[x] & RegionMask::INDEX)];
            let b = row.expected[x];
            let to = |neighbor: Vec3| (neighbor - b).abs();
            let dx =
                to(row.expected[x.saturating_sub(1)]).max(to(row.expected[(x + 1).min(width - 1)]));
            let dy = to(above[x]).max(to(below[x]));
            let allowed = relative * b.abs() + snap * (dx + dy) + floor;
            row.excess2[x] = ((row.actual[x] - b).abs() / allowed).max_element().powi(2);
        }
    });
    Ok(stats.judge(mask, ComparedWith::Center, &scale, tolerances))
}

/// Judges a realtime image that was submitted as EXR: both images clamped to [0, 1] and rounded to 8-bit sRGB levels,
/// as the original course stored them; an unclamped linear image is as good.
///
/// Biases are those of the clamped images.
///
/// # Errors
/// When the sizes differ, or the mask does not fit the reference.
pub fn compare_srgb8(
    actual: &Image,
    center: &Image,
    mask: &RegionMask,
    tolerances: &Tolerances,
) -> Result<ImageEvidence, CompareError> {
    srgb8(actual, center, mask, tolerances, None)
}

/// [`compare_srgb8`]; `excess` takes what each pixel's difference is over the allowed one, above 1 it fails.
///
/// # Errors
/// When the images differ in size, or the mask does not fit them.
pub fn srgb8(
    actual: &Image,
    center: &Image,
    mask: &RegionMask,
    tolerances: &Tolerances,
    excess: Option<&mut Vec<f32>>,
) -> Result<ImageEvidence, CompareError> {
    let (width, scale) = realtime_scale(actual, center, mask, tolerances.srgb_fraction)?;
    // A pixel fails from `srgb_levels` on, so the allowed difference lies half a level below.
    let allowed = tolerances.srgb_levels as f32 - 0.5;
    let mut stats = accumulate(actual, center, mask, tolerances, excess, |_, row| {
        for x in 0..width {
            let apart = srgb::levels_apart(row.actual[x], row.expected[x]);
            row.excess2[x] = (apart as f32 / allowed).powi(2);
        }
    });
    // Rounding to levels and clamping move a region's mean; the levels have judged it already.
    stats.regions.clear();
    Ok(stats.judge(mask, ComparedWith::CenterSrgb8, &scale, tolerances))
}

fn check_size(actual: &Image, expected: &Image) -> Result<(), CompareError> {
    let found = (actual.width, actual.height);
    let wanted = (expected.width, expected.height);
    if found != wanted || actual.pixels.len() != expected.pixels.len() {
        return Err(CompareError::Size { actual: found, expected: wanted });
    }
    Ok(())
}

fn realtime_scale(
    actual: &Image,
    center: &Image,
    mask: &RegionMask,
    interior_fraction: f64,
) -> Result<(usize, Scale), CompareError> {
    check_size(actual, center)?;
    let median_lit =
        check_mask(mask, center).map_err(|e| CompareError::Reference(e.to_string()))?;
    Ok((center.width, Scale { median_lit, interior_fraction }))
}

/// Per column the largest variance of rows y - 1 to y + 1.
fn highest_of_rows(variance: &Image, y: usize, out: &mut [Vec3]) {
    let row = |y: usize| &variance.pixels[y * variance.width..][..variance.width];
    let (above, below) = (row(y.saturating_sub(1)), row((y + 1).min(variance.height - 1)));
    for (((out, a), b), c) in out.iter_mut().zip(above).zip(row(y)).zip(below) {
        *out = a.max(*b).max(*c);
    }
}
