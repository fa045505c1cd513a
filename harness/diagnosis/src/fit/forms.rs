//! Candidates of the search whose form differs from the right formula.

use super::deviation::ORDERS;
use super::estimate::{Feature, median};
use super::formula::{
    After, ExponentForm, Formula, Incident, Lobe, Power, Reflector, Sample, ScaleForm,
};
use super::search::{Search, difference, round};

impl Search<'_> {
    /// Formulas of another form, without a value to be estimated.
    pub(super) fn forms(&self) -> Vec<Formula> {
        let right = Formula::RIGHT;
        let mut all = Vec::new();
        all.extend(ORDERS.iter().map(|(order, _)| Formula { order: *order, ..right }));
        all.push(Formula { incident: Incident::Unit, ..right });
        let witness = |s: &&Sample| matches!(s.reflector, Reflector::Witness(_));
        if self.fitted.iter().any(witness) {
            let lengths = [1.0, -1.0, 2.0, -2.0];
            all.extend(lengths.map(|wi_length| Formula { wi_length, ..right }));
        }
        if self.phong {
            use {ExponentForm as E, Lobe as L, ScaleForm as S};
            let lobes = [L::AbsoluteMirror, L::Half, L::Unmirrored, L::Light, L::Viewer];
            all.extend(lobes.map(|lobe| Formula { lobe, ..right }));
            let forms = [E::Truncated, E::Rounded, E::Ceiled];
            all.extend(forms.map(|exponent| Formula { exponent, ..right }));
            let scales = [S::Mean, S::Channel, S::One, S::Always, S::Sum, S::Smallest];
            all.extend(scales.map(|scale| Formula { scale, ..right }));
            for (times, plus) in [
                (2.0, 0.0),
                (0.5, 0.0),
                (4.0, 0.0),
                (0.25, 0.0),
                (1.0, 1.0),
                (1.0, -1.0),
                (1.0, 2.0),
            ] {
                all.push(Formula { times, plus, follows: true, ..right });
            }
        }
        // A candidate that changes nothing here is no rival.
        all.retain(|formula| {
            let differs = |sample: &&Sample| {
                let (a, b) = (formula.value(sample), right.value(sample));
                a.iter()
                    .zip(b)
                    .any(|(a, b)| 2.0 * difference(*a, b, self.floor) > self.accuracy.relative)
            };
            self.fitted.iter().any(differs)
        });
        all
    }

    /// Formulas of another form with a value that is estimated.
    pub(super) fn estimated_forms(&self) -> Vec<Formula> {
        let right = Formula::RIGHT;
        let mut all = Vec::new();
        let mut apart: [Vec<f64>; 3] = Default::default();
        let (mut powers, mut incidents, mut softened) = (Vec::new(), Vec::new(), Vec::new());
        let mut most = 0.0f64;
        for sample in &self.fitted {
            let value = right.value(sample);
            let unlit = Sample { intensity: [1.0; 3], distance: 1.0, ..**sample };
            let unlit = right.value(&unlit);
            for c in 0..3 {
                apart[c].push(sample.found[c] - value[c]);
                most = most.max(sample.found[c]);
                if value[c] > self.floor && sample.found[c] > 0.0 && value[c].ln().abs() > 0.1 {
                    powers.push(sample.found[c].ln() / value[c].ln());
                }
                if unlit[c] > 1e-4 {
                    let incident = sample.found[c] / unlit[c];
                    incidents.push(incident);
                    softened
                        .push(sample.intensity[c] / incident - sample.distance * sample.distance);
                }
            }
        }
        let offsets = apart.map(|apart| median(apart).unwrap_or(0.0));
        let spread = offsets.iter().map(|o| (o - offsets[0]).abs()).fold(0.0, f64::max);
        let offset = if spread < 0.01 * offsets[0].abs() { [offsets[0]; 3] } else { offsets };
        let after = |after| Formula { after, ..right };
        all.push(after(After::Offset(offset)));
        all.push(after(After::Clamp(most)));
        let named = [1.0 / 2.2, 2.2, 0.5, 2.0, 1.0 / 2.4, 2.4];
        let power = median(powers).unwrap_or(1.0);
        let power = named.into_iter().find(|named| (power / named - 1.0).abs() < 5e-3);
        all.extend(power.map(|power| after(After::Power(power))));
        let varies = self.features.contains(&Feature::Power(Power::R));
        if varies {
            let most = incidents.iter().copied().fold(0.0, f64::max);
            all.push(Formula { incident: Incident::Clamp(round(most)), ..right });
            all.extend(
                median(softened)
                    .filter(|k| *k > 1e-3)
                    .map(|k| Formula { incident: Incident::Softened(round(k)), ..right }),
            );
        }
        all
    }
}
