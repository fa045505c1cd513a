//! Takes submissions through all stages and writes their report: the code that `umbra check` and `umbra grade` share.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::{Context as _, bail, ensure};

use super::MachineLacks;
use super::assemble;
use super::choices::{BudgetChoice, IsolationChoice, Perturb, Slice};
use super::class::{self, Source, Telling};
use super::context::{Context, INTERRUPTED, cores};
use super::export;
use super::found::Found;
use super::join::join;
use super::outputs::{at_root, ensure_apart, ensure_not_read, shell_path};
use super::render::AdapterChoice;
use super::selection::Selection;
use super::settled;
use crate::assignment::Assignment;
use crate::class::{Attempt, Collected, Decisions, Kind, Label, Pins, Stated, Wanted, collect};
use crate::columns::count;
use crate::files::write_whole;
use crate::grading::{Begun, Folders, Grading, Mode, Record, RecordCache, StoredRecord, Workshop};
use crate::held_back::{in_words, recorded_seed};
use crate::program::graded;
use crate::report::{self, BatchReport, SubmissionReport};
use crate::rubric;
use crate::sandbox::Isolation;

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
    pub perturb: Option<Perturb>,
    /// How much time each has in all.
    pub budget: BudgetChoice,
    /// The parts and scenes to ask about; `None` for all.
    pub selection: Option<&'a Selection>,
    /// Whose submissions alone are graded, unless it is empty.
    pub only: &'a [String],
    /// Which share of them alone is graded, without a report.
    pub slice: Option<Slice>,
    /// Where they come from; recognized where it is not said.
    pub from: Option<Kind>,
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
            perturb: None,
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
    pub fn run(&self, root: Option<&Path>) -> anyhow::Result<BatchOutcome> {
        for path in &self.paths {
            ensure!(path.exists(), "{} does not exist", path.display());
        }
        let mut context = Context::new(root)?;
        // What a zip of many holds, until the end of the batch.
        let scratch = tempfile::tempdir_in(&context.supervisor.scratch)?;
        let mut collected = match self.mode {
            Mode::Grade => {
                let wanted = Wanted {
                    tree: &context.assignment.tree,
                    limits: &context.assignment.limits.archive,
                    from: self.from,
                    output: Some(self.output),
                    scratch: scratch.path(),
                };
                collect(&self.paths, &wanted)?
            }
            Mode::Check => {
                let given = |path: &PathBuf| crate::class::Source::given(path);
                let sources = self.paths.iter().map(given).collect();
                Collected { sources, ..Collected::default() }
            }
        };
        // What an earlier run wrote beside the submissions is none.
        let sources = std::mem::take(&mut collected.sources);
        let is_own = |source: &crate::class::Source| export::is_export(&source.path, self.output);
        let (own, sources): (Vec<_>, Vec<_>) = sources.into_iter().partition(is_own);
        collected.sources = sources;
        let own =
            own.into_iter().map(|source| format!("{} (an export of this report)", source.name));
        collected.skipped.extend(own);
        if !self.is_own {
            // Before anything is written, pins included.
            for source in
                class::sources(self.mode, &collected.sources, self.output, &HashMap::new())
            {
                ensure_apart(self.output, &source.path, &source.slug, &context.assignment.tree)?;
            }
        }
        if let Some(list) = self.list {
            // The files of a report, and the class list that it keeps of an earlier run.
            let written = [report::HTML_FILE, report::JSON_FILE, report::CSV_FILE];
            for name in written {
                ensure_not_read(&self.output.join(name), [list])?;
            }
        }
        super::writable(self.output)?;
        if self.mode == Mode::Grade && context.reference().is_none() {
            return Err(MachineLacks(
                "this is a student's kit: it holds neither the reference renderer nor held-back scenes, which \
                 `umbra grade` needs; hint: `umbra check DIR` judges your work on the public scenes. \
                 Instructors: cargo build --release --workspace"
                    .into(),
            )
            .into());
        }
        let isolation = context.supervisor.isolation.isolation();
        if self.isolation == IsolationChoice::Full && isolation != Isolation::Full {
            return Err(MachineLacks(format!(
                "full isolation is not available here ({isolation}), so no submission is run; hint: `umbra doctor` \
                 says what to do, `--isolation reduced` grades without it"
            ))
            .into());
        }
        if let Some(selection) = self.selection {
            selection.restrict(&mut context.assignment)?;
        }
        let instructor = self.output.join(report::INSTRUCTOR);
        let mut pins = match self.mode {
            Mode::Grade => Some(self.pin(&mut context.assignment, root)?),
            Mode::Check => None,
        };
        let context = &context;
        let seed = self.seed(&instructor.join(SEED_FILE))?;
        let earlier = match self.mode {
            Mode::Grade => Found::read(self.output)?.unwrap_or_default(),
            Mode::Check => Found::default(),
        };
        let all = class::sources(self.mode, &collected.sources, self.output, &earlier.names());
        if !collected.copies.is_empty() {
            eprintln!(
                "umbra: {} in more than one download with the same content, graded once: {}",
                count(collected.copies.len(), "submission"),
                class::some(&collected.copies)
            );
        }
        let names = earlier.names();
        for source in all.iter().filter(|source| source.moved.is_some()) {
            let last = |name: &str| name.rsplit('/').next().unwrap_or_default().to_owned();
            let before = names.get(&source.slug).map(|name| last(name));
            if let Some(before) = before.filter(|own| *own != last(&source.name)) {
                eprintln!(
                    "umbra: {} is {before} under another name: it holds the same",
                    source.name
                );
            }
        }
        let mut telling = Telling::default();
        if let Some((pins, decided)) = &pins {
            let matches = decided.matches(self.output)?;
            let roster = class::roster(self.list, self.output)?;
            if let Some(roster) = &roster {
                matches.check_list(roster)?;
            }
            if let (Some(list), Some(roster)) = (self.list, &roster) {
                eprintln!("umbra: {}", roster.reading());
                if self.slice.is_some() {
                    same_list(list, self.output)?;
                }
                class::keep_roster(list, self.output)?;
            }
            if let Some(pin) = pins.current() {
                settled::remember_times(self.output, &pin.decided)?;
            }
            telling = Telling { roster, matches };
        }
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
        let result = context.with_store(|store| {
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
                grading.keep_frames();
            }
            if self.budget == BudgetChoice::None {
                grading.budget = None;
            }
            grading.paths =
                self.selection.map_or(grading.paths, |selection| selection.paths(context));
            grading.asked =
                self.selection.map_or(Vec::new(), |selection| selection.checks(context));
            grading.realtime_first = self.realtime_first;
            grading.compares_submitted = self.selection.is_none_or(Selection::is_all);
            let jobs = self.jobs.min(chosen.len()).max(1);
            grading.threads = (cores() / jobs as u32).max(1);
            let records = match (begun, &chosen[..]) {
                (Some(begun), [source]) => {
                    vec![begun.and_then(|begun| self.go_on(context, &grading, source, begun))]
                }
                _ => {
                    let (all, gone) = self.grade_all(context, &grading, &chosen, jobs);
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
            Ok::<_, anyhow::Error>((records, grading.held_back, grading.cache))
        });
        context.progress.end();
        if INTERRUPTED.load(Ordering::Relaxed) {
            let goes_on = match (self.mode, &result) {
                (Mode::Grade, Ok((records, ..))) => format!(
                    ", {} of {} submissions are graded; the same command resumes there",
                    records.len(),
                    chosen.len()
                ),
                _ => String::new(),
            };
            eprintln!("umbra: interrupted{goes_on}");
            return Ok(BatchOutcome::Interrupted);
        }
        let (records, held_back, cache) = result?;
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
                    Found::supersede(self.output, &conditions)?;
                }
                report
            }
            _ => {
                let rules = &context.assignment.rules;
                let entry = |record| {
                    let mut entry = graded(record, rules);
                    if let Some(selection) = self.selection {
                        selection.only_of(&mut entry.grade, rules, &entry.record.evidence);
                    }
                    entry
                };
                // One alone is no batch: nobody else can have submitted the same.
                let entries = records.into_iter().map(|own| entry(own.record)).collect();
                let report = BatchReport::new(&context.assignment, held_back, entries);
                report::write(self.output, &report)?;
                report
            }
        };
        if self.timings {
            print_timings(&report);
        }
        Ok(BatchOutcome::Report(Box::new(report), collected))
    }

    /// What is known of the batch before anything is graded.
    fn found(&self, collected: &Collected, all: &[Source], aside: &HashSet<String>) -> Found {
        let mut found = Found::new(collected, all, |source| aside.contains(&source.slug));
        let list = self.list.and_then(Path::file_name);
        found.list = list.unwrap_or_default().to_string_lossy().into_owned();
        let whole = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
        found.paths = self.paths.iter().map(whole).collect();
        found
    }

    /// What the report is settled by: what is pinned there, which takes the place of what `config.json` says by now,
    /// with the instructor's decisions as they are now.
    fn pin(
        &self,
        assignment: &mut Assignment,
        root: Option<&Path>,
    ) -> anyhow::Result<(Pins, Decisions)> {
        let stated = Stated::from(&*assignment);
        let attempt = self.attempt.unwrap_or_default();
        let mut decided = Decisions::read(self.output, stated, attempt)?;
        let first =
            Decisions { matches: String::new(), overrides: String::new(), ..decided.clone() };
        let pins = Pins::begin(&self.output.join(report::INSTRUCTOR), &first)?;
        if let Some(pin) = pins.current() {
            let pinned = &pin.decided.assignment;
            let differs = decided.assignment.differs(pinned);
            if !differs.is_empty() {
                eprintln!(
                    "umbra: config.json has other {} than this report, which keeps what it was settled by on {} for \
                     all submissions; `umbra regrade --report {}{}` shows what would change",
                    differs.join(", "),
                    pin.when,
                    shell_path(self.output),
                    at_root(root)
                );
                assignment.pin(pinned);
                decided.assignment = pinned.clone();
            }
            let attempt = pin.decided.attempt;
            ensure!(
                self.slice.is_none() || self.attempt.is_none_or(|own| own == attempt),
                "--attempt: all tasks of a partition choose the same one, which the first of them pinned"
            );
            ensure!(
                self.only.is_empty() || self.attempt.is_none_or(|own| own == attempt),
                "--attempt: it is the whole class's, and with --only the others keep their grades; hint: leave out one of \
                 the two"
            );
            if let Some(own) = self.attempt.filter(|own| *own != attempt) {
                eprintln!(
                    "umbra: --attempt {own} instead of {attempt}, for the whole class from now on"
                );
            }
            decided.attempt = self.attempt.unwrap_or(attempt);
        }
        decided.check(self.output)?;
        Ok((pins, decided))
    }

    /// The seed of the held-back scenes, if there are any: the one that the report has, in `file`.
    fn seed(&self, file: &Path) -> anyhow::Result<Option<u64>> {
        let chosen = self.perturb.map(|Perturb(seed)| seed);
        let seed = match (self.mode, chosen) {
            (Mode::Check, Some(seed)) => return Ok(seed),
            _ => recorded_seed(file, chosen)?,
        };
        // Before they are merged, tasks of a partition are compared with each other.
        let is_merged = self.slice.is_none() || Found::read(self.output)?.is_some();
        ensure!(
            chosen.is_none_or(|own| own == seed || !is_merged),
            "--perturb: {} is graded with {}, and all submissions of a report share their held-back scenes; hint: \
             another --report, or delete {} and grade all of them again",
            self.output.display(),
            in_words(seed),
            file.display()
        );
        Ok(chosen.unwrap_or(seed))
    }

    /// The slugs of attempts that need not be graded: another one of the same student counts.
    fn set_aside(&self, all: &[Source], decided: &Decisions) -> anyhow::Result<HashSet<String>> {
        let matches = decided.matches(self.output)?;
        let told = |source: &Source| !matches.mention(&source.claim());
        let labels: Vec<Option<&Label>> =
            all.iter().map(|source| source.label.as_ref().filter(|_| told(source))).collect();
        let (policy, due) = (&decided.assignment.late, &decided.assignment.due);
        let aside = crate::class::set_aside(&labels, decided.attempt, |stamp| {
            let late = policy.as_ref().and_then(|policy| policy.judge(due, stamp, |_| false));
            late.is_some_and(|late| late.late_s > 0)
        });
        Ok(aside.into_iter().map(|at| all[at].slug.clone()).collect())
    }

    /// The folders of a submission in the report.
    fn folders(&self, slug: &str) -> Folders {
        Folders {
            student: self.output.join(slug),
            instructor: self.output.join(report::INSTRUCTOR).join(slug),
        }
    }

    /// Receives and builds what a student checks.
    fn begin(
        &self,
        context: &Context,
        workshop: &Workshop,
        source: &Source,
    ) -> anyhow::Result<Begun> {
        let say = |stage: &str| context.say(stage);
        let begin = || {
            let mut begun = workshop.receive(&source.path, &source.slug, self.mode, &say)?;
            workshop.build(&mut begun, &say)?;
            self.keeps_plugin.map_or(Ok(()), |file| begun.keep_plugin(file))?;
            anyhow::Ok(begun)
        };
        begin().with_context(|| source.path.display().to_string())
    }

    /// Judges what was begun so.
    fn go_on(
        &self,
        context: &Context,
        grading: &Grading,
        source: &Source,
        begun: Begun,
    ) -> anyhow::Result<StoredRecord> {
        let Source { path, name, slug, .. } = source;
        let record = grading.judge(begun, &self.folders(slug), &|stage| context.say(stage));
        let record = record.with_context(|| path.display().to_string())?;
        Ok(StoredRecord::held(Record { name: name.clone(), ..record }))
    }

    /// Takes submissions through all stages, in their order; none is begun after Ctrl-C. One that the machine
    /// failed on has a record that says so: the others' are no worse for it. One that is not there any more has none,
    /// and a line among those that come second.
    fn grade_all(
        &self,
        context: &Context,
        grading: &Grading,
        sources: &[&Source],
        jobs: usize,
    ) -> (Vec<StoredRecord>, Vec<String>) {
        let next = AtomicUsize::new(0);
        let results = Mutex::new(Vec::new());
        let gone = Mutex::new(Vec::new());
        context.progress.count(sources.len());
        let work = || {
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(source) = sources.get(index) else { return };
                let Source { path, name, slug, .. } = source;
                let say = |stage: &str| context.progress.at(&format!("{slug}: {stage}"));
                let out = self.folders(slug);
                let begun = Instant::now();
                let older = source.moved.as_ref().and_then(|_| RecordCache::text(&out.instructor));
                let result = class::note_source(&out, source)
                    .and_then(|()| grading.one_of_batch(path, slug, &out, &say));
                if INTERRUPTED.load(Ordering::Relaxed) && result.is_err() {
                    return;
                }
                if result.is_err() && path.symlink_metadata().is_err() {
                    // An earlier grade stays.
                    let why = format!("{name}: {} is not there any more", path.display());
                    context.progress.note(&why);
                    gone.lock().map(|mut gone| gone.push(why)).unwrap_or_default();
                    continue;
                }
                let result = result.unwrap_or_else(|error| {
                    let message = format!("{}: {}", path.display(), super::told_once(&error));
                    context.progress.note(&message);
                    grading.unjudged(path, slug)
                });
                let record = Record { name: name.clone(), ..result };
                let mut is_kept = false;
                if let (Some(older), Some(from)) = (older, &source.moved) {
                    match RecordCache::keep_replaced(&out.instructor, &older, &record) {
                        Ok(false) => {}
                        Ok(true) => context.progress.note(&format!(
                            "{} of {} is graded again: it replaces the one that was {from}",
                            record.name,
                            class::who(&record.student)
                        )),
                        Err(error) => context.progress.note(&super::told_once(&error)),
                    }
                }
                if let Some(cache) = &grading.cache {
                    match cache.list(&record, &out) {
                        Ok(()) => is_kept = true,
                        Err(error) => context.progress.note(&super::told_once(&error)),
                    }
                    let grade = rubric::grade(&context.assignment.rules, &record.evidence);
                    let cost = if cache.was_found(slug) {
                        "unchanged".to_owned()
                    } else {
                        format!("{:.1} s", begun.elapsed().as_secs_f64())
                    };
                    context
                        .progress
                        .step(&format!("{}, {cost}", report::in_a_line(&record, &grade)));
                }
                let result = match is_kept {
                    true => StoredRecord::kept(record, true, &out.instructor),
                    false => StoredRecord::held(record),
                };
                let Ok(mut results) = results.lock() else { return };
                results.push((index, result));
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..jobs {
                scope.spawn(work);
            }
        });
        let mut results = results.into_inner().unwrap_or_default();
        results.sort_by_key(|(index, _)| *index);
        let records = results.into_iter().map(|(_, result)| result).collect();
        (records, gone.into_inner().unwrap_or_default())
    }
}

/// Makes sure that a task of a partition uses the class list that other tasks at work use.
fn same_list(list: &Path, output: &Path) -> anyhow::Result<()> {
    let read = |path: &Path| {
        std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
    };
    let kept = class::kept_list(output);
    ensure!(
        Found::begun(output)?.is_empty() || !kept.is_file() || read(list)? == read(&kept)?,
        "--class: {} differs from {}, which the other tasks use; all tasks of a partition use the same list",
        list.display(),
        kept.display()
    );
    Ok(())
}

/// Makes sure that a task of a partition uses the seed of one of the tasks that graded something, if any did.
fn same_seed(seed: Option<u64>, output: &Path) -> anyhow::Result<()> {
    let begun = Found::begun(output)?;
    let seed_of = |found: &Found| found.held_back.as_ref().map(|held_back| held_back.seed);
    if begun.iter().any(|(_, found)| seed_of(found) == seed) {
        return Ok(());
    }
    let instructor = output.join(report::INSTRUCTOR);
    let graded = |(_, found): &&(PathBuf, Found)| {
        let made = |slug: &String| RecordCache::conditions_of(&instructor.join(slug));
        class::folders(output).iter().filter_map(made).any(|made| made == found.conditions)
    };
    let Some((file, found)) = begun.iter().find(graded) else { return Ok(()) };
    let other = in_words(seed_of(found));
    bail!(
        "--perturb: this task would use {}, another one used {other}: all tasks of a partition use the same seed; hint: \
         --perturb {other}, or delete {} and run its task again",
        in_words(seed),
        file.display()
    );
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
