//! Grading one submission from a program, without the command line.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use anyhow::ensure;

use crate::assignment::Assignment;
use crate::class::Standing;
use crate::grading::{Folders, Grading, Mode, Record};
use crate::report::{self, BatchReport, SubmissionReport};
use crate::rubric::{self, Rules};
use crate::sandbox::Isolation;
use crate::store::{Store, reference_library};
use crate::worker::{Adapter, AdapterKind, Supervisor};

/// The folder of the submission in the report.
const SLUG: &str = "submission";

/// Where things are, and what is asked, for [`grade_submission`].
#[derive(Clone, Copy, Debug)]
pub struct GradeOptions<'a> {
    /// The folder of the assignment: `config.json`, `scenes/`, `expected/`.
    pub root: &'a Path,
    /// The program `umbra`, as cargo built it: `umbra-worker` lies beside it.
    pub umbra: &'a Path,
    /// Where the report is written, as `umbra grade --report` does. Made when missing.
    pub output: &'a Path,
    /// The seed of the held-back scenes. Without one the public scenes alone count, and no reference
    /// renderer is needed.
    pub seed: Option<u64>,
    /// Runs the submission even where this machine cannot isolate it fully. Only for code that you trust.
    pub reduced_isolation: bool,
}

/// Grades one submission, an archive or a folder, and writes its report. Takes about a minute, on all
/// cores.
///
/// Whatever is wrong with the submission is in the answer: points, reasons, and the evidence behind them.
///
/// # Errors
/// What the machine lacks, or the assignment: a file, a compiler, isolation, space on disk.
pub fn grade_submission(
    submission: &Path,
    options: &GradeOptions,
) -> anyhow::Result<SubmissionReport> {
    ensure!(submission.exists(), "{} does not exist", submission.display());
    let assignment = Assignment::load(options.root)?;
    let scratch = assignment.scratch()?;
    let umbra = std::path::absolute(options.umbra)?;
    let supervisor = Supervisor::available(umbra, scratch.path().to_owned());
    let isolation = supervisor.isolation.isolation();
    ensure!(
        options.reduced_isolation || isolation == Isolation::Full,
        "full isolation is not available here ({isolation}), so the submission is not run; hint: `umbra doctor` says \
         what to do"
    );
    let store = Store {
        assignment: &assignment,
        reference: reference_library(&assignment.root, &supervisor.umbra),
        supervisor: &supervisor,
        threads: std::thread::available_parallelism().map_or(1, |cores| cores.get() as u32),
        progress: &|_| (),
    };
    let adapter = Adapter { kind: AdapterKind::Any, name: String::new() };
    let never = AtomicBool::new(false);
    let mut grading = Grading::prepare(&store, adapter, options.seed, &never)?;
    let folders = Folders {
        student: options.output.join(SLUG),
        instructor: options.output.join(report::INSTRUCTOR).join(SLUG),
    };
    let record = grading.submission(submission, SLUG, &folders, Mode::Grade, &|_| ())?;
    let held_back = grading.held_back.take();
    let report = BatchReport::new(&assignment, held_back, vec![graded(record, &assignment.rules)]);
    report::write(options.output, &report)?;
    let [entry] = <[SubmissionReport; 1]>::try_from(report.entries).expect("one was graded");
    Ok(entry)
}

/// A record with the points that it is worth.
pub(crate) fn graded(mut record: Record, rules: &Rules) -> SubmissionReport {
    // Graded by all of the evidence: what is settled leaves no second choice of a convention.
    let grade = rubric::grade(rules, &record.evidence);
    record.evidence = rubric::settle(rules, &record.evidence);
    SubmissionReport { record, grade, standing: Standing::default() }
}
