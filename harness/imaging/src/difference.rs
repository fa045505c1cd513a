//! Where two images differ, row by row, in loops that a compiler turns into vectors.

use super::rows::Row;

/// Bits of a 32-bit float's infinity. Those of numbers that are not negative sort as the numbers do.
const INFINITE: i32 = 0x7f80_0000;
/// Bits of the largest finite one: of every difference of finite values from there on.
const LARGE: i32 = INFINITE - 1;

/// How many pixels are so, and the first of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Count {
    /// How many.
    pub count: usize,
    /// Column and row of the first.
    pub first: [usize; 2],
}

/// What is odd about one image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Odd {
    /// Pixels with a value that is not finite.
    pub not_finite: Count,
    /// Pixels with a value below 0.
    pub negative: Count,
}

/// A pixel that differs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Different {
    /// Column and row.
    pub at: [usize; 2],
    /// The difference of the channel that differs most; infinite where a value is not finite. That of finite values is
    /// finite, though it may be beyond what 32 bits hold.
    pub size: f64,
    /// The values of the first image.
    pub actual: [f32; 3],
    /// The values of the second.
    pub expected: [f32; 3],
}

/// How two images of one size differ.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Differences {
    /// Pixels that differ.
    pub differing: usize,
    /// The largest difference, the first of several.
    pub largest: Option<Different>,
    /// The largest between finite values.
    pub largest_finite: Option<Different>,
    /// For the error metrics.
    pub sums: Sums,
}

/// Sums over all pixels and channels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Of |d|.
    pub absolute: f64,
    /// Of d^2.
    pub squared: f64,
    /// Of d^2 / (expected^2 + 0.01).
    pub relative: f64,
    /// The largest expected value, 0 where none is above.
    pub peak: f32,
}

impl Odd {
    /// Takes the row `y` of an image in; returns whether all its values are finite.
    pub fn add(&mut self, y: usize, row: [&[f32]; 3]) -> bool {
        let not_finite = |value: f32| value.to_bits() as i32 & INFINITE == INFINITE;
        let finite = !self.not_finite.add(y, row, not_finite);
        self.negative.add(y, row, |value| value < 0.0);
        finite
    }

    /// Takes in what is further down.
    pub fn append(&mut self, below: &Self) {
        self.not_finite.append(&below.not_finite);
        self.negative.append(&below.negative);
    }
}

impl Count {
    /// Whether the row has any.
    fn add(&mut self, y: usize, row: [&[f32]; 3], is_so: impl Fn(f32) -> bool) -> bool {
        let [red, green, blue] = same_length(row);
        let pixel = |i: usize| is_so(red[i]) | is_so(green[i]) | is_so(blue[i]);
        let mut count = 0;
        for i in 0..red.len() {
            count += u32::from(pixel(i));
        }
        if count > 0 && self.count == 0 {
            let x = (0..red.len()).find(|&i| pixel(i)).unwrap_or_default();
            self.first = [x, y];
        }
        self.count += count as usize;
        count > 0
    }

    fn append(&mut self, below: &Self) {
        if self.count == 0 {
            self.first = below.first;
        }
        self.count += below.count;
    }
}

impl Differences {
    /// Takes a row of two images in. NaN equals NaN, unless `nan_is_error`. `finite`: all values of
    /// both are. `sizes` is room for the differences.
    pub fn add(&mut self, row: &Row, nan_is_error: bool, finite: bool, sizes: &mut Vec<i32>) {
        let (actual, expected) = (same_length(row.colors(0)), same_length(row.colors(1)));
        sizes.resize(actual[0].len(), 0);
        match nan_is_error {
            true => measure::<true>(actual, expected, sizes),
            false => measure::<false>(actual, expected, sizes),
        }
        let mut differing = 0;
        let (mut largest, mut largest_finite) = (0, 0);
        for &size in sizes.iter() {
            differing += u32::from(size != 0);
            largest = largest.max(size);
            largest_finite = largest_finite.max(if size < INFINITE { size } else { 0 });
        }
        self.differing += differing as usize;
        for (kept, size) in
            [(&mut self.largest, largest), (&mut self.largest_finite, largest_finite)]
        {
            let x = match size {
                0 => continue,
                LARGE => largest_at(actual, expected, sizes),
                _ => sizes.iter().position(|&own| own == size).unwrap_or_default(),
            };
            let pixel = |of: [&[f32]; 3]| of.map(|channel| channel[x]);
            let (actual, expected) = (pixel(actual), pixel(expected));
            let size = match size {
                LARGE => apart(actual, expected),
                _ => f64::from(f32::from_bits(size as u32)),
            };
            if kept.is_none_or(|kept| size > kept.size) {
                *kept = Some(Different { at: [x, row.y], size, actual, expected });
            }
        }
        for (a, b) in actual.iter().zip(expected) {
            self.sums.peak = self.sums.peak.max(highest(b));
            // Nothing is to be added where all is finite and equal.
            if differing > 0 || !finite {
                self.sums.add(a, b);
            }
        }
    }

    /// Takes in what is further down.
    pub fn append(&mut self, below: &Self) {
        self.differing += below.differing;
        for (own, other) in
            [(&mut self.largest, below.largest), (&mut self.largest_finite, below.largest_finite)]
        {
            if let Some(other) = other
                && own.is_none_or(|own| other.size > own.size)
            {
                *own = Some(other);
            }
        }
        self.sums.absolute += below.sums.absolute;
        self.sums.squared += below.sums.squared;
        self.sums.relative += below.sums.relative;
        self.sums.peak = self.sums.peak.max(below.sums.peak);
    }
}

impl Sums {
    /// Adds a row of a channel, in four sums side by side.
    fn add(&mut self, actual: &[f32], expected: &[f32]) {
        const LANES: usize = 4;
        let mut lanes = [[0.0f64; LANES]; 3];
        let mut add = |lane: usize, a: f32, b: f32| {
            let (a, b) = (f64::from(a), f64::from(b));
            let d = a - b;
            lanes[0][lane] += d.abs();
            lanes[1][lane] += d * d;
            lanes[2][lane] += d * d / (b * b + 0.01);
        };
        let (fours_a, rest_a) = actual.as_chunks::<LANES>();
        let (fours_b, rest_b) = expected.as_chunks::<LANES>();
        for (a, b) in fours_a.iter().zip(fours_b) {
            for lane in 0..LANES {
                add(lane, a[lane], b[lane]);
            }
        }
        for (&a, &b) in rest_a.iter().zip(rest_b) {
            add(0, a, b);
        }
        let [absolute, squared, relative] = lanes.map(|lanes| lanes.iter().sum::<f64>());
        self.absolute += absolute;
        self.squared += squared;
        self.relative += relative;
    }
}

/// The bits of each pixel's largest difference of a channel, infinite where only one value is finite
/// or both are infinite apart; 0 when all are equal.
fn measure<const NAN_IS_ERROR: bool>(a: [&[f32]; 3], b: [&[f32]; 3], sizes: &mut [i32]) {
    let (a, b) = (a.map(|row| &row[..sizes.len()]), b.map(|row| &row[..sizes.len()]));
    for (i, largest) in sizes.iter_mut().enumerate() {
        *largest = 0;
        for c in 0..3 {
            let (a, b) = (a[c][i], b[c][i]);
            let size = (a - b).abs();
            let finite = (a.abs() < f32::INFINITY) & (b.abs() < f32::INFINITY);
            let most = if finite { LARGE } else { INFINITE };
            let size = if size.is_nan() { INFINITE } else { (size.to_bits() as i32).min(most) };
            let both_nan = !NAN_IS_ERROR & a.is_nan() & b.is_nan();
            let size = if (a == b) | both_nan { 0 } else { size };
            *largest = (*largest).max(size);
        }
    }
}

/// Of the pixels whose difference is too large for 32 bits, the column of the one that differs most.
fn largest_at(a: [&[f32]; 3], b: [&[f32]; 3], sizes: &[i32]) -> usize {
    let pixel = |of: [&[f32]; 3], x: usize| of.map(|channel| channel[x]);
    let mut largest = (0, 0.0);
    for (x, _) in sizes.iter().enumerate().filter(|(_, size)| **size == LARGE) {
        let size = apart(pixel(a, x), pixel(b, x));
        if size > largest.1 {
            largest = (x, size);
        }
    }
    largest.0
}

/// The difference of the channel that differs most, of those with finite values; of 32 bits where they hold it.
fn apart(a: [f32; 3], b: [f32; 3]) -> f64 {
    let apart = a.iter().zip(b).map(|(&a, b)| (f64::from(a) - f64::from(b)).abs());
    let most = apart.filter(|size| size.is_finite()).fold(0.0, f64::max);
    if (most as f32).is_finite() { f64::from(most as f32) } else { most }
}

/// The largest value, 0 where none is above.
fn highest(values: &[f32]) -> f32 {
    let mut highest = 0;
    for value in values {
        let bits = if value.is_nan() { 0 } else { value.to_bits() as i32 };
        highest = highest.max(bits);
    }
    f32::from_bits(highest as u32)
}

/// Channels of one row have one length, which the compiler cannot know.
fn same_length([red, green, blue]: [&[f32]; 3]) -> [&[f32]; 3] {
    [red, &green[..red.len()], &blue[..red.len()]]
}
