//! Slips in what reaches a fragment stage: values that a pass binds, positions and normals.

use basecode::glam::{DMat4, DVec3};
use basecode::{Camera, Scene, Vec3};

use super::radiance;
use crate::CheckId;
use crate::expected::SurfacePoint;
use crate::pixels::{Looked, Places};
use crate::price;
use crate::shading::ShadedPoint;
use crate::vertex::other_normals;

/// What a right stage makes of a point after a slip; `None` if that is not known.
pub(super) type Shaded<'a> = Box<dyn Fn(&SurfacePoint) -> Option<ShadedPoint> + 'a>;

/// What a slip makes of a point; `None` if that is not known.
type Moved<'a> = Box<dyn Fn(&SurfacePoint) -> Option<SurfacePoint> + 'a>;

/// A slip in what reaches a fragment stage.
pub(super) struct Slip<'a> {
    pub of: CheckId,
    pub name: &'static str,
    pub shaded: Shaded<'a>,
}

/// Slips with the values that a pass binds.
pub(super) fn pass_slips<'a>(scene: &'a Scene, right: Places) -> Vec<Slip<'a>> {
    let slip = |name, shaded: Shaded<'a>| Slip { of: CheckId::PassUniforms, name, shaded };
    let at = |name, places: Places| {
        slip(name, Box::new(move |point| Some(places.shaded_point(scene, point))))
    };
    let changed = |name, change: fn(&mut ShadedPoint)| {
        let shaded = move |point: &SurfacePoint| {
            let mut shaded = right.shaded_point(scene, point);
            change(&mut shaded);
            Some(shaded)
        };
        slip(name, Box::new(shaded))
    };
    let beside = |name, by: isize| {
        let shaded = move |point: &SurfacePoint| {
            let other =
                point.shape.checked_add_signed(by).filter(|at| *at < scene.shapes().len())?;
            let is_drawn = !scene.material_of(other).is_emitter();
            is_drawn.then(|| right.with_material(scene, other, point))
        };
        slip(name, Box::new(shaded))
    };
    vec![
        at(price::VIEWER_AT_ORIGIN, Places { eye: Vec3::ZERO, ..right }),
        at(price::LIGHT_AT_ORIGIN, Places { light: Vec3::ZERO, ..right }),
        at("the light stands where the viewer does", Places { light: right.eye, ..right }),
        changed("the intensity is missing", |p| p.intensity = [1.0; 3]),
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
        beside("every surface is drawn with the material of the next one", 1),
        beside("every surface is drawn with the material of the one before", -1),
    ]
}

/// Slips with positions and normals. Positions may come from the depth of a pixel.
pub(super) fn vertex_slips<'a>(scene: &'a Scene, camera: &Camera, right: Places) -> Vec<Slip<'a>> {
    let (view, projection) = (camera.view(), camera.projection());
    let to_clip = projection * view;
    let slip = |name, changed: Moved<'a>| Slip {
        of: CheckId::StageVertex,
        name,
        shaded: Box::new(move |point| Some(right.shaded_point(scene, &changed(point)?))),
    };
    let moved = |name, position: Box<dyn Fn(Vec3) -> Vec3>| {
        let changed = move |point: &SurfacePoint| {
            let position = position(point.position);
            position.is_finite().then_some(SurfacePoint { position, ..*point })
        };
        slip(name, Box::new(changed))
    };
    // Depth has few digits: in f64.
    let [precise, exchanged] =
        [projection.as_dmat4() * view.as_dmat4(), view.as_dmat4() * projection.as_dmat4()];
    let from_film = |name, back: DMat4, other: fn(DVec3) -> DVec3| {
        let there = move |p: Vec3| other(precise.project_point3(p.as_dvec3()));
        moved(name, Box::new(move |p| back.project_point3(there(p)).as_vec3()))
    };
    let back = precise.inverse();
    let mut slips = vec![
        moved(
            "the position is not divided by its w",
            Box::new(move |p| p / (to_clip * p.extend(1.0)).w),
        ),
        moved("positions are in view space", Box::new(move |p| view.transform_point3(p))),
        from_film("the inverse is that of view * projection", exchanged.inverse(), |ndc| ndc),
        from_film("positions are upside down", back, |ndc| DVec3::new(ndc.x, -ndc.y, ndc.z)),
        from_film("positions are mirrored", back, |ndc| DVec3::new(-ndc.x, ndc.y, ndc.z)),
        from_film("positions are turned by half", back, |ndc| DVec3::new(-ndc.x, -ndc.y, ndc.z)),
        from_film("depth is taken from -1 to 1", back, |ndc| ndc.with_z(2.0 * ndc.z - 1.0)),
        from_film("the place on the film is taken from 0 to 1", back, |ndc| {
            DVec3::new(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y, ndc.z)
        }),
        slip(
            "values lose their perspective",
            Box::new(move |point| point.without_perspective(scene, to_clip)),
        ),
    ];
    let mut normals = other_normals();
    normals.push(("the normal is not decoded", Box::new(|p| 0.5 * p.normal + 0.5)));
    normals.push(("the normal is decoded twice", Box::new(|p| 2.0 * p.normal - 1.0)));
    slips.extend(normals.into_iter().map(|(name, other)| {
        let changed = move |point: &SurfacePoint| {
            Some(SurfacePoint { normal: other(point).try_normalize()?, ..*point })
        };
        slip(name, Box::new(changed))
    }));
    slips
}

/// Number of points by which the material of a shape is known.
const POINTS_PER_SHAPE: usize = 100;

/// What a right stage makes of points if each shape has the material of whichever explains best what is found there.
pub(super) fn materials_of_others<'a>(
    scene: &'a Scene,
    right: Places,
    looked: &Looked,
) -> Shaded<'a> {
    let count = scene.shapes().len();
    let apart = |shape: usize, other: usize| -> f64 {
        let own = looked.surfaces.iter().zip(&looked.found);
        let own: Vec<_> = own.filter(|(point, _)| point.shape == shape).collect();
        let few = own.iter().step_by(own.len().div_ceil(POINTS_PER_SHAPE).max(1));
        let differences = few.flat_map(|(point, found)| {
            let drawn = radiance(&right.with_material(scene, other, point));
            [0, 1, 2].map(|c| (drawn[c] - f64::from(found[c])).abs())
        });
        differences.sum()
    };
    let best = |shape: usize| {
        let by_fit = |a: &usize, b: &usize| apart(shape, *a).total_cmp(&apart(shape, *b));
        let drawn = (0..count).filter(|other| !scene.material_of(*other).is_emitter());
        drawn.min_by(by_fit).unwrap_or(shape)
    };
    let of: Vec<usize> = (0..count).map(best).collect();
    Box::new(move |point| Some(right.with_material(scene, of[point.shape], point)))
}
