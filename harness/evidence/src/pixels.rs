//! The price of a wrongly shaded image: compares its pixels with those of known single mistakes.

mod inputs;

use basecode::{Camera, Frame, Image, MaterialModel, Scene, Vec3};
use renderer_api as api;

use super::answers::Answers;
use super::changes::shader_changes;
use super::price::{self, Price};
use super::shading::{ShadedPoint, Shading};
use crate::expected::SurfacePoint;
use imaging::reference::{Region, RegionMask};
use inputs::inputs;

/// Number of pixels of an image that are looked at.
const PIXELS: usize = 3000;
/// The largest relative difference that is none: WGSL's pow at high exponents.
pub(super) const RELATIVE: f64 = 5e-3;

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
        let of = |index: usize, shading: &Shading| shading.radiance(&shaded(&surfaces[index]));
        let answers = Answers { of: &of, changes: &[], ..answers };
        if price.is_least() || answers.surely_leave_more(price.error - class.price()) {
            return price;
        }
        // A black pixel cannot be told from any other black pixel.
        if answers.total() < LEAST_LEFT * points.len() as f64 {
            return price;
        }
        price.or(name, *class, answers.residual_of_right())
    })
}

/// Surfaces of a scene, and what an image shows of them.
pub(super) struct Looked {
    pub surfaces: Vec<SurfacePoint>,
    pub found: Vec<[f32; 3]>,
}

impl Looked {
    /// Some pixels away from edges, spread over the regions that are wanted.
    pub fn at(
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

/// Fraction of the mean radiance that a mistake must leave to explain an image.
pub(super) const LEAST_LEFT: f64 = 1e-4;

/// Where a shader takes light and eye to be, world space.
#[derive(Clone, Copy)]
pub(super) struct Places {
    pub light: Vec3,
    pub eye: Vec3,
}

/// A point of a scene as a right shader sees it.
pub fn seen_by_shader(scene: &Scene, camera: &Camera, point: &SurfacePoint) -> ShadedPoint {
    let places = Places { light: scene.first_light_position(), eye: camera.eye() };
    places.shaded_point(scene, point)
}

impl Places {
    /// A point as a right shader sees it: textures are averages, mirrors a plain diffuse color.
    pub fn shaded_point(&self, scene: &Scene, point: &SurfacePoint) -> ShadedPoint {
        self.with_material(scene, point.shape, point)
    }

    /// The same with the material of a shape.
    pub fn with_material(&self, scene: &Scene, shape: usize, point: &SurfacePoint) -> ShadedPoint {
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
