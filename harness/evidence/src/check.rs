//! What evidence is made of: checks, each with the values that decided it.

use std::borrow::Cow;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use super::registry::{CheckId, RuleId};

/// Everything that was found out about one submission. Plain data: the rubric needs nothing else.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// The checks, in the order they were made.
    pub checks: Vec<Check>,
}

/// One question that was put to a submission, and its answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Check {
    /// Which question.
    pub id: CheckId,
    /// The scene it was asked on; empty when none.
    pub scene: String,
    /// Whether that scene is held back from the student.
    pub held_back: bool,
    /// The convention that it was judged under (`evidence::convention`); empty for the handout's.
    #[serde(default)]
    pub convention: String,
    /// The share of a part's points that it can cost, in (0, 1]: the scene's weight.
    #[serde(default = "whole")]
    pub weight: f64,
    /// The answer in a word.
    pub verdict: Verdict,
    /// How wrong the answer is, in [0, 1]: 0 is right, 1 is as large as the right answer itself. A
    /// relative L1 error or a fraction of wrong answers, or what the single mistake costs that
    /// explains it (`evidence::price`), if that is less.
    #[serde(deserialize_with = "or_nan")]
    pub error: f64,
    /// The single mistake that explains the answer best; empty where none does better than nothing.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub mistake: String,
    /// One sentence: what was found, where, expected and actual.
    pub summary: String,
    /// What may be the cause, in a few words; empty when there is nothing to say.
    pub hint: String,
    /// What only the instructor may read, such as the names of other submissions; empty for most checks.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub private: String,
    /// The values that decided, passed ones too.
    pub measures: Vec<Measure>,
    /// Pictures that show it, as file names beside the report.
    pub pictures: Vec<Picture>,
    /// Of a BSDF that is wrong: its lobe where that shows most.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lobe: Option<Lobe>,
    /// Of shadow rays that are wrong: the pixel of the probe film of each, and whether it should be lit. For the
    /// picture, and not kept.
    #[serde(skip)]
    pub wrong_rays: Vec<(usize, bool)>,
}

/// The answer to a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Right within the tolerance.
    Pass,
    /// Wrong.
    Fail,
    /// The student has not written this part yet.
    NotImplemented,
    /// The question does not apply to this submission, or something else that is broken hides the
    /// answer; the summary says what. Other evidence decides.
    NotJudged,
    /// The machine could not ask (no adapter, disk full). Costs nothing, earns nothing.
    NotRun,
}

impl Verdict {
    /// The verdict in words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::NotImplemented => "not implemented",
            Self::NotJudged => "not judged",
            Self::NotRun => "not run",
        }
    }
}

/// One value against its bound.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Measure {
    /// The rule that it is judged by; nothing when it only informs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rule: Option<RuleId>,
    /// What was measured, with its unit.
    pub name: String,
    /// The value.
    #[serde(deserialize_with = "or_nan")]
    pub value: f64,
    /// The largest value that passes.
    #[serde(deserialize_with = "or_nan")]
    pub bound: f64,
    /// Whether it passed.
    pub passed: bool,
}

/// The measure of how many rays the shadows switch changes.
pub(super) const SWITCHED: &str = "rays that the shadows switch changes (fraction)";
/// How the name begins of the measure that says what a known mistake counts.
pub(super) const PRICED: &str = "difference from what is right";

impl Measure {
    /// Whether it only informs: no rule judges it, so neither its bound nor its verdict says anything.
    pub fn only_informs(&self) -> bool {
        let told = [PRICED, SWITCHED];
        self.rule.is_none() && told.iter().any(|name| self.name.starts_with(name))
    }
}

/// A picture in a file beside the report.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Picture {
    /// What it shows: actual, expected, difference...
    pub title: String,
    /// File name, relative to the folder of the submission's report; of a held-back scene, to that of
    /// the instructor's.
    pub file: String,
    /// Width in pixels; 0 where it is not known.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub width: usize,
    /// Height in pixels; 0 where it is not known.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub height: usize,
}

/// A BSDF along the plane of `wo` and the normal: what is right and what was answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Lobe {
    /// The material, in words.
    pub material: String,
    /// The angle of `wo` from the normal, in degrees.
    pub wo_deg: f64,
    /// Whether values differ so much that only their logarithms can be drawn.
    pub log: bool,
    /// The right values, finely: the angle of `wi` from the normal, in degrees, positive on the side across from `wo`,
    /// and the mean of the channels, cosine included [sr^-1].
    pub expected: Vec<[f64; 2]>,
    /// The same of what was answered, where it was asked.
    #[serde(deserialize_with = "or_nan_points")]
    pub found: Vec<[f64; 2]>,
}

impl Evidence {
    /// The checks with a name.
    pub fn named(&self, id: CheckId) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(move |check| check.id == id)
    }
}

impl Check {
    /// `id` or `id @ scene`.
    pub fn name(&self) -> String {
        if self.scene.is_empty() {
            self.id.to_string()
        } else {
            format!("{} @ {}", self.id, self.scene)
        }
    }

    /// A check with nothing but a verdict and a sentence; the error is 0 for a pass and 1 otherwise.
    pub fn new(id: CheckId, scene: &str, verdict: Verdict, summary: impl Into<String>) -> Self {
        Self {
            id,
            scene: scene.to_owned(),
            held_back: false,
            convention: String::new(),
            weight: 1.0,
            verdict,
            error: if verdict == Verdict::Pass { 0.0 } else { 1.0 },
            mistake: String::new(),
            summary: summary.into(),
            hint: String::new(),
            private: String::new(),
            measures: Vec::new(),
            pictures: Vec::new(),
            lobe: None,
            wrong_rays: Vec::new(),
        }
    }

    /// What it says, as far as everybody may know it: of a held-back scene only whether it is right
    /// and how wrong. The summary may hold places in the scene and words of the submission's.
    pub fn said(&self) -> Cow<'_, str> {
        if !self.held_back {
            return Cow::Borrowed(&self.summary);
        }
        Cow::Owned(match self.verdict {
            Verdict::Pass => "right on a held-back scene".into(),
            Verdict::Fail => {
                format!("wrong on a held-back scene (error {})", coarse(self.error))
            }
            Verdict::NotImplemented => "not implemented on a held-back scene".into(),
            Verdict::NotJudged | Verdict::NotRun => "not judged on a held-back scene".into(),
        })
    }

    /// The check as a student may read it: of a held-back scene only what [`Check::said`] says, and nothing
    /// private.
    pub fn for_student(&self) -> Self {
        if !self.held_back {
            return Self { private: String::new(), ..self.clone() };
        }
        Self {
            held_back: true,
            convention: self.convention.clone(),
            weight: self.weight,
            error: coarse(self.error),
            ..Self::new(self.id, &self.scene, self.verdict, self.said())
        }
    }

    /// The same check with a hint.
    pub fn with_hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = hint.into();
        self
    }
}

/// The weight of a check that may cost all of a part.
fn whole() -> f64 {
    1.0
}

/// JSON has no number for what is not finite, and writes `null`.
fn or_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// The same for points of a curve.
fn or_nan_points<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<[f64; 2]>, D::Error> {
    let points: Vec<[Option<f64>; 2]> = Vec::deserialize(deserializer)?;
    Ok(points.into_iter().map(|point| point.map(|value| value.unwrap_or(f64::NAN))).collect())
}

fn is_zero(size: &usize) -> bool {
    *size == 0
}

/// Two digits: an error must not spell out a scene either.
fn coarse(error: f64) -> f64 {
    format!("{error:.1e}").parse().unwrap_or(error)
}

impl Measure {
    /// A value that passes when it is at most `bound`; NaN never passes.
    pub fn at_most(
        rule: impl Into<Option<RuleId>>,
        name: impl Into<String>,
        value: f64,
        bound: f64,
    ) -> Self {
        Self { rule: rule.into(), name: name.into(), value, bound, passed: value <= bound }
    }
}
