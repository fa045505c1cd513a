//! The values that a pass shows beside those that it must bind, and what wrong ones cost.

use basecode::{Image, MaterialModel, Vec3};

use super::seen::Seen;
use super::shapes::wrong_shapes;
use super::{BoundValue, STRAY_FRACTION, is_close};
use crate::Measure;
use crate::price::{self, Price, PriceClass, SURFACES_MISSING};
use crate::stage_film::StageFilm;

/// From this fraction of wrong pixels on, all values together, a pass has set nothing.
const NO_PASS: f64 = 0.9;

/// What frames show of each value.
pub(super) struct Values {
    /// The fraction of pixels on which each value is wrong.
    pub measures: Vec<Measure>,
    /// The first value with too many.
    pub first_wrong: Option<WrongValue>,
    /// Whether every value of every shape was asked for.
    pub all_wanted: bool,
    /// Pixels that show a wrong value, all values together.
    wrong: usize,
    /// Pixels that were looked at, all values together.
    pub total: usize,
}

/// A value that is wrong, and its first pixel that shows it.
pub(super) struct WrongValue {
    bound: BoundValue,
    index: usize,
    shape: usize,
    expected: Vec3,
    found: Vec3,
    /// The fraction of pixels on which it is wrong.
    fraction: f64,
}

impl WrongValue {
    /// A sentence and a hint.
    pub fn in_words(&self, film: &StageFilm) -> (String, &'static str) {
        let sentence = format!(
            "{} is wrong on {:.0} % of the pixels; on \"{}\" at ({}, {}): expected {}, found {}",
            self.bound.name(),
            100.0 * self.fraction,
            film.scene.shapes()[self.shape].name,
            self.index % film.surface.width,
            self.index / film.surface.width,
            self.expected,
            self.found
        );
        (sentence, if self.found == Vec3::ZERO { "it was never set" } else { "" })
    }
}

impl Values {
    pub fn of(
        film: &StageFilm,
        frames: &[(BoundValue, Image)],
        wanted: &dyn Fn(BoundValue, usize) -> bool,
    ) -> Self {
        let mut values =
            Self { measures: Vec::new(), first_wrong: None, all_wanted: true, wrong: 0, total: 0 };
        for (bound, frame) in frames {
            let (mut wrong, mut counted) = (0usize, 0usize);
            let mut first = None;
            for (index, shape) in film.interior() {
                let expected = bound.expected(film.scene, &film.camera, shape);
                let Some(expected) = expected else { continue };
                if !wanted(*bound, shape) {
                    values.all_wanted = false;
                    continue;
                }
                counted += 1;
                let found = frame.pixels[index];
                if !is_close(found, expected) {
                    wrong += 1;
                    first = first.or(Some((index, shape, expected, found)));
                }
            }
            if counted == 0 {
                continue;
            }
            values.wrong += wrong;
            values.total += counted;
            let fraction = wrong as f64 / counted as f64;
            let what = format!("{} wrong (fraction of pixels)", bound.name());
            let measure = Measure::at_most(bound.rule(), what, fraction, STRAY_FRACTION);
            if let Some((index, shape, expected, found)) = first.filter(|_| !measure.passed) {
                let wrong = WrongValue { bound: *bound, index, shape, expected, found, fraction };
                values.first_wrong.get_or_insert(wrong);
            }
            values.measures.push(measure);
        }
        values
    }

    /// The price of a pass with a wrong value.
    pub fn price(&self, film: &StageFilm, frames: &[(BoundValue, Image)], seen: &Seen) -> Price {
        let wrong = self.wrong as f64 / self.total as f64;
        let shapes = wrong_shapes(film, frames);
        let missing = |price: Price, class| match seen.all_values_right {
            true => price.or(SURFACES_MISSING, class, 0.0),
            false => price,
        };
        // A pass that shows hardly one value, on no shape, is no pass, whatever it draws.
        let price = match wrong > NO_PASS && shapes.wrong == shapes.shapes {
            true => missing(Price::of_raw(wrong), PriceClass::Concept),
            false => {
                let other = other_pipeline(film, frames);
                let price = shapes.price(price_of_values(wrong, &self.measures, other));
                missing(price, PriceClass::Slip)
            }
        };
        // What is seen has its values: one state of the pipeline is wrong, such as the depth test.
        let few = STRAY_FRACTION * seen.all as f64;
        match seen.all_values_right && seen.empty.0 as f64 <= few {
            true => price.or("another surface is seen", PriceClass::Slip, 0.0),
            false => price,
        }
    }
}

/// The price of values if this fraction of all of them is wrong. `measures` has the fraction of each value, and
/// `other_pipeline` says whether the diffuse pipeline draws Phong materials.
fn price_of_values(wrong: f64, measures: &[Measure], other_pipeline: bool) -> Price {
    let price = match measures.iter().filter(|measure| !measure.passed).count() {
        1 if other_pipeline => Price::of_raw(wrong).or(
            "Phong materials are drawn by the diffuse pipeline",
            PriceClass::Concept,
            0.0,
        ),
        1 => Price::of_raw(wrong).or("one value is wrong", PriceClass::Slip, 0.0),
        2 => Price::of_raw(wrong).or("two values are wrong", PriceClass::Concept, 0.0),
        _ => Price::of_raw(wrong).or(price::UNKNOWN, PriceClass::Unknown, 0.0),
    };
    let most_wrong = measures.iter().map(|measure| measure.value).fold(0.0, f64::max);
    price.or("some of the film is wrong", PriceClass::Slip, 0.08 * most_wrong)
}

/// Whether all Phong materials in view are drawn by the diffuse pipeline.
fn other_pipeline(film: &StageFilm, frames: &[(BoundValue, Image)]) -> bool {
    let Some((_, frame)) = frames.iter().find(|(bound, _)| *bound == BoundValue::Exponent) else {
        return false;
    };
    let phong = film
        .interior()
        .filter(|(_, shape)| film.scene.material_of(*shape).model == MaterialModel::Phong);
    let (all, blue) = phong.fold((0usize, 0usize), |(all, blue), (index, _)| {
        (all + 1, blue + usize::from(frame.pixels[index].z != 0.0))
    });
    all > 0 && blue as f64 <= STRAY_FRACTION * all as f64
}
