//! Part 1.3: whether an integrator evaluates the BSDF of the surface that the ray meets.

use basecode::Frame;

use super::{RayBatch, STRAY_FRACTION};
use crate::convention::Convention;
use crate::price::PriceClass;
use crate::{Check, CheckId, Measure, RuleId, Verdict};
use imaging::ratio::triple;

/// The check.
pub const ID: CheckId = CheckId::RadianceMaterial;
/// Largest relative difference of a right answer: frames in f32, raised to high exponents.
const RELATIVE: f64 = 0.02;
/// The same, as a fraction of the batch's mean radiance.
const OF_MEAN: f64 = 1e-3;
/// A ray of a batch, with what the renderer's own BSDF answers where it ends.
pub type OwnValue = (usize, [f32; 3]);

/// Judges radiance along lit rays without shadows (`radiance`, by ray) by the renderer's own BSDFs,
/// right or wrong: their values, cosine included, times I / r^2, under any convention.
///
/// Errors of the light belong to another check: see `leave_unjudged`.
pub fn judge_material(batch: &RayBatch, own: &[OwnValue], radiance: &[[f32; 3]]) -> Check {
    let not_judged = |summary: &str| Check::new(ID, &batch.scene, Verdict::NotJudged, summary);
    if own.is_empty() {
        return not_judged("no lit ray ends on a surface of one color");
    }
    let sum: f64 = own.iter().flat_map(|(ray, _)| radiance[*ray]).map(f64::from).sum();
    if sum.is_nan() || sum <= 0.0 {
        return not_judged("radiance along rays is black, or no number");
    }
    let mean = sum / (3 * own.len()) as f64;
    // How many rays are wrong under a convention, and the first of them.
    let wrong = |convention: &Convention| {
        let mut wrong = own.iter().filter(|(ray, value)| {
            let expected = expected(batch, *ray, *value, convention);
            let found = radiance[*ray].map(f64::from);
            !found.iter().zip(expected).all(|(found, expected)| {
                let both_broken = !found.is_finite() && !expected.is_finite();
                both_broken
                    || (found - expected).abs() <= RELATIVE * expected.abs() + OF_MEAN * mean
            })
        });
        let first =
            wrong.next().map(|(ray, value)| (*ray, expected(batch, *ray, *value, convention)));
        (wrong.count() + usize::from(first.is_some()), first)
    };
    let unit = Convention::all().into_iter().filter(|convention| convention.long_wi.is_none());
    let Some((wrong, first)) =
        unit.map(|convention| wrong(&convention)).min_by_key(|found| found.0)
    else {
        return not_judged("there is no convention");
    };
    let name = "rays that are not what their surface's own BSDF makes of the light (fraction)";
    let measure = Measure::at_most(
        RuleId::RaysMaterial,
        name,
        wrong as f64 / own.len() as f64,
        STRAY_FRACTION,
    );
    let check = match first.filter(|_| !measure.passed) {
        None => {
            let summary = format!(
                "radiance is the surface's BSDF times the incident light along {} rays",
                own.len()
            );
            Check::new(ID, &batch.scene, Verdict::Pass, summary)
        }
        Some((ray, expected)) => {
            let p = batch.points[ray].position;
            let summary = format!(
                "{wrong} of {} rays are not what the BSDF of their surface makes of the light; first at ({:.3}, \
                 {:.3}, {:.3}): expected {}, found {}",
                own.len(),
                p.x,
                p.y,
                p.z,
                triple(expected.map(|v| v as f32)),
                triple(radiance[ray]),
            );
            let check = Check::new(ID, &batch.scene, Verdict::Fail, summary);
            Check { error: PriceClass::Slip.price(), ..check }
                .with_hint("is it the material of the surface that the ray meets?")
        }
    };
    Check { measures: vec![measure], ..check }
}

/// Whether radiance along lit rays is what the renderer's own BSDFs, right or wrong, make of the light: their values,
/// cosine included, times I / r^2. For an integrator that asks the scene for none, and so keeps no convention.
pub fn is_of_own_bsdfs(batch: &RayBatch, own: &[OwnValue], radiance: &[[f32; 3]]) -> bool {
    let same = |found: f32, expected: f64| {
        let both_broken = !found.is_finite() && !expected.is_finite();
        both_broken || (f64::from(found) - expected).abs() <= super::RELATIVE * expected.abs()
    };
    let is_right = |(ray, value): &&OwnValue| {
        let expected = batch.unshadowed(*ray, value.map(f64::from));
        radiance[*ray].iter().zip(expected).all(|(found, expected)| same(*found, expected))
    };
    let right = own.iter().filter(is_right).count();
    (own.len() - right) as f64 <= STRAY_FRACTION * own.len() as f64
}

/// Radiance of a right integrator that asks the BSDF, whose value is `own`.
fn expected(batch: &RayBatch, ray: usize, own: [f32; 3], convention: &Convention) -> [f64; 3] {
    let cos_i = f64::from(Frame::cos_theta(batch.points[ray].wi));
    let integrator = convention.integrator();
    let factor = integrator.factor[0] * cos_i.powf(integrator.cos_i[0] - 1.0);
    batch.unshadowed(ray, own.map(|value| factor * f64::from(value)))
}

/// Where the light is wrong, the material is not judged: on any scene, since light and material are
/// the integrator's on all.
pub fn leave_unjudged(checks: &mut [Check]) {
    let of = |id: CheckId, verdict| {
        checks
            .iter()
            .any(|check| check.id == id && check.verdict == verdict && check.convention.is_empty())
    };
    let light_is_wrong = of(CheckId::RadianceLit, Verdict::Fail);
    if !light_is_wrong {
        return;
    }
    for check in checks.iter_mut().filter(|check| check.id == ID && check.verdict == Verdict::Fail)
    {
        check.verdict = Verdict::NotJudged;
        check.summary = format!("radiance is wrong under other BSDFs too ({})", check.summary);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::batch;
    use super::*;

    /// The renderer's own BSDF where each lit ray ends: another on each surface.
    fn own(batch: &RayBatch) -> Vec<OwnValue> {
        let value = |ray: usize| [0.2, 0.1 + 0.7 * (ray as f32 * 0.29).fract(), 0.5];
        (0..batch.lit).map(|ray| (ray, value(ray))).collect()
    }

    /// Judges radiance that is what `change` makes of the value at each ray's end, times I / r^2.
    fn judge(change: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> Check {
        let batch = batch();
        let own = own(&batch);
        let mut radiance = vec![[0.0; 3]; batch.points.len()];
        for (ray, value) in &own {
            let value = change(*ray, value.map(f64::from));
            radiance[*ray] = batch.unshadowed(*ray, value).map(|v| v as f32);
        }
        judge_material(&batch, &own, &radiance)
    }

    #[test]
    fn what_the_surfaces_own_bsdf_answers_is_right_under_any_convention() {
        let cos_i = |ray: usize| f64::from(Frame::cos_theta(batch().points[ray].wi));
        for right in [
            judge(|_, value| value),
            judge(|ray, value| value.map(|v| v * cos_i(ray))),
            judge(|_, value| value.map(|v| v / std::f64::consts::PI)),
        ] {
            assert_eq!((right.verdict, right.error), (Verdict::Pass, 0.0), "{}", right.summary);
        }
    }

    #[test]
    fn another_surfaces_bsdf_is_a_slip_and_the_first_ray_is_told() {
        let of = own(&batch());
        let next = |ray: usize| of[(ray + 1) % of.len()].1.map(f64::from);
        let wrong = judge(|ray, _| next(ray));
        assert_eq!(wrong.verdict, Verdict::Fail);
        assert_eq!(wrong.error, PriceClass::Slip.price());
        assert!(wrong.summary.contains("of 40 rays"), "{}", wrong.summary);
        // One ray of forty is more than a seam explains.
        assert_eq!(judge(|ray, own| if ray == 7 { next(7) } else { own }).verdict, Verdict::Fail);
        assert_eq!(judge(|ray, own| own.map(|v| if ray == 7 { f64::NAN } else { v })).verdict, {
            Verdict::NotJudged
        });
    }

    #[test]
    fn an_integrator_without_bsdfs_of_the_scene_may_hold_the_same_ones() {
        let batch = batch();
        let own = own(&batch);
        let radiance = |factor: f64| -> Vec<[f32; 3]> {
            let value = |(ray, value): &OwnValue| {
                batch.unshadowed(*ray, value.map(|v| factor * f64::from(v))).map(|v| v as f32)
            };
            own.iter().map(value).collect()
        };
        assert!(is_of_own_bsdfs(&batch, &own, &radiance(1.0)));
        // No convention excuses it, and a lobe of n + 1 is .99 of one of n + 2 where n is 98.
        assert!(!is_of_own_bsdfs(&batch, &own, &radiance(std::f64::consts::PI)));
        assert!(!is_of_own_bsdfs(&batch, &own, &radiance(0.99)));
    }

    #[test]
    fn nothing_is_said_of_black_or_where_the_light_is_wrong() {
        assert_eq!(judge(|_, _| [0.0; 3]).verdict, Verdict::NotJudged);
        let none = judge_material(&batch(), &[], &[]);
        assert_eq!(none.verdict, Verdict::NotJudged);
        let wrong = || Check::new(ID, "s", Verdict::Fail, "");
        let lit = |verdict| Check::new(CheckId::RadianceLit, "other", verdict, "");
        for (light, verdict) in
            [(Verdict::Fail, Verdict::NotJudged), (Verdict::Pass, Verdict::Fail)]
        {
            let mut checks = [wrong(), lit(light)];
            leave_unjudged(&mut checks);
            assert_eq!(checks[0].verdict, verdict);
        }
    }
}
