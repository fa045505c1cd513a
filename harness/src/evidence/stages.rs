//! Parts 2.1 to 2.4 apart: a student's render pass under stages of ours that show what it binds,
//! and a student's stages under a pass of ours.
//!
//! No reference shader is needed: ours write positions, normals and uniforms, not radiance.

use std::collections::BTreeMap;

use basecode::{Camera, Image, MaterialModel, Scene, Vec3};

use super::price::{Class, Price};
use super::{Check, Measure, Verdict};
use crate::expected::SurfaceBuffer;
use crate::imaging::reference::RegionMask;

/// A vertex stage that does what the contract says, for use with a student's fragment stages.
pub const VERTEX: &str =
    concat!(include_str!("shaders/contract.wgsl"), include_str!("shaders/vertex.wgsl"));

/// A fragment stage that writes the interpolated world position.
pub const SHOW_POSITION: &str =
    concat!(include_str!("shaders/contract.wgsl"), include_str!("shaders/position.wgsl"));
/// A fragment stage that writes the interpolated world normal, normalised.
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
    fn rule(self) -> &'static str {
        match self {
            Self::CameraPosition => "pass.camera_position",
            Self::LightPosition => "pass.light_position",
            Self::LightIntensity => "pass.light_intensity",
            Self::RhoD => "pass.rho_d",
            Self::RhoS => "pass.rho_s",
            Self::Exponent => "pass.exponent",
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
        let material = scene.material_of(shape);
        let phong = material.model == MaterialModel::Phong;
        let scale = material.energy_scale();
        match self {
            Self::CameraPosition => Some(camera.eye()),
            Self::LightPosition => Some(scene.first_light_position()),
            Self::LightIntensity => Some(scene.first_light_intensity()),
            Self::RhoD => Some(scale * material.diffuse.average()),
            Self::RhoS if phong => Some(scale * material.specular.average()),
            Self::RhoS => (material.model == MaterialModel::Mirror).then_some(Vec3::ZERO),
            // Blue tells the pipeline apart: a diffuse material must be drawn by `diffuse.fs`.
            Self::Exponent if phong => Some(Vec3::new(material.exponent, 0.0, 1.0)),
            Self::Exponent => None,
        }
    }
}

/// The tolerance of a bound value, relative to its largest component: it travels as f32.
const BOUND_RELATIVE: f32 = 1e-4;
/// So many interior pixels may still differ: a rasteriser's coverage along seams inside a shape.
const STRAY_FRACTION: f64 = 5e-3;
/// The tolerance of a position, relative to its distance from the camera: rasterised attributes
/// against a ray's hit.
const POSITION_RELATIVE: f32 = 2e-3;
/// How far surfaces may lie from their place on the film [pixels]: hardware snaps vertices to 1/256.
const OFFSET_PX: f64 = 0.04;
/// The tolerance of a unit normal.
const NORMAL_ABSOLUTE: f32 = 1e-2;

/// Part 2.1: judges the frames that a student's pass drew with stages that show one bound value each.
pub fn judge_pass(
    scene_name: &str,
    scene: &Scene,
    surface: &SurfaceBuffer,
    mask: &RegionMask,
    frames: &[(BoundValue, Image)],
) -> Check {
    let id = "pass.uniforms";
    let Ok(camera) = scene.camera(surface.width, surface.height) else {
        return Check::new(id, scene_name, Verdict::NotJudged, "the scene has no camera");
    };
    let mut measures = Vec::new();
    let mut first_wrong = None;
    let (mut wrong_total, mut total) = (0usize, 0usize);
    for (bound, frame) in frames {
        let (mut wrong, mut counted) = (0usize, 0usize);
        let mut example = None;
        for (index, shape) in interior(surface, mask) {
            let Some(expected) = bound.expected(scene, &camera, shape) else { continue };
            counted += 1;
            let found = frame.pixels[index];
            let close = (found - expected).abs().max_element()
                <= BOUND_RELATIVE * expected.abs().max_element().max(1e-3);
            if !close {
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
                index % surface.width,
                index / surface.width
            );
            let hint = if found == Vec3::ZERO {
                "it was never set, or nothing was drawn there"
            } else {
                ""
            };
            let price = Price::of_raw(wrong_total as f64 / total as f64);
            let price = match measures.iter().filter(|measure| !measure.passed).count() {
                1 => price.or("one value is wrong", Class::Slip, 0.0),
                2 => price.or("two values are wrong", Class::Concept, 0.0),
                _ => price,
            };
            let price = wrong_shapes(scene, &camera, surface, mask, frames).price(price);
            measures.extend(price.measure());
            Check { error: price.error, ..Check::new(id, scene_name, Verdict::Fail, summary) }
                .with_hint(hint)
        }
    };
    check.measures = measures;
    check
}

/// What is wrong with the shapes of a pass whose values are wrong.
struct WrongShapes {
    /// Shapes in view.
    shapes: usize,
    /// Those that show a wrong value.
    wrong: usize,
    /// Whether each of those shows what belongs to one other shape, or to none.
    exchanged: bool,
    /// Whether each shows its albedos without the energy scale.
    unscaled: bool,
}

impl WrongShapes {
    fn price(&self, price: Price) -> Price {
        let mut price = price;
        if self.exchanged {
            price = price.or("a shape has another's material", Class::Slip, 0.0);
        }
        if self.unscaled {
            price = price.or("albedos without the energy scale", Class::Slip, 0.0);
        }
        if self.wrong == 1 && self.shapes > 1 {
            price = price.or("one shape is wrong or missing", Class::Slip, 0.0);
        }
        price
    }
}

fn wrong_shapes(
    scene: &Scene,
    camera: &Camera,
    surface: &SurfaceBuffer,
    mask: &RegionMask,
    frames: &[(BoundValue, Image)],
) -> WrongShapes {
    let close = |found: Vec3, expected: Vec3| {
        (found - expected).abs().max_element()
            <= BOUND_RELATIVE * expected.abs().max_element().max(1e-3)
    };
    // What each shape shows, at its pixel in the middle of the list.
    let mut pixels: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (index, shape) in interior(surface, mask) {
        pixels.entry(shape).or_default().push(index);
    }
    let shapes = scene.shapes().len();
    let mut seen = WrongShapes { shapes: pixels.len(), wrong: 0, exchanged: true, unscaled: true };
    for (shape, pixels) in &pixels {
        let shows = |expected: &dyn Fn(BoundValue) -> Option<Vec3>| {
            frames.iter().all(|(bound, frame)| {
                let right = |index: &&usize| {
                    expected(*bound).is_none_or(|expected| close(frame.pixels[**index], expected))
                };
                let strays = pixels.len() - pixels.iter().filter(right).count();
                strays as f64 <= STRAY_FRACTION * pixels.len() as f64
            })
        };
        let of = |shape: usize| move |bound: BoundValue| bound.expected(scene, camera, shape);
        if shows(&of(*shape)) {
            continue;
        }
        seen.wrong += 1;
        seen.exchanged &= (0..shapes).any(|other| other != *shape && shows(&of(other)));
        let scale = scene.material_of(*shape).energy_scale();
        seen.unscaled &= shows(&|bound| {
            let expected = bound.expected(scene, camera, *shape)?;
            let scaled = matches!(bound, BoundValue::RhoD | BoundValue::RhoS);
            Some(if scaled { expected / scale } else { expected })
        });
    }
    seen
}

/// Part 2.2: judges the world positions and normals that a student's vertex stage forwards, and
/// where on the film they land.
pub fn judge_vertex(
    scene_name: &str,
    camera: &Camera,
    surface: &SurfaceBuffer,
    mask: &RegionMask,
    positions: &Image,
    normals: &Image,
) -> Check {
    let id = "stage.vertex";
    let (mut counted, mut wrong_position, mut wrong_normal, mut missing) =
        (0usize, 0usize, 0usize, 0usize);
    let (mut not_negated, mut not_flipped) = (0usize, 0usize);
    let mut offsets = Vec::new();
    for (index, _) in interior(surface, mask) {
        let (ray, Some(point)) = &surface.pixels[index] else { continue };
        counted += 1;
        let (p, n) = (positions.pixels[index], normals.pixels[index]);
        let reach = POSITION_RELATIVE * (point.position - ray.origin).length();
        missing += usize::from(p == Vec3::ZERO && n == Vec3::ZERO);
        // What is no number is never right.
        let right_position = (p - point.position).length() <= reach;
        let right_normal = (n - point.normal).length() <= NORMAL_ABSOLUTE;
        wrong_position += usize::from(!right_position);
        wrong_normal += usize::from(!right_normal);
        if right_position {
            offsets.push(offset_px(camera, surface, index, p));
        }
        let negated = (n + point.normal).length() <= NORMAL_ABSOLUTE;
        not_negated += usize::from(!negated);
        let (x, y) = (index % surface.width, index / surface.width);
        let flipped = positions.pixels[(surface.height - 1 - y) * surface.width + x];
        let upside_down = (flipped - point.position).length() <= 4.0 * reach;
        not_flipped += usize::from(!upside_down);
    }
    if counted == 0 {
        return Check::new(
            id,
            scene_name,
            Verdict::NotJudged,
            "no pixel away from edges shows a surface",
        );
    }
    let fraction = |wrong: usize| wrong as f64 / counted as f64;
    let mut measures = vec![
        Measure::at_most(
            "vertex.position",
            "world positions wrong (fraction of pixels)",
            fraction(wrong_position),
            STRAY_FRACTION,
        ),
        Measure::at_most(
            "vertex.normal",
            "world normals wrong (fraction of pixels)",
            fraction(wrong_normal),
            STRAY_FRACTION,
        ),
    ];
    let offset_px = median_length(&mut offsets);
    let name = "surfaces off their place on the film (pixels, median)";
    measures.push(Measure::at_most("vertex.clip", name, offset_px, OFFSET_PX));
    let passed = measures.iter().all(|measure| measure.passed);
    let mut check = if passed {
        let summary = "positions and normals reach the fragment stage in world space";
        Check::new(id, scene_name, Verdict::Pass, summary)
    } else {
        let mut summary = format!(
            "of {counted} pixels, {missing} show nothing, {wrong_position} another world position and {wrong_normal} \
             another world normal than expected"
        );
        if offset_px > OFFSET_PX {
            summary += &format!("; surfaces lie {offset_px:.2} pixels beside their place");
        }
        let price = Price::of_raw(fraction(wrong_position.max(wrong_normal)));
        let strays = |wrong: usize| fraction(wrong) <= STRAY_FRACTION;
        let price = match (strays(wrong_position), strays(wrong_normal)) {
            (true, false) => price.or("the normal alone is wrong", Class::Concept, 0.0).or(
                "the normal is negated",
                Class::Slip,
                fraction(not_negated),
            ),
            (false, true) => price.or("the position alone is wrong", Class::Concept, 0.0),
            (true, true) => {
                Price::of_raw(1.0).or("surfaces lie beside their place", Class::Slip, 0.0)
            }
            (false, false) => price,
        };
        let price = price.or("the image is upside down", Class::Slip, fraction(not_flipped));
        measures.extend(price.measure());
        // Elsewhere it may be either, or the clip-space position: what the diagnosis tells.
        let most = |wrong: usize| wrong * 2 > counted;
        let hint = match (most(missing), most(wrong_position), most(wrong_normal)) {
            _ if strays(wrong_position) && strays(wrong_normal) => {
                "the image is shifted: look at the clip-space position"
            }
            (true, ..) => "nothing is drawn where it should be: look at the clip-space position",
            (_, true, false) => "look at the model matrix and at what is forwarded as position",
            (_, false, true) => "look at the normal matrix and at what is forwarded as normal",
            _ => "",
        };
        let check = Check::new(id, scene_name, Verdict::Fail, summary);
        Check { error: price.error, ..check }.with_hint(hint)
    };
    check.measures = measures;
    check
}

/// How far a world position lies from the centre of the pixel that shows it [pixels, x and y].
fn offset_px(camera: &Camera, film: &SurfaceBuffer, index: usize, position: Vec3) -> [f32; 2] {
    let (x, y) = (index % film.width, index / film.width);
    let ndc = (camera.projection() * camera.view()).project_point3(position);
    let (width, height) = (film.width as f32, film.height as f32);
    let at = [(0.5 + 0.5 * ndc.x) * width, (0.5 - 0.5 * ndc.y) * height];
    [at[0] - x as f32 - 0.5, at[1] - y as f32 - 0.5]
}

/// The length of the median offset; 0 when there is none.
fn median_length(offsets: &mut [[f32; 2]]) -> f64 {
    let mut median = |axis: usize| {
        offsets.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
        offsets.get(offsets.len() / 2).map_or(0.0, |offset| f64::from(offset[axis]))
    };
    median(0).hypot(median(1))
}

/// Pixels away from edges and emitters, with the shape that they show.
fn interior<'a>(
    surface: &'a SurfaceBuffer,
    mask: &'a RegionMask,
) -> impl Iterator<Item = (usize, usize)> + 'a {
    surface.pixels.iter().zip(&mask.pixels).enumerate().filter_map(
        |(index, ((_, point), value))| {
            let clear = value & (RegionMask::EDGE | RegionMask::EMITTER) == 0;
            point.as_ref().filter(|_| clear).map(|point| (index, point.shape))
        },
    )
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
    use super::*;

    #[test]
    fn comments_and_space_do_not_make_a_stage() {
        let template = "fn f() -> f32 { // TODO\n  return 1.0; }";
        assert!(is_template("fn f()->f32{/* a /* nested */ b */return 1.0;}", template));
        assert!(!is_template("fn f() -> f32 { return 2.0; }", template));
        assert!(is_template("fn f() -> f32 { return 1.0; } // ", template));
    }
}
