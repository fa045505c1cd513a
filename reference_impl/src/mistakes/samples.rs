//! Where the samples of a pixel lie: mistakes, and right ways other than independent numbers.

use basecode::Sampler;

use super::{Mistake as M, Mistakes};

/// The samples of one pixel.
pub struct Samples<'a> {
    mistakes: &'a Mistakes,
    sampler: &'a Sampler,
    spp: usize,
    /// Moves a fixed pattern, another way in every pixel, around its torus.
    shift: (f32, f32),
    /// State of a generator of our own.
    word: std::cell::Cell<u64>,
}

impl<'a> Samples<'a> {
    pub fn new(mistakes: &'a Mistakes, sampler: &'a Sampler, spp: usize) -> Self {
        let patterned = [M::Sobol, M::Halton, M::Lattice, M::OwnLcg, M::OwnXorshift]
            .iter()
            .any(|m| mistakes.has(*m));
        let shift = if spp > 1 && patterned { sampler.next_2d() } else { (0.0, 0.0) };
        let word = ((f64::from(shift.0) * 2f64.powi(24)) as u64) << 24
            | (f64::from(shift.1) * 2f64.powi(24)) as u64
            | 1;
        Self { mistakes, sampler, spp, shift, word: word.into() }
    }

    /// The `index`th, in pixels from the pixel's upper left corner.
    pub fn get(&self, index: usize) -> (f32, f32) {
        let has = |mistake| self.mistakes.has(mistake);
        if self.spp == 1 {
            return if has(M::PixelCorner) { (0.0, 0.0) } else { (0.5, 0.5) };
        }
        let wrap = |x: f32, y: f32| ((x + self.shift.0).fract(), (y + self.shift.1).fract());
        match () {
            () if has(M::NoJitter) => (0.5, 0.5),
            () if has(M::SameJitter) => {
                let both = self.sampler.next_1d();
                (both, both)
            }
            () if has(M::JitterXOnly) => (self.sampler.next_1d(), 0.5),
            () if has(M::JitterHalf) => self.scaled(0.5, 0.0),
            () if has(M::JitterWide) => self.scaled(2.0, 0.0),
            () if has(M::JitterShifted) => self.scaled(1.0, -0.5),
            () if has(M::Stratified) => self.in_cell(index, self.sampler.next_2d()),
            () if has(M::RegularGrid) => self.in_cell(index, (0.5, 0.5)),
            () if has(M::Antithetic) => self.antithetic(index),
            () if has(M::Sobol) => wrap(van_der_corput(index as u32), sobol(index as u32)),
            () if has(M::Halton) => wrap(radical_inverse(index, 2), radical_inverse(index, 3)),
            () if has(M::Lattice) => {
                // R2 (Roberts, 2018): powers of the inverse of the plastic number.
                let at = |step: f64| (step * index as f64).fract() as f32;
                wrap(at(0.754_877_666_246_692_7), at(0.569_840_290_998_053_3))
            }
            () if has(M::OwnLcg) => (self.lcg(), self.lcg()),
            () if has(M::OwnXorshift) => (self.xorshift(), self.xorshift()),
            () => self.sampler.next_2d(),
        }
    }

    fn scaled(&self, factor: f32, offset: f32) -> (f32, f32) {
        let (x, y) = self.sampler.next_2d();
        (factor * x + offset, factor * y + offset)
    }

    /// A place within the `index`th cell of the squarest grid that has as many cells as samples.
    fn in_cell(&self, index: usize, (x, y): (f32, f32)) -> (f32, f32) {
        let rows = (1..=self.spp).filter(|n| self.spp.is_multiple_of(*n) && n * n <= self.spp);
        let rows = rows.max().unwrap_or(1);
        let columns = self.spp / rows;
        let (column, row) = (index % columns, index / columns);
        ((column as f32 + x) / columns as f32, (row as f32 + y) / rows as f32)
    }

    /// Every other sample mirrors the one before in the pixel's center.
    fn antithetic(&self, index: usize) -> (f32, f32) {
        if index.is_multiple_of(2) {
            let (x, y) = self.sampler.next_2d();
            self.word.set(u64::from(x.to_bits()) << 32 | u64::from(y.to_bits()));
            return (x, y);
        }
        let word = self.word.get();
        (1.0 - f32::from_bits((word >> 32) as u32), 1.0 - f32::from_bits(word as u32))
    }

    /// Knuth's MMIX generator.
    fn lcg(&self) -> f32 {
        let word = self.word.get().wrapping_mul(6_364_136_223_846_793_005);
        self.word.set(word.wrapping_add(1_442_695_040_888_963_407));
        (self.word.get() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Marsaglia, "Xorshift RNGs", 2003.
    fn xorshift(&self) -> f32 {
        let mut word = self.word.get();
        word ^= word << 13;
        word ^= word >> 7;
        word ^= word << 17;
        self.word.set(word);
        (word >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Digits of `index` in a base, mirrored in the point.
fn radical_inverse(mut index: usize, base: usize) -> f32 {
    let (mut value, mut digit) = (0.0, 1.0 / base as f64);
    while index > 0 {
        value += digit * (index % base) as f64;
        index /= base;
        digit /= base as f64;
    }
    value as f32
}

fn van_der_corput(index: u32) -> f32 {
    (f64::from(index.reverse_bits()) / 2f64.powi(32)) as f32
}

/// The second dimension of Sobol's sequence (Kollig and Keller, 2002).
fn sobol(mut index: u32) -> f32 {
    let (mut direction, mut word) = (1u32 << 31, 0u32);
    while index > 0 {
        if index & 1 == 1 {
            word ^= direction;
        }
        index >>= 1;
        direction ^= direction >> 1;
    }
    (f64::from(word) / 2f64.powi(32)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the pattern, its samples fill the pixel evenly on average.
    #[test]
    fn right_patterns_cover_the_pixel() {
        for (kind, name) in M::RIGHT {
            let mut mistakes = Mistakes::default();
            mistakes.add(name).unwrap();
            let (mut x_sum, mut y_sum, mut square, mut product) = (0.0f64, 0.0, 0.0, 0.0);
            let (pixels, spp) = (2000, 16);
            for pixel in 0..pixels {
                let sampler = Sampler::new(pixel);
                let samples = Samples::new(&mistakes, &sampler, spp);
                for index in 0..spp {
                    let (x, y) = samples.get(index);
                    assert!((0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y), "{kind:?}");
                    let (x, y) = (f64::from(x) - 0.5, f64::from(y) - 0.5);
                    (x_sum, y_sum) = (x_sum + x, y_sum + y);
                    (square, product) = (square + x * x + y * y, product + x * y);
                }
            }
            let count = pixels as f64 * spp as f64;
            let bias = (x_sum / count).abs().max((y_sum / count).abs());
            assert!(bias < 0.01, "{kind:?}: mean {bias}");
            assert!((square / count - 1.0 / 6.0).abs() < 0.012, "{kind:?}: {}", square / count);
            assert!((product / count).abs() < 0.005, "{kind:?}: {}", product / count);
        }
    }
}
