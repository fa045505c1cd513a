//! Parts 2.1 to 2.4 judged separately: a student's render pass with Umbra's stages, which show the values it binds, and
//! a student's stages in Umbra's pass.
//!
//! No reference shader is needed: Umbra's stages write positions, normals and uniforms, not radiance.

use std::collections::BTreeMap;

use basecode::{Camera, Image, MaterialModel, Scene, Vec2, Vec3};

use super::price::{self, Price, PriceClass, SURFACES_MISSING};
use super::stage_film::{OFFSET_PX, StageFilm, median_length};
use super::{Check, CheckId, Measure, RuleId, Verdict};

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

/// A uniform that a render pass must set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoundValue {
    /// `frame.camera_position`.
    CameraPosition,
    /// `frame.light_position`.
    LightPosition,
    /// `frame.light_intensity`.
    LightIntensity,
    /// `material.rho_d`.
    RhoD,
    /// `material.rho_s`: Phong materials, and that none reaches a mirror.
    RhoS,
    /// `material.exponent`, Phong materials only.
    Exponent,
}

impl BoundValue {
    /// All of them, in the order of the contract.
    pub const ALL: [Self; 6] = [
        Self::CameraPosition,
        Self::LightPosition,
        Self::LightIntensity,
        Self::RhoD,
        Self::RhoS,
        Self::Exponent,
    ];

    /// The uniform's name in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::CameraPosition => "frame.camera_position",
            Self::LightPosition => "frame.light_position",
            Self::LightIntensity => "frame.light_intensity",
            Self::RhoD => "material.rho_d",
            Self::RhoS => "material.rho_s",
            Self::Exponent => "material.exponent",
        }
    }

    /// The rule that it is judged by.
    pub fn rule(self) -> RuleId {
        match self {
            Self::CameraPosition => RuleId::PassCameraPosition,
            Self::LightPosition => RuleId::PassLightPosition,
            Self::LightIntensity => RuleId::PassLightIntensity,
            Self::RhoD => RuleId::PassRhoD,
            Self::RhoS => RuleId::PassRhoS,
            Self::Exponent => RuleId::PassExponent,
        }
    }

    /// A fragment stage that writes the value; as `phong.fs` with `model` 1, as `diffuse.fs` with 0.
    /// The blue channel of scalars tells which of the two drew.
    pub fn stage(self, phong: bool) -> String {
        let value = match self {
            Self::Exponent => format!("vec3f(material.exponent.x, 0.0, {}.0)", u8::from(phong)),
            // As a shader that has no specular term: what is no Phong material shows none.
            Self::RhoS if !phong => "vec3f(0.0)".to_owned(),
            _ => format!("{}.xyz", self.name()),
        };
        let contract = include_str!("shaders/contract.wgsl");
        format!(
            "{contract}\n@fragment\nfn fs_main(@location(0) p: vec3f, @location(1) n: vec3f) -> @location(0) vec4f {{\n    \
             return vec4f({value}, 1.0);\n}}\n"
        )
    }

    /// What a right pass binds for a shape; nothing where the contract leaves it open.
    pub fn expected(self, scene: &Scene, camera: &Camera, shape: usize) -> Option<Vec3> {
        let phong = scene.material_of(shape).model == MaterialModel::Phong;
        match self {
            Self::CameraPosition => Some(camera.eye()),
            Self::LightPosition => Some(scene.first_light_position()),
            Self::LightIntensity => Some(scene.first_light_intensity()),
            Self::RhoD | Self::RhoS | Self::Exponent => self.bound(scene, shape, phong),
        }
    }

    /// What shows of the material of a shape that is drawn by the Phong pipeline, or by the diffuse one.
    fn bound(self, scene: &Scene, shape: usize, phong_draws: bool) -> Option<Vec3> {
        let material = scene.material_of(shape);
        let scale = material.energy_scale();
        match self {
            Self::RhoD => Some(scale * material.diffuse.average()),
            // A mirror has no specular term, whoever draws it.
            Self::RhoS if material.model == MaterialModel::Mirror => Some(Vec3::ZERO),
            Self::RhoS if phong_draws => Some(scale * material.specular.average()),
            // Blue tells the pipeline apart: a diffuse material must be drawn by `diffuse.fs`.
            Self::Exponent if phong_draws => Some(Vec3::new(material.exponent, 0.0, 1.0)),
            _ => None,
        }
    }
}

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
    let (scene, camera) = (film.scene, &film.camera);
    let mut measures = Vec::new();
    let mut first_wrong = None;
    let mut all_wanted = true;
    let (mut wrong_total, mut total) = (0usize, 0usize);
    for (bound, frame) in frames {
        let (mut wrong, mut counted) = (0usize, 0usize);
        let mut example = None;
        for (index, shape) in film.interior() {
            let Some(expected) = bound.expected(scene, camera, shape) else { continue };
            if !wanted(*bound, shape) {
                all_wanted = false;
                continue;
            }
            counted += 1;
            let found = frame.pixels[index];
            if !is_close(found, expected) {
                wrong += 1;
                example = example.or(Some((index, shape, expected, found)));
            }
        }
        if counted == 0 {
            continue;
        }
        (wrong_total, total) = (wrong_total + wrong, total + counted);
        let fraction = wrong as f64 / counted as f64;
        let measure = Measure::at_most(
            bound.rule(),
            format!("{} wrong (fraction of pixels)", bound.name()),
            fraction,
            STRAY_FRACTION,
        );
        if let Some(example) = example.filter(|_| !measure.passed) {
            first_wrong = first_wrong.or(Some((*bound, example, fraction)));
        }
        measures.push(measure);
    }
    let mut check = match first_wrong {
        None if total == 0 => Check::new(
            id,
            scene_name,
            Verdict::NotJudged,
            "no pixel away from edges shows a surface",
        ),
        None => {
            let summary = format!("{} uniforms reach the shaders on every object", measures.len());
            Check::new(id, scene_name, Verdict::Pass, summary)
        }
        Some((bound, (index, shape, expected, found), fraction)) => {
            let summary = format!(
                "{} is wrong on {:.0} % of the pixels; on \"{}\" at ({}, {}): expected {expected}, found {found}",
                bound.name(),
                100.0 * fraction,
                scene.shapes()[shape].name,
                index % film.surface.width,
                index / film.surface.width
            );
            let hint = if found == Vec3::ZERO { "it was never set" } else { "" };
            let seen = Seen::of(film, frames, positions);
            let (summary, hint) = seen.in_words(film).unwrap_or((summary, hint));
            let wrong = wrong_total as f64 / total as f64;
            let shapes = wrong_shapes(film, frames);
            // A pass that shows hardly one value, on no shape, is no pass, whatever it draws.
            let price = match wrong > NO_PASS && shapes.wrong == shapes.shapes {
                true if seen.all_values_right => {
                    Price::of_raw(wrong).or(SURFACES_MISSING, PriceClass::Concept, 0.0)
                }
                true => Price::of_raw(wrong),
                false => {
                    let other = other_pipeline(film, frames);
                    let price = shapes.price(price_of_values(wrong, &measures, other));
                    match seen.all_values_right {
                        true => price.or(SURFACES_MISSING, PriceClass::Slip, 0.0),
                        false => price,
                    }
                }
            };
            // What is seen has its values: one state of the pipeline is wrong, such as the depth test.
            let few = STRAY_FRACTION * seen.all as f64;
            let price = match seen.all_values_right && seen.empty.0 as f64 <= few {
                true => price.or("another surface is seen", PriceClass::Slip, 0.0),
                false => price,
            };
            measures.extend(price.measure());
            Check {
                error: price.error,
                mistake: price.name(),
                ..Check::new(id, scene_name, Verdict::Fail, summary)
            }
            .with_hint(hint)
        }
    };
    // Values that other surfaces share do not tell that these are seen.
    if check.verdict == Verdict::Pass && all_wanted {
        let seen = Seen::of(film, frames, positions);
        let fraction = seen.elsewhere.0 as f64 / seen.all.max(1) as f64;
        if fraction > STRAY_FRACTION
            && fraction < HALF
            && let Some((summary, hint)) = seen.in_words(film)
        {
            let error = PriceClass::Slip.price();
            check = Check { error, ..Check::new(id, scene_name, Verdict::Fail, summary) };
            check = check.with_hint(hint);
            check.mistake = "another surface is seen".to_owned();
        }
    }
    let offset_px = if all_wanted { median_offset_px(film, positions) } else { 0.0 };
    let placed = Measure::at_most(
        RuleId::PassPlace,
        "surfaces off their place on the film (pixels, median)",
        offset_px,
        OFFSET_PX,
    );
    let least = PriceClass::Slip.price();
    if !placed.passed && check.error < least {
        let summary = format!("surfaces lie {offset_px:.2} pixels beside their place");
        check = Check { error: least, ..Check::new(id, scene_name, Verdict::Fail, summary) };
        check = check.with_hint("look at the viewport and at the matrices that the pass binds");
        check.mistake = "surfaces lie beside their place".to_owned();
    }
    measures.push(placed);
    check.measures = measures;
    check
}

/// What a pass with Umbra's stages shows where a surface belongs.
struct Seen {
    /// Pixels that show a surface when the pass is right.
    all: usize,
    /// Those that nothing is drawn on, and the first.
    empty: (usize, Option<usize>),
    /// Those that another surface is seen on, and the first.
    elsewhere: (usize, Option<usize>),
    /// Whether all others show the right values.
    all_values_right: bool,
}

impl Seen {
    fn of(film: &StageFilm, frames: &[(BoundValue, Image)], positions: &Image) -> Self {
        let mut seen =
            Self { all: 0, empty: (0, None), elsewhere: (0, None), all_values_right: true };
        let mut right = 0;
        for (index, shape) in film.interior() {
            let (ray, Some(point)) = &film.surface.pixels[index] else { continue };
            seen.all += 1;
            let shown = frames.iter().map(|(_, frame)| frame).chain([positions]);
            let found = positions.pixels[index];
            let distance = (found - point.position).length();
            let is_right = |(bound, frame): &(BoundValue, Image)| {
                let expected = bound.expected(film.scene, &film.camera, shape);
                expected.is_none_or(|expected| is_close(frame.pixels[index], expected))
            };
            let is_right = frames.iter().all(is_right);
            // Close behind it, on the same pixel: the values are another surface's.
            let depth = (point.position - ray.origin).length();
            let is_behind = distance > BEHIND * depth
                && Vec2::from(film.offset_px(index, found)).length() < OFFSET_PX as f32;
            let place = if shown.map(|frame| frame.pixels[index]).all(|value| value == Vec3::ZERO) {
                &mut seen.empty
            } else if distance > NEAR * depth || (is_behind && !is_right) {
                &mut seen.elsewhere
            } else {
                right += usize::from(is_right);
                continue;
            };
            *place = (place.0 + 1, place.1.or(Some(index)));
        }
        let shown = seen.all - seen.empty.0 - seen.elsewhere.0;
        seen.all_values_right = right > 0 && right as f64 >= (1.0 - STRAY_FRACTION) * shown as f64;
        seen
    }

    /// A sentence and a hint, where the surfaces themselves are wrong and not only their values.
    fn in_words(&self, film: &StageFilm) -> Option<(String, &'static str)> {
        let few = STRAY_FRACTION * self.all as f64;
        let (what, (count, first), hint) = if self.empty.0 as f64 > few {
            let hint =
                "look at what is drawn: indices, culling, depth test, clearing, and matrices";
            ("nothing is drawn", self.empty, hint)
        } else if self.elsewhere.0 as f64 > few && self.all_values_right {
            let hint = "look at depth test, culling and matrices";
            ("another surface is seen", self.elsewhere, hint)
        } else {
            return None;
        };
        let index = first?;
        let shape = film.surface.pixels[index].1.as_ref().map(|point| point.shape)?;
        let sentence = format!(
            "{what} on {:.0} % of the pixels that show a surface, with Umbra's own stages; first at ({}, {}), where \
             \"{}\" belongs",
            100.0 * count as f64 / self.all as f64,
            index % film.surface.width,
            index / film.surface.width,
            film.scene.shapes()[shape].name
        );
        Some((sentence, hint))
    }
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

/// Positions on one pixel that are further apart than this, relative to their distance from the camera, are those of
/// two surfaces.
const BEHIND: f32 = 5e-3;

/// Positions are near, relative to their distance from the camera: a few pixels of the small film.
const NEAR: f32 = 0.1;

/// From this fraction of wrong pixels on, all values together, a pass has set nothing.
const NO_PASS: f64 = 0.9;

/// The price of values if this fraction of all of them is wrong. `measures` has the fraction of each value, and
/// `other_pipeline` says whether the diffuse pipeline draws Phong materials.
fn price_of_values(wrong: f64, measures: &[Measure], other_pipeline: bool) -> Price {
    let price = match measures.iter().filter(|measure| !measure.passed).count() {
        1 if other_pipeline => Price::of_raw(wrong).or(
            "Phong materials are drawn by the diffuse pipeline",
            PriceClass::Concept,
            0.0,
        ),
        1 => Price::of_raw(wrong).or("one value is wrong", PriceClass::Slip, 0.0),
        2 => Price::of_raw(wrong).or("two values are wrong", PriceClass::Concept, 0.0),
        _ => Price::of_raw(wrong).or(price::UNKNOWN, PriceClass::Unknown, 0.0),
    };
    let most_wrong = measures.iter().map(|measure| measure.value).fold(0.0, f64::max);
    price.or("some of the film is wrong", PriceClass::Slip, 0.08 * most_wrong)
}

/// Whether all Phong materials in view are drawn by the diffuse pipeline.
fn other_pipeline(film: &StageFilm, frames: &[(BoundValue, Image)]) -> bool {
    let Some((_, frame)) = frames.iter().find(|(bound, _)| *bound == BoundValue::Exponent) else {
        return false;
    };
    let phong = film
        .interior()
        .filter(|(_, shape)| film.scene.material_of(*shape).model == MaterialModel::Phong);
    let (all, blue) = phong.fold((0usize, 0usize), |(all, blue), (index, _)| {
        (all + 1, blue + usize::from(frame.pixels[index].z != 0.0))
    });
    all > 0 && blue as f64 <= STRAY_FRACTION * all as f64
}

/// What is wrong with the shapes of a pass whose values are wrong.
struct WrongShapes {
    /// Shapes in view.
    shapes: usize,
    /// Those that show a wrong value.
    wrong: usize,
    /// The slips that explain each of those.
    slips: Vec<&'static str>,
}

impl WrongShapes {
    fn price(&self, price: Price) -> Price {
        let explained =
            self.slips.iter().fold(price, |price, name| price.or(name, PriceClass::Slip, 0.0));
        match self.wrong == 1 && self.shapes > 1 {
            true => explained.or("one shape is wrong or missing", PriceClass::Slip, 0.0),
            false => explained,
        }
    }
}

/// The slip that diffuse shapes are drawn by the Phong pipeline, and the reverse.
const EXCHANGED: &str = "diffuse and Phong pipeline are exchanged";
/// The slip that a shape shows what belongs to another.
const ANOTHERS: &str = "a shape has another's material";

/// What a shape shows of a value, if a pass makes a slip: nothing where it is left open.
type Slip<'a> = (&'static str, Box<dyn Fn(BoundValue, usize) -> Option<Vec3> + 'a>);

/// The slips of a pass that concern materials.
fn slips<'a>(scene: &'a Scene, camera: &'a Camera) -> Vec<Slip<'a>> {
    let right = move |bound: BoundValue, shape| bound.expected(scene, camera, shape);
    let phong = move |shape| scene.material_of(shape).model == MaterialModel::Phong;
    let count = scene.shapes().len();
    let mut slips: Vec<Slip> = vec![
        (
            "albedos without the energy scale",
            Box::new(move |bound, shape| {
                let expected = right(bound, shape)?;
                let scaled = matches!(bound, BoundValue::RhoD | BoundValue::RhoS);
                let scale = scene.material_of(shape).energy_scale();
                Some(if scaled { expected / scale } else { expected })
            }),
        ),
        (
            "the energy scale twice",
            Box::new(move |bound, shape| {
                let expected = right(bound, shape)?;
                let scaled = matches!(bound, BoundValue::RhoD | BoundValue::RhoS);
                let scale = scene.material_of(shape).energy_scale();
                Some(if scaled { expected * scale } else { expected })
            }),
        ),
        (
            "albedos are grey",
            Box::new(move |bound, shape| {
                let expected = right(bound, shape)?;
                let scaled = matches!(bound, BoundValue::RhoD | BoundValue::RhoS);
                Some(if scaled { Vec3::splat(expected.x) } else { expected })
            }),
        ),
        (
            "rho_d and rho_s are exchanged",
            Box::new(move |bound, shape| {
                let scale = scene.material_of(shape).energy_scale();
                match bound {
                    BoundValue::RhoD => Some(scale * scene.material_of(shape).specular.average()),
                    BoundValue::RhoS if phong(shape) => {
                        Some(scale * scene.material_of(shape).diffuse.average())
                    }
                    _ => right(bound, shape),
                }
            }),
        ),
        (
            EXCHANGED,
            Box::new(move |bound, shape| match bound {
                BoundValue::RhoD | BoundValue::RhoS => bound.bound(scene, shape, !phong(shape)),
                // What the other pipeline shows: blue tells.
                BoundValue::Exponent if phong(shape) => {
                    Some(Vec3::new(scene.material_of(shape).exponent, 0.0, 0.0))
                }
                _ => right(bound, shape),
            }),
        ),
    ];
    // Another's material, with the other's pipeline or one's own.
    let of_index = |shape: usize| {
        let with_material = scene.shapes().iter().position(|other| other.material == shape);
        with_material.unwrap_or(shape)
    };
    let mut whose: Vec<Vec<usize>> = (0..count).map(|other| vec![other; count]).collect();
    whose.push((0..count).map(|shape| shape.saturating_sub(1)).collect());
    whose.push((0..count).map(|shape| (shape + 1).min(count - 1)).collect());
    whose.push((0..count).map(of_index).collect());
    for whose in whose {
        let own_pipeline = whose.clone();
        let own_pipeline = move |bound: BoundValue, shape: usize| match bound {
            BoundValue::RhoD | BoundValue::RhoS | BoundValue::Exponent => {
                bound.bound(scene, own_pipeline[shape], phong(shape))
            }
            _ => right(bound, shape),
        };
        slips.push((ANOTHERS, Box::new(own_pipeline)));
        slips.push((ANOTHERS, Box::new(move |bound, shape| right(bound, whose[shape]))));
    }
    slips
}

fn wrong_shapes(film: &StageFilm, frames: &[(BoundValue, Image)]) -> WrongShapes {
    let (scene, camera) = (film.scene, &film.camera);
    let mut pixels: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (index, shape) in film.interior() {
        pixels.entry(shape).or_default().push(index);
    }
    let shows = |shape: usize, expected: &dyn Fn(BoundValue) -> Option<Vec3>| {
        let pixels = &pixels[&shape];
        frames.iter().all(|(bound, frame)| {
            let Some(expected) = expected(*bound) else { return true };
            let wrong =
                pixels.iter().filter(|index| !is_close(frame.pixels[**index], expected)).count();
            wrong as f64 <= STRAY_FRACTION * pixels.len() as f64
        })
    };
    let right = |shape: usize| shows(shape, &|bound| bound.expected(scene, camera, shape));
    let wrong: Vec<usize> = pixels.keys().copied().filter(|shape| !right(*shape)).collect();
    // One shape may have another's material while the others have their own.
    // The blue of the exponent's frame: which pipeline draws.
    let by_phong = |shape: usize| {
        let exponents = frames.iter().find(|(bound, _)| *bound == BoundValue::Exponent);
        exponents.is_none_or(|(_, frame)| {
            let pixels = &pixels[&shape];
            2 * pixels.iter().filter(|index| frame.pixels[**index].z != 0.0).count() > pixels.len()
        })
    };
    let is_phong = |shape: usize| scene.material_of(shape).model == MaterialModel::Phong;
    let explains = |(name, value): &Slip| {
        if *name == EXCHANGED && !pixels.keys().all(|&shape| is_phong(shape) || by_phong(shape)) {
            return false;
        }
        let all = pixels.keys().copied().filter(|shape| *name != ANOTHERS || wrong.contains(shape));
        all.into_iter().all(|shape| shows(shape, &|bound| value(bound, shape)))
    };
    let slips = slips(scene, camera);
    let slips = slips.iter().filter(|slip| explains(slip)).map(|(name, _)| *name).collect();
    WrongShapes { shapes: pixels.len(), wrong: wrong.len(), slips }
}

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
