//! The search for a formula: candidates with one deviation, then with two, each estimated in log
//! space from a part of the samples and verified on the rest.

use std::f64::consts::PI;

use super::deviation::{Deviation, Subject, deviations, pi_power};
use super::formula::{Formula, Gate, Power, Reflector, Sample, Term};
use super::linear::least_squares;

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
/// Least number of samples that a fit needs.
const LEAST: usize = 60;
/// The mean relative difference from what is right below which there is nothing to explain.
const NOTHING: f64 = 1e-5;
/// A term is fitted where it is at least this fraction of the value.
const SHARE: f64 = 0.1;
/// A term is alone where it is at least this fraction of the value.
const ALONE: f64 = 0.99999;

/// Which terms a change concerns.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Scope {
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
enum Intercept {
    None,
    Factor,
    Channels,
}

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
        for feature in self.features_of(scope) {
            all.extend(self.estimate(base, scope, &[feature], Intercept::None, share));
        }
        let factor = self.estimate(base, scope, &[], Intercept::Factor, share);
        let channels = self.estimate(base, scope, &[], Intercept::Channels, share);
        all.extend(factor.into_iter().chain(channels));
        if scope == Scope::Specular {
            all.extend(normalizations(base));
        }
        all
    }

    /// Formulas with two changes to a term.
    fn pairs(&self, base: &Formula, scope: Scope) -> Vec<Formula> {
        let mut all = Vec::new();
        let features: Vec<Feature> = self.features_of(scope).collect();
        let estimate = |base: &Formula, features: &[Feature], intercept| {
            self.estimate(base, scope, features, intercept, SHARE)
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

    fn features_of(&self, scope: Scope) -> impl Iterator<Item = Feature> {
        let own = move |feature: &Feature| match feature {
            Feature::ExponentTimes | Feature::ExponentPlus => scope == Scope::Specular,
            // Of both at once a power is no sum of logarithms.
            Feature::Power(Power::Reflectance) => scope != Scope::All || !self.phong,
            Feature::Power(_) => true,
        };
        self.features.iter().copied().filter(own)
    }

    /// A change to the terms of `scope`, estimated by least squares and snapped to what somebody
    /// may have written. Nothing when it is no such thing.
    fn estimate(
        &self,
        base: &Formula,
        scope: Scope,
        features: &[Feature],
        intercept: Intercept,
        share: f64,
    ) -> Option<Formula> {
        let mut rows: Vec<([f64; 5], f64, f64)> = Vec::new();
        let mut channels = Vec::new();
        for sample in &self.fitted {
            let [diffuse, specular] = base.terms(sample);
            for c in 0..3 {
                let (own, other) = match scope {
                    Scope::All => (diffuse[c] + specular[c], 0.0),
                    Scope::Diffuse => (diffuse[c], specular[c]),
                    Scope::Specular => (specular[c], diffuse[c]),
                };
                let rest = sample.found[c] - other;
                if own <= share * (own + other) || own <= 1e-2 * self.floor || rest <= 1e-4 * own {
                    continue;
                }
                let mut row = [0.0; 5];
                for (place, feature) in row.iter_mut().zip(features) {
                    *place = logarithm(*feature, base, sample, scope, c)?;
                }
                match intercept {
                    Intercept::None => {}
                    Intercept::Factor => row[features.len()] = 1.0,
                    Intercept::Channels => row[features.len() + c] = 1.0,
                }
                rows.push((row, (rest / own).ln(), own / (own + other)));
                channels.push(c);
            }
        }
        let used = features.len()
            + match intercept {
                Intercept::None => 0,
                Intercept::Factor => 1,
                Intercept::Channels => 3,
            };
        if rows.len() < LEAST {
            return None;
        }
        let estimated = least_squares(&rows, used)?;
        let mut formula = *base;
        let mut snapped = Vec::new();
        for (feature, estimate) in features.iter().zip(estimated) {
            let value = snap(*feature, estimate)?;
            snapped.push(value);
            apply(&mut formula, scope, *feature, value);
        }
        let rest = |(row, y, _): &([f64; 5], f64, f64)| {
            y - row.iter().zip(&snapped).map(|(a, x)| a * x).sum::<f64>()
        };
        let median = |wanted: &dyn Fn(usize) -> bool| {
            let own = rows.iter().zip(&channels).filter(|(_, c)| wanted(**c));
            median(own.map(|(row, _)| rest(row)).collect()).map(f64::exp)
        };
        let factor = match intercept {
            Intercept::None => [1.0; 3],
            Intercept::Factor => [self.snap_factor(median(&|_| true)?); 3],
            Intercept::Channels => {
                let of = |c: usize| median(&|own| own == c).map(|factor| self.snap_factor(factor));
                [of(0)?, of(1)?, of(2)?]
            }
        };
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 2.0 * self.accuracy.relative;
        let one = factor.iter().all(|&factor| near(factor, 1.0));
        let equal = near(factor[0], factor[1]) && near(factor[1], factor[2]);
        match intercept {
            Intercept::Factor if one => return None,
            Intercept::Channels if equal => return None,
            _ => {}
        }
        for term in terms(&mut formula, scope) {
            term.factor = std::array::from_fn(|c| term.factor[c] * factor[c]);
        }
        Some(formula)
    }

    /// A factor, exact where it is 1 or a power of pi.
    fn snap_factor(&self, factor: f64) -> f64 {
        if (factor - 1.0).abs() < self.accuracy.relative {
            return 1.0;
        }
        match pi_power(factor) {
            Some(power) => PI.powf(power),
            None => factor,
        }
    }
}

/// (n + k) / (2 pi) with other k.
fn normalizations(base: &Formula) -> impl Iterator<Item = Formula> {
    let base = *base;
    let others = [0.0, 1.0, 3.0, 4.0, 5.0, 6.0, 8.0, -1.0, -2.0];
    others.into_iter().map(move |normalization_plus| Formula { normalization_plus, ..base })
}

/// The energy scale that is yet to be applied.
fn scale(sample: &Sample) -> f64 {
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

/// Four digits: what was written rather than what was measured.
pub(super) fn round(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}
