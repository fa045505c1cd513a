//! Pseudo-random numbers.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// A stream of uniform random numbers that its seed determines.
///
/// Use a sampler in one thread at a time. Threads that share one draw from the same state in an
/// order that changes from run to run, and some draw the same number twice. No seed then reproduces
/// the noise. Rust rules out a data race because the state is atomic. That makes sharing *safe*,
/// not *right*.
///
/// The generator is PCG-RXS-M-XS-64 (O'Neill, "PCG: A Family of Simple Fast Space-Efficient
/// Statistically Good Algorithms for Random Number Generation", 2014); seeds are scrambled with
/// SplitMix64, so that neighboring seeds give unrelated streams.
#[derive(Debug)]
pub struct Sampler {
    state: AtomicU64,
}

impl Sampler {
    /// A sampler whose stream depends on `seed` alone.
    pub fn new(seed: u64) -> Self {
        let mut z = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        Self { state: AtomicU64::new(z ^ (z >> 31)) }
    }

    /// The next number, uniform in [0, 1), with 24 random bits.
    pub fn next_1d(&self) -> f32 {
        let state = self.state.load(Relaxed);
        self.state.store(
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407),
            Relaxed,
        );
        let word =
            ((state >> ((state >> 59) + 5)) ^ state).wrapping_mul(12_605_985_483_714_917_081);
        ((word >> 43 ^ word) >> 40) as f32 * (1.0 / (1u64 << 24) as f32)
    }

    /// The next two numbers, each uniform in [0, 1).
    pub fn next_2d(&self) -> (f32, f32) {
        (self.next_1d(), self.next_1d())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_uniform_and_streams_unrelated() {
        let (a, b) = (Sampler::new(7), Sampler::new(8));
        let n = 200_000;
        let (mut sum, mut square, mut product) = (0.0f64, 0.0f64, 0.0f64);
        for _ in 0..n {
            let (x, y) = (f64::from(a.next_1d()), f64::from(b.next_1d()));
            assert!((0.0..1.0).contains(&x));
            sum += x;
            square += x * x;
            product += (x - 0.5) * (y - 0.5);
        }
        let n = f64::from(n);
        assert!((sum / n - 0.5).abs() < 3e-3, "mean {}", sum / n);
        assert!((square / n - 1.0 / 3.0).abs() < 3e-3, "second moment {}", square / n);
        assert!((product / n).abs() < 1e-3, "correlation of two seeds {}", product / n);
    }

    #[test]
    fn the_seed_determines_the_stream() {
        let draw = |seed| {
            let sampler = Sampler::new(seed);
            [sampler.next_1d(), sampler.next_1d(), sampler.next_1d()]
        };
        assert_eq!(draw(260_000_000), draw(260_000_000));
        assert_ne!(draw(260_000_000), draw(260_000_001));
    }
}
