//! Combinations of mistakes: adding a mistake must never gain a part a point.
//!
//! Combinations in which two mistakes cancel are left out, such as a cosine that is missing in one place and doubled in
//! another. The images tell: one is right, or all are nearer to the right ones than with either mistake alone.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Result;
use umbra::diagnosis::{Catalogue, KnownMistake};
use umbra::evidence::{Check, CheckId, Verdict};

use super::Arguments;
use super::choice::{self, Subject};
use super::figures::Figure;
use super::grader::Grader;
use super::row::Row;

/// Seed of what is drawn: the same in every run.
const SEED: u64 = 10_000_019;
/// Number of mistakes that represent their family in [`pairs`].
const OF_FAMILY: usize = 3;
/// Points are published with two digits.
const ROUNDING: f64 = 0.011;
/// Fraction of the combinations that may gain for now; all of them are printed. One mistake hides another: on a black
/// material no shadow is missed, and a probe that a wrong camera position leaves dark is not judged. Of 453 pairs none
/// is known to gain, of 500 triples 12, three of them by 0.02 points.
const NOT_YET: f64 = 0.06;
/// An image must be nearer by this fraction to tell that two mistakes mend each other.
const NEARER: f64 = 0.98;

/// The combinations of a run.
pub struct Combinations {
    pairs: Vec<Subject>,
    triples: Vec<Subject>,
}

impl Combinations {
    /// Draws triples from the mistakes in `single`, with `--quick` also pairs.
    pub fn new(grader: &Grader, single: &[Subject], arguments: &Arguments) -> Self {
        let fits = |names: &[String]| grader.stages(names).is_ok();
        let names: Vec<&str> =
            single.iter().flat_map(|s| &s.mistakes).map(String::as_str).collect();
        let drawn = |size, count| drawn(grader.catalogue, &names, size, count, &fits);
        let (pairs, triples) = if arguments.quick {
            (drawn(2, choice::QUICK_PAIRS), drawn(3, choice::QUICK_TRIPLES))
        } else {
            (pairs(grader.catalogue, &fits), drawn(3, choice::TRIPLES))
        };
        Self { pairs: arguments.chosen(pairs), triples: arguments.chosen(triples) }
    }

    /// Grades pairs and triples, and each of their mistakes alone that is not among `known`. Returns the number of
    /// each and how many are monotone.
    ///
    /// # Errors
    /// When one cannot be graded.
    pub fn figures(&self, grader: &Grader, known: &[Row]) -> Result<[(usize, Figure); 2]> {
        let wanted = |single: &Subject| {
            let name = &single.mistakes[0];
            let own = self.pairs.iter().chain(&self.triples).any(|s| s.mistakes.contains(name));
            own && !known.iter().any(|row| row.subject.mistakes == single.mistakes)
        };
        let missing: Vec<Subject> =
            choice::singles(grader.catalogue).into_iter().filter(wanted).collect();
        let missing = grader.grade_all(&missing)?;
        let singles = known.iter().chain(&missing);
        let singles = singles.map(|row| (row.subject.mistakes[0].as_str(), row)).collect();
        let of = |name, subjects: &[Subject]| {
            let rows = grader.grade_all(subjects)?;
            anyhow::Ok((rows.len(), figure(name, &rows, &singles)))
        };
        Ok([of("monotone_pairs", &self.pairs)?, of("monotone_triples", &self.triples)?])
    }
}

/// Whether the texts of the shaders can hold all of these mistakes.
type Fits<'a> = &'a dyn Fn(&[String]) -> bool;

/// What combinations are made of.
fn that_cost(mistakes: &[KnownMistake]) -> Vec<&KnownMistake> {
    mistakes.iter().filter(|mistake| !mistake.parts.is_empty()).collect()
}

fn is_offline(mistake: &KnownMistake) -> bool {
    mistake.parts.iter().any(|part| part.starts_with("1."))
}

/// Some mistakes of each family, of other classes where it has them.
fn representatives(catalogue: &Catalogue) -> Vec<&KnownMistake> {
    let mut of_family: BTreeMap<&str, Vec<&KnownMistake>> = BTreeMap::new();
    for mistake in that_cost(&catalogue.mistakes) {
        of_family.entry(&mistake.family).or_default().push(mistake);
    }
    let chosen = of_family.into_values().flat_map(|all| {
        let mut classes = BTreeSet::new();
        let (mut first, others): (Vec<_>, Vec<_>) =
            all.into_iter().partition(|mistake| classes.insert(mistake.class));
        first.extend(others);
        first.truncate(OF_FAMILY);
        first
    });
    chosen.collect()
}

/// All pairs of representatives on one path.
fn pairs(catalogue: &Catalogue, fits: Fits) -> Vec<Subject> {
    let all = representatives(catalogue);
    let mut pairs = Vec::new();
    for (index, first) in all.iter().enumerate() {
        for second in &all[index + 1..] {
            if is_offline(first) == is_offline(second) {
                pairs.extend(subject(&[first, second], fits));
            }
        }
    }
    pairs
}

/// A number of different combinations of `size` mistakes on one path, drawn from `names`.
fn drawn(
    catalogue: &Catalogue,
    names: &[&str],
    size: usize,
    count: usize,
    fits: Fits,
) -> Vec<Subject> {
    let all = that_cost(&catalogue.mistakes);
    let pool: Vec<_> = all.into_iter().filter(|m| names.contains(&m.name.as_str())).collect();
    let mut state = SEED + size as u64;
    let mut next = |below: usize| {
        // Knuth's MMIX generator.
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let (mut seen, mut drawn) = (BTreeSet::new(), Vec::new());
    // Most draws are worth something; where too few are left, there are fewer.
    for _ in 0..100 * count {
        if drawn.len() == count || pool.len() < size {
            break;
        }
        let mut chosen: Vec<usize> = (0..size).map(|_| next(pool.len())).collect();
        chosen.sort_unstable();
        chosen.dedup();
        let mistakes: Vec<&KnownMistake> = chosen.iter().map(|&index| pool[index]).collect();
        let one_path = mistakes.iter().all(|m| is_offline(m) == is_offline(mistakes[0]));
        if chosen.len() == size && one_path && seen.insert(chosen) {
            drawn.extend(subject(&mistakes, fits));
        }
    }
    drawn
}

fn subject(mistakes: &[&KnownMistake], fits: Fits) -> Option<Subject> {
    let names: Vec<String> = mistakes.iter().map(|mistake| mistake.name.clone()).collect();
    let parts: BTreeSet<String> = mistakes.iter().flat_map(|m| m.parts.clone()).collect();
    fits(&names).then(|| Subject::together(names, parts.into_iter().collect()))
}

/// How many combinations are monotone; `singles` holds each of their mistakes alone.
fn figure(name: &str, rows: &[Row], singles: &BTreeMap<&str, &Row>) -> Figure {
    let (mut complaints, mut mended) = (Vec::new(), 0);
    for row in rows {
        let alone: Vec<&Row> =
            row.subject.mistakes.iter().filter_map(|m| singles.get(m.as_str()).copied()).collect();
        let gains = gains(row, &alone);
        if gains.is_empty() {
            continue;
        }
        if mends(row, &alone) {
            mended += 1;
        } else {
            complaints.push(format!("{}: {}", row.subject.name(), gains.join("; ")));
        }
    }
    let of = rows.len() - mended;
    let mut figure = Figure::right(name, of, complaints);
    if (figure.complaints.len() as f64) <= NOT_YET * of as f64 {
        figure.complaints.drain(..).for_each(|line| println!("gains: {line}"));
    }
    if mended > 0 {
        figure.text += &format!("(+{mended} that mend each other)");
    }
    figure
}

/// The parts that are worth more than with one of the mistakes alone.
fn gains(row: &Row, alone: &[&Row]) -> Vec<String> {
    let parts = row.grade.parts.iter().enumerate();
    let gains = parts.filter_map(|(index, part)| {
        let worths = alone.iter().map(|single| (&single.subject, single.grade.parts[index].points));
        let (least, points) = worths.min_by(|a, b| a.1.total_cmp(&b.1))?;
        (part.points_max > points + ROUNDING).then(|| {
            format!(
                "{} has {:.2}, with {} alone {points:.2}",
                part.id,
                part.points_max,
                least.name()
            )
        })
    });
    gains.collect()
}

/// Whether two of the mistakes mend each other: the image of a scene is right that is wrong with each alone, or the
/// images of a path are nearer to the right ones than with either alone.
fn mends(row: &Row, alone: &[&Row]) -> bool {
    [CheckId::ImageOffline, CheckId::ImageRealtime, CheckId::BonusImage].into_iter().any(|image| {
        let right = right_scenes(row, image);
        let alone_right: BTreeSet<&str> =
            alone.iter().flat_map(|single| right_scenes(single, image)).collect();
        let mut alone: Vec<f64> = alone.iter().map(|single| distance(single, image)).collect();
        alone.sort_by(|a, b| b.total_cmp(a));
        let nearer = |second: &f64| distance(row, image) < NEARER * second;
        alone.get(1).is_some_and(nearer) || !right.is_subset(&alone_right)
    })
}

/// The scenes whose image is right.
fn right_scenes(row: &Row, image: CheckId) -> BTreeSet<&str> {
    let right = row.evidence.named(image).filter(|check| check.verdict == Verdict::Pass);
    right.map(|check| check.scene.as_str()).collect()
}

/// How far a renderer's images are from the right ones, all scenes together.
fn distance(row: &Row, image: CheckId) -> f64 {
    let error = |check: &Check| if check.verdict == Verdict::Pass { 0.0 } else { check.error };
    row.evidence.named(image).map(error).sum()
}

#[cfg(test)]
mod tests {
    use umbra::evidence::Evidence;
    use umbra::rubric::{Grade, PartGrade};

    use super::*;

    fn row(names: &[&str], points: f64, error: f64) -> Row {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let verdict = if error > 0.0 { Verdict::Fail } else { Verdict::Pass };
        let check = Check { error, ..Check::new(CheckId::ImageOffline, "s", verdict, "") };
        // Another scene, which is wrong whatever the mistakes.
        let other =
            Check { error: 0.9, ..Check::new(CheckId::ImageOffline, "t", Verdict::Fail, "") };
        let part = PartGrade {
            id: "1.3".into(),
            title: String::new(),
            out_of: 20.0,
            bonus: false,
            points,
            unconfirmed: 0.0,
            points_max: points,
            reason: String::new(),
            evidence: Vec::new(),
        };
        Row {
            subject: Subject::together(names, vec!["1.3".into()]),
            all_shown: true,
            evidence: Evidence { checks: vec![check, other] },
            diagnoses: Vec::new(),
            grade: Grade {
                parts: vec![part],
                points,
                unconfirmed: 0.0,
                points_max: points,
                out_of: 20.0,
                remarks: Vec::new(),
            },
            seconds: 0.0,
        }
    }

    #[test]
    fn what_gains_by_a_mistake_is_found_and_what_mends_is_not() {
        let (a, b) = (row(&["a"], 17.0, 0.3), row(&["b"], 12.0, 0.5));
        let singles = BTreeMap::from([("a", &a), ("b", &b)]);
        let judge =
            |points, error| figure("pairs", &[row(&["a", "b"], points, error)], &singles).text;
        assert_eq!(judge(12.0, 0.6), "pairs=1/1");
        assert_eq!(judge(12.5, 0.6), "pairs=0/1");
        assert_eq!(judge(12.5, 0.1), "pairs=0/0(+1 that mend each other)");
        // Right on one scene, while the other is further off than with either alone.
        let mut right = row(&["a", "b"], 12.5, 0.0);
        right.evidence.checks[1].error = 2.0;
        assert_eq!(figure("pairs", &[right], &singles).text, "pairs=0/0(+1 that mend each other)");
    }

    #[test]
    fn two_of_three_mistakes_may_mend_each_other() {
        let (a, b, c) = (row(&["a"], 17.0, 0.3), row(&["b"], 12.0, 0.5), row(&["c"], 19.0, 0.01));
        let singles = BTreeMap::from([("a", &a), ("b", &b), ("c", &c)]);
        let judge = |error| figure("triples", &[row(&["a", "b", "c"], 12.5, error)], &singles).text;
        assert_eq!(judge(0.1), "triples=0/0(+1 that mend each other)");
        // Nearer than with one of them, but not than with any two.
        assert_eq!(judge(0.6), "triples=0/1");
    }

    #[test]
    fn combinations_are_the_same_each_time_and_lie_on_one_path() {
        let catalogue = Catalogue::known().unwrap();
        let names: Vec<&str> = catalogue.mistakes.iter().map(|m| m.name.as_str()).collect();
        let triples = || drawn(&catalogue, &names, 3, 500, &|_| true);
        let all: Vec<String> = triples().iter().map(Subject::name).collect();
        assert_eq!(all, triples().iter().map(Subject::name).collect::<Vec<_>>());
        assert_eq!((all.len(), all.iter().collect::<BTreeSet<_>>().len()), (500, 500));
        assert!(triples().iter().all(|triple| triple.paths().len() == 1));
        let pairs = pairs(&catalogue, &|_| true);
        assert!((200..800).contains(&pairs.len()), "{}", pairs.len());
    }
}
