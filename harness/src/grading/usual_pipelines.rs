//! A pass that draws rightly once the host makes its pipelines otherwise: depth test, culling, channels, or the places
//! of vertex attributes are a slip of the pass, whatever its frames show.

use std::path::Path;

use basecode::gpu::USUAL_PIPELINES;

use super::draw::{FrameRequest, draw_each};
use super::isolate::{pass_check, pass_check_of, pass_shown};
use super::prepared_scene::PreparedScene;
use super::session::Session;
use crate::evidence::price::PriceClass;
use crate::evidence::stages::BoundValue;
use crate::evidence::{Check, CheckId, Measure, Verdict};
use crate::worker::{Outcome, StageText};

/// The number of vertex attributes that may be exchanged.
const ATTRIBUTES: u32 = 4;

/// Slips with a pipeline, and what the host replaces to mend each.
pub fn slips() -> impl Iterator<Item = (&'static str, StageText)> {
    let stage = |text: String| StageText { name: USUAL_PIPELINES.to_owned(), text };
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
) -> Option<StageText> {
    let fails = |check: &Check| check.id == CheckId::PassUniforms && check.verdict == Verdict::Fail;
    let slip = PriceClass::Slip.price();
    let failed = |case: &PreparedScene| {
        checks.iter().any(|check| fails(check) && check.scene == case.entry.name)
    };
    if !checks.iter().any(|check| fails(check) && check.error > slip) {
        return None;
    }
    let is_right = |case: &PreparedScene, stage: &StageText| {
        let with = |mut stages: Vec<StageText>| {
            stages.push(stage.clone());
            FrameRequest::probe(case, stages)
        };
        let frames: Vec<FrameRequest> = pass_shown().into_iter().map(with).collect();
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
    let first = wrong.first()?;
    let bound =
        wrong_value(checks.iter().find(|check| fails(check) && check.scene == first.entry.name)?);
    let slips = hopeful(&slips().collect::<Vec<_>>(), &|stages| {
        let values = pass_shown();
        let (value, positions) = (&values[bound as usize], &values[values.len() - 1]);
        let with = |stage: &&StageText, shown: &Vec<StageText>| {
            FrameRequest::probe(first, [shown.clone(), vec![(*stage).clone()]].concat())
        };
        let frames: Vec<FrameRequest> =
            stages.iter().flat_map(|stage| [with(stage, value), with(stage, positions)]).collect();
        let outcomes = draw_each(session, Some(plugin), &frames);
        outcomes.chunks(2).map(|pair| pass_check_of(first, bound, pair)).collect()
    });
    let mends = |stage: &StageText| wrong.iter().chain(&others).all(|case| is_right(case, stage));
    let (name, stage) = slips.into_iter().find(|(_, stage)| mends(stage))?;
    for check in checks.iter_mut().filter(|check| fails(check) && check.error > slip) {
        (check.error, check.mistake) = (slip, name.to_owned());
    }
    Some(stage)
}

/// The value that a check finds wrong, or the first of all where it finds none.
fn wrong_value(check: &Check) -> BoundValue {
    let is_wrong = |bound: &BoundValue| {
        let of = |measure: &Measure| measure.rule == Some(bound.rule()) && !measure.passed;
        check.measures.iter().any(of)
    };
    BoundValue::ALL.into_iter().find(is_wrong).unwrap_or(BoundValue::CameraPosition)
}

/// The slips that leave nothing wrong with one value of one scene: no others are looked at on all. `verdicts` are those
/// on that value with what the host replaces.
fn hopeful<'a>(
    slips: &[(&'a str, StageText)],
    verdicts: &dyn Fn(&[&StageText]) -> Vec<Verdict>,
) -> Vec<(&'a str, StageText)> {
    let stages: Vec<&StageText> = slips.iter().map(|(_, stage)| stage).collect();
    let told = slips.iter().zip(verdicts(&stages));
    told.filter(|(_, verdict)| *verdict == Verdict::Pass).map(|(slip, _)| slip.clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::RuleId;

    #[test]
    fn every_pair_of_attributes_and_the_state_are_tried() {
        let texts: Vec<String> = slips().map(|(_, stage)| stage.text).collect();
        assert_eq!(texts, ["", "0 1", "0 2", "0 3", "1 2", "1 3", "2 3"]);
        assert!(slips().all(|(_, stage)| stage.name == USUAL_PIPELINES));
    }

    #[test]
    fn what_leaves_one_value_wrong_is_not_looked_at_further() {
        let all: Vec<_> = slips().collect();
        let by = |right: &'static str| {
            let judge = |stages: &[&StageText]| {
                let verdict = |stage: &&StageText| match stage.text == right {
                    true => Verdict::Pass,
                    false => Verdict::Fail,
                };
                stages.iter().map(verdict).collect()
            };
            hopeful(&all, &judge).into_iter().map(|(_, stage)| stage.text).collect::<Vec<_>>()
        };
        assert_eq!(by("0 1"), ["0 1"]);
        assert_eq!(by(""), [""]);
        assert_eq!(by("none of them"), [""; 0]);
        // A pipeline that cannot be made that way is mended by nothing.
        assert!(hopeful(&all, &|stages| vec![Verdict::NotJudged; stages.len()]).is_empty());
    }

    #[test]
    fn the_value_that_is_wrong_is_looked_at() {
        let measure = |rule, value| Measure::at_most(rule, "", value, 0.005);
        let check = Check::new(CheckId::PassUniforms, "s", Verdict::Fail, "");
        let of = |measures| wrong_value(&Check { measures, ..check.clone() });
        let light = measure(RuleId::PassLightPosition, 0.0);
        assert_eq!(of(vec![light.clone(), measure(RuleId::PassRhoS, 1.0)]), BoundValue::RhoS);
        assert_eq!(of(vec![light]), BoundValue::CameraPosition);
    }
}
