//! The realtime path: images drawn by a plugin, those of the bonus too.

use std::path::Path;

use basecode::gpu::{EMPTY_MAPS, Footprint};
use basecode::{Image, Vec3};

use super::coverage;
use super::draw::{FrameRequest, draw, draw_one_each, pictures};
use super::judged::Judged;
use super::line_edits::{self, LineEdit};
use super::offline::Drawn;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use super::stages::{MOVED, Stages, negated_normals};
use super::zoomed;
use crate::evidence::images::{self, ImageKind};
use crate::evidence::pixels;
use crate::evidence::price::{self, Price, PriceClass};
use crate::evidence::shadow_map::{EXCHANGED, Shadows};
use crate::evidence::stages::VERTEX;
use crate::evidence::{Check, CheckId, Verdict};
use crate::expected::Expected;
use crate::imaging::reference::{Region, RegionMask};
use crate::imaging::tolerances::Tolerances;
use crate::worker::{Fault, Outcome, STAGES, StageText};

type RegionCheck = (CheckId, &'static dyn Fn(&Region) -> bool);

/// The image as a whole, and by material.
const VIEWS: [RegionCheck; 3] = [
    (CheckId::ImageRealtime, &|_| true),
    (CheckId::ImageRealtimeDiffuse, &|region| region.exponent == 0.0),
    (CheckId::ImageRealtimePhong, &|region| region.exponent > 0.0),
];

/// Draws every scene with the plugin and judges the images, those of the bonus too.
pub fn judge_images(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    stages: &Stages,
    tolerances: &Tolerances,
) -> Vec<Judged> {
    let right_as = |kind, view: RegionCheck| {
        move |case: &PreparedScene, outcome: &Outcome| {
            let Outcome::Done(answer) = outcome else { return false };
            let (width, height) = case.film();
            let image = session::image(&answer.values, width, height);
            judge(case, kind, &image, view, tolerances).verdict == Verdict::Pass
        }
    };
    let frames: Vec<FrameRequest> = cases.iter().map(FrameRequest::plain).collect();
    let plain = draw_one_each(session, plugin, &frames, &right_as(ImageKind::Realtime, VIEWS[0]));
    // Workers of their own: the bonus may crash without a trace on the others.
    let mut frames: Vec<FrameRequest> = cases.iter().filter_map(FrameRequest::bonus).collect();
    // What this one takes is looked at, and must not be there from another.
    frames.sort_by_key(|frame| !frame.case.entry.bonus_required);
    let right = right_as(ImageKind::RealtimeShadows, (CheckId::BonusImage, &|_| true));
    let outcomes = draw_one_each(session, plugin, &frames, &right);
    let mut bonus: Vec<(FrameRequest, Outcome)> = frames.into_iter().zip(outcomes).collect();
    let judged = cases.iter().zip(plain).map(|(case, plain)| {
        let footprint = plain.answer().and_then(|answer| answer.footprint);
        let fails = plain.fault() == Some(Fault::Submission);
        let (mut checks, plain) = judge_plain(session, case, &plain, tolerances);
        let shading = plain.as_ref().and_then(|drawn| {
            let expected = &case.expected;
            images::shading_correlation(
                &drawn.image,
                &expected.unshadowed,
                &expected.unshadowed_mask,
            )
        });
        let mut drawn = Vec::from_iter(plain);
        let own = bonus.iter().position(|(frame, _)| std::ptr::eq(frame.case, case));
        if let Some((frame, outcome)) = own.map(|index| bonus.swap_remove(index)) {
            let plain = drawn.first().map(|drawn| &drawn.image);
            let (mut check, bonus) =
                judge_bonus(session, plugin, case, &outcome, plain, tolerances);
            if matches!(outcome, Outcome::Failed(_))
                && let Some(rest) = judge_bonus_without(session, plugin, case, stages, tolerances)
            {
                check = rest;
            }
            let required = case.entry.bonus_required;
            let id = if required { CheckId::BonusProbe } else { CheckId::BonusImage };
            // How shadows come about is the same on all scenes.
            if required && check.verdict == Verdict::Pass {
                let footprint = outcome.answer().and_then(|answer| answer.footprint);
                let with = bonus.as_ref().map(|drawn| &drawn.image);
                if let (Some(footprint), Some(with)) = (footprint, with)
                    && shows_its_shadows(case, with, plain, tolerances)
                    && let Some(why) = no_shadow_map(session, plugin, &frame, &footprint, with)
                {
                    check = Check { error: 1.0, verdict: Verdict::Fail, summary: why, ..check };
                }
            }
            checks.push(Check { id, ..check });
            drawn.extend(bonus);
        }
        Judged { checks, drawn, fails, footprint, shading }
    });
    let mut judged: Vec<Judged> = judged.collect();
    settle_exchanged_visibility(cases, &mut judged, tolerances);
    coverage::accept_explained(cases, &mut judged);
    coverage::look_at_black_surfaces(session, plugin, cases, &mut judged);
    coverage::refuse_silhouettes(&mut judged);
    judged
}

/// All frames without shadows may be black, and those with shadows right where no light belongs: visibility is
/// exchanged. That is a slip of the shadows, and none of pass and stages.
fn settle_exchanged_visibility(
    cases: &[PreparedScene],
    judged: &mut [Judged],
    tolerances: &Tolerances,
) {
    let drawn = |judged: &Judged, kind| {
        judged.drawn.iter().find(|drawn| drawn.kind == kind).map(|drawn| drawn.image.clone())
    };
    let seen = |(case, judged): (&PreparedScene, &Judged)| {
        let Expected { unshadowed, unshadowed_mask: mask, .. } = &case.expected;
        let plain = drawn(judged, ImageKind::Realtime)?;
        let mut pixels = plain.pixels.iter().zip(&mask.pixels);
        let apart = |value: u16| value & (RegionMask::EDGE | RegionMask::EMITTER) != 0;
        let is_black = pixels.all(|(pixel, value)| apart(*value) || *pixel == Vec3::ZERO);
        let bonus = drawn(judged, ImageKind::RealtimeShadows)
            .map(|with| shadows(case).judge(&case.entry.name, &with, unshadowed, tolerances));
        Some(SeenVisibility { is_black, bonus })
    };
    let seen: Option<Vec<SeenVisibility>> = cases.iter().zip(&*judged).map(seen).collect();
    if let Some(seen) = seen {
        settle_exchanged(judged, seen);
    }
}

/// What tells of a scene whether lit and dark are exchanged.
struct SeenVisibility {
    /// Whether the frame without shadows is all black.
    is_black: bool,
    /// The check of the frame with shadows, by a right one without, if the scene has such a frame; nothing in it where
    /// that tells too little.
    bonus: Option<Option<Check>>,
}

fn settle_exchanged(judged: &mut [Judged], seen: Vec<SeenVisibility>) {
    let is_exchanged =
        |check: &Check| check.mistake == EXCHANGED && check.error <= 1.5 * PriceClass::Slip.price();
    let exchanged = |seen: SeenVisibility| match seen.bonus {
        _ if !seen.is_black => None,
        None => Some(None),
        Some(check) => check.filter(is_exchanged).map(Some),
    };
    let found: Option<Vec<Option<Check>>> = seen.into_iter().map(exchanged).collect();
    let Some(found) = found.filter(|found| found.iter().any(Option::is_some)) else { return };
    for (judged, bonus) in judged.iter_mut().zip(found) {
        for check in &mut judged.checks {
            let is_bonus = [CheckId::BonusImage, CheckId::BonusProbe].contains(&check.id);
            *check = match &bonus {
                Some(bonus) if is_bonus => Check { id: check.id, ..bonus.clone() },
                _ => {
                    let summary = "right but for the shadows, which are exchanged with light";
                    Check::new(check.id, &check.scene, Verdict::Pass, summary)
                }
            };
        }
    }
}

/// A picture that no shader of the submission can have drawn earns nothing, however right it is;
/// `why` says how that is known.
pub fn drawn_by_nobody(check: &mut Check, why: &str) {
    if matches!(check.verdict, Verdict::Pass | Verdict::Fail) {
        check.verdict = Verdict::Fail;
        check.error = 1.0;
        check.hint.clear();
        check.summary = format!("{why}: no frame counts ({})", check.summary);
    }
}

fn judge(
    case: &PreparedScene,
    kind: ImageKind,
    image: &Image,
    (id, wanted): RegionCheck,
    tolerances: &Tolerances,
) -> Check {
    images::judge(id, &case.entry.name, kind, image, &case.expected, wanted, tolerances)
}

/// An outcome as an image, or else the check that says why there is none.
fn drawn(
    session: &Session,
    case: &PreparedScene,
    kind: ImageKind,
    id: CheckId,
    outcome: &Outcome,
) -> Result<Drawn, Box<Check>> {
    let parts = ["2.1", "2.2", "2.3", "2.4", "2.5"];
    let scene = &case.entry.name;
    let Outcome::Done(answer) = outcome else {
        if let Outcome::Failed(said) = outcome {
            session.keep_compiler_message(case.held_back, said);
        }
        return Err(Box::new(session::unanswered(id, scene, &parts, outcome)));
    };
    let (width, height) = case.film();
    let image = session::image(&answer.values, width, height);
    Ok(Drawn { scene: scene.clone(), kind, image })
}

fn judge_plain(
    session: &Session,
    case: &PreparedScene,
    outcome: &Outcome,
    tolerances: &Tolerances,
) -> (Vec<Check>, Option<Drawn>) {
    let drawn = match drawn(session, case, ImageKind::Realtime, VIEWS[0].0, outcome) {
        Ok(drawn) => drawn,
        // Where a part cannot be judged alone either, a frame that is not there decides.
        Err(check) => {
            let same = |id: CheckId| Check { id, ..(*check).clone() };
            let ids = VIEWS.iter().map(|(id, _)| *id).chain([coverage::COVERAGE]);
            return (ids.map(same).collect(), None);
        }
    };
    let Expected { scene, unshadowed_mask: mask, .. } = &case.expected;
    let views = VIEWS.map(|view| {
        let check = judge(case, ImageKind::Realtime, &drawn.image, view, tolerances);
        // The whole image tells of no one part: what it may show is a slip with the film.
        if view.0 == VIEWS[0].0 {
            let right = &case.expected.unshadowed;
            return check.priced(|raw| images::film_price(&drawn.image, right, mask, raw));
        }
        check.priced(|raw| pixels::price(scene, &drawn.image, mask, view.1, raw))
    });
    let without_shadows = match views[0].verdict {
        Verdict::Fail => plain_but_for_shadows(case, &drawn.image, tolerances),
        _ => None,
    };
    let mut checks = without_shadows.unwrap_or(views.to_vec());
    checks.push(coverage::judge(case, &drawn.image));
    (checks, Some(drawn))
}

/// Judges the image with shadows; `plain` is the student's own without.
fn judge_bonus(
    session: &Session,
    plugin: &Path,
    case: &PreparedScene,
    outcome: &Outcome,
    plain: Option<&Image>,
    tolerances: &Tolerances,
) -> (Check, Option<Drawn>) {
    let (kind, id) = (ImageKind::RealtimeShadows, CheckId::BonusImage);
    let drawn = match drawn(session, case, kind, id, outcome) {
        Ok(drawn) => drawn,
        Err(check) => return (*check, None),
    };
    let mut check = judge(case, kind, &drawn.image, (id, &|_| true), tolerances);
    if check.verdict == Verdict::Fail {
        check = judge_visibility(session, plugin, case, (&drawn.image, plain), check, tolerances);
    }
    (check, Some(drawn))
}

/// Judges the bonus of a submission that draws no frame with it, if a stage is at fault: with Umbra's vertex stage or
/// the template's fragment stage in its place, as with a Rust file that does not build. On what a fragment stage
/// should draw, nothing is in shadow: one that draws nothing earns no more than one without shadows. Returns `None`
/// if no frame comes of it either.
fn judge_bonus_without(
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
pub fn judge_bonus_under(
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
pub fn judge_bonus_where_seen(
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
pub fn price_bonus_by_edits(
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
    let fails = |case: &&PreparedScene| {
        checks.iter().any(|check| is_open(check) && check.scene == case.entry.name)
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
    for edits in edits.chunks(line_edits::TRIED_AT_ONCE) {
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
    let view: RegionCheck = (CheckId::BonusImage, &|_| true);
    let as_image = judge(case, ImageKind::RealtimeShadows, with, view, tolerances);
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

/// The masks that tell where shadows fall.
fn shadows(case: &PreparedScene) -> Shadows<'_> {
    let Expected { offline, unshadowed_mask, .. } = &case.expected;
    Shadows { mask: &offline.mask, unshadowed: unshadowed_mask, median_lit: offline.median_lit }
}

/// The mistake of shadows in a default run.
const ALWAYS_SHADOWED: &str = "shadows are drawn where none belong";

/// A default run that is wrong by its shadows alone is the bonus' fault, not that of pass and
/// stages: the checks that say so, if it is.
fn plain_but_for_shadows(
    case: &PreparedScene,
    image: &Image,
    tolerances: &Tolerances,
) -> Option<Vec<Check>> {
    let (name, shadows) = (&case.entry.name, shadows(case));
    if !shadows.are_in(image) {
        return None;
    }
    let Expected { unshadowed, interpolated_normals, .. } = &case.expected;
    let mask = shadows.lit_alone();
    let judged = VIEWS.map(|(id, wanted)| {
        let expected = (unshadowed, interpolated_normals.as_ref());
        images::judge_shaded(id, name, image, expected, &images::only(&mask, wanted), tolerances)
    });
    if judged[0].verdict != Verdict::Pass {
        return None;
    }
    let summary = "the default run draws shadows: only the bonus scene may";
    let mut checks = judged.to_vec();
    let check = Check::new(CheckId::BonusDefault, name, Verdict::Fail, summary);
    checks.push(check.priced(|raw| Price::of_raw(raw).or(ALWAYS_SHADOWED, PriceClass::Slip, 0.0)));
    Some(checks)
}

/// Judges wrong shadows by visibility alone. The image without shadows is the student's own. If that fails, it is drawn
/// with a vertex stage of ours, moved as a whole, with negated normals, with another field of view, or as the second of
/// two frames. What these repair is no fault of the shadows. `check` is the verdict on the image; it stands if none of
/// them decides.
fn judge_visibility(
    session: &Session,
    plugin: &Path,
    case: &PreparedScene,
    (with, without): (&Image, Option<&Image>),
    check: Check,
    tolerances: &Tolerances,
) -> Check {
    let (name, shadows) = (&case.entry.name, shadows(case));
    let judge = |with: &Image, without: &Image| shadows.judge(name, with, without, tolerances);
    let own = without.and_then(|without| judge(with, without));
    let passes = |check: &Check| check.verdict == Verdict::Pass;
    if let Some(own) = own.as_ref().filter(|own| passes(own)) {
        return own.clone();
    }
    let vertex = StageText { name: STAGES[0].to_owned(), text: VERTEX.to_owned() };
    let tries = [(1, vec![vertex]), (1, vec![negated_normals()]), (2, Vec::new())];
    let frames = |(times, stages): &(usize, Vec<StageText>), is_small: bool| {
        let with = if is_small {
            FrameRequest::small_bonus(case, stages.clone())?
        } else {
            FrameRequest { stages: stages.clone(), ..FrameRequest::bonus(case)? }
        };
        let without = FrameRequest { toml: &case.realtime, shadow_map: false, ..with.clone() };
        Some([with, without].map(|frame| FrameRequest { times: *times, ..frame }))
    };
    // Small films tell what is not worth a whole one, and one worker draws them all. Where they tell nothing, whole
    // ones do.
    let small = small_shadows(case);
    let may_pass = |[with, without]: &[Option<Image>; 2]| {
        let judged = small.judge(name, with.as_ref()?, without.as_ref()?, tolerances);
        Some(judged.is_none_or(|judged| judged.verdict != Verdict::Fail))
    };
    let all: Option<Vec<_>> = tries.iter().map(|tried| frames(tried, true)).collect();
    let all = pictures(session, plugin, &all.unwrap_or_default().concat());
    let may_pass: Vec<bool> =
        all.as_chunks().0.iter().map(|pair| may_pass(pair).unwrap_or(false)).collect();
    let may_pass = |index: usize| may_pass.get(index).is_some_and(|may| *may);
    let again = |index: usize| {
        let pictures = pictures(session, plugin, &frames(&tries[index], false)?);
        let [with, without] = pictures.as_slice() else { return None };
        judge(with.as_ref()?, without.as_ref()?)
    };
    let passes_again =
        |index: usize| if may_pass(index) { again(index).filter(passes) } else { None };
    let swapped = if own.is_none() || may_pass(0) { again(0) } else { None };
    if let Some(swapped) = swapped.as_ref().filter(|swapped| passes(swapped)) {
        return swapped.clone();
    }
    let moved = without.and_then(|without| {
        MOVED.iter().find_map(|(_, moved)| judge(&moved(with), &moved(without)).filter(passes))
    });
    let mended = moved.or_else(|| passes_again(1));
    let mended = mended.or_else(|| {
        let masks = zoomed::masks(session, plugin, case)?;
        let shadows = masks.shadows(shadows.median_lit);
        shadows.judge(name, with, without?, tolerances).filter(passes)
    });
    let mended = mended.or_else(|| passes_again(2));
    mended.or(own).or(swapped).unwrap_or(check)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(id: CheckId, mistake: &str, error: f64) -> Check {
        let check = Check::new(id, "s", Verdict::Fail, "");
        Check { mistake: mistake.to_owned(), error, ..check }
    }

    /// The verdicts and errors of a scene's frame and bonus frame, where two scenes show this.
    type Price<'a> = Option<(&'a str, f64)>;

    fn settled(seen: [(bool, Option<Price>); 2]) -> Vec<(Verdict, f64)> {
        let judged = || {
            let checks =
                vec![check(CheckId::ImageRealtime, "", 1.0), check(CheckId::BonusImage, "", 1.0)];
            Judged { checks, drawn: Vec::new(), fails: false, footprint: None, shading: None }
        };
        let mut all = [judged(), judged()];
        let seen = seen.map(|(is_black, bonus)| {
            let of = |(mistake, error)| check(CheckId::BonusImage, mistake, error);
            SeenVisibility { is_black, bonus: bonus.map(|bonus| bonus.map(of)) }
        });
        settle_exchanged(&mut all, seen.into());
        let [first, _] = all;
        first.checks.iter().map(|check| (check.verdict, check.error)).collect()
    }

    #[test]
    fn exchanged_visibility_is_the_bonus_slip_alone() {
        let slip = PriceClass::Slip.price();
        let unsettled = vec![(Verdict::Fail, 1.0); 2];
        let exchanged = (true, Some(Some((EXCHANGED, slip))));
        let without = (true, None);
        let paid = vec![(Verdict::Pass, 0.0), (Verdict::Fail, slip)];
        assert_eq!(settled([exchanged, without]), paid);
        // A scene that is not black, that shows another mistake, or too little of it.
        assert_eq!(settled([exchanged, (false, None)]), unsettled);
        assert_eq!(settled([exchanged, (true, Some(Some(("another", slip))))]), unsettled);
        assert_eq!(settled([exchanged, (true, Some(Some((EXCHANGED, 0.3))))]), unsettled);
        assert_eq!(settled([exchanged, (true, Some(None))]), unsettled);
        // Black frames alone tell nothing.
        assert_eq!(settled([without, without]), unsettled);
    }
}
