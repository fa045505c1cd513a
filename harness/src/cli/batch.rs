//! Takes submissions through all stages and writes their report: the code that `umbra check` and `umbra grade` share.

mod prepare;
mod queue;

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use anyhow::{Context as _, ensure};

use self::prepare::{same_seed, tell_of_copies};
use super::assemble;
use super::choices::{BudgetChoice, HeldBackSeed, IsolationChoice, Slice};
use super::class::{self, Source, Telling};
use super::context::{Context, INTERRUPTED, cores};
use super::found::BatchIndex;
use super::join::join;
use super::render::AdapterChoice;
use super::selection::Selection;
use crate::class::{Attempt, Collected, Platform};
use crate::files::write_whole;
use crate::grading::{Grading, Mode, RecordCache, StoredRecord};
use crate::held_back::HeldBack;
use crate::program::graded;
use crate::report::{self, BatchReport, SubmissionReport};
use crate::store::Store;

/// The file with the seed of a batch's held-back scenes, in the instructor's folder.
const SEED_FILE: &str = "held-back-seed.txt";

/// The file with the reference renderer's times on this machine, if a slow submission needed them.
const COSTS_FILE: &str = "reference-costs.json";

/// Submissions to be taken through all stages.
pub struct Batch<'a> {
    /// Where they lie, or folders that hold them.
    pub paths: Vec<PathBuf>,
    /// The report's folder.
    pub output: &'a Path,
    /// What draws.
    pub adapter: AdapterChoice,
    /// Number of submissions graded at the same time.
    pub jobs: usize,
    /// Whether to grade or to check.
    pub mode: Mode,
    /// The isolation to demand.
    pub isolation: IsolationChoice,
    /// The held-back scenes; `None` for the seed that is recorded with the batch.
    pub held_back_seed: Option<HeldBackSeed>,
    /// How much time each has in all.
    pub budget: BudgetChoice,
    /// The parts and scenes to ask about; `None` for all.
    pub selection: Option<&'a Selection>,
    /// Whose submissions alone are graded, unless it is empty.
    pub only: &'a [String],
    /// Which share of them alone is graded, without a report.
    pub slice: Option<Slice>,
    /// Where they come from; recognized where it is not said.
    pub from: Option<Platform>,
    /// The class list; that of an earlier run where none is named.
    pub list: Option<&'a Path>,
    /// Which attempt of a student counts; as before where it is not said.
    pub attempt: Option<Attempt>,
    /// Whether to grade submissions again that have not changed.
    pub force: bool,
    /// Where to leave the compiled library, if anywhere.
    pub keeps_plugin: Option<&'a Path>,
    /// Whether realtime is judged before anything is rendered offline.
    pub realtime_first: bool,
    /// Whether to print what each stage cost.
    pub timings: bool,
    /// Whether the submission is a copy that Umbra put into the report's folder itself.
    pub is_own: bool,
}

/// How a batch ended.
pub enum BatchOutcome {
    /// By Ctrl-C.
    Interrupted,
    /// With its report, and what was found.
    Report(Box<BatchReport>, Collected),
    /// With the records of a slice, their points, and the number of all submissions that count.
    Slice(Vec<SubmissionReport>, usize),
}

/// What was graded.
struct Graded {
    records: Vec<anyhow::Result<StoredRecord>>,
    held_back: Option<HeldBack>,
    cache: Option<RecordCache>,
}

impl<'a> Batch<'a> {
    /// A batch with the default options of a mode.
    pub fn of(paths: Vec<PathBuf>, output: &'a Path, mode: Mode) -> Self {
        let (jobs, isolation) = match mode {
            Mode::Grade => (cores() as usize, IsolationChoice::Full),
            Mode::Check => (1, IsolationChoice::Reduced),
        };
        Self {
            paths,
            output,
            adapter: AdapterChoice::Software,
            jobs,
            mode,
            isolation,
            held_back_seed: None,
            budget: BudgetChoice::Config,
            selection: None,
            only: &[],
            slice: None,
            from: None,
            list: None,
            attempt: None,
            force: false,
            keeps_plugin: None,
            realtime_first: false,
            timings: false,
            is_own: false,
        }
    }

    /// Grades all and writes the reports, or the records of a slice.
    ///
    /// # Errors
    /// When a path does not exist, an earlier report cannot be read, or a report cannot be written.
    pub fn run(&self, root: Option<&Path>) -> anyhow::Result<BatchOutcome> {
        for path in &self.paths {
            ensure!(path.exists(), "{} does not exist", path.display());
        }
        let mut context = Context::new(root)?;
        // What a zip of many holds, until the end of the batch.
        let scratch = tempfile::tempdir_in(&context.supervisor.scratch)?;
        let collected = self.collect(&context, scratch.path())?;
        self.ensure_apart(&context, &collected)?;
        super::writable(self.output)?;
        self.ensure_means(&context)?;
        if let Some(selection) = self.selection {
            selection.restrict(&mut context.assignment)?;
        }
        let mut pins = match self.mode {
            Mode::Grade => Some(self.pin(&mut context.assignment, root)?),
            Mode::Check => None,
        };
        let context = &context;
        let seed = self.seed(&self.output.join(report::INSTRUCTOR).join(SEED_FILE))?;
        let earlier = match self.mode {
            Mode::Grade => BatchIndex::read(self.output)?.unwrap_or_default(),
            Mode::Check => BatchIndex::default(),
        };
        let names = earlier.names();
        let all = class::sources(self.mode, &collected.sources, self.output, &names);
        tell_of_copies(&collected, &all, &names);
        let telling = match &pins {
            Some((pins, decided)) => self.telling(pins, decided)?,
            None => Telling::default(),
        };
        if self.slice.is_some() {
            same_seed(seed, self.output)?;
        }
        let aside = match &pins {
            Some((_, decided)) => self.set_aside(&all, decided)?,
            None => HashSet::new(),
        };
        let mut chosen = class::only(context, self.output, &all, self.only, &telling)?;
        chosen.retain(|source| !aside.contains(&source.slug));
        let mut found = self.found(&collected, &all, &aside);
        let counting = chosen.len();
        if let Some(slice) = self.slice {
            let own = chosen.into_iter().enumerate().filter(|(at, _)| slice.holds(*at));
            chosen = own.map(|(_, source)| source).collect();
        }
        let result =
            context.with_store(|store| self.grade(context, store, seed, &chosen, &mut found));
        context.progress.end();
        if INTERRUPTED.load(Ordering::Relaxed) {
            let goes_on = match (self.mode, &result) {
                (Mode::Grade, Ok(graded)) => format!(
                    ", {} of {} submissions are graded; the same command resumes there",
                    graded.records.len(),
                    chosen.len()
                ),
                _ => String::new(),
            };
            eprintln!("umbra: interrupted{goes_on}");
            return Ok(BatchOutcome::Interrupted);
        }
        let Graded { records, held_back, cache } = result?;
        let mut records = records.into_iter().collect::<anyhow::Result<Vec<StoredRecord>>>()?;
        if self.slice.is_some() {
            let rules = &context.assignment.rules;
            let entry = |own: &StoredRecord| Ok(report::outline(graded(own.whole()?, rules)));
            let entries = records.iter().map(entry).collect::<anyhow::Result<_>>()?;
            return Ok(BatchOutcome::Slice(entries, counting));
        }
        let report = match (&mut pins, cache) {
            (Some((pins, decided)), Some(cache)) => {
                if cache.found() > 0 {
                    eprintln!(
                        "umbra: {} of {} submissions keep their earlier grades",
                        cache.found(),
                        chosen.len()
                    );
                }
                join(self.output, &found, &mut records);
                let conditions = found.conditions.clone();
                let report = assemble::finish(self.output, pins, decided, found, records)?;
                if self.only.is_empty() {
                    BatchIndex::supersede(self.output, &conditions)?;
                }
                report
            }
            _ => self.report_of_check(context, records, held_back)?,
        };
        if self.timings {
            print_timings(&report);
        }
        Ok(BatchOutcome::Report(Box::new(report), collected))
    }

    /// Takes the chosen submissions through all stages.
    fn grade(
        &self,
        context: &Context,
        store: &Store,
        seed: Option<u64>,
        chosen: &[&Source],
        found: &mut BatchIndex,
    ) -> anyhow::Result<Graded> {
        let adapter = self.adapter.adapter();
        // What a student waits for is compiled while scenes are made ready.
        let (mut grading, begun) =
            Grading::prepare_beside(store, adapter, seed, &INTERRUPTED, |workshop| {
                let own = chosen.first().filter(|_| self.mode == Mode::Check);
                own.map(|source| self.begin(context, workshop, source))
            })?;
        if self.mode == Mode::Grade {
            let cache = grading.record_cache(self.force)?;
            found.conditions = cache.conditions();
            found.held_back.clone_from(&grading.held_back);
            grading.cache = Some(cache);
        }
        if self.slice.is_some() {
            found.begin(self.output)?;
        }
        if self.mode == Mode::Check {
            grading.keep_frames(context.assignment.cache().join("frames"));
        }
        if self.budget == BudgetChoice::None {
            grading.budget = None;
        }
        grading.paths = self.selection.map_or(grading.paths, |selection| selection.paths(context));
        grading.asked = self.selection.map_or(Vec::new(), |selection| selection.checks(context));
        grading.realtime_first = self.realtime_first;
        grading.compares_submitted = self.selection.is_none_or(Selection::is_all);
        let jobs = self.jobs.min(chosen.len()).max(1);
        grading.threads = (cores() / jobs as u32).max(1);
        let records = match (begun, chosen) {
            (Some(begun), [source]) => {
                vec![begun.and_then(|begun| self.go_on(context, &grading, source, begun))]
            }
            _ => {
                let (all, gone) = self.grade_all(context, &grading, chosen, jobs);
                found.unopened.extend(gone);
                all.into_iter().map(Ok).collect()
            }
        };
        let costs = grading.costs_of_reference();
        if self.mode == Mode::Grade && !costs.is_empty() {
            let file = self.output.join(report::INSTRUCTOR).join(COSTS_FILE);
            write_whole(&file, &serde_json::to_vec_pretty(&costs)?)
                .with_context(|| format!("cannot write {}", file.display()))?;
        }
        Ok(Graded { records, held_back: grading.held_back, cache: grading.cache })
    }

    /// Writes the report of a check. One submission is no batch: nobody else can have submitted the same.
    fn report_of_check(
        &self,
        context: &Context,
        records: Vec<StoredRecord>,
        held_back: Option<HeldBack>,
    ) -> anyhow::Result<BatchReport> {
        let rules = &context.assignment.rules;
        let entry = |record| {
            let mut entry = graded(record, rules);
            if let Some(selection) = self.selection {
                selection.only_of(&mut entry.grade, rules, &entry.record.evidence);
            }
            entry
        };
        let entries = records.into_iter().map(|own| entry(own.record)).collect();
        let report = BatchReport::new(&context.assignment, held_back, entries);
        report::write(self.output, &report)?;
        Ok(report)
    }

    /// What is known of the batch before anything is graded.
    fn found(&self, collected: &Collected, all: &[Source], aside: &HashSet<String>) -> BatchIndex {
        let mut found = BatchIndex::new(collected, all, |source| aside.contains(&source.slug));
        let list = self.list.and_then(Path::file_name);
        found.list = list.unwrap_or_default().to_string_lossy().into_owned();
        let whole = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
        found.paths = self.paths.iter().map(whole).collect();
        found
    }
}

fn print_timings(report: &BatchReport) {
    for entry in &report.entries {
        eprintln!("{}", entry.record.name);
        let (mut wall_s, mut cpu_s) = (0.0, 0.0);
        for stage in &entry.record.stages {
            eprintln!("  {:<10} {:7.2} s wall {:7.2} s cpu", stage.name, stage.wall_s, stage.cpu_s);
            wall_s += stage.wall_s;
            cpu_s += stage.cpu_s;
        }
        eprintln!(
            "  {:<10} {wall_s:7.2} s wall {cpu_s:7.2} s cpu (of child processes)",
            "together"
        );
    }
}
