//! Direct illumination from a point light.

use basecode::{Integrator, Ray, Sampler, Scene, Vec3};

/// L = V I / r^2 f cos, from the scene's point light.
pub struct SimpleIntegrator {
    /// Whether occluders cast shadows.
    pub shadows: bool,
}

impl Integrator for SimpleIntegrator {
    fn radiance(&self, scene: &Scene, ray: &Ray, _sampler: &Sampler) -> Vec3 {
        let Some(mut i) = scene.intersect(ray) else {
            return Vec3::ZERO;
        };
        let to_light = scene.first_light_position() - i.p;
        let distance = to_light.length();
        let direction = to_light / distance;
        i.wi = i.frame_ns.to_local(direction);
        // Look up the BSDF first: most points in shadow by their own curvature need no shadow ray.
        let f = scene.bsdf(&i).eval(&i);
        if f == Vec3::ZERO {
            return Vec3::ZERO;
        }
        if self.shadows {
            let far = distance * (1.0 - 1e-4) - Ray::EPSILON;
            let shadow_ray = Ray::segment(i.p, direction, Ray::EPSILON, far);
            if scene.occluded(&shadow_ray) {
                return Vec3::ZERO;
            }
        }
        f * scene.first_light_intensity() / (distance * distance)
    }
}
