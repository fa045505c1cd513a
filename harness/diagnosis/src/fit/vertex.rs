//! Faults of a vertex stage: the values that it forwards, and the place of its triangles on the film.

use basecode::{Mat4, Vec3};

use super::deviation::{Deviation, Of, Value};
use super::linear::least_squares;
use super::search::Fitted;

/// A pixel that shows something.
#[derive(Clone, Copy, Debug)]
pub struct VertexSeen {
    /// The world position that is to be seen here; NaN where nothing is.
    pub position: Vec3,
    /// Its unit normal; NaN likewise.
    pub normal: Vec3,
    /// The position that the stage forwards.
    pub found_position: Vec3,
    /// The normal that it forwards, normalized.
    pub found_normal: Vec3,
    /// The pixel's center in normalized device coordinates.
    pub at: [f64; 2],
    /// Where the position that is forwarded belongs, in the same.
    pub belongs: [f64; 2],
    /// From world to view space.
    pub view: Mat4,
    /// From view to clip space.
    pub projection: Mat4,
}

/// Fraction of the pixels that may differ.
const STRAY: f64 = 0.02;
/// Positions that are nearer, relatively to the largest, are the same.
const POSITION: f32 = 4e-3;
/// Normals that are nearer are the same.
const NORMAL: f32 = 2e-2;
/// Places on the film that are nearer are the same: a tenth of a pixel of a small film.
const PLACE: f64 = 1e-3;
/// Least number of pixels that a diagnosis needs.
const LEAST: usize = 50;

/// What is wrong with a vertex stage, if one thing is.
pub fn explain_vertex(pixels: &[VertexSeen]) -> Option<Fitted> {
    let drawn = |pixel: &&VertexSeen| {
        pixel.found_position.is_finite()
            && pixel.found_normal.is_finite()
            && (pixel.found_position != Vec3::ZERO || pixel.found_normal != Vec3::ZERO)
    };
    let drawn: Vec<&VertexSeen> = pixels.iter().filter(drawn).collect();
    if drawn.len() < LEAST {
        return None;
    }
    // Where the forwarded positions land tells of clip space alone, whatever the pixel should show.
    let placed = holds(&drawn, &|p| apart(p.at, p.belongs) < PLACE);
    let deviations = if placed { None } else { clip(&drawn).map(|deviation| vec![deviation]) };
    let expected = |pixel: &&VertexSeen| pixel.position.is_finite();
    let drawn: Vec<&VertexSeen> = drawn.into_iter().filter(expected).collect();
    let deviations = deviations.or_else(|| {
        if drawn.len() < LEAST {
            return None;
        }
        let position = forwarded(&drawn, Of::Position)?;
        let normal = forwarded(&drawn, Of::Normal)?;
        Some(position.into_iter().chain(normal).collect())
    })?;
    (!deviations.is_empty()).then_some(Fitted { deviations, unexplained: 0.0 })
}

fn holds(pixels: &[&VertexSeen], is: &dyn Fn(&VertexSeen) -> bool) -> bool {
    let wrong = pixels.iter().filter(|pixel| !is(pixel)).count();
    wrong as f64 <= STRAY * pixels.len() as f64
}

fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
}

/// What is forwarded as position or normal: nothing wrong, or the one thing that it is; no answer
/// when it is neither.
fn forwarded(pixels: &[&VertexSeen], of: Of) -> Option<Option<Deviation>> {
    let is_position = of == Of::Position;
    let found = |p: &VertexSeen| if is_position { p.found_position } else { p.found_normal };
    let right = |p: &VertexSeen| if is_position { p.position } else { p.normal };
    let largest = pixels.iter().map(|p| p.position.length()).fold(0.0f32, f32::max);
    let near = |a: Vec3, b: Vec3| match is_position {
        true => (a - b).length() <= POSITION * largest.max(b.length()),
        false => (a - b.normalize_or_zero()).length() <= NORMAL,
    };
    let is = |make: &dyn Fn(&VertexSeen) -> Vec3| holds(pixels, &|p| near(found(p), make(p)));
    if is(&right) {
        return Some(None);
    }
    let name = of.name();
    let say = |quantity, value, words: String| Some(Some(Deviation { of, quantity, value, words }));
    let form = |form, words: &str| say("is", Value::Form(form), format!("the {name} {words}"));
    if is(&|p| -right(p)) {
        return say("factor", Value::Number(-1.0), format!("the {name} is negated"));
    }
    if is(&|_| Vec3::ZERO) {
        return say("factor", Value::Number(0.0), format!("the {name} is not forwarded"));
    }
    let matrix = |p: &VertexSeen| p.view;
    if is_position {
        if is(&|p| matrix(p).transform_point3(p.position)) {
            return form("view", "is forwarded in view space, not in world space");
        }
        if is(&|p| p.normal) {
            return form("normal", "that is forwarded is the normal");
        }
        if let Some([x, y, z]) = by_axis(pixels, is_position) {
            let factor = Vec3::new(x as f32, y as f32, z as f32);
            if is(&|p| factor * p.position) {
                return if (x - y).abs() < 0.01 * x.abs() && (y - z).abs() < 0.01 * y.abs() {
                    say("factor", Value::Number(x), format!("the position is multiplied by {x:.3}"))
                } else {
                    let words = format!("the position is multiplied by ({x:.3}, {y:.3}, {z:.3})");
                    say("axes", Value::Three([x, y, z]), words)
                };
            }
        }
        let shift = pixels.iter().map(|p| p.found_position - p.position).sum::<Vec3>()
            / pixels.len() as f32;
        if is(&|p| p.position + shift) {
            let shift = shift.to_array().map(f64::from);
            let [x, y, z] = shift;
            return say(
                "shift",
                Value::Three(shift),
                format!("the position is off by ({x:.3}, {y:.3}, {z:.3})"),
            );
        }
    } else {
        if is(&|p| matrix(p).transform_vector3(p.normal)) {
            return form("view", "is forwarded in view space, not in world space");
        }
        if is(&|p| p.position) {
            return form("position", "that is forwarded is the position");
        }
        for signs in [
            [-1.0, 1.0, 1.0],
            [1.0, -1.0, 1.0],
            [1.0, 1.0, -1.0],
            [1.0, -1.0, -1.0],
            [-1.0, 1.0, -1.0],
            [-1.0, -1.0, 1.0],
        ] {
            if is(&|p| Vec3::from(signs) * p.normal) {
                let turned: Vec<&str> = signs
                    .iter()
                    .zip(["x", "y", "z"])
                    .filter(|(s, _)| **s < 0.0)
                    .map(|(_, axis)| axis)
                    .collect();
                let words = format!("{} of the normal is negated", turned.join(" and "));
                return say("axes", Value::Three(signs.map(f64::from)), words);
            }
        }
    }
    None
}

/// Factors of each axis of a position.
fn by_axis(pixels: &[&VertexSeen], is_position: bool) -> Option<[f64; 3]> {
    let factor = |axis: usize| {
        let row = |p: &&VertexSeen| {
            let (a, b) = if is_position {
                (p.position, p.found_position)
            } else {
                (p.normal, p.found_normal)
            };
            ([f64::from(a[axis])], f64::from(b[axis]), 1.0)
        };
        let rows: Vec<_> = pixels.iter().map(row).collect();
        least_squares::<1>(&rows, 1).map(|[x]| x)
    };
    Some([factor(0)?, factor(1)?, factor(2)?])
}

/// Where vertices land, by the positions that are seen there.
fn clip(pixels: &[&VertexSeen]) -> Option<Deviation> {
    let say =
        |quantity, value, words: String| Some(Deviation { of: Of::Clip, quantity, value, words });
    let form = |form, words: &str| say("is", Value::Form(form), words.to_owned());
    let lands = |make: &dyn Fn(&VertexSeen) -> basecode::Vec4| {
        holds(pixels, &|p| {
            let clip = make(p);
            let ndc = [f64::from(clip.x / clip.w), f64::from(clip.y / clip.w)];
            apart(ndc, p.at) < 5.0 * PLACE
        })
    };
    let world = |p: &VertexSeen| p.found_position.extend(1.0);
    if lands(&|p| p.view * world(p)) {
        return form("view", "the projection matrix is missing from the clip-space position");
    }
    if lands(&|p| p.projection * world(p)) {
        return form("projection", "the view matrix is missing from the clip-space position");
    }
    if lands(&|p| p.view * p.projection * world(p)) {
        return form("exchanged", "view and projection are multiplied in the wrong order");
    }
    if lands(&world) {
        return form("world", "view and projection are missing from the clip-space position");
    }
    // Scaled and shifted by axis.
    let axis = |axis: usize| {
        let row = |p: &&VertexSeen| ([1.0, p.belongs[axis]], p.at[axis], 1.0);
        least_squares::<2>(&pixels.iter().map(row).collect::<Vec<_>>(), 2)
    };
    let ([dx, x], [dy, y]) = (axis(0)?, axis(1)?);
    let made = |p: &VertexSeen| [dx + x * p.belongs[0], dy + y * p.belongs[1]];
    if !holds(pixels, &|p| apart(p.at, made(p)) < PLACE) {
        return None;
    }
    let is = |a: f64, b: f64| (a - b).abs() < PLACE;
    match (is(x, 1.0) && is(y, 1.0), is(dx, 0.0) && is(dy, 0.0)) {
        (true, true) => None,
        (true, false) => say(
            "shift",
            Value::Three([dx, dy, 0.0]),
            format!(
                "everything is drawn ({dx:.4}, {dy:.4}) off its place, in normalized device coordinates"
            ),
        ),
        (false, true) => say(
            "axes",
            Value::Three([x, y, 1.0]),
            match (is(x, -1.0), is(y, -1.0), is(x, 1.0), is(y, 1.0)) {
                (true, false, _, true) => "the image is mirrored left to right".into(),
                (false, true, true, _) => "the image is upside down".into(),
                (true, true, ..) => "the image is turned by 180 degrees".into(),
                _ => format!("the image is stretched by {x:.3} across and {y:.3} up"),
            },
        ),
        (false, false) => None,
    }
}
