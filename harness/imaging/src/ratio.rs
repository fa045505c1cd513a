//! Constant factors give a mistake away: a region that is 3.1416 times too bright has lost a 1/pi.

use std::f64::consts::PI;

use basecode::image::Image;
use serde::{Deserialize, Serialize};

use super::reference::RegionMask;

/// How much brighter a region is than expected.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegionRatio {
    /// The region's name.
    pub region: String,
    /// Whether this is the region's highlight.
    pub highlight: bool,
    /// Pixels that were used: lit, interior, finite, not too dark.
    pub pixels: usize,
    /// Median of actual over expected (mean of the channels).
    pub median: f64,
    /// Half of the distance between the 2nd and 98th percentile, over the median: small if the factor is constant.
    pub spread: f64,
}

impl RegionRatio {
    /// The factor's name, if it is constant over the region and has one. A factor near 1 must be the
    /// more constant: whatever varies a little looks like 0.99 somewhere.
    pub fn name(&self) -> Option<&'static str> {
        let apart = self.median.abs().max(f64::MIN_POSITIVE).ln().abs();
        (self.spread < 0.05 * apart.min(1.0)).then(|| ratio_name(self.median)).flatten()
    }
}

/// The name of a factor that a known mistake produces, within 0.4 %, those near 1 the closer; 1 has none.
pub fn ratio_name(ratio: f64) -> Option<&'static str> {
    let named = [
        (PI, "pi"),
        (1.0 / PI, "1/pi"),
        (2.0 * PI, "2 pi"),
        (0.5 / PI, "1/(2 pi)"),
        (4.0 * PI, "4 pi"),
        (0.25 / PI, "1/(4 pi)"),
        (PI * PI, "pi^2"),
        (1.0 / (PI * PI), "1/pi^2"),
        (0.5 * PI, "pi/2"),
        (2.0 / PI, "2/pi"),
        (2.0, "2"),
        (0.5, "1/2"),
        (3.0, "3"),
        (1.0 / 3.0, "1/3"),
        (4.0, "4"),
        (0.25, "1/4"),
        (0.99, "0.99"),
        (1.0 / 0.99, "1/0.99"),
    ];
    let margin = |factor: f64| 4e-3f64.min(0.1 * factor.ln().abs());
    named
        .into_iter()
        .find(|(factor, _)| (ratio / factor - 1.0).abs() < margin(*factor))
        .map(|(_, name)| name)
}

/// The ratio actual / expected of every lit region, over interior pixels brighter than a hundredth of the brightest.
///
/// Images of different sizes have no ratios.
pub fn region_ratios(actual: &Image, expected: &Image, mask: &RegionMask) -> Vec<RegionRatio> {
    if actual.pixels.len() != expected.pixels.len() || mask.pixels.len() != expected.pixels.len() {
        return Vec::new();
    }
    let mut ratios = vec![Vec::new(); 2 * mask.regions.len()];
    let lit = |m: &u16| mask.is_lit_interior(*m);
    let brightest = mask
        .pixels
        .iter()
        .zip(&expected.pixels)
        .filter(|(m, _)| lit(m))
        .fold(0.0f32, |max, (_, b)| max.max(b.element_sum()));
    for ((m, a), b) in mask.pixels.iter().zip(&actual.pixels).zip(&expected.pixels) {
        let (a, b) = (a.element_sum(), b.element_sum());
        if lit(m) && a.is_finite() && b > 0.01 * brightest {
            let highlight = usize::from(m & RegionMask::HIGHLIGHT != 0);
            ratios[2 * usize::from(m & RegionMask::INDEX) + highlight].push(a / b);
        }
    }
    let mut found = Vec::new();
    for (i, mut values) in ratios.into_iter().enumerate().filter(|(_, v)| !v.is_empty()) {
        values.sort_unstable_by(f32::total_cmp);
        let at = |fraction: f64| {
            f64::from(values[(fraction * (values.len() - 1) as f64).round() as usize])
        };
        let median = at(0.5);
        let spread = if median > 0.0 { 0.5 * (at(0.98) - at(0.02)) / median } else { f64::MAX };
        found.push(RegionRatio {
            region: mask.regions[i / 2].name.clone(),
            highlight: i % 2 == 1,
            pixels: values.len(),
            median,
            spread,
        });
    }
    found
}

/// Three channels as `(0.1000, 0.2000, 0.3000)`.
pub fn triple(v: [f32; 3]) -> String {
    format!("({:.4}, {:.4}, {:.4})", v[0], v[1], v[2])
}

#[cfg(test)]
mod tests {
    use super::super::reference::Region;
    use super::*;
    use glam::Vec3;

    #[test]
    fn factors_have_names() {
        assert_eq!(ratio_name(3.15), Some("pi"));
        assert_eq!(ratio_name(0.3175), Some("1/pi"));
        assert_eq!(ratio_name(12.57), Some("4 pi"));
        assert_eq!(ratio_name(0.5), Some("1/2"));
        assert_eq!((ratio_name(0.9902), ratio_name(1.0101)), (Some("0.99"), Some("1/0.99")));
        for nothing in [1.0, 0.987, 1.013, 0.0, f64::NAN, f64::INFINITY, 1.02, 3.2, -2.0] {
            assert_eq!(ratio_name(nothing), None, "{nothing}");
        }
    }

    #[test]
    fn a_region_without_its_one_over_pi_is_named_and_the_other_is_not() {
        let (width, height) = (20, 10);
        let mut mask = RegionMask::background(width, height);
        for name in ["left", "right"] {
            mask.regions.push(Region { name: name.into(), lit: true, exponent: 0.0 });
        }
        let mut expected = Image::new(width, height);
        let mut actual = Image::new(width, height);
        for i in 0..width * height {
            let left = i % width < 10;
            mask.pixels[i] = if left { 1 } else { 2 };
            expected.pixels[i] = Vec3::splat(0.2 + (i as f32 * 0.7).sin() * 0.1);
            let factor = if left { std::f32::consts::PI } else { 0.2 + 0.05 * (i / width) as f32 };
            actual.pixels[i] = expected.pixels[i] * factor;
        }
        actual.pixels[3] = Vec3::NAN;
        mask.pixels[4] |= RegionMask::EDGE;
        actual.pixels[4] = Vec3::splat(100.0);
        let ratios = region_ratios(&actual, &expected, &mask);
        assert_eq!(ratios.len(), 2);
        assert_eq!((ratios[0].pixels, ratios[0].name()), (98, Some("pi")));
        assert!(ratios[0].spread < 1e-4);
        assert_eq!(ratios[1].name(), None);
        assert!(ratios[1].spread > 0.2, "{ratios:?}");
        assert_eq!(region_ratios(&Image::new(2, 2), &expected, &mask), []);
    }
}
