//! `umbra mend`: a fix of a few lines by the instructor, graded as the student's code.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};

use super::assemble::KeptReport;
use super::batch::{Batch, BatchOutcome};
use super::choices::{HeldBackSeed, IsolationChoice};
use super::chosen::one;
use super::class;
use super::context::Context;
use super::decide::{DecisionArguments, said};
use super::location::{Location, fetch};
use super::render::AdapterChoice;
use crate::class::mending;
use crate::files::files_below;
use crate::grading::{Mode, Record};
use crate::harmless::harmless;
use crate::report;

/// Options of `umbra mend`.
#[derive(clap::Args)]
pub struct MendArguments {
    /// Student number, name, or the submission's folder in the report
    student: String,
    /// The fix: a unified diff of files in src/, of at most `mend.lines` lines
    patch: PathBuf,
    /// Where the submission is now, if it was moved since grading
    #[arg(long, value_name = "PATH")]
    submission: Option<PathBuf>,
    /// Graphics adapter for realtime scenes
    #[arg(long, value_enum, default_value_t = AdapterChoice::Software)]
    adapter: AdapterChoice,
    /// Required isolation
    #[arg(long, value_enum, default_value_t = IsolationChoice::Full)]
    isolation: IsolationChoice,
    #[command(flatten)]
    decision: DecisionArguments,
}

/// Grades the mended submission beside the record of the unmended one, and keeps the decision.
///
/// # Errors
/// When the patch is not allowed or does not apply, or the result cannot be graded or kept.
pub fn run(arguments: &MendArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let MendArguments { student, patch, decision, .. } = arguments;
    let output = &decision.report.path;
    decision.check()?;
    let assignment = Context::assignment(root)?;
    let Some(mend) = &assignment.mend else {
        bail!(
            "{}: nothing may be mended; hint: \"mend\": {{\"lines\": 5, \"penalty\": 10}} allows five lines for ten points",
            assignment.root.join("config.json").display()
        );
    };
    let text =
        fs::read_to_string(patch).with_context(|| format!("cannot read {}", patch.display()))?;
    let lines = mending::lines_of(&text).with_context(|| patch.display().to_string())?;
    ensure!(
        lines <= mend.lines,
        "{}: changes {lines} lines; expected at most {} (mend.lines in config.json)",
        patch.display(),
        mend.lines
    );
    let kept = KeptReport::read(output)?;
    let graded = one(student, output, &kept)?;
    let record = &graded.entry.record;
    let folder = class::mended(output, &record.slug);
    let source = mended_source(arguments, root, &text, &kept, record)?;
    let seed = kept.held_back().map(|held_back| held_back.seed);
    let batch = Batch {
        adapter: arguments.adapter,
        isolation: arguments.isolation,
        held_back_seed: Some(HeldBackSeed(seed)),
        is_own: true,
        ..Batch::of(vec![source], &folder, Mode::Grade)
    };
    let BatchOutcome::Report(..) = batch.run(root)? else { return Ok(super::EXIT_INTERRUPTED) };
    let made = decision.mend(&graded, text, mend.penalty)?;
    let report = decision.add(kept, &made)?;
    let slug = &record.slug;
    let entry = report.entries.iter().find(|entry| entry.record.slug == *slug);
    if let Some(mended) = entry.and_then(|entry| entry.standing.mended.as_ref()) {
        println!("{}: {}", harmless(&graded.entry.who()), harmless(&mended.words));
    }
    said(output, &graded, &report)
}

/// A copy of the submission with the fix in it, in the instructor's folder.
fn mended_source(
    arguments: &MendArguments,
    root: Option<&Path>,
    patch: &str,
    kept: &KeptReport,
    record: &Record,
) -> anyhow::Result<PathBuf> {
    let output = &arguments.decision.report.path;
    let Record { slug, digest, .. } = record;
    let location = match &arguments.submission {
        Some(path) if path.exists() => Location::Here(path.clone()),
        Some(path) => Location::Gone(path.clone()),
        None => Location::of(output, slug),
    };
    let context = Context::new(root)?;
    let scratch = tempfile::tempdir_in(&context.supervisor.scratch)?;
    let unpacked = scratch.path().join("download");
    fs::create_dir(&unpacked)?;
    let given = fetch(&location, kept.kind(), &context, &unpacked).with_context(|| {
        format!(
            "the submission {slug} cannot be read; hint: --submission PATH, the archive or folder"
        )
    })?;
    let copy = scratch.path().join("copy");
    fs::create_dir(&copy)?;
    let (tree, limits) = (&context.assignment.tree, &context.assignment.limits.archive);
    let received = context.decoder().receive(&given, &copy, tree, limits)?;
    ensure!(
        received.submission.digest == *digest,
        "{} is not what was graded as {slug}; expected the same files",
        given.display()
    );
    let from = &received.submission.root;
    mending::apply(patch, from).with_context(|| arguments.patch.display().to_string())?;
    let folder = class::mended(output, slug);
    if folder.exists() {
        fs::remove_dir_all(&folder)
            .with_context(|| format!("cannot replace {}", folder.display()))?;
    }
    let to = folder.join(report::MENDED_SOURCE);
    for file in files_below(from)? {
        let own = to.join(file.strip_prefix(from).unwrap_or(&file));
        fs::create_dir_all(own.parent().unwrap_or(&to))?;
        fs::copy(&file, &own).with_context(|| format!("cannot write {}", own.display()))?;
    }
    Ok(to)
}
