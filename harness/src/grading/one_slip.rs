//! A wrong picture of a renderer whose pass and stages are right alone, or cannot all be exchanged: one slip may
//! explain its frames on all scenes, and is charged to the part that it belongs to.

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
use crate::evidence::price::{Class, Price};
use crate::evidence::vertex::judge_vertex;
use crate::evidence::{Check, CheckId, Verdict};
use crate::imaging::evidence::Tolerances;

/// Pass and stages, each alone.
const ALONE: [CheckId; 4] =
    [CheckId::PassUniforms, CheckId::StageVertex, CheckId::StageDiffuse, CheckId::StagePhong];

/// What the slip may leave of a scene's picture unexplained.
const LEFT: f64 = 0.01;

/// The checks under which one slip pays for all wrong frames, if one explains them and nothing but its part is known to
/// be wrong alone. `found` are the checks of pass, stages and frames, and `drawn` the frames.
pub fn judge(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    stages: &Stages,
    (found, drawn): (&[Check], &[Drawn]),
    tolerances: &Tolerances,
) -> Vec<Check> {
    let is_open = |check: &Check| matches!(check.verdict, Verdict::Pass | Verdict::NotJudged);
    let fails = |id: CheckId| found.iter().any(|check| check.id == id && !is_open(check));
    let others_are_open = |id: CheckId| ALONE.into_iter().all(|of| of == id || !fails(of));
    let frame = |case: &PreparedScene| {
        let own = |drawn: &&Drawn| drawn.scene == case.entry.name && drawn.kind == Kind::Realtime;
        drawn.iter().find(own).map(|drawn| &drawn.image)
    };
    let Some(frames) = cases.iter().map(frame).collect::<Option<Vec<&Image>>>() else {
        return Vec::new();
    };
    let is_wrong = |case: &PreparedScene| {
        let own =
            |check: &Check| check.scene == case.entry.name && check.id == CheckId::ImageRealtime;
        found.iter().any(|check| own(check) && check.verdict == Verdict::Fail)
    };
    let wrong: Vec<bool> = cases.iter().map(is_wrong).collect();
    let slip = |id, name: &str| {
        let scene = |(case, wrong): (&PreparedScene, &bool)| {
            ALONE.map(|other| explained(other, case, (other == id && *wrong).then_some(name)))
        };
        cases.iter().zip(&wrong).flat_map(scene).collect()
    };
    let (pass, vertex) = (CheckId::PassUniforms, CheckId::StageVertex);
    if others_are_open(pass)
        && let Some(name) = slip_of_pass(cases, &frames, &wrong)
    {
        return slip(pass, name);
    }
    if others_are_open(vertex) && mended_by_normals(session, plugin, cases, tolerances) {
        return slip(vertex, "the normal is negated");
    }
    if ALONE.into_iter().any(fails) {
        return Vec::new();
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

/// The one mistake in the pass's values that explains the frames of all scenes, some of them by light. It must explain
/// every right frame and most of the `wrong` ones, because on one scene noise may decide what a surface shows.
fn slip_of_pass(
    cases: &[PreparedScene],
    frames: &[&Image],
    wrong: &[bool],
) -> Option<&'static str> {
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
        let of = |is_wrong: bool| {
            let scenes = of_scenes.iter().zip(wrong).filter(move |(_, wrong)| **wrong == is_wrong);
            scenes.filter_map(|(scene, _)| scene.get(*index))
        };
        let most = |lights: bool| {
            let (mut all, mut explained) = (0usize, 0usize);
            for left in of(true).filter(|left| left.lights || !lights) {
                (all, explained) = (all + 1, explained + usize::from(left.left <= LEFT));
            }
            2 * explained > all
        };
        of(false).all(|left| left.left <= LEFT) && most(false) && most(true)
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
        let summary = format!("{} (convention: {convention})", check.summary);
        let check = Check { convention, summary, ..check };
        // Identities show nothing wrong, so a matrix stands where another belongs.
        checks.push(check.priced(|raw| Price::of_raw(raw).or("another matrix", Class::Slip, 0.0)));
    }
    // Right there as well: nothing is explained.
    if checks.iter().any(|check| check.verdict == Verdict::Fail) { checks } else { Vec::new() }
}
