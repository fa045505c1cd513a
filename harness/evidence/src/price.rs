//! The price of a wrong answer: the smaller of its raw error, and the price of the one mistake that explains it plus
//! the error left unexplained.
//!
//! A constant factor of pi is off by 214 % and is still one slip: a teacher deducts little for it. So answers are
//! compared with those of known single mistakes, each of a class that has a price. `rules.curve` turns the error into
//! points.

use std::collections::BTreeMap;

use super::check::PRICED;
use super::shading::{Shading, Tests};
use super::{Check, CheckId, Measure, Verdict};
use imaging::correlation::Moments;

/// How a teacher would class a mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PriceClass {
    /// One constant, sign, power, index or division: 10 to 25 % of a part.
    Slip,
    /// Something that the part is about is missing: 40 to 80 %.
    Concept,
    /// Nothing known explains it, but something is there: 80 %.
    Unknown,
}

impl PriceClass {
    /// The error that a mistake of this class counts as, in [0, 1].
    pub fn price(self) -> f64 {
        match self {
            Self::Slip => 0.02,
            Self::Concept => 0.2,
            Self::Unknown => 0.4,
        }
    }
}

/// The error of two slips together: they lose what both lose alone.
const TWO_SLIPS: f64 = 0.0686;
/// What two slips may leave unexplained.
const LEFT_BY_TWO: f64 = 0.01;
/// Number of questions that tell most mistakes apart.
const FEW: usize = 200;

/// Some questions, spread over all.
pub(super) fn few_of(questions: &[usize]) -> Vec<usize> {
    questions.iter().copied().step_by(questions.len().div_ceil(FEW).max(1)).collect()
}

/// What a few questions may leave unexplained when all leave `left`: chance makes it more, but hardly twice as much.
pub(super) fn surely_more_than(left: f64) -> f64 {
    2.0 * left + 0.05
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

/// What answers cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Price {
    /// The error that counts, in [0, 1].
    pub error: f64,
    /// How far off the answers are: sum of differences over sum of right values, at most 1.
    pub raw: f64,
    /// The single mistake that explains them best, when that made the error smaller.
    pub mistake: Option<&'static str>,
}

impl Price {
    /// The price of answers that are `raw` off.
    pub fn of_raw(raw: f64) -> Self {
        // NaN is as wrong as possible.
        let raw = if raw <= 1.0 { raw } else { 1.0 };
        Self { error: raw, raw, mistake: None }
    }

    /// Whether no mistake can make it smaller.
    pub fn is_least(&self) -> bool {
        self.error <= PriceClass::Slip.price()
    }

    /// The single mistake that explains the answers best, if there is one.
    pub fn name(&self) -> String {
        self.mistake.unwrap_or_default().to_owned()
    }

    /// Says what the error is, when a single mistake made it smaller.
    pub fn measure(&self) -> Option<Measure> {
        let mistake = self.mistake?;
        let name = format!(
            "{PRICED}; it counts {:.3}, no more than this known mistake with the same effect: \
             {mistake}",
            self.error
        );
        Some(Measure { passed: true, ..Measure::at_most(None, name, self.raw, 1.0) })
    }

    /// The same, when a mistake of this class leaves `residual` unexplained.
    pub fn or(self, name: &'static str, class: PriceClass, residual: f64) -> Self {
        let error = class.price() + residual;
        if error < self.error { Self { error, mistake: Some(name), ..self } } else { self }
    }
}

impl Check {
    /// The same check, when it failed by an error that a single mistake may explain.
    pub fn priced(mut self, price: impl FnOnce(f64) -> Price) -> Self {
        if self.verdict == Verdict::Fail && self.error > 0.0 {
            let price = price(self.error);
            self.error = price.error;
            self.mistake = price.name();
            self.measures.extend(price.measure());
        }
        self
    }
}

/// Whether one mistake explains a check's answers and leaves next to nothing.
pub fn is_explained(check: &Check) -> bool {
    let leaves_nothing = |class: PriceClass| (check.error - class.price()).abs() < 1e-3;
    let is_known = ![UNKNOWN, ""].contains(&check.mistake.as_str());
    is_known && [PriceClass::Slip, PriceClass::Concept].into_iter().any(leaves_nothing)
}

/// Whether a failed check is no further off than a slip: what one explains may leave as much as a seam does.
fn is_slight(check: &Check) -> bool {
    let is_known = ![UNKNOWN, ""].contains(&check.mistake.as_str());
    check.error <= if is_known { 1.5 } else { 1.0 } * PriceClass::Slip.price()
}

/// Whether failed checks are no further off than a slip.
pub fn are_slight<'a>(checks: impl IntoIterator<Item = &'a Check>) -> bool {
    checks.into_iter().all(is_slight)
}

/// Whether the failed ones of these checks are slight, or explained by single mistakes, on most scenes.
pub fn are_mostly_explained<'a>(checks: impl IntoIterator<Item = &'a Check>) -> bool {
    let failed = checks.into_iter().filter(|check| check.verdict == Verdict::Fail);
    let (all, explained) = failed.fold((0usize, 0usize), |(all, explained), check| {
        (all + 1, explained + usize::from(is_explained(check) || is_slight(check)))
    });
    2 * explained > all
}

/// If one mistake explains a check on most scenes, and nothing known explains it on the others, the others cost no
/// more: on one scene a seam or an edge may leave more unexplained. A scene that the mistake leaves without light
/// (`DARKENING`) is no worse either. And if the answers on most scenes are explained, or follow the right ones, or are
/// right BSDF values, the others do not count as empty.
pub fn settle_by_common_mistake(checks: &mut [Check]) {
    let mut of_id: BTreeMap<(CheckId, String), Vec<usize>> = BTreeMap::new();
    for (index, check) in checks.iter().enumerate() {
        if check.verdict == Verdict::Fail {
            let key = (check.id, check.convention.clone());
            of_id.entry(key).or_default().push(index);
        }
    }
    // Every other question is passed by answers that show nothing as well, where nothing is to be seen.
    let is_told_by_right = |id: CheckId| [CheckId::BsdfDiffuse, CheckId::BsdfPhong].contains(&id);
    let right_of = |(id, convention): &(CheckId, String)| {
        let right = |check: &&Check| {
            let same = check.id == *id && check.convention == *convention;
            same && is_told_by_right(*id) && check.verdict == Verdict::Pass
        };
        checks.iter().filter(right).count()
    };
    let right: Vec<usize> = of_id.keys().map(right_of).collect();
    for (own, right) in of_id.into_values().zip(right) {
        // A mistake that leaves most unexplained is no explanation.
        let unexplained = |check: &Check| {
            let barely = check.error > PriceClass::Unknown.price() && check.mistake != BLACK;
            check.mistake.is_empty() || barely
        };
        let (nothing, others): (Vec<usize>, Vec<usize>) =
            own.iter().partition(|&&index| unexplained(&checks[index]));
        let told = others.iter().filter(|&&index| checks[index].mistake != BLACK).count();
        if told + right >= nothing.len() {
            for index in nothing {
                checks[index].error = checks[index].error.min(PriceClass::Unknown.price());
            }
        }
        let unknown =
            |index: &usize| ["", UNKNOWN, BLACK, ANOTHER_PLACE].contains(&&*checks[*index].mistake);
        let (others, told): (Vec<usize>, Vec<usize>) = own.into_iter().partition(unknown);
        let Some(name) = told.first().map(|&index| checks[index].mistake.clone()) else { continue };
        let one = told.iter().all(|&index| checks[index].mistake == name);
        let darkens = DARKENING.contains(&name.as_str());
        // A scene that shows nothing says nothing against what darkens it.
        let dark = others.iter().filter(|&&index| checks[index].mistake == BLACK).count();
        let against = others.len() - if darkens { dark } else { 0 };
        if !one || told.len() < against {
            continue;
        }
        let mut errors: Vec<f64> = told.iter().map(|&index| checks[index].error).collect();
        errors.sort_by(f64::total_cmp);
        let median = errors[errors.len() / 2];
        for index in told.into_iter().chain(others.into_iter().filter(|_| darkens)) {
            checks[index].error = checks[index].error.min(median);
        }
    }
}

/// The mistake's name for a check whose answers are all black.
pub const BLACK: &str = "nothing is lit";
/// The mistakes that can leave nothing lit on a scene.
const DARKENING: [&str; 8] = [
    LIGHT_NEGATED,
    VIEWER_NEGATED,
    VIEWER_AT_ORIGIN,
    VIEWER_NOT_TURNED,
    LIGHT_IN_VIEW_SPACE,
    LIGHT_IN_WORLD_SPACE,
    LIGHT_AT_ORIGIN,
    WRONG_W,
];
/// wi is negated.
pub const LIGHT_NEGATED: &str = "the direction to the light is negated";
/// wo is negated.
pub const VIEWER_NEGATED: &str = "the direction to the viewer is negated";
/// wo leads to the origin.
pub const VIEWER_AT_ORIGIN: &str = "the viewer stands at the origin";
/// The light's position is multiplied by the view matrix.
pub const LIGHT_IN_VIEW_SPACE: &str = "the light is in view space";
/// The light's position is not multiplied by the view matrix, positions are.
pub const LIGHT_IN_WORLD_SPACE: &str = "the light is in world space, surfaces in view space";
/// The viewer's position is the view matrix' translation, turned the wrong way round.
pub const VIEWER_NOT_TURNED: &str = "the viewer comes from the view matrix without its transpose";
/// wi leads to the origin.
pub const LIGHT_AT_ORIGIN: &str = "the light stands at the origin";

/// Surfaces lie elsewhere on the film, nobody knows how.
pub const ANOTHER_PLACE: &str = "another clip-space position";
/// What a vertex stage shows is right without a translation: with one, it lies behind the far plane.
pub const WRONG_W: &str = "the translation is lost: w of the position is not 1";
/// The slip that some surfaces are not drawn: what is there is right.
pub const SURFACES_MISSING: &str = "surfaces are missing";

/// What the values of a changed renderer are multiplied by, channel by channel.
struct Factors {
    all: [f64; 3],
    /// In place of `all`, for the questions of a group.
    by_group: BTreeMap<usize, [f64; 3]>,
}

impl Factors {
    fn of(all: [f64; 3]) -> Self {
        Self { all, by_group: BTreeMap::new() }
    }
}

impl Default for Factors {
    fn default() -> Self {
        Self::of([1.0; 3])
    }
}

/// At most this many questions are looked at: a price is no finer than a percent.
const QUESTIONS: usize = 4000;
/// Answers that follow the right ones so closely are more than nothing.
pub const LIKE: f64 = 0.3;
/// Answers whose variance is below this part of their mean square are flat: nothing can follow them.
const FLAT: f64 = 0.01;
/// What is said of them.
pub const UNKNOWN: &str = "something that no single known mistake explains";
/// A factor below this leaves nothing of a term.
const NOTHING: f64 = 1e-3;

/// Whether values (a) follow those of a mistake (b), so that the mistake may explain them. If the mistake's own values
/// hardly vary, any constant is about right, so they follow.
pub(super) fn follows(pairs: &Moments) -> bool {
    let [_, varies, _] = pairs.about_means();
    pairs.correlation() >= LIKE || varies < FLAT * pairs.square_of_b()
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
        match !is_concept && self.are_of_two_slips(&questions, &few) {
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

    /// Whether two slips explain the answers, or a slip and a constant factor. Of two factors of the right value their
    /// product is taken, of two that light what should be black the sum. Tests that are missing go with any other slip.
    fn are_of_two_slips(&self, questions: &[usize], few: &[usize]) -> bool {
        let slips: Vec<Shading> = self
            .changes
            .iter()
            .filter(|change| change.class == PriceClass::Slip)
            .filter_map(|change| change.shading)
            .collect();
        let right = Shading::default();
        let both = |right: f64, a: f64, b: f64| {
            if right != 0.0 { a / right * b } else { a + b }
        };
        let values = |shading: &Shading| -> Vec<[f64; 3]> {
            few.iter().map(|&index| (self.of)(index, shading)).collect()
        };
        let found: Vec<[f64; 3]> =
            few.iter().map(|&index| self.found[index].map(f64::from)).collect();
        let (plain, all) = (values(&right), slips.iter().map(values).collect::<Vec<_>>());
        // Most pairs are told by a few questions.
        let explains = |of: &dyn Fn(usize, usize) -> f64| {
            let (mut apart, mut total) = (0.0, 0.0);
            for (at, &index) in few.iter().enumerate() {
                let unit = (self.unit)(index);
                for c in 0..3 {
                    let (found, told) = (found[at][c], of(at, c));
                    if found.is_finite() != told.is_finite() {
                        return false;
                    }
                    if told.is_finite() {
                        let room = self.relative * told.abs() + 1e-6 * unit;
                        let difference = (found - told).abs();
                        apart += if difference <= room { 0.0 } else { difference / unit };
                        total += told.abs() / unit;
                    }
                }
            }
            total > 0.0 && apart <= LEFT_BY_TWO * total
        };
        let surely = |of: &dyn Fn(usize) -> [f64; 3]| {
            let residual = self.residual_of(questions, of);
            residual <= LEFT_BY_TWO
        };
        let pairs = (0..slips.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
        let mut two = pairs
            .filter(|&(a, b)| explains(&|at, c| both(plain[at][c], all[a][at][c], all[b][at][c])));
        let is_untested = |shading: &&Shading| shading.tests != Tests::Each;
        let untested = slips.iter().filter(is_untested).flat_map(|a| {
            let tested = slips.iter().filter(|b| !is_untested(b));
            tested.map(|b| Shading { tests: a.tests, ..*b })
        });
        let mut untested = untested.filter(|shading| {
            let values = values(shading);
            explains(&|at, c| values[at][c])
        });
        if untested.any(|shading| surely(&|index| (self.of)(index, &shading))) {
            return true;
        }
        let mut one_and_factor = (0..slips.len()).filter_map(|a| {
            let mut ratios: Vec<f64> = Vec::new();
            for (at, &index) in few.iter().enumerate() {
                let tells = |c: &usize| all[a][at][*c].abs() > 0.01 * (self.unit)(index);
                ratios.extend((0..3).filter(tells).map(|c| found[at][c] / all[a][at][c]));
            }
            ratios.retain(|ratio| ratio.is_finite());
            ratios.sort_by(f64::total_cmp);
            let factor = *ratios.get(ratios.len() / 2)?;
            let told = factor.abs() >= NOTHING && explains(&|at, c| factor * all[a][at][c]);
            told.then_some((a, factor))
        });
        let of_two = |(a, b): (usize, usize)| {
            surely(&|index| {
                let [plain, a, b] =
                    [&right, &slips[a], &slips[b]].map(|shading| (self.of)(index, shading));
                std::array::from_fn(|c| both(plain[c], a[c], b[c]))
            })
        };
        let of_factor = |(a, factor): (usize, f64)| {
            surely(&|index| (self.of)(index, &slips[a]).map(|value| factor * value))
        };
        two.any(of_two) || one_and_factor.any(of_factor)
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

    /// A factor, as the answers have it. Nothing when it cannot be told, or leaves nothing.
    fn fit(&self, questions: &[usize], fitted: Fitted) -> Option<(Shading, Factors, PriceClass)> {
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

/// The price, on top of a slip, of shadows that leave this fraction of the light: little at half of it, most of the
/// points where nearly none is missing.
pub fn fading(light: f64) -> f64 {
    0.03 * light * light + light.powi(16)
}

/// Shadows are there where at least so much of what should be lit is: acne darkens half of it and more.
const LIT: f64 = 0.05;
/// And where at least so much of what should be dark is.
const DARK: f64 = 0.4;

/// The price of shadows that are wrong on these fractions of the lit and the dark pixels, if nearly all of one kind is
/// right. Acne darkens some lit pixels; too large a bias lights some dark ones.
pub fn partly(price: Price, lit_wrong: f64, dark_wrong: f64) -> Price {
    let few = 0.02;
    let price = match dark_wrong <= few && lit_wrong <= 1.0 - LIT {
        true => price.or("some lit points are in shadow", PriceClass::Slip, 0.015 * lit_wrong),
        false => price,
    };
    match lit_wrong <= few && dark_wrong <= 1.0 - DARK {
        true => price.or("some shadows are missing", PriceClass::Slip, 0.025 * dark_wrong),
        false => price,
    }
}

#[cfg(test)]
mod tests {
    use super::super::changes::shader_changes;
    use super::super::shading::ShadedPoint;
    use super::*;

    fn failed(scene: &str, mistake: &str, error: f64) -> Check {
        let check = Check::new(CheckId::StagePhong, scene, Verdict::Fail, "");
        Check { mistake: mistake.to_owned(), error, ..check }
    }

    fn agreed(checks: &[(&str, f64)]) -> Vec<f64> {
        let scenes = ["a", "b", "c", "d"];
        let own = scenes.iter().zip(checks);
        let mut checks: Vec<Check> =
            own.map(|(scene, (mistake, error))| failed(scene, mistake, *error)).collect();
        settle_by_common_mistake(&mut checks);
        checks.iter().map(|check| check.error).collect()
    }

    #[test]
    fn one_mistake_on_most_scenes_costs_its_median() {
        let slip = "r in place of r^2";
        assert_eq!(agreed(&[(slip, 0.02), (slip, 0.03), (slip, 0.3)]), [0.02, 0.03, 0.03]);
        // Two mistakes, or one that most scenes do not show, stay as they are.
        assert_eq!(agreed(&[(slip, 0.02), ("another", 0.3)]), [0.02, 0.3]);
        assert_eq!(agreed(&[(slip, 0.02), ("", 0.5), ("", 0.6)]), [0.02, 0.5, 0.6]);
        // What leaves nothing lit elsewhere explains that too; another slip does not.
        assert_eq!(agreed(&[(VIEWER_AT_ORIGIN, 0.02), (BLACK, 1.0)]), [0.02, 0.02]);
        assert_eq!(agreed(&[(slip, 0.02), (BLACK, 1.0)]), [0.02, 1.0]);
        // A scene that shows something tells more than any number that show nothing.
        let negated = (LIGHT_NEGATED, 0.02);
        let black = |count| [vec![(BLACK, 1.0); 2], vec![negated; count]].concat();
        assert_eq!(agreed(&black(2)), [0.02; 4]);
        assert_eq!(agreed(&[vec![(BLACK, 1.0); 3], vec![negated]].concat()), [0.02; 4]);
        let unlike = [(BLACK, 1.0), negated, (UNKNOWN, 0.4), (UNKNOWN, 0.4)];
        assert_eq!(agreed(&unlike), [1.0, 0.02, 0.4, 0.4]);
        // What follows the right answers on most scenes is more than nothing on the others.
        assert_eq!(agreed(&[(UNKNOWN, 0.4), (UNKNOWN, 0.4), ("", 1.0)]), [0.4, 0.4, 0.4]);
        assert_eq!(agreed(&[(UNKNOWN, 0.4), (UNKNOWN, 0.4), (slip, 0.8)]), [0.4, 0.4, 0.4]);
        assert_eq!(agreed(&[(UNKNOWN, 0.4), ("", 0.3), ("", 1.0)]), [0.4, 0.3, 1.0]);
        assert_eq!(agreed(&[(UNKNOWN, 0.4), (BLACK, 1.0)]), [0.4, 1.0]);
    }

    #[test]
    fn a_bsdf_that_is_right_elsewhere_is_not_empty() {
        let settled = |id: CheckId, passes: usize| {
            let right = |_| Check::new(id, "", Verdict::Pass, "");
            let mut checks: Vec<Check> = (0..passes).map(right).collect();
            checks.push(Check { id, ..failed("textured", "", 1.0) });
            settle_by_common_mistake(&mut checks);
            checks[passes].error
        };
        // As with another mistake beside it, which explains what is right here.
        assert_eq!(settled(CheckId::BsdfDiffuse, 1), PriceClass::Unknown.price());
        assert_eq!(settled(CheckId::BsdfDiffuse, 0), 1.0);
        // Scenes without a shadow are passed without any.
        assert_eq!(settled(CheckId::ShadowRays, 1), 1.0);
    }

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

    #[test]
    fn shadows_that_are_partly_there_are_a_slip_and_missing_ones_are_not() {
        let of = |lit, dark| partly(Price::of_raw(lit + dark), lit, dark).error;
        assert!((of(0.5, 0.0) - 0.0275).abs() < 1e-9 && (of(0.0, 0.5) - 0.0325).abs() < 1e-9);
        assert_eq!((of(1.0, 0.0), of(0.0, 1.0), of(0.3, 0.3)), (1.0, 1.0, 0.6));
    }
}
