//! Part 2.2: what a vertex stage forwards, and where on the film it lands.
//!
//! Three outputs are judged separately: the world position, the world normal and the clip-space position. A position on
//! a surface is right, wherever on the film it appears.

use std::ops::Range;

use basecode::{Camera, Image, Matrices, Ray, Scene, SurfaceInteraction, Vec3};

use super::price::{self, Price, PriceClass, WRONG_W};
use super::stage_film::{OFFSET_PX, StageFilm, from_origin, median_length};
use super::stages::STRAY_FRACTION;
use super::{Check, CheckId, Measure, RuleId, Verdict};
use crate::expected::{SurfaceBuffer, SurfacePoint};
use imaging::reference::RegionMask;

/// The tolerance of a position, relative to its distance from the camera: rasterized attributes
/// against a ray's hit.
const POSITION_RELATIVE: f32 = 2e-3;
/// The tolerance of a unit normal.
const NORMAL_ABSOLUTE: f32 = 1e-2;
/// Fraction of the expected surface that must be visible to judge the forwarded values, or right to tell its place.
const LEAST_SHOWN: f64 = 0.02;

/// The number of kinds of matrices.
const MATRICES: usize = Matrices::ALL.len();

/// World positions and normals, as the fragment stage receives them.
type Frames<'a> = [&'a Image; 2];

/// Part 2.2: judges the world positions and normals that a student's vertex stage forwards, and
/// where on the film they land. `frames` are drawn under each of [`Matrices::ALL`]: the first decides, the others tell
/// what is wrong.
pub fn judge_vertex(scene_name: &str, film: &StageFilm, frames: [Frames; MATRICES]) -> Check {
    let id = CheckId::StageVertex;
    let seen = frames.map(|frames| Seen::of(film, frames));
    let [usual, in_view, in_projection, ..] = &seen;
    if usual.counted == 0 {
        let summary = "no pixel away from edges shows a surface";
        return Check::new(id, scene_name, Verdict::NotJudged, summary);
    }
    let [wrong_position, wrong_normal] = [usual.wrong_position, usual.wrong_normal];
    let offset_px = usual.offset_px;
    let at_most = |rule, name, value, bound| Measure::at_most(rule, name, value, bound);
    let mut measures = vec![
        at_most(
            RuleId::VertexPosition,
            "world positions wrong (fraction of pixels)",
            usual.fraction(wrong_position),
            STRAY_FRACTION,
        ),
        at_most(
            RuleId::VertexNormal,
            "world normals wrong (fraction of pixels)",
            usual.fraction(wrong_normal),
            STRAY_FRACTION,
        ),
        at_most(
            RuleId::VertexClip,
            "surfaces off their place on the film (pixels, median)",
            offset_px,
            OFFSET_PX,
        ),
    ];
    if measures.iter().all(|measure| measure.passed) {
        let summary = "positions and normals reach the fragment stage in world space";
        return Check { measures, ..Check::new(id, scene_name, Verdict::Pass, summary) };
    }
    let mut summary = format!(
        "of {} pixels, {} show nothing, {wrong_position} another world position and {wrong_normal} another world \
         normal than expected",
        usual.counted, usual.missing
    );
    if offset_px > OFFSET_PX {
        summary += &format!("; surfaces lie {offset_px:.2} pixels beside their place");
    }
    let price = price(film, &seen, &frames);
    measures.extend(price.measure());
    let few = |wrong: usize| usual.fraction(wrong) <= STRAY_FRACTION;
    let most = |wrong: usize| wrong * 2 > usual.counted;
    let hint = match (most(usual.missing), most(wrong_position), most(wrong_normal)) {
        _ if few(wrong_position) && few(wrong_normal) => {
            "the image is shifted: look at the clip-space position"
        }
        _ if in_view.lands() && in_projection.lands() => {
            "the projection belongs on the left: clip = projection * view * world"
        }
        _ if price.mistake == Some(WRONG_SIDE) => {
            "a matrix belongs on the left of what it transforms: clip = projection * view * world"
        }
        _ if price.mistake == Some(WRONG_W) => {
            "w of a position is 1, or it is not moved: look at the fourth component"
        }
        _ if price.mistake == Some(DIVIDED) => {
            "the rasterizer divides by w: leave clip space as it is"
        }
        _ if in_view.lands() => "the clip-space position lacks the projection",
        _ if in_projection.lands() => "the clip-space position lacks the view matrix",
        (true, ..) => "nothing is drawn where it should be: look at the clip-space position",
        (_, true, false) => "look at the model matrix and at what is forwarded as position",
        (_, false, true) => "look at the normal matrix and at what is forwarded as normal",
        _ => "",
    };
    let check = Check::new(id, scene_name, Verdict::Fail, summary);
    Check { error: price.error, mistake: price.name(), measures, ..check }.with_hint(hint)
}

/// Positions are row vectors, and the matrices stand on their right.
const WRONG_SIDE: &str = "the position stands on the left of the matrices";
/// Positions are right but for perspective.
const DIVIDED: &str = "the clip-space position is divided by w: values lose their perspective";

/// What frames show.
struct Seen {
    /// Pixels that show a surface, away from edges.
    counted: usize,
    /// Those of them that show nothing.
    missing: usize,
    /// Those whose position is not that of the pixel.
    wrong_position: usize,
    /// Those whose normal is not that of the pixel.
    wrong_normal: usize,
    /// Pixels of the film that show anything.
    shown: usize,
    /// Those of them whose position lies on no surface.
    nowhere: usize,
    /// Those whose normal is not that of the surface where the position lies.
    turned: usize,
    /// The median distance of right positions from the center of their pixel [pixels].
    offset_px: f64,
}

impl Seen {
    fn of(film: &StageFilm, [positions, normals]: Frames) -> Self {
        let StageFilm { scene, camera, surface, mask } = film;
        let mut seen = Self {
            counted: 0,
            missing: 0,
            wrong_position: 0,
            wrong_normal: 0,
            shown: 0,
            nowhere: 0,
            turned: 0,
            offset_px: 0.0,
        };
        let shows = |index: usize| {
            positions.pixels[index] != Vec3::ZERO || normals.pixels[index] != Vec3::ZERO
        };
        let mut offsets = Vec::new();
        for (index, _) in film.interior() {
            let (ray, Some(point)) = &surface.pixels[index] else { continue };
            seen.counted += 1;
            let (p, n) = (positions.pixels[index], normals.pixels[index]);
            seen.missing += usize::from(!shows(index));
            // NaN is never right.
            let right_position = is_near(p, point.position, ray.origin);
            let right_normal = (n - point.normal).length() <= NORMAL_ABSOLUTE;
            seen.wrong_position += usize::from(!right_position);
            seen.wrong_normal += usize::from(!right_normal);
            if right_position {
                offsets.push(film.offset_px(index, p));
            }
        }
        // A few positions are near the right ones by chance.
        if offsets.len() as f64 > LEAST_SHOWN * seen.counted as f64 {
            seen.offset_px = median_length(&mut offsets);
        }
        for index in 0..positions.pixels.len() {
            let (p, n) = (positions.pixels[index], normals.pixels[index]);
            if !shows(index) || mask.pixels[index] & RegionMask::EMITTER != 0 {
                continue;
            }
            seen.shown += 1;
            match surface_at(scene, p, camera.eye()) {
                None => seen.nowhere += 1,
                Some(hit) => {
                    let right = (n - hit.frame_ns.n).length() <= NORMAL_ABSOLUTE;
                    seen.turned += usize::from(!right);
                }
            }
        }
        seen
    }

    fn fraction(&self, wrong: usize) -> f64 {
        wrong as f64 / self.counted as f64
    }

    /// Whether the drawn image is enough to judge by.
    fn tells(&self) -> bool {
        self.shown as f64 > LEAST_SHOWN * self.counted as f64
    }

    /// Whether world positions are right: at their pixels, or elsewhere on the film. Edges between
    /// surfaces are blends.
    fn positions_are_right(&self) -> bool {
        let few = self.nowhere as f64 <= EDGES * self.shown as f64;
        self.tells() && (few || self.fraction(self.wrong_position) <= STRAY_FRACTION)
    }

    fn normals_are_right(&self) -> bool {
        let few = (self.nowhere + self.turned) as f64 <= EDGES * self.shown as f64;
        self.tells() && (few || self.fraction(self.wrong_normal) <= STRAY_FRACTION)
    }

    /// Whether most normals are not those of the surfaces that show.
    fn is_turned(&self) -> bool {
        2 * self.turned > self.shown
    }

    /// Whether surfaces lie where they should on the film.
    fn lands(&self) -> bool {
        let right = |wrong| self.fraction(wrong) <= STRAY_FRACTION;
        let either = right(self.wrong_position) || right(self.wrong_normal);
        let neither = !self.positions_are_right() && !self.normals_are_right();
        (either || (neither && right(self.missing))) && self.offset_px <= OFFSET_PX
    }
}

/// Fraction of the shown pixels that may be blends of surfaces along edges.
const EDGES: f64 = 0.1;

/// The price of wrong frames: the sum of the prices of the three outputs.
fn price(film: &StageFilm, seen: &[Seen; MATRICES], frames: &[Frames; MATRICES]) -> Price {
    let [usual, in_view, in_projection, transposed, _] = seen;
    // Where nothing shows because of the matrices, the frames that show most tell the rest: of those that show the
    // scene as it is, if any.
    let most = |of: Range<usize>| {
        of.max_by_key(|&index| (seen[index].shown, MATRICES - index)).unwrap_or_default()
    };
    let most = Some(most(0..3)).filter(|&most| seen[most].tells()).unwrap_or(most(0..MATRICES));
    let told = &seen[most];
    if !told.tells() || most == MATRICES - 1 {
        // What shows from the origin alone tells no more than that.
        let price = Price { mistake: Some(price::BLACK), ..Price::of_raw(1.0) };
        return match lost_translation(film, frames[most][0]) && !told.is_turned() {
            true => price.or(WRONG_W, PriceClass::Slip, 0.0),
            false => price,
        };
    }
    let mut error = 0.0;
    let mut names: Vec<&str> = Vec::new();
    let mut add = |name: &'static str, class: PriceClass| {
        error += class.price();
        names.push(name);
    };
    if !usual.lands() {
        match (in_view.lands(), in_projection.lands()) {
            (true, true) => add("view and projection are exchanged", PriceClass::Slip),
            (true, false) => add("the projection is missing", PriceClass::Concept),
            (false, true) => add("the view matrix is missing", PriceClass::Concept),
            (false, false) if transposed.lands() => add(WRONG_SIDE, PriceClass::Slip),
            (false, false) => match slip_of_place(film, frames) {
                Some(name) => add(name, PriceClass::Slip),
                None => add(price::ANOTHER_PLACE, PriceClass::Concept),
            },
        }
    }
    if !told.positions_are_right() {
        match slip_of_positions(film, frames[most][0]) {
            Some(name) => add(name, PriceClass::Slip),
            None => add("another world position", PriceClass::Concept),
        }
    }
    if !told.normals_are_right() {
        match slip_of_normals(film, frames[most][1]) {
            Some(name) => add(name, PriceClass::Slip),
            None => add("another world normal", PriceClass::Concept),
        }
    }
    let name = match names.as_slice() {
        [] if lost_perspective(film, frames[0][0]) => DIVIDED,
        [] => "a few pixels are wrong",
        [name] => name,
        _ => "several things",
    };
    let raw = usual.fraction(usual.wrong_position.max(usual.wrong_normal).max(usual.missing));
    let raw = if raw <= STRAY_FRACTION { 1.0 } else { raw };
    Price { error: error.max(PriceClass::Slip.price()).min(raw), raw, mistake: Some(name) }
}

/// Whether positions lie beside their pixel by a slip: mirrored, upside down, a constant offset, a lost translation or
/// perspective.
fn slip_of_place(film: &StageFilm, frames: &[Frames; MATRICES]) -> Option<&'static str> {
    let positions = frames[0][0];
    let (width, height) = (film.surface.width, film.surface.height);
    let place = |by: [f32; 2]| {
        let of = |index: usize, p: Vec3| {
            let [x, y] = film.place_px(p);
            let (own_x, own_y) = ((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
            let x = if by[0] < 0.0 { width as f32 - x } else { x };
            let y = if by[1] < 0.0 { height as f32 - y } else { y };
            [x - own_x, y - own_y]
        };
        let shown = positions.pixels.iter().enumerate().filter(|(_, p)| **p != Vec3::ZERO);
        shown.map(|(index, p)| of(index, *p)).collect::<Vec<_>>()
    };
    // Nearly all within half a pixel of a common offset of a few.
    let constant = |offsets: &[[f32; 2]], most: f32| {
        let mut sorted = offsets.to_vec();
        let mut median = |axis: usize| {
            sorted.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
            sorted.get(sorted.len() / 2).map_or(f32::NAN, |offset| offset[axis])
        };
        let middle = [median(0), median(1)];
        let near =
            |offset: &&[f32; 2]| (0..2).all(|axis| (offset[axis] - middle[axis]).abs() <= 0.5);
        let few = offsets.len() - offsets.iter().filter(near).count();
        middle.iter().all(|offset| offset.abs() <= most)
            && few as f64 <= EDGES * offsets.len() as f64
    };
    let of = |by: [f32; 2], most: f32, name| constant(&place(by), most).then_some(name);
    of([1.0, 1.0], width as f32 / 4.0, "surfaces lie beside their place")
        .or_else(|| of([1.0, -1.0], 1.5, "the image is upside down"))
        .or_else(|| of([-1.0, 1.0], 1.5, "the image is mirrored"))
        .or_else(|| of([-1.0, -1.0], 1.5, "the image is turned by half"))
        .or_else(|| lost_perspective(film, positions).then_some(DIVIDED))
        .or_else(|| lost_translation(film, frames[MATRICES - 1][0]).then_some(WRONG_W))
}

/// Whether positions are those of their pixels but for perspective.
fn lost_perspective(film: &StageFilm, positions: &Image) -> bool {
    let to_clip = film.camera.projection() * film.camera.view();
    let (mut all, mut wrong) = (0usize, 0usize);
    for (index, _) in film.interior() {
        let (ray, Some(point)) = &film.surface.pixels[index] else { continue };
        let Some(point) = point.without_perspective(film.scene, to_clip) else { continue };
        all += 1;
        wrong += usize::from(!is_near(positions.pixels[index], point.position, ray.origin));
    }
    all > 0 && wrong as f64 <= EDGES * all as f64
}

/// Whether positions under [`Matrices::WithoutTranslation`], seen from the origin, show where these put them.
fn lost_translation(film: &StageFilm, positions: &Image) -> bool {
    let SurfaceBuffer { width, height, .. } = *film.surface;
    let Ok(camera) = Camera::new(from_origin(film.scene), width, height) else { return false };
    let camera = camera.with_matrices(Matrices::WithoutTranslation);
    let moved = StageFilm { camera, ..*film };
    // Emitters are white.
    let shown = positions.pixels.iter().enumerate();
    let shown = shown.filter(|(_, p)| ![Vec3::ZERO, Vec3::ONE].contains(p));
    let offsets: Vec<_> = shown.map(|(index, p)| moved.offset_px(index, *p)).collect();
    let near = |offset: &&[f32; 2]| offset.iter().all(|axis| axis.abs() <= 0.5);
    // Near the origin places are not well known.
    offsets.len() as f64 > LEAST_SHOWN * film.surface.pixels.len() as f64
        && 2 * offsets.iter().filter(near).count() > offsets.len()
}

/// The slip that explains positions, if one does: axes that are exchanged or negated, or a constant.
fn slip_of_positions(film: &StageFilm, positions: &Image) -> Option<&'static str> {
    let pairs = || {
        film.interior().filter_map(|(index, _)| {
            let (ray, point) = &film.surface.pixels[index];
            Some((positions.pixels[index], point.as_ref()?.position, ray.origin))
        })
    };
    let all = pairs().count();
    let explains = |change: &dyn Fn(Vec3) -> Vec3| {
        let wrong = pairs().filter(|(p, right, eye)| !is_near(change(*p), *right, *eye)).count();
        wrong as f64 <= EDGES * all as f64
    };
    let mut ratios: Vec<f32> = pairs()
        .map(|(p, right, _)| p.length() / right.length())
        .filter(|r| r.is_finite())
        .collect();
    ratios.sort_by(f32::total_cmp);
    let factor = ratios.get(ratios.len() / 2).filter(|factor| **factor > 1e-3);
    if factor.is_some_and(|factor| explains(&|p| p / *factor)) {
        return Some("the position is multiplied by a constant");
    }
    for (name, axis) in NEGATED {
        if explains(&|p| p - 2.0 * p * axis) {
            return Some(name);
        }
    }
    ORDERS
        .into_iter()
        .any(|[x, y, z]| explains(&|p| Vec3::new(p[x], p[y], p[z])))
        .then_some("the position has its axes exchanged")
}

/// An axis of a position that is negated.
const NEGATED: [(&str, Vec3); 3] = [
    ("x of the position is negated", Vec3::X),
    ("y of the position is negated", Vec3::Y),
    ("z of the position is negated", Vec3::Z),
];

/// Orders of axes but the usual one.
const ORDERS: [[usize; 3]; 5] = [[2, 1, 0], [1, 0, 2], [0, 2, 1], [1, 2, 0], [2, 0, 1]];

/// What a normal may be instead: a name, and the normal.
type OtherNormal = (&'static str, Box<dyn Fn(&SurfacePoint) -> Vec3>);

/// Slips with a normal: negated, with axes exchanged, its magnitudes, or the position instead.
pub(super) fn other_normals() -> Vec<OtherNormal> {
    const EXCHANGED: &str = "the normal has its axes exchanged";
    let axes = |name, [x, y, z]: [usize; 3], signs: [f32; 3]| -> OtherNormal {
        let change = move |p: &SurfacePoint| {
            Vec3::from(signs) * Vec3::new(p.normal[x], p.normal[y], p.normal[z])
        };
        (name, Box::new(change))
    };
    let mut changes = vec![
        axes("the normal is negated", [0, 1, 2], [-1.0; 3]),
        axes("x of the normal is negated", [0, 1, 2], [-1.0, 1.0, 1.0]),
        axes("y of the normal is negated", [0, 1, 2], [1.0, -1.0, 1.0]),
        axes("z of the normal is negated", [0, 1, 2], [1.0, 1.0, -1.0]),
    ];
    changes.extend(ORDERS.map(|order| axes(EXCHANGED, order, [1.0; 3])));
    changes.push(("abs() of the normal", Box::new(|p: &SurfacePoint| p.normal.abs())));
    let position = |p: &SurfacePoint| p.position.normalize_or_zero();
    changes.push(("the position stands for the normal", Box::new(position)));
    changes
}

/// The slip that explains normals, if one does.
fn slip_of_normals(film: &StageFilm, normals: &Image) -> Option<&'static str> {
    other_normals().into_iter().find_map(|(name, change)| {
        let (mut all, mut wrong) = (0usize, 0usize);
        for (index, _) in film.interior() {
            let Some(point) = &film.surface.pixels[index].1 else { continue };
            all += 1;
            let right = (normals.pixels[index] - change(point)).length() <= 2.0 * NORMAL_ABSOLUTE;
            wrong += usize::from(!right);
        }
        (wrong as f64 <= EDGES * all as f64).then_some(name)
    })
}

/// Whether a position is another, seen from `eye`.
fn is_near(p: Vec3, other: Vec3, eye: Vec3) -> bool {
    (p - other).length() <= POSITION_RELATIVE * (other - eye).length()
}

/// The surface on which a position lies, seen from `eye`.
fn surface_at(scene: &Scene, p: Vec3, eye: Vec3) -> Option<SurfaceInteraction> {
    let reach = POSITION_RELATIVE * (p - eye).length();
    if !p.is_finite() || reach == 0.0 {
        return None;
    }
    let axes = [(p - eye).normalize(), Vec3::X, Vec3::Y, Vec3::Z];
    axes.into_iter()
        .find_map(|axis| scene.intersect(&Ray::segment(p - reach * axis, axis, 0.0, 2.0 * reach)))
}

#[cfg(test)]
mod tests;
