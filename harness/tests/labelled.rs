//! A hundred small mistakes that the catalogue lacks, each with its label: term, quantity, value.
//! Their answers are computed here from closed forms; what is said of them is counted.

#![allow(clippy::unwrap_used)] // its helpers are tests too

#[path = "labelled/answers.rs"]
mod answers;

use answers::{Answers, Labelled, labelled};
use umbra::diagnosis::{Stored, Tile, View};

/// The least difference of two answers that counts, relatively.
const DIFFERENT: f64 = 1e-3;

/// Whether two answers differ anywhere.
fn differ(a: &Answers, b: &Answers) -> bool {
    let apart = |a: &[f64; 3], b: &[f64; 3]| {
        (0..3).any(|c| (a[c] - b[c]).abs() > DIFFERENT * (a[c].abs() + b[c].abs()))
    };
    a.values().iter().zip(b.values()).any(|(a, b)| apart(a, &b))
}

#[test]
fn a_hundred_mistakes_have_labels() {
    let all = labelled();
    assert_eq!(all.len(), 100);
    for (index, mistake) in all.iter().enumerate() {
        assert!(all[..index].iter().all(|other| other.name != mistake.name), "{}", mistake.name);
        assert!(!mistake.changes.is_empty(), "{}", mistake.name);
        let right = Labelled { changes: Vec::new(), ..mistake.clone() };
        assert!(differ(&mistake.answers(), &right.answers()), "{} changes nothing", mistake.name);
    }
    let none = all.iter().filter(|mistake| !mistake.label).count();
    assert!(none >= 10, "nothing is right of {none} only");
}

#[test]
fn right_answers_are_those_of_the_checks() {
    use umbra::evidence::bsdf::{BsdfKind, probes};
    for (part, kind) in [("1.1", BsdfKind::Diffuse), ("1.2", BsdfKind::Phong)] {
        let first = labelled().into_iter().find(|mistake| mistake.part == part).unwrap();
        let right = Labelled { changes: Vec::new(), ..first };
        for (probe, found) in probes(kind).iter().zip(right.answers().values()) {
            for (expected, found) in probe.expected.iter().zip(found) {
                assert!((expected - found).abs() < 1e-6 * (1e-3 + expected), "{probe:?}: {found}");
            }
        }
    }
}

/// The stored answer of a catalogue entry that a labelled mistake of a BSDF equals, if any.
fn in_the_catalogue(stored: &Stored, mistake: &Labelled) -> Option<String> {
    let view = match mistake.part.as_str() {
        "1.1" => View::named("diffuse")?,
        "1.2" => View::named("phong")?,
        _ => return None,
    };
    let values: Vec<[f32; 3]> =
        mistake.answers().values().iter().map(|v| v.map(|v| v as f32)).collect();
    let (tile, stored) = (Tile::of_list(&values), stored.views.get(&view)?);
    let same = |known: &&String| {
        let known = stored.mistakes[*known].values().iter().zip(tile.values());
        let mut known = known.filter(|(a, b)| a.is_finite() && b.is_finite());
        known.all(|(a, b)| (*a - *b).abs().max_element() <= 2e-3 * a.abs().max_element() + 1e-6)
    };
    stored.mistakes.keys().find(same).cloned()
}

#[test]
fn none_is_a_catalogue_entry() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let stored = Stored::load(&root.join("expected/a2/mistakes")).unwrap();
    let known: Vec<String> = labelled()
        .iter()
        .filter_map(|mistake| {
            Some(format!("{}: {}", mistake.name, in_the_catalogue(&stored, mistake)?))
        })
        .collect();
    assert!(known.is_empty(), "{known:?}");
}
