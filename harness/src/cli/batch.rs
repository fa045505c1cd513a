//! Submissions through all stages, and their report: what `umbra check` and `umbra grade` share.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::{Context as _, ensure};

use super::MachineLacks;
use super::check::Asked;
use super::class::{self, Source};
use super::context::{Context, INTERRUPTED, cores};
use super::grade::{BudgetChoice, IsolationChoice, Perturb};
use super::render::AdapterChoice;
use crate::class::overrides::{Applied, OVERRIDES, Overrides, Subject};
use crate::class::{
    Attempt, Claim, Class, Collected, Deciding, Kind, Label, Wanted, collect, settle,
};
use crate::files::write_whole;
use crate::grading::{Folders, Grading, Mode, Record, RecordCache, judge_shared};
use crate::held_back::recorded_seed;
use crate::program::graded;
use crate::report::{self, BatchReport, SubmissionReport};
use crate::rubric::{self, Grade};
use crate::sandbox::Isolation;

/// The file with the seed of a batch's held-back scenes, in the instructor's folder.
const SEED_FILE: &str = "held-back-seed.txt";

/// The file with what the reference renderer took on this machine, where a slow submission needed it.
const COSTS_FILE: &str = "reference-costs.json";

/// What a grade says of a submission that was judged in another way than the others of its class.
const OTHER_CONDITIONS: &str = "graded before with other scenes, limits or another version of Umbra: \
                                not comparable, grade it again";

/// Submissions to be taken through all stages.
pub struct Batch<'a> {
    /// Where they lie, or folders that hold them.
    pub paths: Vec<PathBuf>,
    /// The report's folder.
    pub output: &'a Path,
    /// What draws.
    pub adapter: AdapterChoice,
    /// So many at the same time.
    pub jobs: usize,
    /// What for.
    pub mode: Mode,
    /// What must isolate them.
    pub isolation: IsolationChoice,
    /// Nothing for the seed that is recorded with the batch.
    pub perturb: Option<Perturb>,
    /// How much time each has in all.
    pub budget: BudgetChoice,
    /// What of the assignment is asked; nothing for all of it.
    pub asked: Option<&'a Asked>,
    /// Whose submissions alone are graded, unless it is empty.
    pub only: &'a [String],
    /// Where they come from; recognised where it is not said.
    pub from: Option<Kind>,
    /// The class list; that of an earlier run where none is named.
    pub list: Option<&'a Path>,
    /// Which attempt of a student counts.
    pub attempt: Attempt,
    /// Whether what was found out before is found out anew.
    pub force: bool,
    /// Whether to print what each stage cost.
    pub timings: bool,
}

impl Batch<'_> {
    /// Grades all and writes the reports; nothing when Ctrl-C came in between. Answers what was found, too.
    pub fn run(&self, root: Option<&Path>) -> anyhow::Result<Option<(BatchReport, Collected)>> {
        for path in &self.paths {
            ensure!(path.exists(), "{} does not exist", path.display());
        }
        let mut context = Context::new(root)?;
        // What a zip of many holds, until the end of the batch.
        let scratch = tempfile::tempdir_in(&context.supervisor.scratch)?;
        let collected = match self.mode {
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
        super::writable(self.output)?;
        if self.mode == Mode::Grade && context.reference().is_none() {
            return Err(MachineLacks(
                "grades are made with the reference renderer and with scenes that are held back, which \
                 are not here: a student's kit has neither; hint: `umbra check DIR` judges your work \
                 on the public scenes, as the grader does (instructors: cargo build --release --workspace)"
                    .into(),
            )
            .into());
        }
        let isolation = context.supervisor.isolation.isolation();
        if self.isolation == IsolationChoice::Full && isolation != Isolation::Full {
            return Err(MachineLacks(format!(
                "submissions are not run here, isolation would be {isolation}; hint: `umbra doctor` says \
                 what to do, `--isolation reduced` grades all the same"
            ))
            .into());
        }
        if let Some(asked) = self.asked {
            asked.restrict(&mut context.assignment)?;
        }
        let context = &context;
        let seed = match self.perturb {
            Some(Perturb(seed)) => seed,
            None => Some(recorded_seed(&self.output.join(report::INSTRUCTOR).join(SEED_FILE))?),
        };
        let all = class::sources(&collected.sources, self.output);
        let (roster, matches) = match self.mode {
            Mode::Grade => (class::roster(self.list, self.output)?, class::matches(self.output)?),
            Mode::Check => Default::default(),
        };
        let deciding = Deciding {
            roster: roster.as_ref(),
            matches: &matches,
            policy: context.assignment.late.as_ref(),
            due: &context.assignment.due,
            attempt: self.attempt,
        };
        let told = |source: &Source| !matches.mention(&source.claim());
        let labels: Vec<Option<&Label>> =
            all.iter().map(|source| source.label.as_ref().filter(|_| told(source))).collect();
        let aside: HashSet<String> = crate::class::set_aside(&labels, &deciding)
            .into_iter()
            .map(|at| all[at].slug.clone())
            .collect();
        let mut chosen = class::only(context, self.output, &all, self.only)?;
        chosen.retain(|source| !aside.contains(&source.slug));
        let result = context.with_store(|store| {
            let adapter = self.adapter.adapter();
            let mut grading = Grading::prepare(store, adapter, seed, &INTERRUPTED)?;
            if self.mode == Mode::Grade {
                grading.cache = Some(RecordCache::of(&grading, self.force)?);
            }
            if self.budget == BudgetChoice::None {
                grading.budget = None;
            }
            grading.paths = self.asked.map_or(grading.paths, |asked| asked.paths(context));
            grading.compares_submitted = self.asked.is_none_or(Asked::is_all);
            let jobs = self.jobs.min(chosen.len()).max(1);
            grading.threads = (cores() / jobs as u32).max(1);
            let results = self.grade_all(context, &grading, &chosen, jobs);
            let costs = grading.costs_of_reference();
            if self.mode == Mode::Grade && !costs.is_empty() {
                let file = self.output.join(report::INSTRUCTOR).join(COSTS_FILE);
                write_whole(&file, &serde_json::to_vec_pretty(&costs)?)
                    .with_context(|| format!("cannot write {}", file.display()))?;
            }
            Ok::<_, anyhow::Error>((results, grading.held_back, grading.cache))
        });
        context.progress.end();
        if INTERRUPTED.load(Ordering::Relaxed) {
            let goes_on = match (self.mode, &result) {
                (Mode::Grade, Ok((results, ..))) => format!(
                    ", {} of {} submissions are graded; the same command resumes there",
                    results.len(),
                    chosen.len()
                ),
                _ => String::new(),
            };
            eprintln!("umbra: interrupted{goes_on}");
            return Ok(None);
        }
        let (results, held_back, cache) = result?;
        let mut records = results.into_iter().collect::<anyhow::Result<Vec<Record>>>()?;
        let mut incomparable = Vec::new();
        if let Some(cache) = cache {
            if cache.found() > 0 {
                eprintln!(
                    "umbra: {} of {} submissions keep their earlier grades",
                    cache.found(),
                    chosen.len()
                );
            }
            incomparable = class::join(&cache, self.output, &all, &aside, &mut records);
        }
        // In an order that does not hang on who was graded when.
        records.sort_by_key(|record| record.slug.to_lowercase());
        judge_shared(&mut records);
        let rules = &context.assignment.rules;
        let mut entries = Vec::new();
        for record in records {
            let mut entry = graded(record, rules);
            if let Some(asked) = self.asked {
                asked.only_of(&mut entry.grade);
            }
            if incomparable.contains(&entry.record.slug) {
                entry.grade.remarks.push(OTHER_CONDITIONS.to_owned());
            }
            entries.push(entry);
        }
        let class = match self.mode {
            Mode::Grade => Some(self.settle(&mut entries, &collected, &aside, &all, &deciding)?),
            Mode::Check => None,
        };
        let report =
            BatchReport { class, ..BatchReport::new(&context.assignment, held_back, entries) };
        report::write(self.output, &report)?;
        if self.timings {
            print_timings(&report);
        }
        Ok(Some((report, collected)))
    }

    /// Settles whose the graded submissions are and which of them count; the others leave `entries`.
    fn settle(
        &self,
        entries: &mut Vec<SubmissionReport>,
        collected: &Collected,
        aside: &HashSet<String>,
        all: &[Source],
        deciding: &Deciding,
    ) -> anyhow::Result<Class> {
        let claims: Vec<Claim> =
            entries.iter().map(|entry| class::claim(self.output, &entry.record)).collect();
        let mut grades: Vec<Grade> = entries.iter().map(|entry| entry.grade.clone()).collect();
        let overrides = Overrides::read(&self.output.join(OVERRIDES))?;
        let subjects: Vec<Subject> = entries
            .iter()
            .zip(&claims)
            .map(|(SubmissionReport { record, .. }, claim)| Subject {
                slug: &record.slug,
                numbers: super::decide::numbers(claim, deciding.roster, deciding.matches),
                digest: &record.digest,
                evidence: &record.evidence,
            })
            .collect();
        let decisions: Vec<Vec<Applied>> = subjects
            .iter()
            .zip(&mut grades)
            .map(|(subject, grade)| overrides.apply(subject, grade))
            .collect();
        let parts = grades.first().map(|grade| grade.parts.iter().map(|part| part.id.clone()));
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        let unused = overrides.unused(&subjects, &parts);
        let mut absent: Vec<(Label, String)> =
            collected.empty.iter().map(|empty| (empty.label.clone(), empty.reason())).collect();
        let is_graded = |source: &Source| claims.iter().any(|claim| claim.slug == source.slug);
        let open = all.iter().filter(|source| !is_graded(source) && !aside.contains(&source.slug));
        absent.extend(open.filter_map(|s| Some((s.label.clone()?, "not graded yet".to_owned()))));
        let (standings, mut class) =
            settle(&claims, &mut grades, &absent, collected.kind, deciding)?;
        class.unused = unused;
        class::ask(&class, self.output)?;
        let mut counting = Vec::new();
        for (at, mut standing) in standings {
            // Attempts that were not graded are told, too.
            let own = standing.label.as_ref().map(Label::person);
            let others = all.iter().filter(|source| aside.contains(&source.slug));
            let others = others.filter(|source| source.label.as_ref().map(Label::person) == own);
            let others = others.map(|source| source.name.clone());
            let known: Vec<String> =
                others.filter(|name| !standing.set_aside.contains(name)).collect();
            standing.set_aside.extend(known);
            let stale = decisions[at].iter().filter(|own| own.stale);
            class.stale.extend(stale.map(|own| format!("{}: {}", claims[at].name, own.words())));
            standing.decisions.clone_from(&decisions[at]);
            let grade = grades[at].clone();
            counting.push(SubmissionReport { record: entries[at].record.clone(), grade, standing });
        }
        *entries = counting;
        Ok(class)
    }

    /// Takes submissions through all stages, in their order; none is begun after Ctrl-C. To be graded, one
    /// that the machine failed on has a record that says so: the others' are no worse for it.
    fn grade_all(
        &self,
        context: &Context,
        grading: &Grading,
        sources: &[&Source],
        jobs: usize,
    ) -> Vec<anyhow::Result<Record>> {
        let next = AtomicUsize::new(0);
        let results = Mutex::new(Vec::new());
        let batch = self.mode == Mode::Grade;
        if batch {
            context.progress.count(sources.len());
        }
        let work = || {
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(source) = sources.get(index) else { return };
                let Source { path, name, slug, .. } = source;
                let say = |stage: &str| {
                    if batch {
                        context.progress.at(&format!("{slug}: {stage}"));
                    } else {
                        context.say(stage);
                    }
                };
                let out = Folders {
                    student: self.output.join(slug),
                    instructor: self.output.join(report::INSTRUCTOR).join(slug),
                };
                let begun = Instant::now();
                let result = match self.mode {
                    Mode::Grade => class::note_source(&out, source)
                        .and_then(|()| grading.one_of_batch(path, slug, &out, &say)),
                    Mode::Check => grading.submission(path, slug, &out, self.mode, &say),
                };
                if INTERRUPTED.load(Ordering::Relaxed) && result.is_err() {
                    return;
                }
                let result = match (result, self.mode) {
                    (Err(error), Mode::Grade) => {
                        let message = format!("{}: {}", path.display(), super::told_once(&error));
                        context.progress.note(&message);
                        Ok(grading.unjudged(path, slug))
                    }
                    (result, _) => result.with_context(|| path.display().to_string()),
                };
                let result = result.map(|record| Record { name: name.clone(), ..record });
                if let (Ok(record), Some(cache)) = (&result, &grading.cache) {
                    if let Err(error) = cache.list(record, &out) {
                        context.progress.note(&super::told_once(&error));
                    }
                    let grade = rubric::grade(&context.assignment.rules, &record.evidence);
                    let cost = if cache.was_found(slug) {
                        "unchanged".to_owned()
                    } else {
                        format!("{:.1} s", begun.elapsed().as_secs_f64())
                    };
                    context
                        .progress
                        .step(&format!("{}, {cost}", report::in_a_line(record, &grade)));
                }
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
        results.into_iter().map(|(_, result)| result).collect()
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
