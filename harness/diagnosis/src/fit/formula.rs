//! The shading formula with its fitted parameters: the right values, and how a renderer's may differ.

use std::f64::consts::PI;

use evidence::{Witness, WitnessQuery};

/// What multiplies the incident light at a point.
#[derive(Clone, Copy, Debug)]
pub enum Reflector {
    /// A witness BSDF, its cosine included.
    Witness(Witness),
    /// A material.
    Surface {
        /// Whether it has a specular term.
        phong: bool,
        /// Diffuse reflectance.
        diffuse: [f64; 3],
        /// Specular reflectance.
        specular: [f64; 3],
        /// Phong exponent.
        exponent: f64,
        /// Whether the energy scale is yet to be applied.
        unscaled: bool,
    },
}

/// A point that was shaded: all that the answer depends on, and the answer.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// What reflects.
    pub reflector: Reflector,
    /// Unit direction toward the viewer, local shading frame.
    pub wo: [f64; 3],
    /// Unit direction toward the light, local shading frame.
    pub wi: [f64; 3],
    /// Distance to the light, scene units; 1 where a BSDF alone is asked.
    pub distance: f64,
    /// Radiant intensity of the light [W sr^-1]; 1 where a BSDF alone is asked.
    pub intensity: [f64; 3],
    /// The answer.
    pub found: [f64; 3],
}

/// Powers that a term of the formula has, beside what is right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Power {
    /// Of cos theta_i.
    CosI,
    /// Of cos theta_o.
    CosO,
    /// Of the distance to the light.
    R,
    /// Of the reflectance.
    Reflectance,
    /// Of the energy scale.
    Scale,
}

/// How a term differs from what is right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// Additional powers, by [`Power`].
    pub powers: [f64; 5],
    /// An additional factor, by channel.
    pub factor: [f64; 3],
}

impl Term {
    const RIGHT: Self = Self { powers: [0.0; 5], factor: [1.0; 3] };
}

/// The cosine that is raised to the exponent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lobe {
    /// Between wi and the mirror image of wo.
    Mirror,
    /// The same, its absolute value.
    AbsoluteMirror,
    /// Between the half vector and the normal.
    Half,
    /// Between wi and wo.
    Unmirrored,
    /// Between wi and the normal.
    Light,
    /// Between wo and the normal.
    Viewer,
}

/// What is taken for the exponent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExponentForm {
    /// As it is.
    Whole,
    /// Its integer part.
    Truncated,
    /// The nearest integer.
    Rounded,
    /// The next integer above.
    Ceiled,
}

/// What the energy scale is made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScaleForm {
    /// 0.99 over the largest component of Kd + Ks, where that exceeds 1.
    Largest,
    /// The mean of the components instead.
    Mean,
    /// Each channel its own.
    Channel,
    /// 1 instead of 0.99.
    One,
    /// Where the largest does not exceed 1 too.
    Always,
    /// The sum of all components.
    Sum,
    /// The smallest component.
    Smallest,
}

/// What becomes of the value at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum After {
    /// Nothing.
    Nothing,
    /// This is added.
    Offset([f64; 3]),
    /// It is cut here.
    Clamp(f64),
    /// It is raised to this power.
    Power(f64),
}

/// What happens to light on its way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Incident {
    /// I / r^2.
    Right,
    /// 1 / r^2, whatever the light's intensity.
    Unit,
    /// I / (r^2 + k).
    Softened(f64),
    /// I / r^2, cut here.
    Clamp(f64),
}

/// What is answered where one direction lies below the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gate {
    /// Nothing.
    Both,
    /// wi is not tested.
    NoWi,
    /// wi is not tested, its cosine taken as positive.
    AbsoluteWi,
    /// wo is not tested.
    NoWo,
    /// Neither is tested.
    Neither,
}

/// The formula of shading as a renderer may have it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Formula {
    /// The diffuse term, or all of it under a witness.
    pub diffuse: Term,
    /// The specular term.
    pub specular: Term,
    /// The cosine that is raised.
    pub lobe: Lobe,
    /// What is raised to.
    pub exponent: ExponentForm,
    /// Its factor: a of a n + b.
    pub times: f64,
    /// Its addend: b of a n + b.
    pub plus: f64,
    /// Whether the normalization is made from a n + b too.
    pub follows: bool,
    /// k of the normalization (n + k) / (2 pi).
    pub normalization_plus: f64,
    /// What the energy scale is made from.
    pub scale: ScaleForm,
    /// Whose channel stands in each.
    pub order: [usize; 3],
    /// On the way.
    pub incident: Incident,
    /// wi is as long as r to this power.
    pub wi_length: f64,
    /// At the end.
    pub after: After,
    /// Below the surface.
    pub gate: Gate,
}

impl Formula {
    /// The handout's.
    pub const RIGHT: Self = Self {
        diffuse: Term::RIGHT,
        specular: Term::RIGHT,
        lobe: Lobe::Mirror,
        exponent: ExponentForm::Whole,
        times: 1.0,
        plus: 0.0,
        follows: false,
        normalization_plus: 2.0,
        scale: ScaleForm::Largest,
        order: [0, 1, 2],
        incident: Incident::Right,
        wi_length: 0.0,
        after: After::Nothing,
        gate: Gate::Both,
    };

    /// What it answers at a point.
    pub fn value(&self, sample: &Sample) -> [f64; 3] {
        let (below_i, below_o) = (sample.wi[2] <= 0.0, sample.wo[2] <= 0.0);
        let dark = match self.gate {
            Gate::Both => below_i || below_o,
            Gate::NoWi | Gate::AbsoluteWi => below_o,
            Gate::NoWo => below_i,
            Gate::Neither => false,
        };
        if dark {
            return [0.0; 3];
        }
        let [diffuse, specular] = self.terms(sample);
        std::array::from_fn(|c| {
            let value = diffuse[c] + specular[c];
            match self.after {
                After::Nothing => value,
                After::Offset(offset) => value + offset[c],
                After::Clamp(most) => value.min(most),
                After::Power(power) => value.max(0.0).powf(power),
            }
        })
    }

    /// The diffuse and the specular term at a point, before anything is done to their sum.
    pub fn terms(&self, sample: &Sample) -> [[f64; 3]; 2] {
        let r = sample.distance;
        let light: [f64; 3] = std::array::from_fn(|c| {
            let intensity = sample.intensity[self.order[c]];
            match self.incident {
                Incident::Right => intensity / (r * r),
                Incident::Unit => 1.0 / (r * r),
                Incident::Softened(k) => intensity / (r * r + k),
                Incident::Clamp(most) => (intensity / (r * r)).min(most),
            }
        });
        let both = match &sample.reflector {
            Reflector::Witness(witness) => {
                let length = if self.wi_length == 0.0 { 1.0 } else { r.powf(self.wi_length) };
                let query = WitnessQuery {
                    wi: sample.wi.map(|v| (v * length) as f32),
                    wo: sample.wo.map(|v| v as f32),
                };
                let value = witness.value(&query).unwrap_or_default().map(f64::from);
                [
                    std::array::from_fn(|c| value[c] * self.powers(&self.diffuse, sample, c)),
                    [0.0; 3],
                ]
            }
            Reflector::Surface { phong, diffuse, specular, exponent, unscaled } => {
                let scale = match (phong, unscaled) {
                    (true, true) => self.scale_of(diffuse, specular),
                    _ => [1.0; 3],
                };
                let cos_i = match self.gate {
                    Gate::AbsoluteWi => sample.wi[2].abs(),
                    _ => sample.wi[2],
                };
                let lobe = if *phong { self.lobe_of(sample, *exponent) } else { 0.0 };
                let term = |term: &Term, color: &[f64; 3], lobe: f64, c: usize| {
                    let power =
                        |base: f64, extra: f64| if extra == 0.0 { 1.0 } else { base.powf(extra) };
                    if lobe == 0.0 {
                        return 0.0;
                    }
                    color[c]
                        * power(color[c], term.powers[Power::Reflectance as usize])
                        * scale[c]
                        * power(scale[c], term.powers[Power::Scale as usize])
                        * self.powers(term, sample, c)
                        * cos_i
                        * lobe
                };
                [
                    std::array::from_fn(|c| term(&self.diffuse, diffuse, 1.0 / PI, c)),
                    std::array::from_fn(|c| term(&self.specular, specular, lobe, c)),
                ]
            }
        };
        both.map(|term| std::array::from_fn(|c| term[self.reflected(sample, c)] * light[c]))
    }

    /// Under a witness the light's channels may be exchanged; of a BSDF its own.
    fn reflected(&self, sample: &Sample, c: usize) -> usize {
        match sample.reflector {
            Reflector::Surface { unscaled: true, .. } => self.order[c],
            _ => c,
        }
    }

    fn powers(&self, term: &Term, sample: &Sample, c: usize) -> f64 {
        let power = |base: f64, which: Power| match term.powers[which as usize] {
            0.0 => 1.0,
            extra => base.powf(extra),
        };
        power(sample.wi[2].abs(), Power::CosI)
            * power(sample.wo[2].abs(), Power::CosO)
            * power(sample.distance, Power::R)
            * term.factor[c]
    }

    /// The cosine that is raised to the exponent, clamped to 0.
    pub fn cos_lobe(&self, sample: &Sample) -> f64 {
        let (wi, wo) = (sample.wi, sample.wo);
        let mirrored = wi[2] * wo[2] - wi[0] * wo[0] - wi[1] * wo[1];
        let cos = match self.lobe {
            Lobe::Mirror => mirrored,
            Lobe::AbsoluteMirror => mirrored.abs(),
            Lobe::Half => {
                let half: [f64; 3] = std::array::from_fn(|c| wi[c] + wo[c]);
                half[2] / half.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-12)
            }
            Lobe::Unmirrored => wi.iter().zip(wo).map(|(a, b)| a * b).sum(),
            Lobe::Light => wi[2],
            Lobe::Viewer => wo[2],
        };
        cos.max(0.0)
    }

    fn lobe_of(&self, sample: &Sample, exponent: f64) -> f64 {
        let n = match self.exponent {
            ExponentForm::Whole => exponent,
            ExponentForm::Truncated => exponent.trunc(),
            ExponentForm::Rounded => exponent.round(),
            ExponentForm::Ceiled => exponent.ceil(),
        };
        let raised = self.times * n + self.plus;
        let normal = if self.follows { raised } else { n };
        (normal + self.normalization_plus) / (2.0 * PI) * self.cos_lobe(sample).powf(raised)
    }

    fn scale_of(&self, diffuse: &[f64; 3], specular: &[f64; 3]) -> [f64; 3] {
        let sums: [f64; 3] = std::array::from_fn(|c| diffuse[c] + specular[c]);
        let most = |v: &[f64; 3]| v.iter().copied().fold(0.0, f64::max);
        let of = |m: f64| if m > 1.0 { 0.99 / m } else { 1.0 };
        match self.scale {
            ScaleForm::Largest => [of(most(&sums)); 3],
            ScaleForm::Mean => [of(sums.iter().sum::<f64>() / 3.0); 3],
            ScaleForm::Channel => sums.map(of),
            ScaleForm::One => {
                [of(most(&sums)).min(1.0) / if most(&sums) > 1.0 { 0.99 } else { 1.0 }; 3]
            }
            ScaleForm::Always => [0.99 / most(&sums).max(1e-6); 3],
            ScaleForm::Sum => [of(sums.iter().sum()); 3],
            ScaleForm::Smallest => [of(sums.iter().copied().fold(f64::INFINITY, f64::min)); 3],
        }
    }
}
