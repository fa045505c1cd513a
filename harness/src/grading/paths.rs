//! Judges both halves of the assignment, offline and realtime, scene by scene.

use std::path::Path;
use std::sync::atomic::Ordering;

use super::begun::Say;
use super::conventions::Answers;
use super::host_changes::MendedBy;
use super::offline::{self, Drawn, Run};
use super::pipeline::Grading;
use super::prepared_scene::PreparedScene;
use super::session::Session;
use super::stages::{Stages, nothing_unset};
use super::{bonus, isolate, one_slip, realtime, sampler, uploads, usual_pipelines};
use crate::evidence::{Check, CheckId, Verdict, loops, price, rays, shadow_map};

/// By how much the standard error of a region's mean grows when its rows share their noise: the
/// root of its height in pixels; the highlights that are judged apart are about 9 pixels high.
const DEPENDENT_PIXELS: f64 = 3.0;

impl Grading<'_> {
    pub(super) fn offline(
        &self,
        session: &Session,
        plugin: &Path,
        seed: u64,
        say: Say,
        checks: &mut Vec<Check>,
        drawn: &mut Vec<Drawn>,
    ) -> anyhow::Result<()> {
        // Cheap questions first: a slow submission then skips only the most expensive ones.
        let probed = self.groups().map(|cases| {
            let mut answers = Answers::default();
            let checks = answers.probe_bsdfs(session, plugin, cases);
            if cases.iter().any(|case| !case.held_back) {
                say(&answers.first_verdict());
            }
            (answers, checks)
        });
        PreparedScene::cast_rays(&self.cases);
        if self.is_told_by_bsdfs() {
            let mut told: Vec<Check> =
                probed.iter().flat_map(|(answers, _)| answers.judge()).collect();
            mark(&mut told, &self.cases);
            let is_right = |id: &CheckId| {
                let own = || told.iter().filter(|check| check.id == *id);
                own().count() > 0 && own().all(|check| check.verdict != Verdict::Fail)
            };
            // Where one is not, integrator and images may still show that it is right together with them.
            if self.asked.iter().all(is_right) {
                checks.extend(told);
                return Ok(());
            }
        }
        let scene = std::path::absolute(self.assignment.root.join(&self.assignment.sampler_scene))?;
        let findings = sampler::judge(session, plugin, &scene)?;
        let mut tolerances = self.assignment.tolerances.clone();
        if findings
            .iter()
            .any(|found| found.id != CheckId::SamplerSeed && found.verdict == Verdict::Fail)
        {
            // Pixels are as noisy as they should be, but not independent, so that the mean of a
            // region is noisier than they tell: a finding, no wrong image.
            tolerances.bias_standard_errors *= DEPENDENT_PIXELS;
        }
        checks.extend(findings);
        for (cases, (mut answers, probed)) in self.groups().into_iter().zip(probed) {
            let begin = checks.len();
            checks.extend(probed);
            // One large image is drawn whole even if it is right: a public one, which can be shown.
            let mut whole = cases.iter().all(|case| !case.held_back);
            for case in cheap_first(cases) {
                self.stop_if_interrupted()?;
                let run = Run { seed, threads: self.threads, whole };
                whole &= case.first.is_none();
                let (found, image) =
                    offline::judge_scene(session, plugin, case, run, &tolerances, &mut answers);
                checks.extend(found);
                drawn.extend(image);
            }
            checks.extend(answers.judge());
            if cases.iter().any(|case| case.probe_film.sampled.is_some()) {
                checks.push(loops::judge_edges(&answers.edges));
            }
            rays::leave_unjudged(&mut checks[begin..]);
            price::settle_by_common_mistake(&mut checks[begin..]);
            mark(&mut checks[begin..], cases);
        }
        Ok(())
    }

    /// Whether BSDFs by themselves tell all that is asked.
    fn is_told_by_bsdfs(&self) -> bool {
        let of_bsdf = |id: &CheckId| [CheckId::BsdfDiffuse, CheckId::BsdfPhong].contains(id);
        !self.asked.is_empty() && self.asked.iter().all(of_bsdf)
    }

    /// The public scenes and the held-back ones. No worker is asked about both, and neither's
    /// verdicts hang on the other's: what a renderer learns of a held-back scene must not show in
    /// an image of a public one.
    fn groups(&self) -> [&[PreparedScene]; 2] {
        let public = self.cases.iter().take_while(|case| !case.held_back).count();
        self.cases.split_at(public).into()
    }

    pub(super) fn realtime(
        &self,
        session: &Session,
        plugin: &Path,
        stages: &Stages,
        checks: &mut Vec<Check>,
        drawn: &mut Vec<Drawn>,
    ) -> anyhow::Result<()> {
        let tolerances = &self.assignment.tolerances;
        for cases in self.groups() {
            let begin = checks.len();
            let judged = realtime::judge_images(session, plugin, cases, stages, tolerances);
            let fails = judged.iter().any(|judged| judged.fails);
            let footprints: Vec<_> = judged.iter().map(|judged| judged.footprint).collect();
            let uploaded = uploads::judge(session, plugin, cases, &footprints);
            let nothing_draws = stages.nothing_draws().or(uploaded.nothing_draws);
            checks.extend(uploaded.checks);
            let mut is_right = true;
            for judged in judged {
                let mut found = judged.checks;
                if let Some(why) = nothing_draws {
                    found.iter_mut().for_each(|check| realtime::drawn_by_nobody(check, why));
                }
                let proof = |check: &Check| {
                    check.id == CheckId::ImageRealtime && check.verdict != Verdict::Pass
                };
                is_right &= !found.iter().any(proof);
                checks.extend(found);
                drawn.extend(judged.drawn);
            }
            // A held-back scene leaves it to a public one, never the other way round.
            shadow_map::leave_unjudged(checks, begin);
            self.stop_if_interrupted()?;
            // Right end to end is enough. Where an image is wrong, pass and stages are taken apart on all scenes:
            // what a stage does not test may show only on a scene that a wrong pass draws right.
            if !is_right {
                let own = (&checks[begin..], fails);
                let mut found = isolate::isolate(session, plugin, cases, stages, own, tolerances);
                session.retries.uncounted(|| {
                    let mended_by = usual_pipelines::price_pass(session, plugin, cases, &mut found);
                    checks.extend(found);
                    if nothing_draws.is_some() {
                        return;
                    }
                    let own = (&checks[begin..], &drawn[..]);
                    let slip = one_slip::judge(session, plugin, cases, stages, own, tolerances);
                    // What a pass forgets to set leaves no light to see shadows by.
                    let mended_by = slip.mended_by.or(mended_by.map(MendedBy::Stage));
                    let stage = |case: &PreparedScene| match &mended_by {
                        Some(mended_by) => mended_by.stage(case),
                        None => nothing_unset(case.expected.scene.first_light_position(), &[]),
                    };
                    let found = &mut checks[begin..];
                    bonus::judge_under(&stage, session, plugin, cases, tolerances, found);
                    if slip.is_of_missing_surfaces {
                        bonus::judge_where_seen(cases, drawn, tolerances, found);
                    }
                    checks.extend(slip.checks);
                });
            }
            if nothing_draws.is_none() {
                let found = &mut checks[begin..];
                session.retries.uncounted(|| {
                    bonus::price_by_edits(session, plugin, cases, stages, drawn, tolerances, found);
                });
            }
            price::settle_by_common_mistake(&mut checks[begin..]);
            mark(&mut checks[begin..], cases);
        }
        self.stop_if_interrupted()
    }

    fn stop_if_interrupted(&self) -> anyhow::Result<()> {
        anyhow::ensure!(!self.cancel.load(Ordering::Relaxed), "interrupted");
        Ok(())
    }
}

/// Scenes by what their images cost: where a submission uses up its time, the most expensive are not asked.
fn cheap_first(cases: &[PreparedScene]) -> Vec<&PreparedScene> {
    let mut order: Vec<&PreparedScene> = cases.iter().collect();
    order.sort_by_key(|case| {
        let (width, height) = case.film();
        u64::from(width) * u64::from(height) * u64::from(case.spp)
    });
    order
}

/// Notes in the checks on a group of scenes whether these are held back, and what they can cost.
fn mark(checks: &mut [Check], cases: &[PreparedScene]) {
    let held_back = cases.iter().any(|case| case.held_back);
    for check in checks {
        check.held_back = held_back;
        let case = cases.iter().find(|case| case.entry.name == check.scene);
        // Shadows where none belong do not depend on the scene.
        let own = case.filter(|_| check.id != CheckId::BonusDefault);
        check.weight = own.map_or(1.0, |case| case.entry.weight);
    }
}
