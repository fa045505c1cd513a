//! Witness BSDFs: known functions of the host's in place of a renderer's BSDFs, so that an
//! integrator can be judged without them.
//!
//! A correct integrator's radiance under a witness is exactly V I / r^2 times its value. The
//! tangents of a local frame are arbitrary, so a witness depends only on what every correct frame
//! agrees on: the two cosines and the angle between `wi` and `wo`.

use basecode::Vec3;
use serde::{Deserialize, Serialize};

/// Which BSDF an integrator meets. All values include the cosine [sr^-1] and, but for `Flat`, are zero unless `wi` and
/// `wo` both lie above the surface; there they are smooth, and positive if the constant is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Witness {
    /// The renderer's own.
    True,
    /// This value wherever both directions are above the surface.
    Constant([f32; 3]),
    /// This value everywhere, below the surface too: for visibility, whatever the frame.
    Flat([f32; 3]),
    /// A function of cos theta_i alone, another for each channel.
    OfWi,
    /// A function of cos theta_o alone, another for each channel.
    OfWo,
    /// A function of the angle between `wi` and `wo` alone, another for each channel.
    OfAngle,
}

/// What a witness sees of a call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WitnessQuery {
    /// Direction toward the light, local shading frame.
    pub wi: [f32; 3],
    /// Direction toward the viewer, local shading frame.
    pub wo: [f32; 3],
}

impl WitnessQuery {
    /// The larger | |w| - 1 | of both directions; infinite when one is not finite.
    pub fn norm_error(&self) -> f32 {
        let error = |w: [f32; 3]| {
            let error = (Vec3::from(w).length() - 1.0).abs();
            if error.is_finite() { error } else { f32::INFINITY }
        };
        error(self.wi).max(error(self.wo))
    }
}

impl Witness {
    /// The witness' value; none for [`Witness::True`].
    pub fn value(&self, query: &WitnessQuery) -> Option<[f32; 3]> {
        let WitnessQuery { wi, wo } = *query;
        if let Self::Flat(value) = self {
            return Some(*value);
        }
        if *self == Self::True {
            return None;
        }
        // Not `<= 0`: a direction that is not a number is not above the surface either.
        if !(wi[2] > 0.0 && wo[2] > 0.0) {
            return Some([0.0; 3]);
        }
        Some(match self {
            Self::True => return None,
            Self::Constant(value) | Self::Flat(value) => *value,
            Self::OfWi => polynomial(wi[2]),
            Self::OfWo => polynomial(wo[2]),
            // From [-1, 1] to [0, 1].
            Self::OfAngle => polynomial(0.5 + 0.5 * dot(wi, wo)),
        })
    }

    /// The same for directions in single precision; black for [`Witness::True`].
    pub fn of_directions(&self, wi: Vec3, wo: Vec3) -> [f64; 3] {
        let query = WitnessQuery { wi: wi.into(), wo: wo.into() };
        self.value(&query).unwrap_or_default().map(f64::from)
    }
}

/// Three functions on [0, 1] between 0.1 and 1.3 that differ in height and slope, so that a
/// swapped argument or channel changes the result by tens of percent.
fn polynomial(x: f32) -> [f32; 3] {
    [0.1 + 0.9 * x, 0.2 + 0.6 * x * x, 1.3 - 0.8 * x]
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: [f32; 3] = [0.0, 0.0, 1.0];
    const WITNESSES: [Witness; 4] =
        [Witness::Constant([1.0, 2.0, 3.0]), Witness::OfWi, Witness::OfWo, Witness::OfAngle];

    #[test]
    fn witnesses_are_zero_below_the_surface_and_positive_above() {
        for witness in WITNESSES {
            for (wi, wo, lit) in [
                (UP, UP, true),
                ([0.6, 0.0, 0.8], [-0.8, 0.0, 0.6], true),
                ([0.0, 0.0, -1.0], UP, false),
                (UP, [0.6, 0.0, -0.8], false),
                ([f32::NAN; 3], UP, false),
            ] {
                let value = witness.value(&WitnessQuery { wi, wo }).unwrap();
                assert!(value.iter().all(|v| (*v > 0.0) == lit), "{witness:?} {wi:?} {wo:?}");
            }
        }
    }

    #[test]
    fn witnesses_do_not_depend_on_the_tangents_and_do_on_their_argument() {
        let turn = |[x, y, z]: [f32; 3]| [0.6 * x - 0.8 * y, 0.8 * x + 0.6 * y, z];
        let (wi, wo) = ([0.6, 0.0, 0.8], [0.0, 0.8, 0.6]);
        for witness in &WITNESSES[1..] {
            let plain = witness.value(&WitnessQuery { wi, wo }).unwrap();
            let turned = witness.value(&WitnessQuery { wi: turn(wi), wo: turn(wo) }).unwrap();
            let swapped = witness.value(&WitnessQuery { wi: wo, wo: wi }).unwrap();
            for channel in 0..3 {
                assert!((plain[channel] - turned[channel]).abs() < 1e-6, "{witness:?}");
            }
            assert_eq!(plain == swapped, *witness == Witness::OfAngle);
        }
    }
}
