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
        match scene.intersect(ray).and_then(|hit| self.unshadowed(scene, hit)) {
            Some(lit) if !(self.shadows && scene.occluded(&lit.shadow_ray)) => lit.radiance,
            _ => Vec3::ZERO,
        }
    }

    fn radiance_of_eight(
        &self,
        scene: &Scene,
        rays: &[Option<Ray>; 8],
        _sampler: &Sampler,
    ) -> [Vec3; 8] {
        let lit = scene.intersect_eight(rays).map(|hit| self.unshadowed(scene, hit?));
        let shadow_rays = lit.each_ref().map(|lit| lit.as_ref().map(|lit| lit.shadow_ray));
        let shadowed = if self.shadows { scene.occluded_eight(&shadow_rays) } else { [false; 8] };
        std::array::from_fn(|i| match &lit[i] {
            Some(lit) if !shadowed[i] => lit.radiance,
            _ => Vec3::ZERO,
        })
    }
}

/// A point that faces the light.
struct Lit {
    /// That of the point where nothing blocks `shadow_ray`.
    radiance: Vec3,
    shadow_ray: Ray,
}

impl SimpleIntegrator {
    /// Nothing where the point is black whatever stands in between.
    fn unshadowed(&self, scene: &Scene, mut i: SurfaceInteraction) -> Option<Lit> {
        let to_light = scene.first_light_position() - i.p;
        let distance = to_light.length();
        let direction = to_light / distance;
        i.wi = i.frame_ns.to_local(direction);
        // Look up the BSDF first: most points in shadow by their own curvature need no shadow ray.
        let f = self.eval(scene, &i);
        if f == Vec3::ZERO {
            return None;
        }
        let far = distance * (1.0 - 1e-4) - i.epsilon;
        Some(Lit {
            radiance: f * scene.first_light_intensity() / (distance * distance),
            shadow_ray: Ray::segment(i.p, direction, i.epsilon, far),
        })
    }

    fn eval(&self, scene: &Scene, i: &SurfaceInteraction) -> Vec3 {
        let material = scene.material_of(i.shape);
        if self.diffuse_mirrors && material.model == MaterialModel::Mirror {
            return DiffuseBsdf::new(&crate::average(material)).eval(i);
        }
        scene.bsdf(i).eval(i)
    }
}
