//! `umbra check` and `umbra grade`: hand-ins through all stages, and their reports.

use std::collections::HashSet;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context as _, ensure};

use super::MachineLacks;
use super::collect::{Collected, Source, collect};
use super::context::{Context, INTERRUPTED, cores};
use super::render::AdapterChoice;
use crate::evidence::Verdict;
use crate::files::write_whole;
use crate::grading::{Folders, Grading, INTERNAL_ERROR, Kept, Purpose, Record, judge_shared};
use crate::held_back::recorded_seed;
use crate::report::{self, Entry, Sheet};
use crate::rubric;
use crate::sandbox::Isolation;

/// The file with the seed of a batch's held-back scenes, in the instructor's folder.
const SEED_FILE: &str = "held-back-seed.txt";

/// The file with what the reference renderer took on this machine, where a slow submission needed it.
const COSTS_FILE: &str = "reference-costs.json";

/// What `umbra check` is told.
#[derive(clap::Args)]
pub struct CheckArguments {
    /// Your working folder (config.json, src/, offline/, realtime/) or an archive
    hand_in: PathBuf,
    /// Where to write the report with its pictures
    #[arg(long, short, value_name = "DIR", default_value = "umbra-report")]
    output: PathBuf,
    /// Which adapter draws realtime scenes
    #[arg(long, value_enum, default_value_t = AdapterChoice::Auto)]
    adapter: AdapterChoice,
    /// Print what each stage cost
    #[arg(long)]
    timings: bool,
}

/// What `umbra grade` is told.
#[derive(clap::Args)]
pub struct GradeArguments {
    /// Archives, submission folders, or folders that hold them at any depth, as a learning platform lays them out
    #[arg(required = true)]
    hand_ins: Vec<PathBuf>,
    /// Where to write report.html, report.json, grades.csv and each hand-in's own report. What was found
    /// out about a hand-in is kept there too: the same command goes on where it was ended, and takes
    /// up what is new or has changed
    #[arg(long, short, value_name = "DIR", default_value = "umbra-report")]
    output: PathBuf,
    /// Which adapter draws realtime scenes; software gives every machine the same pixels
    #[arg(long, value_enum, default_value_t = AdapterChoice::Software)]
    adapter: AdapterChoice,
    /// Hand-ins that are graded at the same time [default: one for each core]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// What must isolate hand-ins: full refuses a machine that cannot, reduced takes what there is
    /// and says so in the report (see `umbra doctor`)
    #[arg(long, value_enum, default_value_t = IsolationChoice::Full)]
    isolation: IsolationChoice,
    /// Seed of the held-back scenes, to reproduce a batch; off grades on the public scenes alone
    /// [default: the batch's secret one, made when there is none in --output]
    #[arg(long, value_name = "SEED|off", overrides_with = "perturb")]
    perturb: Option<Perturb>,
    /// The time that each submission has in all: as config.json says (ten times the reference renderer's
    /// CPU time), or none, which grades fully what used it up before
    #[arg(long, value_enum, default_value_t = BudgetChoice::Config)]
    budget: BudgetChoice,
    /// Print what each stage cost
    #[arg(long)]
    timings: bool,
}

/// How much time a submission has in all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BudgetChoice {
    /// As config.json says
    Config,
    /// As much as it takes
    None,
}

/// A seed of held-back scenes, or none of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Perturb(Option<u64>);

impl FromStr for Perturb {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "off" {
            return Ok(Self(None));
        }
        let seed = text.parse().map_err(|_| {
            format!("expected off or a whole number from 0 to {}, found {text}", u64::MAX)
        })?;
        Ok(Self(Some(seed)))
    }
}

/// How much isolation is demanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum IsolationChoice {
    /// Every layer
    Full,
    /// What this machine has
    Reduced,
}

/// Checks one working folder and prints everything about it; exit 1 when points are missing.
pub fn check(arguments: &CheckArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let batch = Batch {
        paths: vec![arguments.hand_in.clone()],
        output: &arguments.output,
        adapter: arguments.adapter,
        jobs: 1,
        purpose: Purpose::Check,
        isolation: IsolationChoice::Reduced,
        perturb: Some(Perturb(None)),
        budget: BudgetChoice::Config,
        timings: arguments.timings,
    };
    let Some((sheet, _)) = batch.run(root)? else { return Ok(super::EXIT_INTERRUPTED) };
    let (width, colours) = terminal();
    let entry = &sheet.entries[0].for_student(&sheet.rules);
    print!("{}", report::text_detail(&sheet, entry, width, colours));
    println!(
        "report: {}",
        arguments.output.join(&entry.record.slug).join(report::HTML_FILE).display()
    );
    let whole = entry.grade.points >= entry.grade.out_of;
    Ok(if whole { super::EXIT_OK } else { super::EXIT_NOT_IN_ORDER })
}

/// Grades hand-ins and prints the table; exit 0 when all could be graded, whatever their points.
pub fn grade(arguments: &GradeArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let batch = Batch {
        paths: arguments.hand_ins.clone(),
        output: &arguments.output,
        adapter: arguments.adapter,
        jobs: arguments.jobs.unwrap_or(cores() as usize).max(1),
        purpose: Purpose::Grade,
        isolation: arguments.isolation,
        perturb: arguments.perturb,
        budget: arguments.budget,
        timings: arguments.timings,
    };
    let Some((sheet, skipped)) = batch.run(root)? else { return Ok(super::EXIT_INTERRUPTED) };
    let (width, colours) = terminal();
    print!("{}", report::text_table(&sheet, width, colours)?);
    if let Some(skipped) = skipped {
        println!("skipped, no submissions: {skipped}");
    }
    println!("report: {}", arguments.output.join(report::HTML_FILE).display());
    if let Some(held_back) = &sheet.held_back {
        println!("held-back seed {0}; --perturb {0} reproduces", held_back.seed);
    }
    Ok(exit_code(&sheet))
}

/// What a batch ends with: a bug of ours counts more than what the machine lacks.
fn exit_code(sheet: &Sheet) -> u8 {
    let mut checks = sheet.entries.iter().flat_map(|entry| &entry.record.evidence.checks);
    if checks.any(|check| check.id == INTERNAL_ERROR && check.verdict == Verdict::Fail) {
        return super::EXIT_BUG;
    }
    let ungraded = sheet.entries.iter().any(|entry| entry.grade.points < entry.grade.points_max);
    if ungraded { super::EXIT_MACHINE } else { super::EXIT_OK }
}

/// The width of the terminal in columns, and whether it takes colours.
fn terminal() -> (usize, bool) {
    let stdout = std::io::stdout();
    let colours = stdout.is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let width = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
    (width.unwrap_or(if colours { 110 } else { 160 }), colours)
}

/// Folder names for hand-ins: what their names allow, made unique.
fn slugs(sources: &[Source]) -> Vec<String> {
    let mut taken = HashSet::from([report::INSTRUCTOR.to_owned()]);
    let slug = |Source { name, .. }: &Source| {
        let safe = |c: char| if c.is_ascii_alphanumeric() || "-_".contains(c) { c } else { '-' };
        let stem = name.trim_end_matches(".gz").trim_end_matches(".tar").trim_end_matches(".zip");
        let stem: String = stem.chars().map(safe).take(80).collect();
        let stem = if stem.trim_matches('-').is_empty() { "hand-in".to_owned() } else { stem };
        let mut slug = stem.clone();
        let mut number = 2;
        while !taken.insert(slug.to_lowercase()) {
            slug = format!("{stem}-{number}");
            number += 1;
        }
        slug
    };
    sources.iter().map(slug).collect()
}

/// Hand-ins to be taken through all stages.
struct Batch<'a> {
    paths: Vec<PathBuf>,
    output: &'a Path,
    adapter: AdapterChoice,
    jobs: usize,
    purpose: Purpose,
    isolation: IsolationChoice,
    /// Nothing for the seed that is recorded with the batch.
    perturb: Option<Perturb>,
    budget: BudgetChoice,
    timings: bool,
}

impl Batch<'_> {
    /// Grades all and writes the reports; nothing when Ctrl-C came in between. Answers what was skipped, too.
    fn run(&self, root: Option<&Path>) -> anyhow::Result<Option<(Sheet, Option<String>)>> {
        for path in &self.paths {
            ensure!(path.exists(), "{} does not exist", path.display());
        }
        let context = Context::new(root)?;
        let collected = match self.purpose {
            Purpose::Grade => collect(&self.paths, self.output, &context.assignment.tree)?,
            Purpose::Check => {
                let sources = self.paths.iter().map(|path| Source::given(path)).collect();
                Collected { sources, ..Collected::default() }
            }
        };
        let sources = &collected.sources;
        super::writable(self.output)?;
        if self.purpose == Purpose::Grade && context.reference().is_none() {
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
                "hand-ins are not run here, isolation would be {isolation}; hint: `umbra doctor` says \
                 what to do, `--isolation reduced` grades all the same"
            ))
            .into());
        }
        let seed = match self.perturb {
            Some(Perturb(seed)) => seed,
            None => Some(recorded_seed(&self.output.join(report::INSTRUCTOR).join(SEED_FILE))?),
        };
        let result = context.with_store(|store| {
            let adapter = self.adapter.adapter();
            let mut grading = Grading::prepare(store, adapter, seed, &INTERRUPTED)?;
            if self.purpose == Purpose::Grade {
                grading.kept = Some(Kept::of(&grading)?);
            }
            if self.budget == BudgetChoice::None {
                grading.budget = None;
            }
            let jobs = self.jobs.min(sources.len()).max(1);
            grading.threads = (cores() / jobs as u32).max(1);
            let results = self.grade_all(&context, &grading, sources, jobs);
            let costs = grading.costs_of_reference();
            if self.purpose == Purpose::Grade && !costs.is_empty() {
                let file = self.output.join(report::INSTRUCTOR).join(COSTS_FILE);
                write_whole(&file, &serde_json::to_vec_pretty(&costs)?)
                    .with_context(|| format!("cannot write {}", file.display()))?;
            }
            let found = grading.kept.as_ref().map_or(0, Kept::found);
            if found > 0 {
                context.line.suspend(|| {
                    eprintln!(
                        "umbra: {found} of {} hand-ins are as they were graded before",
                        sources.len()
                    );
                });
            }
            Ok::<_, anyhow::Error>((results, grading.held_back))
        });
        context.line.finish_and_clear();
        if INTERRUPTED.load(Ordering::Relaxed) {
            let goes_on = match (self.purpose, &result) {
                (Purpose::Grade, Ok((results, _))) => format!(
                    ", {} of {} hand-ins are graded; the same command goes on from there",
                    results.len(),
                    sources.len()
                ),
                _ => String::new(),
            };
            eprintln!("umbra: interrupted{goes_on}");
            return Ok(None);
        }
        let (results, held_back) = result?;
        let mut records = results.into_iter().collect::<anyhow::Result<Vec<Record>>>()?;
        judge_shared(&mut records);
        let rules = &context.assignment.rules;
        let entries = records.into_iter().map(|mut record| {
            record.evidence = rubric::settle(rules, &record.evidence);
            let grade = rubric::grade(rules, &record.evidence);
            Entry { record, grade }
        });
        let sheet = Sheet::new(&context.assignment, held_back, entries.collect());
        report::write(self.output, &sheet)?;
        if self.timings {
            print_timings(&sheet);
        }
        Ok(Some((sheet, collected.skipped())))
    }

    /// Takes all hand-ins through all stages, in their order; none is begun after Ctrl-C. To be graded, one
    /// that the machine failed on has a record that says so: the others' are no worse for it.
    fn grade_all(
        &self,
        context: &Context,
        grading: &Grading,
        sources: &[Source],
        jobs: usize,
    ) -> Vec<anyhow::Result<Record>> {
        let slugs = slugs(sources);
        let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let results = Mutex::new(Vec::new());
        let work = || {
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(Source { path: source, name }) = sources.get(index) else { return };
                let slug = &slugs[index];
                let say = |stage: &str| {
                    let done = done.load(Ordering::Relaxed);
                    context.say(&format!("{done} of {} done; {slug}: {stage}", sources.len()));
                };
                let out = Folders {
                    student: self.output.join(slug),
                    instructor: self.output.join(report::INSTRUCTOR).join(slug),
                };
                let result = match self.purpose {
                    Purpose::Grade => grading.one_of_batch(source, slug, &out, &say),
                    Purpose::Check => grading.hand_in(source, slug, &out, self.purpose, &say),
                };
                if INTERRUPTED.load(Ordering::Relaxed) && result.is_err() {
                    return;
                }
                let result = match (result, self.purpose) {
                    (Err(error), Purpose::Grade) => {
                        context.line.suspend(|| {
                            eprintln!("umbra: {}: {}", source.display(), super::told_once(&error));
                        });
                        Ok(grading.unjudged(source, slug))
                    }
                    (result, _) => result.with_context(|| source.display().to_string()),
                };
                let result = result.map(|record| Record { name: name.clone(), ..record });
                done.fetch_add(1, Ordering::Relaxed);
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

fn print_timings(sheet: &Sheet) {
    for entry in &sheet.entries {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::Check;
    use crate::report::sample;

    #[test]
    fn a_bug_of_ours_counts_more_than_what_the_machine_lacks() {
        let mut sheet = sample::sheet();
        assert_eq!(exit_code(&sheet), super::super::EXIT_MACHINE);
        let bug = Check::new(INTERNAL_ERROR, "", Verdict::Fail, "index out of bounds");
        sheet.entries[0].record.evidence.checks.push(bug);
        assert_eq!(exit_code(&sheet), super::super::EXIT_BUG);
        sheet.entries.clear();
        assert_eq!(exit_code(&sheet), super::super::EXIT_OK);
    }
}
