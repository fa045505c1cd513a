//! The stored answers of known mistakes: each is told from all others, none is seen where another
//! is made that the catalogue lacks, and a fresh render of the reference gives the same.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use basecode::{Image, Vec3};
use umbra::assignment::Assignment;
use umbra::diagnosis::{
    Catalogue, Diagnosis, Input, KnownMistake, LoopSeen, Observations, Stored, StoredView, ViewKind,
};
use umbra::evidence::{Check, CheckId, Evidence, Verdict};
use umbra::files::library_name;
use umbra::grading::Grading;
use umbra::store::Store;
use umbra::worker::{Adapter, AdapterKind, Supervisor};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

fn stored() -> Stored {
    let stored = Stored::load(&root().join("expected/a2/mistakes")).unwrap();
    assert!(stored.views.len() >= 20, "only {} views are stored", stored.views.len());
    stored
}

/// The mistakes that a diagnosis names.
fn catalogue() -> Catalogue {
    let mut catalogue = Catalogue::known().unwrap();
    catalogue.mistakes.retain(|mistake| mistake.is_stored());
    catalogue
}

/// What a renderer with this mistake answers, as it is stored.
fn answers(stored: &Stored, mistake: &KnownMistake) -> Observations {
    let tile = |view: &StoredView| view.mistakes.get(&mistake.name).unwrap_or(&view.right).clone();
    let tiles = stored.views.iter().map(|(view, content)| (view.clone(), tile(content)));
    Observations { tiles: tiles.collect(), ..Default::default() }
}

/// The checks that fail: of part 1.3 those whose views show it.
fn evidence(stored: &Stored, mistake: &KnownMistake) -> Evidence {
    let seen = |kind| {
        let mut views = stored.views.iter().filter(|(view, _)| view.kind == kind);
        views.any(|(_, content)| content.mistakes.contains_key(&mistake.name))
    };
    let mut failing = mistake.findings.clone();
    if seen(ViewKind::Lit) {
        failing.push(CheckId::RadianceLit);
    } else if seen(ViewKind::Offline) {
        failing.push(CheckId::LoopAgreement);
    }
    let checks = failing.iter().map(|id| Check::new(*id, "s", Verdict::Fail, "wrong"));
    Evidence { checks: checks.collect() }
}

/// What is said of one mistake, by a catalogue that may lack it.
fn said(stored: &Stored, mistake: &KnownMistake, catalogue: &Catalogue) -> Vec<Diagnosis> {
    let input = Input {
        evidence: &evidence(stored, mistake),
        failing: &mistake.parts,
        observations: &answers(stored, mistake),
        stored,
        catalogue,
    };
    input.diagnose()
}

#[test]
fn stored_mistakes_are_told_apart() {
    let (stored, catalogue) = (stored(), catalogue());
    let mut unnamed = Vec::new();
    for mistake in &catalogue.mistakes {
        let found = said(&stored, mistake, &catalogue);
        let right = |found: &Diagnosis| {
            found.factor.is_none()
                && found.mistakes.len() == 1
                && found.mistakes[0].contains(&mistake.name)
        };
        if found.is_empty() || !found.iter().all(right) {
            unnamed.push(format!("{}: {found:#?}", mistake.name));
        }
    }
    let (of, named) = (catalogue.mistakes.len(), catalogue.mistakes.len() - unnamed.len());
    println!("{named} of {of} are named, alone\n{}", unnamed.join("\n"));
    assert!(named as f64 >= 0.95 * of as f64, "{named} of {of}");
}

#[test]
fn what_the_catalogue_lacks_is_rarely_taken_for_something_else() {
    let (stored, catalogue) = (stored(), catalogue());
    let (mut silent, mut kin, mut factors, mut strangers) = (0, 0, 0, Vec::new());
    for mistake in &catalogue.mistakes {
        let mut without = catalogue.clone();
        without
            .mistakes
            .retain(|other| other.name != mistake.name && !other.alike.contains(&mistake.name));
        let found = said(&stored, mistake, &without);
        let names = || found.iter().flat_map(|found| found.mistakes.iter().flatten());
        let of_family = |name: &String| {
            catalogue.named(name).is_some_and(|known| known.family == mistake.family)
        };
        if found.is_empty() {
            silent += 1;
        } else if names().next().is_none() {
            factors += 1;
        } else {
            let words = names().cloned().collect::<Vec<_>>().join(", ");
            let worst = found.iter().map(|found| found.unexplained).fold(0.0, f64::max);
            println!("{} is taken for {words} ({worst:.3})", mistake.name);
            if found.iter().all(|found| found.mistakes.len() == 1) && names().all(of_family) {
                kin += 1;
            } else {
                strangers.push(format!("{}: {words}", mistake.name));
            }
        }
    }
    let of = catalogue.mistakes.len();
    println!(
        "of {of}: {silent} silent, {factors} factors, {kin} kin, {} strangers",
        strangers.len()
    );
    assert!(silent + factors >= of * 9 / 10, "{silent} silent, {factors} factors, of {of}");
    assert!(kin + strangers.len() <= 3, "{kin} kin; {}", strangers.join("\n"));
}

#[test]
fn right_answers_look_like_nothing_whatever_fails() {
    let (stored, catalogue) = (stored(), catalogue());
    let nothing = catalogue.mistakes[0].clone();
    let everything = ["1.1", "1.2", "1.3", "1.4", "2.1", "2.2", "2.3", "2.4", "2.5"];
    let right = KnownMistake { name: "none".into(), ..nothing };
    let input = Input {
        evidence: &Evidence::default(),
        failing: &everything.map(str::to_owned),
        observations: &answers(&stored, &right),
        stored: &stored,
        catalogue: &catalogue,
    };
    assert_eq!(input.diagnose(), []);
}

#[test]
fn scenes_that_nothing_is_stored_of_say_nothing() {
    let (stored, catalogue) = (stored(), Catalogue::known().unwrap());
    let evidence =
        Evidence { checks: vec![Check::new(CheckId::LoopAgreement, "s", Verdict::Fail, "wrong")] };
    let rays = Image {
        width: 16,
        height: 12,
        pixels: (0..192).map(|i| Vec3::new(0.01 * i as f32, 0.3, 0.1 * (i % 16) as f32)).collect(),
    };
    let rows = rays.pixels.chunks(16).rev().flatten().copied();
    let flipped = LoopSeen { image: Image { pixels: rows.collect(), ..rays }, rays: rays.clone() };
    let names = |scene: &str| {
        let loops = [(scene.to_owned(), flipped.clone())].into();
        let input = Input {
            evidence: &evidence,
            failing: &["1.3".to_owned()],
            observations: &Observations { loops, ..Default::default() },
            stored: &stored,
            catalogue: &catalogue,
        };
        input.diagnose().into_iter().flat_map(|found| found.mistakes).collect::<Vec<_>>()
    };
    assert_eq!(names("cbox"), [["film-flipped-rows"]]);
    assert!(names("held back").is_empty());
}

#[test]
#[ignore = "some seconds: `./run test` asks for it"]
fn stored_answers_agree_with_fresh_ones() {
    let root = root();
    let mut assignment = Assignment::load(&root).unwrap();
    assignment.scenes.retain(|scene| ["scale", "coloured"].contains(&scene.name.as_str()));
    let release = root.join("target/release");
    let reference = release.join(library_name("reference_impl"));
    assert!(reference.is_file(), "run `cargo build --release --workspace` first");
    let scratch = tempfile::tempdir().unwrap();
    let supervisor =
        Supervisor::available(env!("CARGO_BIN_EXE_umbra").into(), scratch.path().into());
    let store = Store {
        assignment: &assignment,
        reference: Some(reference.clone()),
        supervisor: &supervisor,
        threads: 2,
        progress: &|_| (),
    };
    let cancel = AtomicBool::new(false);
    let adapter = Adapter { kind: AdapterKind::Software, name: String::new() };
    let grading = Grading::prepare(&store, adapter, None, &cancel).unwrap();
    let catalogue = Catalogue::known().unwrap();
    let names = [
        "diffuse-no-pi",
        "phong-n-plus-1",
        "light-grey",
        "phong-fs-unnormalised",
        "pass-rho-d-unset",
    ];
    let mistakes = names.map(|name| catalogue.named(name).unwrap());
    let fresh = grading.look_at_mistakes(&reference, &mistakes, &|_| ()).unwrap();
    let stored = stored();
    let mut compared = 0;
    for (view, fresh) in &fresh.views {
        let stored = &stored.views[view];
        assert_eq!(fresh.digest, stored.digest, "{view}: stale; hint: `umbra bless --mistakes`");
        assert!(stored.differs(&fresh.right) < 1e-3, "{view}: what is right differs");
        for (name, tile) in &fresh.mistakes {
            let stored = StoredView { right: stored.mistakes[name].clone(), ..stored.clone() };
            assert!(stored.differs(tile) < 1e-3, "{view}: {name}: {}", stored.differs(tile));
            compared += 1;
        }
    }
    assert!(compared >= 12, "only {compared} answers were compared");
}
