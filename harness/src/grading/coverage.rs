//! The fallback of 2.1 and 2.2: whether surfaces lie where they should, whatever their colors.

use std::path::Path;

use basecode::Image;

use super::draw::{FrameRequest, draw_each};
use super::judged::Judged;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use super::uploads::{drawn_parts, every_fragment};
use crate::evidence::{Check, CheckId, Verdict, price};
use crate::imaging::reference::Coverage;

/// Whether surfaces lie where they should, for what cannot be judged alone.
pub const COVERAGE: CheckId = CheckId::ImageRealtimeCoverage;

/// Silhouettes correlate by 0, in one color or one for each surface; what follows the light does by more.
const LEAST_SHADING: f64 = 0.2;

/// Fraction of the pixels that may be wrong.
const STRAY: f64 = 5e-3;

/// Where the image shows a surface and where not.
pub fn judge(case: &PreparedScene, image: &Image) -> Check {
    let Coverage { counted, missing, extra } = case.expected.unshadowed_mask.coverage(image);
    let (name, wrong) = (&case.entry.name, missing + extra);
    let error = wrong as f64 / counted.max(1) as f64;
    if error > STRAY {
        let summary = format!(
            "{wrong} of {counted} pixels show a surface where none is, or none where one is"
        );
        return Check { error, ..Check::new(COVERAGE, name, Verdict::Fail, summary) };
    }
    Check::new(COVERAGE, name, Verdict::Pass, "surfaces lie where they should")
}

/// Surfaces that are dark where known mistakes of the fragment stages explain what most scenes show are there.
pub fn accept_explained(cases: &[PreparedScene], judged: &mut [Judged]) {
    let explained = [CheckId::ImageRealtimeDiffuse, CheckId::ImageRealtimePhong].map(|id| {
        let own = judged.iter().flat_map(|judged| &judged.checks).filter(|check| check.id == id);
        let own: Vec<&Check> = own.collect();
        let fails = own.iter().any(|check| check.verdict == Verdict::Fail);
        !fails || price::are_mostly_explained(own)
    });
    if explained != [true; 2] {
        return;
    }
    for (case, judged) in cases.iter().zip(judged) {
        let Some(drawn) = judged.drawn.first() else { continue };
        let Coverage { counted, missing, extra } =
            case.expected.unshadowed_mask.coverage(&drawn.image);
        if missing > 0 && extra as f64 <= STRAY * counted as f64 {
            for check in judged.checks.iter_mut().filter(|check| check.id == COVERAGE) {
                let summary =
                    "surfaces lie where they should, some of them dark by a known mistake";
                *check = Check::new(COVERAGE, &case.entry.name, Verdict::Pass, summary);
            }
        }
    }
}

/// Looks once more at scenes whose own frame does not show its surfaces: a black surface is there too. Every fragment
/// has one color then.
pub fn look_at_black_surfaces(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    judged: &mut [Judged],
) {
    let fails = |check: &Check| check.id == COVERAGE && check.verdict == Verdict::Fail;
    let wrong = |judged: &Judged| !judged.drawn.is_empty() && judged.checks.iter().any(fails);
    let again: Vec<usize> = (0..cases.len()).filter(|&index| wrong(&judged[index])).collect();
    let frame = |&index: &usize| FrameRequest {
        stages: vec![every_fragment()],
        ..FrameRequest::plain(&cases[index])
    };
    let frames: Vec<FrameRequest> = again.iter().map(frame).collect();
    for (index, outcome) in again.into_iter().zip(draw_each(session, Some(plugin), &frames)) {
        let (case, (width, height)) = (&cases[index], cases[index].film());
        let image = outcome.answer().map(|answer| session::image(&answer.values, width, height));
        let shown = image.map(|image| judge(case, &drawn_parts(&image)));
        let Some(shown) = shown.filter(|check| check.verdict == Verdict::Pass) else { continue };
        for check in judged[index].checks.iter_mut().filter(|check| fails(check)) {
            *check = shown.clone();
        }
    }
}

/// Surfaces that lie where they should earn nothing when no light falls on them on most scenes: one scene may show
/// little but what another mistake spoils. What a known mistake explains on some scene is shaded.
pub fn refuse_silhouettes(judged: &mut [Judged]) {
    let mut shading: Vec<f64> = judged.iter().filter_map(|judged| judged.shading).collect();
    shading.sort_by(f64::total_cmp);
    if shading.get(shading.len() / 2).is_none_or(|median| *median >= LEAST_SHADING) {
        return;
    }
    let tells = |judged: &&Judged| judged.shading.is_some();
    let is_shaded = |check: &Check| check.mistake != price::BLACK && price::is_explained(check);
    if judged.iter().filter(tells).any(|judged| judged.checks.iter().any(is_shaded)) {
        return;
    }
    for judged in judged {
        let Some(shading) = judged.shading.filter(|shading| *shading < LEAST_SHADING) else {
            continue;
        };
        let covered = |check: &&mut Check| check.id == COVERAGE && check.verdict == Verdict::Pass;
        for check in judged.checks.iter_mut().filter(covered) {
            let summary = format!(
                "surfaces lie where they should, but no light falls on them: within a surface, brightness \
                 correlates by {shading:.2} with what is expected, and must by {LEAST_SHADING} on most scenes"
            );
            *check = Check::new(COVERAGE, &check.scene, Verdict::Fail, summary);
        }
    }
}
