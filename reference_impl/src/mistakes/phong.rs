//! Mistakes in the Phong BSDF: the formula of `crate::bsdfs::phong`, with switches.

use basecode::{
    Bsdf, Frame, INV_PI, INV_TWO_PI, Material, SurfaceInteraction, Texture, Vec3, vec3,
};

use super::bsdfs::{blue_first, first_texel, incoming, turned};
use super::{Mistake as M, Mistakes};

pub struct Phong {
    mistakes: Mistakes,
    diffuse_reflectance: Texture,
    specular_reflectance: Texture,
    exponent: f32,
    /// By channel, as only a mistake wants it.
    scale: Vec3,
}

impl Phong {
    pub fn new(mistakes: &Mistakes, material: &Material) -> Self {
        let (mut kd, mut ks) = (material.diffuse.clone(), material.specular.clone());
        if mistakes.has(M::PhongTextureIgnored) {
            (kd, ks) = (first_texel(&kd), first_texel(&ks));
        }
        if mistakes.has(M::PhongTextureAveraged) {
            (kd, ks) = (kd.average().into(), ks.average().into());
        }
        if mistakes.has(M::PhongKdKsSwapped) {
            (kd, ks) = (ks, kd);
        }
        Self {
            mistakes: mistakes.clone(),
            diffuse_reflectance: kd,
            specular_reflectance: ks,
            exponent: material.exponent,
            scale: scale(mistakes, material),
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
        if has(M::PhongReflectNoTwo) {
            return -wi.x * wo.x - wi.y * wo.y;
        }
        if has(M::PhongReflectIsNegative) {
            return -wi.dot(wo);
        }
        if has(M::PhongReflectForgotten) {
            return wi.dot(wo);
        }
        if has(M::PhongReflectOneAxis) {
            return wi.dot(vec3(-wo.x, wo.y, wo.z));
        }
        if has(M::PhongAlphaFromNormal) {
            return Frame::cos_theta(wi);
        }
        if has(M::PhongSpecularAbs) {
            return wi.dot(mirrored).abs();
        }
        if has(M::AlphaByDots) {
            return 2.0 * wi.z * wo.z - wi.dot(wo);
        }
        if has(M::ReflectWi) {
            return wo.dot(vec3(-wi.x, -wi.y, wi.z));
        }
        if has(M::ShadingInF64) {
            return wi.as_dvec3().dot(mirrored.as_dvec3()) as f32;
        }
        wi.dot(mirrored)
    }

    /// The exponent of the lobe.
    fn power(&self) -> f32 {
        let has = |mistake| self.mistakes.has(mistake);
        let n = self.exponent;
        match () {
            () if has(M::PhongExponentPlusOne) => n + 1.0,
            () if has(M::PhongExponentMinusOne) => n - 1.0,
            () if has(M::PhongExponentHalf) => 0.5 * n,
            () if has(M::PhongExponentTwice) => 2.0 * n,
            () if has(M::PhongExponentTruncated) => n.trunc(),
            () if has(M::PhongExponentRounded) => n.round(),
            () => n,
        }
    }

    /// The specular lobe, rho_s left out.
    fn lobe(&self, wo: Vec3, wi: Vec3) -> f32 {
        let has = |mistake| self.mistakes.has(mistake);
        let (n, power) = (self.exponent, self.power());
        let cos_alpha = self.cos_alpha(wo, wi);
        let peak = if has(M::PhongPowBeforeClamp) {
            cos_alpha.powf(power).max(0.0)
        } else if has(M::PhongPowSwapped) {
            power.powf(cos_alpha.max(0.0))
        } else if has(M::PhongNoClamp) {
            cos_alpha.powf(power)
        } else if has(M::PowerByLogarithm) {
            (power * cos_alpha.max(1e-30).ln()).exp()
        } else if has(M::ShadingInF64) {
            f64::from(cos_alpha.max(0.0)).powf(f64::from(power)) as f32
        } else {
            cos_alpha.max(0.0).powf(power)
        };
        let factor = match () {
            () if has(M::PhongUnnormalised) => 1.0,
            () if has(M::PhongNPlusOne) => (n + 1.0) * INV_TWO_PI,
            () if has(M::PhongNoParentheses) => n + 2.0 * INV_TWO_PI,
            () if has(M::PhongNOverTwoPi) => n * INV_TWO_PI,
            () if has(M::PhongSpecularNoTwoPi) => n + 2.0,
            () if has(M::PhongSpecularOverPi) => (n + 2.0) * INV_PI,
            // What belongs to the exponent alone is not carried over, but a truncated one is.
            () if has(M::PhongExponentTruncated) => (power + 2.0) * INV_TWO_PI,
            () => (n + 2.0) * INV_TWO_PI,
        };
        factor * peak
    }

    /// The cosines of the diffuse and of the specular term.
    fn cosines(&self, cos_i: f32, cos_o: f32) -> [f32; 2] {
        let has = |mistake| self.mistakes.has(mistake);
        match () {
            () if has(M::PhongNoCosine) || has(M::CosineInIntegrator) => [1.0, 1.0],
            () if has(M::PhongTwoCosines) => [cos_i * cos_i; 2],
            () if has(M::PhongCosO) => [cos_o; 2],
            () if has(M::PhongSpecularWithoutCosine) => [cos_i, 1.0],
            () if has(M::PhongDiffuseWithoutCosine) => [1.0, cos_i],
            () if has(M::PhongSpecularTwoCosines) => [cos_i, cos_i * cos_i],
            () => [cos_i; 2],
        }
    }

    /// `scale` at a point, for the diffuse and for the specular term.
    fn scales(&self, kd: Vec3, ks: Vec3) -> [Vec3; 2] {
        let has = |mistake| self.mistakes.has(mistake);
        let scale = if has(M::PhongScaleAtPoint) {
            Vec3::splat(below_one((kd + ks).max_element()))
        } else {
            self.scale
        };
        match () {
            () if has(M::PhongNoScale) => [Vec3::ONE; 2],
            () if has(M::PhongScaleTwice) => [scale * scale; 2],
            () if has(M::PhongScaleInverted) => [Vec3::ONE / scale; 2],
            () if has(M::PhongScaleDiffuseOnly) => [scale, Vec3::ONE],
            () if has(M::PhongScaleSpecularOnly) => [Vec3::ONE, scale],
            () => [scale; 2],
        }
    }
}

impl Bsdf for Phong {
    fn eval(&self, i: &SurfaceInteraction) -> Vec3 {
        let i = &turned(&self.mistakes, i);
        let has = |mistake| self.mistakes.has(mistake);
        let wi = incoming(&self.mistakes, i);
        let (mut cos_i, cos_o) = (Frame::cos_theta(wi), Frame::cos_theta(i.wo));
        if has(M::PhongAbsCosine) {
            cos_i = cos_i.abs();
        }
        let untested = has(M::PhongNoTests) || has(M::TestsInIntegrator);
        let from_behind = cos_o <= 0.0 && !has(M::PhongNoWoTest) && !untested;
        let lit_from_behind = cos_i <= 0.0 && !has(M::PhongNoWiTest) && !untested;
        if from_behind || lit_from_behind || has(M::PhongBlack) {
            return Vec3::ZERO;
        }
        let (kd, mut ks) = (self.diffuse_reflectance.eval(i), self.specular_reflectance.eval(i));
        if has(M::PhongSpecularGrey) {
            ks = Vec3::splat(ks.x);
        }
        let [scale_d, scale_s] = self.scales(kd, ks);
        let [cos_d, cos_s] = self.cosines(cos_i, cos_o);
        let mut diffuse = scale_d * kd * INV_PI * cos_d;
        if has(M::PhongNoPi) {
            diffuse /= INV_PI;
        }
        if has(M::PhongPiTwice) {
            diffuse *= INV_PI;
        }
        if has(M::PhongPi314) {
            diffuse *= 0.318_471_34 / INV_PI;
        }
        if has(M::PhongDiffuseNormalised) {
            diffuse *= (self.exponent + 2.0) * INV_TWO_PI;
        }
        if has(M::PhongDiffuseLessSpecular) {
            diffuse *= Vec3::ONE - ks;
        }
        if has(M::PhongKsRaised) {
            ks = ks.powf(self.exponent);
        }
        let specular = scale_s * ks * self.lobe(i.wo, wi) * cos_s;
        let mut value = match () {
            () if has(M::PhongNoDiffuse) => specular,
            () if has(M::PhongNoSpecular) => diffuse,
            () => diffuse + specular,
        };
        if has(M::PiInIntegrator) {
            value /= INV_PI;
        }
        if has(M::PhongChannelsSwapped) { blue_first(value) } else { value }
    }
}

/// What keeps a largest reflectance below one.
fn below_one(largest: f32) -> f32 {
    if largest > 1.0 { 0.99 / largest } else { 1.0 }
}

fn scale(mistakes: &Mistakes, material: &Material) -> Vec3 {
    let has = |mistake| mistakes.has(mistake);
    let (kd, ks) = (&material.diffuse, &material.specular);
    let sum = kd.max() + ks.max();
    Vec3::splat(match () {
        () if has(M::PhongScalePerChannel) => return sum.to_array().map(below_one).into(),
        () if has(M::PhongScaleAverage) => below_one((kd.average() + ks.average()).max_element()),
        () if has(M::PhongScaleOfPeaks) => {
            below_one(kd.max().max_element() + ks.max().max_element())
        }
        () if has(M::PhongScaleOfKd) => below_one(kd.max().max_element()),
        () if has(M::PhongScaleAlways) => 0.99 / sum.max_element(),
        () if has(M::PhongScaleWithoutMargin) => 1.0 / sum.max_element().max(1.0),
        () => material.energy_scale(),
    })
}
