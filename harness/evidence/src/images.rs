//! Compares whole images with the expected ones, over all regions or some of them.

use basecode::Image;

use super::price::Price;
use super::{Check, CheckId, Measure, RuleId, Verdict, film_slips};
use crate::expected::Expected;
use imaging::compare::{
    compare_offline, compare_realtime_linear, compare_srgb8, offline, realtime_linear, srgb8,
};
use imaging::comparison::{CompareError, ImageEvidence};
use imaging::correlation::Moments;
use imaging::origin::{same_draws, same_levels};
use imaging::ratio::{RegionRatio, region_ratios};
use imaging::reference::{Region, RegionMask};
use imaging::tolerances::Tolerances;

/// How an image came about, which decides how it is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageKind {
    /// Rendered offline with shadows at this many samples per pixel.
    Offline {
        /// Samples per pixel.
        spp: u32,
    },
    /// Drawn by code: linear floats, without shadows.
    Realtime,
    /// Drawn by code: linear floats, with shadows (the bonus).
    RealtimeShadows,
    /// Submitted as a realtime image: 8-bit levels or linear floats, without shadows.
    SubmittedRealtime,
    /// Submitted as the bonus: 8-bit levels or linear floats, with shadows.
    SubmittedShadows,
}

/// What an image of a kind is compared with, and its regions.
pub fn reference_of(kind: ImageKind, expected: &Expected) -> (&Image, &RegionMask) {
    match kind {
        ImageKind::Offline { spp: 1 }
        | ImageKind::RealtimeShadows
        | ImageKind::SubmittedShadows => (&expected.offline.center, &expected.offline.mask),
        ImageKind::Offline { .. } => (&expected.offline.mean, &expected.offline.mask),
        ImageKind::Realtime | ImageKind::SubmittedRealtime => {
            (&expected.unshadowed, &expected.unshadowed_mask)
        }
    }
}

/// Compares all of an image, for whoever looks at single pixels: the second is each one's difference over the largest
/// that is allowed there.
///
/// # Errors
/// When the sizes differ.
pub fn compare_pixels(
    kind: ImageKind,
    actual: &Image,
    expected: &Expected,
    tolerances: &Tolerances,
) -> Result<(ImageEvidence, Vec<f32>), CompareError> {
    let (reference, mask) = reference_of(kind, expected);
    let mut excess = Vec::with_capacity(mask.pixels.len());
    let kept = Some(&mut excess);
    let evidence = match kind {
        ImageKind::Offline { spp } => offline(actual, &expected.offline, spp, tolerances, kept),
        ImageKind::Realtime | ImageKind::RealtimeShadows => {
            realtime_linear(actual, reference, mask, tolerances, kept)
        }
        ImageKind::SubmittedRealtime | ImageKind::SubmittedShadows => {
            srgb8(actual, reference, mask, tolerances, kept)
        }
    };
    Ok((evidence?, excess))
}

/// Judges `actual`; regions for which `wanted` is false are left out.
pub fn judge(
    id: CheckId,
    scene: &str,
    kind: ImageKind,
    actual: &Image,
    expected: &Expected,
    wanted: &dyn Fn(&Region) -> bool,
    tolerances: &Tolerances,
) -> Check {
    let (reference, mask) = reference_of(kind, expected);
    let mask = only(mask, wanted);
    if !mask.pixels.iter().any(|value| value & (RegionMask::EDGE | RegionMask::EMITTER) == 0) {
        let summary = "no pixel away from edges shows what this is about";
        return Check::new(id, scene, Verdict::NotJudged, summary);
    }
    let compared = match kind {
        ImageKind::Offline { spp } => {
            let reference = imaging::reference::ReferenceImage {
                mask: mask.clone(),
                ..expected.offline.clone()
            };
            compare_offline(actual, &reference, spp, tolerances)
        }
        ImageKind::Realtime => {
            let raw = expected.interpolated_normals.as_ref();
            return judge_shaded(id, scene, actual, (reference, raw), &mask, tolerances);
        }
        ImageKind::RealtimeShadows => {
            return judge_realtime(id, scene, actual, reference, &mask, tolerances);
        }
        ImageKind::SubmittedRealtime | ImageKind::SubmittedShadows => {
            compare_srgb8(actual, reference, &mask, tolerances)
        }
    };
    match compared {
        Ok(found) => describe(id, scene, &found, actual, reference, &mask),
        Err(error @ CompareError::Size { .. }) => {
            let measures = vec![Measure::at_most(RuleId::ImageSize, error.to_string(), 1.0, 0.0)];
            Check { measures, ..Check::new(id, scene, Verdict::Fail, error.to_string()) }
        }
        Err(error) => Check::new(id, scene, Verdict::NotJudged, error.to_string()),
    }
}

/// The price of an image that is `raw` off: a slip in how it is written explains it, or nothing does.
pub fn film_price(image: &Image, right: &Image, mask: &RegionMask, raw: f64) -> Price {
    let colors = |image: &Image| image.pixels.iter().map(|p| p.to_array()).collect::<Vec<_>>();
    let room = |index: usize| {
        let never = RegionMask::EDGE | RegionMask::EMITTER;
        (mask.pixels[index] & never == 0).then_some(0.0)
    };
    let size = (image.width, image.height);
    if size != (right.width, right.height) {
        return Price::of_raw(raw);
    }
    film_slips::film_price(size, &colors(image), &colors(right), &room, raw)
}

/// Whether two images of one scene come from one renderer: equal within noise offline, within a
/// level of 8-bit sRGB realtime.
pub fn same_origin(
    kind: ImageKind,
    a: &Image,
    b: &Image,
    expected: &Expected,
    tolerances: &Tolerances,
) -> bool {
    let mask = match kind {
        ImageKind::Offline { spp } => {
            return same_draws(a, b, spp, expected.offline.median_lit, tolerances);
        }
        ImageKind::Realtime | ImageKind::SubmittedRealtime => &expected.unshadowed_mask,
        ImageKind::RealtimeShadows | ImageKind::SubmittedShadows => &expected.offline.mask,
    };
    same_levels(a, b, mask, tolerances)
}

/// Judges a frame drawn by code, linear floats, against the image at pixel centers.
pub fn judge_realtime(
    id: CheckId,
    scene: &str,
    actual: &Image,
    center: &Image,
    mask: &RegionMask,
    tolerances: &Tolerances,
) -> Check {
    match compare_realtime_linear(actual, center, mask, tolerances) {
        Ok(found) => describe(id, scene, &found, actual, center, mask),
        Err(error) => Check::new(id, scene, Verdict::NotJudged, error.to_string()),
    }
}

/// As [`judge_realtime`], but what stages draw that do not renormalize the interpolated normal
/// (`raw`) is as good, for all materials or for the diffuse or Phong ones alone.
pub fn judge_shaded(
    id: CheckId,
    scene: &str,
    actual: &Image,
    (center, raw): (&Image, Option<&Image>),
    mask: &RegionMask,
    tolerances: &Tolerances,
) -> Check {
    let check = judge_realtime(id, scene, actual, center, mask, tolerances);
    let Some(raw) = raw.filter(|_| check.verdict == Verdict::Fail) else { return check };
    let taken: [&dyn Fn(&Region) -> bool; 3] =
        [&|_| true, &|region| region.exponent == 0.0, &|region| region.exponent > 0.0];
    for taken in taken {
        let pixels = center.pixels.iter().zip(&raw.pixels).zip(&mask.pixels);
        let mixed = pixels.map(|((a, b), value)| if taken(mask.region(*value)) { *b } else { *a });
        let mixed = Image { pixels: mixed.collect(), ..*center };
        let accepted = judge_realtime(id, scene, actual, &mixed, mask, tolerances);
        if accepted.verdict == Verdict::Pass {
            let summary =
                "the image is what is expected of a normal that is not renormalized (accepted)";
            return Check { summary: summary.into(), ..accepted };
        }
    }
    check
}

/// How the brightness (cube root) of `actual` follows that of `expected` within the lit surfaces, away
/// from edges: 1 at best. Nothing when what is expected hardly varies there.
pub fn shading_correlation(actual: &Image, expected: &Image, mask: &RegionMask) -> Option<f64> {
    let brightness = |pixel: basecode::Vec3| f64::from(pixel.element_sum()).max(0.0).cbrt();
    let mut regions = vec![Moments::default(); mask.regions.len()];
    for (index, &value) in mask.pixels.iter().enumerate() {
        if !mask.is_lit_interior(value) || !actual.pixels[index].is_finite() {
            continue;
        }
        let (a, b) = (brightness(actual.pixels[index]), brightness(expected.pixels[index]));
        regions[usize::from(value & RegionMask::INDEX)].add(1.0, a, b);
    }
    let (mut aa, mut bb, mut ab, mut level) = (0.0, 0.0, 0.0, 0.0);
    for region in regions {
        let own = region.about_means();
        (aa, bb, ab) = (aa + own[0], bb + own[1], ab + own[2]);
        level += region.square_of_b();
    }
    // 3 % of the brightness: flat surfaces tell nothing.
    let varies = bb > 1e-3 * level;
    varies.then(|| if aa > 1e-12 * level { ab / (aa * bb).sqrt() } else { 0.0 })
}

/// A mask in which all but the wanted regions are never compared.
pub fn only(mask: &RegionMask, wanted: &dyn Fn(&Region) -> bool) -> RegionMask {
    let keep: Vec<bool> = mask.regions.iter().map(wanted).collect();
    let mut mask = mask.clone();
    for value in &mut mask.pixels {
        if !keep[usize::from(*value & RegionMask::INDEX)] {
            *value |= RegionMask::EMITTER;
        }
    }
    mask
}

fn describe(
    id: CheckId,
    scene: &str,
    found: &ImageEvidence,
    actual: &Image,
    reference: &Image,
    mask: &RegionMask,
) -> Check {
    let measures = found.checks.iter().map(|check| Measure {
        rule: format!("image.{}", check.id.split(':').next().unwrap_or_default()).parse().ok(),
        name: match check.id.split_once(": ") {
            // The detail begins with the region that the check is about.
            Some((kind, region)) if check.detail.starts_with(region) => {
                format!("{kind}: {}", check.detail)
            }
            _ => format!("{}: {}", check.id, check.detail),
        },
        value: check.value,
        bound: check.bound,
        passed: check.passed,
    });
    let mut check = match found.checks.iter().find(|check| !check.passed) {
        None if found.passed() => {
            Check::new(id, scene, Verdict::Pass, "the image is what is expected, within its noise")
        }
        None => Check::new(id, scene, Verdict::NotJudged, "nothing of the image was compared"),
        Some(first) => {
            let error = relative_error(actual, reference, mask).min(1.0);
            Check { error, ..Check::new(id, scene, Verdict::Fail, first.detail.clone()) }
        }
    };
    check.measures = measures.collect();
    if check.verdict == Verdict::Fail {
        check.hint = ratio_hint(actual, reference, mask);
    }
    check
}

/// Sum of differences over sum of expected values, away from edges and emitters; what is not
/// finite differs by the brightest value.
fn relative_error(actual: &Image, expected: &Image, mask: &RegionMask) -> f64 {
    let (mut apart, mut total, mut brightest) = (0.0, 0.0, 0.0f64);
    let mut broken = 0usize;
    for ((a, b), value) in actual.pixels.iter().zip(&expected.pixels).zip(&mask.pixels) {
        if value & (RegionMask::EDGE | RegionMask::EMITTER) != 0 {
            continue;
        }
        total += f64::from(b.element_sum());
        brightest = brightest.max(f64::from(b.element_sum()));
        if a.is_finite() {
            apart += f64::from((*a - *b).abs().element_sum());
        } else {
            broken += 1;
        }
    }
    (apart + broken as f64 * brightest) / total.max(f64::MIN_POSITIVE)
}

/// Names the factors that whole regions are off by; nothing where a region is off by anything else,
/// since then a constant factor is not what is wrong.
fn ratio_hint(actual: &Image, expected: &Image, mask: &RegionMask) -> String {
    let off = |ratio: &RegionRatio| (ratio.median - 1.0).abs() > 4e-3 || ratio.spread > 0.01;
    let off = region_ratios(actual, expected, mask).into_iter().filter(off);
    let named: Option<Vec<String>> = off
        .map(|ratio| {
            let name = ratio.name()?;
            Some(format!("{} is off by a constant factor: {name}", ratio.region))
        })
        .collect();
    let mut named = named.unwrap_or_default();
    named.dedup();
    named.truncate(3);
    named.join("; ")
}

#[cfg(test)]
mod tests {
    use basecode::Vec3;

    use super::*;

    #[test]
    fn silhouettes_and_other_surfaces_show_no_light() {
        let mut mask = RegionMask::background(16, 16);
        for exponent in [0.0, 20.0] {
            mask.regions.push(Region { name: "ball".into(), lit: true, exponent });
        }
        mask.pixels = (0..256).map(|i| if i % 16 < 8 { 1 } else { 2 }).collect();
        let image = |value: &dyn Fn(usize) -> f32| Image {
            width: 16,
            height: 16,
            pixels: (0..256).map(|i| Vec3::splat(value(i))).collect(),
        };
        let right = image(&|i| 1.0 + (i / 16) as f32 * if i % 16 < 8 { 1.0 } else { 3.0 });
        let of = |actual: &Image| shading_correlation(actual, &right, &mask);
        assert!(of(&right).is_some_and(|found| found > 0.999));
        assert!(of(&image(&|i| 0.3 * right.pixels[i].x + 0.1)).is_some_and(|found| found > 0.9));
        // One color for everything, one for each surface, and noise in which rows differ by nothing.
        assert_eq!(of(&image(&|_| 1.0)), Some(0.0));
        let by_surface = of(&image(&|i| if i % 16 < 8 { 1.0 } else { 4.0 }));
        assert!(by_surface.is_some_and(|found| found.abs() < 1e-3));
        assert!(of(&image(&|i| (i * 7 % 5) as f32)).is_some_and(|found| found.abs() < 0.2));
        let flat = image(&|_| 1.0);
        assert_eq!(shading_correlation(&right, &flat, &mask), None);
    }

    #[test]
    fn normals_that_are_not_renormalized_are_accepted_by_material() {
        let mut mask = RegionMask::background(16, 16);
        for exponent in [0.0, 20.0] {
            mask.regions.push(Region { name: "ball".into(), lit: true, exponent });
        }
        mask.pixels = (0..256).map(|i| if i % 16 < 8 { 1 } else { 2 }).collect();
        let image = |value: &dyn Fn(usize) -> f32| Image {
            width: 16,
            height: 16,
            pixels: (0..256).map(|i| Vec3::splat(value(i))).collect(),
        };
        let (right, raw) = (image(&|_| 1.0), image(&|_| 0.95));
        let judge = |actual: &Image, raw: Option<&Image>| {
            judge_shaded(
                CheckId::StageDiffuse,
                "s",
                actual,
                (&right, raw),
                &mask,
                &Tolerances::default(),
            )
            .verdict
        };
        assert_eq!(judge(&right, Some(&raw)), Verdict::Pass);
        assert_eq!(judge(&raw, Some(&raw)), Verdict::Pass);
        assert_eq!(judge(&raw, None), Verdict::Fail);
        let diffuse_alone = image(&|i| if i % 16 < 8 { 0.95 } else { 1.0 });
        assert_eq!(judge(&diffuse_alone, Some(&raw)), Verdict::Pass);
        // Neither one nor the other.
        assert_eq!(judge(&image(&|_| 0.97), Some(&raw)), Verdict::Fail);
        assert_eq!(judge(&image(&|i| if i < 128 { 0.95 } else { 1.0 }), Some(&raw)), Verdict::Fail);
    }
}
