//! Parts 2.1 to 2.4 judged separately: a student's render pass with Umbra's stages, which show the values it binds, and
//! a student's stages in Umbra's pass.
//!
//! No reference shader is needed: Umbra's stages write positions, normals and uniforms, not radiance.

mod bound;
mod seen;
mod shapes;
mod values;

pub use bound::BoundValue;

use basecode::{Image, Vec3};

use super::price::PriceClass;
use super::stage_film::{OFFSET_PX, StageFilm, median_length};
use super::{Check, CheckId, Measure, RuleId, Verdict};
use seen::Seen;
use values::Values;

/// A vertex stage that does what the contract says, for use with a student's fragment stages.
pub const VERTEX: &str =
    concat!(include_str!("shaders/contract.wgsl"), include_str!("shaders/vertex.wgsl"));

/// A fragment stage that writes the interpolated world position.
pub const SHOW_POSITION: &str =
    concat!(include_str!("shaders/contract.wgsl"), include_str!("shaders/position.wgsl"));
/// A fragment stage that writes the interpolated world normal, normalized.
pub const SHOW_NORMAL: &str =
    concat!(include_str!("shaders/contract.wgsl"), include_str!("shaders/normal.wgsl"));

/// A fragment stage that draws black: for the materials that are not looked at. Their pixels bleed
/// over edges, and what they show must be a radiance.
pub const BLACK: &str =
    concat!(include_str!("shaders/contract.wgsl"), include_str!("shaders/black.wgsl"));

/// The tolerance of a bound value, relative to its largest component: it travels as f32.
const BOUND_RELATIVE: f32 = 1e-4;
/// Fraction of interior pixels that may still differ: a rasterizer's coverage along seams inside a shape.
pub(super) const STRAY_FRACTION: f64 = 5e-3;

/// Part 2.1: judges the frames that a student's pass drew with stages that show one bound value each.
/// `positions` is the frame that shows world positions. Asks for the values of a shape that are `wanted`; surfaces are
/// in their place if any is not.
pub fn judge_pass(
    scene_name: &str,
    film: &StageFilm,
    frames: &[(BoundValue, Image)],
    positions: &Image,
    wanted: &dyn Fn(BoundValue, usize) -> bool,
) -> Check {
    let id = CheckId::PassUniforms;
    let values = Values::of(film, frames, wanted);
    let seen = Seen::of(film, frames, positions);
    let mut measures = values.measures.clone();
    let mut check = match &values.first_wrong {
        None if values.total == 0 => Check::new(
            id,
            scene_name,
            Verdict::NotJudged,
            "no pixel away from edges shows a surface",
        ),
        None => {
            let summary = format!("{} uniforms reach the shaders on every object", measures.len());
            Check::new(id, scene_name, Verdict::Pass, summary)
        }
        Some(wrong) => {
            let (summary, hint) = seen.in_words(film).unwrap_or_else(|| wrong.in_words(film));
            let price = values.price(film, frames, &seen);
            measures.extend(price.measure());
            Check {
                error: price.error,
                mistake: price.name(),
                ..Check::new(id, scene_name, Verdict::Fail, summary)
            }
            .with_hint(hint)
        }
    };
    let slip = |mistake: &str, summary: String, hint: &'static str| Check {
        error: PriceClass::Slip.price(),
        mistake: mistake.to_owned(),
        ..Check::new(id, scene_name, Verdict::Fail, summary).with_hint(hint)
    };
    // Values that other surfaces share do not tell that these are seen.
    if check.verdict == Verdict::Pass && values.all_wanted {
        let fraction = seen.elsewhere.0 as f64 / seen.all.max(1) as f64;
        if fraction > STRAY_FRACTION
            && fraction < HALF
            && let Some((summary, hint)) = seen.in_words(film)
        {
            check = slip("another surface is seen", summary, hint);
        }
    }
    let offset_px = if values.all_wanted { median_offset_px(film, positions) } else { 0.0 };
    let placed = Measure::at_most(
        RuleId::PassPlace,
        "surfaces off their place on the film (pixels, median)",
        offset_px,
        OFFSET_PX,
    );
    if !placed.passed && check.error < PriceClass::Slip.price() {
        let summary = format!("surfaces lie {offset_px:.2} pixels beside their place");
        let hint = "look at the viewport and at the matrices that the pass binds";
        check = slip("surfaces lie beside their place", summary, hint);
    }
    measures.push(placed);
    check.measures = measures;
    check
}

/// Whether a bound value is as expected.
fn is_close(found: Vec3, expected: Vec3) -> bool {
    let least = BOUND_RELATIVE * expected.abs().max_element().max(1e-3);
    (found - expected).abs().max_element() <= least
}

/// How far surfaces lie from their place under a pass. 0 where most of the film shows nothing near what
/// belongs there: values tell what is wrong then, or the pass draws by a vertex stage of its own.
fn median_offset_px(film: &StageFilm, positions: &Image) -> f64 {
    let (mut all, mut offsets) = (0usize, Vec::new());
    for (index, _) in film.interior() {
        let (ray, Some(point)) = &film.surface.pixels[index] else { continue };
        all += 1;
        let found = positions.pixels[index];
        if (found - point.position).length() <= NEAR * (point.position - ray.origin).length() {
            offsets.push(film.offset_px(index, found));
        }
    }
    if 2 * offsets.len() < all { 0.0 } else { median_length(&mut offsets) }
}

/// From this fraction on, positions that are not those of the pixels tell of a vertex stage with outputs of its own.
const HALF: f64 = 0.5;

/// Positions are near, relative to their distance from the camera: a few pixels of the small film.
const NEAR: f32 = 0.1;

/// Whether a student's stage is still the template's: equal apart from comments and white space.
pub fn is_template(stage: &str, template: &str) -> bool {
    bare(stage) == bare(template)
}

/// A source without comments and white space.
pub fn bare(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    let mut depth = 0usize;
    while let Some(c) = rest.chars().next() {
        if rest.starts_with("/*") {
            depth += 1;
            rest = &rest[2..];
        } else if depth > 0 && rest.starts_with("*/") {
            depth -= 1;
            rest = &rest[2..];
        } else if depth == 0 && rest.starts_with("//") {
            rest = rest.find('\n').map_or("", |end| &rest[end..]);
        } else {
            if depth == 0 && !c.is_whitespace() {
                out.push(c);
            }
            rest = &rest[c.len_utf8()..];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::expected::{SurfaceBuffer, load_scene, regions};

    /// What a right pass binds on the assignment's Cornell box, drawn so many pixels beside its place;
    /// `position` is what shows as a world position.
    fn judged(shift_px: usize, position: impl Fn(Vec3) -> Vec3) -> Check {
        judged_where(shift_px, position, |_| true)
    }

    /// The same of a pass that draws some of the pixels alone.
    fn judged_where(
        shift_px: usize,
        position: impl Fn(Vec3) -> Vec3,
        drawn: impl Fn(usize) -> bool,
    ) -> Check {
        let (width, height) = (64, 48);
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let scene = root.join("scenes/a2/cbox/tinyrender/cbox_simple_offline.toml");
        let scene = load_scene(&scene).unwrap();
        let surface = SurfaceBuffer::new(&scene, width, height).unwrap();
        let [_, mask] = regions(&scene, width, height).unwrap();
        let camera = scene.camera(width, height).unwrap();
        let film = StageFilm { scene: &scene, camera, surface: &surface, mask: &mask };
        let image = |of: &dyn Fn(usize) -> Vec3| {
            let pixels = (0..width * height).map(|index| {
                let beside = (index % width + shift_px).min(width - 1);
                of(index / width * width + beside)
            });
            Image { width, height, pixels: pixels.collect() }
        };
        let point = |index: usize| surface.pixels[index].1.as_ref();
        let values = BoundValue::ALL.map(|bound| {
            let of = |index| bound.expected(&scene, &film.camera, point(index)?.shape);
            let shown = |index| if drawn(index) { of(index) } else { None };
            (bound, image(&|index| shown(index).unwrap_or_default()))
        });
        let shown = |index| {
            let point = point(index).filter(|_| drawn(index));
            point.map_or(Vec3::ZERO, |point| position(point.position))
        };
        judge_pass("s", &film, &values, &image(&|index| shown(index)), &|_, _| true)
    }

    #[test]
    fn a_pass_that_draws_beside_its_place_makes_a_slip() {
        let place = |check: &Check| {
            let of = |measure: &&Measure| measure.rule == Some(RuleId::PassPlace);
            check.measures.iter().find(of).map(|measure| measure.value)
        };
        let right = judged(0, |p| p);
        assert_eq!(right.verdict, Verdict::Pass, "{}", right.summary);
        assert!(place(&right).is_some_and(|value| value < OFFSET_PX), "{:?}", place(&right));
        let shifted = judged(1, |p| p);
        assert_eq!(shifted.verdict, Verdict::Fail);
        assert!((shifted.error - PriceClass::Slip.price()).abs() < 0.01, "{}", shifted.error);
        assert!(place(&shifted).is_some_and(|value| (value - 1.0).abs() < 0.01));
        // A vertex stage of its own may forward anything; nothing is claimed of where that lies.
        let own = judged(0, |p| 5.0 * p);
        assert_eq!((own.verdict, place(&own)), (Verdict::Pass, Some(0.0)), "{}", own.summary);
    }

    #[test]
    fn another_surface_of_the_same_values_is_seen() {
        let all = |far: f32| judged(0, move |p| if p.x > far { p + Vec3::splat(50.0) } else { p });
        let some = (0..40).map(|step| all(0.25 * step as f32 - 5.0)).find(|check| {
            check.verdict == Verdict::Fail && check.summary.starts_with("another surface is seen")
        });
        assert!(some.is_some_and(|check| check.error == PriceClass::Slip.price()));
        // Elsewhere everywhere: outputs of a vertex stage of its own.
        assert_eq!(all(-1e9).verdict, Verdict::Pass);
    }

    #[test]
    fn what_is_not_drawn_is_no_wrong_value() {
        let some = judged_where(0, |p| p, |index| index % 20 == 0);
        assert!(some.summary.starts_with("nothing is drawn on 95 %"), "{}", some.summary);
        assert_eq!(some.mistake, "surfaces are missing");
        assert!((some.error - PriceClass::Concept.price()).abs() < 1e-9, "{}", some.error);
        let none = judged_where(0, |p| p, |_| false);
        assert!(none.summary.starts_with("nothing is drawn on 100 %"), "{}", none.summary);
        assert_eq!(none.error, 1.0);
    }

    #[test]
    fn comments_and_space_do_not_make_a_stage() {
        let template = "fn f() -> f32 { // TODO\n  return 1.0; }";
        assert!(is_template("fn f()->f32{/* a /* nested */ b */return 1.0;}", template));
        assert!(!is_template("fn f() -> f32 { return 2.0; }", template));
        assert!(is_template("fn f() -> f32 { return 1.0; } // ", template));
    }
}
