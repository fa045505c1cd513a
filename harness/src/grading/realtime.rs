//! The realtime path: images drawn by a plugin, those of the bonus too.

use std::path::Path;

use basecode::{Image, Vec3};

use super::bonus;
use super::coverage;
use super::draw::{FrameRequest, draw_one_each};
use super::frame_checks::{RegionCheck, drawn, judge_regions, shadows};
use super::judged::Judged;
use super::offline::Drawn;
use super::prepared_scene::PreparedScene;
use super::session::Session;
use super::stages::Stages;
use crate::evidence::images::{self, ImageKind};
use crate::evidence::pixels;
use crate::evidence::price::{Price, PriceClass};
use crate::evidence::shadow_map::EXCHANGED;
use crate::evidence::{Check, CheckId, Verdict};
use crate::expected::Expected;
use crate::imaging::reference::RegionMask;
use crate::imaging::tolerances::Tolerances;
use crate::worker::{Fault, Outcome};

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
    let is_right = |case: &PreparedScene, outcome: &Outcome| {
        let picture = FrameRequest::plain(case).picture(outcome);
        let judge = |image| judge_regions(case, ImageKind::Realtime, &image, VIEWS[0], tolerances);
        picture.map(judge).is_some_and(|check| check.verdict == Verdict::Pass)
    };
    let frames: Vec<FrameRequest> = cases.iter().map(FrameRequest::plain).collect();
    let plain = draw_one_each(session, plugin, &frames, &is_right);
    let judged = cases.iter().zip(plain).map(|(case, outcome)| {
        let footprint = outcome.answer().and_then(|answer| answer.footprint);
        let fails = outcome.fault() == Some(Fault::Submission);
        let (checks, plain) = judge_plain(session, case, &outcome, tolerances);
        let shading = plain.as_ref().and_then(|drawn| {
            let Expected { unshadowed, unshadowed_mask, .. } = &case.expected;
            images::shading_correlation(&drawn.image, unshadowed, unshadowed_mask)
        });
        Judged { checks, drawn: Vec::from_iter(plain), fails, footprint, shading }
    });
    let mut judged: Vec<Judged> = judged.collect();
    bonus::judge(session, plugin, cases, stages, &mut judged, tolerances);
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
        let check = judge_regions(case, ImageKind::Realtime, &drawn.image, view, tolerances);
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
