//! Finds the likely mistake in each failing part. It decides nothing: grading does not use it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::catalogue::{Catalogue, KnownMistake};
use super::fit::{
    Accuracy, Fitted, Subject, explain, explain_pass, explain_shadows, explain_vertex,
};
use super::loops;
use super::nearest::{Comparison, Hypothesis, Nearest, is_black, nearest};
use super::stored::{Material, Stored};
use super::view::{Observations, View, ViewKind};
use evidence::rays::INVERTED;
use evidence::{CheckId, Evidence, Picture, Verdict};
use imaging::ratio::ratio_name;

/// What one failing part looks like.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Diagnosis {
    /// The part, such as `1.3`; empty for a finding that costs nothing.
    pub part: String,
    /// The known mistakes, all made together; each as the names that cannot be told apart.
    pub mistakes: Vec<Vec<String>>,
    /// A constant factor, if there is one.
    pub factor: Option<f64>,
    /// For the student, after the words "looks like:".
    pub words: String,
    /// The fraction of the difference from what is right that this leaves unexplained.
    pub unexplained: f64,
    /// The same of the next best hypothesis; 1 is what is right.
    pub runner_up: f64,
    /// Small pictures: what was drawn, what is right, what the known mistake draws.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pictures: Vec<Picture>,
}

impl Diagnosis {
    /// The name of the viewer's case that shows the known mistake of a part.
    pub fn view_of(part: &str) -> String {
        format!("looks like @ {part}")
    }
}

/// All that a diagnosis is made from. Nothing of it comes from scenes that are held back.
pub struct Input<'a> {
    /// What was found out.
    pub evidence: &'a Evidence,
    /// The parts that lost points.
    pub failing: &'a [String],
    /// What the renderer answered.
    pub observations: &'a Observations,
    /// What known mistakes answer.
    pub stored: &'a Stored,
    /// What they are.
    pub catalogue: &'a Catalogue,
}

/// The checks of a part, and the view that isolates it.
struct Question {
    part: &'static str,
    checks: &'static [CheckId],
    isolated: &'static [ViewKind],
    /// The image that shows it too.
    image: ViewKind,
    /// The material that it is about, if any.
    material: Option<Material>,
}

const QUESTIONS: [Question; 9] = {
    const fn question(
        part: &'static str,
        checks: &'static [CheckId],
        isolated: &'static [ViewKind],
        image: ViewKind,
        material: Option<Material>,
    ) -> Question {
        Question { part, checks, isolated, image, material }
    }
    let (diffuse, phong) = (Some(Material::Diffuse), Some(Material::Phong));
    [
        question("1.1", &[CheckId::BsdfDiffuse], &[ViewKind::Diffuse], ViewKind::Offline, diffuse),
        question("1.2", &[CheckId::BsdfPhong], &[ViewKind::Phong], ViewKind::Offline, phong),
        question(
            "1.3",
            &[CheckId::RadianceLit, CheckId::LoopAgreement],
            &[ViewKind::Lit],
            ViewKind::Offline,
            None,
        ),
        question("1.4", &[CheckId::ShadowRays], &[ViewKind::Shadow], ViewKind::Offline, None),
        question("2.1", &[CheckId::PassUniforms], &[], ViewKind::Realtime, None),
        question("2.2", &[CheckId::StageVertex], &[], ViewKind::Realtime, None),
        question(
            "2.3",
            &[CheckId::StageDiffuse],
            &[ViewKind::Fragment],
            ViewKind::Realtime,
            diffuse,
        ),
        question("2.4", &[CheckId::StagePhong], &[ViewKind::Fragment], ViewKind::Realtime, phong),
        question("2.5", &[CheckId::BonusImage], &[ViewKind::Bonus], ViewKind::Bonus, None),
    ]
};

impl Input<'_> {
    /// What every failing part looks like; nothing of those that look like nothing known.
    pub fn diagnose(&self) -> Vec<Diagnosis> {
        let mut found = self.by_findings();
        for question in &QUESTIONS {
            let known = |diagnosis: &Diagnosis| diagnosis.part == question.part;
            let told = self.unwritten(question) || self.by_another_convention(question);
            if self.fails(question.part) && !told && !found.iter().any(known) {
                found.extend(self.part(question));
            }
        }
        found.sort_by(|a, b| a.part.cmp(&b.part));
        found
    }

    fn fails(&self, part: &str) -> bool {
        self.failing.iter().any(|failing| failing == part)
    }

    fn verdict_of(&self, check: CheckId, verdict: Verdict) -> bool {
        let seen = |check: &evidence::Check| !check.held_back && check.verdict == verdict;
        self.evidence.named(check).any(seen)
    }

    /// Whether what fails was judged under another convention than the handout's: what a part answers alone is no
    /// mistake then, and says nothing of one.
    fn by_another_convention(&self, question: &Question) -> bool {
        let mut checks = question.checks.iter().flat_map(|check| self.evidence.named(*check));
        checks.any(|check| check.verdict == Verdict::Fail && !check.convention.is_empty())
    }

    fn unwritten(&self, question: &Question) -> bool {
        question.checks.iter().any(|&check| self.verdict_of(check, Verdict::NotImplemented))
    }

    /// Mistakes that a finding gives away.
    fn by_findings(&self) -> Vec<Diagnosis> {
        let found = |mistake: &&KnownMistake| {
            let fails = |id: &CheckId| self.verdict_of(*id, Verdict::Fail);
            !mistake.findings.is_empty() && mistake.findings.iter().all(fails)
        };
        let mistakes = self.catalogue.mistakes.iter().filter(found);
        let named = mistakes.map(|mistake| Diagnosis {
            part: mistake.parts.iter().find(|part| self.fails(part)).cloned().unwrap_or_default(),
            ..self.known(&[&mistake.name], 0.0, 1.0)
        });
        named.collect()
    }

    fn part(&self, question: &Question) -> Option<Diagnosis> {
        let part = question.part;
        let own = |mistake: &KnownMistake| mistake.parts.iter().any(|own| own == part);
        let [isolated, image] = [question.isolated, &[question.image]]
            .map(|kinds| self.comparisons(kinds, question.material));
        // Shadows where none should be: images of the bonus do not show how it draws them.
        if part == "2.5" && self.verdict_of(CheckId::BonusDefault, Verdict::Fail) {
            return None;
        }
        // Its image is that of a renderer that tests nothing.
        let inverted = |check: &evidence::Check| check.mistake == INVERTED;
        if part == "1.4" && self.evidence.named(CheckId::ShadowRays).any(inverted) {
            let words = format!("the switch is inverted: {INVERTED}");
            return Some(Diagnosis { part: part.to_owned(), words, ..self.known(&[], 0.0, 1.0) });
        }
        if part == "1.3" {
            return self.direct_light(&isolated, &image);
        }
        // An image that several parts spoil says nothing about any one of them.
        let spoils = |other: &String| {
            other != part && ["2.1", "2.2", "2.3", "2.4"].contains(&other.as_str())
        };
        let alone = || !self.failing.iter().any(spoils);
        let known = if !question.isolated.is_empty() {
            // What isolates a part may hide how it went wrong: a surface point that is overwritten
            // under a constant witness.
            self.among(&isolated, own).or_else(|| self.among(&image, own))
        } else if question.image == ViewKind::Bonus || alone() {
            self.among(&image, own)
        } else {
            None
        };
        let found = self.better(self.fitted(part), known);
        found.map(|diagnosis| Diagnosis { part: part.to_owned(), ..diagnosis })
    }

    /// What the answers of a part say by themselves.
    fn fitted(&self, part: &str) -> Option<Diagnosis> {
        let (seen, bsdf) = (self.observations, Accuracy { relative: 1e-3, stray: 2e-3 });
        let shaded = |subject, accuracy| explain(seen.shaded.get(part)?, subject, accuracy);
        let Fitted { deviations, unexplained } = match part {
            "1.1" | "1.2" => shaded(Subject::Bsdf, bsdf),
            "1.3" => shaded(Subject::Radiance, Accuracy { relative: 5e-3, stray: 5e-3 }),
            "1.4" => explain_shadows(&seen.shadow_rays),
            "2.1" => explain_pass(&seen.bound),
            "2.2" => explain_vertex(&seen.vertices),
            "2.3" | "2.4" => shaded(Subject::Color, Accuracy { relative: 1e-2, stray: 2e-2 }),
            _ => None,
        }?;
        let words: Vec<&str> = deviations.iter().map(|deviation| &*deviation.words).collect();
        Some(Diagnosis { words: words.join("; and "), ..self.known(&[], unexplained, 1.0) })
    }

    /// A known mistake that is made alone is worded better than a fit.
    fn better(&self, fitted: Option<Diagnosis>, known: Option<Diagnosis>) -> Option<Diagnosis> {
        let alone = |known: &Diagnosis| known.mistakes.len() == 1 && known.factor.is_none();
        match (fitted, known) {
            (Some(_), Some(known)) if alone(&known) => Some(known),
            (fitted, known) => fitted.or(known),
        }
    }

    /// Part 1.3 is radiance along rays, and the loop that makes an image of it.
    fn direct_light(&self, lit: &[Comparison], image: &[Comparison]) -> Option<Diagnosis> {
        let own = |mistake: &KnownMistake| mistake.parts.iter().any(|part| part == "1.3");
        let looping =
            |mistake: &KnownMistake| matches!(&*mistake.family, "loop" | "film" | "camera");
        let rays_fail = self.verdict_of(CheckId::RadianceLit, Verdict::Fail);
        let loop_fails = self.verdict_of(CheckId::LoopAgreement, Verdict::Fail);
        let radiance = || {
            let seen = if lit.is_empty() { image } else { lit };
            let known = self.among(seen, |mistake| own(mistake) && !looping(mistake));
            self.better(self.fitted("1.3"), known)
        };
        let by_loop = || {
            // Scenes that nothing is stored of are held back.
            let public = |scene: &&String| {
                self.stored.views.contains_key(&View::new(ViewKind::Offline, scene))
            };
            let scenes = self.observations.loops.iter().filter(|(scene, _)| public(scene));
            let made = loops::explain(scenes.map(|(_, seen)| seen));
            made.map(|(name, left)| self.known(&[name], left, 1.0))
                .or_else(|| self.among(image, |mistake| own(mistake) && looping(mistake)))
        };
        let film = || {
            self.among(&self.comparisons(&[ViewKind::Film], None), |mistake| {
                mistake.family == "loop"
            })
        };
        let found = match (rays_fail, loop_fails) {
            (true, true) => match (radiance(), by_loop()) {
                (Some(a), Some(b)) => Some(a.and(b)),
                (a, b) => a.or(b),
            },
            (true, false) => radiance(),
            (false, true) => by_loop(),
            // Every ray is right, and the image at one sample per pixel too.
            (false, false) => film(),
        };
        found.map(|diagnosis| Diagnosis { part: "1.3".to_owned(), ..diagnosis })
    }

    /// What the renderer answered to questions of these kinds, beside what the store knows.
    fn comparisons(&self, kinds: &[ViewKind], material: Option<Material>) -> Vec<Comparison<'_>> {
        let seen = self.observations.tiles.iter().filter(|(view, _)| kinds.contains(&view.kind));
        let comparisons = seen.filter_map(|(view, tile)| {
            let stored = self.stored.views.get(view)?;
            let everything =
                material.is_none() || matches!(view.kind, ViewKind::Diffuse | ViewKind::Phong);
            let counts = |shown: &Material| match everything {
                true => *shown != Material::Ignored,
                false => Some(*shown) == material,
            };
            Some(Comparison {
                seen: tile,
                right: &stored.right,
                mistakes: &stored.mistakes,
                counts: stored.materials.iter().map(counts).collect(),
            })
        });
        let comparisons: Vec<Comparison> = comparisons.collect();
        // Darkness is an answer to whether a point is lit, and elsewhere has any reason.
        let lightless = |kind: &ViewKind| matches!(kind, ViewKind::Shadow | ViewKind::Bonus);
        if !kinds.iter().all(lightless) && is_black(&comparisons) {
            return Vec::new();
        }
        comparisons
    }

    /// What some views look like, among some of the known mistakes.
    fn among(
        &self,
        comparisons: &[Comparison],
        wanted: impl Fn(&KnownMistake) -> bool,
    ) -> Option<Diagnosis> {
        let mut names: Vec<&str> = Vec::new();
        for mistake in self.catalogue.mistakes.iter().filter(|mistake| wanted(mistake)) {
            if !mistake.alike.iter().any(|other| names.contains(&other.as_str())) {
                names.push(&mistake.name);
            }
        }
        let Nearest { guess, distance, runner_up } = nearest(comparisons, &names)?;
        let family = |name: &str| self.catalogue.named(name).map(|known| &known.family);
        Some(match guess {
            // What two of a kind explain together is rather a third.
            Hypothesis::Two(a, b) if family(&a) == family(&b) => return None,
            Hypothesis::One(name) => self.known(&[&name], distance, runner_up),
            Hypothesis::Two(a, b) => self.known(&[&a, &b], distance, runner_up),
            Hypothesis::Factor(factor) => self.known(&[], distance, runner_up).times(factor),
            Hypothesis::Scaled(name, factor) => {
                self.known(&[&name], distance, runner_up).times(factor)
            }
        })
    }

    /// The words for mistakes made together.
    fn known(&self, names: &[&str], unexplained: f64, runner_up: f64) -> Diagnosis {
        let (mut mistakes, mut words) = (Vec::new(), Vec::new());
        for name in names {
            let Some(mistake) = self.catalogue.named(name) else { continue };
            let alike: Vec<&KnownMistake> = std::iter::once(mistake)
                .chain(mistake.alike.iter().filter_map(|other| self.catalogue.named(other)))
                .collect();
            mistakes.push(alike.iter().map(|mistake| mistake.name.clone()).collect());
            let each: Vec<&str> = alike.iter().map(|mistake| mistake.looks_like.as_str()).collect();
            words.push(each.join("; or "));
        }
        let words = words.join("; and ");
        Diagnosis {
            part: String::new(),
            mistakes,
            factor: None,
            words,
            unexplained,
            runner_up,
            pictures: Vec::new(),
        }
    }
}

impl Diagnosis {
    /// Two things that were found apart, in one part.
    fn and(self, other: Self) -> Self {
        Self {
            mistakes: [self.mistakes, other.mistakes].concat(),
            factor: self.factor.or(other.factor),
            words: format!("{}; and {}", self.words, other.words),
            unexplained: self.unexplained.max(other.unexplained),
            runner_up: self.runner_up.min(other.runner_up),
            part: self.part,
            pictures: Vec::new(),
        }
    }

    /// The same with a constant factor on top.
    fn times(mut self, factor: f32) -> Self {
        let value = f64::from(factor);
        let name = ratio_name(value).map(|name| format!(" ({name})")).unwrap_or_default();
        let words = format!("off by a constant factor of {value:.4}{name}");
        self.words =
            if self.words.is_empty() { words } else { format!("{}; and {words}", self.words) };
        self.factor = Some(value);
        self
    }
}
