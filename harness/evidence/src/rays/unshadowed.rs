//! Part 1.3: radiance without shadows.

use super::{RELATIVE, RayBatch, STRAY_FRACTION};
use crate::answers::{Answers, Change};
use crate::convention::Convention;
use crate::price::{self, PriceClass};
use crate::shading::Shading;
use crate::{Check, CheckId, Measure, RuleId, Verdict};
use imaging::ratio::{ratio_name, triple};

/// The answers to a batch under one witness, shadows off.
pub struct Unshadowed<'a> {
    /// What the witness is, for reports: `constant`, `function of wi`...
    pub witness: &'a str,
    /// Radiance along lit ray `index` of an integrator that lights so.
    pub of: &'a dyn Fn(usize, &Shading) -> [f64; 3],
    /// Radiance along every ray of the batch.
    pub values: &'a [[f32; 3]],
    /// Whether it is black below the surface.
    pub black_below: bool,
}

/// Whether radiance is right along all rays but strays, under a convention.
pub fn passes_unshadowed(
    batch: &RayBatch,
    answers: &[Unshadowed],
    convention: &Convention,
) -> bool {
    let right = convention.integrator();
    // Of most conventions the first rays tell.
    let strays = (STRAY_FRACTION * batch.lit as f64) as usize;
    let passes = |answer: &Unshadowed| {
        let is_wrong =
            |(index, value): &(usize, &[f32; 3])| excess(value, (answer.of)(*index, &right)) > 1.0;
        let rays = answer.values[..batch.lit].iter().enumerate();
        rays.filter(is_wrong).nth(strays).is_none()
    };
    batch.lit > 0 && answers.iter().all(passes)
}

/// The largest difference of a channel, over the one that is allowed.
fn excess(found: &[f32; 3], expected: [f64; 3]) -> f64 {
    let of = |c: usize| {
        apart(found[c], expected[c]) / (RELATIVE * expected[c].abs()).max(f64::MIN_POSITIVE)
    };
    (0..3).map(of).fold(0.0, f64::max)
}

/// The difference of a channel; what is not finite is far off. Witnesses may be negative, as where wi has the length r.
fn apart(found: f32, expected: f64) -> f64 {
    if found.is_finite() { (f64::from(found) - expected).abs() } else { 10.0 * expected.abs() }
}

/// Part 1.3: judges unshadowed radiance along the lit rays and the black ones, the worst
/// witness counting.
pub fn judge_unshadowed(
    batch: &RayBatch,
    answers: &[Unshadowed],
    convention: &Convention,
    changes: &[Change],
) -> Check {
    let id = CheckId::RadianceLit;
    let black = batch.rays.len() - batch.points.len();
    if batch.lit + black == 0 || answers.is_empty() {
        let summary = "the scene has no lit ray away from edges".to_owned();
        return Check::new(id, &batch.scene, Verdict::NotJudged, summary);
    }
    let right = convention.integrator();
    let mut worst: Option<Difference> = None;
    let mut measures = Vec::new();
    for answer in answers.iter().filter(|_| batch.lit > 0) {
        let difference = Difference::of(batch, answer, &right);
        measures.push(Measure::at_most(
            RuleId::RaysLit,
            format!("rays wrong with the test BSDF \"{}\" (fraction)", answer.witness),
            difference.wrong,
            STRAY_FRACTION,
        ));
        if worst.as_ref().is_none_or(|worst| difference.error > worst.error) {
            worst = Some(difference);
        }
    }
    let lit_is_right = measures.iter().all(|measure| measure.passed);
    let below = answers.iter().filter(|answer| answer.black_below);
    let shining = below.map(|answer| shining(batch, answer)).max().unwrap_or_default();
    if black > 0 {
        let fraction = shining as f64 / black as f64;
        let name = "rays that must be black and are not (fraction)";
        measures.push(Measure::at_most(RuleId::RaysBlack, name, fraction, STRAY_FRACTION));
    }
    let passed = measures.iter().all(|measure| measure.passed);
    let mut check = match worst {
        _ if passed => {
            let summary = format!("unshadowed radiance is right along {} rays", batch.lit);
            Check::new(id, &batch.scene, Verdict::Pass, summary)
        }
        Some(worst) if !lit_is_right => {
            let price = price_of(batch, answers, &right, changes, worst.error);
            measures.extend(price.measure());
            let check = Check::new(id, &batch.scene, Verdict::Fail, worst.summary);
            Check { error: price.error, mistake: price.name(), ..check }.with_hint(worst.hint)
        }
        _ => Check { error: 0.0, ..Check::new(id, &batch.scene, Verdict::Fail, String::new()) },
    };
    if !passed && lit_is_right {
        check.summary = format!(
            "{shining} of {black} rays that meet nothing, or a surface from behind, are not black"
        );
    }
    if shining as f64 > STRAY_FRACTION * black as f64 {
        check.error = check.error.max(PriceClass::Slip.price());
    }
    check.measures = measures;
    check
}

/// How many rays that must be black are not.
fn shining(batch: &RayBatch, answer: &Unshadowed) -> usize {
    let black = &answer.values[batch.points.len()..];
    black.iter().filter(|value| **value != [0.0; 3]).count()
}

/// The price of the answers under all witnesses together: one mistake must explain all of them.
fn price_of(
    batch: &RayBatch,
    answers: &[Unshadowed],
    right: &Shading,
    changes: &[Change],
    raw: f64,
) -> price::Price {
    let found: Vec<[f32; 3]> =
        answers.iter().flat_map(|answer| answer.values[..batch.lit].to_vec()).collect();
    let of = |index: usize, shading: &Shading| {
        let (answer, ray) = (&answers[index / batch.lit], index % batch.lit);
        (answer.of)(ray, &shading.over(right))
    };
    let sum: f64 = {
        let sizes = |index| of(index, &Shading::default()).map(f64::abs).iter().sum::<f64>();
        (0..found.len()).map(sizes).sum()
    };
    let mean = (sum / (3 * found.len()) as f64).max(f64::MIN_POSITIVE);
    let group = |index: usize| index / batch.lit;
    let unit = |_| mean;
    let mut changes = changes.to_vec();
    changes.extend(light_elsewhere(batch, &answers[0], right));
    let answers = Answers {
        found: &found,
        of: &of,
        unit: &unit,
        group: &group,
        relative: RELATIVE,
        changes: &changes,
    };
    answers.price(Some(raw))
}

/// The mistake of a light in another place.
pub(super) const ELSEWHERE: &str = "the light stands elsewhere";

/// The light in the place that the radiance under a constant BSDF tells, as a mistake.
fn light_elsewhere(batch: &RayBatch, constant: &Unshadowed, right: &Shading) -> Option<Change> {
    let ratio = |ray: usize| {
        let found: f64 = constant.values[ray].iter().map(|v| f64::from(*v)).sum();
        let expected: f64 = (constant.of)(ray, right).iter().sum();
        let ratio = expected / found;
        (ratio.is_finite() && ratio > 0.0).then_some((ray, ratio))
    };
    let ratios: Vec<(usize, f64)> = (0..batch.lit).filter_map(ratio).collect();
    let offset = batch.light_by_distances(&ratios)? - batch.light;
    Some(Change::slip(ELSEWHERE, Shading { light_offset: offset.into(), ..Shading::default() }))
}

/// How one witness' answers differ from the right ones.
struct Difference {
    /// Fraction of the rays that differ by more than the tolerance.
    wrong: f64,
    /// Sum of differences over sum of expected values.
    error: f64,
    summary: String,
    hint: String,
}

impl Difference {
    fn of(batch: &RayBatch, answer: &Unshadowed, right: &Shading) -> Self {
        let (mut wrong, mut sum, mut total) = (0usize, 0.0, 0.0);
        let mut worst = (0.0, 0, [0.0; 3]);
        let mut ratios = Vec::new();
        for (index, value) in answer.values[..batch.lit].iter().enumerate() {
            let expected = (answer.of)(index, right);
            for (found, expected) in value.iter().zip(expected) {
                sum += apart(*found, expected);
                total += expected.abs();
                if expected > 0.0 && found.is_finite() {
                    ratios.push(f64::from(*found) / expected);
                }
            }
            let excess = excess(value, expected);
            wrong += usize::from(excess > 1.0);
            if excess > worst.0 {
                worst = (excess, index, expected);
            }
        }
        let (_, index, expected) = worst;
        let found = answer.values[index];
        let p = batch.points[index].position;
        Self {
            wrong: wrong as f64 / batch.lit as f64,
            error: sum / total,
            summary: format!(
                "unshadowed radiance is wrong along {wrong} of {} rays with a test BSDF in place of yours, \"{}\"; \
                 worst at ({:.3}, {:.3}, {:.3}): expected {}, found {}",
                batch.lit,
                answer.witness,
                p.x,
                p.y,
                p.z,
                triple(expected.map(|v| v as f32)),
                triple(found)
            ),
            hint: factor_hint(&mut ratios),
        }
    }
}

/// Names the factor between actual and expected, when it is constant. What else may be wrong is told
/// from all scenes together, by the diagnosis.
fn factor_hint(ratios: &mut [f64]) -> String {
    if ratios.is_empty() {
        return "radiance is not a number".into();
    }
    ratios.sort_by(f64::total_cmp);
    let at = |fraction: f64| ratios[((ratios.len() - 1) as f64 * fraction) as usize];
    let (median, width) = (at(0.5), at(0.99) - at(0.01));
    if median.abs() < 1e-6 && width < 1e-6 {
        return "radiance is 0 where the light is in sight".into();
    }
    if width > 4e-3 * median.abs() || (median - 1.0).abs() < 4e-3 {
        return String::new();
    }
    match ratio_name(median) {
        Some(factor) => format!("off by a constant factor: {factor}"),
        None => format!("off by a constant factor of {median:.4}"),
    }
}
