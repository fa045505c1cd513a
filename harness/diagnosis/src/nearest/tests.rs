use proptest::prelude::*;

use super::super::thumbnail::LENGTH;
use super::*;

/// Right answers, and three mistakes: a factor on one half, another on the other, a slope.
struct World {
    right: Thumbnail,
    mistakes: BTreeMap<String, Thumbnail>,
}

impl World {
    fn new() -> Self {
        let right: Vec<[f32; 3]> = (0..LENGTH).map(|i| [1.0 + (i % 7) as f32, 0.5, 2.0]).collect();
        let right = Thumbnail::of_list(&right);
        let spoilt = |f: &dyn Fn(usize) -> f32| {
            let values = right.values().iter().enumerate();
            let values: Vec<[f32; 3]> = values.map(|(i, v)| (f(i) * *v).into()).collect();
            Thumbnail::of_list(&values)
        };
        let mistakes = [
            ("top", spoilt(&|i| if i < LENGTH / 2 { 3.0 } else { 1.0 })),
            ("bottom", spoilt(&|i| if i < LENGTH / 2 { 1.0 } else { 0.5 })),
            ("slope", spoilt(&|i| 1.0 + i as f32 / 500.0)),
        ];
        Self { right, mistakes: mistakes.map(|(name, tile)| (name.to_owned(), tile)).into() }
    }

    fn guess(&self, seen: &Thumbnail, names: &[&str]) -> Option<Nearest> {
        nearest(&[self.exhibit(seen)], names)
    }

    fn exhibit<'a>(&'a self, seen: &'a Thumbnail) -> Comparison<'a> {
        let counts = vec![true; LENGTH];
        Comparison { seen, right: &self.right, mistakes: &self.mistakes, counts }
    }
}

const NAMES: [&str; 3] = ["top", "bottom", "slope"];

#[test]
fn each_mistake_is_itself_and_right_is_nothing() {
    let world = World::new();
    for name in NAMES {
        let found = world.guess(&world.mistakes[name], &NAMES).unwrap();
        assert_eq!(found.guess, Hypothesis::One(name.to_owned()));
        assert_eq!(found.distance, 0.0);
        assert!(found.runner_up > 0.3, "{found:?}");
    }
    assert_eq!(world.guess(&world.right, &NAMES), None);
    let noisy = world.right.map(|value| 1.001 * value);
    assert_eq!(world.guess(&noisy, &NAMES), None);
}

#[test]
fn what_is_like_no_mistake_is_not_named() {
    let world = World::new();
    for name in NAMES {
        let others: Vec<&str> = NAMES.into_iter().filter(|other| *other != name).collect();
        assert_eq!(world.guess(&world.mistakes[name], &others), None, "{name}");
    }
    // Half way between two.
    let [top, slope] = [&world.mistakes["top"], &world.mistakes["slope"]];
    let between = world.right.combine(top, slope, |_, a, b| 0.5 * (a + b));
    assert_eq!(world.guess(&between, &NAMES), None);
    // Two names for one thing: neither is clearly nearer.
    let mut world = world;
    world.mistakes.insert("twin".into(), world.mistakes["top"].clone());
    assert_eq!(world.guess(&world.mistakes["top"].clone(), &["top", "twin", "slope"]), None);
}

#[test]
fn factors_and_pairs_are_found() {
    let world = World::new();
    let brighter = world.right.map(|value| std::f32::consts::PI * value);
    let found = world.guess(&brighter, &NAMES).unwrap();
    assert!(
        matches!(found.guess, Hypothesis::Factor(f) if (f - std::f32::consts::PI).abs() < 1e-3),
        "{found:?}"
    );
    let [top, bottom] = [&world.mistakes["top"], &world.mistakes["bottom"]];
    let both = world.right.combine(top, bottom, |right, a, b| a * b / right);
    let found = world.guess(&both, &NAMES).unwrap();
    assert_eq!(found.guess, Hypothesis::Two("top".into(), "bottom".into()));
    let scaled = world.mistakes["slope"].map(|value| 0.1 * value);
    let found = world.guess(&scaled, &NAMES).unwrap();
    assert!(
        matches!(&found.guess, Hypothesis::Scaled(name, f) if name == "slope" && (f - 0.1).abs() < 1e-3),
        "{found:?}"
    );
}

#[test]
fn values_that_do_not_count_or_were_not_asked_change_nothing() {
    let world = World::new();
    let seen = &world.mistakes["top"];
    let holes =
        Thumbnail::of_list(&seen.values().iter().map(|v| (*v).into()).collect::<Vec<_>>()[..500]);
    assert_eq!(world.guess(&holes, &NAMES).unwrap().guess, Hypothesis::One("top".into()));
    let mut exhibit = Comparison {
        seen,
        right: &world.right,
        mistakes: &world.mistakes,
        counts: (0..LENGTH).map(|i| i >= LENGTH / 2).collect(),
    };
    assert_eq!(nearest(&[exhibit], &NAMES), None, "the half that counts is right");
    exhibit = Comparison {
        seen,
        right: &world.right,
        mistakes: &world.mistakes,
        counts: vec![false; LENGTH],
    };
    assert_eq!(nearest(&[exhibit], &NAMES), None);
    assert_eq!(nearest(&[], &NAMES), None);
}

#[test]
fn what_is_not_finite_is_only_like_itself() {
    let mut world = World::new();
    let broken = world.right.map(|value| if value.x > 5.0 { Vec3::INFINITY } else { value });
    assert_eq!(world.guess(&broken, &NAMES), None);
    world.mistakes.insert("broken".into(), broken.clone());
    let names = ["broken", "top", "bottom", "slope"];
    assert_eq!(world.guess(&broken, &names).unwrap().guess, Hypothesis::One("broken".into()));
}

proptest! {
    /// Units do not matter, nor the order of views or names; a little noise neither.
    #[test]
    fn scale_and_order_do_not_matter(
        which in 0..NAMES.len(),
        scale in 0.01f32..100.0,
        noise in 0.0f32..5e-3,
        shift in 0..3usize,
    ) {
        let world = World::new();
        let name = NAMES[which];
        let plain = world.guess(&world.mistakes[name], &NAMES).unwrap();
        let scaled = World {
            right: world.right.map(|value| scale * value),
            mistakes: world
                .mistakes
                .iter()
                .map(|(name, tile)| (name.clone(), tile.map(|value| scale * value)))
                .collect(),
        };
        let seen = scaled.mistakes[name].map(|value| value * (1.0 + noise * value.x.sin()));
        let mut names = NAMES;
        names.rotate_left(shift);
        let found = scaled.guess(&seen, &names).unwrap();
        prop_assert_eq!(&found.guess, &plain.guess);
        prop_assert!(found.distance < 0.02);

        // Two views of one mistake, one of them darker; and one that shows the mistake beside one
        // that is right, which is like no mistake.
        let (shown, darker) = (&world.mistakes[name], &scaled.mistakes[name]);
        let both = || [world.exhibit(shown), scaled.exhibit(darker)];
        let [one, other] = [both(), both()].map(|comparisons| nearest(&comparisons, &names));
        let mut turned = both();
        turned.reverse();
        let turned = nearest(&turned, &NAMES);
        prop_assert_eq!(&one, &other);
        prop_assert_eq!(one.map(|found| found.guess), turned.map(|found| found.guess));
        let mut torn = [world.exhibit(shown), world.exhibit(&world.right)];
        prop_assert_eq!(nearest(&torn, &NAMES), None);
        torn.reverse();
        prop_assert_eq!(nearest(&torn, &names), None);
    }
}
