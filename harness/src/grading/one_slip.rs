//! A wrong picture of a renderer whose pass and stages are right alone, or cannot be exchanged: one slip may explain its
//! frames on all scenes, and is charged to the part that it belongs to.

use std::path::Path;

use basecode::Image;

use super::draw::{Frame, draw_each};
use super::isolate::{on_film, positions_and_normals};
use super::offline::Drawn;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use super::stages::{Stages, negated_normals};
use crate::evidence::images::{self, Kind};
use crate::evidence::pixels::{self, LeftByPass};
use crate::evidence::price::Class;
use crate::evidence::vertex::judge_vertex;
use crate::evidence::{Check, CheckId, Verdict};
use crate::imaging::evidence::Tolerances;

/// Pass and stages, each alone.
const ALONE: [CheckId; 4] =
    [CheckId::PassUniforms, CheckId::StageVertex, CheckId::StageDiffuse, CheckId::StagePhong];

/// What the slip may leave of a scene's picture unexplained.
const LEFT: f64 = 0.01;

/// The checks under which one slip pays for all wrong frames, if one explains them and nothing is known to be wrong
/// alone. `found` are the checks of pass, stages and frames, and `drawn` the frames.
pub fn judge(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    stages: &Stages,
    (found, drawn): (&[Check], &[Drawn]),
    tolerances: &Tolerances,
) -> Vec<Check> {
    let is_open = |check: &Check| matches!(check.verdict, Verdict::Pass | Verdict::NotJudged);
    let mut alone = found.iter().filter(|check| ALONE.contains(&check.id));
    if !alone.all(is_open) {
        return Vec::new();
    }
    let frame = |case: &PreparedScene| {
        let own = |drawn: &&Drawn| drawn.scene == case.entry.name && drawn.kind == Kind::Realtime;
        drawn.iter().find(own).map(|drawn| &drawn.image)
    };
    let Some(frames) = cases.iter().map(frame).collect::<Option<Vec<&Image>>>() else {
        return Vec::new();
    };
    let slip = |id, name: &str| {
        let scene = |case: &PreparedScene| {
            let wrong = |check: &&Check| {
                let own = check.scene == case.entry.name && check.id == CheckId::ImageRealtime;
                own && check.verdict == Verdict::Fail
            };
            let is_wrong = found.iter().any(|check| wrong(&check));
            ALONE.map(|other| explained(other, case, (other == id && is_wrong).then_some(name)))
        };
        cases.iter().flat_map(scene).collect()
    };
    if let Some(name) = slip_of_pass(cases, &frames) {
        return slip(CheckId::PassUniforms, name);
    }
    if mended_by_normals(session, plugin, cases, tolerances) {
        return slip(CheckId::StageVertex, "the normal is negated");
    }
    vertex_under_own_pass(session, plugin, cases, stages)
}

/// The check of a part under the slip that explains all frames: `name`, where it is the part's own.
fn explained(id: CheckId, case: &PreparedScene, name: Option<&str>) -> Check {
    let scene = &case.entry.name;
    let convention = "one slip explains every frame".to_owned();
    let Some(name) = name else {
        let summary = "right but for the one slip that explains every frame";
        return Check { convention, ..Check::new(id, scene, Verdict::Pass, summary) };
    };
    let (error, mistake) = (Class::Slip.price(), name.to_owned());
    let summary = format!("one slip explains the submission's own frames on every scene: {name}");
    Check { error, mistake, convention, ..Check::new(id, scene, Verdict::Fail, summary) }
}

/// The one mistake in the values of a pass that explains the frames of all scenes, some of them by light.
fn slip_of_pass(cases: &[PreparedScene], frames: &[&Image]) -> Option<&'static str> {
    let of_scenes: Vec<Vec<LeftByPass>> = cases
        .iter()
        .zip(frames)
        .map(|(case, frame)| {
            let expected = &case.expected;
            pixels::left_by_pass(&expected.scene, frame, &expected.unshadowed_mask)
        })
        .collect();
    let names = of_scenes.first()?.iter().map(|left| left.name);
    let explains = |index: &usize| {
        let own = || of_scenes.iter().filter_map(|scene| scene.get(*index));
        own().all(|left| left.left <= LEFT) && own().any(|left| left.lights)
    };
    names.enumerate().find(|(index, _)| explains(index)).map(|(_, name)| name)
}

/// Whether a pass draws the right picture of every scene whose normals are negated.
fn mended_by_normals(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    tolerances: &Tolerances,
) -> bool {
    let frame = |case| Frame::probe(case, vec![negated_normals()]);
    let frames: Vec<Frame> = cases.iter().map(frame).collect();
    let outcomes = draw_each(session, Some(plugin), &frames);
    let verdict = |(frame, outcome): (&Frame, &crate::worker::Outcome)| {
        let small = &frame.case.probe_film;
        let image = session::image(&outcome.answer()?.values, small.width, small.height);
        let expected = (&small.unshadowed, small.interpolated_normals.as_ref());
        let (id, scene) = (CheckId::ImageRealtime, &frame.case.entry.name);
        let mask = &small.unshadowed_mask;
        Some(images::judge_shaded(id, scene, &image, expected, mask, tolerances).verdict)
    };
    let verdicts: Vec<_> = frames.iter().zip(&outcomes).map(verdict).collect();
    let right =
        |verdict: &Option<Verdict>| matches!(verdict, Some(Verdict::Pass | Verdict::NotJudged));
    verdicts.iter().all(right) && verdicts.contains(&Some(Verdict::Pass))
}

/// The vertex stage under the submission's own pass: its matrices may show what Umbra's, of which the model's is an
/// identity, do not.
fn vertex_under_own_pass(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    stages: &Stages,
) -> Vec<Check> {
    let Some(own) = stages.own[0].as_ref().filter(|_| !stages.is_template(0)) else {
        return Vec::new();
    };
    let sets = positions_and_normals(own);
    let frames: Vec<Frame> =
        cases.iter().flat_map(|case| sets.clone().map(|set| Frame::probe(case, set))).collect();
    let outcomes = draw_each(session, Some(plugin), &frames);
    let mut checks = Vec::new();
    for (case, pair) in cases.iter().zip(outcomes.chunks(sets.len())) {
        let (width, height) = (case.probe_film.width, case.probe_film.height);
        let images = pair.iter().filter_map(|outcome| outcome.answer());
        let images = images.map(|answer| session::image(&answer.values, width, height));
        let images: Vec<Image> = images.collect();
        let [positions, normals] = images.as_slice() else { return Vec::new() };
        let check = on_film(CheckId::StageVertex, case, |film, name| {
            judge_vertex(name, film, [[positions, normals]; 3])
        });
        let convention = "the vertex stage under the submission's own pass".to_owned();
        let summary = format!("{} (judged so: {convention})", check.summary);
        checks.push(Check { convention, summary, ..check });
    }
    // Right there as well: nothing is explained.
    if checks.iter().any(|check| check.verdict == Verdict::Fail) { checks } else { Vec::new() }
}
