//! Direct illumination from a point light.

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
        if self.shadows && !light_is_visible(scene, &i) {
            return Vec3::ZERO;
        }
        unshadowed(scene, i)
    }
}

/// The light that the surface at `i` reflects toward `i.wo`, whatever stands in between.
fn unshadowed(scene: &Scene, mut i: SurfaceInteraction) -> Vec3 {
    let to_light = scene.first_light_position() - i.p;
    i.wi = i.frame_ns.to_local(to_light.normalize());
    let incident = scene.first_light_intensity() / to_light.length_squared();
    // eval() holds the cosine already.
    incident * scene.bsdf(&i).eval(&i)
}

/// Whether nothing stands between the surface at `i` and the light.
fn light_is_visible(scene: &Scene, i: &SurfaceInteraction) -> bool {
    let to_light = scene.first_light_position() - i.p;
    let ray = Ray::new(i.p, to_light.normalize());
    !scene.occluded(&ray)
}
