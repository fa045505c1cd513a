//! The handout's shading in closed form, in f64, and variants with one change.
//!
//! `Shading::default()` is right. A variant gives the answer of a renderer with one known mistake; [`super::price`]
//! tests whether an answer is that of a single mistake.

use std::array;

use renderer_api as api;

/// The radiance that a surface reflects of a point light:
/// `I r^-falloff times scale (Kd/pi + Ks (n + 2)/(2 pi) max(0, cos alpha)^n) cos theta_i`,
/// the handout's equation (1) and the equation of its section 1.3. Each field is one thing that a
/// student may get wrong; pairs hold the diffuse term's value, then the specular term's.
#[derive(Clone, Copy, Debug)]
pub struct Shading {
    /// A factor of each term.
    pub factor: [f64; 2],
    /// Whether each term is multiplied by the material's energy scale.
    pub scaled: [bool; 2],
    /// Whether each channel has an energy scale of its own.
    pub scale_by_channel: bool,
    /// The power of cos theta_i in each term.
    pub cos_i: [f64; 2],
    /// The power of cos theta_o in each term.
    pub cos_o: [f64; 2],
    /// The lobe's exponent is `exponent[0] n + exponent[1]`, then rounded by `round`.
    pub exponent: [f64; 2],
    /// How the exponent is rounded.
    pub round: fn(f64) -> f64,
    /// What the lobe is multiplied by, a function of n.
    pub normalization: fn(f64) -> f64,
    /// Which angle the lobe depends on.
    pub angle: Angle,
    /// Where cos alpha is clamped to 0.
    pub clamp: Clamp,
    /// Whether n is raised to cos alpha.
    pub swapped_power: bool,
    /// Whether Ks is raised with cos alpha.
    pub raised_ks: bool,
    /// The specular term is multiplied by Kd too, itself with this power of the energy scale.
    pub specular_times_diffuse: Option<i32>,
    /// The diffuse term is multiplied by one minus Ks, itself with this power of the energy scale.
    pub diffuse_less_specular: Option<i32>,
    /// Whether cos theta_i is replaced by half of it plus one half.
    pub wrapped: bool,
    /// Whether the diffuse term is multiplied by the lobe's normalization too.
    pub diffuse_normalized: bool,
    /// Where a surface is black.
    pub tests: Tests,
    /// The component of wi that stands for cos theta_i: 2 is right.
    pub axis: usize,
    /// Whether cos theta_i is replaced by its magnitude.
    pub absolute: bool,
    /// Whether cos theta_i is replaced by the sine.
    pub sine: bool,
    /// Which of red, green and blue each channel takes.
    pub channels: [usize; 3],
    /// The same for the specular term alone, after `channels`.
    pub specular_channels: [usize; 3],
    /// What is made of the diffuse reflectance.
    pub albedo: fn(f64) -> f64,
    /// Which of Kd (0) and Ks (1) the terms of a Phong material take.
    pub colors: [usize; 2],
    /// What is made of both terms.
    pub terms: Terms,
    /// The power of 1/r.
    pub falloff: f64,
    /// What is made of that power of r before it divides.
    pub divisor: fn(f64) -> f64,
    /// What is made of the intensity over the squared distance.
    pub incident: fn(f64) -> f64,
    /// Whether wi reaches the BSDF with the length r.
    pub long_wi: bool,
    /// The directions that an integrator hands to the BSDF.
    pub directions: Directions,
    /// Whether the distance along the camera ray stands for that of the light.
    pub along_ray: bool,
    /// Whether the distance of the light from the world's origin stands for its distance.
    pub from_origin: bool,
    /// The axis that is left out of the distance of the light.
    pub without_axis: Option<usize>,
    /// How far the light stands from its place, world space.
    pub light_offset: [f32; 3],
    /// Whether an integrator asks the BSDF at all.
    pub asks: bool,
    /// What is added where a surface is lit, times the diffuse reflectance where a material is known.
    pub ambient: f64,
    /// What is made of radiance before it is written.
    pub output: fn(f64) -> f64,
}

/// The directions that an integrator hands to a BSDF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Directions {
    /// wi and wo in the local frame: right.
    Local,
    /// wi in world space.
    WorldWi,
    /// wo in world space.
    WorldWo,
    /// Both in world space.
    World,
    /// Both in the frame of the negated normal.
    NegatedNormal,
    /// wi negated.
    NegatedWi,
    /// wo negated.
    NegatedWo,
    /// wi in the place of wo, and wo in that of wi.
    Exchanged,
    /// wo in both places.
    WoTwice,
    /// wi in both places.
    WiTwice,
    /// wi brought from the local frame to world space, though it is in world space.
    WiToWorld,
    /// wi and wo brought from the local frame to world space.
    BothToWorld,
    /// wo brought to the local frame twice.
    WoLocalTwice,
    /// wi brought to the local frame twice.
    WiLocalTwice,
    /// wi with two of its components exchanged.
    WiTurned([usize; 3]),
    /// wo with two of its components exchanged.
    WoTurned([usize; 3]),
    /// The light's position, as a direction, in the place of wi.
    LightFromOrigin,
    /// The direction from the viewer to the light in the place of wi.
    LightFromViewer,
    /// The sum of the positions of light and surface in the place of their difference.
    LightPlusPoint,
}

/// What is tested before anything is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tests {
    /// wo and wi: black where either lies below the surface. Right.
    Each,
    /// wo alone.
    Wo,
    /// wi alone.
    Wi,
    /// Nothing.
    Neither,
    /// Both at once: black only where both lie below.
    AtOnce,
    /// Their product: not black where both lie below.
    SameSide,
}

/// What is made of the diffuse term and the specular term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Terms {
    /// Their sum: right.
    Sum,
    /// Their product, times cos theta_i once.
    Product,
    /// The larger one.
    Larger,
}

/// What is clamped to 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clamp {
    /// cos alpha, before it is raised: right.
    Base,
    /// The power of cos alpha: even exponents shine backward.
    Power,
    /// Nothing: fractional powers are no numbers.
    Nothing,
    /// Nothing, but its magnitude is raised: the lobe shines both ways.
    Magnitude,
    /// Nothing, and no power of a negative number is one, as in WGSL.
    NotANumber,
}

/// The angle that a lobe depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Angle {
    /// Between wi and this multiple of n cos theta_o plus this multiple of wo: 2 and -1 give the mirror direction.
    Sum(f64, f64),
    /// Between one direction and twice the normal minus the other, where the normal has these powers of cos theta_i
    /// and cos theta_o, instead of one of each.
    Cosines(i32, i32),
    /// Between the normal and the half vector (Blinn).
    Half,
    /// Between wi and wo mirrored on this axis of the tangents alone, 0 or 1.
    OneAxis(usize),
    /// Between wi and the normal.
    Normal,
}

impl Default for Shading {
    fn default() -> Self {
        Self {
            factor: [1.0; 2],
            scaled: [true; 2],
            scale_by_channel: false,
            cos_i: [1.0; 2],
            cos_o: [0.0; 2],
            exponent: [1.0, 0.0],
            round: |n| n,
            normalization: |n| (n + 2.0) / std::f64::consts::TAU,
            angle: Angle::Sum(2.0, -1.0),
            clamp: Clamp::Base,
            swapped_power: false,
            raised_ks: false,
            specular_times_diffuse: None,
            diffuse_less_specular: None,
            wrapped: false,
            diffuse_normalized: false,
            tests: Tests::Each,
            axis: 2,
            absolute: false,
            sine: false,
            channels: [0, 1, 2],
            specular_channels: [0, 1, 2],
            albedo: |albedo| albedo,
            colors: [0, 1],
            terms: Terms::Sum,
            falloff: 2.0,
            divisor: |squared| squared,
            incident: |incident| incident,
            long_wi: false,
            directions: Directions::Local,
            along_ray: false,
            from_origin: false,
            without_axis: None,
            light_offset: [0.0; 3],
            asks: true,
            ambient: 0.0,
            output: |radiance| radiance,
        }
    }
}

/// One point of a surface, as its BSDF sees it.
#[derive(Clone, Copy, Debug)]
pub struct ShadedPoint {
    /// The material, its colors not multiplied by `scale`.
    pub material: api::MaterialValue,
    /// The material's energy scale.
    pub scale: f64,
    /// Unit direction toward the viewer, local frame.
    pub wo: [f64; 3],
    /// Unit direction toward the light, local frame.
    pub wi: [f64; 3],
    /// Radiant intensity of the light [W sr^-1].
    pub intensity: [f64; 3],
    /// Distance to the light, scene units.
    pub distance: f64,
}

impl ShadedPoint {
    /// A BSDF query: a light of intensity 1 at distance 1.
    pub fn of_bsdf(material: &api::MaterialValue, scale: f64, wo: [f32; 3], wi: [f32; 3]) -> Self {
        let [wo, wi] = [wo, wi].map(|w| w.map(f64::from));
        Self { material: *material, scale, wo, wi, intensity: [1.0; 3], distance: 1.0 }
    }
}

impl Shading {
    /// Radiance toward the viewer [W m^-2 sr^-1]; for a BSDF query its value times cos theta_i.
    pub fn radiance(&self, point: &ShadedPoint) -> [f64; 3] {
        let ShadedPoint { material, scale, wo, wi, intensity, distance } = point;
        let cos_o = wo[2];
        let length = if self.long_wi { *distance } else { 1.0 };
        let cos_i = length * if self.absolute { wi[self.axis].abs() } else { wi[self.axis] };
        let (behind, below) = (cos_o <= 0.0, cos_i <= 0.0);
        let black = match self.tests {
            Tests::Each => behind || below,
            Tests::Wo => behind,
            Tests::Wi => below,
            Tests::Neither => false,
            Tests::AtOnce => behind && below,
            Tests::SameSide => behind != below,
        };
        if black {
            return [0.0; 3];
        }
        let cos_i = if self.sine { (1.0 - cos_i * cos_i).max(0.0).sqrt() } else { cos_i };
        let cos_i = if self.wrapped { 0.5 * cos_i + 0.5 } else { cos_i };
        let phong = material.model == api::MATERIAL_PHONG;
        let lobe = if phong && self.factor[1] != 0.0 { self.lobe(point, length) } else { 0.0 };
        let [diffuse, specular]: [f64; 2] = array::from_fn(|term| {
            let scale = if self.scaled[term] { *scale } else { 1.0 };
            self.factor[term]
                * scale
                * power(cos_i, self.cos_i[term])
                * power(cos_o, self.cos_o[term])
        });
        let n = f64::from(material.exponent);
        let normalized = if self.diffuse_normalized { (self.normalization)(n) } else { 1.0 };
        let diffuse = normalized * diffuse / std::f64::consts::PI;
        let incident = self.attenuation(*distance);
        let colors = [material.diffuse, material.specular];
        let [kd, ks] = if phong { self.colors.map(|color| colors[color]) } else { colors };
        let value: [f64; 3] = array::from_fn(|c| {
            let ks = f64::from(ks[self.specular_channels[c]]);
            let own = (f64::from(kd[c]) + ks).max(0.99);
            let less = self.diffuse_less_specular.filter(|_| phong);
            let less = less.map_or(1.0, |power| 1.0 - scale.powi(power) * ks);
            let ks = if self.raised_ks { ks.powf(n) } else { ks };
            let kd_too =
                self.specular_times_diffuse.map(|power| scale.powi(power) * f64::from(kd[c]));
            let ks = ks * kd_too.unwrap_or(1.0);
            let factor = if self.scale_by_channel { 0.99 / own / scale } else { 1.0 };
            let terms = [diffuse * less * (self.albedo)(f64::from(kd[c])), specular * lobe * ks];
            factor * self.together(terms, if phong { cos_i } else { 0.0 })
        });
        array::from_fn(|c| {
            let reflected = (self.incident)(intensity[c] * incident) * value[self.channels[c]];
            (self.output)(reflected + self.ambient * f64::from(kd[c]))
        })
    }

    /// What the terms make together. Of a surface that has but one term (`cos_i` 0) it is all.
    fn together(&self, [diffuse, specular]: [f64; 2], cos_i: f64) -> f64 {
        match self.terms {
            Terms::Product if cos_i != 0.0 => diffuse * specular / power(cos_i, self.cos_i[1]),
            Terms::Larger => diffuse.max(specular),
            Terms::Sum | Terms::Product => diffuse + specular,
        }
    }

    /// What the intensity is multiplied by at this distance of the light.
    pub fn attenuation(&self, distance: f64) -> f64 {
        // The usual power without the function for all: this is computed millions of times.
        let power = match self.falloff {
            2.0 => distance * distance,
            falloff => distance.powf(falloff),
        };
        1.0 / (self.divisor)(power)
    }

    /// This change, made to another shading instead of the right one: of what conventions change
    /// too, both count.
    #[inline]
    pub fn over(&self, other: &Self) -> Self {
        Self {
            factor: array::from_fn(|term| self.factor[term] * other.factor[term]),
            cos_i: array::from_fn(|term| self.cos_i[term] + other.cos_i[term] - 1.0),
            falloff: self.falloff + other.falloff - 2.0,
            long_wi: self.long_wi != other.long_wi,
            ..*self
        }
    }

    /// The lobe with its normalization, Ks left out.
    fn lobe(&self, point: &ShadedPoint, length: f64) -> f64 {
        let ShadedPoint { material, wo, wi, .. } = point;
        let n = f64::from(material.exponent);
        let between = wi[0] * wo[0] + wi[1] * wo[1] + wi[2] * wo[2];
        let cos_alpha = length
            * match self.angle {
                Angle::Sum(normal, toward_viewer) => {
                    normal * wi[2] * wo[2] + toward_viewer * between
                }
                Angle::Cosines(i, o) => 2.0 * wi[2].powi(i) * wo[2].powi(o) - between,
                Angle::OneAxis(axis) => {
                    let signs = [[-1.0, 1.0], [1.0, -1.0]][axis];
                    signs[0] * wi[0] * wo[0] + signs[1] * wi[1] * wo[1] + wi[2] * wo[2]
                }
                Angle::Normal => wi[2],
                Angle::Half => {
                    let h: [f64; 3] = std::array::from_fn(|i| wi[i] + wo[i]);
                    h[2] / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt().max(f64::MIN_POSITIVE)
                }
            };
        let base = match self.clamp {
            Clamp::Base => cos_alpha.max(0.0),
            Clamp::Magnitude => cos_alpha.abs(),
            Clamp::Power | Clamp::Nothing => cos_alpha,
            Clamp::NotANumber if cos_alpha < 0.0 => f64::NAN,
            Clamp::NotANumber => cos_alpha,
        };
        let exponent = (self.round)(self.exponent[0] * n + self.exponent[1]);
        let power = if self.swapped_power { exponent.powf(base) } else { base.powf(exponent) };
        let power = if self.clamp == Clamp::Power { power.max(0.0) } else { power };
        let lobe = (self.normalization)((self.round)(n)) * power;
        // As in a renderer's single precision.
        if lobe.abs() > f64::from(f32::MAX) { f64::INFINITY } else { lobe }
    }
}

/// `base` to `exponent`, with the sign of the base.
pub fn power(base: f64, exponent: f64) -> f64 {
    match exponent {
        0.0 => 1.0,
        1.0 => base,
        _ => base.signum() * base.abs().powf(exponent),
    }
}

/// 0.99 over the largest component of Kd + Ks where that exceeds 1; 1 elsewhere and for diffuse.
pub fn energy_scale(material: &api::MaterialValue) -> f64 {
    let sums = (0..3).map(|c| f64::from(material.diffuse[c]) + f64::from(material.specular[c]));
    let largest = sums.fold(0.0, f64::max);
    if material.model == api::MATERIAL_PHONG && largest > 1.0 { 0.99 / largest } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: [f64; 3] = [0.0, 0.0, 1.0];

    fn point() -> ShadedPoint {
        let material = api::MaterialValue {
            model: api::MATERIAL_PHONG,
            diffuse: [0.5, 0.25, 0.1],
            specular: [0.2, 0.3, 0.4],
            exponent: 4.0,
        };
        let intensity = [2.0, 4.0, 8.0];
        ShadedPoint { material, scale: 1.0, wo: UP, wi: UP, intensity, distance: 2.0 }
    }

    #[test]
    fn the_formula_has_its_closed_forms() {
        let expected = 2.0 / 4.0 * (0.5 / std::f64::consts::PI + 0.2 * 6.0 / std::f64::consts::TAU);
        assert!((Shading::default().radiance(&point())[0] - expected).abs() < 1e-8);
        let below = ShadedPoint { wi: [0.0, 0.0, -1.0], ..point() };
        assert_eq!(Shading::default().radiance(&below), [0.0; 3]);
        let behind = ShadedPoint { wo: [0.0, 0.0, -1.0], ..point() };
        assert_eq!(Shading::default().radiance(&behind), [0.0; 3]);
    }

    #[test]
    fn each_change_changes_its_own_term() {
        let right = Shading::default();
        let diffuse = Shading { factor: [1.0, 0.0], ..right };
        let specular = Shading { factor: [0.0, 1.0], ..right };
        let sum = diffuse.radiance(&point())[1] + specular.radiance(&point())[1];
        assert!((sum - right.radiance(&point())[1]).abs() < 1e-12);
        let near = Shading { falloff: 1.0, ..right };
        assert!((near.radiance(&point())[2] / right.radiance(&point())[2] - 2.0).abs() < 1e-12);
        let bounded = Shading { divisor: |squared| squared.max(1.0), ..right };
        assert_eq!([0.5, 2.0].map(|r| bounded.attenuation(r)), [1.0, 0.25]);
        let slanted = ShadedPoint { wi: [0.6, 0.0, 0.8], ..point() };
        let twice = Shading { cos_i: [2.0; 2], ..right };
        assert!((twice.radiance(&slanted)[0] / right.radiance(&slanted)[0] - 0.8).abs() < 1e-12);
        let unclamped = Shading { clamp: Clamp::Nothing, tests: Tests::Wo, ..right };
        let odd = ShadedPoint {
            material: api::MaterialValue { exponent: 2.5, ..point().material },
            wi: [0.0, 0.0, -1.0],
            ..point()
        };
        assert!(unclamped.radiance(&odd)[0].is_nan());
    }
}
