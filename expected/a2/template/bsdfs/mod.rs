//! Reflectance models.

mod diffuse;
mod phong;

pub use diffuse::DiffuseBsdf;
pub use phong::PhongBsdf;
