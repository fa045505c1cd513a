//! The diffuse reflectance model.

// Quiet until the task of this file is done: then remove this line, and the compiler helps you.
#![allow(unused)]

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
        // TODO(A2) 1.1: test whether the incoming and outgoing rays are front-facing to the surface
        // (`Frame::cos_theta` of `i.wi` and `i.wo`); if not, return black. Otherwise, return the
        // albedo divided by pi and multiplied by the cosine foreshortening factor.
        todo!("1.1 diffuse BSDF")
    }
}
