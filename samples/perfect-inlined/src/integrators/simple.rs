//! Direct illumination from a point light.

use basecode::{
    Frame, INV_PI, INV_TWO_PI, Integrator, MaterialModel, Ray, Sampler, Scene, SurfaceInteraction,
    Vec3, vec3,
};

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
    incident * shade(scene, &i)
}

/// The BSDF at `i` times the cosine, without a call through a trait for every ray.
fn shade(scene: &Scene, i: &SurfaceInteraction) -> Vec3 {
    let material = scene.material_of(i.shape);
    let (cos_o, cos_i) = (Frame::cos_theta(i.wo), Frame::cos_theta(i.wi));
    if cos_o <= 0.0 || cos_i <= 0.0 {
        return Vec3::ZERO;
    }
    let diffuse = material.diffuse.eval(i) * INV_PI;
    match material.model {
        MaterialModel::Mirror => Vec3::ZERO,
        MaterialModel::Diffuse => diffuse * cos_i,
        MaterialModel::Phong => {
            let n = material.exponent;
            let mirrored = vec3(-i.wo.x, -i.wo.y, i.wo.z);
            let lobe = (n + 2.0) * INV_TWO_PI * mirrored.dot(i.wi).max(0.0).powf(n);
            material.energy_scale() * (diffuse + material.specular.eval(i) * lobe) * cos_i
        }
    }
}

/// Whether nothing stands between the surface at `i` and the light.
fn light_is_visible(scene: &Scene, i: &SurfaceInteraction) -> bool {
    let to_light = scene.first_light_position() - i.p;
    let distance = to_light.length();
    let direction = to_light / distance;
    let ray = Ray::segment(i.p, direction, Ray::EPSILON, distance - Ray::EPSILON);
    !scene.occluded(&ray)
}
