//! Two slips at once.

use super::Answers;
use super::factors::NOTHING;
use crate::price::PriceClass;
use crate::shading::{Shading, Tests};

/// The error of two slips together: they lose what both lose alone.
pub(super) const TWO_SLIPS: f64 = 0.0686;
/// What two slips may leave unexplained.
pub(super) const LEFT_BY_TWO: f64 = 0.01;
/// A difference of a value that is none, in units.
const ROOM: f64 = 1e-6;

/// The slips of a renderer, beside its answers to a few questions.
pub(super) struct Slips<'a> {
    answers: &'a Answers<'a>,
    few: &'a [usize],
    slips: Vec<Shading>,
    /// What was answered to the few.
    found: Vec<[f64; 3]>,
    /// The sum of its finite values in units, with the room of each.
    total: f64,
    /// The right answers to them.
    right: Vec<[f64; 3]>,
    /// The answers of each slip.
    slipped: Vec<Vec<[f64; 3]>>,
}

impl<'a> Slips<'a> {
    pub fn of(answers: &'a Answers<'a>, few: &'a [usize]) -> Self {
        let slips = answers.changes.iter().filter(|change| change.class == PriceClass::Slip);
        let slips: Vec<Shading> = slips.filter_map(|change| change.shading).collect();
        let values = |shading: &Shading| values(answers, few, shading);
        let found: Vec<[f64; 3]> =
            few.iter().map(|&index| answers.found[index].map(f64::from)).collect();
        let sizes = few.iter().zip(&found).flat_map(|(&index, found)| {
            let unit = (answers.unit)(index);
            found.iter().filter(|value| value.is_finite()).map(move |v| v.abs() / unit + ROOM)
        });
        let total = sizes.sum();
        let (right, slipped) = (values(&Shading::default()), slips.iter().map(values).collect());
        Self { answers, few, slips, found, total, right, slipped }
    }

    /// Whether two slips explain the answers, or a slip and a constant factor. Of two factors of the right value their
    /// product is taken, of two that light what should be black the sum. Tests that are missing go with any other slip.
    pub fn two_explain(&self, questions: &[usize]) -> bool {
        let surely =
            |of: &dyn Fn(usize) -> [f64; 3]| self.answers.residual_of(questions, of) <= LEFT_BY_TWO;
        let answer = self.answers.of;
        if self.untested().any(|shading| surely(&|index| answer(index, &shading))) {
            return true;
        }
        let right = Shading::default();
        let of_two = |(a, b): (usize, usize)| {
            surely(&|index| {
                let [right, a, b] =
                    [&right, &self.slips[a], &self.slips[b]].map(|shading| answer(index, shading));
                std::array::from_fn(|c| both(right[c], a[c], b[c]))
            })
        };
        let of_factor = |(a, factor): (usize, f64)| {
            surely(&|index| answer(index, &self.slips[a]).map(|value| factor * value))
        };
        self.pairs().any(of_two) || self.with_factor().any(of_factor)
    }

    /// Slips without tests that explain the few.
    fn untested(&self) -> impl Iterator<Item = Shading> {
        let is_untested = |shading: &&Shading| shading.tests != Tests::Each;
        let untested = self.slips.iter().filter(is_untested).flat_map(move |a| {
            let tested = self.slips.iter().filter(move |b| !is_untested(b));
            tested.map(|b| Shading { tests: a.tests, ..*b })
        });
        untested.filter(|shading| {
            let values = values(self.answers, self.few, shading);
            self.explains(&|at, c| values[at][c])
        })
    }

    /// Pairs of slips that explain the few.
    fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        let pairs = (0..self.slips.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
        pairs.filter(|&(a, b)| {
            let (a, b) = (&self.slipped[a], &self.slipped[b]);
            self.explains(&|at, c| both(self.right[at][c], a[at][c], b[at][c]))
        })
    }

    /// Slips that explain the few with a constant factor.
    fn with_factor(&self) -> impl Iterator<Item = (usize, f64)> {
        self.slipped.iter().enumerate().filter_map(|(slip, slipped)| {
            let mut ratios: Vec<f64> = Vec::new();
            for (at, &index) in self.few.iter().enumerate() {
                let tells = |c: &usize| slipped[at][*c].abs() > 0.01 * (self.answers.unit)(index);
                ratios.extend((0..3).filter(tells).map(|c| self.found[at][c] / slipped[at][c]));
            }
            ratios.retain(|ratio| ratio.is_finite());
            ratios.sort_by(f64::total_cmp);
            let factor = *ratios.get(ratios.len() / 2)?;
            let told = factor.abs() >= NOTHING && self.explains(&|at, c| factor * slipped[at][c]);
            told.then_some((slip, factor))
        })
    }

    /// Whether values of the few, by place and channel, explain what was answered. Few questions tell most pairs.
    fn explains(&self, of: &dyn Fn(usize, usize) -> f64) -> bool {
        let (mut apart, mut total) = (0.0, 0.0);
        for (at, &index) in self.few.iter().enumerate() {
            // All that is told comes to no more than what was found and what is apart from it, with its room.
            let most = (self.total + apart) / (1.0 - self.answers.relative);
            if apart > LEFT_BY_TWO * most {
                return false;
            }
            let unit = (self.answers.unit)(index);
            for c in 0..3 {
                let (found, told) = (self.found[at][c], of(at, c));
                if found.is_finite() != told.is_finite() {
                    return false;
                }
                if told.is_finite() {
                    let room = self.answers.relative * told.abs() + ROOM * unit;
                    let difference = (found - told).abs();
                    apart += if difference <= room { 0.0 } else { difference / unit };
                    total += told.abs() / unit;
                }
            }
        }
        total > 0.0 && apart <= LEFT_BY_TWO * total
    }
}

/// What a renderer that shades so answers to some questions.
fn values(answers: &Answers, questions: &[usize], shading: &Shading) -> Vec<[f64; 3]> {
    questions.iter().map(|&index| (answers.of)(index, shading)).collect()
}

/// The value of two slips, of which each makes `a` and `b` of the right one.
fn both(right: f64, a: f64, b: f64) -> f64 {
    if right != 0.0 { a / right * b } else { a + b }
}
