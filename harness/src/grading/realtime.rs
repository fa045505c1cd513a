//! The realtime path: images drawn by a plugin, and where one is wrong, pass and stages apart.

use std::path::Path;

use basecode::Image;

use super::ask::{self, Asker};
use super::case::Case;
use super::offline::Drawn;
use crate::evidence::images::{self, Kind};
use crate::evidence::shadow_map::Shadows;
use crate::evidence::stages::{
    BLACK, BoundValue, SHOW_NORMAL, SHOW_POSITION, VERTEX, is_template, judge_pass, judge_vertex,
};
use crate::evidence::{Check, Verdict};
use crate::expected::Expected;
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
        let stage =
            |src: &Path, name| std::fs::read_to_string(src.join(format!("shaders/{name}.wgsl")));
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
        let outcome = draw(
            asker,
            Some(plugin),
            case,
            toml,
            (width, height),
            kind == Kind::RealtimeShadows,
            &[],
        );
        let parts = ["2.1", "2.2", "2.3", "2.4", "2.5"];
        let Outcome::Done(answer) = &outcome else {
            checks.push(ask::unanswered(id, name, &parts, &outcome));
            continue;
        };
        let image = ask::image(&answer.values, width, height);
        let judge =
            |id, wanted| images::judge(id, name, kind, &image, &case.expected, wanted, tolerances);
        if kind == Kind::Realtime {
            let views = VIEWS.map(|(id, wanted)| judge(id, wanted));
            checks.extend(
                if views[0].verdict == Verdict::Fail {
                    plain_but_for_shadows(case, &image, tolerances)
                } else {
                    None
                }
                .unwrap_or(views.to_vec()),
            );
            checks.push(judge_coverage(case, &image));
        } else {
            let check = judge(id, &|_| true);
            let plain = drawn
                .iter()
                .find(|drawn: &&Drawn| drawn.kind == Kind::Realtime)
                .map(|drawn| &drawn.image);
            checks.push(if check.verdict == Verdict::Fail {
                judge_visibility(asker, plugin, case, (&image, plain), check, tolerances)
            } else {
                check
            });
        }
        drawn.push(Drawn { scene: name.clone(), kind, image });
    }
    (checks, drawn)
}

/// The masks that tell where shadows fall.
fn shadows(case: &Case) -> Shadows<'_> {
    let Expected { offline, unshadowed_mask, .. } = &case.expected;
    Shadows { mask: &offline.mask, unshadowed: unshadowed_mask, median_lit: offline.median_lit }
}

/// A default run that is wrong by its shadows alone is the bonus' fault, not that of pass and
/// stages: the checks that say so, if it is.
fn plain_but_for_shadows(
    case: &Case,
    image: &Image,
    tolerances: &Tolerances,
) -> Option<Vec<Check>> {
    let (name, shadows) = (&case.entry.name, shadows(case));
    if !shadows.are_in(image) {
        return None;
    }
    let Expected { unshadowed, raw_normals, .. } = &case.expected;
    let mask = shadows.lit_alone();
    let judged = VIEWS.map(|(id, wanted)| {
        let expected = (unshadowed, raw_normals.as_ref());
        images::judge_shaded(id, name, image, expected, &images::only(&mask, wanted), tolerances)
    });
    if judged[0].verdict != Verdict::Pass {
        return None;
    }
    let summary = "the default run draws shadows: only the bonus scene may";
    let mut checks = judged.to_vec();
    checks.push(Check::new("bonus.default", name, Verdict::Fail, summary));
    Some(checks)
}

/// Judges shadows that are wrong as an image by visibility alone: against the student's own image
/// without shadows, or else against that drawn under a vertex stage of ours. `check` is the
/// verdict on the image, which stands when neither tells.
fn judge_visibility(
    asker: &Asker,
    plugin: &Path,
    case: &Case,
    (with, without): (&Image, Option<&Image>),
    check: Check,
    tolerances: &Tolerances,
) -> Check {
    let (name, shadows) = (&case.entry.name, shadows(case));
    let judge = |with: &Image, without: &Image| shadows.judge(name, with, without, tolerances);
    let own = without.and_then(|without| judge(with, without));
    if let Some(own) = own.as_ref().filter(|own| own.verdict == Verdict::Pass) {
        return own.clone();
    }
    let (width, height) = case.film();
    let vertex = [Stage { name: NAMES[0].to_owned(), text: VERTEX.to_owned() }];
    let drawn = |toml, shadow_map| match draw(
        asker,
        Some(plugin),
        case,
        toml,
        (width, height),
        shadow_map,
        &vertex,
    ) {
        Outcome::Done(answer) => Some(ask::image(&answer.values, width, height)),
        _ => None,
    };
    let swapped = case
        .bonus
        .as_ref()
        .and_then(|bonus| judge(&drawn(bonus, true)?, &drawn(&case.realtime, false)?));
    match swapped {
        Some(swapped) if swapped.verdict == Verdict::Pass => swapped,
        _ => own.unwrap_or(check),
    }
}

/// Where the image shows a surface and where not, whatever its colours.
fn judge_coverage(case: &Case, image: &Image) -> Check {
    let mask = &case.expected.unshadowed_mask;
    let (mut counted, mut wrong) = (0usize, 0usize);
    for (pixel, &value) in image.pixels.iter().zip(&mask.pixels) {
        let background = value & RegionMask::INDEX == 0;
        if value & (RegionMask::EDGE | RegionMask::EMITTER) != 0
            || !(background || mask.region(value).lit)
        {
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
    let summary =
        format!("{wrong} of {counted} pixels show a surface where none is, or none where one is");
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
    for (index, id, task, phong) in [
        (1, "stage.diffuse", "2.3 diffuse fragment shader", false),
        (2, "stage.phong", "2.4 Phong fragment shader", true),
    ] {
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
    let shown = BoundValue::ALL
        .map(|bound| named([VERTEX.to_owned(), bound.stage(false), bound.stage(true)]));
    let outcomes = draw_each(asker, Some(plugin), case, &case.realtime, size, false, &shown);
    for (bound, outcome) in BoundValue::ALL.into_iter().zip(outcomes) {
        match outcome {
            Outcome::Done(answer) => {
                frames.push((bound, ask::image(&answer.values, size.0, size.1)))
            }
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
    let shown = [SHOW_POSITION, SHOW_NORMAL]
        .map(|show| named([own.clone(), show.to_owned(), show.to_owned()]));
    for outcome in draw_each(asker, None, case, &case.realtime, size, false, &shown) {
        match outcome {
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
    let mut texts = [VERTEX, BLACK, BLACK].map(str::to_owned);
    texts[index].clone_from(own);
    match draw(asker, None, case, &case.realtime, (width, height), false, &named(texts)) {
        Outcome::Done(answer) => {
            let image = ask::image(&answer.values, width, height);
            let small = &case.small;
            images::judge_shaded(
                id,
                &case.entry.name,
                &image,
                (&small.unshadowed, small.raw_normals.as_ref()),
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

/// Draws one frame.
fn draw(
    asker: &Asker,
    plugin: Option<&Path>,
    case: &Case,
    toml: &Path,
    size: (u32, u32),
    shadow_map: bool,
    stages: &[Stage],
) -> Outcome {
    let outcome = draw_each(asker, plugin, case, toml, size, shadow_map, &[stages.to_vec()]).pop();
    outcome.unwrap_or_else(|| {
        Outcome::NoAdapter("the worker gave no outcome: a bug of Umbra's".into())
    })
}

/// Draws a frame under each set of stages, all in one worker.
fn draw_each(
    asker: &Asker,
    plugin: Option<&Path>,
    case: &Case,
    toml: &Path,
    (width, height): (u32, u32),
    shadow_map: bool,
    sets: &[Vec<Stage>],
) -> Vec<Outcome> {
    let adapter = match &asker.adapter {
        Ok(adapter) => adapter,
        Err(reason) => return vec![Outcome::NoAdapter(reason.clone()); sets.len()],
    };
    let request = |stages: &Vec<Stage>| Request::RenderRealtime {
        scene: asker.scene(toml),
        width,
        height,
        shadow_map,
        adapter: adapter.clone(),
        stages: stages.clone(),
        cameras: vec![case.camera],
    };
    let requests: Vec<Request> = sets.iter().map(request).collect();
    let mut outcomes = asker.ask(plugin, requests.clone());
    if outcomes.iter().any(|outcome| matches!(outcome, Outcome::NoAdapter(_))) {
        // The adapter was there when the batch began: believe its loss only twice.
        outcomes = asker.ask(plugin, requests);
    }
    let believed = outcomes.into_iter().map(|outcome| match outcome {
        Outcome::NoAdapter(message) => {
            Outcome::Failed(format!("{message} (but this machine's adapter works)"))
        }
        outcome => outcome,
    });
    believed.collect()
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
