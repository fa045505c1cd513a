//! Part 1.4: visibility along shadow rays.

use std::collections::BTreeMap;

use basecode::{Ray, Vec3};

use super::unshadowed::ELSEWHERE;
use super::{RELATIVE, RayBatch, STRAY_FRACTION};
use crate::expected::SurfacePoint;
use crate::light_levels::{GAINS_LIGHT, LEAVES_LIGHT, LOSES_LIGHT, Levels, what_lit_get};
use crate::price::{self, Price, PriceClass};
use crate::{Check, CheckId, Measure, RuleId, Verdict};
use imaging::correlation::Moments;

/// Nothing is in shadow, or nothing lit, where more of the rays than this are wrong.
const NEARLY_ALL: f64 = 0.99;
/// The mistake of shadows that are all of one color.
const ONE_COLOR: &str = "shadows have a color of their own";
/// The mistake of a switch that does the opposite.
pub const INVERTED: &str = "shadows are drawn where none are asked for, and none where they are";
/// What a slip may leave unexplained: the fraction of wrong rays, lit and dark ones together.
const LEFT: f64 = 0.02;
/// Number of dark rays that share a color, on average.
const SHARE_A_COLOR: usize = 10;
/// Light that a color of shadows counts as, at most: it is one constant.
const BRIGHTEST: f64 = 0.6;
/// Fraction of the lit rays that must not be black without shadows.
const LEAST_KNOWN: f64 = 0.25;
/// A visibility below this is dark, above one minus it lit; anything between is neither.
const HALF_LIGHT: f64 = 0.02;

/// Part 1.4: judges visibility, from the radiance along all rays with shadows (`with`) and without
/// (`without`), under the same BSDF whose value is `bsdf`.
///
/// Errors on lit and on shadowed rays count apart and add up, so that an image that is all lit or
/// all dark is worth nothing. `shaded` is radiance with and without shadows under the renderer's own
/// BSDFs, right or wrong: along a lit ray the shadow query leaves what is shaded as it was.
///
/// Where the integrator has the light in another place, whatever 1.3 loses by that, shadows are those of that light.
pub fn judge_shadows(
    batch: &RayBatch,
    bsdf: &dyn Fn(&SurfacePoint) -> [f64; 3],
    (with, without): (&[[f32; 3]], &[[f32; 3]]),
    shaded: (&[[f32; 3]], &[[f32; 3]]),
    occluders: &Occluders,
) -> Check {
    let check = judge_of_light(batch, bsdf, (with, without), shaded, occluders);
    if check.verdict != Verdict::Fail {
        return check;
    }
    let Some((moved, order)) = of_light_elsewhere(batch, bsdf, without, occluders) else {
        return check;
    };
    let chosen = |values: &[[f32; 3]]| order.iter().map(|ray| values[*ray]).collect::<Vec<_>>();
    let [with, without, on, off] = [with, without, shaded.0, shaded.1].map(chosen);
    let elsewhere = judge_of_light(&moved, bsdf, (&with, &without), (&on, &off), occluders);
    let is_better = elsewhere.verdict == Verdict::Pass
        || (elsewhere.verdict == Verdict::Fail && elsewhere.error < check.error);
    if is_better { elsewhere } else { check }
}

/// The batch with the light where radiance without shadows has it, and the rays in its order; nothing where that is
/// where it belongs, or not known.
fn of_light_elsewhere(
    batch: &RayBatch,
    bsdf: &dyn Fn(&SurfacePoint) -> [f64; 3],
    without: &[[f32; 3]],
    occluders: &Occluders,
) -> Option<(RayBatch, Vec<usize>)> {
    let sum = |values: [f64; 3]| values.iter().sum::<f64>();
    let found = |ray: usize| sum(without[ray].map(f64::from));
    let expected =
        |batch: &RayBatch, ray: usize| sum(batch.unshadowed(ray, bsdf(&batch.points[ray])));
    let rays = 0..batch.points.len();
    let ratios = rays.clone().map(|ray| (ray, expected(batch, ray) / found(ray)));
    let ratios: Vec<_> = ratios.filter(|(_, ratio)| ratio.is_finite() && *ratio > 0.0).collect();
    let light = batch.light_by_distances(&ratios)?;
    let moved = batch.with_light(light);
    let is_told = |batch: &RayBatch| {
        let off = |ray: &usize| {
            let right = expected(batch, *ray);
            let close = (found(*ray) - right).abs() <= RELATIVE * right;
            !close
        };
        rays.clone().filter(off).count() as f64 <= LEFT * rays.len() as f64
    };
    if is_told(batch) || !is_told(&moved) {
        return None;
    }
    let is_blocked = |ray: &usize| {
        let (point, toward) = (&moved.points[*ray], moved.to_light(*ray));
        let end = 0.999 * point.distance;
        let way = Ray::segment(point.position, toward, Ray::EPSILON, end);
        (occluders.blocker)(&way).is_some()
    };
    let (dark, lit): (Vec<usize>, Vec<usize>) = rays.partition(is_blocked);
    let count = lit.len();
    let order: Vec<usize> = lit.into_iter().chain(dark).collect();
    let points = order.iter().map(|ray| moved.points[*ray]).collect();
    let pixels = order.iter().map(|ray| moved.pixels[*ray]).collect();
    let rays = order.iter().map(|ray| moved.rays[*ray]).collect();
    Some((RayBatch { points, pixels, rays, lit: count, contacts: 0, ..moved }, order))
}

/// Judges visibility with the light where the batch has it.
fn judge_of_light(
    batch: &RayBatch,
    bsdf: &dyn Fn(&SurfacePoint) -> [f64; 3],
    (with, without): (&[[f32; 3]], &[[f32; 3]]),
    shaded: (&[[f32; 3]], &[[f32; 3]]),
    occluders: &Occluders,
) -> Check {
    let id = CheckId::ShadowRays;
    let dark = batch.points.len() - batch.lit;
    if dark == 0 || batch.lit == 0 {
        let summary = "the scene has no ray in full light, or none in full shadow, away from edges";
        return Check::new(id, &batch.scene, Verdict::NotJudged, summary);
    }
    // A renderer that ignores the switch draws shadows always: then its own shadows are what is
    // missing without, and no fault of its shading.
    // Asked of one scene alone: `leave_unjudged` looks at the others.
    let ignores_switch = with == without;
    let (mut lit_wrong, mut dark_wrong, mut lit_black) = (0usize, 0usize, 0usize);
    let mut first: Option<(usize, f64)> = None;
    let (mut lit_seen, mut dark_seen) = (Vec::new(), Vec::new());
    // What is known of visibility: the ray, and what was found.
    let mut known = Vec::new();
    let mut wrong_rays = Vec::new();
    for index in 0..batch.points.len() {
        let expected = batch.unshadowed(index, bsdf(&batch.points[index]));
        let is_lit = index < batch.lit;
        if is_lit && !ignores_switch && is_black(without[index], expected) {
            lit_black += 1;
            continue;
        }
        let visibility = visibility(with[index], without[index], expected);
        if is_lit { &mut lit_seen } else { &mut dark_seen }.push(visibility);
        // NaN is never right.
        let right = (visibility - f64::from(u8::from(is_lit))).abs() < HALF_LIGHT;
        let changed = is_lit && !same_shading(shaded.0[index], shaded.1[index]);
        // No shadow ray explains a query that lets light through and changes what is shaded.
        known.push((index, if changed && right { f64::NAN } else { visibility }));
        if !right || changed {
            let count = if is_lit { &mut lit_wrong } else { &mut dark_wrong };
            *count += 1;
            first = first.or(Some((index, visibility)));
            wrong_rays.push((batch.pixels[index], is_lit));
        }
    }
    // A ray that is black both with and without shadows says nothing about visibility.
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
    let changed = changed as f64 / batch.points.len() as f64;
    let measures = vec![
        Measure::at_most(None, SWITCHED, changed, 1.0),
        Measure::at_most(
            RuleId::ShadowLit,
            "lit rays that are not lit (fraction)",
            lit_fraction,
            STRAY_FRACTION,
        ),
        Measure::at_most(
            RuleId::ShadowDark,
            "shadowed rays that are not dark (fraction)",
            dark_fraction,
            STRAY_FRACTION,
        ),
    ];
    let mut check = match first.filter(|_| measures.iter().any(|measure| !measure.passed)) {
        None => {
            let summary = format!("visibility is right along {} rays", batch.points.len());
            Check::new(id, &batch.scene, Verdict::Pass, summary)
        }
        Some((index, visibility)) => {
            let p = batch.points[index].position;
            let wrong = lit_seen.iter().copied().filter(|seen| (seen - 1.0).abs() >= HALF_LIGHT);
            let get = what_lit_get(wrong);
            let summary = format!(
                "{lit_wrong} of {lit_known} rays that reach the light get {get}, {dark_wrong} of {dark} rays in \
                 shadow get light; first at ({:.3}, {:.3}, {:.3}): expected visibility {}, found {visibility:.2}",
                p.x,
                p.y,
                p.z,
                u8::from(index < batch.lit),
            );
            let check = Check::new(id, &batch.scene, Verdict::Fail, summary);
            check.with_hint(shadow_hint(&mut lit_seen, &mut dark_seen))
        }
    };
    check.measures = measures;
    if check.verdict == Verdict::Fail {
        check.wrong_rays = wrong_rays;
        let price = price(batch, &known, lit_fraction + dark_fraction, occluders);
        let price = match residual_of_inverted(batch, bsdf, (with, without)) {
            left if left <= LEFT => {
                check.hint = format!("the switch is inverted: {INVERTED}");
                // Nothing else explains what is drawn without shadows.
                Price { error: PriceClass::Slip.price() + left, mistake: Some(INVERTED), ..price }
            }
            _ => match color_of_shadows(batch, bsdf, with) {
                Some(light) if lit_fraction <= LEFT => {
                    let light = price::fading(light.min(BRIGHTEST));
                    price.or(ONE_COLOR, PriceClass::Slip, light + lit_fraction)
                }
                _ => price,
            },
        };
        check.error = price.error;
        check.mistake = price.name();
        check.measures.extend(price.measure());
    }
    check
}

/// The fractions of lit and of dark rays, added up, that are wrong where the switch is taken for its opposite.
fn residual_of_inverted(
    batch: &RayBatch,
    bsdf: &dyn Fn(&SurfacePoint) -> [f64; 3],
    (with, without): (&[[f32; 3]], &[[f32; 3]]),
) -> f64 {
    if with == without {
        return 1.0;
    }
    let is_wrong = |index: &usize| {
        let expected = batch.unshadowed(*index, bsdf(&batch.points[*index]));
        let visibility = visibility(without[*index], with[*index], expected);
        let right = (visibility - f64::from(u8::from(*index < batch.lit))).abs() < HALF_LIGHT;
        !right
    };
    let fraction = |rays: std::ops::Range<usize>| {
        let all = rays.len().max(1);
        rays.filter(is_wrong).count() as f64 / all as f64
    };
    fraction(0..batch.lit) + fraction(batch.lit..batch.points.len())
}

/// How much of the light a color amounts to that nearly all dark rays show, or that those have which meet the same
/// shape: the median. Nothing where there is none, or where it is that of lit points.
fn color_of_shadows(
    batch: &RayBatch,
    bsdf: &dyn Fn(&SurfacePoint) -> [f64; 3],
    with: &[[f32; 3]],
) -> Option<f64> {
    let dark = batch.lit..batch.points.len();
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    let mut of_shape: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for index in dark.clone() {
        of_shape.entry(batch.points[index].shape).or_default().push(index);
    }
    // A few rays on a shape have one color by chance.
    if dark.len() < SHARE_A_COLOR * of_shape.len() {
        return None;
    }
    let mut colors: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
    for (shape, own) in &of_shape {
        let channel = |c: usize| median(own.iter().map(|ray| f64::from(with[*ray][c])).collect());
        colors.insert(*shape, [channel(0)?, channel(1)?, channel(2)?]);
    }
    let color = |index: usize| colors[&batch.points[index].shape];
    let largest = |index: usize| color(index).into_iter().fold(0.0, f64::max);
    let is_other = |index: &usize| {
        let apart = |c: usize| (f64::from(with[*index][c]) - color(*index)[c]).abs();
        // NaN is another.
        !(0..3).all(|c| apart(c) <= RELATIVE * largest(*index))
    };
    let sum = |value: [f64; 3]| value.iter().sum::<f64>();
    let of_light = dark
        .clone()
        .map(|index| sum(color(index)) / sum(batch.unshadowed(index, bsdf(&batch.points[index]))));
    let light = median(of_light.collect())?;
    let others = dark.clone().filter(is_other).count();
    let told = light > 0.0 && (light - 1.0).abs() > HALF_LIGHT;
    (told && others as f64 <= LEFT * dark.len() as f64).then_some(light)
}

/// What a scene says of shadow rays.
#[derive(Clone, Copy)]
pub struct Occluders<'a> {
    /// The shape that blocks a ray first, if one does.
    pub blocker: &'a dyn Fn(&Ray) -> Option<usize>,
    /// Whether a shape's material is Phong.
    pub is_phong: &'a dyn Fn(usize) -> bool,
}

/// A mistake with shadow rays: what it is, and how much of the light reaches the point of a ray then.
type Change<'a> = (&'static str, Box<dyn Fn(usize) -> f64 + 'a>);

/// The one that is no slip: the end is part of what the handout asks for.
const ENDLESS: &str = "the shadow ray does not end";

/// Those that a ray without an end may be taken for.
const BEYOND: [&str; 3] =
    ["the shadow ray ends at 1.1 r", "the shadow ray ends at 1.5 r", "the shadow ray ends at 2 r"];

/// The mistakes that are looked for.
fn changes<'a>(batch: &'a RayBatch, occluders: &'a Occluders<'a>) -> Vec<Change<'a>> {
    let lit = |blocked: bool| if blocked { 0.0 } else { 1.0 };
    let blocks = |ray: &Ray| ray.min_t < ray.max_t && (occluders.blocker)(ray).is_some();
    let right = move |index: usize| lit(index >= batch.lit);
    let mut changes: Vec<Change> = Vec::new();
    let mut of = |name, ray: fn(&SurfacePoint, Vec3, f32) -> Ray| {
        let light = move |index: usize| {
            let point = &batch.points[index];
            lit(blocks(&ray(point, batch.to_light(index), point.distance)))
        };
        changes.push((name, Box::new(light)));
    };
    let eps = Ray::EPSILON;
    of("the shadow ray leads away from the light", |p, w, r| {
        Ray::segment(p.position, -w, Ray::EPSILON, 0.999 * r)
    });
    of("the shadow ray starts at the light, and leads away from the surface", |p, w, r| {
        Ray::segment(p.position + r * w, w, Ray::EPSILON, 0.999 * r)
    });
    of("the shadow ray starts at the camera", |p, w, r| {
        Ray::segment(p.ray.origin, w, Ray::EPSILON, 0.999 * r)
    });
    of("the shadow ray leads along wi in the local frame", |p, _, r| {
        Ray::segment(p.position, p.wi, Ray::EPSILON, 0.999 * r)
    });
    of("the shadow ray starts below the surface", |p, w, r| {
        Ray::segment(p.position - 1e-2 * p.normal, w, Ray::EPSILON, 0.999 * r)
    });
    of("the shadow ray starts off the surface, .1 along the normal", |p, w, r| {
        Ray::segment(p.position + 0.1 * p.normal, w, Ray::EPSILON, 0.999 * r)
    });
    // The ends of the ray: of the light's distance, or of the scene's units.
    for (name, times, end) in [
        (ENDLESS, 0.0, f32::INFINITY),
        ("the shadow ray ends at 2 r", 2.0, 0.0),
        ("the shadow ray ends at 1.5 r", 1.5, 0.0),
        ("the shadow ray ends at 1.1 r", 1.1, 0.0),
        ("the shadow ray ends at .98 r", 0.98, 0.0),
        ("the shadow ray ends at .95 r", 0.95, 0.0),
        ("the shadow ray ends at .9 r", 0.9, 0.0),
        ("the shadow ray ends at .8 r", 0.8, 0.0),
        ("the shadow ray ends at .75 r", 0.75, 0.0),
        ("the shadow ray ends at .5 r", 0.5, 0.0),
        ("the shadow ray ends at .25 r", 0.25, 0.0),
        ("the shadow ray ends at .5", 0.0, 0.5),
        ("the shadow ray ends at 1", 0.0, 1.0),
        ("the shadow ray ends at 2", 0.0, 2.0),
        ("the shadow ray ends at 3", 0.0, 3.0),
        ("the shadow ray ends at 5", 0.0, 5.0),
        ("the shadow ray ends at 10", 0.0, 10.0),
        ("the shadow ray ends at 1 short of the light", 1.0, -1.0),
        ("the shadow ray ends at .1 short of the light", 1.0, -0.1),
    ] {
        let light = move |index: usize| {
            let (p, w) = (&batch.points[index], batch.to_light(index));
            lit(blocks(&Ray::segment(p.position, w, eps, times * p.distance + end)))
        };
        changes.push((name, Box::new(light)));
    }
    let squared = move |index: usize| {
        let (p, w) = (&batch.points[index], batch.to_light(index));
        lit(blocks(&Ray::segment(p.position, w, eps, p.distance * p.distance)))
    };
    changes.push(("the shadow ray ends at r^2", Box::new(squared)));
    // Its start: in the scene's units, or of the light's distance.
    for (name, times, start) in [
        ("the shadow ray starts .01 off", 0.0, 0.01),
        ("the shadow ray starts .02 off", 0.0, 0.02),
        ("the shadow ray starts .05 off", 0.0, 0.05),
        ("the shadow ray starts .1 off", 0.0, 0.1),
        ("the shadow ray starts .2 off", 0.0, 0.2),
        ("the shadow ray starts .5 off", 0.0, 0.5),
        ("the shadow ray starts 1 off", 0.0, 1.0),
        ("the shadow ray starts at .01 r", 0.01, 0.0),
        ("the shadow ray starts at .02 r", 0.02, 0.0),
        ("the shadow ray starts at .05 r", 0.05, 0.0),
        ("the shadow ray starts at .1 r", 0.1, 0.0),
        ("the shadow ray starts at .2 r", 0.2, 0.0),
        ("the shadow ray starts at .5 r", 0.5, 0.0),
    ] {
        let light = move |index: usize| {
            let (p, w) = (&batch.points[index], batch.to_light(index));
            let start = times * p.distance + start;
            lit(blocks(&Ray::segment(p.position, w, start, 0.999 * p.distance)))
        };
        changes.push((name, Box::new(light)));
    }
    let blocker = move |index: usize| {
        let (p, w) = (&batch.points[index], batch.to_light(index));
        (occluders.blocker)(&Ray::segment(p.position, w, eps, 0.999 * p.distance))
    };
    let phong = move |index: usize| (occluders.is_phong)(batch.points[index].shape);
    changes.push(("lit and dark are exchanged", Box::new(move |i| 1.0 - right(i))));
    changes.push((
        "a surface's own shape casts no shadow on it",
        Box::new(move |i| lit(blocker(i).is_some_and(|shape| shape != batch.points[i].shape))),
    ));
    changes.push((
        "the first shape alone casts shadows",
        Box::new(move |i| lit(blocker(i) == Some(0))),
    ));
    changes.push((
        "no shadow falls on Phong materials",
        Box::new(move |i| if phong(i) { 1.0 } else { right(i) }),
    ));
    changes.push((
        "no shadow falls on diffuse materials",
        Box::new(move |i| if phong(i) { right(i) } else { 1.0 }),
    ));
    changes
}

/// The price of wrong visibility. The errors of lit and of dark rays add up.
fn price(batch: &RayBatch, known: &[(usize, f64)], raw: f64, occluders: &Occluders) -> Price {
    let of = |wanted: bool| known.iter().filter(move |(index, _)| (*index < batch.lit) == wanted);
    let counts = [of(true).count().max(1), of(false).count().max(1)].map(|n| n as f64);
    // The fraction of lit rays whose visibility is not `light`, and that of dark ones.
    let residual = |light: &dyn Fn(usize) -> f64| {
        let wrong = |wanted| {
            let wrong = of(wanted).filter(|(index, visibility)| {
                // Compared this way, a NaN counts as wrong.
                let right = (visibility - light(*index)).abs() < HALF_LIGHT;
                !right
            });
            wrong.count() as f64
        };
        wrong(true) / counts[0] + wrong(false) / counts[1]
    };
    let right = |index: usize| f64::from(u8::from(index < batch.lit));
    let pairs = known.iter().map(|(index, visibility)| (*visibility, right(*index)));
    let start = match Moments::of(pairs).correlation() {
        likeness if likeness >= price::LIKE => {
            Price::of_raw(raw).or(price::UNKNOWN, PriceClass::Unknown, 0.0)
        }
        _ => Price::of_raw(raw),
    };
    let changes = changes(batch, occluders);
    let left = |wanted: &str| {
        let of = changes.iter().find(|(name, _)| *name == wanted);
        of.map_or(f64::INFINITY, |(_, light)| residual(light))
    };
    // A ray without an end explains no less than one that ends somewhere beyond the light.
    let endless = BEYOND.iter().all(|name| left(ENDLESS) <= left(name));
    let told = changes.iter().filter(|(name, _)| !(endless && BEYOND.contains(name)));
    let price = told.fold(start, |price, (name, light)| {
        let class = if *name == ENDLESS { PriceClass::Concept } else { PriceClass::Slip };
        price.or(name, class, residual(light))
    });
    // Acne darkens some of what is lit, an offset too large lets some light through.
    let [lit_wrong, dark_wrong] = [true, false].map(|lit| {
        let level = f64::from(u8::from(lit));
        let right = |visibility: f64| (visibility - level).abs() < HALF_LIGHT;
        of(lit).filter(|(_, visibility)| !right(*visibility)).count() as f64
    });
    let price = price::partly(price, lit_wrong / counts[0], dark_wrong / counts[1]);
    let seen = known.iter().map(|(index, visibility)| (*index < batch.lit, *visibility));
    Levels::of(seen)
        .priced(price, |lit, dark| residual(&|index| if index < batch.lit { lit } else { dark }))
}

/// Whether radiance is the same except for rounding. NaN in both does not concern shadows.
fn same_shading(with: [f32; 3], without: [f32; 3]) -> bool {
    let same = |a: f64, b: f64| match (a.is_finite(), b.is_finite()) {
        (true, true) => (a - b).abs() <= RELATIVE * b.abs(),
        (a, b) => a == b,
    };
    with.iter().zip(without).all(|(a, b)| same(f64::from(*a), f64::from(b)))
}

/// The measure of how much of a scene the shadows switch changes.
pub(super) use crate::check::SWITCHED;

/// The least fraction of rays whose radiance is wrong where the light stands elsewhere.
const LIGHT_ELSEWHERE: f64 = 0.9;

/// Where the light stands elsewhere than it should, shadows fall elsewhere too. So on a scene whose
/// unshadowed radiance is wrong nearly everywhere (1.3) shadows are not judged (1.4), as long as
/// there is another scene whose radiance is right and whose shadows are judged. If one mistake explains the answers
/// completely with the light in its place, the light is in its place.
pub fn leave_unjudged(checks: &mut [Check]) {
    charge_what_is_never_tested(checks);
    let is = |check: &Check, id: CheckId, verdict| check.id == id && check.verdict == verdict;
    let nearly_all = |check: &&Check| check.measures.iter().any(|m| m.value > LIGHT_ELSEWHERE);
    let named =
        |checks: Vec<&Check>| checks.iter().map(|check| check.scene.clone()).collect::<Vec<_>>();
    let radiance =
        |verdict| checks.iter().filter(move |check| is(check, CheckId::RadianceLit, verdict));
    let right = named(radiance(Verdict::Pass).collect());
    let stands_elsewhere = |check: &Check| check.mistake == ELSEWHERE;
    let elsewhere = |check: &&Check| {
        nearly_all(check) && (stands_elsewhere(check) || !price::is_explained(check))
    };
    let mut wrong = named(radiance(Verdict::Fail).filter(elsewhere).collect());
    // Right under a convention is right.
    wrong.retain(|scene| !right.contains(scene));
    let judged = |check: &Check| {
        is(check, CheckId::ShadowRays, Verdict::Pass)
            || is(check, CheckId::ShadowRays, Verdict::Fail)
    };
    let switched = |check: &Check| {
        let of = check.measures.iter().find(|measure| measure.name == SWITCHED);
        of.map_or(0.0, |measure| measure.value)
    };
    // Black on lit rays, with shadows and without, by a renderer that obeys the switch elsewhere.
    let obeys = checks.iter().any(|check| judged(check) && switched(check) > 0.0);
    let no_dark_is_lit = |check: &Check| {
        let mut dark = check.measures.iter().filter(|m| m.rule == Some(RuleId::ShadowDark));
        dark.all(|dark| dark.passed)
    };
    for check in checks.iter_mut().filter(|check| is(check, CheckId::ShadowRays, Verdict::Fail)) {
        if obeys && switched(check) == 0.0 && no_dark_is_lit(check) {
            check.verdict = Verdict::NotJudged;
            check.summary =
                format!("black without shadows too: they are judged elsewhere ({})", check.summary);
        }
    }
    if !checks.iter().any(|check| judged(check) && right.contains(&check.scene)) {
        return;
    }
    for check in checks.iter_mut().filter(|check| is(check, CheckId::ShadowRays, Verdict::Fail)) {
        if wrong.contains(&check.scene) {
            check.verdict = Verdict::NotJudged;
            check.summary = format!(
                "unshadowed radiance is wrong here and right elsewhere: shadows are judged there ({})",
                check.summary
            );
        }
    }
}

/// On one scene alone a shadow ray that misses its occluders looks like none at all. So where nothing
/// is in shadow on any scene, or nothing lit, no slip explains it.
fn charge_what_is_never_tested(checks: &mut [Check]) {
    let fractions = |check: &Check| {
        let of = |rule| check.measures.iter().find(|measure| measure.rule == Some(rule));
        (check.id == CheckId::ShadowRays)
            .then_some((of(RuleId::ShadowLit)?.value, of(RuleId::ShadowDark)?.value))
    };
    let all: Vec<(f64, f64)> = checks.iter().filter_map(fractions).collect();
    let all_lit = all.iter().all(|(lit, dark)| *dark > NEARLY_ALL && *lit <= NEARLY_ALL);
    let all_dark = all.iter().all(|(lit, dark)| *lit > NEARLY_ALL && *dark <= NEARLY_ALL);
    if !(all_lit || all_dark) {
        return;
    }
    for check in checks.iter_mut().filter(|check| check.verdict == Verdict::Fail) {
        let left = [LEAVES_LIGHT, LOSES_LIGHT, GAINS_LIGHT, ONE_COLOR, INVERTED]
            .contains(&check.mistake.as_str());
        if let Some((lit, dark)) = fractions(check).filter(|_| !left) {
            check.error = Price::of_raw(lit + dark).error;
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
    // Compared this way, a NaN counts as black.
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
                "no point is in shadow: is visibility tested, and toward the light?".into()
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
