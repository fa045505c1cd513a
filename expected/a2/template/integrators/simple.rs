//! Direct illumination from a point light.

// Quiet until the tasks of this file are done: then remove this line, and the compiler helps you.
#![allow(unused)]

use basecode::{Integrator, Ray, Sampler, Scene, SurfaceInteraction, Vec3};

/// L = V I / r^2 f cos, from the scene's point light.
pub struct SimpleIntegrator {
    /// Whether occluders cast shadows.
    pub shadows: bool,
}

impl Integrator for SimpleIntegrator {
    fn radiance(&self, scene: &Scene, ray: &Ray, _sampler: &Sampler) -> Vec3 {
        let Some(i) = scene.intersect(ray) else {
            return Vec3::ZERO;
        };
        // You may merge the two functions below; apart, either can be written and tested first.
        if self.shadows && !light_is_visible(scene, &i) {
            return Vec3::ZERO;
        }
        unshadowed(scene, i)
    }
}

/// The light that the surface at `i` reflects toward `i.wo`, whatever stands in between.
fn unshadowed(scene: &Scene, mut i: SurfaceInteraction) -> Vec3 {
    // TODO(A2) 1.3: set `i.wi` to the direction of the light (`scene.first_light_position`) in the
    // local frame (`i.frame_ns.to_local`), evaluate the BSDF (`scene.bsdf`), which includes the
    // cosine already, and multiply by what arrives from the light (`scene.first_light_intensity`).
    todo!("1.3 unshadowed direct illumination: return intensity / r^2 * bsdf.eval")
}

/// Whether nothing stands between the surface at `i` and the light.
fn light_is_visible(scene: &Scene, i: &SurfaceInteraction) -> bool {
    // TODO(A2) 1.4: cast a shadow ray (`scene.occluded`) from `i.p` toward the light. What lies
    // behind the light casts no shadow: mind both ends of the ray (`Ray::segment`).
    todo!("1.4 hard shadows: ask scene.occluded along a ray that ends at the light")
}
