//! `umbra grade`: takes a class through all stages and writes its report.

use std::path::{Path, PathBuf};

use super::batch::{Batch, BatchOutcome};
use super::choices::{BudgetChoice, HeldBackSeed, IsolationChoice, Slice};
use super::context::cores;
use super::export::{self, ExportFormat, Item};
use super::outputs::{at_root, shell_path};
use super::render::AdapterChoice;
use super::terminal;
use crate::class::{Attempt, MATCHES, Platform};
use crate::columns::count;
use crate::evidence::Verdict;
use crate::grading::{INTERNAL_ERROR, Mode};
use crate::report::{self, BatchReport, SubmissionReport};

/// Options of `umbra grade`.
#[derive(clap::Args)]
pub struct GradeArguments {
    /// Archives, submission folders, a folder of them, or a download from Brightspace, Canvas, Moodle or Gradescope
    #[arg(required = true)]
    submissions: Vec<PathBuf>,
    /// Where the submissions come from [default: recognized by their names]
    #[arg(long, value_enum, value_name = "KIND")]
    from: Option<Platform>,
    /// The class list: a CSV file as a learning platform exports it
    ///
    /// Umbra matches submissions to its students and lists who is missing. The report keeps a copy for later runs.
    #[arg(long, value_name = "LIST.csv")]
    class: Option<PathBuf>,
    /// Which of a student's attempts counts [default: as in earlier runs into --report, else latest]
    #[arg(long, value_enum)]
    attempt: Option<Attempt>,
    /// Folder for the reports and results
    ///
    /// The same command resumes an interrupted batch and grades only what is new or has changed. Other submissions join
    /// the class that is there.
    #[arg(
        long = "report",
        alias = "output",
        short_alias = 'o',
        value_name = "DIR",
        default_value = "umbra-report"
    )]
    output: PathBuf,
    /// Graphics adapter for realtime scenes; software gives every machine the same pixels
    #[arg(long, value_enum, default_value_t = AdapterChoice::Software)]
    adapter: AdapterChoice,
    /// Submissions to grade at the same time [default: one for each core]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Required isolation; `reduced` runs with what this machine has, and the report says so (see `umbra doctor`)
    #[arg(long, value_enum, default_value_t = IsolationChoice::Full)]
    isolation: IsolationChoice,
    /// Seed of the held-back scenes, to reproduce a batch; `off` uses public scenes alone [default: the secret seed of
    /// the report]
    #[arg(
        long = "held-back",
        alias = "perturb",
        value_name = "SEED|off",
        overrides_with = "held_back_seed"
    )]
    held_back_seed: Option<HeldBackSeed>,
    /// Grade only this student's submission, by number, name or file name; the others keep their grades
    #[arg(long, value_name = "STUDENT")]
    only: Vec<String>,
    /// Grade only this share, such as slice:2/4, and write no report; `umbra merge` writes it
    #[arg(long, value_name = "slice:K/N", conflicts_with = "only")]
    partition: Option<Slice>,
    /// Grade unchanged submissions again too
    #[arg(long)]
    force: bool,
    /// CPU time limit of each submission
    ///
    /// By default config.json sets it, as a multiple of the reference renderer's CPU time. `none` finishes a submission
    /// that used up its time.
    #[arg(long, value_enum, default_value_t = BudgetChoice::Config)]
    budget: BudgetChoice,
    /// Print what each step cost
    #[arg(long)]
    timings: bool,
    /// Also write the grades as `umbra export` does, into --report; may be repeated
    #[arg(long, value_enum, value_name = "FORMAT", conflicts_with = "partition")]
    export: Vec<ExportFormat>,
    #[command(flatten)]
    item: Item,
}

/// Grades submissions and prints the table; exit 0 when all could be graded, whatever their points, 1 when a zip that
/// looks like a download was left out.
///
/// # Errors
/// When an option contradicts another, or the batch cannot be graded or written.
pub fn grade(arguments: &GradeArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    export::check(&arguments.export, &arguments.output, arguments.class.as_deref())?;
    let batch = Batch {
        paths: arguments.submissions.clone(),
        output: &arguments.output,
        adapter: arguments.adapter,
        jobs: arguments.jobs.unwrap_or(cores() as usize).max(1),
        mode: Mode::Grade,
        isolation: arguments.isolation,
        held_back_seed: arguments.held_back_seed,
        budget: arguments.budget,
        selection: None,
        only: &arguments.only,
        slice: arguments.partition,
        from: arguments.from,
        list: arguments.class.as_deref(),
        attempt: arguments.attempt,
        force: arguments.force,
        keeps_plugin: None,
        realtime_first: false,
        timings: arguments.timings,
        is_own: false,
    };
    let (report, collected) = match batch.run(root)? {
        BatchOutcome::Interrupted => return Ok(super::EXIT_INTERRUPTED),
        BatchOutcome::Report(report, collected) => (report, collected),
        BatchOutcome::Slice(entries, all) => {
            println!(
                "{} of {all} graded; `umbra merge --report {}{}` makes the reports when all tasks are done",
                count(entries.len(), "submission"),
                shell_path(&arguments.output),
                at_root(root)
            );
            return Ok(exit_code(&entries));
        }
    };
    export::beside(&arguments.export, &arguments.output, &arguments.item)?;
    shown(&report, &arguments.output, collected.skipped())
}

/// Prints the table of a report, what was skipped, and what is left to do; the exit code that it stands for.
///
/// # Errors
/// When the table cannot be made.
pub fn shown(report: &BatchReport, output: &Path, skipped: Option<String>) -> anyhow::Result<u8> {
    print_as_is!("{}", report::text_table(report, terminal::width(), terminal::colors())?);
    if let Some(skipped) = skipped {
        println!("skipped, not submissions: {skipped}");
    }
    if report.class.as_ref().is_some_and(|class| !class.undecided.is_empty()) {
        let file = output.join(MATCHES);
        println!("decide in {}, and run the same command again", file.display());
    }
    println!("report: {}", output.join(report::HTML_FILE).display());
    if let Some(held_back) = &report.held_back {
        println!("held-back seed {0}; --held-back {0} reproduces this batch", held_back.seed);
    }
    let unopened = report.class.as_ref().is_some_and(|class| !class.unopened.is_empty());
    Ok(match exit_code(&report.entries) {
        super::EXIT_OK if unopened => super::EXIT_NOT_IN_ORDER,
        code => code,
    })
}

/// The exit code of a batch: a bug of ours takes precedence over something that the machine lacks.
fn exit_code(entries: &[SubmissionReport]) -> u8 {
    let mut checks = entries.iter().flat_map(|entry| &entry.record.evidence.checks);
    if checks.any(|check| check.id == INTERNAL_ERROR && check.verdict == Verdict::Fail) {
        return super::EXIT_BUG;
    }
    let ungraded = entries.iter().any(|entry| entry.grade.points < entry.grade.points_max);
    if ungraded { super::EXIT_MACHINE } else { super::EXIT_OK }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_share_all_without_a_rest() {
        let slices: Vec<Slice> =
            (1..=4).map(|index| format!("slice:{index}/4").parse().unwrap()).collect();
        for at in 0..24 {
            assert_eq!(slices.iter().filter(|slice| slice.holds(at)).count(), 1, "{at}");
        }
        for slip in ["slice:0/4", "slice:5/4", "2/4", "slice:2", "slice:a/b", "slice:1/0"] {
            assert!(slip.parse::<Slice>().unwrap_err().contains("such as slice:2/4"), "{slip}");
        }
    }
}
