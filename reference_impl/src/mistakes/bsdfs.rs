//! Mistakes in the diffuse BSDF, and in what both BSDFs share: the formulas of `crate::bsdfs`, with switches.

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
        let scaled = mistakes.has(M::DiffuseScaled);
        Self {
            mistakes: mistakes.clone(),
            albedo: if mistakes.has(M::DiffuseTextureIgnored) {
                first_texel(albedo)
            } else if mistakes.has(M::DiffuseTextureAveraged) {
                albedo.average().into()
            } else {
                albedo.clone()
            },
            scale: if scaled { 0.99 / albedo.max().max_element() } else { 1.0 },
        }
    }
}

impl Bsdf for Diffuse {
    fn eval(&self, i: &SurfaceInteraction) -> Vec3 {
        let has = |mistake| self.mistakes.has(mistake);
        let i = &turned(&self.mistakes, i);
        let wi = incoming(&self.mistakes, i);
        let mut cos_i = if has(M::DiffuseAxisY) { wi.y } else { Frame::cos_theta(wi) };
        let cos_o = Frame::cos_theta(i.wo);
        if has(M::DiffuseAbsCosine) {
            cos_i = cos_i.abs();
        }
        let untested = has(M::DiffuseNoTests) || has(M::TestsInIntegrator);
        let from_behind = cos_o <= 0.0 && !has(M::DiffuseNoWoTest) && !untested;
        let lit_from_behind = cos_i <= 0.0 && !has(M::DiffuseNoWiTest) && !untested;
        let black = match has(M::DiffuseTestsAtOnce) {
            true => from_behind && lit_from_behind,
            false => from_behind || lit_from_behind,
        };
        if black || has(M::DiffuseBlack) {
            return Vec3::ZERO;
        }
        if has(M::DiffuseSine) {
            cos_i = (1.0 - cos_i * cos_i).max(0.0).sqrt();
        }
        if has(M::DiffuseNoCosine) || has(M::CosineInIntegrator) {
            cos_i = 1.0;
        }
        if has(M::DiffuseCosO) {
            cos_i = cos_o;
        }
        if has(M::DiffuseTwoCosines) {
            cos_i *= cos_i;
        }
        let albedo = if has(M::DiffuseNoAlbedo) { Vec3::ONE } else { self.albedo.eval(i) };
        let mut value = if has(M::ShadingInF64) {
            (albedo.as_dvec3() / std::f64::consts::PI * f64::from(cos_i)).as_vec3()
        } else {
            self.scale * albedo * INV_PI * cos_i
        };
        if has(M::DiffuseNoPi) || has(M::PiInIntegrator) {
            value /= INV_PI;
        }
        if has(M::DiffusePiTwice) {
            value *= INV_PI;
        }
        if has(M::DiffusePiRounded) {
            value *= 0.32 / INV_PI;
        }
        if has(M::DiffusePi314) {
            value *= 0.318_471_34 / INV_PI;
        }
        if has(M::DiffuseOverTwoPi) {
            value *= INV_TWO_PI / INV_PI;
        }
        if has(M::DiffuseGrey) {
            value = Vec3::splat(value.x);
        }
        if has(M::DiffuseChannelsSwapped) { blue_first(value) } else { value }
    }
}

/// The point with its directions in the local frame, where the integrator has not turned them.
pub fn turned(mistakes: &Mistakes, i: &SurfaceInteraction) -> SurfaceInteraction {
    let mut turned = *i;
    if mistakes.has(M::DirectionsInWorld) {
        turned.wi = i.frame_ns.to_local(i.wi);
        turned.wo = i.frame_ns.to_local(i.wo);
    }
    if mistakes.has(M::WiFromLight) {
        turned.wi = -turned.wi;
    }
    turned
}

/// The direction toward the light, of unit length where the integrator has not seen to it.
pub fn incoming(mistakes: &Mistakes, i: &SurfaceInteraction) -> Vec3 {
    if mistakes.has(M::WiUnnormalised) { i.wi.normalize_or_zero() } else { i.wi }
}

pub fn first_texel(texture: &Texture) -> Texture {
    texture.lookup(Vec2::ZERO).into()
}

pub fn blue_first(v: Vec3) -> Vec3 {
    vec3(v.z, v.y, v.x)
}
