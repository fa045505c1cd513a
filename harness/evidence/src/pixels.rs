//! The price of a wrongly shaded image: compares its pixels with those of known single mistakes.

mod inputs;
mod missing;
mod slips;

use basecode::{Camera, Frame, Image, MaterialModel, Scene, Vec3};
use renderer_api as api;

use super::CheckId;
use super::answers::Answers;
use super::changes::shader_changes;
use super::price::{self, Price, SURFACES_MISSING};
use super::shading::{ShadedPoint, Shading};
use crate::expected::SurfacePoint;
use imaging::reference::{Region, RegionMask};
use inputs::inputs;
use missing::Missing;
use slips::{Slip, materials_of_others, pass_slips, vertex_slips};

/// Number of pixels of an image that are looked at.
const PIXELS: usize = 3000;
/// The largest relative difference that is none: WGSL's pow at high exponents.
const RELATIVE: f64 = 5e-3;

/// The price of an unshadowed realtime `image` that is `raw` off, on the regions that are wanted:
/// those of Phong materials (`phong`) or of diffuse ones.
pub fn price(
    scene: &Scene,
    image: &Image,
    mask: &RegionMask,
    wanted: &dyn Fn(&Region) -> bool,
    raw: f64,
) -> Price {
    let Ok(camera) = scene.camera(image.width, image.height) else { return Price::of_raw(raw) };
    let Looked { surfaces, found } = Looked::at(scene, &camera, image, mask, wanted);
    let places = Places { light: scene.first_light_position(), eye: camera.eye() };
    let shaded = |point: &SurfacePoint| places.shaded_point(scene, point);
    let points: Vec<ShadedPoint> = surfaces.iter().map(shaded).collect();
    let of = |index: usize, shading: &Shading| shading.radiance(&points[index]);
    let sum: f64 =
        (0..points.len()).map(|index| of(index, &Shading::default()).iter().sum::<f64>()).sum();
    let mean = (sum / (3 * points.len()).max(1) as f64).max(f64::MIN_POSITIVE);
    let phong = points.iter().any(|point| point.material.model == api::MATERIAL_PHONG);
    let changes = shader_changes(phong);
    let unit = |_| mean;
    let answers = Answers {
        found: &found,
        of: &of,
        unit: &unit,
        group: &|_| 0,
        relative: RELATIVE,
        changes: &changes,
    };
    if found.iter().all(|value| *value == [0.0; 3]) {
        return Price { mistake: Some(price::BLACK), ..Price::of_raw(raw) };
    }
    let price = answers.price(Some(raw));
    inputs(scene, &camera).iter().fold(price, |price, (name, class, shaded)| {
        if price.is_least() {
            return price;
        }
        let points: Vec<ShadedPoint> = surfaces.iter().map(shaded).collect();
        let of = |index: usize, shading: &Shading| shading.radiance(&points[index]);
        let answers = Answers { of: &of, changes: &[], ..answers };
        // A black pixel cannot be told from any other black pixel.
        if answers.total() < LEAST_LEFT * points.len() as f64 {
            return price;
        }
        price.or(name, *class, answers.residual_of_right())
    })
}

/// Surfaces of a scene, and what an image shows of them.
struct Looked {
    surfaces: Vec<SurfacePoint>,
    found: Vec<[f32; 3]>,
}

impl Looked {
    /// Some pixels away from edges, spread over the regions that are wanted.
    fn at(
        scene: &Scene,
        camera: &Camera,
        image: &Image,
        mask: &RegionMask,
        wanted: &dyn Fn(&Region) -> bool,
    ) -> Self {
        let clear = |value: &u16| {
            value & (RegionMask::EDGE | RegionMask::EMITTER) == 0
                && value & RegionMask::INDEX != 0
                && wanted(mask.region(*value))
        };
        let pixels = mask.pixels.iter().enumerate().filter(|(_, value)| clear(value));
        let pixels: Vec<usize> = pixels.map(|(index, _)| index).collect();
        let step = pixels.len().div_ceil(PIXELS).max(1);
        let mut looked = Self { surfaces: Vec::new(), found: Vec::new() };
        for index in pixels.into_iter().step_by(step) {
            let (x, y) = (index % image.width, index / image.width);
            let ray = camera.ray(x as f32 + 0.5, y as f32 + 0.5);
            let Some(point) = SurfacePoint::cast(scene, ray) else { continue };
            looked.surfaces.push(point);
            looked.found.push(image.pixels[index].into());
        }
        looked
    }
}

/// What a slip leaves of an image unexplained.
pub struct LeftBySlip {
    /// What it belongs to: the render pass or the vertex stage.
    pub of: CheckId,
    /// The slip.
    pub name: &'static str,
    /// Sum of differences from what it draws over the sum of that, at most 1.
    pub left: f64,
    /// The same of what is right.
    pub left_by_right: f64,
    /// Whether it draws any light: one black image is as good as another.
    pub lights: bool,
    /// What is left on diffuse and on Phong surfaces alone, where it draws light on them.
    pub left_of_lit: [Option<f64>; 2],
}

/// How far single slips in what reaches a fragment stage explain an unshadowed realtime image: those that are no slip
/// of the stage as well, such as a missing term.
pub fn left_by_slips(scene: &Scene, image: &Image, mask: &RegionMask) -> Vec<LeftBySlip> {
    let Ok(camera) = scene.camera(image.width, image.height) else { return Vec::new() };
    let Looked { surfaces, found } = Looked::at(scene, &camera, image, mask, &|_| true);
    let places = Places { light: scene.first_light_position(), eye: camera.eye() };
    let right = |point: &SurfacePoint| places.shaded_point(scene, point);
    let radiance = |shaded: &ShadedPoint| Shading::default().radiance(shaded);
    let sum: f64 = surfaces.iter().flat_map(|point| radiance(&right(point))).sum();
    let mean = (sum / (3 * surfaces.len()).max(1) as f64).max(f64::MIN_POSITIVE);
    let mut slips = pass_slips(scene, places);
    slips.extend(vertex_slips(scene, &camera, places));
    slips.push(Slip {
        of: CheckId::PassUniforms,
        name: "surfaces are drawn with the material of others",
        shaded: materials_of_others(scene, places, &surfaces, &found),
    });
    let unit = |_| mean;
    let as_it_is = |index: usize, _: &Shading| radiance(&right(&surfaces[index]));
    let left_by_right = answers(&found, &as_it_is, &unit).residual_of_right().min(1.0);
    let left = |slip: &Slip| {
        let shaded: Vec<Option<ShadedPoint>> = surfaces.iter().map(&slip.shaded).collect();
        let told = shaded.iter().zip(&found);
        let told = told.filter_map(|(shaded, found)| Some((shaded.as_ref()?, *found)));
        let grazes = |p: &ShadedPoint| p.wo[2].abs() < GRAZING || p.wi[2].abs() < GRAZING;
        let told: Vec<_> = told.filter(|(shaded, _)| !grazes(shaded)).collect();
        let left_of_lit = [api::MATERIAL_DIFFUSE, api::MATERIAL_PHONG].map(|model| {
            let own = told.iter().filter(|(shaded, _)| shaded.material.model == model);
            let own = own.map(|(shaded, found)| (radiance(shaded), *found));
            let own = own.filter(|(radiance, _)| *radiance != [0.0; 3]);
            let (changed, found): (Vec<[f64; 3]>, Vec<[f32; 3]>) = own.unzip();
            let of = |index: usize, _: &Shading| changed[index];
            let left = || answers(&found, &of, &unit).residual_of_right().min(1.0);
            (found.len() >= LEAST_SHOWN).then(left)
        });
        let (changed, found): (Vec<[f64; 3]>, Vec<[f32; 3]>) =
            told.into_iter().map(|(shaded, found)| (radiance(shaded), found)).unzip();
        let slipped = |index: usize, _: &Shading| changed[index];
        let answers = answers(&found, &slipped, &unit);
        // A scene of which little is left tells nothing of this slip.
        let tells = 4 * found.len() >= surfaces.len();
        let lights = tells && answers.total() >= LEAST_LEFT * found.len() as f64;
        let left = if tells { answers.residual_of_right().min(1.0) } else { 0.0 };
        LeftBySlip { of: slip.of, name: slip.name, left, left_by_right, lights, left_of_lit }
    };
    let mut all: Vec<LeftBySlip> = slips.iter().map(left).collect();
    let missing = Missing::of(scene, &surfaces, &found, places, mean);
    all.push(LeftBySlip {
        of: CheckId::PassUniforms,
        name: SURFACES_MISSING,
        left: missing.left,
        left_by_right,
        lights: missing.shown.iter().sum::<usize>() >= LEAST_SHOWN,
        left_of_lit: missing.shown.map(|shown| (shown >= LEAST_SHOWN).then_some(missing.left)),
    });
    all
}

/// Number of points that tell something of surfaces.
const LEAST_SHOWN: usize = 10;

/// What was found beside what `of` says of each question.
fn answers<'a>(
    found: &'a [[f32; 3]],
    of: &'a dyn Fn(usize, &Shading) -> [f64; 3],
    unit: &'a dyn Fn(usize) -> f64,
) -> Answers<'a> {
    Answers { found, of, unit, group: &|_| 0, relative: RELATIVE, changes: &[] }
}

/// Where a direction lies in the surface, as from the origin on a floor through it, rounding decides what is black.
const GRAZING: f64 = 1e-3;

/// Fraction of the mean radiance that a mistake must leave to explain an image.
const LEAST_LEFT: f64 = 1e-4;

/// Where a shader takes light and eye to be, world space.
#[derive(Clone, Copy)]
struct Places {
    light: Vec3,
    eye: Vec3,
}

/// A point of a scene as a right shader sees it.
pub fn seen_by_shader(scene: &Scene, camera: &Camera, point: &SurfacePoint) -> ShadedPoint {
    let places = Places { light: scene.first_light_position(), eye: camera.eye() };
    places.shaded_point(scene, point)
}

impl Places {
    /// A point as a right shader sees it: textures are averages, mirrors a plain diffuse color.
    fn shaded_point(&self, scene: &Scene, point: &SurfacePoint) -> ShadedPoint {
        self.with_material(scene, point.shape, point)
    }

    /// The same with the material of a shape.
    fn with_material(&self, scene: &Scene, shape: usize, point: &SurfacePoint) -> ShadedPoint {
        let material = scene.material_of(shape);
        let phong = material.model == MaterialModel::Phong;
        let frame = Frame::from_normal(point.normal);
        let local = |v: Vec3| frame.to_local(v.normalize()).to_array().map(f64::from);
        let to_light = self.light - point.position;
        ShadedPoint {
            material: api::MaterialValue {
                model: if phong { api::MATERIAL_PHONG } else { api::MATERIAL_DIFFUSE },
                diffuse: material.diffuse.average().into(),
                specular: material.specular.average().into(),
                exponent: material.exponent,
            },
            scale: f64::from(material.energy_scale()),
            wo: local(self.eye - point.position),
            wi: local(to_light),
            intensity: scene.first_light_intensity().to_array().map(f64::from),
            distance: f64::from(to_light.length()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::expected::{load_scene, regions};

    /// The names that explain what a right stage draws of a scene with its points changed so.
    fn explained(change: &dyn Fn(&mut ShadedPoint), at: &dyn Fn(&mut Places)) -> Vec<&'static str> {
        explained_of(EXPONENTS, &|scene, places, point| {
            let mut places = *places;
            at(&mut places);
            let mut shaded = places.shaded_point(scene, point);
            change(&mut shaded);
            shaded
        })
    }

    const EXPONENTS: &str = "probes/exponents/tinyrender/exponents_realtime.toml";
    const BOX: &str = "cbox/tinyrender/cbox_simple_realtime.toml";

    /// The names that explain what a right stage draws of such points of a scene.
    fn explained_of(
        scene: &str,
        of: &dyn Fn(&Scene, &Places, &SurfacePoint) -> ShadedPoint,
    ) -> Vec<&'static str> {
        let (width, height) = (64, 48);
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let scene = root.join("scenes/a2").join(scene);
        let scene = load_scene(&scene).unwrap();
        let [_, mask] = regions(&scene, width, height).unwrap();
        let camera = scene.camera(width, height).unwrap();
        let places = Places { light: scene.first_light_position(), eye: camera.eye() };
        let pixel = |index: usize| {
            let ray = camera.ray((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
            let Some(point) = SurfacePoint::cast(&scene, ray) else { return Vec3::ZERO };
            let shaded = of(&scene, &places, &point);
            Vec3::from(Shading::default().radiance(&shaded).map(|value| value as f32))
        };
        let pixels = (0..width * height).map(pixel).collect();
        let left = left_by_slips(&scene, &Image { width, height, pixels }, &mask);
        let explains = left.iter().filter(|left| left.left < 1e-3 && left.lights);
        // What is dark may be missing as well: where there are holes, nobody's pixels tell.
        explains.map(|left| left.name).filter(|name| *name != SURFACES_MISSING).collect()
    }

    /// What the slip that surfaces are missing leaves of right pictures that are changed so, by pixel; and whether
    /// diffuse and Phong surfaces are shown.
    fn left_by_missing(change: &dyn Fn(usize, Vec3) -> Vec3) -> (f64, [bool; 2]) {
        let (width, height) = (64, 48);
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let scene = load_scene(&root.join("scenes/a2").join(EXPONENTS)).unwrap();
        let [_, mask] = regions(&scene, width, height).unwrap();
        let camera = scene.camera(width, height).unwrap();
        let places = Places { light: scene.first_light_position(), eye: camera.eye() };
        let pixel = |index: usize| {
            let ray = camera.ray((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
            let point = SurfacePoint::cast(&scene, ray);
            let right = point.map_or([0.0; 3], |point| {
                Shading::default().radiance(&places.shaded_point(&scene, &point))
            });
            change(index, Vec3::from(right.map(|value| value as f32)))
        };
        let pixels = (0..width * height).map(pixel).collect();
        let left = left_by_slips(&scene, &Image { width, height, pixels }, &mask);
        let own = left.iter().find(|left| left.name == SURFACES_MISSING).unwrap();
        (own.left, own.left_of_lit.map(|left| left.is_some()))
    }

    #[test]
    fn surfaces_that_are_missing_leave_the_others_right() {
        let some = left_by_missing(&|index, right| if index % 3 == 0 { Vec3::ZERO } else { right });
        assert_eq!(some.0, 0.0);
        assert!(some.1.contains(&true));
        // Nothing that is drawn shows of a black picture that it is right, and what is drawn darker is not.
        assert_eq!(left_by_missing(&|_, _| Vec3::ZERO).1, [false; 2]);
        assert!(left_by_missing(&|_, right| 0.5 * right).0 > 0.5);
    }

    #[test]
    fn a_slip_in_the_values_of_a_pass_is_told_by_its_pictures() {
        let exchanged = |point: &mut ShadedPoint| {
            std::mem::swap(&mut point.material.diffuse, &mut point.material.specular);
        };
        assert_eq!(explained(&exchanged, &|_| ()), ["rho_d and rho_s are exchanged"]);
        let light = |places: &mut Places| places.light = places.eye;
        let at_viewer = "the light stands where the viewer does";
        assert_eq!(explained(&|_| (), &light), [at_viewer]);
        // What is right, black or a shader's own needs no pass.
        let none: [&str; 0] = [];
        assert_eq!(explained(&|point| point.intensity = [0.0; 3], &|_| ()), none);
        assert_eq!(explained(&|point| point.material.specular = [0.0; 3], &|_| ()), none);
    }

    #[test]
    fn a_slip_with_positions_normals_or_materials_is_told_by_its_pictures() {
        let moved = |change: &dyn Fn(&Scene, Vec3) -> Vec3| {
            explained_of(EXPONENTS, &|scene, places, point| {
                let position = change(scene, point.position);
                places.shaded_point(scene, &SurfacePoint { position, ..*point })
            })
        };
        let to_clip = |scene: &Scene| {
            let camera = scene.camera(64, 48).unwrap();
            camera.projection() * camera.view()
        };
        let undivided = moved(&|scene, p| p / (to_clip(scene) * p.extend(1.0)).w);
        assert_eq!(undivided, ["the position is not divided by its w"]);
        let upside_down = moved(&|scene, p| {
            let to_clip = to_clip(scene);
            let ndc = to_clip.project_point3(p);
            to_clip.inverse().project_point3(Vec3::new(ndc.x, -ndc.y, ndc.z))
        });
        assert_eq!(upside_down, ["positions are upside down"]);
        let turned = explained_of(BOX, &|scene, places, point| {
            let normal = Vec3::new(point.normal.x, point.normal.y, -point.normal.z);
            places.shaded_point(scene, &SurfacePoint { normal, ..*point })
        });
        assert_eq!(turned, ["z of the normal is negated"]);
        let material = |of: &dyn Fn(usize, usize) -> usize| {
            explained_of(EXPONENTS, &|scene, places, point| {
                places.with_material(scene, of(point.shape, scene.shapes().len()), point)
            })
        };
        let others = "surfaces are drawn with the material of others";
        let next = material(&|shape, count| (shape + 1) % count);
        assert_eq!(next, ["every surface is drawn with the material of the next one"]);
        let first = material(&|_, _| 0);
        assert_eq!(first, [others]);
        // All of it at once is no slip.
        let none: [&str; 0] = [];
        assert_eq!(moved(&|_, p| 0.5 * p + Vec3::splat(0.3)), none);
    }
}
