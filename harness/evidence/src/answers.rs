//! Answers of a renderer beside those of known single mistakes: which mistake explains them, and how well.

mod factors;
mod two_slips;

use std::collections::BTreeMap;

use super::price::{LIKE, Price, PriceClass, UNKNOWN};
use super::shading::Shading;
use factors::Factors;
use imaging::correlation::Moments;
use two_slips::{LEFT_BY_TWO, Slips, TWO_SLIPS};

/// Number of questions that tell most mistakes apart.
const FEW: usize = 200;

/// Some questions, spread over all.
pub(super) fn few_of(questions: &[usize]) -> Vec<usize> {
    questions.iter().copied().step_by(questions.len().div_ceil(FEW).max(1)).collect()
}

/// At most this many questions are looked at: a price is no finer than a percent.
const QUESTIONS: usize = 4000;
/// Answers whose variance is below this part of their mean square are flat: nothing can follow them.
const FLAT: f64 = 0.01;

/// What a few questions may leave unexplained when all leave `left`: chance makes it more, but hardly twice as much.
pub(super) fn surely_more_than(left: f64) -> f64 {
    2.0 * left + 0.05
}

/// Whether values (a) follow those of a mistake (b), so that the mistake may explain them. If the mistake's own values
/// hardly vary, any constant is about right, so they follow.
pub(super) fn follows(pairs: &Moments) -> bool {
    let [_, varies, _] = pairs.about_means();
    pairs.correlation() >= LIKE || varies < FLAT * pairs.square_of_b()
}

/// The part of a group's answers that is left unexplained.
fn left((apart, total): &(f64, f64)) -> f64 {
    apart / total.max(f64::MIN_POSITIVE)
}

/// Answers to be compared with the right ones.
pub struct Answers<'a> {
    /// What was answered.
    pub found: &'a [[f32; 3]],
    /// The answer of a renderer that shades so, to a question.
    pub of: &'a dyn Fn(usize, &Shading) -> [f64; 3],
    /// The scale of a question's differences: its material's peak, or 1.
    pub unit: &'a dyn Fn(usize) -> f64,
    /// The group that a question belongs to, such as its material: the worst group counts.
    pub group: &'a dyn Fn(usize) -> usize,
    /// The largest relative difference that is none.
    pub relative: f64,
    /// The changes that are looked for.
    pub changes: &'a [Change],
}

/// One thing changed, and what it is worth.
#[derive(Clone, Copy, Debug)]
pub struct Change {
    /// What the mistake is, for reports.
    pub name: &'static str,
    /// Its class.
    pub class: PriceClass,
    /// The changed shading; `None` where a factor is fitted.
    pub(super) shading: Option<Shading>,
    /// Which factor is fitted.
    pub(super) fitted: Option<Fitted>,
}

impl Change {
    /// A slip that makes a renderer shade so.
    pub(super) fn slip(name: &'static str, shading: Shading) -> Self {
        Self { name, class: PriceClass::Slip, shading: Some(shading), fitted: None }
    }
}

/// A factor that is taken from the answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fitted {
    /// One of all values.
    All,
    /// One of each channel.
    Channels,
    /// One of each group of questions: a wrong scale of the material's.
    Groups,
    /// One of each group and channel: a wrong color of the material's.
    Colors,
    /// One of the diffuse term.
    Diffuse,
    /// One of the specular term.
    Specular,
    /// What is added, over the diffuse reflectance.
    Ambient,
}

impl Answers<'_> {
    /// The price of the answers; `raw` is how far off they are, if the caller knows that better.
    pub fn price(&self, raw: Option<f64>) -> Price {
        let questions = self.questions();
        let right = Shading::default();
        let price = Price::of_raw(
            raw.unwrap_or_else(|| self.residual(&questions, &right, &Factors::default())),
        );
        // Black answers hold nothing that a mistake could explain.
        if self.found.iter().all(|value| *value == [0.0; 3]) {
            return price;
        }
        let price = match self.pairs(&questions, &right, &Factors::default()).correlation() >= LIKE
        {
            true => price.or(UNKNOWN, PriceClass::Unknown, 0.0),
            false => price,
        };
        let few = few_of(&questions);
        let price = self.likeliest_first(&few).into_iter().fold(price, |price, (left, change)| {
            if price.is_least() || left > surely_more_than(price.error - change.class.price()) {
                return price;
            }
            let Some((shading, factors, class)) = self.changed(change, &questions) else {
                return price;
            };
            let residual = self.residual(&questions, &shading, &factors);
            let better = price.or(change.name, class, residual);
            // Few are better, so that few need be compared once more.
            match better != price && self.follow(&questions, &shading, &factors) {
                true => better,
                false => price,
            }
        });
        if price.error <= TWO_SLIPS {
            return price;
        }
        // A concept that explains them is one, also where it is far from the right answers by little: without falloff
        // is no r in place of r^2, made twice.
        let is_concept = self.changes.iter().any(|change| {
            let left = price.error - PriceClass::Concept.price();
            let is_named = price.mistake == Some(change.name)
                && left <= LEFT_BY_TWO
                && (change.class == PriceClass::Concept
                    || (change.fitted.is_some() && left >= 0.0));
            let explains = |shading: Shading| {
                let factors = Factors::default();
                self.left_of(&few, &shading, &factors) <= surely_more_than(LEFT_BY_TWO)
                    && self.residual(&questions, &shading, &factors) <= LEFT_BY_TWO
            };
            is_named
                || (change.class == PriceClass::Concept && change.shading.is_some_and(explains))
        });
        match !is_concept && Slips::of(self, &few).two_explain(&questions) {
            true => Price { error: TWO_SLIPS, mistake: Some("two slips"), ..price },
            false => price,
        }
    }

    /// The changes, each with what it leaves unexplained of a few questions. Those come first that would cost least: a
    /// mistake that is found early spares the comparison with others.
    fn likeliest_first(&self, few: &[usize]) -> Vec<(f64, &Change)> {
        let left = |change: &Change| match self.changed(change, few) {
            Some((shading, factors, _)) => self.left_of(few, &shading, &factors),
            // More questions may tell its factor.
            None => 0.0,
        };
        let mut changes: Vec<_> =
            self.changes.iter().map(|change| (left(change), change)).collect();
        let cost = |(left, change): &(f64, &Change)| change.class.price() + left;
        changes.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        changes
    }

    /// A change as a shading, with the factors that the questions tell.
    fn changed(
        &self,
        change: &Change,
        questions: &[usize],
    ) -> Option<(Shading, Factors, PriceClass)> {
        match (change.shading, change.fitted) {
            (Some(shading), _) => Some((shading, Factors::default(), change.class)),
            (None, Some(fitted)) => self.fit(questions, fitted),
            (None, None) => None,
        }
    }

    /// Whether the answers follow those of a changed renderer.
    fn follow(&self, questions: &[usize], changed: &Shading, factors: &Factors) -> bool {
        follows(&self.pairs(questions, changed, factors))
    }

    /// Sum of differences from what is right over the sum of that, in the worst group.
    pub fn residual_of_right(&self) -> f64 {
        self.residual(&self.questions(), &Shading::default(), &Factors::default())
    }

    /// Whether a few questions tell that more than `most` is left unexplained.
    pub(super) fn surely_leave_more(&self, most: f64) -> bool {
        let few = few_of(&self.questions());
        self.left_of(&few, &Shading::default(), &Factors::default()) > surely_more_than(most)
    }

    /// Sum of the right answers, in units.
    pub fn total(&self) -> f64 {
        let right = Shading::default();
        let sizes = self.questions().into_iter().map(|index| {
            let sum: f64 = (self.of)(index, &right).iter().filter(|v| v.is_finite()).sum();
            sum / (3.0 * (self.unit)(index))
        });
        sizes.sum()
    }

    /// The questions that are looked at.
    fn questions(&self) -> Vec<usize> {
        let step = self.found.len().div_ceil(QUESTIONS).max(1);
        (0..self.found.len()).step_by(step).collect()
    }

    /// The answers beside those of `shading`, of every channel, in units. Where neither is finite, they agree, and
    /// nothing is to be compared.
    fn pairs(&self, questions: &[usize], shading: &Shading, factors: &Factors) -> Moments {
        Moments::of(questions.iter().flat_map(|&index| {
            let (expected, unit) = ((self.of)(index, shading), (self.unit)(index));
            let (found, factors) = (self.found[index], self.factors(factors, index));
            let pair = move |c: usize| (f64::from(found[c]), factors[c] * expected[c]);
            let told = |(a, b): &(f64, f64)| a.is_finite() || b.is_finite();
            (0..3).map(pair).filter(told).map(move |(a, b)| (a / unit, b / unit))
        }))
    }

    /// What a question's answer is multiplied by.
    fn factors(&self, factors: &Factors, index: usize) -> [f64; 3] {
        *factors.by_group.get(&(self.group)(index)).unwrap_or(&factors.all)
    }

    fn times_factors(&self, answer: [f64; 3], factors: &Factors, index: usize) -> [f64; 3] {
        let factors = self.factors(factors, index);
        std::array::from_fn(|c| factors[c] * answer[c])
    }

    /// Sum of differences from what `shading` answers over the sum of that, in the worst group.
    fn residual(&self, questions: &[usize], shading: &Shading, factors: &Factors) -> f64 {
        self.residual_of(questions, &|index| {
            self.times_factors((self.of)(index, shading), factors, index)
        })
    }

    /// The same for any answers.
    fn residual_of(&self, questions: &[usize], of: &dyn Fn(usize) -> [f64; 3]) -> f64 {
        let errors = self.differences(questions, of).into_values().map(|group| left(&group));
        errors.fold(0.0, f64::max)
    }

    /// Sum of differences from what `shading` answers over the sum of that, all groups together: no more than in the
    /// worst.
    fn left_of(&self, questions: &[usize], shading: &Shading, factors: &Factors) -> f64 {
        let changed = |index| self.times_factors((self.of)(index, shading), factors, index);
        let groups = self.differences(questions, &changed).into_values();
        left(&groups.fold((0.0, 0.0), |all, group| (all.0 + group.0, all.1 + group.1)))
    }

    /// For each group, the sum of differences from other answers and the sum of those.
    fn differences(
        &self,
        questions: &[usize],
        of: &dyn Fn(usize) -> [f64; 3],
    ) -> BTreeMap<usize, (f64, f64)> {
        let mut groups: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
        for &index in questions {
            let unit = (self.unit)(index);
            let changed = of(index);
            let group = (self.group)(index);
            let (apart, total) = groups.entry(group).or_default();
            for (c, b) in changed.into_iter().enumerate() {
                let a = f64::from(self.found[index][c]);
                let difference = match (a.is_finite(), b.is_finite()) {
                    (true, true) => (a - b).abs(),
                    (false, false) => 0.0,
                    // NaN is as far off as possible.
                    _ if b.is_finite() => unit.max(b.abs()),
                    _ => unit,
                };
                let room = self.relative * b.abs() + 1e-6 * unit;
                *apart += if difference <= room { 0.0 } else { difference / unit };
                *total += if b.is_finite() { b.abs() / unit } else { 1.0 };
            }
        }
        groups
    }

    /// The questions of each group.
    fn by_group(&self, questions: &[usize]) -> BTreeMap<usize, Vec<usize>> {
        let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for &index in questions {
            groups.entry((self.group)(index)).or_default().push(index);
        }
        groups
    }
}

#[cfg(test)]
mod tests {
    use super::super::changes::shader_changes;
    use super::super::shading::{ShadedPoint, Tests};
    use super::*;

    #[test]
    fn two_slips_lose_what_both_lose() {
        let right = Shading::default();
        let point = |index: usize| {
            let z = 0.05 + 0.9 * (index as f64 * 0.37).fract();
            let x = (1.0 - z * z).sqrt();
            let material = renderer_api::MaterialValue {
                model: renderer_api::MATERIAL_PHONG,
                diffuse: [0.5, 0.25, 0.1],
                specular: [0.2, 0.3, 0.4],
                exponent: 4.0,
            };
            let wi = [x, 0.0, if index.is_multiple_of(5) { -z } else { z }];
            let wo = [-0.6, 0.0, 0.8];
            let distance = 1.0 + index as f64 / 50.0;
            ShadedPoint { material, scale: 1.0, wo, wi, intensity: [1.0, 2.0, 4.0], distance }
        };
        let of = |index: usize, shading: &Shading| shading.radiance(&point(index));
        let changes = shader_changes(true);
        let price = |made: &Shading, factor: f64| {
            let shown = |index| of(index, made).map(|value| (factor * value) as f32);
            let found: Vec<[f32; 3]> = (0..200).map(shown).collect();
            let (unit, group) = (|_| 0.3, |_| 0);
            let answers = Answers {
                found: &found,
                of: &of,
                unit: &unit,
                group: &group,
                relative: 1e-3,
                changes: &changes,
            };
            answers.price(None)
        };
        let lobe = |n: f64| (n + 1.0) / std::f64::consts::TAU;
        let two_cosines = Shading { cos_i: [2.0; 2], ..right };
        for (made, factor) in [
            (two_cosines, 3.0),
            (Shading { normalization: lobe, ..two_cosines }, 1.0),
            (Shading { normalization: lobe, tests: Tests::Wo, ..right }, 1.0),
            (Shading { falloff: 1.0, ..two_cosines }, 1.0),
        ] {
            assert_eq!(price(&made, factor).error, TWO_SLIPS, "{made:?}");
        }
        // One is cheaper, a third is more, and a concept is a concept.
        let no_falloff = Shading { falloff: 0.0, ..right };
        assert_eq!(price(&no_falloff, 1.0).error, PriceClass::Concept.price());
        assert_eq!(price(&two_cosines, 1.0).error, PriceClass::Slip.price());
        let three = Shading { falloff: 1.0, normalization: lobe, ..two_cosines };
        assert!(price(&three, 2.0).error > TWO_SLIPS);
    }

    #[test]
    fn what_does_not_vary_is_explained_by_nothing() {
        let priced = |right: fn(usize) -> f64, found: fn(usize) -> f64| {
            let found: Vec<[f32; 3]> = (0..100).map(|index| [found(index) as f32; 3]).collect();
            let answers = Answers {
                found: &found,
                of: &|index, _| [right(index); 3],
                unit: &|_| 1.0,
                group: &|_| 0,
                relative: 1e-3,
                changes: &shader_changes(false),
            };
            answers.price(None)
        };
        let slope: fn(usize) -> f64 = |index| 1.0 + index as f64 / 100.0;
        for constant in [(|_| 1e9) as fn(usize) -> f64, |_| 3.0, |index| 3.0 + (index % 2) as f64] {
            assert_eq!(priced(slope, constant), Price::of_raw(1.0));
        }
        let slip = priced(slope, |index| -3.0 - 3.0 * index as f64 / 100.0);
        assert_eq!((slip.mistake, slip.raw), (Some("a constant factor"), 1.0));
        // Where all is the same, nothing can follow it.
        assert_eq!(priced(|_| 2.0, |_| 6.0).mistake, Some("a constant factor"));
    }
}
