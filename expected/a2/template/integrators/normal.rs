//! The previous assignment: normals as colours.

use basecode::{Integrator, Ray, Sampler, Scene, Vec3};

/// Shows the absolute value of the shading normal.
pub struct NormalIntegrator;

impl Integrator for NormalIntegrator {
    fn radiance(&self, scene: &Scene, ray: &Ray, _sampler: &Sampler) -> Vec3 {
        match scene.intersect(ray) {
            Some(hit) => hit.frame_ns.n.abs(),
            None => Vec3::ZERO,
        }
    }
}
