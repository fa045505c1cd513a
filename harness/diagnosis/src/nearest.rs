//! Finds the known mistake nearest to some answers, if it is clearly nearer than any other and than the right answers.
//! A pure function from thumbnails to a hypothesis.

use std::collections::BTreeMap;

use basecode::Vec3;

use super::thumbnail::Thumbnail;

/// Values that differ by less than this fraction of their sum are the same: 16-bit floats in the
/// store and f32 arithmetic in any order.
const DEAD_ZONE: f32 = 1.5e-3;
/// A difference counts against at least this fraction of the mean of what is right.
const FLOOR: f32 = 1e-3;
/// Mean difference from what is right below which there is nothing to explain.
const NOTHING: f64 = 1e-5;
/// A single mistake is named when it leaves less than this fraction of the difference unexplained.
/// Measured: a mistake that the catalogue lacks leaves more, such as a missing highlight beside one that points into
/// the surface.
const SINGLE: f64 = 0.02;
/// The same for a constant factor.
const FACTOR: f64 = 0.03;
/// The same for a mistake with a constant factor on top: both together come near much that is neither, such as another
/// function of the distance, and leave next to nothing of what they are.
const SCALED: f64 = 3e-3;
/// A factor nearer to 1 than this counts as none.
const NO_FACTOR: f32 = 5e-3;
/// The same for two mistakes together, which fit more easily.
const PAIR: f64 = 0.02;
/// What is named must leave less than this fraction of what the runner-up leaves.
const CLEARLY: f64 = 0.5;
/// Pairs are compared on so many views at most, those that differ most.
const PAIR_VIEWS: usize = 4;

/// One view of the renderer in question, beside what the store knows of it.
pub struct Comparison<'a> {
    /// What it answered.
    pub seen: &'a Thumbnail,
    /// What is right.
    pub right: &'a Thumbnail,
    /// What known mistakes answer; one that is not here answers what is right.
    pub mistakes: &'a BTreeMap<String, Thumbnail>,
    /// Which values count.
    pub counts: Vec<bool>,
}

/// What answers look like.
#[derive(Clone, Debug, PartialEq)]
pub enum Hypothesis {
    /// This mistake.
    One(String),
    /// What is right, times a constant.
    Factor(f32),
    /// This mistake, and a constant factor on top.
    Scaled(String, f32),
    /// These two together.
    Two(String, String),
}

/// A hypothesis with its distance.
#[derive(Clone, Debug, PartialEq)]
pub struct Nearest {
    /// What it is.
    pub guess: Hypothesis,
    /// Its distance, as a fraction of the distance from what is right.
    pub distance: f64,
    /// The distance of the next best hypothesis of the same sort; 1 is that of what is right.
    pub runner_up: f64,
}

/// What the answers look like, among mistakes of these names; no two of them may look the same.
pub fn nearest(comparisons: &[Comparison], names: &[&str]) -> Option<Nearest> {
    if from_right(comparisons) < NOTHING {
        return None;
    }
    let shown: Vec<(&Comparison, f32)> =
        comparisons.iter().map(|exhibit| (exhibit, scale(exhibit))).collect();
    let distance = |shown: &[(&Comparison, f32)], guess: &dyn Fn(&Comparison) -> Thumbnail| {
        let from_right = total(shown, |exhibit| exhibit.right.clone());
        total(shown, guess).sum / from_right.sum.max(f64::MIN_POSITIVE)
    };
    let single: Vec<f64> =
        names.iter().map(|name| distance(&shown, &|exhibit| exhibit.tile(name).clone())).collect();
    let singles = single.iter().zip(names);
    let singles = singles.map(|(&distance, &name)| (distance, Hypothesis::One(name.to_owned())));
    if let Some(found) = clearest(singles.collect(), SINGLE) {
        return Some(found);
    }
    let factor = common_factor(&shown, |exhibit| exhibit.right.clone());
    let left = distance(&shown, &|exhibit| exhibit.right.map(|value| factor * value));
    if left < FACTOR && is_factor(factor) {
        return Some(Nearest { guess: Hypothesis::Factor(factor), distance: left, runner_up: 1.0 });
    }
    let mut most = shown;
    let apart = |(exhibit, scale): &(&Comparison, f32)| {
        total(&[(*exhibit, *scale)], |exhibit| exhibit.right.clone()).sum
    };
    most.sort_by(|a, b| apart(b).total_cmp(&apart(a)));
    most.truncate(PAIR_VIEWS);
    let mut pairs = Vec::new();
    for (i, first) in names.iter().enumerate() {
        let factor = common_factor(&most, |exhibit| exhibit.tile(first).clone());
        let left = distance(&most, &|exhibit| exhibit.tile(first).map(|value| factor * value));
        if left < SCALED && left < CLEARLY * single[i] && is_factor(factor) {
            pairs.push((left, Hypothesis::Scaled((*first).to_owned(), factor)));
        }
        for (j, second) in names.iter().enumerate().skip(i + 1) {
            let left = distance(&most, &|exhibit| exhibit.both(first, second));
            // A second mistake that explains nothing more is none.
            if left < CLEARLY * single[i].min(single[j]) {
                pairs.push((left, Hypothesis::Two((*first).to_owned(), (*second).to_owned())));
            }
        }
    }
    clearest(pairs, PAIR)
}

/// Whether a factor changes values, and leaves something of them.
fn is_factor(factor: f32) -> bool {
    (factor - 1.0).abs() > NO_FACTOR && factor.abs() > NO_FACTOR
}

/// The mean difference of all answers from what is right: 0 is the same, 1 nothing alike.
pub fn from_right(comparisons: &[Comparison]) -> f64 {
    let shown: Vec<_> = comparisons.iter().map(|exhibit| (exhibit, scale(exhibit))).collect();
    total(&shown, |exhibit| exhibit.right.clone()).mean()
}

/// Answers are black if at least this fraction of what should shine is dark.
const BLACK: f64 = 0.98;

/// Whether nearly everything is black that should shine: it may be so for any reason.
pub fn is_black(comparisons: &[Comparison]) -> bool {
    let (mut shining, mut dark) = (0usize, 0usize);
    for exhibit in comparisons {
        let values = exhibit.seen.values().iter().zip(exhibit.right.values());
        for ((seen, right), _) in values.zip(&exhibit.counts).filter(|(_, counts)| **counts) {
            if right.element_sum() > 0.0 && !seen.is_nan() {
                shining += 1;
                dark += usize::from(seen.abs().element_sum() <= 1e-6);
            }
        }
    }
    shining > 0 && dark as f64 >= BLACK * shining as f64
}

impl Comparison<'_> {
    fn tile(&self, name: &str) -> &Thumbnail {
        self.mistakes.get(name).unwrap_or(self.right)
    }

    /// Two mistakes together, from each alone: what either does to what is right, it does to the
    /// other too.
    fn both(&self, first: &str, second: &str) -> Thumbnail {
        let compose = |right: f32, a: f32, b: f32| if right == 0.0 { a + b } else { a * b / right };
        self.right.combine(self.tile(first), self.tile(second), |right, a, b| {
            Vec3::from_array(std::array::from_fn(|c| compose(right[c], a[c], b[c])))
        })
    }
}

/// The nearest hypothesis, if it leaves less than `limit` and clearly less than the next one.
fn clearest(mut guesses: Vec<(f64, Hypothesis)>, limit: f64) -> Option<Nearest> {
    guesses.sort_by(|a, b| a.0.total_cmp(&b.0));
    let runner_up = guesses.get(1).map_or(1.0, |(distance, _)| distance.min(1.0));
    let (distance, guess) = guesses.into_iter().next()?;
    (distance < limit && distance < CLEARLY * runner_up).then_some(Nearest {
        guess,
        distance,
        runner_up,
    })
}

/// Differences, added up.
#[derive(Clone, Copy, Default)]
struct Total {
    sum: f64,
    count: usize,
}

impl Total {
    fn mean(self) -> f64 {
        self.sum / self.count.max(1) as f64
    }
}

/// How far the answers are from a hypothesis, over all views.
fn total(shown: &[(&Comparison, f32)], guess: impl Fn(&Comparison) -> Thumbnail) -> Total {
    let mut total = Total::default();
    for (exhibit, scale) in shown {
        let guess = guess(exhibit);
        let values = exhibit.seen.values().iter().zip(guess.values()).zip(&exhibit.counts);
        for ((a, b), _) in values.filter(|(_, counts)| **counts) {
            if let Some(difference) = difference(*a, *b, *scale) {
                total.sum += f64::from(difference);
                total.count += 1;
            }
        }
    }
    total
}

/// The relative difference of an answer and a guess, from 0 to 1; `None` where nothing was asked. A guess without a
/// value there is entirely wrong.
fn difference(a: Vec3, b: Vec3, scale: f32) -> Option<f32> {
    if a.is_nan() {
        return None;
    }
    Some(match (a.is_finite(), b.is_finite()) {
        (true, true) => {
            let size = a.abs().element_sum() + b.abs().element_sum();
            ((a - b).abs().element_sum() / (size + FLOOR * scale) - DEAD_ZONE).max(0.0)
        }
        (false, false) => 0.0,
        _ => 1.0,
    })
}

/// The mean of what is right.
fn scale(exhibit: &Comparison) -> f32 {
    let (mut sum, mut count) = (0.0f64, 0);
    for value in exhibit.right.values().iter().filter(|value| value.is_finite()) {
        sum += f64::from(value.abs().element_sum());
        count += 1;
    }
    (sum / f64::from(count.max(1))).max(1e-6) as f32
}

/// The median of answers over a guess, where the guess is not dark.
fn common_factor(shown: &[(&Comparison, f32)], guess: impl Fn(&Comparison) -> Thumbnail) -> f32 {
    let mut ratios = Vec::new();
    for (exhibit, scale) in shown {
        let guess = guess(exhibit);
        let values = exhibit.seen.values().iter().zip(guess.values()).zip(&exhibit.counts);
        for ((a, b), counts) in values {
            let (a, b) = (a.element_sum(), b.element_sum());
            if *counts && a.is_finite() && b.is_finite() && b > 0.05 * scale {
                ratios.push(a / b);
            }
        }
    }
    ratios.sort_by(f32::total_cmp);
    ratios.get(ratios.len() / 2).copied().unwrap_or(1.0)
}

#[cfg(test)]
mod tests;
