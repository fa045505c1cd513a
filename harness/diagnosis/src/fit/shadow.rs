//! Estimates where shadow rays begin and end, and how much light shadows leave, from visibility along rays whose
//! occluders are known.

use super::deviation::{Deviation, Of, Value};
use super::search::Fitted;

/// A shadow ray, from the surface to the light and beyond.
#[derive(Clone, Debug)]
pub struct ShadowRay {
    /// Distance to the light, scene units.
    pub distance: f64,
    /// How far off everything is that blocks light, nearest first, behind the light too.
    pub occluders: Vec<f64>,
    /// The visibility that the renderer has: 0 is dark, 1 lit.
    pub found: f64,
}

/// Visibilities that differ by less are the same.
const SAME: f64 = 0.02;
/// Fraction of the rays that may differ.
const STRAY: f64 = 5e-3;
/// Fraction of the wrong rays that may be wrong for another reason.
const OTHERWISE: f64 = 0.05;
/// Least number of rays on either side of a limit that is needed to find it.
const LEAST: usize = 8;
/// An estimate is reported only if its relative uncertainty is below this.
const NARROW: f64 = 0.1;

/// What is wrong with visibility, if one thing is.
pub fn explain_shadows(rays: &[ShadowRay]) -> Option<Fitted> {
    let blocked = |ray: &ShadowRay| ray.occluders.iter().any(|&t| t < ray.distance);
    let (dark, lit): (Vec<&ShadowRay>, Vec<&ShadowRay>) = rays.iter().partition(|ray| blocked(ray));
    if dark.len() < LEAST || lit.len() < LEAST || rays.iter().any(|ray| !ray.found.is_finite()) {
        return None;
    }
    let said = match (level(&dark), level(&lit)) {
        (Some(dark), Some(lit)) => levels(dark, lit),
        _ => limits(rays),
    };
    said.map(|deviations| Fitted { deviations, unexplained: 0.0 })
        .filter(|f| !f.deviations.is_empty())
}

/// The one visibility that all rays have, if they do.
fn level(rays: &[&ShadowRay]) -> Option<f64> {
    let mut values: Vec<f64> = rays.iter().map(|ray| ray.found).collect();
    values.sort_by(f64::total_cmp);
    let middle = values[values.len() / 2];
    let other = values.iter().filter(|value| (*value - middle).abs() > SAME).count();
    (other as f64 <= STRAY * values.len() as f64).then_some(middle)
}

fn levels(dark: f64, lit: f64) -> Option<Vec<Deviation>> {
    let say = |quantity, value: f64, words: String| Deviation {
        of: Of::Shadow,
        quantity,
        value: Value::Number(value),
        words,
    };
    let is = |value: f64, other: f64| (value - other).abs() < SAME;
    Some(match (dark, lit) {
        _ if is(dark, 1.0) && is(lit, 1.0) => {
            vec![say(
                "remains",
                1.0,
                "nothing is in shadow: is visibility tested, and toward the light?".into(),
            )]
        }
        _ if is(dark, 0.0) && is(lit, 0.0) => {
            vec![say("lit_remains", 0.0, "everything is in shadow".into())]
        }
        _ if is(dark, 1.0) && is(lit, 0.0) => return None,
        _ => {
            let mut all = Vec::new();
            if !is(dark, 0.0) {
                let percent = 100.0 * dark;
                all.push(say(
                    "remains",
                    dark,
                    format!("shadows leave {percent:.0} % of the light"),
                ));
            }
            if !is(lit, 1.0) {
                let percent = 100.0 * lit;
                let words =
                    format!("with shadows on, lit points keep {percent:.0} % of their light");
                all.push(say("lit_remains", lit, words));
            }
            all
        }
    })
}

/// A limit that tells dark rays from lit ones.
#[derive(Clone, Copy, Debug)]
struct Limit {
    below: f64,
    above: f64,
}

impl Limit {
    /// The shortest number between the two bounds.
    fn value(self) -> f64 {
        let middle = 0.5 * (self.below + self.above);
        for digits in 0..4 {
            let near: f64 = format!("{middle:.digits$}").parse().unwrap_or(middle);
            if near > self.below && near <= self.above && near != 0.0 {
                return near;
            }
        }
        middle
    }

    fn is_narrow(self) -> bool {
        self.above - self.below <= NARROW * self.above.abs()
    }
}

/// A name for a place on a ray, and what it is for an occluder at a distance.
type Along = (&'static str, fn(&ShadowRay, f64) -> f64);

/// Where rays end or begin, when visibility is all or nothing.
fn limits(rays: &[ShadowRay]) -> Option<Vec<Deviation>> {
    let between = |ray: &&ShadowRay| ray.found > SAME && ray.found < 1.0 - SAME;
    if rays.iter().filter(between).count() as f64 > STRAY * rays.len() as f64 {
        return None;
    }
    let is_dark = |ray: &ShadowRay| ray.found < 0.5;
    let right = |ray: &&ShadowRay| ray.occluders.iter().any(|t| *t < ray.distance);
    let wrong = rays.iter().filter(|ray| right(ray) != is_dark(ray)).count();
    // A limit must explain nearly all that is wrong.
    let limit = |asked| limit(asked, OTHERWISE * wrong as f64);
    let ends: [Along; 3] = [
        ("end_fraction", |ray, t| t / ray.distance),
        ("end_absolute", |_, t| t),
        ("end_minus", |ray, t| t - ray.distance),
    ];
    // A ray is dark when the nearest occluder lies before its end...
    let fits = ends.into_iter().filter_map(|(quantity, of)| {
        let asked =
            rays.iter().filter_map(|ray| Some((of(ray, *ray.occluders.first()?), is_dark(ray))));
        Some((quantity, limit(asked.collect())?))
    });
    let ends: Vec<(&str, Limit)> = fits.filter(|_| lit_where_nothing_is(rays)).collect();
    // ... and when the farthest one before the light lies behind its start.
    let starts: [Along; 2] = [("start", |_, t| -t), ("start_fraction", |ray, t| -t / ray.distance)];
    let fits = starts.into_iter().filter_map(|(quantity, of)| {
        let asked = rays.iter().filter_map(|ray| {
            let last = ray.occluders.iter().rev().find(|t| **t < ray.distance)?;
            Some((of(ray, *last), is_dark(ray)))
        });
        Some((quantity, limit(asked.collect())?))
    });
    let right_elsewhere =
        || rays.iter().all(|ray| ray.occluders.iter().any(|t| *t < ray.distance) || !is_dark(ray));
    let starts: Vec<(&str, Limit)> = fits.filter(|_| right_elsewhere()).collect();
    let late = || {
        let beyond = |ray: &ShadowRay| ray.occluders.first().is_some_and(|t| *t >= ray.distance);
        rays.iter().any(|ray| beyond(ray) && is_dark(ray))
    };
    let form = |quantity, form, words: &str| Deviation {
        of: Of::Shadow,
        quantity,
        value: Value::Form(form),
        words: words.to_owned(),
    };
    match (ends.as_slice(), starts.as_slice()) {
        ([(quantity, limit)], []) if limit.is_narrow() || *quantity == "end_minus" => {
            Some(vec![end(quantity, limit.value())])
        }
        ([_, ..], []) if late() => Some(vec![form(
            "end",
            "late",
            "shadow rays do not end at the light: what lies behind it casts shadows",
        )]),
        ([_, ..], []) => Some(vec![form(
            "end",
            "early",
            "shadow rays end before they reach the light: near it, occluders are missed",
        )]),
        ([], [(quantity, limit)])
            if (Limit { below: -limit.above, above: -limit.below }).is_narrow() =>
        {
            let limit = Limit { below: -limit.above, above: -limit.below };
            Some(vec![start(quantity, limit.value())])
        }
        ([], [_, ..]) => Some(vec![form(
            "start",
            "far",
            "shadow rays start too far from the surface: near occluders are missed",
        )]),
        _ => None,
    }
}

/// Whether rays that meet nothing at all are lit.
fn lit_where_nothing_is(rays: &[ShadowRay]) -> bool {
    let free: Vec<&ShadowRay> = rays.iter().filter(|ray| ray.occluders.is_empty()).collect();
    let dark = free.iter().filter(|ray| ray.found < 0.5).count();
    dark as f64 <= STRAY * free.len() as f64
}

/// The limit below which rays are dark and from which on they are lit, if there is one.
fn limit(mut asked: Vec<(f64, bool)>, otherwise: f64) -> Option<Limit> {
    asked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let dark = asked.iter().filter(|(_, dark)| *dark).count();
    if dark < LEAST || asked.len() - dark < LEAST {
        return None;
    }
    // So many of the first are dark when all are where they belong.
    let misplaced = asked[..dark].iter().filter(|(_, dark)| !dark).count();
    if misplaced as f64 > otherwise {
        return None;
    }
    // Strays do not set the bounds.
    let below = asked[..dark].iter().rev().find(|(_, dark)| *dark)?;
    let above = asked[dark..].iter().find(|(_, dark)| !dark)?;
    Some(Limit { below: below.0, above: above.0 })
}

fn end(quantity: &'static str, value: f64) -> Deviation {
    let words = match quantity {
        "end_fraction" => {
            format!("shadow rays end at {value:.2} r where they are to end at r, the light")
        }
        "end_absolute" => {
            format!("shadow rays end {value:.2} from the surface, however far the light is")
        }
        _ if value < 0.0 => format!("shadow rays end {:.3} before the light", -value),
        _ => format!("shadow rays end {value:.3} behind the light"),
    };
    Deviation { of: Of::Shadow, quantity, value: Value::Number(value), words }
}

fn start(quantity: &'static str, value: f64) -> Deviation {
    let words = match quantity {
        "start" => {
            format!("shadow rays start {value:.3} from the surface: nearer occluders are missed")
        }
        _ => format!("shadow rays start at {value:.3} r: nearer occluders are missed"),
    };
    Deviation { of: Of::Shadow, quantity, value: Value::Number(value), words }
}
