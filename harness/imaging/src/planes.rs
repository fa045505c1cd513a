//! Samples of images as bytes that compress well: the highest bytes of all samples first.

use basecode::Image;
use half::f16;

/// The channels of an image one after the other, row by row.
pub fn channels(image: &Image) -> Vec<f32> {
    let mut values = Vec::with_capacity(3 * image.pixels.len());
    for channel in 0..3 {
        values.extend(image.pixels.iter().map(|pixel| pixel[channel]));
    }
    values
}

/// The bits of the nearest halves.
pub fn halves(values: &[f32]) -> Vec<u16> {
    values.iter().map(|&value| f16::from_f32(value).to_bits()).collect()
}

/// The values as halves; none where these cannot hold the very bits of each, those of what is not a number included.
pub fn exact_halves(values: &[f32]) -> Option<Vec<u16>> {
    let half = |&value: &f32| {
        let half = f16::from_f32(value);
        (half.to_f32().to_bits() == value.to_bits()).then(|| half.to_bits())
    };
    values.iter().map(half).collect()
}

/// How far values lie off, over what is allowed there, as halves: rounded, but never across 1. NaN is infinitely far
/// off.
pub fn excess_halves(excess: &[f32]) -> Vec<u16> {
    let one = f16::ONE.to_bits();
    let rounded = |&value: &f32| {
        let half = f16::from_f32(value.min(f16::MAX.to_f32())).to_bits();
        match value {
            _ if value.is_nan() => f16::INFINITY.to_bits(),
            _ if value > 1.0 => half.max(one + 1),
            _ => half.min(one),
        }
    };
    excess.iter().map(rounded).collect()
}

/// Differences between successive samples, all their highest bytes first: neighbors are alike, so these are alike.
pub fn of_words(samples: &[u16]) -> Vec<u8> {
    of(samples.iter().map(|&sample| sample.into()), 2)
}

/// As [`of_words`], for the bits of floats.
pub fn of_floats(samples: &[f32]) -> Vec<u8> {
    of(samples.iter().map(|sample| sample.to_bits()), 4)
}

fn of(samples: impl ExactSizeIterator<Item = u32>, bytes: usize) -> Vec<u8> {
    let count = samples.len();
    let mut planes = vec![0; count * bytes];
    let mut last = 0u32;
    for (index, sample) in samples.enumerate() {
        let step = sample.wrapping_sub(last).to_le_bytes();
        for plane in 0..bytes {
            planes[plane * count + index] = step[bytes - 1 - plane];
        }
        last = sample;
    }
    planes
}
