//! The price of a wrongly shaded image: compares its pixels with those of known single mistakes.

use basecode::{Camera, Frame, Image, MaterialModel, Scene, Vec3};
use renderer_api as api;

use super::changes::shader_changes;
use super::price::{self, Answers, Class, Price};
use super::shading::{ShadedPoint, Shading};
use crate::expected::SurfacePoint;
use crate::imaging::reference::{Region, RegionMask};

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

/// What a mistake in the values of a render pass leaves of an image unexplained.
pub struct LeftByPass {
    /// The mistake.
    pub name: &'static str,
    /// Sum of differences from what it draws over the sum of that, at most 1.
    pub left: f64,
    /// Whether it draws any light: one black image is as good as another.
    pub lights: bool,
}

/// How far single mistakes in the values that a pass binds explain an unshadowed realtime image: those that are no
/// mistake of a shader as well, such as a missing term.
pub fn left_by_pass(scene: &Scene, image: &Image, mask: &RegionMask) -> Vec<LeftByPass> {
    let Ok(camera) = scene.camera(image.width, image.height) else { return Vec::new() };
    let Looked { surfaces, found } = Looked::at(scene, &camera, image, mask, &|_| true);
    let places = Places { light: scene.first_light_position(), eye: camera.eye() };
    let radiances = |shaded: &dyn Fn(&SurfacePoint) -> ShadedPoint| -> Vec<[f64; 3]> {
        surfaces.iter().map(|point| Shading::default().radiance(&shaded(point))).collect()
    };
    let right = radiances(&|point| places.shaded_point(scene, point));
    let sum: f64 = right.iter().flatten().sum();
    let mean = (sum / (3 * right.len()).max(1) as f64).max(f64::MIN_POSITIVE);
    let left = |(name, shaded): &PassMistake| {
        let grazes = |point: &SurfacePoint| {
            let point = shaded(point);
            point.wo[2].abs() < GRAZING || point.wi[2].abs() < GRAZING
        };
        let changed = radiances(shaded);
        let told: Vec<usize> = (0..surfaces.len()).filter(|&at| !grazes(&surfaces[at])).collect();
        let found: Vec<[f32; 3]> = told.iter().map(|&at| found[at]).collect();
        let answers = Answers {
            found: &found,
            of: &|index, _| changed[told[index]],
            unit: &|_| mean,
            group: &|_| 0,
            relative: RELATIVE,
            changes: &[],
        };
        // A scene of which little is left tells nothing of this mistake.
        let tells = 4 * told.len() >= surfaces.len();
        let lights = tells && answers.total() >= LEAST_LEFT * told.len() as f64;
        let left = if tells { answers.residual_of_right().min(1.0) } else { 0.0 };
        LeftByPass { name, left, lights }
    };
    pass_mistakes(scene, places).iter().map(left).collect()
}

/// Where a direction lies in the surface, as from the origin on a floor through it, rounding decides what is black.
const GRAZING: f64 = 1e-3;

/// A mistake in the values of a pass: its name, and what a right shader makes of a point under it.
type PassMistake<'a> = (&'static str, Box<dyn Fn(&SurfacePoint) -> ShadedPoint + 'a>);

fn pass_mistakes(scene: &Scene, right: Places) -> Vec<PassMistake<'_>> {
    let at = |name, places: Places| -> PassMistake {
        (name, Box::new(move |point| places.shaded_point(scene, point)))
    };
    let changed = |name, change: fn(&mut ShadedPoint)| -> PassMistake {
        let shaded = move |point: &SurfacePoint| {
            let mut shaded = right.shaded_point(scene, point);
            change(&mut shaded);
            shaded
        };
        (name, Box::new(shaded))
    };
    vec![
        at(price::VIEWER_AT_ORIGIN, Places { eye: Vec3::ZERO, ..right }),
        at(price::LIGHT_AT_ORIGIN, Places { light: Vec3::ZERO, ..right }),
        at("the light stands where the viewer does", Places { light: right.eye, ..right }),
        changed("the intensity is grey", |p| p.intensity = [p.intensity[0]; 3]),
        changed("the intensity is divided by 4 pi", |p| {
            p.intensity = p.intensity.map(|v| v / (2.0 * std::f64::consts::TAU));
        }),
        changed("rho_d and rho_s are exchanged", |p| {
            std::mem::swap(&mut p.material.diffuse, &mut p.material.specular);
        }),
        changed("albedos are grey", |p| {
            p.material.diffuse = [p.material.diffuse[0]; 3];
            p.material.specular = [p.material.specular[0]; 3];
        }),
        changed("albedos without the energy scale", |p| p.scale = 1.0),
        changed("the energy scale twice", |p| p.scale *= p.scale),
    ]
}

/// Fraction of the mean radiance that a mistake must leave to explain an image.
const LEAST_LEFT: f64 = 1e-4;

/// Where a shader takes light and eye to be, world space.
#[derive(Clone, Copy)]
struct Places {
    light: Vec3,
    eye: Vec3,
}

/// A mistake in a shader's use of its inputs: its name, and what the shader shades instead.
type Input<'a> = (&'static str, Class, Box<dyn Fn(&SurfacePoint) -> ShadedPoint + 'a>);

/// The mistakes that are looked for.
fn inputs<'a>(scene: &'a Scene, camera: &'a Camera) -> Vec<Input<'a>> {
    let right = Places { light: scene.first_light_position(), eye: camera.eye() };
    let view = camera.view();
    let seen = view.transform_point3(right.light);
    let at = |name, class, places: Places| -> Input<'a> {
        (name, class, Box::new(move |point| places.shaded_point(scene, point)))
    };
    let changed = |name, change: fn(&mut ShadedPoint)| -> Input<'a> {
        let shaded = move |point: &SurfacePoint| {
            let mut shaded = right.shaded_point(scene, point);
            change(&mut shaded);
            shaded
        };
        (name, Class::Slip, Box::new(shaded))
    };
    let mut inputs = vec![
        at(price::LIGHT_IN_VIEW_SPACE, Class::Slip, Places { light: seen, ..right }),
        at(
            price::LIGHT_IN_WORLD_SPACE,
            Class::Slip,
            Places { light: view.inverse().transform_point3(right.light), ..right },
        ),
        at(
            price::VIEWER_NOT_TURNED,
            Class::Slip,
            Places { eye: -view.transform_vector3(view.w_axis.truncate()), ..right },
        ),
        at(price::VIEWER_AT_ORIGIN, Class::Slip, Places { eye: Vec3::ZERO, ..right }),
        at(price::LIGHT_AT_ORIGIN, Class::Concept, Places { light: Vec3::ZERO, ..right }),
        at(
            "light and viewer are exchanged",
            Class::Concept,
            Places { light: right.eye, eye: right.light },
        ),
        changed(price::LIGHT_NEGATED, |p| p.wi = p.wi.map(|v| -v)),
        changed(price::VIEWER_NEGATED, |p| p.wo = p.wo.map(|v| -v)),
        changed("the intensity is clamped to 1", |p| p.intensity = p.intensity.map(|v| v.min(1.0))),
        changed("the intensity is grey", |p| p.intensity = [p.intensity[0]; 3]),
    ];
    let of = |name, class, shaded: Box<dyn Fn(&SurfacePoint) -> ShadedPoint + 'a>| -> Input<'a> {
        (name, class, shaded)
    };
    inputs.extend([
        of(
            "the distance is that of the viewer",
            Class::Slip,
            Box::new(move |point| ShadedPoint {
                distance: f64::from((right.eye - point.position).length()),
                ..right.shaded_point(scene, point)
            }),
        ),
        of(
            "the distance is that of the light from the origin",
            Class::Slip,
            Box::new(move |point| ShadedPoint {
                distance: f64::from(right.light.length()),
                ..right.shaded_point(scene, point)
            }),
        ),
        of(
            "the direction to the viewer is the viewer's position",
            Class::Slip,
            Box::new(move |point| {
                let frame = Frame::from_normal(point.normal);
                let wo = frame.to_local(right.eye.normalize_or_zero()).to_array().map(f64::from);
                ShadedPoint { wo, ..right.shaded_point(scene, point) }
            }),
        ),
        of(
            "the direction to the light is the light's position",
            Class::Concept,
            Box::new(move |point| {
                let frame = Frame::from_normal(point.normal);
                let wi = frame.to_local(right.light.normalize_or_zero()).to_array().map(f64::from);
                let distance = f64::from(right.light.length());
                ShadedPoint { wi, distance, ..right.shaded_point(scene, point) }
            }),
        ),
        of(
            "the normal is that of a triangle's first corner",
            Class::Slip,
            Box::new(move |point| {
                let shape = &scene.shapes()[point.shape];
                let corner = shape.triangles[point.primitive][0] as usize;
                let normal = shape.normals.get(corner).copied().unwrap_or(point.normal);
                let normal = normal.try_normalize().unwrap_or(point.normal);
                right.shaded_point(scene, &SurfacePoint { normal, ..*point })
            }),
        ),
        of(
            "the normal points up",
            Class::Concept,
            Box::new(move |point| {
                right.shaded_point(scene, &SurfacePoint { normal: Vec3::Y, ..*point })
            }),
        ),
    ]);
    for exponent in [1.0, 2.0, 4.0, 5.0, 8.0, 10.0, 16.0, 20.0, 32.0, 50.0, 64.0, 100.0, 128.0] {
        let shaded = move |point: &SurfacePoint| {
            let mut shaded = right.shaded_point(scene, point);
            shaded.material.exponent = exponent;
            shaded
        };
        inputs.push(of("the exponent is a constant", Class::Slip, Box::new(shaded)));
    }
    inputs
}

/// A point of a scene as a right shader sees it.
pub fn seen_by_shader(scene: &Scene, camera: &Camera, point: &SurfacePoint) -> ShadedPoint {
    let places = Places { light: scene.first_light_position(), eye: camera.eye() };
    places.shaded_point(scene, point)
}

impl Places {
    /// A point as a right shader sees it: textures are averages, mirrors a plain diffuse color.
    fn shaded_point(&self, scene: &Scene, point: &SurfacePoint) -> ShadedPoint {
        let material = scene.material_of(point.shape);
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

    /// The names that explain what a right stage draws of the Cornell box with its points changed so.
    fn explained(change: &dyn Fn(&mut ShadedPoint), at: &dyn Fn(&mut Places)) -> Vec<&'static str> {
        let (width, height) = (64, 48);
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let scene = root.join("scenes/a2/probes/exponents/tinyrender/exponents_realtime.toml");
        let scene = load_scene(&scene).unwrap();
        let [_, mask] = regions(&scene, width, height).unwrap();
        let camera = scene.camera(width, height).unwrap();
        let mut places = Places { light: scene.first_light_position(), eye: camera.eye() };
        at(&mut places);
        let pixel = |index: usize| {
            let ray = camera.ray((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
            let Some(point) = SurfacePoint::cast(&scene, ray) else { return Vec3::ZERO };
            let mut shaded = places.shaded_point(&scene, &point);
            change(&mut shaded);
            Vec3::from(Shading::default().radiance(&shaded).map(|value| value as f32))
        };
        let pixels = (0..width * height).map(pixel).collect();
        let left = left_by_pass(&scene, &Image { width, height, pixels }, &mask);
        let explains = left.iter().filter(|left| left.left < 1e-3 && left.lights);
        explains.map(|left| left.name).collect()
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
}
