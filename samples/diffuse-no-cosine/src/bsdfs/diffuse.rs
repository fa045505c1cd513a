//! The diffuse reflectance model.

use basecode::{Bsdf, Frame, INV_PI, Material, SurfaceInteraction, Texture, Vec3};

/// Lambertian reflection.
pub struct DiffuseBsdf {
    albedo: Texture,
}

impl DiffuseBsdf {
    /// Takes the material's Kd.
    pub fn new(material: &Material) -> Self {
        Self { albedo: material.diffuse.clone() }
    }
}

impl Bsdf for DiffuseBsdf {
    fn eval(&self, i: &SurfaceInteraction) -> Vec3 {
        let (cos_o, cos_i) = (Frame::cos_theta(i.wo), Frame::cos_theta(i.wi));
        if cos_o > 0.0 && cos_i > 0.0 { self.albedo.eval(i) * INV_PI } else { Vec3::ZERO }
    }
}
