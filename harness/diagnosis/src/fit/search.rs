//! The search for a formula: candidates with one deviation, then with two, each estimated in log
//! space from a part of the samples and verified on the rest.

use super::deviation::{Deviation, Subject, deviations};
use super::estimate::{Answers, Change, Feature, Intercept, LEAST, Scope, scale};
use super::formula::{Formula, Gate, Power, Reflector, Sample};

/// How well answers to a question are known.
#[derive(Clone, Copy, Debug)]
pub struct Accuracy {
    /// The largest relative difference of an answer that a formula explains.
    pub relative: f64,
    /// Fraction of the answers that may differ more.
    pub stray: f64,
}

/// A formula that explains the answers.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// How it differs from the right one.
    pub deviations: Vec<Deviation>,
    /// The fraction of the difference from what is right that it leaves.
    pub unexplained: f64,
}

/// A formula is reported only if it leaves less than this fraction of the difference unexplained.
const UNEXPLAINED: f64 = 0.01;
/// Number of samples that are fitted to; all others verify.
const FITTED: usize = 300;
/// Number of the others that are looked at first.
const GLANCE: usize = 60;
/// The mean relative difference from what is right below which there is nothing to explain.
const NOTHING: f64 = 1e-5;
/// A term is fitted where it is at least this fraction of the value.
const SHARE: f64 = 0.1;
/// A term is alone where it is at least this fraction of the value.
const ALONE: f64 = 0.99999;

pub(super) struct Search<'a> {
    pub(super) fitted: Vec<&'a Sample>,
    pub(super) verifying: Vec<&'a Sample>,
    pub(super) accuracy: Accuracy,
    pub(super) phong: bool,
    pub(super) floor: f64,
    /// The difference from what is right of those that verify, added up.
    pub(super) from_right: f64,
    pub(super) features: Vec<Feature>,
    pub(super) gates: Vec<Gate>,
}

/// The formula that explains the answers, if one does and no other that is as simple.
pub fn explain(samples: &[Sample], subject: Subject, accuracy: Accuracy) -> Option<Fitted> {
    let search = Search::new(samples, accuracy)?;
    for level in [Search::singles, Search::doubles] {
        let mut found: Vec<Fitted> = Vec::new();
        let mut known: Vec<Formula> = Vec::new();
        for formula in level(&search) {
            if known.contains(&formula) {
                continue;
            }
            known.push(formula);
            let Some((formula, unexplained)) = search.verify(formula) else { continue };
            let deviations = deviations(&formula, subject, search.phong);
            let same = |other: &Fitted| other.deviations == deviations;
            if !deviations.is_empty() && !found.iter().any(same) {
                found.push(Fitted { deviations, unexplained });
            }
        }
        let fewest = found.iter().map(|fitted| fitted.deviations.len()).min();
        found.retain(|fitted| Some(fitted.deviations.len()) == fewest);
        if found.len() > 1 {
            return None;
        }
        if let Some(fitted) = found.pop() {
            return Some(fitted);
        }
    }
    None
}

/// The relative difference of two values, from 0 to 1.
pub(super) fn difference(a: f64, b: f64, floor: f64) -> f64 {
    (a - b).abs() / (a.abs() + b.abs() + floor)
}

impl<'a> Search<'a> {
    fn new(samples: &'a [Sample], accuracy: Accuracy) -> Option<Self> {
        let finite = |sample: &&Sample| sample.found.iter().all(|v| v.is_finite());
        let kept: Vec<&Sample> = samples.iter().filter(finite).collect();
        let lost = samples.len() - kept.len();
        if kept.len() < 2 * LEAST || lost as f64 > accuracy.stray * samples.len() as f64 {
            return None;
        }
        let above = |sample: &&&Sample| sample.wi[2] > 0.0 && sample.wo[2] > 0.0;
        let lit = kept.iter().filter(above).count();
        if kept.iter().filter(above).all(|sample| sample.found == [0.0; 3]) {
            return None;
        }
        // An odd stride: probes come in regular order.
        let stride = (lit.div_ceil(FITTED)).max(2) | 1;
        let (mut fitted, mut verifying, mut index) = (Vec::new(), Vec::new(), 0);
        for sample in &kept {
            let is_lit = above(&sample);
            index += usize::from(is_lit);
            let list =
                if is_lit && index.is_multiple_of(stride) { &mut fitted } else { &mut verifying };
            list.push(*sample);
        }
        let right = |sample: &&Sample| Formula::RIGHT.value(sample).iter().sum::<f64>() / 3.0;
        let mean = kept.iter().map(right).sum::<f64>() / lit.max(1) as f64;
        let phong = kept.iter().any(|sample| match sample.reflector {
            Reflector::Surface { phong, .. } => phong,
            Reflector::Witness(_) => false,
        });
        let mut search = Self {
            fitted,
            verifying,
            accuracy,
            phong,
            floor: 1e-3 * mean,
            from_right: 0.0,
            features: Vec::new(),
            gates: Vec::new(),
        };
        search.from_right = search.left(&Formula::RIGHT, &search.verifying).0;
        if search.from_right < NOTHING * (3 * search.verifying.len()) as f64 {
            return None;
        }
        search.features = search.features();
        search.gates = search.gates();
        Some(search)
    }

    /// The powers that the samples tell of.
    fn features(&self) -> Vec<Feature> {
        let varies = |of: &dyn Fn(&Sample) -> f64| {
            let values = self.fitted.iter().map(|sample| of(sample));
            let (low, high) =
                values.fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(v), high.max(v)));
            high > 1.1 * low
        };
        let surface = self.fitted.iter().any(|s| matches!(s.reflector, Reflector::Surface { .. }));
        let mut features = vec![Feature::Power(Power::CosI), Feature::Power(Power::CosO)];
        if varies(&|sample| sample.distance) {
            features.push(Feature::Power(Power::R));
        }
        if surface {
            features.push(Feature::Power(Power::Reflectance));
        }
        if varies(&|sample| scale(sample)) {
            features.push(Feature::Power(Power::Scale));
        }
        if self.phong {
            features.extend([Feature::ExponentTimes, Feature::ExponentPlus]);
        }
        features
    }

    /// What may be answered below the surface.
    fn gates(&self) -> Vec<Gate> {
        let shines = |wanted: &dyn Fn(&Sample) -> bool| {
            self.verifying.iter().any(|s| wanted(s) && s.found != [0.0; 3])
        };
        let below_i = shines(&|s| s.wi[2] <= 0.0 && s.wo[2] > 0.0);
        let below_o = shines(&|s| s.wi[2] > 0.0 && s.wo[2] <= 0.0);
        match (below_i, below_o) {
            (false, false) => vec![Gate::Both],
            (true, false) => vec![Gate::NoWi, Gate::AbsoluteWi],
            (false, true) => vec![Gate::NoWo],
            (true, true) => vec![Gate::Neither],
        }
    }

    /// The difference of the answers from a formula's, and the fraction that differs too much.
    fn left(&self, formula: &Formula, samples: &[&Sample]) -> (f64, f64) {
        let (mut sum, mut stray) = (0.0, 0usize);
        for sample in samples {
            let value = formula.value(sample);
            let mut most = 0.0f64;
            for (found, value) in sample.found.iter().zip(value) {
                let apart = 2.0 * difference(*found, value, self.floor);
                sum += (apart - self.accuracy.relative / 2.0).max(0.0);
                // NaN is never right.
                most = most.max(if apart.is_finite() { apart } else { 1.0 });
            }
            stray += usize::from(most > self.accuracy.relative);
        }
        (sum, stray as f64 / samples.len().max(1) as f64)
    }

    /// Whether a formula explains the answers that it was not fitted to, under the tests of
    /// directions that fit, and what it leaves.
    fn verify(&self, formula: Formula) -> Option<(Formula, f64)> {
        let stride = (self.verifying.len() / GLANCE).max(1);
        let few: Vec<&Sample> = self.fitted.iter().step_by(5).copied().take(GLANCE).collect();
        if self.left(&formula, &few).1 > 0.1 {
            return None;
        }
        let others: Vec<&Sample> = self.verifying.iter().step_by(stride).copied().collect();
        self.gates.iter().find_map(|&gate| {
            let formula = Formula { gate, ..formula };
            if self.left(&formula, &others).1 > 0.1 {
                return None;
            }
            let (left, stray) = self.left(&formula, &self.verifying);
            let unexplained = left / self.from_right;
            (stray <= self.accuracy.stray && unexplained < UNEXPLAINED)
                .then_some((formula, unexplained))
        })
    }

    fn scopes(&self) -> &'static [Scope] {
        if self.phong { &[Scope::All, Scope::Diffuse, Scope::Specular] } else { &[Scope::All] }
    }

    /// Formulas with one deviation.
    fn singles(&self) -> Vec<Formula> {
        let mut all = vec![Formula::RIGHT];
        for &scope in self.scopes() {
            all.extend(self.changes(&Formula::RIGHT, scope));
        }
        all.extend(self.forms());
        all.extend(self.estimated_forms());
        all
    }

    /// Formulas with two.
    fn doubles(&self) -> Vec<Formula> {
        let mut all = Vec::new();
        for &scope in self.scopes() {
            all.extend(self.pairs(&Formula::RIGHT, scope));
        }
        for form in self.forms() {
            for &scope in self.scopes() {
                all.extend(self.changes(&form, scope));
            }
        }
        if self.phong {
            // One in each term: the diffuse one shows where there is no highlight.
            for diffuse in self.changes_where(&Formula::RIGHT, Scope::Diffuse, ALONE) {
                if !self.explains_diffuse(&diffuse) {
                    continue;
                }
                all.extend(self.changes(&diffuse, Scope::Specular));
                let specular = |form: Formula| Formula { diffuse: diffuse.diffuse, ..form };
                all.extend(self.forms().into_iter().map(specular));
            }
        }
        all
    }

    /// Whether a formula explains what is shaded by the diffuse term alone.
    fn explains_diffuse(&self, formula: &Formula) -> bool {
        let alone = |sample: &&&Sample| {
            let [diffuse, specular] = Formula::RIGHT.terms(sample);
            sample.wi[2] > 0.0
                && sample.wo[2] > 0.0
                && (0..3).all(|c| specular[c] <= (1.0 - ALONE) * diffuse[c])
        };
        let own: Vec<&Sample> = self.fitted.iter().filter(alone).copied().collect();
        own.len() >= 10 && self.left(formula, &own).1 < 0.05
    }

    /// Formulas with one change to a term beside those of `base`.
    fn changes(&self, base: &Formula, scope: Scope) -> Vec<Formula> {
        self.changes_where(base, scope, SHARE)
    }

    fn changes_where(&self, base: &Formula, scope: Scope, share: f64) -> Vec<Formula> {
        let mut all = Vec::new();
        let answers = self.answers();
        let estimate = |features: &[Feature], intercept| {
            Change { scope, features, intercept, share }.estimate(base, &answers)
        };
        for feature in self.features_of(scope) {
            all.extend(estimate(&[feature], Intercept::None));
        }
        all.extend(estimate(&[], Intercept::Factor));
        all.extend(estimate(&[], Intercept::Channels));
        if scope == Scope::Specular {
            all.extend(normalizations(base));
        }
        all
    }

    /// Formulas with two changes to a term.
    fn pairs(&self, base: &Formula, scope: Scope) -> Vec<Formula> {
        let mut all = Vec::new();
        let features: Vec<Feature> = self.features_of(scope).collect();
        let answers = self.answers();
        let estimate = |base: &Formula, features: &[Feature], intercept| {
            Change { scope, features, intercept, share: SHARE }.estimate(base, &answers)
        };
        for (i, &first) in features.iter().enumerate() {
            for &second in &features[i + 1..] {
                all.extend(estimate(base, &[first, second], Intercept::None));
            }
            all.extend(estimate(base, &[first], Intercept::Factor));
            all.extend(estimate(base, &[first], Intercept::Channels));
        }
        if scope == Scope::Specular {
            for base in normalizations(base) {
                for &feature in &features {
                    all.extend(estimate(&base, &[feature], Intercept::None));
                }
                all.extend(estimate(&base, &[], Intercept::Factor));
            }
        }
        all
    }

    /// What is fitted to.
    fn answers(&self) -> Answers<'_> {
        Answers { samples: &self.fitted, floor: self.floor, relative: self.accuracy.relative }
    }

    fn features_of(&self, scope: Scope) -> impl Iterator<Item = Feature> {
        let own = move |feature: &Feature| match feature {
            Feature::ExponentTimes | Feature::ExponentPlus => scope == Scope::Specular,
            // Of both at once a power is no sum of logarithms.
            Feature::Power(Power::Reflectance) => scope != Scope::All || !self.phong,
            Feature::Power(_) => true,
        };
        self.features.iter().copied().filter(own)
    }
}

/// (n + k) / (2 pi) with other k.
fn normalizations(base: &Formula) -> impl Iterator<Item = Formula> {
    let base = *base;
    let others = [0.0, 1.0, 3.0, 4.0, 5.0, 6.0, 8.0, -1.0, -2.0];
    others.into_iter().map(move |normalization_plus| Formula { normalization_plus, ..base })
}

/// Four digits: what was written rather than what was measured.
pub(super) fn round(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}
