//! Mistakes of visibility: where the shadow ray begins, where it leads, where it ends, what it asks.

use basecode::{MaterialModel, Ray, Scene, SurfaceInteraction, Vec3};

use super::{Mistake as M, Mistakes};

/// The fraction of the light, `direction` and `distance` away, that reaches the point.
pub fn visibility(
    mistakes: &Mistakes,
    scene: &Scene,
    camera_ray: &Ray,
    i: &mut SurfaceInteraction,
    (direction, distance): (Vec3, f32),
) -> f32 {
    let has = |mistake| mistakes.has(mistake);
    if has(M::ShadowHitReused) {
        return reuse_hit(scene, i, direction, distance);
    }
    let model = scene.material_of(i.shape).model;
    if has(M::ShadowAlways) {
        return 0.0;
    }
    if has(M::ShadowDiffuseOnly) && model == MaterialModel::Phong {
        return 1.0;
    }
    let ray = shadow_ray(mistakes, camera_ray, i, (direction, distance));
    let blocked = match () {
        () if has(M::ShadowNotOwnShape) => {
            scene.intersect(&ray).is_some_and(|hit| hit.shape != i.shape && solid(scene, &hit))
        }
        () if has(M::ShadowFirstShape) => {
            scene.occluded(&ray) && scene.intersect(&ray).is_some_and(|hit| hit.shape == 0)
        }
        () if has(M::ShadowByClosestHit) => {
            scene.intersect(&ray).is_some_and(|hit| solid(scene, &hit)) && scene.occluded(&ray)
        }
        () => scene.occluded(&ray),
    };
    if blocked == has(M::ShadowInverted) {
        return if has(M::ShadowLitDimmed) { 0.8 } else { 1.0 };
    }
    match () {
        () if has(M::ShadowHalf) => 0.5,
        () if has(M::ShadowTenth) => 0.1,
        () => 0.0,
    }
}

fn solid(scene: &Scene, hit: &SurfaceInteraction) -> bool {
    !scene.material_of(hit.shape).is_emitter()
}

fn shadow_ray(
    mistakes: &Mistakes,
    camera_ray: &Ray,
    i: &SurfaceInteraction,
    (direction, distance): (Vec3, f32),
) -> Ray {
    let has = |mistake| mistakes.has(mistake);
    let right_end = distance * (1.0 - 1e-4) - i.epsilon;
    let far = match () {
        () if has(M::ShadowNoMaxT) => f32::INFINITY,
        () if has(M::ShadowMaxTSquared) => distance * distance,
        () if has(M::ShadowEndTwice) => 2.0 * distance,
        () if has(M::ShadowEnd95) => 0.95 * distance,
        () if has(M::ShadowEnd90) => 0.9 * distance,
        () if has(M::ShadowEnd50) => 0.5 * distance,
        () if has(M::ShadowEndShort) => distance - 0.1,
        () if has(M::ShadowEndOne) => 1.0,
        () => right_end,
    };
    let near = match () {
        () if has(M::ShadowEpsilon) => 0.1,
        () if has(M::ShadowStart05) => 0.05,
        () if has(M::ShadowStartOne) => 1.0,
        () if has(M::ShadowAcne) => 0.0,
        () if has(M::ShadowStartSmall) => 1e-4,
        () => i.epsilon,
    };
    let toward = if has(M::ShadowReversed) { -direction } else { direction };
    let light = i.p + distance * direction;
    let n = i.frame_ns.n;
    match () {
        () if has(M::ShadowFromLightWrong) => Ray::segment(light, direction, near, far),
        () if has(M::ShadowFromLight) => {
            Ray::segment(light, -direction, 1e-4 * distance, distance - i.epsilon)
        }
        () if has(M::ShadowFromCamera) => Ray::segment(camera_ray.origin, toward, near, far),
        () if has(M::ShadowLocal) => Ray::segment(i.p, i.wi, near, far),
        () if has(M::ShadowInward) => Ray::segment(i.p - 0.01 * n, toward, near, far),
        () if has(M::ShadowLifted) => Ray::segment(i.p + 0.1 * n, toward, near, far),
        () if has(M::ShadowOffNormal) => {
            let origin = i.p + 1e-3 * n;
            let way = light - origin;
            Ray::segment(origin, way.normalize(), 0.0, way.length() * (1.0 - 1e-4))
        }
        () => Ray::segment(i.p, toward, near, far),
    }
}

/// The shadow query writes what it hits into the record that is shaded afterwards.
fn reuse_hit(scene: &Scene, i: &mut SurfaceInteraction, direction: Vec3, distance: f32) -> f32 {
    let ray = Ray::segment(i.p, direction, i.epsilon, f32::INFINITY);
    let Some(hit) = scene.intersect(&ray) else { return 1.0 };
    if hit.t < distance * (1.0 - 1e-4) - i.epsilon && solid(scene, &hit) {
        return 0.0;
    }
    *i = hit;
    i.wi = i.frame_ns.to_local(direction);
    1.0
}
