//! The realtime path: images drawn by a plugin, and where one is wrong, pass and stages apart.

use std::path::Path;

use basecode::Image;

use super::ask::{self, Asker};
use super::case::Case;
use super::offline::Drawn;
use crate::evidence::images::{self, Kind};
use crate::evidence::stages::{
    BoundValue, SHOW_NORMAL, SHOW_NOTHING, SHOW_POSITION, VERTEX, is_template, judge_pass, judge_vertex,
};
use crate::evidence::{Check, Verdict};
use crate::imaging::evidence::Tolerances;
use crate::imaging::reference::{Region, RegionMask};
use crate::worker::{Outcome, Request, Stage};

/// The stage texts of a hand-in, and of the template.
pub struct Stages {
    /// `simple.vs`, `diffuse.fs`, `phong.fs` of the hand-in; absent where the file is.
    pub own: [Option<String>; 3],
    /// The same of the template.
    pub template: [String; 3],
}

/// The names of the stages, in order.
const NAMES: [&str; 3] = ["simple.vs", "diffuse.fs", "phong.fs"];

impl Stages {
    /// Reads the stages below a hand-in's and the template's `src` folder. A file that is no text
    /// counts as absent.
    pub fn read(src: &Path, template: &Path) -> Self {
        let stage = |src: &Path, name| std::fs::read_to_string(src.join(format!("shaders/{name}.wgsl")));
        Self {
            own: NAMES.map(|name| stage(src, name).ok()),
            template: NAMES.map(|name| stage(template, name).unwrap_or_default()),
        }
    }

    fn is_template(&self, index: usize) -> bool {
        self.own[index].as_ref().is_some_and(|own| is_template(own, &self.template[index]))
    }
}

type View = (&'static str, &'static dyn Fn(&Region) -> bool);

/// The image as a whole, and by material.
const VIEWS: [View; 3] = [
    ("image.realtime", &|_| true),
    ("image.realtime.diffuse", &|region| region.exponent == 0.0),
    ("image.realtime.phong", &|region| region.exponent > 0.0),
];

/// Draws every scene with the plugin and judges the images, those of the bonus too.
pub fn judge_images(
    asker: &Asker,
    plugin: &Path,
    case: &Case,
    tolerances: &Tolerances,
) -> (Vec<Check>, Vec<Drawn>) {
    let name = &case.entry.name;
    let (width, height) = case.film();
    let mut asked = vec![(Kind::Realtime, &case.realtime, "image.realtime")];
    if let Some(bonus) = &case.bonus {
        asked.push((Kind::RealtimeShadows, bonus, "bonus.image"));
    }
    let (mut checks, mut drawn) = (Vec::new(), Vec::new());
    // One worker for each image: the bonus may crash without a trace on the other.
    for (kind, toml, id) in asked {
        let outcome = draw(asker, Some(plugin), case, toml, (width, height), kind == Kind::RealtimeShadows, &[]);
        let parts = ["2.1", "2.2", "2.3", "2.4", "2.5"];
        let Outcome::Done(answer) = &outcome else {
            checks.push(ask::unanswered(id, name, &parts, &outcome));
            continue;
        };
        let image = ask::image(&answer.values, width, height);
        if kind == Kind::Realtime {
            for (id, wanted) in VIEWS {
                checks.push(images::judge(id, name, kind, &image, &case.expected, wanted, tolerances));
            }
            checks.push(judge_coverage(case, &image));
        } else {
            checks.push(images::judge(id, name, kind, &image, &case.expected, &|_| true, tolerances));
        }
        drawn.push(Drawn { scene: name.clone(), kind, image });
    }
    (checks, drawn)
}

/// Where the image shows a surface and where not, whatever its colours.
fn judge_coverage(case: &Case, image: &Image) -> Check {
    let mask = &case.expected.unshadowed_mask;
    let (mut counted, mut wrong) = (0usize, 0usize);
    for (pixel, &value) in image.pixels.iter().zip(&mask.pixels) {
        let background = value & RegionMask::INDEX == 0;
        if value & (RegionMask::EDGE | RegionMask::EMITTER) != 0 || !(background || mask.region(value).lit) {
            continue;
        }
        counted += 1;
        wrong += usize::from((*pixel == basecode::Vec3::ZERO) != background);
    }
    let (id, name) = ("image.realtime.coverage", &case.entry.name);
    let error = wrong as f64 / counted.max(1) as f64;
    if error <= 5e-3 {
        return Check::new(id, name, Verdict::Pass, "surfaces lie where they should");
    }
    let summary = format!("{wrong} of {counted} pixels show a surface where none is, or none where one is");
    Check { error, ..Check::new(id, name, Verdict::Fail, summary) }
}

/// Judges the student's pass under stages of ours (2.1) and his stages under a pass of ours (2.2
/// to 2.4), on one scene's small film.
pub fn isolate(
    asker: &Asker,
    plugin: &Path,
    case: &Case,
    stages: &Stages,
    tolerances: &Tolerances,
) -> Vec<Check> {
    let mut checks = vec![isolate_pass(asker, plugin, case)];
    checks.push(match stages.is_template(0) {
        true => untouched("stage.vertex", case, "2.2 vertex shader"),
        false => isolate_vertex(asker, case, stages),
    });
    for (index, id, task, phong) in
        [(1, "stage.diffuse", "2.3 diffuse fragment shader", false), (2, "stage.phong", "2.4 Phong fragment shader", true)]
    {
        checks.push(match stages.is_template(index) {
            true => untouched(id, case, task),
            false => isolate_fragment(asker, case, stages, (index, id, phong), tolerances),
        });
    }
    checks
}

fn untouched(id: &str, case: &Case, task: &str) -> Check {
    let summary = format!("not implemented yet: {task}: the stage is the template's");
    Check::new(id, &case.entry.name, Verdict::NotImplemented, summary)
}

fn isolate_pass(asker: &Asker, plugin: &Path, case: &Case) -> Check {
    let size = (case.small.width, case.small.height);
    let mut frames = Vec::new();
    for bound in BoundValue::ALL {
        let texts = [VERTEX.to_owned(), bound.stage(false), bound.stage(true)];
        match draw(asker, Some(plugin), case, &case.realtime, size, false, &named(texts)) {
            Outcome::Done(answer) => frames.push((bound, ask::image(&answer.values, size.0, size.1))),
            other => return swap_failed("pass.uniforms", case, &["2.1"], &other),
        }
    }
    let scene = &case.expected.scene;
    judge_pass(&case.entry.name, scene, &case.small.surface, &case.small.unshadowed_mask, &frames)
}

fn isolate_vertex(asker: &Asker, case: &Case, stages: &Stages) -> Check {
    let id = "stage.vertex";
    let Some(own) = &stages.own[0] else { return absent(id, case, NAMES[0]) };
    let size = (case.small.width, case.small.height);
    let mut images = Vec::new();
    for show in [SHOW_POSITION, SHOW_NORMAL] {
        let texts = [own.clone(), show.to_owned(), show.to_owned()];
        match draw(asker, None, case, &case.realtime, size, false, &named(texts)) {
            Outcome::Done(answer) => images.push(ask::image(&answer.values, size.0, size.1)),
            other => return swap_failed(id, case, &[], &other),
        }
    }
    let mask = &case.small.unshadowed_mask;
    judge_vertex(&case.entry.name, &case.small.surface, mask, &images[0], &images[1])
}

fn isolate_fragment(
    asker: &Asker,
    case: &Case,
    stages: &Stages,
    (index, id, phong): (usize, &str, bool),
    tolerances: &Tolerances,
) -> Check {
    let Some(own) = &stages.own[index] else { return absent(id, case, NAMES[index]) };
    let (width, height) = (case.small.width, case.small.height);
    let mut texts = [VERTEX, SHOW_NOTHING, SHOW_NOTHING].map(str::to_owned);
    texts[index].clone_from(own);
    match draw(asker, None, case, &case.realtime, (width, height), false, &named(texts)) {
        Outcome::Done(answer) => {
            let image = ask::image(&answer.values, width, height);
            let small = &case.small;
            images::judge_realtime(
                id,
                &case.entry.name,
                &image,
                &small.unshadowed,
                &images::only(&small.unshadowed_mask, &|region| (region.exponent > 0.0) == phong),
                tolerances,
            )
        }
        other => swap_failed(id, case, &[], &other),
    }
}

fn absent(id: &str, case: &Case, name: &str) -> Check {
    let summary = format!("swap not possible: there is no src/shaders/{name}.wgsl");
    Check::new(id, &case.entry.name, Verdict::NotJudged, summary)
}

/// A swap that the graphics library refuses is no fault: the student may have chosen another
/// layout. Whether a stage compiles at all shows in the student's own image.
fn swap_failed(id: &str, case: &Case, parts: &[&str], outcome: &Outcome) -> Check {
    match outcome {
        Outcome::Failed(message) => {
            let first = message.lines().next().unwrap_or_default();
            let summary = format!("swap not possible: {first}");
            Check::new(id, &case.entry.name, Verdict::NotJudged, summary)
        }
        other => ask::unanswered(id, &case.entry.name, parts, other),
    }
}

fn named(texts: [String; 3]) -> Vec<Stage> {
    let named = NAMES.iter().zip(texts);
    named.map(|(&name, text)| Stage { name: name.to_owned(), text }).collect()
}

fn draw(
    asker: &Asker,
    plugin: Option<&Path>,
    case: &Case,
    toml: &Path,
    (width, height): (u32, u32),
    shadow_map: bool,
    stages: &[Stage],
) -> Outcome {
    let adapter = match &asker.adapter {
        Ok(adapter) => adapter.clone(),
        Err(reason) => return Outcome::NoAdapter(reason.clone()),
    };
    let request = Request::RenderRealtime {
        scene: asker.scene(toml),
        width,
        height,
        shadow_map,
        adapter,
        stages: stages.to_vec(),
        cameras: vec![case.camera],
    };
    let outcome = asker.ask(plugin, vec![request.clone()]).pop();
    let outcome = match outcome {
        // The adapter was there when the batch began: believe its loss only twice.
        Some(Outcome::NoAdapter(_)) => asker.ask(plugin, vec![request]).pop(),
        other => other,
    };
    match outcome {
        Some(Outcome::NoAdapter(message)) => {
            Outcome::Failed(format!("{message} (but this machine's adapter works)"))
        }
        Some(outcome) => outcome,
        None => Outcome::NoAdapter("the worker gave no outcome: a bug of Umbra's".into()),
    }
}

/// Whether this machine can draw at all: asks Umbra's own pass for one small frame.
///
/// # Errors
/// Why not, in words.
pub fn probe_adapter(asker: &Asker, case: &Case) -> Result<(), String> {
    let texts = [VERTEX, SHOW_NORMAL, SHOW_NORMAL].map(str::to_owned);
    match draw(asker, None, case, &case.realtime, (16, 16), false, &named(texts)) {
        Outcome::Done(_) => Ok(()),
        Outcome::NoAdapter(message) | Outcome::Failed(message) => Err(message),
        other => Err(format!("{other:?}")),
    }
}
