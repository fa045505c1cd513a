//! How many pixels of two images differ by more than thresholds, as OpenImageIO's `idiff` counts them.

use super::rows::Row;

/// When a difference counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// |a - b| counts above this.
    pub absolute: f32,
    /// And above this fraction of the mean of |a| and |b|.
    pub relative: f32,
    /// So many percent of all pixels may count, 0 to 100.
    pub percent: f32,
    /// No |a - b| may be above this.
    pub hard: f32,
}

/// The largest difference of two images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Largest {
    /// |a - b|, above 0; infinite where only one is finite, or where 32 bits do not hold it.
    pub size: f32,
    /// Column and row.
    pub at: [usize; 2],
    /// The channel, as they were counted.
    pub channel: usize,
}

/// What was found so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Tally {
    /// Sum of |a - b| where both are finite, over all values.
    pub absolute: f64,
    /// Sum of its squares.
    pub squared: f64,
    /// The largest finite |a| or |b|, 1 or more.
    pub peak: f32,
    /// The largest difference, the first of several.
    pub largest: Option<Largest>,
    /// Pixels above the limits of failure.
    pub failing: usize,
    /// Pixels above the limits of warning.
    pub warned: usize,
    /// Pixels with values that have no difference: NaN or infinity in one image, infinities apart.
    pub not_finite: usize,
    /// Of each pixel of the row: whether it fails, warns, is not finite.
    flags: Vec<u8>,
}

const FAILS: u8 = 1;
const WARNS: u8 = 2;
const NOT_FINITE: u8 = 4;

impl Default for Tally {
    fn default() -> Self {
        Self {
            absolute: 0.0,
            squared: 0.0,
            peak: 1.0,
            largest: None,
            failing: 0,
            warned: 0,
            not_finite: 0,
            flags: Vec::new(),
        }
    }
}

impl Tally {
    /// Takes a channel of a row in. After the last one comes [`Tally::end_row`].
    pub fn add(&mut self, row: &Row, channel: usize, fail: &Thresholds, warn: &Thresholds) {
        let (a, b) = (row.values(0, channel), row.values(1, channel));
        self.flags.resize(a.len(), 0);
        let (mut largest, mut peak) = (0, 0);
        let mut sums = [[0.0f64; 4]; 2];
        for (i, ((&a, &b), flags)) in a.iter().zip(b).zip(&mut self.flags).enumerate() {
            let size = size(a, b);
            let mean = 0.5 * (a.abs() + b.abs());
            // Two finite values may be further apart than any 32-bit number.
            let infinite = size == f32::INFINITY;
            let not_finite = infinite & !(a.is_finite() & b.is_finite());
            let above = |limits: &Thresholds| {
                infinite | (size > limits.absolute.max(limits.relative * mean)) & (size > 0.0)
            };
            for (is_so, flag) in
                [(above(fail), FAILS), (above(warn), WARNS), (not_finite, NOT_FINITE)]
            {
                *flags |= u8::from(is_so) * flag;
            }
            largest = largest.max(size.to_bits() as i32);
            let finite =
                |value: f32| if value.is_finite() { value.abs().to_bits() as i32 } else { 0 };
            peak = peak.max(finite(a)).max(finite(b));
            let apart =
                if infinite { (f64::from(a) - f64::from(b)).abs() } else { f64::from(size) };
            let size = if not_finite { 0.0 } else { apart };
            sums[0][i % 4] += size;
            sums[1][i % 4] += size * size;
        }
        self.peak = self.peak.max(f32::from_bits(peak as u32));
        self.absolute += sums[0].iter().sum::<f64>();
        self.squared += sums[1].iter().sum::<f64>();
        let largest = f32::from_bits(largest as u32);
        let before = self.largest;
        if largest > 0.0 && before.is_none_or(|before| largest >= before.size) {
            let x = a.iter().zip(b).position(|(&a, &b)| size(a, b) == largest).unwrap_or_default();
            // Of one size the first counts: within a row the leftmost, then the first channel.
            let first = before.is_none_or(|before| {
                largest > before.size || (before.at[1] == row.y && x < before.at[0])
            });
            if first {
                self.largest = Some(Largest { size: largest, at: [x, row.y], channel });
            }
        }
    }

    /// Counts the pixels of a row whose channels are all in.
    pub fn end_row(&mut self) {
        let count = |flag: u8| self.flags.iter().map(|flags| usize::from(flags & flag != 0)).sum();
        let [failing, warned, not_finite]: [usize; 3] = [FAILS, WARNS, NOT_FINITE].map(count);
        self.failing += failing;
        self.warned += warned;
        self.not_finite += not_finite;
        self.flags.clear();
    }

    /// Takes in what is further down.
    pub fn append(&mut self, below: &Self) {
        self.absolute += below.absolute;
        self.squared += below.squared;
        self.peak = self.peak.max(below.peak);
        if let Some(other) = below.largest
            && self.largest.is_none_or(|own| other.size > own.size)
        {
            self.largest = Some(other);
        }
        self.failing += below.failing;
        self.warned += below.warned;
        self.not_finite += below.not_finite;
    }
}

/// |a - b|: 0 for equal values and two NaN, infinite where there is no difference.
fn size(a: f32, b: f32) -> f32 {
    let size = (a - b).abs();
    let size = if size.is_nan() { f32::INFINITY } else { size };
    if (a == b) | (a.is_nan() & b.is_nan()) { 0.0 } else { size }
}
