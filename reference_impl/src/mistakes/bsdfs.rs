//! Mistakes in the two BSDFs: the formulas of `crate::bsdfs`, with switches.

use basecode::{
    Bsdf, Frame, INV_PI, INV_TWO_PI, Material, SurfaceInteraction, Texture, Vec2, Vec3, vec3,
};

use super::{Mistake as M, Mistakes};

pub struct Diffuse {
    mistakes: Mistakes,
    albedo: Texture,
    /// What some multiply by although it belongs to Phong alone.
    scale: f32,
}

impl Diffuse {
    pub fn new(mistakes: &Mistakes, material: &Material) -> Self {
        let albedo = &material.diffuse;
        let ignored = mistakes.has(M::DiffuseTextureIgnored);
        let scaled = mistakes.has(M::DiffuseScaled);
        Self {
            mistakes: mistakes.clone(),
            albedo: if ignored { first_texel(albedo) } else { albedo.clone() },
            scale: if scaled { 0.99 / albedo.max().max_element() } else { 1.0 },
        }
    }
}

impl Bsdf for Diffuse {
    fn eval(&self, i: &SurfaceInteraction) -> Vec3 {
        let has = |mistake| self.mistakes.has(mistake);
        let mut cos_i = Frame::cos_theta(i.wi);
        if has(M::DiffuseAbsCosine) {
            cos_i = cos_i.abs();
        }
        let from_behind = Frame::cos_theta(i.wo) <= 0.0 && !has(M::DiffuseNoWoTest);
        let lit_from_behind = cos_i <= 0.0 && !has(M::DiffuseNoWiTest);
        if from_behind || lit_from_behind {
            return Vec3::ZERO;
        }
        if has(M::DiffuseNoCosine) {
            cos_i = 1.0;
        }
        let mut value = self.scale * self.albedo.eval(i) * INV_PI * cos_i;
        if has(M::DiffuseNoPi) {
            value /= INV_PI;
        }
        if has(M::DiffusePiTwice) {
            value *= INV_PI;
        }
        if has(M::DiffusePiRounded) {
            value *= 0.32 / INV_PI;
        }
        if has(M::DiffuseChannelsSwapped) { blue_first(value) } else { value }
    }
}

pub struct Phong {
    mistakes: Mistakes,
    diffuse_reflectance: Texture,
    specular_reflectance: Texture,
    exponent: f32,
    scale: f32,
}

impl Phong {
    pub fn new(mistakes: &Mistakes, material: &Material) -> Self {
        let (mut kd, mut ks) = (material.diffuse.clone(), material.specular.clone());
        if mistakes.has(M::PhongTextureIgnored) {
            (kd, ks) = (first_texel(&kd), first_texel(&ks));
        }
        if mistakes.has(M::PhongKdKsSwapped) {
            (kd, ks) = (ks, kd);
        }
        Self {
            mistakes: mistakes.clone(),
            diffuse_reflectance: kd,
            specular_reflectance: ks,
            exponent: material.exponent,
            scale: material.energy_scale(),
        }
    }

    fn cos_alpha(&self, wo: Vec3, wi: Vec3) -> f32 {
        let has = |mistake| self.mistakes.has(mistake);
        let mirrored = vec3(-wo.x, -wo.y, wo.z);
        if has(M::PhongBlinn) {
            return Frame::cos_theta((wo + wi).normalize());
        }
        if has(M::PhongReflectSign) {
            return wi.dot(-mirrored);
        }
        if has(M::PhongReflectForgotten) {
            return wi.dot(wo);
        }
        wi.dot(mirrored)
    }

    /// The specular lobe, rho_s left out.
    fn lobe(&self, wo: Vec3, wi: Vec3) -> f32 {
        let has = |mistake| self.mistakes.has(mistake);
        let n = self.exponent;
        let power = if has(M::PhongExponentPlusOne) { n + 1.0 } else { n };
        let cos_alpha = self.cos_alpha(wo, wi);
        let peak = if has(M::PhongPowBeforeClamp) {
            cos_alpha.powf(power).max(0.0)
        } else if has(M::PhongNoClamp) {
            cos_alpha.powf(power)
        } else {
            cos_alpha.max(0.0).powf(power)
        };
        if has(M::PhongUnnormalised) {
            return peak;
        }
        if has(M::PhongNPlusOne) {
            return (n + 1.0) * INV_TWO_PI * peak;
        }
        if has(M::PhongNOverTwoPi) {
            return n * INV_TWO_PI * peak;
        }
        (n + 2.0) * INV_TWO_PI * peak
    }
}

impl Bsdf for Phong {
    fn eval(&self, i: &SurfaceInteraction) -> Vec3 {
        let has = |mistake| self.mistakes.has(mistake);
        let mut cos_i = Frame::cos_theta(i.wi);
        if has(M::PhongAbsCosine) {
            cos_i = cos_i.abs();
        }
        let from_behind = Frame::cos_theta(i.wo) <= 0.0 && !has(M::PhongNoWoTest);
        let lit_from_behind = cos_i <= 0.0 && !has(M::PhongNoWiTest);
        if from_behind || lit_from_behind {
            return Vec3::ZERO;
        }
        if has(M::PhongNoCosine) {
            cos_i = 1.0;
        }
        let mut diffuse = self.diffuse_reflectance.eval(i) * INV_PI * cos_i;
        if has(M::PhongNoPi) {
            diffuse /= INV_PI;
        }
        let mut specular = self.specular_reflectance.eval(i) * self.lobe(i.wo, i.wi) * cos_i;
        if has(M::PhongSpecularWithoutCosine) {
            specular /= cos_i;
        }
        if !has(M::PhongNoScale) && !has(M::PhongScaleSpecularOnly) {
            diffuse *= self.scale;
        }
        if !has(M::PhongNoScale) && !has(M::PhongScaleDiffuseOnly) {
            specular *= self.scale;
        }
        let value = diffuse + specular;
        if has(M::PhongChannelsSwapped) { blue_first(value) } else { value }
    }
}

fn first_texel(texture: &Texture) -> Texture {
    texture.lookup(Vec2::ZERO).into()
}

fn blue_first(v: Vec3) -> Vec3 {
    vec3(v.z, v.y, v.x)
}
