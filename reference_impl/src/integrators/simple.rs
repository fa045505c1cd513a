//! Direct illumination from a point light.

use basecode::{Bsdf, Integrator, MaterialModel, Ray, Sampler, Scene, SurfaceInteraction, Vec3};

use crate::bsdfs::DiffuseBsdf;

/// L = V I / r^2 f cos, from the scene's point light.
pub struct SimpleIntegrator {
    /// Whether occluders cast shadows.
    pub shadows: bool,
    /// Whether mirrors, which have no BSDF, show the diffuse colour that realtime draws them in.
    pub diffuse_mirrors: bool,
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
        let f = self.eval(scene, &i);
        if f == Vec3::ZERO {
            return Vec3::ZERO;
        }
        if self.shadows {
            let far = distance * (1.0 - 1e-4) - i.epsilon;
            let shadow_ray = Ray::segment(i.p, direction, i.epsilon, far);
            if scene.occluded(&shadow_ray) {
                return Vec3::ZERO;
            }
        }
        f * scene.first_light_intensity() / (distance * distance)
    }
}

impl SimpleIntegrator {
    fn eval(&self, scene: &Scene, i: &SurfaceInteraction) -> Vec3 {
        let material = scene.material_of(i.shape);
        if self.diffuse_mirrors && material.model == MaterialModel::Mirror {
            return DiffuseBsdf::new(&crate::average(material)).eval(i);
        }
        scene.bsdf(i).eval(i)
    }
}
