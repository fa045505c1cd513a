//! The price of a wrong answer: the smaller of its raw error, and the price of the one mistake that explains it plus
//! the error left unexplained.
//!
//! A constant factor of pi is off by 214 % and is still one slip: a teacher deducts little for it. So answers are
//! compared with those of known single mistakes (`answers`), each of a class that has a price. `rules.curve` turns the
//! error into points.

use std::collections::BTreeMap;

use super::check::PRICED;
use super::{Check, CheckId, Measure, Verdict};

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

/// Answers that follow the right ones so closely are more than nothing.
pub const LIKE: f64 = 0.3;
/// What is said of them.
pub const UNKNOWN: &str = "something that no single known mistake explains";
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
    fn shadows_that_are_partly_there_are_a_slip_and_missing_ones_are_not() {
        let of = |lit, dark| partly(Price::of_raw(lit + dark), lit, dark).error;
        assert!((of(0.5, 0.0) - 0.0275).abs() < 1e-9 && (of(0.0, 0.5) - 0.0325).abs() < 1e-9);
        assert_eq!((of(1.0, 0.0), of(0.0, 1.0), of(0.3, 0.3)), (1.0, 1.0, 0.6));
    }
}
