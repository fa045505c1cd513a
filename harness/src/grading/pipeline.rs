//! One submission through all stages: what was begun, then offline, realtime, images.

use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, OnceLock};
use std::time::Instant;

use anyhow::Context;
use tempfile::TempDir;

use super::begun::{Begun, Say, Workshop};
use super::cache::RecordCache;
use super::costs::ReferenceCosts;
use super::pictures::Images;
use super::prepared_scene::PreparedScene;
use super::record::{Conditions, Folders, Record};
use super::session::{KeptFrames, Session};
use super::stages::Stages;
use super::tree_checks::Mode;
use super::{draw, submitted};
use crate::assignment::Assignment;
use crate::build::Recording;
use crate::decode::Decoder;
use crate::diagnosis::{Diagnosis, Stored};
use crate::evidence::{Check, CheckId, Evidence, Verdict};
use crate::held_back::{self, HeldBack};
use crate::store::Store;
use crate::worker::{Adapter, Budget, Reference, RetryBudget, Supervisor};

/// The check that fails nobody: it says that the machine did.
const JUDGED: CheckId = CheckId::SubmissionJudged;

/// Everything that is the same for all submissions of a batch.
pub struct Grading<'a> {
    /// The assignment.
    pub assignment: &'a Assignment,
    /// Starts workers.
    pub supervisor: Supervisor,
    /// Keeps the compiled shaders that the supervisor gives to workers.
    pub(super) compiled: Option<TempDir>,
    /// The template's compiler call.
    pub recording: Recording,
    /// The scenes, ready: the public ones first.
    pub cases: Vec<PreparedScene>,
    /// What is held back, if anything.
    pub held_back: Option<HeldBack>,
    /// What realtime is drawn with, or why nothing can be.
    pub adapter: Result<Adapter, String>,
    /// What Umbra's own pass drew with, in the adapter's words; empty when nothing can be drawn.
    pub(super) drawn_with: String,
    /// Where frames of that pass are kept, if anywhere.
    pub(super) kept_frames: Option<KeptFrames>,
    /// The reference renderer's library; absent in a student's kit.
    pub reference: Option<PathBuf>,
    /// Threads for each submission.
    pub threads: u32,
    /// Ctrl-C.
    pub cancel: &'a AtomicBool,
    /// What is asked about: both halves of the assignment, or one.
    pub paths: Vec<RenderPath>,
    /// The checks whose verdicts are asked for; all, if none is named.
    pub asked: Vec<CheckId>,
    /// Whether realtime is judged before anything is rendered offline.
    pub realtime_first: bool,
    /// Whether submitted images are compared with what the code draws.
    pub compares_submitted: bool,
    /// Records made before and to be made, if they are kept.
    pub cache: Option<RecordCache>,
    /// What a submission may use on each path, if that is limited.
    pub budget: Option<Budget>,
    /// What the reference renderer takes, as far as it was needed.
    pub(super) reference_costs: ReferenceCosts,
    /// What known mistakes answer, read when it is first needed.
    pub(super) stored: OnceLock<Stored>,
}

/// A way from a scene to an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RenderPath {
    /// Rays on the CPU: parts 1.1 to 1.4.
    Offline,
    /// Rasterized: parts 2.1 to 2.5.
    Realtime,
}

impl RenderPath {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Offline, Self::Realtime];
}

impl<'a> Grading<'a> {
    /// Makes the batch ready: records the compiler call, loads all scenes, tries the adapter.
    /// `held_back_seed` is the seed of the held-back scenes; without one there are none.
    ///
    /// # Errors
    /// When the template cannot be built or expected images cannot be had: the machine's matter.
    pub fn prepare(
        store: &Store<'a>,
        adapter: Adapter,
        held_back_seed: Option<u64>,
        cancel: &'a AtomicBool,
    ) -> anyhow::Result<Self> {
        Self::prepare_beside(store, adapter, held_back_seed, cancel, |_| ())
            .map(|(ready, ())| ready)
    }

    /// The same, while something is done that needs no scene. Answers what that gives, too.
    ///
    /// # Errors
    /// As [`Grading::prepare`].
    pub fn prepare_beside<T: Send>(
        store: &Store<'a>,
        adapter: Adapter,
        held_back_seed: Option<u64>,
        cancel: &'a AtomicBool,
        beside: impl FnOnce(&Workshop) -> T + Send,
    ) -> anyhow::Result<(Self, T)> {
        let assignment = store.assignment;
        anyhow::ensure!(
            held_back_seed.is_none() || store.reference.is_some(),
            "held-back scenes cannot be made: there is no reference renderer to tell what is right on them; \
             hint: `--held-back off` grades on the public scenes alone"
        );
        let begun = Instant::now();
        let recording =
            Recording::obtain_telling(&assignment.root, &store.supervisor.umbra, &|compiling| {
                (store.progress)(&compiling.in_words(begun.elapsed()));
            })?;
        let workshop =
            Workshop { assignment, supervisor: store.supervisor, recording: &recording, cancel };
        let (ready, done) = std::thread::scope(|scope| {
            let done = scope.spawn(|| beside(&workshop));
            let ready =
                Self::with_scenes(store, adapter, held_back_seed, cancel, recording.clone());
            if let (Ok(ready), false) = (&ready, done.is_finished()) {
                PreparedScene::cast_rays(&ready.cases);
            }
            (ready, done.join().unwrap_or_else(|panic| resume_unwind(panic)))
        });
        Ok((ready?, done))
    }

    /// Makes ready what needs scenes.
    fn with_scenes(
        store: &Store<'a>,
        adapter: Adapter,
        held_back_seed: Option<u64>,
        cancel: &'a AtomicBool,
        recording: Recording,
    ) -> anyhow::Result<Self> {
        let assignment = store.assignment;
        let mut cases = PreparedScene::all(store, &assignment.scenes)?;
        let held_back =
            held_back_seed.map(|seed| hold_back(store, seed, &mut cases)).transpose()?;
        let mut grading = Self {
            assignment,
            supervisor: store.supervisor.clone(),
            compiled: None,
            recording,
            cases,
            held_back,
            adapter: Ok(adapter),
            drawn_with: String::new(),
            kept_frames: None,
            reference: store.reference.clone(),
            threads: store.threads,
            cancel,
            paths: RenderPath::ALL.to_vec(),
            asked: Vec::new(),
            realtime_first: false,
            compares_submitted: true,
            cache: None,
            budget: Some(assignment.limits.budget.clone()),
            reference_costs: ReferenceCosts::default(),
            stored: OnceLock::new(),
        };
        if let Some(case) = grading.cases.first() {
            match draw::probe_adapter(&grading.session(""), case) {
                Ok(adapter) => grading.drawn_with = adapter,
                Err(why) => grading.adapter = Err(why),
            }
        }
        grading.compile_shaders()?;
        Ok(grading)
    }

    pub(super) fn session(&self, options: &str) -> Session<'_> {
        let mut limits = self.assignment.limits.run.clone();
        limits.threads = self.threads;
        Session {
            supervisor: self.supervisor.clone(),
            limits,
            cancel: self.cancel,
            adapter: self.adapter.clone(),
            options: options.to_owned(),
            cpu_s: Mutex::new(0.0),
            printed: Mutex::new(0),
            retries: RetryBudget::with(
                self.reference.is_some().then_some(self as &dyn Reference),
                self.budget.clone(),
            ),
            reference: self.reference.as_deref(),
            scenes_interfere: AtomicBool::new(false),
            kept_frames: self.kept_frames.as_ref(),
            observations: Mutex::default(),
            compiler_messages: Mutex::default(),
        }
    }

    /// Grades one submission; pictures of what is wrong go to `out`. `say` is told each stage.
    ///
    /// # Errors
    /// The machine's matters and Ctrl-C; what is wrong with the submission is in the record.
    pub fn submission(
        &self,
        source: &Path,
        slug: &str,
        out: &Folders,
        mode: Mode,
        say: Say,
    ) -> anyhow::Result<Record> {
        let workshop = self.workshop();
        let mut begun = workshop.receive(source, slug, mode, say)?;
        begun.record.conditions = self.conditions();
        let (Some(cache), true) = (&self.cache, begun.received.is_some()) else {
            workshop.build(&mut begun, say)?;
            return self.judge(begun, out, say);
        };
        let failing = |evidence: &Evidence| self.failing(evidence);
        let key = cache.key(&begun.record, &begun.checks)?;
        if let Some(found) = cache.find(&key, failing, self.budget.is_some(), out) {
            return Ok(found);
        }
        workshop.build(&mut begun, say)?;
        cache.keep(&key, failing, self.judge(begun, out, say)?, out)
    }

    /// Goes on with a submission that was received and built.
    ///
    /// # Errors
    /// As [`Grading::submission`].
    pub fn judge(&self, begun: Begun, out: &Folders, say: Say) -> anyhow::Result<Record> {
        let Begun { mut record, mut checks, mut costs, received, built, scratch: _scratch } = begun;
        record.conditions = self.conditions();
        let Some((submission, config)) = received else {
            record.evidence = Evidence { checks };
            return Ok(record);
        };
        let session = self.session("");
        let decoder = Decoder::new(&self.supervisor, &self.assignment.limits.decode, self.cancel);
        let seed = config.sampler_seed().unwrap_or_default();
        let mut drawn = Vec::new();
        if let Some((plugin, built)) = &built {
            let stages = Stages::read(&built.src, &self.assignment.template());
            let both = self.both_paths(&session, plugin, &stages, seed, say, &mut costs)?;
            if let Some(realtime) = &both.realtime {
                record.findings.extend(stages.findings());
                let said =
                    [std::mem::take(&mut record.diagnostics), realtime.compiler_messages.clone()];
                record.diagnostics =
                    said.into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join("\n");
            }
            for path in [both.offline, both.realtime].into_iter().flatten() {
                checks.extend(path.checks);
                drawn.extend(path.drawn);
            }
        }
        let compared: &[PreparedScene] = if self.compares_submitted { &self.cases } else { &[] };
        if self.compares_submitted {
            say("comparing the submitted images");
        }
        let tree = &self.assignment.tree;
        let submitted = submitted::read(&decoder, &submission.root, tree, compared)?;
        record
            .findings
            .extend(submitted.iter().filter_map(|image| image.finding(&submission.root)));
        record.findings.sort_by_key(|finding| finding.severity);
        let is_right =
            |check: &&Check| check.id == CheckId::ImageOffline && check.verdict == Verdict::Pass;
        let right: Vec<String> =
            checks.iter().filter(is_right).map(|check| check.scene.clone()).collect();
        for image in &submitted {
            let tolerances = &self.assignment.tolerances;
            let (found, digest) = submitted::judge(image, &drawn, &right, tolerances);
            checks.extend(found);
            record.images.extend(digest);
        }
        if let (None, Some(reference), Some(seed)) =
            (&built, &self.reference, config.sampler_seed())
        {
            checks.extend(submitted::judge_seeds(&session, reference, &submitted, seed));
        }
        costs.end("images", decoder.take_cpu_s() + session.end_path());
        if let Some((_, built)) = &built {
            built.explain(&self.assignment.rules, &mut checks, &mut record.findings);
        }
        let images = Images { cases: &self.cases, drawn: &drawn, submitted: &submitted };
        images.draw(&mut checks, out)?;
        record.error_maps = images.error_maps(&checks);
        record.views = images.view(&checks, &self.assignment.tolerances, out)?;
        costs.end("pictures", 0.0);
        record.evidence = Evidence { checks };
        let (diagnoses, views) =
            self.diagnose(&session, &record.evidence, &drawn, Some(&out.student))?;
        record.diagnoses = diagnoses;
        record.views.extend(views);
        record.stages = costs.end("diagnosis", 0.0);
        Ok(record)
    }

    /// What receives and builds submissions.
    fn workshop(&self) -> Workshop<'_> {
        let Self { assignment, supervisor, recording, cancel, .. } = self;
        Workshop { assignment, supervisor, recording, cancel }
    }

    /// The record of a submission that the machine failed on: nothing is found out, no point lost.
    pub fn unjudged(&self, source: &Path, slug: &str) -> Record {
        let summary = "the machine failed before this submission could be judged";
        let checks = vec![Check::new(JUDGED, "", Verdict::NotRun, summary)];
        Record { evidence: Evidence { checks }, ..self.begin(source, slug) }
    }

    pub(super) fn begin(&self, source: &Path, slug: &str) -> Record {
        Record { conditions: self.conditions(), ..Record::begun(source, slug) }
    }

    /// What is found out on some paths about a library that is there already, without a submission
    /// around it, and what it looks like. `options` are told to it with every scene, `seed` to its
    /// samplers; `stages` are its texts.
    ///
    /// # Errors
    /// The machine's matters and Ctrl-C.
    pub fn plugin(
        &self,
        library: &Path,
        options: &str,
        seed: u64,
        stages: &Stages,
        paths: &[RenderPath],
    ) -> anyhow::Result<(Evidence, Vec<Diagnosis>)> {
        let mut session = self.session(options);
        let mut _compiled = None;
        let (mut checks, mut drawn) = (Vec::new(), Vec::new());
        if paths.contains(&RenderPath::Offline) {
            self.offline(&session, library, seed, &|_| (), &mut checks, &mut drawn)?;
            session.retries.renew();
        }
        if paths.contains(&RenderPath::Realtime) {
            _compiled = self.compile_own(&mut session, stages, &|_| ())?;
            self.realtime(&session, library, stages, &mut checks, &mut drawn)?;
        }
        let evidence = Evidence { checks };
        let (diagnoses, _) = self.diagnose(&session, &evidence, &drawn, None)?;
        Ok((evidence, diagnoses))
    }

    fn conditions(&self) -> Conditions {
        Conditions {
            umbra: env!("CARGO_PKG_VERSION").to_owned(),
            isolation: self.supervisor.isolation.isolation().to_string(),
            adapter: match &self.adapter {
                Ok(adapter) => format!("{:?} {}", adapter.kind, adapter.name).trim().to_owned(),
                Err(why) => format!("none: {why}"),
            },
            compiler: format!("{}, call {}", self.recording.version, self.recording.key),
        }
    }
}

/// Makes the held-back scenes of a batch ready.
fn hold_back(store: &Store, seed: u64, cases: &mut Vec<PreparedScene>) -> anyhow::Result<HeldBack> {
    (store.progress)("making the held-back scenes");
    let (held_back, entries) = held_back::make(store.assignment, seed)?;
    let made = PreparedScene::all(store, &entries).with_context(|| format!("seed {seed}"))?;
    for case in made {
        // What the loop does wrong must explain the wrong images here as well.
        let mut case = case.with_samples()?;
        case.held_back = true;
        cases.push(case);
    }
    Ok(held_back)
}
