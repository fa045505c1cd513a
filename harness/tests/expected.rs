//! The stored expected images against fresh, reduced renders of the reference: the same statistics,
//! not the same bytes.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use basecode::Image;
use umbra::assignment::{Assignment, SceneEntry};
use umbra::evidence::Verdict;
use umbra::evidence::images::{Kind, judge};
use umbra::expected::{Expected, Store};
use umbra::process::Limits;
use umbra::worker::{Job, Outcome, Request, SceneRef, Supervisor};

/// Samples per pixel of the reduced renders.
const SPP: u32 = 4;
/// A seed that no stored image was made with.
const SEED: u64 = 20_191_006;

#[test]
#[ignore = "half a minute: `./run test` asks for it"]
fn stored_images_agree_with_a_reduced_render_of_another_seed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let assignment = Assignment::load(root).unwrap();
    let reference = format!(
        "target/release/{}reference_impl{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    );
    let reference = root.join(reference);
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
        // On the stored film, whatever film hand-ins are judged on.
        let entry = SceneEntry { film: None, ..entry.clone() };
        let expected = store.expected(&entry).unwrap();
        let scene = SceneRef { path: root.join(&entry.offline), options: String::new() };
        let (width, height) = (expected.offline.mean.width, expected.offline.mean.height);
        let render = |spp| Request::RenderOffline {
            scene: scene.clone(),
            width: width as u32,
            height: height as u32,
            spp,
            seed: SEED,
            threads,
            shadows: true,
        };
        let job = Job { plugin: Some(reference.clone()), requests: vec![render(SPP), render(1)] };
        let limits = Limits { wall_s: 300.0, cpu_s: 600, ..Limits::default() };
        let report = supervisor.run_job(&job, &limits, &AtomicBool::new(false), &mut |_| ());
        let images = report.outcomes.into_iter().map(|outcome| match outcome {
            Outcome::Done(answer) => image(&answer.values, width, height),
            other => panic!("{}: the reference answers {other:?}", entry.name),
        });
        for (spp, image) in [SPP, 1].into_iter().zip(images) {
            let verdict = |image: &Image| verdict(&entry.name, spp, image, &expected, &assignment);
            let (accepted, said) = verdict(&image);
            assert_eq!(accepted, Verdict::Pass, "{} at {spp} spp: {said}", entry.name);
            // The same render 2 % too bright would be no reference.
            let brighter =
                Image { pixels: image.pixels.iter().map(|&p| 1.02 * p).collect(), ..image };
            assert_eq!(
                verdict(&brighter).0,
                Verdict::Fail,
                "{} at {spp} spp, brighter",
                entry.name
            );
        }
    }
    assert!(stored >= 4, "only {stored} scenes are stored");
}

fn verdict(
    name: &str,
    spp: u32,
    image: &Image,
    expected: &Expected,
    assignment: &Assignment,
) -> (Verdict, String) {
    let kind = Kind::Offline { spp };
    let check =
        judge("image.offline", name, kind, image, expected, &|_| true, &assignment.tolerances);
    (check.verdict, check.summary)
}

fn image(values: &[f32], width: usize, height: usize) -> Image {
    let pixels = values.as_chunks::<3>().0.iter().map(|&v| v.into()).collect();
    Image { width, height, pixels }
}
