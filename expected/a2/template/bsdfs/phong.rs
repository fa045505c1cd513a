//! The normalised Phong reflectance model.

// Quiet until the task of this file is done: then remove this line, and the compiler helps you.
#![allow(unused)]

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
        // TODO(A2) 1.2: test for front-facing incoming and outgoing rays, evaluate the Phong BRDF in
        // equation (1) of the handout, and return this value multiplied by the cosine
        // foreshortening factor. Multiply each albedo by `self.scale` to ensure energy conservation.
        todo!("1.2 Phong BSDF")
    }
}
