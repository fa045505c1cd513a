//! The price of a wrongly shaded image: compares its pixels with those of known single mistakes.

use basecode::{Camera, Frame, Image, MaterialModel, Scene, Vec3};
use renderer_api as api;

use super::changes::shader_changes;
use super::price::{self, Answers, Price, PriceClass};
use super::shading::{ShadedPoint, Shading};
use crate::expected::SurfacePoint;
use imaging::reference::{Region, RegionMask};

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

/// A mistake in a shader's use of its inputs: its name, and what the shader shades instead.
type Input<'a> = (&'static str, PriceClass, Box<dyn Fn(&SurfacePoint) -> ShadedPoint + 'a>);

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
        (name, PriceClass::Slip, Box::new(shaded))
    };
    let mut inputs = vec![
        at(price::LIGHT_IN_VIEW_SPACE, PriceClass::Slip, Places { light: seen, ..right }),
        at(
            price::LIGHT_IN_WORLD_SPACE,
            PriceClass::Slip,
            Places { light: view.inverse().transform_point3(right.light), ..right },
        ),
        at(
            price::VIEWER_NOT_TURNED,
            PriceClass::Slip,
            Places { eye: -view.transform_vector3(view.w_axis.truncate()), ..right },
        ),
        at(price::VIEWER_AT_ORIGIN, PriceClass::Slip, Places { eye: Vec3::ZERO, ..right }),
        at(price::LIGHT_AT_ORIGIN, PriceClass::Concept, Places { light: Vec3::ZERO, ..right }),
        at(
            "light and viewer are exchanged",
            PriceClass::Concept,
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
            PriceClass::Slip,
            Box::new(move |point| ShadedPoint {
                distance: f64::from((right.eye - point.position).length()),
                ..right.shaded_point(scene, point)
            }),
        ),
        of(
            "the distance is that of the light from the origin",
            PriceClass::Slip,
            Box::new(move |point| ShadedPoint {
                distance: f64::from(right.light.length()),
                ..right.shaded_point(scene, point)
            }),
        ),
        of(
            "wo is not of unit length",
            PriceClass::Slip,
            Box::new(move |point| {
                let shaded = right.shaded_point(scene, point);
                let length = f64::from((right.eye - point.position).length());
                ShadedPoint { wo: shaded.wo.map(|v| length * v), ..shaded }
            }),
        ),
        of(
            "the direction to the viewer is the viewer's position",
            PriceClass::Slip,
            Box::new(move |point| {
                let frame = Frame::from_normal(point.normal);
                let wo = frame.to_local(right.eye.normalize_or_zero()).to_array().map(f64::from);
                ShadedPoint { wo, ..right.shaded_point(scene, point) }
            }),
        ),
        of(
            "the direction to the light is the light's position",
            PriceClass::Concept,
            Box::new(move |point| {
                let frame = Frame::from_normal(point.normal);
                let wi = frame.to_local(right.light.normalize_or_zero()).to_array().map(f64::from);
                let distance = f64::from(right.light.length());
                ShadedPoint { wi, distance, ..right.shaded_point(scene, point) }
            }),
        ),
        of(
            "the normal is that of a triangle's first corner",
            PriceClass::Slip,
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
            PriceClass::Concept,
            Box::new(move |point| {
                right.shaded_point(scene, &SurfacePoint { normal: Vec3::Y, ..*point })
            }),
        ),
    ]);
    for exponent in
        [0.0, 1e-9, 1.0, 2.0, 4.0, 5.0, 8.0, 10.0, 16.0, 20.0, 32.0, 50.0, 64.0, 100.0, 128.0]
    {
        let shaded = move |point: &SurfacePoint| {
            let mut shaded = right.shaded_point(scene, point);
            shaded.material.exponent = exponent;
            shaded
        };
        inputs.push(of("the exponent is a constant", PriceClass::Slip, Box::new(shaded)));
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
