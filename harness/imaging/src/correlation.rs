//! How one quantity follows another: sums over pairs, and the correlations that they give.

/// Weighted sums over pairs (a, b).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    weight: f64,
    a: f64,
    b: f64,
    aa: f64,
    bb: f64,
    ab: f64,
}

/// A quantity varies where its variance is more than this part of its mean square: rounding leaves less.
const VARIES: f64 = 1e-10;

impl Moments {
    /// The sums over pairs of the same weight.
    pub fn of(pairs: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut moments = Self::default();
        pairs.into_iter().for_each(|(a, b)| moments.add(1.0, a, b));
        moments
    }

    /// Takes one pair in; one that holds no number is left out.
    pub fn add(&mut self, weight: f64, a: f64, b: f64) {
        if a.is_finite() && b.is_finite() {
            self.weight += weight;
            self.a += weight * a;
            self.b += weight * b;
            self.aa += weight * a * a;
            self.bb += weight * b * b;
            self.ab += weight * a * b;
        }
    }

    /// The sums about the means: of a * a, b * b and a * b.
    pub fn about_means(&self) -> [f64; 3] {
        let Self { weight, a, b, aa, bb, ab } = *self;
        if weight > 0.0 {
            [aa - a * a / weight, bb - b * b / weight, ab - a * b / weight]
        } else {
            [0.0; 3]
        }
    }

    /// The sum of b * b.
    pub fn square_of_b(&self) -> f64 {
        self.bb
    }

    /// Pearson's correlation, in [-1, 1]; 0 where either does not vary.
    pub fn correlation(&self) -> f64 {
        let [aa, bb, ab] = self.about_means();
        if aa > VARIES * self.aa && bb > VARIES * self.bb { ab / (aa * bb).sqrt() } else { 0.0 }
    }

    /// The same about 0 instead of the means, for what has a mean of 0; nothing where either is 0.
    pub fn cosine(&self) -> Option<f64> {
        let scale = (self.aa * self.bb).sqrt();
        (scale > 0.0).then_some(self.ab / scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_tells_what_follows() {
        let of = |f: fn(f64) -> f64| {
            Moments::of((0..50).map(|i| (f(f64::from(i)), f64::from(i)))).correlation()
        };
        assert!((of(|x| 3.0 * x - 1.0) - 1.0).abs() < 1e-9 && (of(|x| -x) + 1.0).abs() < 1e-9);
        assert_eq!((of(|_| 2.0), of(|_| f64::NAN)), (0.0, 0.0));
        // What does not vary, after rounding.
        assert_eq!((of(|_| 0.1), of(|x| 1e5 + 1e-9 * x)), (0.0, 0.0));
        // However small the quantity is.
        assert!((of(|x| 1e-12 * x) - 1.0).abs() < 1e-9);
        assert_eq!((Moments::default().correlation(), Moments::default().cosine()), (0.0, None));
    }

    #[test]
    fn a_pair_of_twice_the_weight_counts_as_two() {
        let mut weighted = Moments::of([(1.0, 2.0), (0.0, -1.0)]);
        weighted.add(2.0, 3.0, 1.0);
        let twice = Moments::of([(1.0, 2.0), (0.0, -1.0), (3.0, 1.0), (3.0, 1.0)]);
        assert_eq!(weighted, twice);
        let cosine = (2.0 + 3.0 + 3.0) / (19.0f64 * 7.0).sqrt();
        assert!((twice.cosine().unwrap() - cosine).abs() < 1e-12);
    }
}
