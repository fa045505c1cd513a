//! The rules of the rubric, as `config.json` states them.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Curve;
use crate::evidence::CheckId;

/// How evidence becomes points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    /// Error to fraction of points, for failed checks.
    pub curve: Curve,
    /// Fraction of a part's points that images alone can earn when there is no code to judge, once the
    /// instructor confirms them.
    pub images_only_ceiling: f64,
    /// What makes images alone worth more.
    #[serde(default)]
    pub images_only_trust: Option<Trust>,
    /// What must be in order before anything counts.
    pub gates: Vec<Gate>,
    /// The two halves of the assignment, by name.
    pub paths: BTreeMap<String, PathRule>,
    /// The parts, in the handout's order.
    pub parts: Vec<Part>,
}

/// A check that shows who drew an image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Trust {
    /// The check: where all of this name pass, one at least, the images of a part that names it among its
    /// `images_only` are trusted.
    pub check: CheckId,
    /// Fraction of the part's points that they can earn then.
    pub ceiling: f64,
}

/// A condition on the whole submission.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gate {
    /// The check that must not fail.
    pub check: CheckId,
    /// Fraction of the points that can be earned when it fails; with 1 it is only remarked on.
    pub ceiling: f64,
    /// Why, in the words of the handout.
    pub reason: String,
    /// Whether the check and the reason are for the instructor alone.
    #[serde(default)]
    pub private: bool,
}

/// One half of the assignment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PathRule {
    /// The check that, passed on every scene, earns all parts of this path in full.
    pub proof: CheckId,
    /// The checks that a right image does not stand for: what they say of a part counts all the same.
    #[serde(default)]
    pub unseen: Vec<CheckId>,
    /// The part that pays when the proof fails and no part's own evidence says why.
    pub residual_part: String,
}

/// One part of the assignment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// The handout's number, such as `1.1`.
    pub id: String,
    /// The handout's title.
    pub title: String,
    /// The handout's points.
    pub points: f64,
    /// Whether the points come on top of the total.
    #[serde(default)]
    pub bonus: bool,
    /// The path it belongs to; empty when it stands for itself.
    #[serde(default)]
    pub path: String,
    /// The checks that isolate it; the worst scene counts.
    pub evidence: Vec<CheckId>,
    /// The check on the end result that, passed on every scene, earns the part in full: it is right by a
    /// convention of its own.
    #[serde(default)]
    pub proof: Option<CheckId>,
    /// Whether the best scene counts instead: the student was free to choose one.
    #[serde(default)]
    pub any_scene: bool,
    /// The checks that decide when the evidence does not apply.
    #[serde(default)]
    pub fallback: Vec<CheckId>,
    /// The files of the template's `src` that it is done in, for telling what is lost with one that
    /// does not build.
    #[serde(default)]
    pub files: Vec<String>,
    /// The checks on the images submitted, for a submission that does not build.
    #[serde(default)]
    pub images_only: Vec<CheckId>,
}

impl Rules {
    /// Whether what a check says is for the instructor alone: a suspicion that somebody is to look at.
    pub fn is_private(&self, check: CheckId) -> bool {
        self.gates.iter().any(|gate| gate.private && gate.check == check)
    }

    /// What is wrong with the rules themselves, if anything.
    pub fn problem(&self) -> Option<String> {
        for part in &self.parts {
            if !(part.points.is_finite() && part.points >= 0.0) {
                return Some(format!("part {}: points are {}", part.id, part.points));
            }
            if !part.path.is_empty() && !self.paths.contains_key(&part.path) {
                return Some(format!("part {}: there is no path \"{}\"", part.id, part.path));
            }
            if part.evidence.is_empty() {
                return Some(format!("part {}: no evidence is named", part.id));
            }
            if self.parts.iter().filter(|other| other.id == part.id).count() > 1 {
                return Some(format!("part {} is there twice", part.id));
            }
        }
        for (name, path) in &self.paths {
            if !self.parts.iter().any(|part| part.id == path.residual_part && part.path == *name) {
                return Some(format!(
                    "path \"{name}\": residual_part is \"{}\", which is no part of this path",
                    path.residual_part
                ));
            }
        }
        let trust = self.images_only_trust.iter().map(|trust| trust.ceiling);
        let ceilings = self.gates.iter().map(|gate| gate.ceiling).chain([self.images_only_ceiling]);
        let ceilings = ceilings.chain(trust);
        for ceiling in ceilings {
            if !(0.0..=1.0).contains(&ceiling) {
                return Some(format!("a ceiling is {ceiling} but must lie in [0, 1]"));
            }
        }
        None
    }

    /// What a check counts for, in words: `1.3`, `fallback of 2.3`, `gate`...; empty when for nothing.
    pub fn role(&self, check: CheckId) -> String {
        let named = |list: fn(&Part) -> &Vec<CheckId>| {
            let own = self.parts.iter().filter(|part| list(part).contains(&check));
            own.map(|part| part.id.as_str()).collect::<Vec<_>>().join(", ")
        };
        let proves = self.paths.iter().filter(|(_, path)| path.proof == check);
        let mut roles: Vec<String> = proves.map(|(name, _)| format!("proof of {name}")).collect();
        let proven = self.parts.iter().filter(|part| part.proof == Some(check));
        roles.extend(proven.map(|part| format!("proof of {}", part.id)));
        for (role, parts) in [
            ("", named(|part| &part.evidence)),
            ("fallback of ", named(|part| &part.fallback)),
            ("images alone of ", named(|part| &part.images_only)),
        ] {
            if !parts.is_empty() {
                roles.push(format!("{role}{parts}"));
            }
        }
        if let Some(gate) = self.gates.iter().find(|gate| gate.check == check) {
            roles.push(if gate.ceiling < 1.0 { "gate" } else { "remark" }.to_owned());
        }
        roles.join("; ")
    }

    /// The points of all parts that are no bonus.
    pub fn total_points(&self) -> f64 {
        self.parts.iter().filter(|part| !part.bonus).map(|part| part.points).sum()
    }
}
