//! How close right renders come to the thresholds: 2,000 seeds of the reference on every film, at four numbers of
//! samples. No rule may use half of what it allows, so that chance rejects no right renderer in a career of grading.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use basecode::Image;
use umbra::assignment::{Assignment, SceneEntry};
use umbra::evidence::CheckId;
use umbra::evidence::Witness;
use umbra::evidence::loops::judge_agreement;
use umbra::expected::{Expected, SurfaceBuffer};
use umbra::files::library_name;
use umbra::grading::{CORRELATED, row_correlation};
use umbra::imaging::compare::compare_offline;
use umbra::imaging::reference::ReferenceImage;
use umbra::process::ProcessLimits;
use umbra::store::Store;
use umbra::worker::{Job, Outcome, RayQuery, Request, SceneRef, Supervisor};

/// Scenes with shadow edges and dark corners, a highlight, steep lobes, a colored light.
const SCENES: [&str; 4] = ["cbox", "sphere_phong", "exponents", "coloured"];
/// Their film: regions are as small, and so as noisy, as they get.
const FILM: [u32; 2] = [48, 36];
/// Seeds of each scene.
const SEEDS: usize = 2000;
/// Samples per pixel of the seeds, in turn.
const SPP: [u32; 20] = [1, 4, 16, 4, 16, 4, 16, 4, 16, 4, 16, 4, 16, 4, 16, 4, 64, 4, 16, 4];
/// Student ids lie further apart than a film has rows.
const STRIDE: u64 = 1009;
/// Images asked of one worker.
const PER_JOB: usize = 100;
/// The part of a threshold that a right renderer may use.
const HALF: f64 = 0.5;

/// For every rule the largest part of its threshold that was used, where, and how often it was asked.
#[derive(Default)]
struct Used(BTreeMap<String, (f64, String, usize)>);

impl Used {
    /// Takes in one answer; a rule that allows nothing is used up by anything.
    fn add(&mut self, rule: &str, value: f64, bound: f64, place: &dyn Fn() -> String) {
        let used = if bound > 0.0 { value.abs() / bound } else { value.abs() };
        let (worst, worst_place, count) =
            self.0.entry(rule.to_owned()).or_insert((-1.0, String::new(), 0));
        *count += 1;
        if used > *worst {
            (*worst, *worst_place) = (used, place());
        }
    }
}

#[test]
#[ignore = "half a minute: `./run test` asks for it"]
fn two_thousand_seeds_stay_under_half_of_every_threshold() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let assignment = Assignment::load(root).unwrap();
    let reference = root.join("target/release").join(library_name("reference_impl"));
    assert!(reference.is_file(), "run `cargo build --release --workspace` first");
    let scratch = tempfile::tempdir().unwrap();
    let supervisor =
        Supervisor::available(env!("CARGO_BIN_EXE_umbra").into(), scratch.path().into());
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let store = Store {
        assignment: &assignment,
        reference: Some(reference.clone()),
        supervisor: &supervisor,
        threads: cores as u32,
        progress: &|_| (),
    };
    let bench = Bench { assignment: &assignment, supervisor: &supervisor, reference };
    let used = Mutex::new(Used::default());
    for name in SCENES {
        let entry = assignment.scenes.iter().find(|entry| entry.name == name).unwrap();
        let entry = SceneEntry { film: Some(FILM), ..entry.clone() };
        let expected = store.expected(&entry).unwrap();
        let toml = root.join(&entry.offline);
        let next = AtomicUsize::new(0);
        let work = || {
            loop {
                let first = next.fetch_add(PER_JOB, Ordering::Relaxed);
                if first >= SEEDS {
                    return;
                }
                let numbers = first..(first + PER_JOB).min(SEEDS);
                bench.judge_images(name, &toml, &expected, numbers, &used);
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..cores {
                scope.spawn(work);
            }
        });
        bench.judge_loop(name, &toml, &expected, &mut used.lock().unwrap());
    }
    bench.judge_rows(&root.join(&assignment.sampler_scene), &mut used.lock().unwrap());

    let Used(used) = used.into_inner().unwrap();
    for (rule, (used, place, count)) in &used {
        println!("{rule:<24} {:5.1} % of what it allows, of {count}: {place}", 100.0 * used);
    }
    let rules = ["non_finite", "negative", "interior", "blob", "edge", "bias"];
    for rule in rules.into_iter().chain([
        "centre: interior",
        "origin: bias",
        CheckId::LoopAgreement.name(),
        CheckId::SamplerRows.name(),
    ]) {
        assert!(used.contains_key(rule), "{rule} was never asked");
    }
    let over: Vec<_> = used.iter().filter(|(_, (used, ..))| *used >= HALF).collect();
    assert!(over.is_empty(), "right renders use half of a threshold or more: {over:#?}");
}

struct Bench<'a> {
    assignment: &'a Assignment,
    supervisor: &'a Supervisor,
    reference: PathBuf,
}

impl Bench<'_> {
    /// Renders seeds of one scene; judges each image, and each beside the last of the same spp as
    /// what was submitted is judged beside what the code draws.
    fn judge_images(
        &self,
        scene: &str,
        toml: &Path,
        expected: &Expected,
        numbers: Range<usize>,
        used: &Mutex<Used>,
    ) {
        let tolerances = &self.assignment.tolerances;
        let requests = numbers.clone().map(|number| {
            self.render(toml, FILM, SPP[number % SPP.len()], 260_000_000 + STRIDE * number as u64)
        });
        let images = self.ask(requests.collect());
        let mut last: BTreeMap<u32, Image> = BTreeMap::new();
        for (number, values) in numbers.zip(images) {
            let spp = SPP[number % SPP.len()];
            let image = image(&values, FILM);
            let add = |before: &str, reference: &ReferenceImage| {
                let found = compare_offline(&image, reference, spp, tolerances).unwrap();
                let place = |said: &str| format!("{scene}, {spp} spp, seed {number}: {said}");
                let mut used = used.lock().unwrap();
                for check in found.checks.iter().filter(|check| !check.id.starts_with("bias")) {
                    let rule = format!("{before}{}", check.id);
                    used.add(&rule, check.value, check.bound, &|| place(&check.detail));
                }
                let judged = |pixels: u32| pixels >= tolerances.min_region_pixels;
                for region in found.regions.iter().filter(|region| judged(region.pixels)) {
                    let place = || place(&format!("{}, {} pixels", region.region, region.pixels));
                    used.add(&format!("{before}bias"), region.bias, region.bound, &place);
                }
            };
            add(if spp == 1 { "centre: " } else { "" }, &expected.offline);
            if let Some(mean) = last.remove(&spp).filter(|_| spp > 1) {
                add("origin: ", &ReferenceImage { mean, n: spp, ..expected.offline.clone() });
            }
            last.insert(spp, image);
        }
    }

    /// The image at 1 spp against radiance along the pixels' center rays.
    fn judge_loop(&self, scene: &str, toml: &Path, expected: &Expected, used: &mut Used) {
        let [width, height] = FILM;
        let surface = SurfaceBuffer::new(&expected.scene, width as usize, height as usize).unwrap();
        let ray = |ray: &basecode::Ray| RayQuery {
            origin: ray.origin.into(),
            min_t: ray.min_t,
            direction: ray.direction.into(),
            max_t: ray.max_t,
        };
        let along = Request::Radiance {
            scene: SceneRef { path: toml.to_owned(), options: String::new() },
            rays: surface.pixels.iter().map(|(center, _)| ray(center)).collect(),
            shadows: true,
            witness: Witness::True,
            seed: 1,
        };
        let [drawn, along] =
            self.ask(vec![self.render(toml, FILM, 1, 1), along]).try_into().unwrap();
        let (drawn, along) = (drawn.as_chunks::<3>().0, along.as_chunks::<3>().0);
        let check = judge_agreement(scene, &expected.offline.mask, drawn, along);
        for measure in &check.measures {
            used.add(check.id.name(), measure.value, measure.bound, &|| measure.name.clone());
        }
    }

    /// The correlation of the noise in neighboring rows.
    fn judge_rows(&self, toml: &Path, used: &mut Used) {
        let config = basecode::scene::SceneConfig::load(toml).unwrap();
        let film = [config.width as u32, config.height as u32];
        let seeds = 0..64u64;
        let requests = seeds.map(|seed| self.render(toml, film, 4, STRIDE * seed)).collect();
        for (number, pair) in self.ask(requests).windows(2).enumerate() {
            let correlation = row_correlation(&pair[0], &pair[1], 3 * film[0] as usize);
            let place = || format!("seeds {number} and {}", number + 1);
            used.add(CheckId::SamplerRows.name(), correlation, CORRELATED, &place);
        }
    }

    fn render(&self, toml: &Path, [width, height]: [u32; 2], spp: u32, seed: u64) -> Request {
        Request::RenderOffline {
            scene: SceneRef { path: toml.to_owned(), options: String::new() },
            width,
            height,
            spp,
            seed,
            threads: 1,
            shadows: true,
        }
    }

    fn ask(&self, requests: Vec<Request>) -> Vec<Vec<f32>> {
        let job = Job { plugin: Some(self.reference.clone()), requests };
        let limits = ProcessLimits { wall_s: 300.0, cpu_s: 600, ..ProcessLimits::default() };
        let cancel = AtomicBool::new(false);
        let report = self.supervisor.run_job(&job, &limits, &cancel, &mut |_| ());
        let answers = report.outcomes.into_iter().map(|outcome| match outcome {
            Outcome::Done(answer) => answer.values,
            other => panic!("the reference answers {other:?}"),
        });
        answers.collect()
    }
}

fn image(values: &[f32], [width, height]: [u32; 2]) -> Image {
    let pixels = values.as_chunks::<3>().0.iter().map(|&v| v.into()).collect();
    Image { width: width as usize, height: height as usize, pixels }
}
