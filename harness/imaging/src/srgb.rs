//! The sRGB transfer function (IEC 61966-2-1) and 8-bit levels.

use std::sync::LazyLock;

use basecode::Image;
use glam::Vec3;

/// Encodes a linear value in [0, 1].
pub fn encode(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Decodes an encoded value in [0, 1].
pub fn decode(encoded: f64) -> f64 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Linear values are looked up by exponent and this many leading bits of the fraction.
const FRACTION_BITS: u32 = 8;
/// Below 2^-13 every value is level 0, whose upper end is half of 1/255 / 12.92.
const FIRST: u32 = (127 - 13) << FRACTION_BITS;

struct Table {
    /// The smallest linear value of each level; one past the last never comes.
    starts: [f32; 257],
    /// The level at the beginning of each bucket of floats.
    buckets: Vec<u8>,
}

static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let mut starts = [f32::INFINITY; 257];
    starts[0] = 0.0;
    for (level, start) in starts.iter_mut().enumerate().take(256).skip(1) {
        *start = decode((level as f64 - 0.5) / 255.0) as f32;
    }
    let last = 127 << FRACTION_BITS;
    let buckets = (FIRST..=last).map(|bucket| {
        let x = f32::from_bits(bucket << (23 - FRACTION_BITS));
        (starts.partition_point(|&start| start <= x) - 1) as u8
    });
    let buckets = buckets.collect();
    Table { starts, buckets }
});

/// The nearest 8-bit sRGB level of a linear value clamped to [0, 1]; NaN is 0.
pub fn level(linear: f32) -> u8 {
    let table = &*TABLE;
    // NaN and both zeros are 0: the bits of -0.0 are those of a large number.
    let x = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
    let bucket = x.to_bits() >> (23 - FRACTION_BITS);
    if bucket < FIRST {
        return 0;
    }
    let mut level = usize::from(table.buckets[(bucket - FIRST) as usize]);
    while x >= table.starts[level + 1] {
        level += 1;
    }
    level as u8
}

/// How many levels two colors are apart, in the channel where they are furthest.
pub fn levels_apart(a: Vec3, b: Vec3) -> u32 {
    let levels = |p: Vec3| p.to_array().map(level);
    let pairs = levels(a).into_iter().zip(levels(b));
    pairs.map(|(a, b)| u32::from(a.abs_diff(b))).max().unwrap_or(0)
}

/// The levels of an image, channel by channel of each pixel, after its values were rounded to halves.
pub fn levels_of_halves(image: &Image) -> Vec<u8> {
    let channels = image.pixels.iter().flat_map(|pixel| pixel.to_array());
    channels.map(|value| level(to_half(value))).collect()
}

/// The nearest value with the ten fraction bits of half precision, ties to even. What half
/// precision cannot hold (below 6e-5, above 65,504) has level 0 or 255 either way.
fn to_half(value: f32) -> f32 {
    let bits = value.to_bits();
    if !value.is_finite() {
        return value;
    }
    f32::from_bits((bits + 0x0fff + ((bits >> 13) & 1)) & !0x1fff)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_levels() {
        let cases = [
            (0.0, 0),
            (-0.0, 0),
            (f32::from_bits(1), 0),
            (-f32::from_bits(1), 0),
            (-3.0, 0),
            (1.0, 255),
            (39.0, 255),
            (0.5, 188),
            (0.2, 124),
            (f32::NAN, 0),
            (-f32::NAN, 0),
            (f32::INFINITY, 255),
            (f32::NEG_INFINITY, 0),
        ];
        for (linear, expected) in cases {
            assert_eq!(level(linear), expected, "{linear}");
        }
    }

    #[test]
    fn the_table_agrees_with_the_formula() {
        for i in 0..=200_000u32 {
            let x = (i as f32 / 200_000.0).powi(2);
            let exact = 255.0 * encode(f64::from(x));
            let distance = (f64::from(level(x)) - exact).abs();
            assert!(distance < 0.5001, "{x}: {} for {exact}", level(x));
        }
    }

    #[test]
    fn every_level_comes_back() {
        for l in 0..=255u8 {
            assert_eq!(level(decode(f64::from(l) / 255.0) as f32), l);
        }
    }
}
