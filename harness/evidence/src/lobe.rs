//! The lobe of a BSDF that is wrong, along the plane of one `wo` and the normal, where it is furthest off.

use renderer_api as api;

use super::Lobe;
use imaging::ratio::triple;

/// A direction of the local frame.
type Direction = [f32; 3];

/// One answer, as the lobe sees it.
pub(super) struct Answer {
    /// The material that was asked about.
    pub material: api::MaterialValue,
    /// Toward the viewer.
    pub wo: Direction,
    /// Toward the light.
    pub wi: Direction,
    /// Mean of the channels that is right [sr^-1].
    pub expected: f64,
    /// Mean of the channels that was found.
    pub found: f64,
}

/// Directions this far out of the plane, as a sine, still lie in it.
const IN_PLANE: f32 = 1e-3;
/// The expected curve has a point so many degrees apart.
const STEP_DEG: f64 = 1.0;
/// From this exponent on a lobe is so narrow and high that its logarithm is drawn.
const HIGH: f32 = 30.0;
/// At least so many answers make a lobe.
const ENOUGH: usize = 6;

/// The lobe with the largest difference among the answers; `right` is the right value for a material, `wo` and `wi`.
/// None where no plane was asked about.
pub(super) fn worst(
    answers: &[Answer],
    right: &dyn Fn(&api::MaterialValue, Direction, Direction) -> f64,
) -> Option<Lobe> {
    let same = |a: &Answer, b: &Answer| a.wo == b.wo && fields(&a.material) == fields(&b.material);
    let mut planes: Vec<(f64, Vec<&Answer>)> = Vec::new();
    for answer in answers.iter().filter(|a| a.wo[2] > 0.1 && a.wo[2] < 0.99) {
        if angle_deg(answer.wo, answer.wi).is_none() {
            continue;
        }
        let off = (answer.found - answer.expected).abs();
        let off = if off.is_finite() { off } else { f64::MAX / 1e6 };
        match planes.iter_mut().find(|(_, plane)| plane.first().is_some_and(|a| same(a, answer))) {
            Some((sum, plane)) => {
                *sum += off;
                plane.push(answer);
            }
            None => planes.push((off, vec![answer])),
        }
    }
    let relative = |(sum, plane): &(f64, Vec<&Answer>)| {
        sum / plane.iter().map(|a| a.expected).sum::<f64>().max(f64::MIN_POSITIVE)
    };
    planes.retain(|(sum, plane)| plane.len() >= ENOUGH && *sum > 0.0);
    let (_, mut plane) = planes.into_iter().max_by(|a, b| relative(a).total_cmp(&relative(b)))?;
    let first = *plane.first()?;
    plane.sort_by(|a, b| {
        let angle = |answer: &Answer| angle_deg(answer.wo, answer.wi).unwrap_or_default();
        angle(a).total_cmp(&angle(b))
    });
    let point = |a: &&Answer| Some([angle_deg(a.wo, a.wi)?, a.found]);
    let steps = (180.0 / STEP_DEG) as i32;
    let expected = (0..=steps).map(|step| {
        let angle = -90.0 + STEP_DEG * f64::from(step);
        [angle, right(&first.material, first.wo, direction(first.wo, angle))]
    });
    let phong = first.material.model == api::MATERIAL_PHONG;
    Some(Lobe {
        material: describe(&first.material),
        wo_deg: f64::from(first.wo[2].clamp(-1.0, 1.0).acos().to_degrees()),
        log: phong && first.material.exponent >= HIGH,
        expected: expected.collect(),
        found: plane.iter().filter_map(point).collect(),
    })
}

fn fields(m: &api::MaterialValue) -> (u32, [f32; 3], [f32; 3], f32) {
    (m.model, m.diffuse, m.specular, m.exponent)
}

fn describe(m: &api::MaterialValue) -> String {
    if m.model == api::MATERIAL_PHONG {
        format!("kd {}, ks {}, n {}", triple(m.diffuse), triple(m.specular), m.exponent)
    } else {
        format!("kd {}", triple(m.diffuse))
    }
}

/// The part of `wo` along the surface, of unit length.
fn tangent(wo: Direction) -> [f32; 2] {
    let length = wo[0].hypot(wo[1]).max(f32::MIN_POSITIVE);
    [wo[0] / length, wo[1] / length]
}

/// The angle of `wi` from the normal, positive across from `wo`; none when it lies out of the plane or below.
fn angle_deg(wo: Direction, wi: Direction) -> Option<f64> {
    let [s, t] = tangent(wo);
    let (along, aside) = (wi[0] * s + wi[1] * t, wi[1] * s - wi[0] * t);
    let inside = wi[2] > 0.0 && aside.abs() < IN_PLANE;
    inside.then(|| f64::from((-along).atan2(wi[2]).to_degrees()))
}

/// The direction at an angle.
fn direction(wo: Direction, angle_deg: f64) -> Direction {
    let [s, t] = tangent(wo);
    let (sin, cos) = (angle_deg.to_radians() as f32).sin_cos();
    [-sin * s, -sin * t, cos]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plane_that_is_furthest_off_is_drawn() {
        let material = |exponent| api::MaterialValue {
            model: api::MATERIAL_PHONG,
            diffuse: [0.0; 3],
            specular: [0.5; 3],
            exponent,
        };
        let right =
            |m: &api::MaterialValue, _: Direction, wi: Direction| f64::from(wi[2] * m.exponent);
        let mut answers = Vec::new();
        for (exponent, factor) in [(2.0, 1.01), (50.0, 1.5)] {
            for (azimuth, cos) in [(0.3f32, 0.8f32), (1.9, 0.4)] {
                let sin = (1.0 - cos * cos).sqrt();
                let wo = [sin * azimuth.cos(), sin * azimuth.sin(), cos];
                for angle in [-80.0, -40.0, -10.0, 0.0, 20.0, 60.0, 75.0] {
                    let wi = direction(wo, angle);
                    assert!((angle_deg(wo, wi).unwrap() - angle).abs() < 1e-3);
                    let expected = right(&material(exponent), wo, wi);
                    let off = if cos == 0.4 { factor } else { 1.0 };
                    answers.push(Answer {
                        material: material(exponent),
                        wo,
                        wi,
                        expected,
                        found: off * expected,
                    });
                }
                // Out of the plane, and below.
                for wi in [[wo[1], -wo[0], 0.5], [0.0, 0.0, -1.0]] {
                    answers.push(Answer {
                        material: material(exponent),
                        wo,
                        wi,
                        expected: 1.0,
                        found: 9e9,
                    });
                }
            }
        }
        let lobe = worst(&answers, &right).unwrap();
        assert!(lobe.log && lobe.material.ends_with("n 50"));
        assert!((lobe.wo_deg - 66.42).abs() < 0.01);
        assert_eq!((lobe.found.len(), lobe.expected.len()), (7, 181));
        assert!(lobe.found.is_sorted_by(|a, b| a[0] < b[0]));
        let [angle, value] = lobe.found[0];
        assert!((angle + 80.0).abs() < 1e-3 && (value - 1.5 * lobe.expected[10][1]).abs() < 1e-3);

        answers.iter_mut().for_each(|answer| answer.found = answer.expected);
        assert_eq!(worst(&answers, &right), None);
    }
}
