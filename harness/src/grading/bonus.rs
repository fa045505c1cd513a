//! The bonus: frames with shadows, judged beside those without.

use std::path::Path;

use basecode::gpu::{EMPTY_MAPS, Footprint};
use basecode::{Image, Vec3};

use super::draw::{FrameRequest, draw, draw_one_each, pictures, pictures_of_scenes};
use super::frame_checks::{RegionCheck, drawn, judge_regions, shadows};
use super::judged::Judged;
use super::line_edits::{self, LineEdit};
use super::offline::Drawn;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use super::stages::{MOVED, Moved, Stages, negated_normals};
use super::zoomed;
use crate::evidence::images::ImageKind;
use crate::evidence::price::{self, PriceClass};
use crate::evidence::shadow_map::Shadows;
use crate::evidence::stages::VERTEX;
use crate::evidence::{Check, CheckId, Verdict};
use crate::expected::Expected;
use crate::imaging::reference::RegionMask;
use crate::imaging::tolerances::Tolerances;
use crate::worker::{Outcome, STAGES, StageText};

/// Draws every scene with shadows and judges the images; `judged` is what is known of those without, and gets the
/// checks.
pub fn judge(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    stages: &Stages,
    judged: &mut [Judged],
    tolerances: &Tolerances,
) {
    // Workers of their own: the bonus may crash without a trace on the others.
    let mut frames: Vec<FrameRequest> = cases.iter().filter_map(FrameRequest::bonus).collect();
    // What this one takes is looked at, and must not be there from another.
    frames.sort_by_key(|frame| !frame.case.entry.bonus_required);
    let is_right = |case: &PreparedScene, outcome: &Outcome| {
        let picture = FrameRequest::plain(case).picture(outcome);
        picture.is_some_and(|image| of_image(case, &image, tolerances).verdict == Verdict::Pass)
    };
    let outcomes = draw_one_each(session, plugin, &frames, &is_right);
    let shown = |outcome: (&FrameRequest, &Outcome)| {
        let (FrameRequest { case, .. }, outcome) = outcome;
        let kind = ImageKind::RealtimeShadows;
        match drawn(session, case, kind, CheckId::BonusImage, outcome) {
            Ok(drawn) => (of_image(case, &drawn.image, tolerances), Some(drawn)),
            Err(check) => (*check, None),
        }
    };
    let mut found: Vec<(Check, Option<Drawn>)> = frames.iter().zip(&outcomes).map(shown).collect();
    let of_scene =
        |frame: &FrameRequest| cases.iter().position(|case| std::ptr::eq(case, frame.case));
    let plain =
        |frame: &FrameRequest| judged[of_scene(frame)?].drawn.first().map(|drawn| &drawn.image);
    let wrong = frames.iter().zip(&mut found).filter_map(|(frame, (check, drawn))| {
        let with = &drawn.as_ref().filter(|_| check.verdict == Verdict::Fail)?.image;
        let (case, without) = (frame.case, plain(frame));
        let (by_visibility, may_pass) = (None, [false; 3]);
        Some(WrongBonus { case, with, without, by_visibility, may_pass, check })
    });
    judge_visibility(session, plugin, wrong.collect(), tolerances);
    for ((frame, outcome), (check, drawn)) in frames.iter().zip(&outcomes).zip(&mut found) {
        let case = frame.case;
        if matches!(outcome, Outcome::Failed(_))
            && let Some(rest) = judge_without_stages(session, plugin, case, stages, tolerances)
        {
            *check = rest;
        }
        let required = case.entry.bonus_required;
        check.id = if required { CheckId::BonusProbe } else { CheckId::BonusImage };
        // How shadows come about is the same on all scenes.
        if required
            && passes(check)
            && let Some(with) = drawn.as_ref().map(|drawn| &drawn.image)
            && let Some(footprint) = outcome.answer().and_then(|answer| answer.footprint)
            && shows_its_shadows(case, with, plain(frame), tolerances)
            && let Some(why) = no_shadow_map(session, plugin, frame, &footprint, with)
        {
            (check.error, check.verdict, check.summary) = (1.0, Verdict::Fail, why);
        }
    }
    let of_scene: Vec<Option<usize>> = frames.iter().map(of_scene).collect();
    for (index, (check, drawn)) in of_scene.into_iter().zip(found) {
        if let Some(index) = index {
            judged[index].checks.push(check);
            judged[index].drawn.extend(drawn);
        }
    }
}

/// The verdict on an image with shadows as a whole.
fn of_image(case: &PreparedScene, image: &Image, tolerances: &Tolerances) -> Check {
    let whole: RegionCheck = (CheckId::BonusImage, &|_| true);
    judge_regions(case, ImageKind::RealtimeShadows, image, whole, tolerances)
}

/// A scene whose frame with shadows is wrong.
struct WrongBonus<'a> {
    case: &'a PreparedScene,
    with: &'a Image,
    /// The frame without shadows.
    without: Option<&'a Image>,
    /// The verdict by visibility: one that passes, or the first one.
    by_visibility: Option<Check>,
    /// Which of the tries may mend it.
    may_pass: [bool; 3],
    /// The verdict on the image, and in the end on the scene.
    check: &'a mut Check,
}

fn passes(check: &Check) -> bool {
    check.verdict == Verdict::Pass
}

impl WrongBonus<'_> {
    fn is_open(&self) -> bool {
        !self.by_visibility.as_ref().is_some_and(passes)
    }

    fn take(&mut self, found: Option<Check>) {
        if self.by_visibility.is_none() || found.as_ref().is_some_and(passes) {
            self.by_visibility = found;
        }
    }
}

/// What is done to a frame with shadows and the one without: number of frames, the last of which is looked at, and
/// stages of ours.
type Tried = (usize, Vec<StageText>);

/// Judges wrong shadows by visibility alone. The image without shadows is the student's own. If that fails, it is drawn
/// with a vertex stage of ours, moved as a whole, with negated normals, with another field of view, or as the second of
/// two frames. What these repair is no fault of the shadows. The verdict on the image stands if none of them decides.
fn judge_visibility(
    session: &Session,
    plugin: &Path,
    mut scenes: Vec<WrongBonus>,
    tolerances: &Tolerances,
) {
    let judge = |case: &PreparedScene, with: &Image, without: &Image| {
        shadows(case).judge(&case.entry.name, with, without, tolerances)
    };
    for scene in &mut scenes {
        scene.take(scene.without.and_then(|without| judge(scene.case, scene.with, without)));
    }
    let vertex = StageText { name: STAGES[0].to_owned(), text: VERTEX.to_owned() };
    let tries: [Tried; 3] = [(1, vec![vertex]), (1, vec![negated_normals()]), (2, Vec::new())];
    find_hopeful(session, plugin, &mut scenes, &tries, tolerances);
    // What a try makes of the whole films of the scenes that it may mend.
    let drawn_again = |scenes: &[WrongBonus], tried: usize| -> Vec<Option<Check>> {
        let frames = scenes.iter().map(|scene| {
            // Where nothing else can be judged, a vertex stage of ours must do.
            let decides = tried == 0 && scene.by_visibility.is_none();
            let wanted = scene.is_open() && (scene.may_pass[tried] || decides);
            let frame = FrameRequest::bonus(scene.case).filter(|_| wanted);
            frame.map_or(Vec::new(), |frame| both(frame, &tries[tried]))
        });
        let frames: Vec<_> = frames.collect();
        let pictures = pictures_of_scenes(session, plugin, &frames);
        let verdict = |(scene, pictures): (&WrongBonus, &Vec<Option<Image>>)| {
            let [with, without] = pictures.as_slice() else { return None };
            judge(scene.case, with.as_ref()?, without.as_ref()?)
        };
        scenes.iter().zip(&pictures).map(verdict).collect()
    };
    let with_vertex_stage = drawn_again(&scenes, 0);
    scenes.iter_mut().zip(with_vertex_stage).for_each(|(scene, found)| scene.take(found));
    for scene in scenes.iter_mut().filter(|scene| scene.is_open()) {
        let moved =
            |(_, moved): &Moved| judge(scene.case, &moved(scene.with), &moved(scene.without?));
        if let Some(right) = MOVED.iter().find_map(|way| moved(way).filter(passes)) {
            scene.take(Some(right));
        }
    }
    let take_right = |scenes: &mut [WrongBonus], found: Vec<Option<Check>>| {
        for (scene, found) in scenes.iter_mut().zip(found) {
            if let Some(right) = found.filter(passes) {
                scene.take(Some(right));
            }
        }
    };
    let negated = drawn_again(&scenes, 1);
    take_right(&mut scenes, negated);
    let zoomed = |scene: &WrongBonus| {
        let case = Some(scene.case).filter(|_| scene.is_open());
        let masks = zoomed::masks(session, plugin, case?)?;
        let shadows = masks.shadows(shadows(scene.case).median_lit);
        shadows.judge(&scene.case.entry.name, scene.with, scene.without?, tolerances)
    };
    let zoomed = scenes.iter().map(zoomed).collect();
    take_right(&mut scenes, zoomed);
    let second = drawn_again(&scenes, 2);
    take_right(&mut scenes, second);
    for scene in scenes {
        if let Some(found) = scene.by_visibility {
            *scene.check = found;
        }
    }
}

/// A frame with shadows and the one without under what is tried.
fn both<'a>(with: FrameRequest<'a>, (times, stages): &Tried) -> Vec<FrameRequest<'a>> {
    let with = FrameRequest { times: *times, stages: stages.clone(), ..with };
    let without = FrameRequest { toml: &with.case.realtime, shadow_map: false, ..with.clone() };
    vec![with, without]
}

/// Finds out which tries may mend a scene: small films tell what is not worth a whole one. Where they tell nothing, it
/// may.
fn find_hopeful(
    session: &Session,
    plugin: &Path,
    scenes: &mut [WrongBonus],
    tries: &[Tried; 3],
    tolerances: &Tolerances,
) {
    let frames = scenes.iter().map(|scene| {
        let small = FrameRequest::small_bonus(scene.case, Vec::new());
        small.filter(|_| scene.is_open()).map_or(Vec::new(), |small| {
            tries.iter().flat_map(|tried| both(small.clone(), tried)).collect()
        })
    });
    let frames: Vec<Vec<FrameRequest>> = frames.collect();
    let pictures = pictures_of_scenes(session, plugin, &frames);
    for (scene, pictures) in scenes.iter_mut().zip(pictures) {
        for (may_pass, pair) in scene.may_pass.iter_mut().zip(pictures.as_chunks().0) {
            let [Some(with), Some(without)] = pair else { continue };
            let judged = small_shadows(scene.case).judge("", with, without, tolerances);
            *may_pass = judged.is_none_or(|judged| judged.verdict != Verdict::Fail);
        }
    }
}

/// Judges the bonus of a submission that draws no frame with it, if a stage is at fault: with Umbra's vertex stage or
/// the template's fragment stage in its place, as with a Rust file that does not build. On what a fragment stage
/// should draw, nothing is in shadow: one that draws nothing earns no more than one without shadows. Returns `None`
/// if no frame comes of it either.
fn judge_without_stages(
    session: &Session,
    plugin: &Path,
    case: &PreparedScene,
    stages: &Stages,
    tolerances: &Tolerances,
) -> Option<Check> {
    let bonus = case.bonus.as_deref()?;
    // The template's vertex stage draws nothing.
    let another = |index: &usize| StageText {
        name: STAGES[*index].to_owned(),
        text: if *index == 0 { VERTEX.to_owned() } else { stages.template[*index].clone() },
    };
    let own: Vec<usize> = [1, 2, 0]
        .into_iter()
        .filter(|&index| stages.own[index].is_some() && !stages.is_template(index))
        .collect();
    let each = own.iter().map(|index| vec![*index]);
    let sets = each.chain((own.len() > 1).then(|| own.clone()));
    let drawn = |toml: &Path, shadow_map, stages: &[StageText]| {
        let frame =
            FrameRequest { toml, shadow_map, stages: stages.to_vec(), ..FrameRequest::plain(case) };
        let outcome = draw(session, Some(plugin), &frame);
        let (width, height) = frame.size;
        outcome.answer().map(|answer| session::image(&answer.values, width, height))
    };
    for set in sets {
        let replaced: Vec<StageText> = set.iter().map(another).collect();
        let Some(mut with) = drawn(bonus, true, &replaced) else { continue };
        let mut without = drawn(&case.realtime, false, &replaced)?;
        let Expected { unshadowed, unshadowed_mask: mask, .. } = &case.expected;
        for (index, value) in mask.pixels.iter().enumerate() {
            let stage = if mask.region(*value).exponent > 0.0 { 2 } else { 1 };
            if set.contains(&stage) {
                with.pixels[index] = unshadowed.pixels[index];
                without.pixels[index] = unshadowed.pixels[index];
            }
        }
        return shadows(case).judge(&case.entry.name, &with, &without, tolerances);
    }
    None
}

fn is_failed_bonus(check: &Check) -> bool {
    let is_bonus = [CheckId::BonusImage, CheckId::BonusProbe].contains(&check.id);
    is_bonus && check.verdict == Verdict::Fail
}

/// Judges the bonus once more where the host's change of what a pass is given mends all frames without shadows: by
/// visibility, and what is right then is right.
pub fn judge_under(
    stage: &dyn Fn(&PreparedScene) -> StageText,
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    tolerances: &Tolerances,
    checks: &mut [Check],
) {
    for check in checks.iter_mut().filter(|check| is_failed_bonus(check)) {
        let Some(case) = cases.iter().find(|case| case.entry.name == check.scene) else { continue };
        let Some(with) = FrameRequest::bonus(case) else { continue };
        let frames = [with, FrameRequest::plain(case)]
            .map(|frame| FrameRequest { stages: vec![stage(case)], ..frame });
        let pictures = pictures(session, plugin, &frames);
        let [Some(with), Some(without)] = pictures.as_slice() else { continue };
        let judged = shadows(case).judge(&check.scene, with, without, tolerances);
        if let Some(judged) =
            judged.filter(|judged| judged.verdict != Verdict::Fail || judged.error < check.error)
        {
            *check = Check { id: check.id, ..judged };
        }
    }
}

/// Judges the bonus once more, by visibility, where the frame without shadows shows what belongs there: elsewhere
/// surfaces are missing that cast shadows all the same.
pub fn judge_where_seen(
    cases: &[PreparedScene],
    drawn: &[Drawn],
    tolerances: &Tolerances,
    checks: &mut [Check],
) {
    for check in checks.iter_mut().filter(|check| is_failed_bonus(check)) {
        let Some(case) = cases.iter().find(|case| case.entry.name == check.scene) else { continue };
        let frame = |kind| {
            let own = |drawn: &&Drawn| drawn.scene == check.scene && drawn.kind == kind;
            drawn.iter().find(own).map(|drawn| drawn.image.clone())
        };
        let (Some(with), Some(mut without)) =
            (frame(ImageKind::RealtimeShadows), frame(ImageKind::Realtime))
        else {
            continue;
        };
        for (pixel, right) in without.pixels.iter_mut().zip(&case.expected.unshadowed.pixels) {
            let is_seen = (*pixel - *right).abs().max_element() <= SEEN * right.max_element();
            if !is_seen {
                *pixel = Vec3::ZERO;
            }
        }
        let judged = shadows(case).judge(&check.scene, &with, &without, tolerances);
        if let Some(judged) =
            judged.filter(|judged| judged.verdict != Verdict::Fail || judged.error < check.error)
        {
            *check = Check { id: check.id, ..judged };
        }
    }
}

/// Prices the bonus as a slip if one word of one line of its own WGSL mends it on every scene that it fails
/// on, where no known mistake explains it. `drawn` has the frames without shadows.
pub fn price_by_edits(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    stages: &Stages,
    drawn: &[Drawn],
    tolerances: &Tolerances,
    checks: &mut [Check],
) {
    let is_open = |check: &Check| {
        is_failed_bonus(check)
            && !price::are_slight([check])
            && !price::is_explained(check)
            // What fails although the picture is right draws no shadow map.
            && check.measures.iter().any(|measure| !measure.passed)
    };
    // Of a frame that is not drawn at all, no one word is wrong.
    let is_drawn = |case: &PreparedScene| {
        let own = |drawn: &Drawn| {
            drawn.scene == case.entry.name && drawn.kind == ImageKind::RealtimeShadows
        };
        drawn.iter().any(own)
    };
    let fails = |case: &&PreparedScene| {
        let own = |check: &Check| is_open(check) && check.scene == case.entry.name;
        is_drawn(case) && checks.iter().any(own)
    };
    let mut failing: Vec<&PreparedScene> = cases.iter().filter(fails).collect();
    failing.sort_by_key(|case| !case.entry.bonus_required);
    let Some(first) = failing.first() else { return };
    let shows = |case: &PreparedScene, edit: &LineEdit| {
        let own =
            |drawn: &&Drawn| drawn.scene == case.entry.name && drawn.kind == ImageKind::Realtime;
        let plain = drawn.iter().find(own).map(|drawn| &drawn.image);
        let Some(bonus) = FrameRequest::bonus(case) else { return false };
        let frame = FrameRequest { stages: vec![edit.stage()], ..bonus };
        let outcome = draw(session, Some(plugin), &frame);
        let Some((answer, with)) = outcome.answer().zip(frame.picture(&outcome)) else {
            return false;
        };
        let has_map = || {
            let made = answer.footprint.as_ref();
            made.is_none_or(|made| no_shadow_map(session, plugin, &frame, made, &with).is_none())
        };
        shows_its_shadows(case, &with, plain, tolerances)
            && (!case.entry.bonus_required || has_map())
    };
    // Of all lines, those that draw a map or read it.
    let may_mend = |edit: &LineEdit| edit.of.vertex || edit.of.with_texture;
    let edits: Vec<LineEdit> = line_edits::all(stages).into_iter().filter(may_mend).collect();
    let plain = [FrameRequest::probe(first, Vec::new())];
    let Some(plain) = pictures(session, plugin, &plain).pop().flatten() else { return };
    // Nothing is seen by which light and shadow could be told apart.
    if small_shadows(first).judge("", &plain, &plain, tolerances).is_none() {
        return;
    }
    for edits in line_edits::batches(&edits) {
        let small = |edit: &LineEdit| FrameRequest::small_bonus(first, vec![edit.stage()]);
        let frames: Vec<FrameRequest> = edits.iter().filter_map(small).collect();
        let tried = edits.iter().zip(pictures(session, plugin, &frames));
        let may_be_right = |with: &Image| {
            let judged = small_shadows(first).judge("", with, &plain, tolerances);
            judged.is_some_and(|check| check.verdict != Verdict::Fail)
        };
        let mut right = tried.filter(|(_, image)| image.as_ref().is_some_and(may_be_right));
        let everywhere = |edit: &LineEdit| failing.iter().all(|case| shows(case, edit));
        let Some((edit, _)) = right.find(|(edit, _)| everywhere(edit)) else {
            continue;
        };
        for check in checks.iter_mut().filter(|check| is_open(check)) {
            (check.error, check.mistake) = (PriceClass::Slip.price(), edit.name.to_owned());
            check.summary = format!("{}: {} ({})", edit.name, edit.place(), check.summary);
        }
        return;
    }
}

/// The shadows on a scene's small film.
fn small_shadows(case: &PreparedScene) -> Shadows<'_> {
    let film = &case.probe_film;
    let median_lit = case.expected.offline.median_lit;
    Shadows { mask: &film.mask, unshadowed: &film.unshadowed_mask, median_lit }
}

/// The largest relative difference of a pixel from what is right that shows the surface that belongs there.
const SEEN: f32 = 0.01;

/// Whether a frame itself shows shadows that are right: by another stage than the submission's they may be
/// right where its own frame shows nothing.
fn shows_its_shadows(
    case: &PreparedScene,
    with: &Image,
    plain: Option<&Image>,
    tolerances: &Tolerances,
) -> bool {
    let as_image = of_image(case, with, tolerances);
    let by_visibility = || shadows(case).judge(&case.entry.name, with, plain?, tolerances);
    as_image.verdict == Verdict::Pass
        || by_visibility().is_some_and(|check| check.verdict == Verdict::Pass)
}

/// Number of pixels that must change when nothing is drawn into a shadow map, over the number of shadowed pixels.
const LEAST_CHANGED: f64 = 0.2;

/// Why shadows that are right come from no shadow map that is drawn and read, if that is so: the same
/// frame is drawn once more while what pipelines draw beside the picture leaves no trace. A map of a picture's format
/// cannot be told from a picture: nothing is claimed then.
fn no_shadow_map(
    session: &Session,
    plugin: &Path,
    frame: &FrameRequest,
    footprint: &Footprint,
    with: &Image,
) -> Option<String> {
    // A pass whose pipelines are made otherwise is not watched.
    if footprint.vertex_pipelines == 0 && footprint.vertexless_pipelines == 0 {
        return None;
    }
    if footprint.maps == 0 {
        // Pipelines that draw pictures draw into textures of a picture's format alone.
        let none = footprint.picture_targets == 0;
        let why = "the shadows are right, but the pass makes no pipeline to draw a shadow map with";
        return none.then(|| why.to_owned());
    }
    let stage = StageText { name: EMPTY_MAPS.to_owned(), text: EMPTY_MAPS.to_owned() };
    let stages = [frame.stages.clone(), vec![stage]].concat();
    let outcome = draw(session, Some(plugin), &FrameRequest { stages, ..frame.clone() });
    let without = session::image(&outcome.answer()?.values, frame.size.0, frame.size.1);
    let mask = &frame.case.expected.offline.mask;
    let inside = |value: u16| {
        value & (RegionMask::EDGE | RegionMask::EMITTER) == 0 && value & RegionMask::INDEX != 0
    };
    // A frame may be darker than expected by another mistake.
    let lit = with.pixels.iter().zip(&mask.pixels);
    let lit = lit.filter(|(_, value)| inside(**value) && mask.region(**value).lit);
    let mut lit: Vec<f32> = lit.map(|(pixel, _)| pixel.max_element()).collect();
    lit.sort_unstable_by(f32::total_cmp);
    let median = lit.get(lit.len() / 2).copied().unwrap_or_default();
    let least = 0.01 * median.min(frame.case.expected.offline.median_lit);
    let (mut shadowed, mut changed) = (0usize, 0usize);
    for ((a, b), &value) in with.pixels.iter().zip(&without.pixels).zip(&mask.pixels) {
        if inside(value) {
            shadowed += usize::from(!mask.region(value).lit);
            changed += usize::from((*a - *b).abs().max_element() > least);
        }
    }
    if changed as f64 >= LEAST_CHANGED * shadowed as f64 {
        return None;
    }
    Some(format!(
        "the shadows are right, but they are the same on all but {changed} pixels when nothing is drawn into \
         the shadow map"
    ))
}
