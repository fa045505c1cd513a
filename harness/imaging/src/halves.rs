//! Samples of images as 16-bit floats.

use half::f16;

/// The bits of the nearest halves.
pub fn of(values: &[f32]) -> Vec<u16> {
    values.iter().map(|&value| f16::from_f32(value).to_bits()).collect()
}

/// How far values lie off, over what is allowed there, as halves: rounded, but never across 1. NaN is infinitely far
/// off.
pub fn of_excess(excess: &[f32]) -> Vec<u16> {
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
