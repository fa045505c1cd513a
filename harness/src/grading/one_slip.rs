//! A wrong picture of a renderer whose pass and stages are right alone, or cannot all be exchanged: one slip may
//! explain its frames on all scenes, and is charged to the part that it belongs to.

use std::path::Path;

use basecode::{Image, Matrices};

use super::draw::{Frame, draw_each};
use super::isolate::{on_film, positions_and_normals};
use super::offline::Drawn;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use super::stages::{MOVED, Moved, Stages, matrices, negated_normals};
use super::usual_pipelines;
use crate::evidence::images::{self, Kind};
use crate::evidence::pixels::{self, LeftBySlip};
use crate::evidence::price::{Class, Price};
use crate::evidence::vertex::judge_vertex;
use crate::evidence::{Check, CheckId, Verdict};
use crate::imaging::tolerances::Tolerances;
use crate::worker::Stage;

/// Pass and stages, each alone.
const ALONE: [CheckId; 4] =
    [CheckId::PassUniforms, CheckId::StageVertex, CheckId::StageDiffuse, CheckId::StagePhong];

/// What the slip may leave of a scene's picture unexplained.
const LEFT: f64 = 0.01;

/// What explains the wrong frames of a renderer.
#[derive(Default)]
pub struct Found {
    /// The checks under which it pays for all.
    pub checks: Vec<Check>,
    /// What the host replaces to have the pass draw the right pictures, if that is how it is known.
    pub mended_by: Option<Stage>,
}

impl Found {
    fn of(checks: Vec<Check>) -> Self {
        Self { checks, mended_by: None }
    }
}

/// The checks under which one slip pays for all wrong frames, if one explains them and nothing but its part is known to
/// be wrong alone. `found` are the checks of pass, stages and frames, and `drawn` the frames.
pub fn judge(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    stages: &Stages,
    (found, drawn): (&[Check], &[Drawn]),
    tolerances: &Tolerances,
) -> Found {
    let is_open = |check: &Check| matches!(check.verdict, Verdict::Pass | Verdict::NotJudged);
    let fails = |id: CheckId| found.iter().any(|check| check.id == id && !is_open(check));
    let others_are_open = |id: CheckId| ALONE.into_iter().all(|of| of == id || !fails(of));
    let frame = |case: &PreparedScene| {
        let own = |drawn: &&Drawn| drawn.scene == case.entry.name && drawn.kind == Kind::Realtime;
        drawn.iter().find(own).map(|drawn| &drawn.image)
    };
    let Some(frames) = cases.iter().map(frame).collect::<Option<Vec<&Image>>>() else {
        return Found::default();
    };
    let is_wrong = |case: &PreparedScene| {
        let own =
            |check: &Check| check.scene == case.entry.name && check.id == CheckId::ImageRealtime;
        found.iter().any(|check| own(check) && check.verdict == Verdict::Fail)
    };
    let wrong: Vec<bool> = cases.iter().map(is_wrong).collect();
    let slip = |id, (name, class): (&str, Class)| {
        let scene = |(case, wrong): (&PreparedScene, &bool)| {
            let own = |other| (other == id && *wrong).then_some((name, class));
            ALONE.map(|other| explained(other, case, own(other)))
        };
        Found::of(cases.iter().zip(&wrong).flat_map(scene).collect())
    };
    let vertex = CheckId::StageVertex;
    // Of a stage that is wrong alone its own frames tell.
    let is_open = |id: CheckId| others_are_open(id) && !(id == vertex && fails(vertex));
    if let Some((id, name)) = slip_of_frames(cases, &frames, &wrong, &is_open) {
        return slip(id, (name, Class::Slip));
    }
    let first = wrong.iter().position(|wrong| *wrong).unwrap_or_default();
    let mended = |stage: &Stage| mended_by(stage, session, plugin, (cases, first), tolerances);
    if others_are_open(CheckId::PassUniforms)
        && let Some((name, stage)) = usual_pipelines::slips().find(|(_, stage)| mended(stage))
    {
        let checks = slip(CheckId::PassUniforms, (name, Class::Slip)).checks;
        return Found { checks, mended_by: Some(stage) };
    }
    if others_are_open(vertex) {
        let is_moved = |(_, moved): &&Moved| {
            let moved = frames.iter().map(|frame| Some(moved(frame)));
            are_right(cases, moved.collect(), Film::Whole, tolerances)
        };
        if let Some((name, _)) = MOVED.iter().find(is_moved) {
            return slip(vertex, (name, Class::Slip));
        }
        if mended(&negated_normals()) {
            return slip(vertex, ("the normal is negated", Class::Slip));
        }
        if is_open(vertex)
            && let Some((found, which)) = slip_of_matrices(&|which| mended(&matrices(which)))
        {
            return Found { checks: slip(vertex, found).checks, mended_by: Some(matrices(which)) };
        }
    }
    if ALONE.into_iter().any(fails) {
        return Found::default();
    }
    Found::of(vertex_under_own_pass(session, plugin, cases, stages))
}

/// What is wrong with the matrices of a pass that is right under other ones, and which these are.
fn slip_of_matrices(
    is_right: &dyn Fn(Matrices) -> bool,
) -> Option<((&'static str, Class), Matrices)> {
    use Matrices::{InProjection, InView, Transposed};
    let exchanged = ("view and projection are exchanged", Class::Slip);
    Some(match (is_right(InView), is_right(InProjection)) {
        (true, true) => (exchanged, InView),
        (true, false) => (("the projection is missing", Class::Concept), InView),
        (false, true) => (("the view matrix is missing", Class::Concept), InProjection),
        (false, false) if is_right(Transposed) => {
            (("the position stands on the left of the matrices", Class::Slip), Transposed)
        }
        (false, false) => return None,
    })
}

/// The check of a part under the mistake that explains all frames: where it is the part's own.
fn explained(id: CheckId, case: &PreparedScene, own: Option<(&str, Class)>) -> Check {
    let scene = &case.entry.name;
    let convention = "one slip explains every frame".to_owned();
    let Some((name, class)) = own else {
        let summary = "right but for the one slip that explains every frame";
        return Check { convention, ..Check::new(id, scene, Verdict::Pass, summary) };
    };
    let (error, mistake) = (class.price(), name.to_owned());
    let summary = format!("one slip explains the submission's own frames on every scene: {name}");
    Check { error, mistake, convention, ..Check::new(id, scene, Verdict::Fail, summary) }
}

/// The one slip with what reaches the fragment stages that explains the frames of all scenes, some of them by light. It
/// must explain every right frame and most of the `wrong` ones, because on one scene noise may decide what a surface
/// shows. `is_open` tells whether no other fault is known of the part that a slip belongs to.
fn slip_of_frames(
    cases: &[PreparedScene],
    frames: &[&Image],
    wrong: &[bool],
    is_open: &dyn Fn(CheckId) -> bool,
) -> Option<(CheckId, &'static str)> {
    if ![CheckId::PassUniforms, CheckId::StageVertex].into_iter().any(is_open) {
        return None;
    }
    let of_scenes: Vec<Vec<LeftBySlip>> = cases
        .iter()
        .zip(frames)
        .map(|(case, frame)| {
            let expected = &case.expected;
            pixels::left_by_slips(&expected.scene, frame, &expected.unshadowed_mask)
        })
        .collect();
    let slips = of_scenes.first()?.iter().map(|left| (left.of, left.name));
    let explains = |index: usize| {
        let of = |is_wrong: bool| {
            let scenes = of_scenes.iter().zip(wrong).filter(move |(_, wrong)| **wrong == is_wrong);
            scenes.filter_map(move |(scene, _)| scene.get(index))
        };
        // Where what is right explains as much, a scene tells nothing of a slip.
        let shows = |left: &LeftBySlip| left.lights && left.left_by_right > LEFT;
        let most = |must_show: bool| {
            let (mut all, mut explained) = (0usize, 0usize);
            for left in of(true).filter(|left| shows(left) || !must_show) {
                (all, explained) = (all + 1, explained + usize::from(left.left <= LEFT));
            }
            2 * explained > all
        };
        of(false).all(|left| left.left <= LEFT) && most(false) && most(true)
    };
    let mut slips = slips.enumerate().filter(|(_, (of, _))| is_open(*of));
    slips.find(|(index, _)| explains(*index)).map(|(_, slip)| slip)
}

/// The film that pictures of a scene are drawn on.
#[derive(Clone, Copy)]
enum Film {
    Whole,
    Small,
}

/// Whether pictures show their scenes, and some of them light.
fn are_right(
    cases: &[PreparedScene],
    pictures: Vec<Option<Image>>,
    film: Film,
    tolerances: &Tolerances,
) -> bool {
    let verdict = |(case, image): (&PreparedScene, Option<Image>)| {
        let (expected, small) = (&case.expected, &case.probe_film);
        let (right, normals, mask) = match film {
            Film::Whole => {
                (&expected.unshadowed, &expected.interpolated_normals, &expected.unshadowed_mask)
            }
            Film::Small => (&small.unshadowed, &small.interpolated_normals, &small.unshadowed_mask),
        };
        let (id, scene) = (CheckId::ImageRealtime, &case.entry.name);
        let right = (right, normals.as_ref());
        Some(images::judge_shaded(id, scene, &image?, right, mask, tolerances).verdict)
    };
    let verdicts: Vec<_> = cases.iter().zip(pictures).map(verdict).collect();
    let right =
        |verdict: &Option<Verdict>| matches!(verdict, Some(Verdict::Pass | Verdict::NotJudged));
    verdicts.iter().all(right) && verdicts.contains(&Some(Verdict::Pass))
}

/// Whether a pass draws the right picture of every scene where the host changes what it is given. `first` is one that
/// it draws wrongly otherwise: where that stays wrong, no other is drawn.
fn mended_by(
    stage: &Stage,
    session: &Session,
    plugin: &Path,
    (cases, first): (&[PreparedScene], usize),
    tolerances: &Tolerances,
) -> bool {
    let is_mended = |cases: &[PreparedScene]| {
        let frame = |case| Frame::probe(case, vec![stage.clone()]);
        let frames: Vec<Frame> = cases.iter().map(frame).collect();
        let outcomes = draw_each(session, Some(plugin), &frames);
        let image = |(frame, outcome): (&Frame, &crate::worker::Outcome)| {
            let (width, height) = frame.size;
            Some(session::image(&outcome.answer()?.values, width, height))
        };
        let pictures = frames.iter().zip(&outcomes).map(image).collect();
        are_right(cases, pictures, Film::Small, tolerances)
    };
    cases.get(first..=first).is_some_and(&is_mended) && is_mended(cases)
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
            judge_vertex(name, film, [[positions, normals]; Matrices::ALL.len()])
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_matrices_mend_is_told_by_which_do() {
        let of = |right: &[Matrices]| slip_of_matrices(&|which| right.contains(&which));
        use Matrices::{InProjection, InView, Transposed};
        assert_eq!(of(&[]), None);
        let class = |right: &[Matrices]| of(right).map(|((_, class), _)| class);
        assert_eq!(class(&[InView, InProjection]), Some(Class::Slip));
        assert_eq!(class(&[InView]), Some(Class::Concept));
        assert_eq!(class(&[InProjection]), Some(Class::Concept));
        assert_eq!(class(&[Transposed]), Some(Class::Slip));
    }
}
