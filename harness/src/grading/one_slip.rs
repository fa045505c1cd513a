//! A wrong picture of a renderer whose pass and stages are right alone, or cannot all be exchanged: one slip may
//! explain its frames on all scenes, and is charged to the part that it belongs to.

use std::path::Path;

use basecode::{Image, Matrices, Vec3};

use super::draw::{FrameRequest, draw_each, draw_one_each, pictures};
use super::host_changes::{HostChange, MendedBy, UnsetLight, slip_of_matrices};
use super::isolate::{on_film, positions_and_normals};
use super::line_edits::{self, LineEdit};
use super::offline::Drawn;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use super::stages::{MOVED, Moved, Stages, matrices};
use crate::evidence::frame_slips::{FrameSlips, LeftBySlip};
use crate::evidence::images::{self, ImageKind};
use crate::evidence::price::{self, Price, PriceClass, SURFACES_MISSING};
use crate::evidence::vertex::judge_vertex;
use crate::evidence::{Check, CheckId, Verdict};
use crate::imaging::reference::{Region, RegionMask};
use crate::imaging::tolerances::Tolerances;
use crate::worker::{Outcome, STAGES, StageText};

/// Pass and stages, each alone.
const ALONE: [CheckId; 4] =
    [CheckId::PassUniforms, ALONE_STAGES[0], ALONE_STAGES[1], ALONE_STAGES[2]];
/// The stages in the order of [`STAGES`].
const ALONE_STAGES: [CheckId; 3] =
    [CheckId::StageVertex, CheckId::StageDiffuse, CheckId::StagePhong];

/// The convention of parts that one slip pays for.
const ONE_SLIP: &str = "one slip explains every frame";

/// What the slip may leave of a scene's picture unexplained.
const LEFT: f64 = 0.01;

/// What explains the wrong frames of a renderer.
#[derive(Default)]
pub struct Found {
    /// The checks under which it pays for all.
    pub checks: Vec<Check>,
    /// What the host changes to have the pass draw the right pictures, if that is how it is known.
    pub mended_by: Option<MendedBy>,
    /// Whether some surfaces are not drawn, and no more is wrong.
    pub is_of_missing_surfaces: bool,
}

impl Found {
    fn of(checks: Vec<Check>) -> Self {
        Self { checks, ..Self::default() }
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
    let is_wrong = |case: &PreparedScene| {
        let own =
            |check: &Check| check.scene == case.entry.name && check.id == CheckId::ImageRealtime;
        found.iter().any(|check| own(check) && check.verdict == Verdict::Fail)
    };
    let wrong: Vec<bool> = cases.iter().map(is_wrong).collect();
    let first = wrong.iter().position(|wrong| *wrong).unwrap_or_default();
    let Some(first) = cases.get(first) else { return Found::default() };
    let renderer = WrongRenderer { session, plugin, cases, first, wrong, found, tolerances };
    let frame = |case: &PreparedScene| {
        let own =
            |drawn: &&Drawn| drawn.scene == case.entry.name && drawn.kind == ImageKind::Realtime;
        drawn.iter().find(own).map(|drawn| &drawn.image)
    };
    // A pipeline that cannot be drawn with leaves no frame.
    let frames: Option<Vec<&Image>> = cases.iter().map(frame).collect();
    let Some(frames) = frames else {
        return renderer.by_host_changes(HostChange::of_pipelines()).unwrap_or_default();
    };
    let slips = slips_of_frames(cases, &frames, &renderer.wrong);
    // What costs least is asked first.
    let found = renderer
        .by_frames(&slips)
        .or_else(|| renderer.by_moved_frames(&frames))
        .or_else(|| renderer.by_host_changes(HostChange::all()))
        .or_else(|| renderer.by_unset_light(&frames))
        .or_else(|| renderer.by_line_edits(stages))
        .or_else(|| renderer.by_missing_surfaces(&slips));
    match found {
        Some(found) => found,
        None if ALONE.into_iter().any(|id| renderer.fails(id)) => Found::default(),
        None => Found::of(vertex_under_own_pass(session, plugin, cases, stages)),
    }
}

/// A renderer with wrong frames, and what is known of it.
struct WrongRenderer<'a> {
    session: &'a Session<'a>,
    plugin: &'a Path,
    cases: &'a [PreparedScene],
    /// The first of them that it draws wrongly.
    first: &'a PreparedScene,
    /// Which of them it draws wrongly.
    wrong: Vec<bool>,
    /// The checks of pass, stages and frames.
    found: &'a [Check],
    tolerances: &'a Tolerances,
}

impl WrongRenderer<'_> {
    /// Whether a part is wrong, or cannot be told.
    fn fails(&self, id: CheckId) -> bool {
        let is_open = |check: &Check| matches!(check.verdict, Verdict::Pass | Verdict::NotJudged);
        self.found.iter().any(|check| check.id == id && !is_open(check))
    }

    /// Whether no part but this one is wrong alone.
    fn others_are_open(&self, id: CheckId) -> bool {
        ALONE.into_iter().all(|of| of == id || !self.fails(of))
    }

    /// What slips of the parts `ids` at a place in the source cost, and all others nothing.
    fn slips(&self, ids: &[CheckId], (name, class): (&str, PriceClass), place: &str) -> Found {
        let scene = |(case, wrong): (&PreparedScene, &bool)| {
            let own = |other| (ids.contains(&other) && *wrong).then_some((name, class, place));
            // What a pass shows by itself tells more than its frames.
            let shown = |other| {
                let own = |check: &&Check| check.id == other && check.scene == case.entry.name;
                let is_worse =
                    |check: &&Check| check.verdict == Verdict::Fail && check.error > class.price();
                let pass = ids.contains(&other) && other == CheckId::PassUniforms;
                self.found.iter().filter(|_| pass).find(own).filter(is_worse)
            };
            ALONE.map(|other| match shown(other) {
                Some(shown) => Check { convention: ONE_SLIP.to_owned(), ..shown.clone() },
                None => explained(other, case, own(other)),
            })
        };
        Found::of(self.cases.iter().zip(&self.wrong).flat_map(scene).collect())
    }

    fn slip(&self, id: CheckId, name: &str) -> Found {
        self.slips(&[id], (name, PriceClass::Slip), "")
    }

    /// By what the frames themselves show.
    fn by_frames(&self, slips: &[(CheckId, &str)]) -> Option<Found> {
        // Of a stage that is wrong alone its own frames tell.
        let vertex = CheckId::StageVertex;
        let is_open = |id| self.others_are_open(id) && !(id == vertex && self.fails(vertex));
        let mut open = slips.iter().filter(|(id, name)| is_open(*id) && *name != SURFACES_MISSING);
        open.next().map(|(id, name)| self.slip(*id, name))
    }

    /// By frames that are moved as a whole.
    fn by_moved_frames(&self, frames: &[&Image]) -> Option<Found> {
        let id = CheckId::StageVertex;
        let is_moved = |(_, moved): &&Moved| {
            let moved = frames.iter().map(|frame| Some(moved(frame)));
            are_right(self.cases, moved.collect(), Film::Whole, self.tolerances)
        };
        let mut moved = MOVED.iter().filter(|_| self.others_are_open(id));
        moved.find(is_moved).map(|(name, _)| self.slip(id, name))
    }

    /// By what the host changes of what the pass is given.
    fn by_host_changes(&self, changes: Vec<HostChange>) -> Option<Found> {
        let is_open = |change: &HostChange| match change {
            // The matrices of a stage that is wrong alone are told by its own frames.
            HostChange::Matrices(_) if self.fails(change.part()) => false,
            _ => self.others_are_open(change.part()),
        };
        let open: Vec<HostChange> = changes.into_iter().filter(is_open).collect();
        let stages: Vec<StageText> = open.iter().map(HostChange::stage).collect();
        let hopeful = open.iter().zip(self.mend_first(&stages)).filter(|(_, right)| *right);
        let mends = |stage: &StageText| self.is_mended_by(&|_| stage.clone());
        let slip = |change: &HostChange| -> Option<((&str, PriceClass), HostChange)> {
            let mended = || mends(&change.stage()).then(|| change.clone());
            match change {
                HostChange::Pipelines(name, _) => Some(((name, PriceClass::Slip), mended()?)),
                HostChange::Normals => {
                    Some((("the normal is negated", PriceClass::Slip), mended()?))
                }
                HostChange::Matrices(_) => {
                    let (slip, which) = slip_of_matrices(&|which| mends(&matrices(which)))?;
                    Some((slip, HostChange::Matrices(which)))
                }
            }
        };
        let (slip, change) = hopeful.map(|(change, _)| change).find_map(slip)?;
        let mended_by = Some(MendedBy::Stage(change.stage()));
        Some(Found { mended_by, ..self.slips(&[change.part()], slip, "") })
    }

    /// By a light that is not set, where no surface is lit.
    fn by_unset_light(&self, frames: &[&Image]) -> Option<Found> {
        let id = CheckId::PassUniforms;
        let is_dark = |(case, frame): (&PreparedScene, &&Image)| {
            let mask = &case.expected.unshadowed_mask;
            let surface = |value: u16| {
                value & RegionMask::INDEX != 0
                    && value & (RegionMask::EDGE | RegionMask::EMITTER) == 0
            };
            let mut own =
                frame.pixels.iter().zip(&mask.pixels).filter(|(_, value)| surface(**value));
            own.all(|(pixel, _)| *pixel == Vec3::ZERO)
        };
        if !self.others_are_open(id) || !self.cases.iter().zip(frames).all(is_dark) {
            return None;
        }
        let stages = UnsetLight::ALL.map(|unset| unset.stage(self.first));
        let hopeful = UnsetLight::ALL.into_iter().zip(self.mend_first(&stages));
        let mut hopeful = hopeful.filter(|(_, right)| *right).map(|(unset, _)| unset);
        let unset = hopeful.find(|unset| self.is_mended_by(&|case| unset.stage(case)))?;
        let mended_by = Some(MendedBy::Light(unset));
        Some(Found { mended_by, ..self.slips(&[id], unset.slip(), "") })
    }

    /// By one word of one line of the submission's own WGSL.
    fn by_line_edits(&self, stages: &Stages) -> Option<Found> {
        let edits = line_edits::all(stages).into_iter();
        let edits: Vec<LineEdit> = edits.filter(|edit| pays(edit, self.found)).collect();
        line_edits::batches(&edits).find_map(|edits| {
            let stages: Vec<StageText> = edits.iter().map(LineEdit::stage).collect();
            let hopeful = edits.iter().zip(&stages).zip(self.mend_first(&stages));
            let mut hopeful = hopeful.filter(|(_, right)| *right).map(|(edit, _)| edit);
            let (edit, stage) =
                hopeful.find(|(_, stage)| self.is_mended_by(&|_| (*stage).clone()))?;
            let slip = (edit.name, PriceClass::Slip);
            let of = self.slips(&paying(edit, self.found), slip, &edit.place());
            Some(Found { mended_by: Some(MendedBy::Stage(stage.clone())), ..of })
        })
    }

    /// By surfaces that are not drawn, where that is what is wrong with most frames.
    fn by_missing_surfaces(&self, slips: &[(CheckId, &str)]) -> Option<Found> {
        let hole = |check: &&Check| {
            check.id == CheckId::ImageRealtimeCoverage && check.verdict == Verdict::Fail
        };
        let holes = self.found.iter().filter(hole).count();
        let wrong = self.wrong.iter().filter(|wrong| **wrong).count();
        let (id, name) = slips.iter().find(|(_, name)| *name == SURFACES_MISSING)?;
        let explains = self.others_are_open(*id) && 2 * holes > wrong;
        explains.then(|| Found { is_of_missing_surfaces: true, ..self.slip(*id, name) })
    }

    /// Whether the pass draws the first wrong scene rightly under each change of the host's: one worker tries all.
    fn mend_first<'a>(&self, stages: impl IntoIterator<Item = &'a StageText>) -> Vec<bool> {
        let frame = |stage: &StageText| FrameRequest::probe(self.first, vec![stage.clone()]);
        let frames: Vec<FrameRequest> = stages.into_iter().map(frame).collect();
        let scene = std::slice::from_ref(self.first);
        let is_right = |image| are_right(scene, vec![image], Film::Small, self.tolerances);
        pictures(self.session, self.plugin, &frames).into_iter().map(is_right).collect()
    }

    /// Whether the pass draws every scene rightly where the host changes what it is given.
    fn is_mended_by(&self, stage: &dyn Fn(&PreparedScene) -> StageText) -> bool {
        let frame = |case| FrameRequest::probe(case, vec![stage(case)]);
        let frames: Vec<FrameRequest> = self.cases.iter().map(frame).collect();
        let is_right = |case: &PreparedScene, outcome: &Outcome| {
            let picture = FrameRequest::probe(case, Vec::new()).picture(outcome);
            are_right(std::slice::from_ref(case), vec![picture], Film::Small, self.tolerances)
        };
        let outcomes = draw_one_each(self.session, self.plugin, &frames, &is_right);
        let pictures = frames.iter().zip(&outcomes);
        let pictures = pictures.map(|(frame, outcome)| frame.picture(outcome)).collect();
        are_right(self.cases, pictures, Film::Small, self.tolerances)
    }
}

/// The parts of an edit: what reaches it and draws wrongly.
fn paying(edit: &LineEdit, found: &[Check]) -> Vec<CheckId> {
    if !edit.of.fragment {
        return vec![CheckId::StageVertex];
    }
    let fails =
        |id: CheckId| found.iter().any(|check| check.id == id && check.verdict == Verdict::Fail);
    let stages = [
        (CheckId::StageDiffuse, CheckId::ImageRealtimeDiffuse),
        (CheckId::StagePhong, CheckId::ImageRealtimePhong),
    ];
    stages.into_iter().filter(|(_, frames)| fails(*frames)).map(|(stage, _)| stage).collect()
}

/// Whether an edit may mend what nothing else explains: its parts lose more than a slip, and no other is wrong alone.
fn pays(edit: &LineEdit, found: &[Check]) -> bool {
    let ids = paying(edit, found);
    let failed = |id: CheckId| {
        found.iter().filter(move |check| check.id == id && check.verdict == Verdict::Fail)
    };
    let open = |id: CheckId| {
        let lost: Vec<&Check> = failed(id).collect();
        let concept = PriceClass::Concept.price() - 1e-3;
        let of_concept = |check: &&&Check| price::is_explained(check) && check.error >= concept;
        let is_concept = 2 * lost.iter().filter(of_concept).count() > lost.len();
        let unexplained = |check: &&Check| {
            !price::are_slight(std::iter::once(*check)) && !price::is_explained(check)
        };
        lost.iter().any(unexplained) && !is_concept
    };
    let is_judged = |id: CheckId| {
        let mut own = found.iter().filter(|check| check.id == id);
        own.any(|check| matches!(check.verdict, Verdict::Pass | Verdict::Fail))
    };
    let by_frames = |id: CheckId| match id {
        CheckId::StageDiffuse => CheckId::ImageRealtimeDiffuse,
        CheckId::StagePhong => CheckId::ImageRealtimePhong,
        _ => CheckId::ImageRealtimeCoverage,
    };
    let alone = ALONE.into_iter().all(|id| ids.contains(&id) || failed(id).next().is_none());
    // What stands in the file of a stage that is right alone is right.
    let of_file = |(name, _): &(&str, CheckId)| edit.file == format!("shaders/{name}.wgsl");
    let stage = STAGES.into_iter().zip(ALONE_STAGES).find(of_file);
    let is_right = stage.is_some_and(|(_, id)| is_judged(id) && failed(id).next().is_none());
    let lost = |id: &CheckId| open(if is_judged(*id) { *id } else { by_frames(*id) });
    // Where nothing can be judged alone, surfaces that are missing are the fragment stage's as well.
    let missing = !is_judged(CheckId::PassUniforms) && open(CheckId::ImageRealtimeCoverage);
    alone && !is_right && (ids.iter().any(lost) || missing)
}

/// The check of a part under the mistake that explains all frames: where it is the part's own.
fn explained(id: CheckId, case: &PreparedScene, own: Option<(&str, PriceClass, &str)>) -> Check {
    let scene = &case.entry.name;
    let convention = ONE_SLIP.to_owned();
    let Some((name, class, place)) = own else {
        let summary = "right but for the one slip that explains every frame";
        return Check { convention, ..Check::new(id, scene, Verdict::Pass, summary) };
    };
    let (error, mistake) = (class.price(), name.to_owned());
    let place = if place.is_empty() { String::new() } else { format!(" in {place}") };
    let summary =
        format!("one slip explains the submission's own frames on every scene: {name}{place}");
    Check { error, mistake, convention, ..Check::new(id, scene, Verdict::Fail, summary) }
}

/// The slips with what reaches the fragment stages that explain the frames of all scenes, some of them by light on
/// diffuse and on Phong surfaces. One must explain every right frame and most of the `wrong` ones, because on one scene
/// noise may decide what a surface shows.
fn slips_of_frames(
    cases: &[PreparedScene],
    frames: &[&Image],
    wrong: &[bool],
) -> Vec<(CheckId, &'static str)> {
    let frames = cases.iter().zip(frames).map(|(case, frame)| {
        let expected = &case.expected;
        FrameSlips::new(&expected.scene, frame, &expected.unshadowed_mask)
    });
    let frames: Option<Vec<FrameSlips>> = frames.collect();
    let Some(frames) = frames.filter(|frames| !frames.is_empty()) else { return Vec::new() };
    let slips = frames[0].names();
    // Kinds of surfaces that there are: what leaves one of them dark explains nothing that is wrong with it.
    let kinds = [false, true].map(|phong| {
        let own = |region: &Region| region.lit && (region.exponent > 0.0) == phong;
        cases.iter().any(|case| case.expected.unshadowed_mask.regions.iter().any(own))
    });
    // Most slips are told by a few pixels of each frame.
    let may_explain = |index: usize| {
        let surely_not = |is_wrong: bool| {
            let own = frames.iter().zip(wrong).filter(move |(_, wrong)| **wrong == is_wrong);
            own.filter(|(frame, _)| frame.surely_leaves_more(index, LEFT)).count()
        };
        let count = wrong.iter().filter(|wrong| **wrong).count();
        2 * surely_not(true) < count && surely_not(false) == 0
    };
    let explains = |index: usize| {
        let lefts: Vec<LeftBySlip> = frames.iter().map(|frame| frame.left(index)).collect();
        let of = |is_wrong: bool| {
            let own = lefts.iter().zip(wrong).filter(move |(_, wrong)| **wrong == is_wrong);
            own.map(|(left, _)| left)
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
        let explains_kind = |kind: usize| {
            let all = of(true).chain(of(false));
            let lit: Vec<f64> = all.filter_map(|left| left.left_of_lit[kind]).collect();
            let explained = lit.iter().filter(|left| **left <= LEFT).count();
            // What a pass leaves out may be all of a kind, and is then nobody's to know.
            let is_dark = lit.is_empty() && slips[index].1 != SURFACES_MISSING;
            is_dark || 2 * explained > lit.len()
        };
        let all_kinds = (0..kinds.len()).all(|kind| !kinds[kind] || explains_kind(kind));
        of(false).all(|left| left.left <= LEFT) && most(false) && most(true) && all_kinds
    };
    let found = (0..slips.len()).filter(|index| may_explain(*index) && explains(*index));
    found.map(|index| slips[index]).collect()
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
    let frames: Vec<FrameRequest> = cases
        .iter()
        .flat_map(|case| sets.clone().map(|set| FrameRequest::probe(case, set)))
        .collect();
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
        checks.push(
            check.priced(|raw| Price::of_raw(raw).or("another matrix", PriceClass::Slip, 0.0)),
        );
    }
    // Right there as well: nothing is explained.
    if checks.iter().any(|check| check.verdict == Verdict::Fail) { checks } else { Vec::new() }
}
