//! Materials as the MTL file describes them.

use glam::Vec3;

use super::Texture;

/// Which BSDF a material asks for, by MTL's `illum`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaterialModel {
    /// `illum 7`: Lambertian reflection.
    Diffuse,
    /// `illum 5`: a mirror. It has no BSDF in this assignment and is black offline; realtime
    /// draws it as a diffuse color.
    Mirror,
    /// Any other `illum`: normalized Phong.
    Phong,
}

/// A material as its file gives it, before any energy scale.
#[derive(Clone, Debug)]
pub struct Material {
    /// The name in the MTL file.
    pub name: String,
    /// The BSDF it asks for.
    pub model: MaterialModel,
    /// Diffuse albedo Kd or map_Kd.
    pub diffuse: Texture,
    /// Specular albedo Ks or map_Ks.
    pub specular: Texture,
    /// Phong exponent Ns.
    pub exponent: f32,
    /// Emission Ke; for a point light its radiant intensity [W sr^-1].
    pub emission: Vec3,
}

impl Material {
    /// A diffuse material of a constant color.
    pub fn diffuse(albedo: Vec3) -> Self {
        Self {
            name: "diffuse".into(),
            model: MaterialModel::Diffuse,
            diffuse: albedo.into(),
            specular: Vec3::ZERO.into(),
            exponent: 1.0,
            emission: Vec3::ZERO,
        }
    }

    /// A Phong material of constant colors.
    pub fn phong(diffuse: Vec3, specular: Vec3, exponent: f32) -> Self {
        let (diffuse, specular) = (diffuse.into(), specular.into());
        Self {
            name: "phong".into(),
            model: MaterialModel::Phong,
            diffuse,
            specular,
            exponent,
            ..Self::diffuse(Vec3::ZERO)
        }
    }

    /// The factor on both terms of the Phong BSDF that keeps it from reflecting more than it
    /// receives: 0.99 / m where m, the largest component of Kd + Ks, exceeds 1, and 1 elsewhere.
    pub fn energy_scale(&self) -> f32 {
        let largest = (self.diffuse.max() + self.specular.max()).max_element();
        if self.model == MaterialModel::Phong && largest > 1.0 { 0.99 / largest } else { 1.0 }
    }

    /// Whether the material emits light.
    pub fn is_emitter(&self) -> bool {
        self.emission != Vec3::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_scale_is_one_up_to_one_and_only_phong() {
        let phong = |kd, ks| Material::phong(Vec3::splat(kd), Vec3::splat(ks), 30.0).energy_scale();
        assert_eq!(phong(0.5, 0.5), 1.0);
        assert_eq!(phong(0.8, 0.7), 0.99 / 1.5);
        assert_eq!(Material::diffuse(Vec3::splat(2.0)).energy_scale(), 1.0);
    }
}
