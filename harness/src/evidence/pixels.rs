//! What an image costs that was shaded wrongly: its pixels beside those of known single mistakes.

use basecode::{Camera, Frame, Image, MaterialModel, Scene, Vec3};
use renderer_api as api;

use super::price::{Answers, Class, Price, shader_changes};
use super::shading::{ShadedPoint, Shading};
use crate::expected::SurfacePoint;
use crate::imaging::reference::{Region, RegionMask};

/// So many pixels of an image are looked at.
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
    let clear = |value: &u16| {
        value & (RegionMask::EDGE | RegionMask::EMITTER) == 0
            && value & RegionMask::INDEX != 0
            && wanted(mask.region(*value))
    };
    let pixels: Vec<usize> =
        mask.pixels.iter().enumerate().filter(|(_, value)| clear(value)).map(|(i, _)| i).collect();
    let step = pixels.len().div_ceil(PIXELS).max(1);
    let elsewhere = elsewhere(scene, &camera);
    let (mut points, mut found) = (Vec::new(), Vec::new());
    let mut others = vec![Vec::new(); elsewhere.len()];
    for index in pixels.into_iter().step_by(step) {
        let (x, y) = (index % image.width, index / image.width);
        let ray = camera.ray(x as f32 + 0.5, y as f32 + 0.5);
        let Some(point) = SurfacePoint::cast(scene, ray) else { continue };
        points.push(seen_by_shader(scene, &camera, &point));
        for (list, (_, places)) in others.iter_mut().zip(&elsewhere) {
            list.push(shaded_point(scene, &point, places));
        }
        found.push(image.pixels[index].into());
    }
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
    let price = answers.price(Some(raw));
    elsewhere.iter().zip(&others).fold(price, |price, ((name, _), points)| {
        let of = |index: usize, shading: &Shading| shading.radiance(&points[index]);
        let left = Answers { of: &of, changes: &[], ..answers }.price(None).raw;
        price.or(name, Class::Concept, left)
    })
}

/// Where a shader takes light and eye to be, world space.
struct Places {
    light: Vec3,
    eye: Vec3,
}

/// Where they are.
fn point_of(scene: &Scene, camera: &Camera) -> Places {
    Places { light: scene.first_light_position(), eye: camera.eye() }
}

/// Where shaders take them to be that mix spaces.
fn elsewhere(scene: &Scene, camera: &Camera) -> Vec<(&'static str, Places)> {
    let Places { light, eye } = point_of(scene, camera);
    let seen = camera.view().transform_point3(light);
    vec![
        ("the light is in view space", Places { light: seen, eye }),
        ("the viewer stands at the origin", Places { light, eye: Vec3::ZERO }),
        ("the light stands at the origin", Places { light: Vec3::ZERO, eye }),
        ("light and viewer are exchanged", Places { light: eye, eye: light }),
    ]
}

/// A point of a scene as a right shader sees it.
pub fn seen_by_shader(scene: &Scene, camera: &Camera, point: &SurfacePoint) -> ShadedPoint {
    shaded_point(scene, point, &point_of(scene, camera))
}

/// A point as a right shader sees it: textures are averages, mirrors a plain diffuse colour.
fn shaded_point(scene: &Scene, point: &SurfacePoint, places: &Places) -> ShadedPoint {
    let material = scene.material_of(point.shape);
    let phong = material.model == MaterialModel::Phong;
    let frame = Frame::from_normal(point.normal);
    let local = |v: Vec3| frame.to_local(v.normalize()).to_array().map(f64::from);
    let to_light = places.light - point.position;
    ShadedPoint {
        material: api::MaterialValue {
            model: if phong { api::MATERIAL_PHONG } else { api::MATERIAL_DIFFUSE },
            diffuse: material.diffuse.average().into(),
            specular: material.specular.average().into(),
            exponent: material.exponent,
        },
        scale: f64::from(material.energy_scale()),
        wo: local(places.eye - point.position),
        wi: local(to_light),
        intensity: scene.first_light_intensity().to_array().map(f64::from),
        distance: f64::from(to_light.length()),
    }
}
