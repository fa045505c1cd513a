//! What grading costs, beside what it takes at least to do the same by hand: one compiler call for each submission, its
//! six images, and a comparison of each.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use anyhow::Context;
use umbra::build::{BuildOutcome, Recording, compile, default_limits};
use umbra::worker::Supervisor;

use super::Bench;
use super::child::{Cost, measure};
use super::figures::{Line, Samples, seconds};
use super::page::Curve;
use crate::samples;

/// The submitted images: their scene files below `scenes/a2`, and their names in a submission.
const IMAGES: [(&str, &str); 6] = [
    ("teapot/tinyrender/teapot_simple_offline", "offline/teapot_simple_offline"),
    ("cbox/tinyrender/cbox_simple_offline", "offline/cbox_simple_offline"),
    ("teapot/tinyrender/teapot_simple_realtime", "realtime/teapot_simple_realtime"),
    ("cbox/tinyrender/cbox_simple_realtime", "realtime/cbox_simple_realtime"),
    ("teapot/tinyrender/teapot_simple_realtime_bonus", "realtime/teapot_bonus"),
    ("cbox/tinyrender/cbox_simple_realtime_bonus", "realtime/cbox_bonus"),
];
/// The seed of the held-back scenes.
const SEED: &str = "7";

/// A right submission as a folder, edited before each run so that nothing of it is known.
struct Submission {
    folder: PathBuf,
    source: String,
    edits: usize,
}

impl Submission {
    fn new(bench: &Bench, name: &str) -> anyhow::Result<Self> {
        let archive = bench.root.join("target/umbra/samples/perfect.zip");
        let folder = bench.folder.join("submissions").join(name);
        let _ = fs::remove_dir_all(&folder);
        zip::ZipArchive::new(fs::File::open(&archive)?)?.extract(&folder)?;
        let source = fs::read_to_string(folder.join("src/lib.rs"))?;
        // A class is of different students.
        let (config, id) = (folder.join("config.json"), name.bytes().last().unwrap_or(b'0') % 10);
        let text = fs::read_to_string(&config)?.replace("260181512", &format!("26018151{id}"));
        fs::write(&config, text)?;
        Ok(Self { folder, source, edits: 0 })
    }

    /// Changes a line that changes nothing.
    fn edit(&mut self) -> anyhow::Result<()> {
        self.edits += 1;
        let now = std::time::SystemTime::UNIX_EPOCH.elapsed()?.as_nanos();
        let text = format!("{}\n// {now} {}\n", self.source, self.edits);
        Ok(fs::write(self.folder.join("src/lib.rs"), text)?)
    }
}

/// What a batch needs, done by hand or by Umbra.
struct Batch<'a> {
    bench: &'a Bench,
    recording: Recording,
    supervisor: Supervisor,
}

impl Batch<'_> {
    /// Edits a submission, and costs its compiler call, its images and their comparison.
    fn by_hand(&self, submission: &mut Submission) -> anyhow::Result<Cost> {
        submission.edit()?;
        let out = tempfile::tempdir_in(&self.bench.folder)?;
        let never = AtomicBool::new(false);
        let (src, limits) = (submission.folder.join("src"), default_limits());
        let built = compile(&self.recording, &self.supervisor, &src, out.path(), &limits, &never)?;
        let BuildOutcome::Built { library } = &built.outcome else {
            anyhow::bail!("the sample does not build: {:?}", built.outcome);
        };
        let mut sum = Cost { wall: built.wall_s, cpu: built.cpu_s, memory: 0.0 };
        for (scene, image) in IMAGES {
            let toml = self.bench.root.join("scenes/a2").join(scene).with_extension("toml");
            let drawn = out.path().join("image.exr");
            let submitted = submission.folder.join(image).with_extension("exr");
            let render = [Path::new("render"), &toml, Path::new("--plugin"), library];
            let render = [&*self.bench.umbra].into_iter().chain(render);
            let mut costs = vec![measure(render.chain([Path::new("--output"), &drawn]))?];
            if submitted.exists() {
                costs.push(measure([Path::new("idiff"), &drawn, &submitted])?);
            }
            anyhow::ensure!(drawn.exists(), "{} was not drawn", toml.display());
            for cost in costs {
                sum.wall += cost.wall;
                sum.cpu += cost.cpu;
            }
        }
        Ok(sum)
    }

    fn graded(&self, folder: &Path, held_back_seed: &str) -> anyhow::Result<Cost> {
        let output = self.bench.folder.join("report");
        let held_back_seed = format!("--held-back={held_back_seed}");
        let line = [&*self.bench.umbra, Path::new("grade"), folder, Path::new(&held_back_seed)];
        let rest = [Path::new("--isolation=reduced"), Path::new("--output"), &output];
        let _ = fs::remove_dir_all(&output);
        let cost = measure(line.into_iter().chain(rest))?;
        anyhow::ensure!(output.join("report.json").exists(), "nothing was graded");
        Ok(cost)
    }

    fn checked(&self, folder: &Path) -> anyhow::Result<Cost> {
        let output = self.bench.folder.join("check");
        measure([&*self.bench.umbra, Path::new("check"), folder, Path::new("--output"), &output])
    }

    /// What one submission costs, by the ways to grade and to check it.
    fn one(&self) -> anyhow::Result<Vec<Line>> {
        let mut one = Submission::new(self.bench, "one")?;
        // What is made once per batch is there before anything counts.
        self.graded(&one.folder, SEED)?;
        let [mut hand, mut again, mut edited, mut public, mut all] = <[Samples; 5]>::default();
        for _ in 0..self.bench.rounds.min(3) {
            hand.push(self.by_hand(&mut one)?.cpu);
            for (held_back_seed, samples) in [("off", &mut public), (SEED, &mut all)] {
                one.edit()?;
                samples.push(self.graded(&one.folder, held_back_seed)?.cpu);
            }
            one.edit()?;
            edited.push(self.checked(&one.folder)?.wall);
            again.push(self.checked(&one.folder)?.wall);
        }
        let begin = Instant::now();
        self.graded(&self.bench.root.join("target/umbra/samples/hangs.zip"), "off")?;
        let hangs = begin.elapsed().as_secs_f64();
        let anchor = "rustc, six images, idiff";
        let alone = |work: &str, ours: f64| Line {
            work: work.to_owned(),
            anchor: String::new(),
            theirs: String::new(),
            ours: seconds(ours),
            ratio: String::new(),
        };
        Ok(vec![
            Line::of_times("a right submission, public scenes, CPU".into(), anchor, &hand, &public),
            Line::of_times("the same with held-back scenes, CPU".into(), anchor, &hand, &all),
            alone("edit one line, then `check`, wall", edited.median()),
            alone("`check` without an edit, wall", again.median()),
            alone("the sample `hangs`, wall", hangs),
        ])
    }

    /// CPU time against the number of submissions.
    fn growth(&self) -> anyhow::Result<Vec<Curve>> {
        let mut curves = ["Umbra", "Umbra, with held-back scenes", "by hand"].map(Curve::new);
        for count in [1, 2, 4] {
            let class = self.bench.folder.join("submissions/class");
            let _ = fs::remove_dir_all(&class);
            let mut several = Vec::new();
            for index in 0..count {
                several.push(Submission::new(self.bench, &format!("class/{index}"))?);
            }
            for (curve, held_back_seed) in [(0, "off"), (1, SEED)] {
                several.iter_mut().try_for_each(Submission::edit)?;
                curves[curve].push(f64::from(count), self.graded(&class, held_back_seed)?.cpu);
            }
            let cpu = several.iter_mut().map(|one| Ok(self.by_hand(one)?.cpu));
            let cpu: Vec<f64> = cpu.collect::<anyhow::Result<_>>().context("by hand")?;
            curves[2].push(f64::from(count), cpu.iter().sum());
        }
        Ok(curves.into())
    }
}

/// The table's rows, and how a batch grows.
///
/// # Errors
/// When a sample cannot be packed, built or graded.
pub fn run(bench: &Bench) -> anyhow::Result<(Vec<Line>, Vec<Curve>)> {
    samples::pack(&bench.root, &|name, _| ["perfect", "hangs"].contains(&name))?;
    let recording = Recording::obtain(&bench.root, &bench.umbra)?;
    let scratch = tempfile::tempdir()?;
    let supervisor = Supervisor::new(bench.umbra.clone(), scratch.path().to_owned());
    let batch = Batch { bench, recording, supervisor };
    Ok((batch.one()?, batch.growth()?))
}
