//! How much of the light most lit and most dark points have, where shadows are wrong (parts 1.4 and 2.5).

use super::price::{self, Price, PriceClass};

/// The mistake of shadows that are not black.
pub const LEAVES_LIGHT: &str = "shadows leave some light";
/// The mistake of lit points that are darker with shadows on.
pub const LOSES_LIGHT: &str = "lit points lose some light";
/// The mistake of lit points that are brighter with shadows on.
pub const GAINS_LIGHT: &str = "lit points get too much light";

/// A visibility that differs from another by less than this is the same.
const SAME: f64 = 0.02;

/// The median visibility of the points that the light reaches, and of those that it does not: 1 and 0 where shadows
/// are right.
#[derive(Clone, Copy, Debug)]
pub struct Levels {
    lit: f64,
    dark: f64,
}

impl Levels {
    /// Of points: whether the light reaches each, and what is left of it there. What is not finite says nothing.
    pub fn of(points: impl Iterator<Item = (bool, f64)>) -> Self {
        let (lit, dark): (Vec<_>, Vec<_>) = points.partition(|(lit, _)| *lit);
        let level = |points: Vec<(bool, f64)>| median(points.into_iter().map(|(_, light)| light));
        Self { lit: level(lit).unwrap_or_default(), dark: level(dark).unwrap_or_default() }
    }

    /// The price, if one constant changes all lit points, or all dark ones. `residual` is asked with what lit and what
    /// dark points have, and returns the fractions of both that have not, added up.
    pub fn priced(self, price: Price, residual: impl Fn(f64, f64) -> f64) -> Price {
        let price = match self.dark > 0.0 && self.dark < 1.0 {
            true => {
                let residual = price::fading(self.dark) + residual(1.0, self.dark);
                price.or(LEAVES_LIGHT, PriceClass::Slip, residual)
            }
            false => price,
        };
        // As much too bright costs what as much too dark does.
        let (name, kept) = match self.lit < 1.0 {
            true => (LOSES_LIGHT, self.lit),
            false => (GAINS_LIGHT, 1.0 / self.lit),
        };
        match kept > 0.0 && kept < 1.0 {
            true => price.or(
                name,
                PriceClass::Slip,
                price::fading(1.0 - kept) + residual(self.lit, 0.0),
            ),
            false => price,
        }
    }
}

/// What lit points get that get the wrong light, in words that follow "get".
pub fn what_lit_get(wrong: impl Iterator<Item = f64>) -> String {
    match median(wrong) {
        Some(light) if (light - 1.0).abs() < SAME => "light of another color".into(),
        Some(light) if light >= SAME => format!("{light:.2} of it"),
        _ => "none".into(),
    }
}

/// The median of what is finite.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The error of points that all have these shares of the light, half of them lit.
    fn error(lit: f64, dark: f64) -> (f64, String) {
        let points = [(true, lit), (true, lit), (false, dark), (false, dark)];
        let residual = |lit: f64, dark: f64| {
            let off = |(is_lit, light): &&(bool, f64)| {
                (light - if *is_lit { lit } else { dark }).abs() > SAME
            };
            points.iter().filter(off).count() as f64 / 2.0
        };
        let price = Levels::of(points.into_iter()).priced(Price::of_raw(1.0), residual);
        (price.error, price.name())
    }

    #[test]
    fn one_constant_is_a_slip_whichever_way() {
        let slip = PriceClass::Slip.price();
        for (lit, dark, name) in [
            (0.8, 0.0, LOSES_LIGHT),
            (1.125, 0.0, GAINS_LIGHT),
            (9.0 / 4.0, 0.0, GAINS_LIGHT),
            (1.0, 0.3, LEAVES_LIGHT),
        ] {
            let (error, found) = error(lit, dark);
            assert_eq!(found, name);
            assert!((slip..1.5 * slip).contains(&error), "{lit} {dark}: {error}");
        }
        // Next to nothing is left.
        assert!(error(0.01, 0.0).0 > 0.5);
        assert!(error(1.0, 0.99).0 > 0.5);
    }

    #[test]
    fn words_say_what_is_found() {
        assert_eq!(what_lit_get([0.0, 0.0, 0.5].into_iter()), "none");
        assert_eq!(what_lit_get([1.125, 1.125].into_iter()), "1.12 of it");
        assert_eq!(what_lit_get([1.0].into_iter()), "light of another color");
        assert_eq!(what_lit_get([f64::NAN].into_iter()), "none");
    }
}
