//! Judges parts 2.1 to 2.4 separately if an image is wrong: the student's pass with Umbra's stages, and the student's
//! stages in Umbra's pass, on small films.

use std::ops::Range;
use std::path::Path;

use basecode::{Image, MaterialModel, Matrices, Vec3};

use super::draw::{FrameRequest, draw, draw_scenes};
use super::kept_frames::draw_sets;
use super::observe;
use super::own_frames;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session, headline};
use super::stages::{Stages, matrices, named};
use super::uploads::{drawn_parts, every_fragment};
use crate::diagnosis::{Thumbnail, View, ViewKind};
use crate::evidence::premultiplied::Premultiplied;
use crate::evidence::stage_film::StageFilm;
use crate::evidence::stages::{BLACK, BoundValue, SHOW_NORMAL, SHOW_POSITION, VERTEX, judge_pass};
use crate::evidence::varyings::vertex_for;
use crate::evidence::vertex::judge_vertex;
use crate::evidence::{Check, CheckId, Verdict};
use crate::evidence::{images, pixels};
use crate::imaging::reference::{Region, RegionMask};
use crate::imaging::tolerances::Tolerances;
use crate::worker::{Outcome, STAGES, StageText};

/// The checks of the three stages, and the tasks that they belong to.
const CHECKS: [(CheckId, &str); 3] = [
    (CheckId::StageVertex, "2.2 vertex shader"),
    (CheckId::StageDiffuse, "2.3 diffuse fragment shader"),
    (CheckId::StagePhong, "2.4 Phong fragment shader"),
];

/// The stages of ours that show what a pass binds, and then world positions.
pub fn pass_shown() -> Vec<Vec<StageText>> {
    let of = |fragments: [String; 2]| {
        let [diffuse, phong] = fragments;
        named([VERTEX.to_owned(), diffuse, phong])
    };
    let bound = BoundValue::ALL.map(|bound| of([bound.stage(false), bound.stage(true)]));
    bound.into_iter().chain([of([SHOW_POSITION; 2].map(str::to_owned))]).collect()
}

/// What a student's pass draws under those.
struct PassFrames {
    bound: Vec<(BoundValue, Image)>,
    positions: Image,
}

impl PassFrames {
    /// Whether nothing shows under any stage.
    fn are_black(&self) -> bool {
        let frames = self.bound.iter().map(|(_, frame)| frame).chain([&self.positions]);
        frames.flat_map(|frame| &frame.pixels).all(|pixel| *pixel == Vec3::ZERO)
    }
}

/// Whether a pass draws any fragment of a scene, by whatever stages: where Umbra's own show nothing, under other
/// matrices as well.
fn draws_surfaces(session: &Session, plugin: &Path, case: &PreparedScene) -> bool {
    let draws = |which: Matrices| {
        let frame = FrameRequest::probe(case, vec![every_fragment(), matrices(which)]);
        let outcome = draw(session, Some(plugin), &frame);
        let (width, height) = frame.size;
        let image = outcome.answer().map(|answer| session::image(&answer.values, width, height));
        let drawn = image.map(|image| drawn_parts(&image).pixels);
        drawn.is_some_and(|drawn| drawn.iter().any(|pixel| *pixel != Vec3::ZERO))
    };
    [Matrices::Usual, Matrices::InView, Matrices::Transposed].into_iter().any(draws)
}

/// Whether a pass takes the host's stages: of those that are no WGSL it then makes no frame.
fn takes_stages(session: &Session, plugin: &Path, case: &PreparedScene) -> bool {
    let none = named(["no WGSL"; 3].map(str::to_owned));
    needs_wgsl(&draw(session, Some(plugin), &FrameRequest::probe(case, none)))
}

/// Whether a frame under stages that are no WGSL shows that a pass needs them.
fn needs_wgsl(outcome: &Outcome) -> bool {
    outcome.answer().is_none()
}

/// Judges the student's pass with Umbra's stages (2.1) and the student's stages in Umbra's pass (2.2 to 2.4) on scenes.
/// One worker draws all frames of the former; another, without any of the student's Rust code, draws those of the
/// latter. `own_frames` is what the student's own frames show. The flag says whether one of some scene got no answer:
/// then a stage that does not compile is to blame, otherwise no frame needs it.
pub fn isolate(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    stages: &Stages,
    (own_frames, fails): (&[Check], bool),
    tolerances: &Tolerances,
) -> Vec<Check> {
    let (swaps, sets) = swaps(stages);
    let is_right =
        |index, frames: &[Outcome]| pass_check(&cases[index], frames).verdict == Verdict::Pass;
    let passes = draw_scenes(session, plugin, &under(cases, &pass_shown()), &is_right);
    let own =
        |stage: &StageText| stage.name == STAGES[0] && stages.own[0].as_ref() == Some(&stage.text);
    let frame = |case, set: &Vec<StageText>| FrameRequest {
        each_matrices: set.iter().any(own),
        ..FrameRequest::probe(case, set.clone())
    };
    let frames: Vec<Vec<FrameRequest>> =
        sets.iter().map(|set| cases.iter().map(|case| frame(case, set)).collect()).collect();
    let mut swapped: Vec<_> = draw_sets(session, &frames).into_iter().map(Vec::into_iter).collect();
    let mut shown = Shown::default();
    let mut checks = Vec::new();
    for (case, pass) in cases.iter().zip(passes) {
        let swapped: Vec<Outcome> = swapped.iter_mut().filter_map(Iterator::next).collect();
        let pass = match pass_frames(case, &pass) {
            Ok(frames)
                if frames.are_black()
                    && (!takes_stages(session, plugin, case)
                        || draws_surfaces(session, plugin, case)) =>
            {
                let summary =
                    "cannot be judged alone: no stage of Umbra's draws what the pass draws";
                Check::new(CheckId::PassUniforms, &case.entry.name, Verdict::NotJudged, summary)
            }
            Ok(frames) => {
                observe::pass(session, case, &frames.bound);
                let check = judge_pass_frames(case, &frames);
                shown.passes.push((case, frames));
                check
            }
            Err(check) => *check,
        };
        let takes_ours = pass.verdict != Verdict::NotJudged;
        let mut stage = |index: usize| {
            let (id, task) = CHECKS[index];
            let outcomes = match &swaps[index] {
                Swap::Untouched if takes_ours || !stages.is_elsewhere(index) => {
                    let summary =
                        format!("not implemented yet: {task}: the stage is the template's");
                    return Check::new(id, &case.entry.name, Verdict::NotImplemented, summary);
                }
                Swap::Absent if !stages.is_elsewhere(index) => {
                    let summary =
                        format!("not implemented yet: {task}: the source holds no such stage");
                    return Check::new(id, &case.entry.name, Verdict::NotImplemented, summary);
                }
                Swap::Untouched | Swap::Absent => {
                    let name = STAGES[index];
                    let summary = format!(
                        "cannot be judged alone: what draws is not in src/shaders/{name}.wgsl"
                    );
                    return Check::new(id, &case.entry.name, Verdict::NotJudged, summary);
                }
                Swap::Drawn(range) => &swapped[range.clone()],
            };
            let images = match images(case, outcomes) {
                Ok(images) => images,
                Err(outcome) => return swap_failed(session, id, case, fails, outcome),
            };
            match images.as_slice() {
                images if index == 0 && images.len() == 2 * Matrices::ALL.len() => {
                    let (positions, normals) = images.split_at(Matrices::ALL.len());
                    observe::vertex(session, case, &positions[0], &normals[0]);
                    let frames = std::array::from_fn(|at| [&positions[at], &normals[at]]);
                    on_film(id, case, |film, name| judge_vertex(name, film, frames))
                }
                [image] => {
                    record_fragment(session, case, image, index == 2);
                    observe::fragment(session, case, image, index == 2);
                    shown.fragments.push((case, index, image.clone()));
                    fragment(id, case, image, index == 2, tolerances)
                }
                _ => unreachable!(
                    "a vertex stage draws two frames under each matrix, a fragment stage one"
                ),
            }
        };
        checks.push(pass);
        checks.extend((0..STAGES.len()).map(&mut stage));
    }
    refuse_inputs(&mut checks, own_frames, stages);
    checks.extend(shown.judge_premultiplied(tolerances));
    let pass_of = |wanted: own_frames::Wanted| shown.judge_passes(wanted);
    let together = own_frames::judge(&checks, own_frames, &pass_of);
    checks.extend(together);
    checks
}

/// A fragment stage that takes more than the contract forwards gets zeros from Umbra's vertex stage. Where it is wrong
/// with them, and its own pipeline is refused, the cause is what the graphics library says.
fn refuse_inputs(checks: &mut [Check], own_frames: &[Check], stages: &Stages) {
    for index in [1, 2] {
        let takes_more = stages.own[index].as_ref().is_some_and(|own| vertex_for(own) != VERTEX);
        let label = format!("label = '{}'", STAGES[index]);
        for check in checks.iter_mut().filter(|check| check.id == CHECKS[index].0) {
            let refused = own_frames.iter().find(|own| {
                own.id == CheckId::ImageRealtime
                    && own.scene == check.scene
                    && own.summary.contains(&label)
            });
            if let (true, Verdict::Fail, Some(refused)) = (takes_more, check.verdict, refused) {
                check.summary.clone_from(&refused.summary);
                check.hint.clear();
            }
        }
    }
}

/// What pass and fragment stages show of scenes.
#[derive(Default)]
struct Shown<'a> {
    passes: Vec<(&'a PreparedScene, PassFrames)>,
    /// With the stage's index.
    fragments: Vec<(&'a PreparedScene, usize, Image)>,
}

impl Shown<'_> {
    /// The checks of the pass by the values that are wanted of a scene's shapes.
    fn judge_passes(&self, wanted: own_frames::Wanted) -> Vec<Check> {
        let judge = |(case, frames): &(&PreparedScene, PassFrames)| {
            let scene = &case.expected.scene;
            let phong = |shape| scene.material_of(shape).model == MaterialModel::Phong;
            judge_pass_by(case, frames, &|bound, shape| wanted(bound, phong(shape)))
        };
        self.passes.iter().map(judge).collect()
    }

    /// The checks under each convention that the pass keeps on all scenes, and a fragment stage with it.
    fn judge_premultiplied(&self, tolerances: &Tolerances) -> Vec<Check> {
        let fits = |check: &Check| check.verdict != Verdict::Fail;
        if self.passes.iter().all(|(case, frames)| fits(&judge_pass_frames(case, frames))) {
            return Vec::new();
        }
        let mut checks = Vec::new();
        for convention in Premultiplied::all() {
            let pass = self.passes.iter().map(|(case, frames)| {
                let (scene, surface) = (&case.expected.scene, &case.probe_film.surface);
                let undone = |(bound, frame): &(BoundValue, Image)| {
                    (*bound, convention.undone_bound(scene, surface, *bound, frame))
                };
                let bound = frames.bound.iter().map(undone).collect();
                judge_pass_frames(case, &PassFrames { bound, positions: frames.positions.clone() })
            });
            let kept: Option<Vec<Check>> = pass.map(|check| Some(check).filter(fits)).collect();
            let Some(kept) = kept else { continue };
            let fragments: Vec<(usize, Check)> = self
                .fragments
                .iter()
                .map(|(case, index, image)| {
                    let (scene, surface) = (&case.expected.scene, &case.probe_film.surface);
                    let image = convention.undone_stage(scene, surface, image);
                    (*index, fragment(CHECKS[*index].0, case, &image, *index == 2, tolerances))
                })
                .collect();
            let keeps = |wanted: usize| {
                let own = || fragments.iter().filter(|(index, _)| *index == wanted);
                own().all(|(_, check)| fits(check))
                    && own().any(|(_, check)| check.verdict == Verdict::Pass)
            };
            if keeps(1) || keeps(2) {
                let name = convention.name();
                let judged = kept.into_iter().chain(fragments.into_iter().map(|(_, check)| check));
                checks.extend(judged.map(|check| {
                    let summary = format!("{} (convention: {name})", check.summary);
                    Check { convention: name.clone(), summary, ..check }
                }));
            }
        }
        checks
    }
}

/// The frames of each scene under all sets of stages.
fn under<'a>(cases: &'a [PreparedScene], sets: &[Vec<StageText>]) -> Vec<Vec<FrameRequest<'a>>> {
    let frames = |case: &'a PreparedScene| {
        sets.iter().map(|set| FrameRequest::probe(case, set.clone())).collect()
    };
    cases.iter().map(frames).collect()
}

/// A vertex stage with stages of ours that show the positions, and the normals, that it forwards.
pub fn positions_and_normals(vertex: &str) -> [Vec<StageText>; 2] {
    let under = |show: &str| named([vertex.to_owned(), show.to_owned(), show.to_owned()]);
    [SHOW_POSITION, SHOW_NORMAL].map(under)
}

/// What can be asked of a stage.
enum Swap {
    /// Nothing: it is the template's.
    Untouched,
    /// Nothing: there is no such file, or nobody names it.
    Absent,
    /// These of the sets of stages show it.
    Drawn(Range<usize>),
}

/// How each stage is looked at, and the sets of stages that it takes, the same for every scene.
fn swaps(stages: &Stages) -> ([Swap; 3], Vec<Vec<StageText>>) {
    let mut sets = Vec::new();
    let swaps = [0, 1, 2].map(|index| {
        if stages.is_template(index) {
            return if stages.is_named(index) { Swap::Untouched } else { Swap::Absent };
        }
        let Some(own) = &stages.own[index] else { return Swap::Absent };
        let begin = sets.len();
        if index == 0 {
            sets.extend(positions_and_normals(own));
        } else {
            let mut texts = [vertex_for(own), BLACK.to_owned(), BLACK.to_owned()];
            texts[index].clone_from(own);
            sets.push(named(texts));
        }
        Swap::Drawn(begin..sets.len())
    });
    (swaps, sets)
}

/// The images of a scene's frames, or the first outcome that is none.
fn images<'a>(case: &PreparedScene, outcomes: &'a [Outcome]) -> Result<Vec<Image>, &'a Outcome> {
    let (width, height) = (case.probe_film.width, case.probe_film.height);
    let floats = (3 * width * height) as usize;
    let mut images = Vec::new();
    for outcome in outcomes {
        let Outcome::Done(answer) = outcome else { return Err(outcome) };
        images
            .extend(answer.values.chunks(floats).map(|frame| session::image(frame, width, height)));
    }
    Ok(images)
}

/// Judges a pass by one bound value and the world positions that it draws, where both are there.
pub fn pass_check_of(case: &PreparedScene, bound: BoundValue, outcomes: &[Outcome]) -> Verdict {
    match images(case, outcomes).as_deref() {
        Ok([value, positions]) => {
            let (bound, positions) = (vec![(bound, value.clone())], positions.clone());
            judge_pass_frames(case, &PassFrames { bound, positions }).verdict
        }
        _ => Verdict::NotJudged,
    }
}

pub fn pass_check(case: &PreparedScene, outcomes: &[Outcome]) -> Check {
    match pass_frames(case, outcomes) {
        Ok(frames) => judge_pass_frames(case, &frames),
        Err(check) => *check,
    }
}

/// The frames that show what a pass binds, or else the check that says why there are none.
fn pass_frames(case: &PreparedScene, outcomes: &[Outcome]) -> Result<PassFrames, Box<Check>> {
    let (id, name) = (CheckId::PassUniforms, &case.entry.name);
    let mut images = match images(case, outcomes) {
        Ok(images) => images,
        // Its own frame decides: a pass with a layout of its own takes no stages of ours.
        Err(Outcome::Failed(message)) => return Err(Box::new(not_possible(id, case, message))),
        Err(outcome) => return Err(Box::new(session::unanswered(id, name, &["2.1"], outcome))),
    };
    // Each frame shows another value. A pass with pipelines of its own takes no stages of ours.
    // By bits: a NaN in all of them is the same.
    let bits = |image: &Image| -> Vec<[u32; 3]> {
        image.pixels.iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect()
    };
    let first = bits(&images[0]);
    let is_same = |image: &Image| bits(image) == first;
    let shows = |image: &Image| image.pixels.iter().any(|pixel| *pixel != Vec3::ZERO);
    if images.iter().all(is_same) && images.iter().any(shows) {
        let summary = "cannot be judged alone: the pass draws the same under all stages";
        return Err(Box::new(Check::new(id, name, Verdict::NotJudged, summary)));
    }
    let Some(positions) = images.pop() else { unreachable!("each value has a frame") };
    Ok(PassFrames { bound: BoundValue::ALL.into_iter().zip(images).collect(), positions })
}

fn judge_pass_frames(case: &PreparedScene, frames: &PassFrames) -> Check {
    judge_pass_by(case, frames, &|_, _| true)
}

fn judge_pass_by(
    case: &PreparedScene,
    frames: &PassFrames,
    wanted: &dyn Fn(BoundValue, usize) -> bool,
) -> Check {
    on_film(CheckId::PassUniforms, case, |film, name| {
        judge_pass(name, film, &frames.bound, &frames.positions, wanted)
    })
}

/// Judges on the small film of a scene.
pub fn on_film(
    id: CheckId,
    case: &PreparedScene,
    judge: impl FnOnce(&StageFilm, &str) -> Check,
) -> Check {
    let (scene, small, name) = (&case.expected.scene, &case.probe_film, &case.entry.name);
    match scene.camera(small.surface.width, small.surface.height) {
        Ok(camera) => {
            let (surface, mask) = (&small.surface, &small.unshadowed_mask);
            judge(&StageFilm { scene, camera, surface, mask }, name)
        }
        Err(error) => Check::new(id, name, Verdict::NotRun, error.to_string()),
    }
}

fn fragment(
    id: CheckId,
    case: &PreparedScene,
    image: &Image,
    phong: bool,
    tolerances: &Tolerances,
) -> Check {
    let small = &case.probe_film;
    let own = |region: &Region| (region.exponent > 0.0) == phong;
    let wanted = images::only(&small.unshadowed_mask, &own);
    let expected = (&small.unshadowed, small.interpolated_normals.as_ref());
    let check = images::judge_shaded(id, &case.entry.name, image, expected, &wanted, tolerances);
    let scene = &case.expected.scene;
    check.priced(|raw| pixels::price(scene, image, &small.unshadowed_mask, &own, raw))
}

/// Keeps for the diagnosis what one of the two fragment stages draws.
fn record_fragment(session: &Session, case: &PreparedScene, image: &Image, phong: bool) {
    let mask = &case.probe_film.unshadowed_mask;
    let pixels = image.pixels.iter().zip(&mask.pixels).enumerate();
    let own = pixels.filter(|(_, (_, value))| {
        **value & RegionMask::INDEX != 0 && (mask.region(**value).exponent > 0.0) == phong
    });
    let own = own.map(|(index, (pixel, _))| (index, (*pixel).into()));
    let tile = Thumbnail::of_pixels((image.width, image.height), own);
    session.record(View::new(ViewKind::Fragment, &case.entry.name), tile);
}

/// The check for a stage that draws nothing under our pass. One that is no WGSL is at fault where a
/// frame fails; whether another only has a layout of its own shows in the student's own frame.
fn swap_failed(
    session: &Session,
    id: CheckId,
    case: &PreparedScene,
    fails: bool,
    outcome: &Outcome,
) -> Check {
    match outcome {
        Outcome::StageRefused(message) if !fails => {
            let summary = format!("no frame needs it, but {}", headline(message));
            Check::new(id, &case.entry.name, Verdict::NotJudged, summary)
        }
        Outcome::StageRefused(message) => {
            session.keep_compiler_message(case.held_back, message);
            session::unanswered(id, &case.entry.name, &[], outcome)
        }
        Outcome::Failed(message) => not_possible(id, case, message),
        other => session::unanswered(id, &case.entry.name, &[], other),
    }
}

/// A swap that the graphics library refuses is no fault.
fn not_possible(id: CheckId, case: &PreparedScene, message: &str) -> Check {
    let summary = format!("cannot be judged alone: {}", headline(message));
    Check::new(id, &case.entry.name, Verdict::NotJudged, summary)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pass_takes_stages_if_none_can_be_drawn_without_wgsl() {
        use crate::worker::Answer;
        assert!(needs_wgsl(&Outcome::StageRefused("expected global item".into())));
        assert!(needs_wgsl(&Outcome::Failed("a pipeline is refused".into())));
        // It draws the same whatever the host hands to it.
        assert!(!needs_wgsl(&Outcome::Done(Answer { values: vec![0.5; 3], ..Answer::default() })));
    }

    #[test]
    fn an_input_that_nobody_writes_is_the_cause_and_not_what_comes_of_it() {
        let stages = |phong: &str| {
            let mut stages = Stages::default();
            stages.own =
                [None, Some("fn fs_main(@location(1) n: vec3f)".into()), Some(phong.into())];
            stages
        };
        let said = |phong: &str, verdict, own: &str| {
            let mut checks = [Check::new(CheckId::StagePhong, "s", verdict, "not finite")];
            let own = Check::new(CheckId::ImageRealtime, "s", Verdict::Fail, own);
            refuse_inputs(&mut checks, &[own], &stages(phong));
            let [check] = checks;
            check.summary
        };
        let (takes, refused) =
            ("fn fs_main(@location(5) n: vec3f)", "label = 'phong.fs': it takes");
        assert_eq!(said(takes, Verdict::Fail, refused), refused);
        assert_eq!(said(takes, Verdict::Pass, refused), "not finite");
        assert_eq!(said(takes, Verdict::Fail, "label = 'diffuse.fs': it takes"), "not finite");
        assert_eq!(said("fn fs_main(@location(1) n: vec3f)", Verdict::Fail, refused), "not finite");
    }
}
