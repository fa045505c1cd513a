//! Factors between answers and right values, as the answers have them.

use std::collections::BTreeMap;

use super::{Answers, Fitted};
use crate::price::PriceClass;
use crate::shading::Shading;

/// A factor below this leaves nothing of a term.
pub(super) const NOTHING: f64 = 1e-3;

/// What the values of a changed renderer are multiplied by, channel by channel.
pub(super) struct Factors {
    pub all: [f64; 3],
    /// In place of `all`, for the questions of a group.
    pub by_group: BTreeMap<usize, [f64; 3]>,
}

impl Factors {
    pub fn of(all: [f64; 3]) -> Self {
        Self { all, by_group: BTreeMap::new() }
    }
}

impl Default for Factors {
    fn default() -> Self {
        Self::of([1.0; 3])
    }
}

impl Answers<'_> {
    /// A factor, as the answers have it. Nothing when it cannot be told, or leaves nothing.
    pub(super) fn fit(
        &self,
        questions: &[usize],
        fitted: Fitted,
    ) -> Option<(Shading, Factors, PriceClass)> {
        let right = Shading::default();
        let (diffuse, specular) =
            (Shading { factor: [1.0, 0.0], ..right }, Shading { factor: [0.0, 1.0], ..right });
        let ratios =
            |questions: &[usize], wanted: &[usize], own: &Shading, other: Option<&Shading>| {
                let mut ratios = Vec::new();
                for &index in questions {
                    let own = (self.of)(index, own);
                    let other = other.map_or([0.0; 3], |other| (self.of)(index, other));
                    for &c in wanted {
                        let tells = own[c] > 0.01 * (self.unit)(index) && own[c] > 0.2 * other[c];
                        let found = f64::from(self.found[index][c]);
                        if tells && found.is_finite() {
                            ratios.push((found - other[c]) / own[c]);
                        }
                    }
                }
                ratios.sort_by(f64::total_cmp);
                ratios.get(ratios.len() / 2).copied()
            };
        let all = [0, 1, 2];
        let class = |factor: f64| {
            if factor.abs() < NOTHING { PriceClass::Concept } else { PriceClass::Slip }
        };
        match fitted {
            Fitted::All => {
                let factor = ratios(questions, &all, &right, None)?;
                (factor.abs() >= NOTHING).then_some((
                    right,
                    Factors::of([factor; 3]),
                    PriceClass::Slip,
                ))
            }
            Fitted::Channels => {
                let factors = all.map(|c| ratios(questions, &[c], &right, None));
                let factors = [factors[0]?, factors[1]?, factors[2]?];
                let some = factors.iter().any(|factor| factor.abs() >= NOTHING);
                some.then_some((right, Factors::of(factors), PriceClass::Slip))
            }
            Fitted::Groups => {
                let mut factors = Factors::default();
                for (group, own) in self.by_group(questions) {
                    let factor = ratios(&own, &all, &right, None)?;
                    if factor.abs() < NOTHING {
                        return None;
                    }
                    factors.by_group.insert(group, [factor; 3]);
                }
                Some((right, factors, PriceClass::Slip))
            }
            Fitted::Colors => {
                let mut factors = Factors::default();
                for (group, own) in self.by_group(questions) {
                    // Where a channel of the right answer is black, no factor tells.
                    let factor = all.map(|c| ratios(&own, &[c], &right, None).unwrap_or(1.0));
                    if factor.iter().all(|factor| factor.abs() < NOTHING) {
                        return None;
                    }
                    factors.by_group.insert(group, factor);
                }
                Some((right, factors, PriceClass::Concept))
            }
            Fitted::Diffuse => {
                let factor = ratios(questions, &all, &diffuse, Some(&specular))?;
                let shading = Shading { factor: [factor, 1.0], ..right };
                Some((shading, Factors::default(), class(factor)))
            }
            Fitted::Ambient => {
                let one = Shading { factor: [0.0; 2], ambient: 1.0, ..right };
                let ambient = ratios(questions, &all, &one, Some(&right))?;
                let shading = Shading { ambient, ..right };
                Some((shading, Factors::default(), PriceClass::Slip))
            }
            Fitted::Specular => {
                let factor = ratios(questions, &all, &specular, Some(&diffuse))?;
                let shading = Shading { factor: [1.0, factor], ..right };
                Some((shading, Factors::default(), class(factor)))
            }
        }
    }
}
