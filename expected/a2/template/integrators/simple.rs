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
    // TODO(A2) 1.3: retrieve the light's position and its intensity, retrieve the surface's BSDF
    // (`scene.bsdf`), transform the world-space incoming direction `i.wi` to the surface's local
    // coordinates (`i.frame_ns.to_local`), and evaluate the BRDF and incident lighting locally.
    todo!("1.3 unshadowed direct illumination")
}

/// Whether nothing stands between the surface at `i` and the light.
fn light_is_visible(scene: &Scene, i: &SurfaceInteraction) -> bool {
    // TODO(A2) 1.4: create a shadow ray (`Ray::segment`), set the ray's bounds accordingly, and
    // evaluate the visibility between the surface and the light with it (`scene.occluded`).
    todo!("1.4 hard shadows")
}
