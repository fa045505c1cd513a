//! The published curve from error to the fraction of points that is left.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A piecewise-linear curve through (error, fraction) points: errors rise, fractions fall.
///
/// It applies to failed checks only; one that passes is worth everything, so that the first
/// fraction is the most that a failed check can keep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Vec<[f64; 2]>", into = "Vec<[f64; 2]>")]
pub struct Curve(Vec<[f64; 2]>);

impl Curve {
    /// The fraction that is left, in [0, 1]. An error that is not finite leaves nothing.
    pub fn fraction(&self, error: f64) -> f64 {
        let points = &self.0;
        let last = points[points.len() - 1];
        if !error.is_finite() || error >= last[0] {
            return if error.is_finite() { last[1] } else { 0.0 };
        }
        if error <= points[0][0] {
            return points[0][1];
        }
        let right = points.partition_point(|point| point[0] <= error);
        let ([x0, y0], [x1, y1]) = (points[right - 1], points[right]);
        y0 + (y1 - y0) * (error - x0) / (x1 - x0)
    }

    /// The points, for showing.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.0
    }
}

impl TryFrom<Vec<[f64; 2]>> for Curve {
    type Error = String;

    fn try_from(points: Vec<[f64; 2]>) -> Result<Self, String> {
        if points.is_empty() {
            return Err("a curve needs at least one [error, fraction] point".into());
        }
        for pair in points.windows(2) {
            if !(pair[0][0] < pair[1][0] && pair[0][1] >= pair[1][1]) {
                return Err(format!(
                    "a curve's errors must rise and its fractions must not: [{}, {}] is followed by [{}, {}]",
                    pair[0][0], pair[0][1], pair[1][0], pair[1][1]
                ));
            }
        }
        match points.iter().find(|p| !(p[0] >= 0.0 && (0.0..=1.0).contains(&p[1]))) {
            Some([error, fraction]) => Err(format!(
                "curve point [{error}, {fraction}]: expected an error of at least 0 and a fraction in [0, 1]"
            )),
            None => Ok(Self(points)),
        }
    }
}

impl From<Curve> for Vec<[f64; 2]> {
    fn from(curve: Curve) -> Self {
        curve.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolates_between_its_points_and_holds_the_ends() {
        let curve = Curve::try_from(vec![[0.0, 0.9], [0.1, 0.5], [1.0, 0.0]]).unwrap();
        for (error, expected) in
            [(0.0, 0.9), (0.05, 0.7), (0.1, 0.5), (0.55, 0.25), (1.0, 0.0), (9.0, 0.0)]
        {
            assert!((curve.fraction(error) - expected).abs() < 1e-12, "{error}");
        }
        assert_eq!(curve.fraction(f64::NAN), 0.0);
        assert_eq!(curve.fraction(f64::INFINITY), 0.0);
    }

    #[test]
    fn refuses_what_is_not_monotone_or_out_of_range() {
        for points in [
            vec![],
            vec![[0.0, 0.5], [0.1, 0.6]],
            vec![[0.1, 0.5], [0.1, 0.4]],
            vec![[0.0, 1.5]],
            vec![[-1.0, 0.5]],
            vec![[f64::NAN, 0.5], [1.0, 0.0]],
        ] {
            assert!(Curve::try_from(points.clone()).is_err(), "{points:?}");
        }
    }
}
