use std::collections::BTreeSet;

use basecode::{Renderer, SurfaceInteraction, Vec2, Vec3, vec3};

use super::*;
use crate::Reference;
use crate::renderpasses::{DIFFUSE_FS, PHONG_FS, SIMPLE_VS};

#[test]
fn the_catalogue_and_the_switches_have_the_same_names() {
    let catalogue: serde_json::Value =
        serde_json::from_str(include_str!("../../../harness/data/mistakes.json")).unwrap();
    let listed = |list: &str| -> BTreeSet<&str> {
        catalogue[list].as_array().unwrap().iter().map(|m| m["name"].as_str().unwrap()).collect()
    };
    let same = |list: &str, code: &[(Mistake, &'static str)], stages: Vec<&'static str>| {
        let count = code.len() + stages.len();
        let known: BTreeSet<&str> = code.iter().map(|(_, name)| *name).chain(stages).collect();
        assert_eq!(listed(list), known);
        assert_eq!(known.len(), count, "a name is there twice");
    };
    same("mistakes", Mistake::WRONG, stages::wrong().map(|m| m.name).collect());
    same("right", Mistake::RIGHT, stages::HARMLESS.iter().map(|m| m.name).collect());
}

#[test]
fn options_name_mistakes() {
    assert!(
        Reference::new("mistake=phong-blinn,mistake=vertex-flipped,materials=realtime").is_ok()
    );
    let error = Reference::new("mistake=none-such").err().unwrap().to_string();
    assert!(error.contains("none-such"), "{error}");
}

#[test]
fn every_mistake_of_a_shader_fits_its_text() {
    for mistake in stages::all() {
        let mut mistakes = Mistakes::default();
        mistakes.add(mistake.name).unwrap();
        let own = [SIMPLE_VS, DIFFUSE_FS, PHONG_FS];
        let changed = own.iter().filter(|stage| mistakes.text(**stage).unwrap() != stage.text);
        assert!(changed.count() > 0, "{}", mistake.name);
        let names = own.map(|stage| stage.name);
        assert!(
            mistake.changes.iter().all(|(stage, ..)| names.contains(stage)),
            "{}",
            mistake.name
        );
    }
    assert!(stages::apply("simple.vs", "", &["vertex-flipped"]).is_err());
}

/// The formulas that are written down a second time are the plain ones as long as no switch of
/// theirs is on.
#[test]
fn without_its_mistake_a_mistaken_bsdf_is_right() {
    let materials = [
        Material::diffuse(vec3(0.9, 0.5, 0.2)),
        Material::phong(vec3(0.9, 0.5, 0.2), vec3(0.4, 0.3, 0.2), 9.8),
    ];
    let plain = Reference::new("").unwrap();
    let other = Reference::new("mistake=film-gamma").unwrap();
    let up = vec3(0.0, 0.6, 0.8);
    for material in &materials {
        let (right, mistaken) = (plain.bsdf(material), other.bsdf(material));
        for wo in [up, -up, vec3(0.6, 0.0, 0.8)] {
            for wi in [up, -up, vec3(-0.6, 0.48, 0.64), vec3(-0.8, -0.6, 0.0)] {
                let point = SurfaceInteraction {
                    t: 0.0,
                    p: Vec3::ZERO,
                    uv: Vec2::ZERO,
                    ng: Vec3::Z,
                    frame_ns: basecode::Frame::from_normal(Vec3::Z),
                    wo,
                    wi,
                    shape: 0,
                    primitive: 0,
                    epsilon: basecode::Ray::EPSILON,
                };
                let (a, b) = (right.eval(&point), mistaken.eval(&point));
                assert!((a - b).abs().max_element() <= 1e-5 * a.max_element(), "{a} {b}");
            }
        }
    }
}
