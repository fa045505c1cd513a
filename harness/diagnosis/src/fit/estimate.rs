//! Changes to a formula, estimated in log space from answers.

use std::f64::consts::PI;

use super::deviation::pi_power;
use super::formula::{Formula, Power, Reflector, Sample, Term};
use super::linear::least_squares;

/// Least number of samples that a fit needs.
pub(super) const LEAST: usize = 60;

/// Which terms a change concerns.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Scope {
    All,
    Diffuse,
    Specular,
}

/// What is estimated.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Feature {
    Power(Power),
    ExponentTimes,
    ExponentPlus,
}

/// Further quantities that are estimated.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Intercept {
    None,
    Factor,
    Channels,
}

/// The answers that a change is estimated from.
pub(super) struct Answers<'a> {
    pub samples: &'a [&'a Sample],
    /// Values far below are not known well enough.
    pub floor: f64,
    /// The largest relative difference of an answer that a formula explains.
    pub relative: f64,
}

/// A change to the terms of `scope`, whose values are to be estimated.
pub(super) struct Change<'a> {
    pub scope: Scope,
    pub features: &'a [Feature],
    pub intercept: Intercept,
    /// The terms are fitted where they are at least this fraction of the value.
    pub share: f64,
}

/// An equation for each usable channel of an answer.
#[derive(Default)]
struct Equations {
    /// Coefficients, the logarithm of what is found over what is right, and the weight.
    rows: Vec<([f64; 5], f64, f64)>,
    channels: Vec<usize>,
}

impl Change<'_> {
    /// A formula with this change, estimated by least squares and snapped to what somebody
    /// may have written. Nothing when it is no such thing.
    pub fn estimate(&self, base: &Formula, answers: &Answers) -> Option<Formula> {
        let equations = self.equations(base, answers)?;
        if equations.rows.len() < LEAST {
            return None;
        }
        let used = self.features.len()
            + match self.intercept {
                Intercept::None => 0,
                Intercept::Factor => 1,
                Intercept::Channels => 3,
            };
        let estimated = least_squares(&equations.rows, used)?;
        let mut formula = *base;
        let mut snapped = Vec::new();
        for (feature, estimate) in self.features.iter().zip(estimated) {
            let value = snap(*feature, estimate)?;
            snapped.push(value);
            apply(&mut formula, self.scope, *feature, value);
        }
        let factor = self.factor(&equations, &snapped, answers.relative)?;
        for term in terms(&mut formula, self.scope) {
            term.factor = std::array::from_fn(|c| term.factor[c] * factor[c]);
        }
        Some(formula)
    }

    fn equations(&self, base: &Formula, answers: &Answers) -> Option<Equations> {
        let mut equations = Equations::default();
        for sample in answers.samples {
            let [diffuse, specular] = base.terms(sample);
            for c in 0..3 {
                let (own, other) = match self.scope {
                    Scope::All => (diffuse[c] + specular[c], 0.0),
                    Scope::Diffuse => (diffuse[c], specular[c]),
                    Scope::Specular => (specular[c], diffuse[c]),
                };
                let rest = sample.found[c] - other;
                let minor = own <= self.share * (own + other);
                if minor || own <= 1e-2 * answers.floor || rest <= 1e-4 * own {
                    continue;
                }
                let mut row = [0.0; 5];
                for (place, feature) in row.iter_mut().zip(self.features) {
                    *place = logarithm(*feature, base, sample, self.scope, c)?;
                }
                match self.intercept {
                    Intercept::None => {}
                    Intercept::Factor => row[self.features.len()] = 1.0,
                    Intercept::Channels => row[self.features.len() + c] = 1.0,
                }
                equations.rows.push((row, (rest / own).ln(), own / (own + other)));
                equations.channels.push(c);
            }
        }
        Some(equations)
    }

    /// The factor of each channel that is left when the features have these values. Nothing when another
    /// intercept says the same.
    fn factor(&self, equations: &Equations, snapped: &[f64], relative: f64) -> Option<[f64; 3]> {
        let of = |wanted: &dyn Fn(usize) -> bool| {
            let factor = median(equations.rest(snapped, wanted)).map(f64::exp);
            factor.map(|factor| snap_factor(factor, relative))
        };
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 2.0 * relative;
        match self.intercept {
            Intercept::None => Some([1.0; 3]),
            Intercept::Factor => {
                let factor = of(&|_| true)?;
                (!near(factor, 1.0)).then_some([factor; 3])
            }
            Intercept::Channels => {
                let [r, g, b] = [0, 1, 2].map(|channel| of(&|own| own == channel));
                let (r, g, b) = (r?, g?, b?);
                (!(near(r, g) && near(g, b))).then_some([r, g, b])
            }
        }
    }
}

impl Equations {
    /// What the features leave in some channels.
    fn rest(&self, values: &[f64], wanted: &dyn Fn(usize) -> bool) -> Vec<f64> {
        let own = self.rows.iter().zip(&self.channels).filter(|(_, channel)| wanted(**channel));
        own.map(|((row, y, _), _)| y - row.iter().zip(values).map(|(a, x)| a * x).sum::<f64>())
            .collect()
    }
}

/// A factor, exact where it is 1 or a power of pi.
fn snap_factor(factor: f64, relative: f64) -> f64 {
    if (factor - 1.0).abs() < relative {
        return 1.0;
    }
    match pi_power(factor) {
        Some(power) => PI.powf(power),
        None => factor,
    }
}

/// The energy scale that is yet to be applied.
pub(super) fn scale(sample: &Sample) -> f64 {
    match &sample.reflector {
        Reflector::Surface { phong: true, diffuse, specular, unscaled: true, .. } => {
            let most = (0..3).map(|c| diffuse[c] + specular[c]).fold(0.0, f64::max);
            if most > 1.0 { 0.99 / most } else { 1.0 }
        }
        _ => 1.0,
    }
}

/// The logarithm whose multiple a feature adds; nothing where it is none.
fn logarithm(
    feature: Feature,
    base: &Formula,
    sample: &Sample,
    scope: Scope,
    c: usize,
) -> Option<f64> {
    let value = match (feature, &sample.reflector) {
        (Feature::Power(Power::CosI), _) => sample.wi[2],
        (Feature::Power(Power::CosO), _) => sample.wo[2],
        (Feature::Power(Power::R), _) => sample.distance,
        (Feature::Power(Power::Scale), _) => scale(sample),
        (Feature::Power(Power::Reflectance), Reflector::Surface { diffuse, specular, .. }) => {
            if scope == Scope::Specular {
                specular[c]
            } else {
                diffuse[c]
            }
        }
        (Feature::ExponentTimes, Reflector::Surface { exponent, .. }) => {
            return Some(exponent * base.cos_lobe(sample).max(1e-30).ln());
        }
        (Feature::ExponentPlus, Reflector::Surface { .. }) => base.cos_lobe(sample),
        (_, Reflector::Witness(_)) => return None,
    };
    (value > 0.0).then(|| value.ln())
}

/// The value that somebody may have written, as what it adds to the right one.
fn snap(feature: Feature, estimate: f64) -> Option<f64> {
    let (allowed, margin): (&[f64], f64) = match feature {
        Feature::Power(Power::Reflectance) => {
            (&[-1.0, -0.5, 1.0, 1.2, 2.0, 1.0 / 2.2 - 1.0, 1.4], 0.02)
        }
        Feature::Power(_) => {
            (&[-4.0, -3.0, -2.0, -1.5, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0], 0.05)
        }
        Feature::ExponentTimes => {
            (&[-0.75, -2.0 / 3.0, -0.5, -0.25, 0.25, 0.5, 1.0, 2.0, 3.0, 7.0], 0.01)
        }
        Feature::ExponentPlus => (&[-2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0], 0.05),
    };
    let near = allowed.iter().copied().find(|value| (value - estimate).abs() < margin)?;
    Some(near)
}

fn apply(formula: &mut Formula, scope: Scope, feature: Feature, value: f64) {
    match feature {
        Feature::Power(power) => {
            for term in terms(formula, scope) {
                term.powers[power as usize] += value;
            }
        }
        Feature::ExponentTimes => formula.times += value,
        Feature::ExponentPlus => formula.plus += value,
    }
}

fn terms(formula: &mut Formula, scope: Scope) -> Vec<&mut Term> {
    match scope {
        Scope::All => vec![&mut formula.diffuse, &mut formula.specular],
        Scope::Diffuse => vec![&mut formula.diffuse],
        Scope::Specular => vec![&mut formula.specular],
    }
}

/// The middle of some values.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
