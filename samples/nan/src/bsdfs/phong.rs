//! The normalised Phong reflectance model.

use basecode::{
    Bsdf, Frame, INV_PI, INV_TWO_PI, Material, SurfaceInteraction, Texture, Vec3, vec3,
};

/// Phong, "Illumination for Computer Generated Pictures", 1975, normalised to conserve energy.
pub struct PhongBsdf {
    diffuse_reflectance: Texture,
    specular_reflectance: Texture,
    exponent: f32,
    /// Multiplies both terms.
    scale: f32,
}

impl PhongBsdf {
    /// Takes the material's Kd, Ks and Ns.
    pub fn new(material: &Material) -> Self {
        Self {
            diffuse_reflectance: material.diffuse.clone(),
            specular_reflectance: material.specular.clone(),
            exponent: material.exponent,
            scale: material.energy_scale(),
        }
    }
}

/// The perfect specular direction of `w`, local frame.
fn reflect(w: Vec3) -> Vec3 {
    vec3(-w.x, -w.y, w.z)
}

impl Bsdf for PhongBsdf {
    fn eval(&self, i: &SurfaceInteraction) -> Vec3 {
        let (cos_o, cos_i) = (Frame::cos_theta(i.wo), Frame::cos_theta(i.wi));
        if cos_o <= 0.0 || cos_i <= 0.0 {
            return Vec3::ZERO;
        }
        let rho_d = self.scale * self.diffuse_reflectance.eval(i);
        let rho_s = self.scale * self.specular_reflectance.eval(i);
        let lobe = reflect(i.wi).dot(i.wo).powf(self.exponent).clamp(0.0, f32::INFINITY);
        let normalisation = (self.exponent + 2.0) * INV_TWO_PI;
        let f = rho_d * INV_PI + rho_s * (normalisation * lobe);
        f * cos_i
    }
}
