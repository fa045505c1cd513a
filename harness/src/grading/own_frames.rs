//! Conventions of the realtime path that no factor expresses: pass, vertex stage and fragment stages are judged by the
//! student's own frames, where these show that they are right together.

use crate::evidence::stages::BoundValue;
use crate::evidence::{Check, CheckId, Verdict, price};

/// Which bound values are looked at, of Phong materials (`true`) or of others.
pub type Wanted<'a> = &'a dyn Fn(BoundValue, bool) -> bool;

/// What is said of such a convention.
const OF_THEIR_OWN: &str = "pass and stages keep a convention of their own";

/// The surfaces that one fragment stage draws.
#[derive(Clone, Copy)]
struct Surfaces {
    phong: bool,
    /// The stage alone.
    stage: CheckId,
    /// The student's own frame on these surfaces.
    own: CheckId,
}

const DIFFUSE: Surfaces =
    Surfaces { phong: false, stage: CheckId::StageDiffuse, own: CheckId::ImageRealtimeDiffuse };
const PHONG: Surfaces =
    Surfaces { phong: true, stage: CheckId::StagePhong, own: CheckId::ImageRealtimePhong };

impl Surfaces {
    /// Whether what is drawn on these surfaces hangs on a bound value of a Phong material or another.
    fn hang_on(self, bound: BoundValue, phong: bool) -> bool {
        match bound {
            BoundValue::CameraPosition => self.phong,
            BoundValue::LightPosition | BoundValue::LightIntensity => true,
            BoundValue::RhoD | BoundValue::RhoS | BoundValue::Exponent => phong == self.phong,
        }
    }
}

/// The checks under a convention of the submission's own, if it has one. It has one if two of pass, vertex stage and
/// fragment stage are wrong alone, but the own frames are right on all surfaces of one fragment stage on every scene. A
/// slip in the frames is no obstacle if it does not explain the stage alone. `alone` are the checks of the three, `own`
/// those of the frames, and `pass_of` judges the pass by some of its values.
pub fn judge(alone: &[Check], own: &[Check], pass_of: &dyn Fn(Wanted) -> Vec<Check>) -> Vec<Check> {
    let failed = |id: CheckId| {
        let is_own = move |check: &&Check| check.id == id && check.convention.is_empty();
        alone.iter().filter(is_own).filter(|check| check.verdict == Verdict::Fail)
    };
    let frames = |of: Surfaces| own.iter().filter(move |check| check.id == of.own);
    let wrong_frames = |of: Surfaces| {
        frames(of).filter(|check| check.verdict == Verdict::Fail).collect::<Vec<_>>()
    };
    let is_right = |of: Surfaces| {
        let said = |check: &Check| matches!(check.verdict, Verdict::Pass | Verdict::NotJudged);
        frames(of).all(said) && frames(of).any(|check| check.verdict == Verdict::Pass)
    };
    let is_a_slip = |of: Surfaces| {
        let wrong = wrong_frames(of);
        let is_wrong_alone = failed(of.stage).next().is_some();
        let explained = price::are_mostly_explained(failed(of.stage));
        !wrong.is_empty() && price::are_slight(wrong) && is_wrong_alone && !explained
    };
    let mends = |of: Surfaces| {
        let pass_fails = || {
            let checks = pass_of(&|bound, phong| of.hang_on(bound, phong));
            checks.iter().any(|check| check.verdict == Verdict::Fail)
        };
        // A stage that cannot be exchanged takes other inputs than the contract's.
        let mut stage = alone.iter().filter(|check| check.id == of.stage).peekable();
        let takes_others =
            stage.peek().is_some() && stage.all(|check| check.verdict == Verdict::NotJudged);
        let vertex_fails = failed(CheckId::StageVertex).next().is_some();
        let stage_fails = takes_others || failed(of.stage).next().is_some();
        let wrong = usize::from(vertex_fails) + usize::from(stage_fails);
        (is_right(of) || is_a_slip(of)) && wrong > 0 && (wrong > 1 || pass_fails())
    };
    let all = [DIFFUSE, PHONG];
    if !all.into_iter().any(mends) {
        return Vec::new();
    }
    // Where one mistake of the stage explains the frame, the pass has none.
    let is_known = |of: Surfaces| {
        let explained = price::are_slight(wrong_frames(of))
            || wrong_frames(of).into_iter().all(price::is_explained);
        is_right(of) || (explained && failed(of.stage).next().is_some())
    };
    let known: Vec<Surfaces> = all.into_iter().filter(|of| is_known(*of)).collect();
    let mut checks = Vec::new();
    let together = |check: &Check| {
        let summary = "right together with the rest, in the submission's own frames";
        Check::new(check.id, &check.scene, Verdict::Pass, summary)
    };
    let open = pass_of(&|bound, phong| !known.iter().any(|of| of.hang_on(bound, phong)));
    checks.extend(open.into_iter().map(|check| match check.verdict {
        Verdict::NotJudged => together(&check),
        _ => check,
    }));
    checks.extend(failed(CheckId::StageVertex).map(together));
    for of in all {
        if is_right(of) {
            checks.extend(failed(of.stage).map(together));
        } else if failed(of.stage).next().is_some() {
            checks.extend(frames(of).map(|check| Check { id: of.stage, ..check.clone() }));
        }
    }
    let named = checks.into_iter().map(|check| {
        let summary = format!("{} (convention: {OF_THEIR_OWN})", check.summary);
        Check { convention: OF_THEIR_OWN.to_owned(), summary, ..check }
    });
    named.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(id: CheckId, verdict: Verdict, mistake: &str) -> Check {
        let error = if mistake.is_empty() { 0.9 } else { 0.02 };
        let mistake = mistake.to_owned();
        Check { error, mistake, ..Check::new(id, "s", verdict, "") }
    }

    /// What fails and by which error, if pass, vertex, diffuse and Phong stage answer `alone` so and the own frames on
    /// diffuse and Phong materials show `own`.
    fn judged(alone: [Option<&str>; 4], own: [Option<&str>; 2]) -> Option<Vec<(CheckId, f64)>> {
        let verdict =
            |wrong: Option<&str>| if wrong.is_some() { Verdict::Fail } else { Verdict::Pass };
        let of =
            |id: CheckId, wrong: Option<&str>| check(id, verdict(wrong), wrong.unwrap_or_default());
        let ids = [
            CheckId::PassUniforms,
            CheckId::StageVertex,
            CheckId::StageDiffuse,
            CheckId::StagePhong,
        ];
        let alone: Vec<Check> =
            ids.into_iter().zip(alone).map(|(id, wrong)| of(id, wrong)).collect();
        let own = [of(DIFFUSE.own, own[0]), of(PHONG.own, own[1])];
        let pass_of = |wanted: Wanted| {
            // Its light is what is wrong, if anything is.
            let asked = wanted(BoundValue::LightIntensity, false);
            let check = &alone[0];
            vec![if asked {
                check.clone()
            } else {
                Check { verdict: Verdict::NotJudged, ..check.clone() }
            }]
        };
        let checks = super::judge(&alone, &own, &pass_of);
        let failed = checks.iter().filter(|check| check.verdict == Verdict::Fail);
        let failed = failed.map(|check| (check.id, check.error)).collect();
        (!checks.is_empty()).then_some(failed)
    }

    #[test]
    fn what_is_right_together_is_a_convention() {
        let (wrong, slip) = (Some(""), Some("n + 1 for n + 2"));
        let phong = vec![(CheckId::StagePhong, 0.02)];
        // The light's intensity, or matrices, or the normal, by a convention; and a slip in the Phong stage.
        assert_eq!(judged([wrong, None, wrong, wrong], [None, slip]), Some(phong.clone()));
        assert_eq!(judged([wrong, wrong, None, slip], [None, slip]), Some(phong.clone()));
        assert_eq!(judged([None, wrong, wrong, wrong], [None, slip]), Some(phong.clone()));
        // No frame is right, but the slip is all that one shows.
        let diffuse_too = vec![(CheckId::StageDiffuse, 0.9), (CheckId::StagePhong, 0.02)];
        assert_eq!(judged([wrong, None, wrong, wrong], [wrong, slip]), Some(diffuse_too));
        // One alone that is wrong has made a mistake, and what a slip explains alone is one.
        assert_eq!(judged([wrong, None, None, slip], [None, slip]), None);
        assert_eq!(judged([wrong, None, wrong, slip], [wrong, slip]), None);
        assert_eq!(judged([None, wrong, None, None], [wrong, wrong]), None);
    }
}
