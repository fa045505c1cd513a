//! The stored expected images against fresh renders of the reference: the same statistics, not the
//! same bytes; and how small an error costs points on them.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use basecode::Image;
use umbra::assignment::{Assignment, SceneEntry};
use umbra::evidence::images::{ImageKind, judge};
use umbra::evidence::{Check, CheckId, Evidence, Verdict};
use umbra::expected::Expected;
use umbra::files::library_name;
use umbra::process::ProcessLimits;
use umbra::rubric::grade;
use umbra::store::Store;
use umbra::worker::{Job, Outcome, Request, SceneRef, Supervisor};

/// A seed that no stored image was made with.
const SEED: u64 = 20_191_006;

#[test]
#[ignore = "half a minute: `./run test` asks for it"]
fn stored_images_agree_with_a_render_of_another_seed_and_a_small_gain_costs_points() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let assignment = Assignment::load(root).unwrap();
    let reference = root.join("target/release").join(library_name("reference_impl"));
    assert!(reference.is_file(), "run `cargo build --release --workspace` first");
    let scratch = tempfile::tempdir().unwrap();
    let supervisor =
        Supervisor::available(env!("CARGO_BIN_EXE_umbra").into(), scratch.path().into());
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get() as u32);
    let store = Store {
        assignment: &assignment,
        reference: Some(reference.clone()),
        supervisor: &supervisor,
        threads,
        progress: &|_| (),
    };

    let mut stored = 0;
    for entry in assignment.scenes.iter().filter(|entry| entry.stored) {
        stored += 1;
        // On the stored film, whatever film submissions are judged on.
        let entry = SceneEntry { film: None, ..entry.clone() };
        let expected = store.expected(&entry).unwrap();
        let scene = SceneRef { path: root.join(&entry.offline), options: String::new() };
        let (width, height) = (expected.offline.mean.width, expected.offline.mean.height);
        let own_spp = expected.scene.config().spp as u32;
        let render = |spp| Request::RenderOffline {
            scene: scene.clone(),
            width: width as u32,
            height: height as u32,
            spp,
            seed: SEED,
            threads,
            shadows: true,
        };
        let job =
            Job { plugin: Some(reference.clone()), requests: vec![render(own_spp), render(1)] };
        let limits = ProcessLimits { wall_s: 300.0, cpu_s: 600, ..ProcessLimits::default() };
        let report = supervisor.run_job(&job, &limits, &AtomicBool::new(false), &mut |_| ());
        let images = report.outcomes.into_iter().map(|outcome| match outcome {
            Outcome::Done(answer) => image(&answer.values, width, height),
            other => panic!("{}: the reference answers {other:?}", entry.name),
        });
        let judged = |kind, image: &Image| judged(&entry.name, kind, image, &expected, &assignment);
        for (spp, image) in [own_spp, 1].into_iter().zip(images) {
            let kind = ImageKind::Offline { spp };
            for (gain, right) in [(1.0, true), (0.99, false), (1.01, false)] {
                let (full, said) = judged(kind, &scaled(&image, gain));
                assert_eq!(full, right, "{} at {spp} spp, gain {gain}: {said}", entry.name);
            }
        }
        for (gain, right) in [(1.0, true), (0.98, false), (1.02, false)] {
            let (full, said) = judged(ImageKind::Realtime, &scaled(&expected.unshadowed, gain));
            assert_eq!(full, right, "{} realtime, gain {gain}: {said}", entry.name);
        }
    }
    assert!(stored >= 4, "only {stored} scenes are stored");
}

/// Whether a submission earns everything when this image is like that and all other evidence is right.
fn judged(
    name: &str,
    kind: ImageKind,
    image: &Image,
    expected: &Expected,
    assignment: &Assignment,
) -> (bool, String) {
    let rules = &assignment.rules;
    let id =
        if kind == ImageKind::Realtime { CheckId::ImageRealtime } else { CheckId::ImageOffline };
    let check = judge(id, name, kind, image, expected, &|_| true, &assignment.tolerances);
    let said = check.summary.clone();
    let right = |id: &CheckId| Check::new(*id, name, Verdict::Pass, "right");
    let mut checks: Vec<Check> =
        rules.parts.iter().flat_map(|part| &part.evidence).map(right).collect();
    checks.push(check);
    let grade = grade(rules, &Evidence { checks });
    let full: f64 = rules.parts.iter().map(|part| part.points).sum();
    (grade.points == full && grade.points_max == full, said)
}

fn scaled(image: &Image, gain: f32) -> Image {
    Image { pixels: image.pixels.iter().map(|&p| gain * p).collect(), ..*image }
}

fn image(values: &[f32], width: usize, height: usize) -> Image {
    let pixels = values.as_chunks::<3>().0.iter().map(|&v| v.into()).collect();
    Image { width, height, pixels }
}
