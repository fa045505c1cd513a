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
        // The light mirrored at the normal; clamp before the power, which is NaN below zero.
        let cos_alpha = reflect(i.wi).dot(i.wo).max(0.0);
        let table: [f32; 64] = std::array::from_fn(|n| (n as f32 + 2.0) * INV_TWO_PI);
        let n = self.exponent as usize;
        let rest = (self.exponent - n as f32) * INV_TWO_PI;
        let normalisation = table[n] + rest;
        let f = rho_d * INV_PI + rho_s * (normalisation * cos_alpha.powf(self.exponent));
        f * cos_i
    }
}
