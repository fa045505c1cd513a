//! A hundred small mistakes that the catalogue lacks, each with its label: term, quantity, value.
//! Their answers are computed here from closed forms; what is said of them is counted.

#[path = "labeled/answers.rs"]
mod answers;

use answers::{Answers, Labeled, Probe, labeled};
use basecode::{Camera, CameraConfig, Vec3};
use umbra::diagnosis::fit::{
    Accuracy, Bound, Deviation, Fitted, Reflector, Sample, ShadowRay, Subject, Value, VertexSeen,
    explain, explain_pass, explain_shadows, explain_vertex,
};
use umbra::diagnosis::{Stored, Thumbnail, View};

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
    let all = labeled();
    assert_eq!(all.len(), 100);
    for (index, mistake) in all.iter().enumerate() {
        assert!(all[..index].iter().all(|other| other.name != mistake.name), "{}", mistake.name);
        assert!(!mistake.changes.is_empty(), "{}", mistake.name);
        let right = Labeled { changes: Vec::new(), ..mistake.clone() };
        assert!(differ(&mistake.answers(), &right.answers()), "{} changes nothing", mistake.name);
    }
    let none = all.iter().filter(|mistake| !mistake.label).count();
    assert!(none >= 10, "nothing is right of {none} only");
}

#[test]
fn right_answers_are_those_of_the_checks() {
    use umbra::evidence::bsdf::{BsdfKind, probes};
    for (part, kind) in [("1.1", BsdfKind::Diffuse), ("1.2", BsdfKind::Phong)] {
        let first = labeled().into_iter().find(|mistake| mistake.part == part).unwrap();
        let right = Labeled { changes: Vec::new(), ..first };
        for (probe, found) in probes(kind).iter().zip(right.answers().values()) {
            for (expected, found) in probe.expected.iter().zip(found) {
                assert!((expected - found).abs() < 1e-6 * (1e-3 + expected), "{probe:?}: {found}");
            }
        }
    }
}

/// The stored answer of a catalogue entry that a labelled mistake of a BSDF equals, if any.
fn in_the_catalogue(stored: &Stored, mistake: &Labeled) -> Option<String> {
    let view = match mistake.part.as_str() {
        "1.1" => View::named("diffuse")?,
        "1.2" => View::named("phong")?,
        _ => return None,
    };
    let values: Vec<[f32; 3]> =
        mistake.answers().values().iter().map(|v| v.map(|v| v as f32)).collect();
    let (tile, stored) = (Thumbnail::of_list(&values), stored.views.get(&view)?);
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
    let known: Vec<String> = labeled()
        .iter()
        .filter_map(|mistake| {
            Some(format!("{}: {}", mistake.name, in_the_catalogue(&stored, mistake)?))
        })
        .collect();
    assert!(known.is_empty(), "{known:?}");
}

/// A point that was shaded, as the fit takes it.
fn sample(probe: &Probe, found: [f64; 3]) -> Sample {
    let reflector = match probe.witness {
        Some(witness) => Reflector::Witness(witness),
        None => Reflector::Surface {
            phong: probe.phong,
            diffuse: probe.kd,
            specular: probe.ks,
            exponent: probe.n,
            unscaled: probe.scales,
        },
    };
    let Probe { wo, wi, r: distance, intensity, .. } = *probe;
    // Answers are f32.
    Sample { reflector, wo, wi, distance, intensity, found: found.map(|v| f64::from(v as f32)) }
}

/// What is said of values that a part shades.
fn said_of_shading(part: &str, samples: &[Sample]) -> Option<Fitted> {
    let (subject, accuracy) = match part {
        "1.1" | "1.2" => (Subject::Bsdf, Accuracy { relative: 1e-3, stray: 2e-3 }),
        "1.3" => (Subject::Radiance, Accuracy { relative: 5e-3, stray: 5e-3 }),
        _ => (Subject::Color, Accuracy { relative: 1e-2, stray: 2e-2 }),
    };
    explain(samples, subject, accuracy)
}

/// What is said of a mistake's answers.
fn said(mistake: &Labeled) -> Option<Fitted> {
    match mistake.answers() {
        Answers::Shading(all) => {
            let samples = all.iter().map(|(probe, found)| sample(probe, *found));
            said_of_shading(&mistake.part, &samples.collect::<Vec<_>>())
        }
        Answers::Shadows(all) => {
            let ray = |(ray, found): &(answers::ShadowRay, f64)| ShadowRay {
                distance: ray.r,
                occluders: ray.occluders.clone(),
                found: *found,
            };
            explain_shadows(&all.iter().map(ray).collect::<Vec<_>>())
        }
        Answers::Pass(all) => {
            let bound = |(bound, found): &(answers::Bound, Vec3)| {
                let answers::Bound { uniform, scene, object, expected, scale } = *bound;
                let scene = scene.to_string();
                Bound { uniform, scene, object, expected, found: *found, scale }
            };
            explain_pass(&all.iter().map(bound).collect::<Vec<_>>())
        }
        Answers::Vertex(all) => {
            let config = CameraConfig {
                eye: Vec3::new(1.0, 2.0, 5.0),
                at: Vec3::ZERO,
                up: Vec3::Y,
                fov_y_deg: 40.0,
            };
            let camera = Camera::new(config, 40, 30).unwrap();
            let seen = |(pixel, position, normal, at): &(answers::Pixel, Vec3, Vec3, [f64; 2])| {
                VertexSeen {
                    position: pixel.position,
                    normal: pixel.normal,
                    found_position: *position,
                    found_normal: *normal,
                    at: *at,
                    belongs: pixel.ndc,
                    view: camera.view(),
                    projection: camera.projection(),
                }
            };
            explain_vertex(&all.iter().map(seen).collect::<Vec<_>>())
        }
    }
}

/// Whether what is said is the label.
fn is_label(mistake: &Labeled, deviations: &[Deviation]) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= 0.01 * (1.0 + b.abs());
    let same = |deviation: &Deviation| {
        mistake.changes.iter().any(|change| {
            let value = match (&deviation.value, &change.value) {
                (Value::Number(found), _) => change.value.as_f64().is_some_and(|v| near(*found, v)),
                (Value::Three(found), _) => {
                    let list = change.value.as_array();
                    list.is_some_and(|list| {
                        found.iter().zip(list).all(|(a, b)| near(*a, b.as_f64().unwrap()))
                    })
                }
                (Value::Form(found), _) => change.value.as_str() == Some(found),
            };
            value && deviation.of.name() == change.term && deviation.quantity == change.quantity
        })
    };
    mistake.label && deviations.len() == mistake.changes.len() && deviations.iter().all(same)
}

#[test]
fn most_labels_are_found_and_no_other_is_said() {
    let (mut right, mut silent, mut wrong) = (0, Vec::new(), Vec::new());
    for mistake in labeled() {
        let begin = std::time::Instant::now();
        match said(&mistake) {
            None if mistake.label => silent.push(mistake.name),
            None => {}
            Some(fitted) if is_label(&mistake, &fitted.deviations) => {
                right += 1;
                let words: Vec<&str> = fitted.deviations.iter().map(|d| &*d.words).collect();
                println!("{}: {} ({:?})", mistake.name, words.join("; and "), begin.elapsed());
            }
            Some(fitted) => wrong.push(format!("{}: {fitted:?}", mistake.name)),
        }
    }
    println!("{right} of 100 get their label, {} another\nsilent: {silent:#?}", wrong.len());
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(right >= 60, "{right}");
}

#[test]
fn of_two_at_once_nothing_else_is_said() {
    let all = labeled();
    let (mut both, mut silent, mut wrong) = (0, 0, Vec::new());
    for part in ["1.1", "1.2", "1.3", "2.3", "2.4"] {
        let own: Vec<&Labeled> =
            all.iter().filter(|m| m.part == part && m.changes.len() == 1).collect();
        // Some of all pairs, always the same.
        let pairs =
            own.iter().enumerate().flat_map(|(i, a)| own[..i].iter().map(move |b| (*a, *b)));
        for (a, b) in pairs.step_by(7) {
            let (one, other) = (&a.changes[0], &b.changes[0]);
            // Two of a kind are one: n + 2 in exponent and normalization, a factor and 1/pi.
            let kind = |quantity: &str| match quantity {
                "pi" | "factor" | "channels" => "constant".to_owned(),
                other => other.split('_').next().unwrap().replace("normalisation", "exponent"),
            };
            if kind(&one.quantity) == kind(&other.quantity) {
                continue;
            }
            let changes = vec![one.clone(), other.clone()];
            let name = format!("{} + {}", a.name, b.name);
            let mistake = Labeled { name, changes, label: a.label && b.label, ..a.clone() };
            match said(&mistake) {
                None => silent += 1,
                Some(fitted) if is_label(&mistake, &fitted.deviations) => both += 1,
                Some(fitted) => wrong.push(format!("{}: {fitted:?}", mistake.name)),
            }
        }
    }
    println!("{both} pairs are told, {silent} are not, {} are told another", wrong.len());
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(both >= silent / 4, "{both} of {}", both + silent);
}

#[test]
fn a_missing_intensity_is_told_alone_and_beside_the_falloff() {
    for part in ["1.3", "2.3", "2.4"] {
        let of_part = labeled().into_iter().find(|mistake| mistake.part == part).unwrap();
        let right = Labeled { changes: Vec::new(), ..of_part };
        let Answers::Shading(all) = right.answers() else { panic!("{part} shades nothing") };
        for power in [0, 2] {
            let found = |probe: &Probe, found: &[f64; 3]| {
                std::array::from_fn(|c| found[c] * probe.r.powi(power) / probe.intensity[c])
            };
            let samples: Vec<Sample> =
                all.iter().map(|(probe, value)| sample(probe, found(probe, value))).collect();
            let said = said_of_shading(part, &samples).map(|fitted| fitted.deviations);
            let told: Vec<_> = said.iter().flatten().map(|deviation| deviation.quantity).collect();
            let expected: &[_] = if power == 0 { &["intensity"] } else { &["r", "intensity"] };
            assert_eq!(told, expected, "{part}, r to {power}: {said:?}");
        }
    }
}
