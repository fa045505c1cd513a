//! Mistakes in a shader's use of its inputs.

use basecode::{Camera, Frame, Scene, Vec3};

use super::Places;
use crate::expected::SurfacePoint;
use crate::price::{self, PriceClass};
use crate::shading::ShadedPoint;

/// A mistake in a shader's use of its inputs: its name, and what the shader shades instead.
pub(super) type Input<'a> =
    (&'static str, PriceClass, Box<dyn Fn(&SurfacePoint) -> ShadedPoint + 'a>);

/// The mistakes that are looked for.
pub(super) fn inputs<'a>(scene: &'a Scene, camera: &'a Camera) -> Vec<Input<'a>> {
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
