//! Parts 1.3 and 1.4: radiance along rays of the host's choice, under witness BSDFs.
//!
//! Under a witness a right integrator answers exactly V I / r^2 w, so that a fault in a BSDF is
//! not paid twice. Only rays that hang on nothing are asked: away from every edge, both directions
//! well above the surface, the light in sight (or out of it) whatever the shadow ray's epsilon.

use basecode::{Frame, Ray, Vec3};

use super::{Check, Measure, Verdict};
use crate::expected::{SurfaceBuffer, SurfacePoint};
use crate::imaging::ratio::ratio_name;
use crate::imaging::reference::RegionMask;

/// Directions closer to the surface than this cosine are left out.
const MIN_COSINE: f32 = 0.05;
/// Largest relative difference of a right answer: f32 positions and frames in any order.
const RELATIVE: f64 = 3e-3;
/// So many of the rays may still differ: a student's own intersection code meets other triangles
/// along seams that no mask knows.
const STRAY_FRACTION: f64 = 2e-3;
/// So many of the lit rays must not be black without shadows.
const LEAST_KNOWN: f64 = 0.25;
/// A visibility below this is dark, above one minus it lit; anything between is neither.
const HALF_LIGHT: f64 = 0.02;

/// The rays of one scene, and what is right along them.
#[derive(Clone, Debug, Default)]
pub struct RayBatch {
    /// The scene's name, for reports.
    pub scene: String,
    /// The rays, lit ones first.
    pub rays: Vec<Ray>,
    /// The pixel of the small film that each goes through, row by row.
    pub pixels: Vec<usize>,
    /// What each ray meets.
    pub points: Vec<SurfacePoint>,
    /// How many of the rays end on lit points; the others end in shadow.
    pub lit: usize,
    /// Radiant intensity of the light [W sr^-1].
    pub intensity: Vec3,
}

impl RayBatch {
    /// Chooses the rays of a surface buffer; `mask` is that of the same film, with shadows.
    pub fn new(scene: &str, surface: &SurfaceBuffer, mask: &RegionMask, intensity: Vec3) -> Self {
        let (mut lit, mut dark) = (Vec::new(), Vec::new());
        for (pixel, ((ray, point), &value)) in surface.pixels.iter().zip(&mask.pixels).enumerate() {
            let Some(point) = point else { continue };
            let clear_of_edges = value & (RegionMask::EDGE | RegionMask::EMITTER) == 0;
            let above = |w| Frame::cos_theta(w) > MIN_COSINE;
            if clear_of_edges && above(point.wo) && above(point.wi) {
                let list = if mask.region(value).lit { &mut lit } else { &mut dark };
                list.push((pixel, (*ray, *point)));
            }
        }
        let count = lit.len();
        let (pixels, (rays, points)) = lit.into_iter().chain(dark).unzip();
        Self { scene: scene.to_owned(), rays, pixels, points, lit: count, intensity }
    }

    /// Unshadowed radiance along ray `index` when the BSDF (cosine included) is `bsdf`.
    fn unshadowed(&self, index: usize, bsdf: [f64; 3]) -> [f64; 3] {
        let r = f64::from(self.points[index].distance);
        std::array::from_fn(|c| f64::from(self.intensity[c]) / (r * r) * bsdf[c])
    }
}

/// The answers to a batch under one witness, shadows off.
pub struct Unshadowed<'a> {
    /// What the witness is, for reports: `constant`, `function of wi`...
    pub witness: &'a str,
    /// The witness' value for a lit ray, cosine included.
    pub bsdf: &'a dyn Fn(&SurfacePoint) -> [f64; 3],
    /// Radiance along every ray of the batch.
    pub values: &'a [[f32; 3]],
}

/// Part 1.3: judges unshadowed radiance along the lit rays, the worst witness counting.
pub fn judge_unshadowed(batch: &RayBatch, answers: &[Unshadowed]) -> Check {
    let id = "radiance.lit";
    if batch.lit == 0 || answers.is_empty() {
        let summary = "the scene has no lit ray away from edges".to_owned();
        return Check::new(id, &batch.scene, Verdict::NotJudged, summary);
    }
    let mut worst: Option<Difference> = None;
    let mut measures = Vec::new();
    for answer in answers {
        let difference = Difference::of(batch, answer);
        measures.push(Measure::at_most(
            "rays.lit",
            format!("rays wrong under the witness BSDF \"{}\" (fraction)", answer.witness),
            difference.wrong,
            STRAY_FRACTION,
        ));
        if worst.as_ref().is_none_or(|worst| difference.error > worst.error) {
            worst = Some(difference);
        }
    }
    let passed = measures.iter().all(|measure| measure.passed);
    let Some(worst) = worst else {
        return Check::new(id, &batch.scene, Verdict::NotJudged, "no witness was asked");
    };
    let mut check = if passed {
        let summary = format!("unshadowed radiance is right along {} rays", batch.lit);
        Check::new(id, &batch.scene, Verdict::Pass, summary)
    } else {
        Check { error: worst.error, ..Check::new(id, &batch.scene, Verdict::Fail, worst.summary) }
            .with_hint(worst.hint)
    };
    check.measures = measures;
    check
}

/// How one witness' answers differ from what is right.
struct Difference {
    /// Fraction of the rays that differ by more than the tolerance.
    wrong: f64,
    /// Sum of differences over sum of expected values.
    error: f64,
    summary: String,
    hint: String,
}

impl Difference {
    fn of(batch: &RayBatch, answer: &Unshadowed) -> Self {
        let (mut wrong, mut apart, mut total) = (0usize, 0.0, 0.0);
        let mut worst = (0.0, 0, [0.0; 3]);
        let mut ratios = Vec::new();
        for (index, value) in answer.values[..batch.lit].iter().enumerate() {
            let point = &batch.points[index];
            let expected = batch.unshadowed(index, (answer.bsdf)(point));
            let mut excess = 0.0f64;
            for c in 0..3 {
                let (a, b) = (f64::from(value[c]), expected[c]);
                let difference = if a.is_finite() { (a - b).abs() } else { 10.0 * b };
                excess = excess.max(difference / (RELATIVE * b).max(f64::MIN_POSITIVE));
                apart += difference;
                total += b;
                if b > 0.0 && a.is_finite() {
                    ratios.push(a / b);
                }
            }
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
            error: apart / total,
            summary: format!(
                "unshadowed radiance is wrong along {wrong} of {} rays under the witness BSDF \"{}\"; worst at \
                 ({:.3}, {:.3}, {:.3}): expected ({:.4}, {:.4}, {:.4}), found ({:.4}, {:.4}, {:.4})",
                batch.lit,
                answer.witness,
                p.x,
                p.y,
                p.z,
                expected[0],
                expected[1],
                expected[2],
                found[0],
                found[1],
                found[2]
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

/// Part 1.4: judges visibility, from the radiance along all rays with shadows (`with`) and without
/// (`without`), under the same BSDF whose value is `bsdf`.
///
/// Errors on lit and on shadowed rays count apart and add up, so that an image that is all lit or
/// all dark is worth nothing. `shaded` is radiance with and without shadows under the renderer's own
/// BSDFs, right or wrong: along a lit ray the shadow query leaves what is shaded as it was.
pub fn judge_shadows(
    batch: &RayBatch,
    bsdf: &dyn Fn(&SurfacePoint) -> [f64; 3],
    with: &[[f32; 3]],
    without: &[[f32; 3]],
    shaded: (&[[f32; 3]], &[[f32; 3]]),
) -> Check {
    let id = "shadow.rays";
    let dark = batch.rays.len() - batch.lit;
    if dark == 0 || batch.lit == 0 {
        let summary = "the scene has no ray in full light, or none in full shadow, away from edges";
        return Check::new(id, &batch.scene, Verdict::NotJudged, summary);
    }
    // A renderer that ignores the switch draws shadows always: then its own shadows are what is
    // missing without, and no fault of its shading.
    // Asked of one scene alone: `set_apart` looks at the others.
    let ignores_switch = with == without;
    let (mut lit_wrong, mut dark_wrong, mut lit_black) = (0usize, 0usize, 0usize);
    let mut first: Option<(usize, f64)> = None;
    let (mut lit_seen, mut dark_seen) = (Vec::new(), Vec::new());
    for index in 0..batch.rays.len() {
        let expected = batch.unshadowed(index, bsdf(&batch.points[index]));
        let is_lit = index < batch.lit;
        if is_lit && !ignores_switch && is_black(without[index], expected) {
            lit_black += 1;
            continue;
        }
        let visibility = visibility(with[index], without[index], expected);
        if is_lit { &mut lit_seen } else { &mut dark_seen }.push(visibility);
        // What is no number is never right.
        let right = (visibility - f64::from(u8::from(is_lit))).abs() < HALF_LIGHT;
        let changed = is_lit && !same_shading(shaded.0[index], shaded.1[index]);
        if !right || changed {
            let count = if is_lit { &mut lit_wrong } else { &mut dark_wrong };
            *count += 1;
            first = first.or(Some((index, visibility)));
        }
    }
    // What is black with shadows and without says nothing about visibility.
    let lit_known = batch.lit - lit_black;
    if (lit_known as f64) < LEAST_KNOWN * batch.lit as f64 {
        let verdict = if lit_known == 0 { Verdict::Fail } else { Verdict::NotJudged };
        let summary =
            format!("{lit_black} of {} lit rays are black without shadows too", batch.lit);
        return Check::new(id, &batch.scene, verdict, summary);
    }
    let lit_fraction = lit_wrong as f64 / lit_known as f64;
    let dark_fraction = dark_wrong as f64 / dark as f64;
    let changed = with.iter().zip(without).filter(|(with, without)| with != without).count();
    let changed = changed as f64 / batch.rays.len() as f64;
    let measures = vec![
        Measure::at_most("", SWITCHED, changed, 1.0),
        Measure::at_most(
            "shadow.lit",
            "lit rays that are not lit (fraction)",
            lit_fraction,
            STRAY_FRACTION,
        ),
        Measure::at_most(
            "shadow.dark",
            "shadowed rays that are not dark (fraction)",
            dark_fraction,
            STRAY_FRACTION,
        ),
    ];
    let mut check = match first.filter(|_| measures.iter().any(|measure| !measure.passed)) {
        None => {
            let summary = format!("visibility is right along {} rays", batch.rays.len());
            Check::new(id, &batch.scene, Verdict::Pass, summary)
        }
        Some((index, visibility)) => {
            let p = batch.points[index].position;
            let summary = format!(
                "{lit_wrong} of {lit_known} lit rays are not lit and {dark_wrong} of {dark} shadowed rays are not dark; \
                 first at ({:.3}, {:.3}, {:.3}): expected visibility {}, found {visibility:.2}",
                p.x,
                p.y,
                p.z,
                u8::from(index < batch.lit),
            );
            let check = Check::new(id, &batch.scene, Verdict::Fail, summary);
            check.with_hint(shadow_hint(&mut lit_seen, &mut dark_seen))
        }
    };
    check.error = if check.verdict == Verdict::Pass { 0.0 } else { lit_fraction + dark_fraction };
    check.measures = measures;
    check
}

/// Whether radiance is the same but for rounding; what is no number in both is no matter of shadows.
fn same_shading(with: [f32; 3], without: [f32; 3]) -> bool {
    let same = |a: f64, b: f64| match (a.is_finite(), b.is_finite()) {
        (true, true) => (a - b).abs() <= RELATIVE * b.abs(),
        (a, b) => a == b,
    };
    with.iter().zip(without).all(|(a, b)| same(f64::from(*a), f64::from(b)))
}

/// The measure of how much of a scene the shadows switch changes.
const SWITCHED: &str = "rays that the shadows switch changes (fraction)";

/// The least fraction of rays whose radiance is wrong where the light stands elsewhere.
const LIGHT_ELSEWHERE: f64 = 0.9;

/// Where the light stands elsewhere than it should, shadows fall elsewhere too. So on a scene whose
/// unshadowed radiance is wrong nearly everywhere (1.3) shadows are not judged (1.4), as long as
/// there is another scene whose radiance is right and whose shadows are judged.
pub fn set_apart(checks: &mut [Check]) {
    let is = |check: &Check, id: &str, verdict| check.id == id && check.verdict == verdict;
    let nearly_all = |check: &&Check| check.measures.iter().any(|m| m.value > LIGHT_ELSEWHERE);
    let named =
        |checks: Vec<&Check>| checks.iter().map(|check| check.scene.clone()).collect::<Vec<_>>();
    let radiance = |verdict| checks.iter().filter(move |check| is(check, "radiance.lit", verdict));
    let right = named(radiance(Verdict::Pass).collect());
    let wrong = named(radiance(Verdict::Fail).filter(nearly_all).collect());
    let judged = |check: &Check| {
        is(check, "shadow.rays", Verdict::Pass) || is(check, "shadow.rays", Verdict::Fail)
    };
    let switched = |check: &Check| {
        let of = check.measures.iter().find(|measure| measure.name == SWITCHED);
        of.map_or(0.0, |measure| measure.value)
    };
    // Black on lit rays, with shadows and without, by a renderer that obeys the switch elsewhere.
    let obeys = checks.iter().any(|check| judged(check) && switched(check) > 0.0);
    let no_dark_is_lit = |check: &Check| check.measures.last().is_some_and(|dark| dark.passed);
    for check in checks.iter_mut().filter(|check| is(check, "shadow.rays", Verdict::Fail)) {
        if obeys && switched(check) == 0.0 && no_dark_is_lit(check) {
            check.verdict = Verdict::NotJudged;
            check.summary =
                format!("black without shadows too: they are judged elsewhere ({})", check.summary);
        }
    }
    if !checks.iter().any(|check| judged(check) && right.contains(&check.scene)) {
        return;
    }
    for check in checks.iter_mut().filter(|check| is(check, "shadow.rays", Verdict::Fail)) {
        if wrong.contains(&check.scene) {
            check.verdict = Verdict::NotJudged;
            check.summary = format!(
                "unshadowed radiance is wrong here and right elsewhere: shadows are judged there ({})",
                check.summary
            );
        }
    }
}

/// Visibility as the renderer has it: radiance with over without shadows. Where there is none
/// without (a renderer that ignores the switch), no radiance with shadows is darkness.
fn visibility(with: [f32; 3], without: [f32; 3], expected: [f64; 3]) -> f64 {
    let sum = |v: [f32; 3]| v.iter().map(|&x| f64::from(x)).sum::<f64>();
    let expected_sum = expected.iter().sum::<f64>();
    if is_black(without, expected) { sum(with) / expected_sum } else { sum(with) / sum(without) }
}

/// Whether radiance is nothing beside what is expected.
fn is_black(radiance: [f32; 3], expected: [f64; 3]) -> bool {
    let sum = radiance.iter().map(|&x| f64::from(x)).sum::<f64>();
    // Asked this way round, a NaN is black.
    let shines = sum.abs() > 1e-3 * expected.iter().sum::<f64>();
    !shines
}

/// What the visibilities of lit and of shadowed rays say.
fn shadow_hint(lit: &mut [f64], dark: &mut [f64]) -> String {
    let wrong = |values: &[f64], right: f64| {
        let off = values.iter().filter(|v| (*v - right).abs() >= HALF_LIGHT).count();
        off as f64 > STRAY_FRACTION * values.len() as f64
    };
    // The one value that nearly all have.
    let level = |values: &mut [f64]| {
        values.sort_by(f64::total_cmp);
        let at = |fraction: f64| values[((values.len() - 1) as f64 * fraction) as usize];
        (!values.is_empty() && at(0.99) - at(0.01) < HALF_LIGHT).then(|| at(0.5))
    };
    let bright = |values: &[f64]| values.iter().all(|v| v.min((1.0 - v).abs()) < HALF_LIGHT);
    let percent = |v: f64| 100.0 * v;
    match (wrong(lit, 1.0), wrong(dark, 0.0)) {
        (false, true) => match level(dark) {
            Some(left) if left > 1.0 - HALF_LIGHT => {
                "no point is in shadow: is visibility tested at all?".into()
            }
            Some(left) => format!("shadows leave {:.0} % of the light", percent(left)),
            None if bright(dark) => {
                "some occluders are missed: look at the shadow ray's min_t and max_t".into()
            }
            None => String::new(),
        },
        (true, false) => match level(lit) {
            Some(left) if left < HALF_LIGHT => "nothing is lit when shadows are on".into(),
            Some(left) => {
                format!("with shadows on, lit points keep {:.0} % of their light", percent(left))
            }
            None if bright(lit) => {
                "lit points are in shadow: does the shadow ray end at the light, and start off the surface?".into()
            }
            None => String::new(),
        },
        _ => String::new(),
    }
}

/// Part 1.3: whether the full render agrees with the renderer's own radiance along the same pixel
/// centres; what differs is the loop's, the film's or the camera's fault.
///
/// `image` is a render at 1 spp, `rays` the renderer's radiance along the pixels' centre rays, both
/// row by row; `mask` tells where an edge forgives.
pub fn judge_agreement(
    scene: &str,
    mask: &RegionMask,
    image: &[[f32; 3]],
    rays: &[[f32; 3]],
) -> Check {
    let id = "loop.agreement";
    let largest = rays.iter().flatten().filter(|v| v.is_finite()).fold(0.0f32, |m, &v| m.max(v));
    if largest == 0.0 {
        let summary = "radiance along rays is black: there is nothing to agree with";
        return Check::new(id, scene, Verdict::NotJudged, summary);
    }
    let (mut wrong, mut counted, mut apart, mut total) = (0usize, 0usize, 0.0, 0.0);
    let mut first = None;
    for (index, ((a, b), &value)) in image.iter().zip(rays).zip(&mask.pixels).enumerate() {
        if value & RegionMask::EDGE != 0 {
            continue;
        }
        counted += 1;
        let mut differs = false;
        for c in 0..3 {
            let (a, b) = (f64::from(a[c]), f64::from(b[c]));
            let difference = match (a.is_finite(), b.is_finite()) {
                (true, true) => (a - b).abs(),
                (false, false) => 0.0,
                _ => f64::from(largest),
            };
            differs |= difference > RELATIVE * b.abs() + 1e-5 * f64::from(largest);
            apart += difference;
            total += if b.is_finite() { b.abs() } else { 0.0 };
        }
        if differs {
            wrong += 1;
            first = first.or(Some(index));
        }
    }
    let fraction = wrong as f64 / counted.max(1) as f64;
    let measure = Measure::at_most(
        "loop.agreement",
        "pixels that differ (fraction)",
        fraction,
        STRAY_FRACTION,
    );
    let mut check = match first.filter(|_| !measure.passed) {
        None => {
            let summary =
                format!("the image is what the integrator answers at {counted} pixel centres");
            Check::new(id, scene, Verdict::Pass, summary)
        }
        Some(index) => {
            let summary = format!(
                "{wrong} of {counted} pixels of a 1 spp render are not what the integrator answers along their \
                 centre rays; first at ({}, {})",
                index % mask.width,
                index / mask.width
            );
            let hint = "look at the render loop, the film and the camera ray, not at the shading";
            Check { error: apart / total, ..Check::new(id, scene, Verdict::Fail, summary) }
                .with_hint(hint)
        }
    };
    check.measures = vec![measure];
    check
}

#[cfg(test)]
mod tests;
