//! Conventions: what one part of the offline path may leave to another.
//!
//! A renderer whose integrator multiplies by the cosine, and whose BSDFs therefore leave it out, is
//! right. So each part is judged under each convention that at least two of diffuse BSDF, Phong
//! BSDF and integrator keep; one convention holds for all of them, and the rubric takes the one that
//! is worth most.

use std::collections::BTreeSet;

use super::shading::Shading;
use super::{Check, Verdict, price};

/// What the integrator does in place of the BSDFs: it multiplies by
/// `cos(theta_i)^cos_i pi^pi r^-length`, and the BSDFs divide by it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Convention {
    /// The power of cos theta_i.
    pub cos_i: i8,
    /// The power of pi.
    pub pi: i8,
    /// Nothing when wi reaches the BSDFs with length 1. Otherwise it has the light's distance r as
    /// its length, and the values of the BSDFs grow by this power of it.
    pub long_wi: Option<i8>,
}

impl Convention {
    /// All of them, the handout's first.
    pub fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for long_wi in [None, Some(0), Some(1), Some(-1)] {
            for cos_i in [0, 1, -1] {
                for pi in [0, 1, -1] {
                    all.push(Self { cos_i, pi, long_wi });
                }
            }
        }
        all
    }

    /// A short name for reports; empty for the handout's.
    pub fn name(&self) -> String {
        let power = |what: &str, power: i8| match power {
            0 => None,
            1 => Some(format!("the integrator multiplies by {what}, eval() does not")),
            -1 => Some(format!("the integrator divides by {what}, eval() multiplies by it")),
            other => Some(format!("the integrator multiplies by {what}^{other}")),
        };
        let long = self.long_wi.map(|length| match length {
            0 => "eval() normalizes wi".to_owned(),
            _ => format!("wi has length r, and eval() grows by r^{length}"),
        });
        let parts = [power("cos theta_i", self.cos_i), power("pi", self.pi), long];
        parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
    }

    /// What a right BSDF answers under this convention; of `wi`'s length, see [`Self::growth`].
    pub fn bsdf(&self) -> Shading {
        let factor = std::f64::consts::PI.powi(-i32::from(self.pi));
        let cos_i = 1.0 - f64::from(self.cos_i);
        Shading { factor: [factor; 2], cos_i: [cos_i; 2], ..Shading::default() }
    }

    /// What a right BSDF's value is multiplied by when wi has this length.
    pub fn growth(&self, length: f64) -> f64 {
        length.powi(i32::from(self.long_wi.unwrap_or_default()))
    }

    /// What a right integrator makes of a BSDF's value under this convention.
    pub fn integrator(&self) -> Shading {
        Shading {
            factor: [std::f64::consts::PI.powi(i32::from(self.pi)); 2],
            cos_i: [1.0 + f64::from(self.cos_i); 2],
            falloff: 2.0 + f64::from(self.long_wi.unwrap_or_default()),
            long_wi: self.long_wi.is_some(),
            ..Shading::default()
        }
    }
}

/// A convention that no factor expresses: it shows in what the integrator makes of the BSDFs.
const OF_ITS_OWN: &str = "integrator and BSDFs keep a convention of their own";

/// Who keeps a convention.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Party {
    /// Part 1.1.
    Diffuse,
    /// Part 1.2.
    Phong,
    /// Part 1.3.
    Integrator,
}

/// A question whose right answer depends on the convention.
pub struct Conventional<'a> {
    /// Whose answer it is.
    pub party: Party,
    /// Whether the answer is right.
    pub passes: Box<dyn Fn(&Convention) -> bool + 'a>,
    /// The check.
    pub judge: Box<dyn Fn(&Convention) -> Check + 'a>,
}

/// Number of parties that must keep a convention: one alone has made a mistake.
const PARTIES: usize = 2;

/// An integrator that is wrong in many ways is about as wrong under any convention, and leaves the choice to the BSDFs.
const FURTHER: f64 = 1.5;

/// The checks under the handout's convention, and under each other that enough parties keep: what the BSDFs leave out,
/// an integrator must supply, so it must not be much further off than under the handout's.
///
/// `together` judges a BSDF by the radiance that the renderer's own integrator makes of it.
pub fn judge(questions: &[Conventional], together: &dyn Fn() -> Vec<(Party, Check)>) -> Vec<Check> {
    let mut checks: Vec<Check> =
        questions.iter().map(|question| (question.judge)(&Convention::default())).collect();
    if checks.iter().all(|check| check.verdict != Verdict::Fail) {
        return checks;
    }
    let integrator_is_off = |checks: &[Check]| -> f64 {
        let own = checks.iter().zip(questions);
        let own = own.filter(|(_, question)| question.party == Party::Integrator);
        own.map(|(check, _)| if check.verdict == Verdict::Fail { check.error } else { 0.0 }).sum()
    };
    let limit = integrator_is_off(&checks);
    let parties: BTreeSet<Party> = questions.iter().map(|question| question.party).collect();
    for convention in Convention::all().into_iter().skip(1) {
        let keeps = |party: &&Party| {
            let mut own = questions.iter().filter(|question| question.party == **party);
            own.all(|question| (question.passes)(&convention))
        };
        if parties.iter().filter(keeps).count() >= PARTIES {
            let own: Vec<Check> =
                questions.iter().map(|question| (question.judge)(&convention)).collect();
            if integrator_is_off(&own) > FURTHER * limit {
                continue;
            }
            let name = convention.name();
            checks.extend(own.into_iter().map(|check| {
                let summary = format!("{} (convention: {name})", check.summary);
                Check { convention: name.clone(), summary, ..check }
            }));
        }
    }
    let own = judge_together(questions, &checks[..questions.len()], together);
    checks.extend(own);
    checks
}

/// The checks under a convention of the renderer's own, if it has one: integrator and one BSDF are wrong each alone,
/// and right together on every scene, or so but for a slip that does not explain the BSDF alone. Then the integrator is
/// right, and what it makes of the other BSDF is that one's matter. A BSDF that is right alone mends nothing: what an
/// integrator does wrong may not show on its surfaces.
fn judge_together(
    questions: &[Conventional],
    handouts: &[Check],
    together: &dyn Fn() -> Vec<(Party, Check)>,
) -> Vec<Check> {
    let is_wrong_alone = |party: Party| {
        let mut own = questions.iter().zip(handouts);
        own.any(|(question, check)| question.party == party && check.verdict == Verdict::Fail)
    };
    let bsdfs = [Party::Diffuse, Party::Phong];
    if !is_wrong_alone(Party::Integrator) || !bsdfs.into_iter().any(is_wrong_alone) {
        return Vec::new();
    }
    let together = together();
    let of = |party: Party| together.iter().filter(move |(own, _)| *own == party);
    let judged = |party: Party| {
        of(party).any(|(_, check)| matches!(check.verdict, Verdict::Pass | Verdict::Fail))
    };
    let is_explained_alone = |party: Party| {
        let own = questions.iter().zip(handouts);
        let own = own.filter(|(question, _)| question.party == party).map(|(_, check)| check);
        price::are_mostly_explained(own)
    };
    let mends = |party: Party| {
        let failed = of(party).map(|(_, check)| check);
        let failed: Vec<&Check> = failed.filter(|check| check.verdict == Verdict::Fail).collect();
        let right = failed.is_empty();
        let but_for_a_slip = price::are_slight(failed) && !is_explained_alone(party);
        is_wrong_alone(party) && judged(party) && (right || but_for_a_slip)
    };
    if !bsdfs.into_iter().any(mends) {
        return Vec::new();
    }
    let alone = questions.iter().zip(handouts).map(|(question, check)| {
        let verdict = match (question.party, check.verdict) {
            (Party::Integrator, Verdict::Fail) => Verdict::Pass,
            // Its surfaces tell.
            (Party::Diffuse | Party::Phong, Verdict::Pass | Verdict::Fail)
                if judged(question.party) =>
            {
                Verdict::NotJudged
            }
            (_, verdict) => verdict,
        };
        if verdict == check.verdict {
            return check.clone();
        }
        let summary = "right together with the BSDFs".to_owned();
        Check::new(check.id, &check.scene, verdict, summary)
    });
    let all = alone.chain(together.iter().map(|(_, check)| check.clone()));
    let named = all.map(|check| {
        let summary = format!("{} (convention: {OF_ITS_OWN})", check.summary);
        Check { convention: OF_ITS_OWN.to_owned(), summary, ..check }
    });
    named.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CheckId;

    fn question(party: Party, kept: Convention) -> Conventional<'static> {
        Conventional {
            party,
            passes: Box::new(move |convention| *convention == kept),
            judge: Box::new(move |convention| {
                let right = if *convention == kept { Verdict::Pass } else { Verdict::Fail };
                Check::new(CheckId::RadianceLit, "s", right, "")
            }),
        }
    }

    #[test]
    fn a_convention_counts_when_two_parties_keep_it() {
        let cosine = Convention { cos_i: 1, ..Convention::default() };
        let own = Convention::default();
        let names = |kept: [Convention; 3]| {
            let parties = [Party::Diffuse, Party::Phong, Party::Integrator];
            let questions: Vec<_> =
                parties.into_iter().zip(kept).map(|(party, kept)| question(party, kept)).collect();
            judge(&questions, &Vec::new)
                .into_iter()
                .map(|check| check.convention)
                .collect::<Vec<_>>()
        };
        assert_eq!(names([own; 3]), [""; 3]);
        let name = cosine.name();
        assert_eq!(names([cosine, own, cosine]), ["", "", "", &name, &name, &name]);
        assert_eq!(names([cosine, own, own]), [""; 3]);
        // What both BSDFs leave out, nobody supplies.
        assert_eq!(names([cosine, cosine, own]), [""; 3]);
        // An integrator that is wrong either way does not tell.
        let other = Convention { pi: -1, ..own };
        assert_eq!(names([cosine, cosine, other]), ["", "", "", &name, &name, &name]);
    }

    #[test]
    fn a_convention_of_its_own_is_told_by_what_integrator_and_bsdfs_make_of_each_other() {
        let of = |verdict: Verdict, id: CheckId, mistake: &str| {
            let error = if mistake.is_empty() { 0.9 } else { 0.02 };
            let check = Check { error, ..Check::new(id, "s", verdict, "") };
            Check { mistake: mistake.to_owned(), ..check }
        };
        let (pass, fail) = (Verdict::Pass, Verdict::Fail);
        let ids = [CheckId::BsdfDiffuse, CheckId::BsdfPhong, CheckId::RadianceLit];
        let parties = [Party::Diffuse, Party::Phong, Party::Integrator];
        let judge = |alone: [(Verdict, &'static str); 3], together: [(Verdict, &str); 2]| {
            let questions: Vec<Conventional> = (0..3)
                .map(|index| Conventional {
                    party: parties[index],
                    passes: Box::new(|_| false),
                    judge: Box::new(move |_| of(alone[index].0, ids[index], alone[index].1)),
                })
                .collect();
            let together = || {
                let check = |index: usize| of(together[index].0, ids[index], together[index].1);
                (0..2).map(|index| (parties[index], check(index))).collect()
            };
            let checks = judge(&questions, &together);
            let own = checks.iter().filter(|check| check.convention == OF_ITS_OWN);
            let judged = own.filter(|check| check.verdict != Verdict::NotJudged);
            judged.map(|check| (check.id, check.verdict, check.error)).collect::<Vec<_>>()
        };
        let (wrong, slip) = ((fail, ""), (fail, "n + 1 for n + 2"));
        let right = (pass, "");
        let [diffuse, phong, light] = ids;
        let passes = |id| (id, pass, 0.9);
        // Both BSDFs keep it, and one has a slip besides: that is what it loses.
        let found = judge([wrong, wrong, wrong], [right, slip]);
        assert_eq!(found, [(light, pass, 0.0), passes(diffuse), (phong, fail, 0.02)]);
        // Neither is right, but a slip is all that one lacks.
        let found = judge([wrong, wrong, wrong], [wrong, slip]);
        assert_eq!(found, [(light, pass, 0.0), (diffuse, fail, 0.9), (phong, fail, 0.02)]);
        // A BSDF that is right alone mends nothing, nor one that a slip explains alone and together.
        assert_eq!(judge([right, wrong, wrong], [right, wrong]), []);
        assert_eq!(judge([wrong, slip, wrong], [wrong, slip]), []);
        // An integrator that is right keeps the handout's convention.
        assert_eq!(judge([wrong, wrong, right], [right, right]), []);
    }

    #[test]
    fn names_tell_conventions_apart_and_only_the_handouts_is_empty() {
        let names: BTreeSet<String> = Convention::all().iter().map(Convention::name).collect();
        assert_eq!(names.len(), Convention::all().len());
        assert_eq!(Convention::all()[0].name(), "");
    }

    #[test]
    fn what_one_leaves_out_the_other_supplies() {
        for convention in Convention::all() {
            let (cos_i, r) = (0.3f64, 2.5);
            let bsdf = convention.bsdf();
            let value = bsdf.factor[0] * cos_i.powf(bsdf.cos_i[0]) * convention.growth(r);
            let light = convention.integrator();
            let factor = light.factor[0] * cos_i.powf(light.cos_i[0] - 1.0);
            let both = value * factor * r.powf(-light.falloff);
            assert!((both - cos_i / (r * r)).abs() < 1e-12, "{convention:?}: {both}");
        }
    }
}
