//! A pass that draws rightly once the host makes its pipelines otherwise: depth test, culling, channels, or the places
//! of vertex attributes are a slip of the pass, whatever its frames show.

use std::path::Path;

use basecode::gpu::USUAL_PIPELINES;

use super::draw::{Frame, draw_each};
use super::isolate::{pass_check, pass_shown};
use super::prepared_scene::PreparedScene;
use super::session::Session;
use crate::evidence::price::Class;
use crate::evidence::{Check, CheckId, Verdict};
use crate::worker::{Outcome, Stage};

/// The number of vertex attributes that may be exchanged.
const ATTRIBUTES: u32 = 4;

/// Slips with a pipeline, and what the host replaces to mend each.
pub fn slips() -> impl Iterator<Item = (&'static str, Stage)> {
    let stage = |text: String| Stage { name: USUAL_PIPELINES.to_owned(), text };
    let state = ("depth test, culling or channels of a pipeline are wrong", stage(String::new()));
    let pairs = (0..ATTRIBUTES).flat_map(|a| (a + 1..ATTRIBUTES).map(move |b| format!("{a} {b}")));
    let exchanged = move |pair| ("two vertex attributes are exchanged", stage(pair));
    std::iter::once(state).chain(pairs.map(exchanged))
}

/// Prices a pass that is wrong under Umbra's stages as a slip if all is right with other pipelines. Returns what mends
/// it.
pub fn price_pass(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    checks: &mut [Check],
) -> Option<Stage> {
    let fails = |check: &Check| check.id == CheckId::PassUniforms && check.verdict == Verdict::Fail;
    let slip = Class::Slip.price();
    let failed = |case: &PreparedScene| {
        checks.iter().any(|check| fails(check) && check.scene == case.entry.name)
    };
    if !checks.iter().any(|check| fails(check) && check.error > slip) {
        return None;
    }
    let is_right = |case: &PreparedScene, stage: &Stage| {
        let with = |mut stages: Vec<Stage>| {
            stages.push(stage.clone());
            Frame::probe(case, stages)
        };
        let frames: Vec<Frame> = pass_shown().into_iter().map(with).collect();
        let outcomes: Vec<Outcome> = draw_each(session, Some(plugin), &frames);
        // A pipeline that cannot be made that way is mended by nothing.
        match pass_check(case, &outcomes).verdict {
            Verdict::Pass => true,
            Verdict::Fail => false,
            _ => !failed(case),
        }
    };
    // Those that are wrong tell most.
    let (wrong, others): (Vec<_>, Vec<_>) = cases.iter().partition(|case| failed(case));
    let mends = |stage: &Stage| wrong.iter().chain(&others).all(|case| is_right(case, stage));
    let (name, stage) = slips().find(|(_, stage)| mends(stage))?;
    for check in checks.iter_mut().filter(|check| fails(check) && check.error > slip) {
        (check.error, check.mistake) = (slip, name.to_owned());
    }
    Some(stage)
}
