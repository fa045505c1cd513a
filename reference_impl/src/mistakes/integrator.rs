//! Mistakes in direct illumination: the steps of `crate::integrators::simple`, with switches.

use basecode::{Frame, Integrator, Ray, Sampler, Scene, Shape, SurfaceInteraction, Vec3};

use super::{Mistake as M, Mistakes};

pub struct Mistaken {
    pub mistakes: Mistakes,
    pub shadows: bool,
}

impl Integrator for Mistaken {
    fn radiance(&self, scene: &Scene, ray: &Ray, _sampler: &Sampler) -> Vec3 {
        let has = |mistake| self.mistakes.has(mistake);
        let Some(mut i) = scene.intersect(ray) else {
            return Vec3::ZERO;
        };
        let to_light = self.light_position(scene) - i.p;
        let distance = to_light.length();
        let direction = to_light / distance;
        if has(M::GeometricNormal) {
            i.frame_ns = Frame::from_normal(i.ng);
            i.wo = i.frame_ns.to_local(-ray.direction);
        }
        i.wi = i.frame_ns.to_local(direction);
        if has(M::WorldWi) {
            i.wi = direction;
        }
        if has(M::WiNotNormalised) {
            i.wi = i.frame_ns.to_local(to_light);
        }
        if has(M::WiReversed) {
            i.wi = -i.wi;
        }
        let cos_i = Frame::cos_theta(i.wi);
        let mut visibility = 1.0;
        if self.shadows && !has(M::NoShadows) {
            visibility = self.visibility(scene, &mut i, direction, distance);
        }
        if visibility == 0.0 {
            return Vec3::ZERO;
        }
        let mut radiance = visibility * scene.bsdf(&i).eval(&i) * self.light_intensity(scene);
        if has(M::TwoCosines) {
            radiance *= cos_i;
        }
        if has(M::NoFalloff) {
            radiance
        } else if has(M::OverR) {
            radiance / distance
        } else if has(M::OverRCubed) {
            radiance / distance.powi(3)
        } else {
            radiance / (distance * distance)
        }
    }
}

impl Mistaken {
    fn light_position(&self, scene: &Scene) -> Vec3 {
        let mut shapes = scene.shapes().iter().enumerate();
        let emits = |(index, _): &(usize, &Shape)| scene.material_of(*index).is_emitter();
        match shapes.find(emits) {
            Some((_, light)) if self.mistakes.has(M::FirstVertex) => light.positions[0],
            Some((_, light)) if self.mistakes.has(M::Centroid) => {
                // Corners that several triangles share count once.
                let mut corners: Vec<Vec3> = Vec::new();
                for corner in light.triangles.iter().flatten() {
                    let corner = light.positions[*corner as usize];
                    if !corners.contains(&corner) {
                        corners.push(corner);
                    }
                }
                corners.iter().sum::<Vec3>() / corners.len() as f32
            }
            _ => scene.first_light_position(),
        }
    }

    fn light_intensity(&self, scene: &Scene) -> Vec3 {
        const FOUR_PI: f32 = 4.0 * std::f32::consts::PI;
        let intensity = scene.first_light_intensity();
        if self.mistakes.has(M::TimesFourPi) {
            return FOUR_PI * intensity;
        }
        if self.mistakes.has(M::OverFourPi) {
            return intensity / FOUR_PI;
        }
        if self.mistakes.has(M::GreyIntensity) {
            return Vec3::splat(intensity.x);
        }
        intensity
    }

    fn visibility(
        &self,
        scene: &Scene,
        i: &mut SurfaceInteraction,
        direction: Vec3,
        distance: f32,
    ) -> f32 {
        let has = |mistake| self.mistakes.has(mistake);
        if has(M::ShadowHitReused) {
            return reuse_hit(scene, i, direction, distance);
        }
        let mut far = distance * (1.0 - 1e-4) - i.epsilon;
        if has(M::ShadowNoMaxT) {
            far = f32::INFINITY;
        }
        if has(M::ShadowMaxTSquared) {
            far = distance * distance;
        }
        let mut near = i.epsilon;
        if has(M::ShadowEpsilon) {
            near = 0.1;
        }
        if has(M::ShadowAcne) {
            near = 0.0;
        }
        let toward = if has(M::ShadowReversed) { -direction } else { direction };
        let blocked = scene.occluded(&Ray::segment(i.p, toward, near, far));
        if blocked == has(M::ShadowInverted) {
            return 1.0;
        }
        if has(M::ShadowHalf) { 0.5 } else { 0.0 }
    }
}

/// The shadow query writes what it hits into the record that is shaded afterwards.
fn reuse_hit(scene: &Scene, i: &mut SurfaceInteraction, direction: Vec3, distance: f32) -> f32 {
    let ray = Ray::segment(i.p, direction, i.epsilon, f32::INFINITY);
    let Some(hit) = scene.intersect(&ray) else { return 1.0 };
    let far = distance * (1.0 - 1e-4) - i.epsilon;
    if hit.t < far && !scene.material_of(hit.shape).is_emitter() {
        return 0.0;
    }
    *i = hit;
    i.wi = i.frame_ns.to_local(direction);
    1.0
}
