//! The first stages of a submission, which need no scene: intake and build.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::Context;
use tempfile::TempDir;

use super::costs::Costs;
use super::record::{Record, Student};
use super::tree_checks::{Mode, config_check, refused_checks, tree_check};
use super::{similarity, template_fallback};
use crate::assignment::Assignment;
use crate::build::{self, BuildOutcome, Recording};
use crate::decode::{Decoder, Received};
use crate::evidence::{Check, Verdict};
use crate::files::{step, write_whole};
use crate::harmless::harmless;
use crate::intake::{self, IntakeError, Submission, SubmittedConfig};
use crate::process::Exit;
use crate::rubric::BUILD;
use crate::worker::Supervisor;

/// What the progress says in front of the first error of a compiler, as soon as that is known.
pub const REFUSED: &str = "does not compile: ";

/// What it says in front of the points of a path that is judged while the other is not.
pub const SO_FAR: &str = "points so far: ";

/// Receives messages about progress.
pub type Say<'a> = &'a (dyn Fn(&str) + Sync);

/// Receives and builds submissions.
#[derive(Clone, Copy)]
pub struct Workshop<'a> {
    pub(super) assignment: &'a Assignment,
    pub(super) supervisor: &'a Supervisor,
    /// The template's compiler call.
    pub(super) recording: &'a Recording,
    /// Ctrl-C.
    pub(super) cancel: &'a AtomicBool,
}

/// A submission after intake and build.
pub struct Begun {
    /// The record so far, without the conditions.
    pub(super) record: Record,
    pub(super) checks: Vec<Check>,
    pub(super) costs: Costs,
    /// Its private copy and its config; `None` if it was refused.
    pub(super) received: Option<(Submission, SubmittedConfig)>,
    /// The library, if it was built.
    pub(super) built: Option<(PathBuf, template_fallback::Built)>,
    /// Where copy and library lie.
    pub(super) scratch: TempDir,
}

impl Begun {
    /// Leaves the library for others in `file`, when the source was built as it is.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn keep_plugin(&self, file: &Path) -> anyhow::Result<()> {
        // A library with files of the template does not show the author's work.
        let Some((library, _)) = self.built.as_ref().filter(|(_, own)| own.replaced.is_empty())
        else {
            return Ok(());
        };
        write_whole(file, &std::fs::read(library)?)
            .with_context(|| format!("cannot write {}", file.display()))
    }
}

impl Workshop<'_> {
    /// Copies the submission at `source`, and looks at the copy.
    ///
    /// # Errors
    /// When the machine fails; faults of the submission are in the answer.
    pub fn receive(
        &self,
        source: &Path,
        slug: &str,
        mode: Mode,
        say: Say,
    ) -> anyhow::Result<Begun> {
        say("copying the files");
        let decoder = Decoder::new(self.supervisor, &self.assignment.limits.decode, self.cancel);
        let scratch =
            tempfile::Builder::new().prefix("submission-").tempdir_in(&self.supervisor.scratch)?;
        let copy = scratch.path().join("copy");
        std::fs::create_dir(&copy)?;
        let mut begun = Begun {
            record: Record::begun(source, slug),
            checks: Vec::new(),
            costs: Costs::begin(),
            received: None,
            built: None,
            scratch,
        };
        let record = &mut begun.record;
        let (tree, limits) = (&self.assignment.tree, &self.assignment.limits.archive);
        let Received { submission, validation, source } =
            match decoder.receive(source, &copy, tree, limits) {
                Ok(received) => received,
                Err(IntakeError::Refused(refusal)) => {
                    let validation = intake::validate_refusal(&refusal);
                    begun.checks = refused_checks(&validation);
                    record.findings = validation.findings;
                    record.stages = begun.costs.end("intake", decoder.take_cpu_s());
                    return Ok(begun);
                }
                Err(error) => return Err(error.into()),
            };
        step("submission", "copied");
        record.digest.clone_from(&submission.digest);
        let config = validation.config.clone().unwrap_or_default();
        record.student = Student::of(&config);
        record.findings.clone_from(&validation.findings);
        record.findings.extend(source);
        record.sources = similarity::digests(&submission, &self.assignment.template())
            .context("cannot read the source")?;
        begun.checks = vec![tree_check(&validation, &submission, tree, mode)];
        begun.checks.extend(config_check(&validation));
        begun.costs.end("intake", decoder.take_cpu_s());
        begun.received = Some((submission, config));
        Ok(begun)
    }

    /// Builds the source, with files of the template where it does not build as it is.
    ///
    /// # Errors
    /// When the machine fails, and at Ctrl-C.
    pub fn build(&self, begun: &mut Begun, say: Say) -> anyhow::Result<()> {
        let Some((submission, _)) = &begun.received else { return Ok(()) };
        say("compiling the source");
        let src = submission.root.join("src");
        if !src.join("lib.rs").is_file() {
            let summary = no_source(&submission.root);
            begun.checks.push(Check::new(BUILD, "", Verdict::Fail, summary));
            return Ok(());
        }
        let scratch = begun.scratch.path();
        let out = scratch.join("out");
        std::fs::create_dir(&out)?;
        let limits = &self.assignment.limits.build;
        let isolation = self.supervisor.isolation.isolation();
        let kept = build::KeptLibraries::within(&self.assignment.cache(), isolation);
        let own = &src;
        let compile = |src: &Path| {
            let report =
                kept.compile(self.recording, self.supervisor, src, &out, limits, self.cancel)?;
            if let BuildOutcome::CompileError { errors } = &report.outcome
                && let Some(first) = errors.first().filter(|_| src == own)
            {
                say(&format!("{REFUSED}{}", harmless(&first.headline())));
            }
            Ok(report)
        };
        let template = self.assignment.template();
        let built = template_fallback::build(&compile, &src, &template, &scratch.join("mended"))?;
        begun.costs.end("build", built.cpu_s);
        let rendered = built.errors.iter().map(|error| error.rendered.as_str());
        begun.record.diagnostics = rendered.collect::<Vec<_>>().join("\n");
        let first = built.errors.first().map(build::Diagnostic::headline).unwrap_or_default();
        let mut hint = String::new();
        let (plugin, summary) = match &built.report.outcome {
            BuildOutcome::Built { library } if built.replaced.is_empty() => {
                (Some(library.clone()), "the source builds".to_owned())
            }
            BuildOutcome::Built { library } => {
                let summary =
                    format!("the source builds but for files that were replaced: {first}");
                (Some(library.clone()), summary)
            }
            BuildOutcome::CompileError { .. } => {
                hint = first;
                (None, "the source does not build".to_owned())
            }
            BuildOutcome::Ended(Exit::Cancelled) => anyhow::bail!("interrupted"),
            BuildOutcome::Ended(exit) => (None, format!("the compiler {exit}")),
        };
        let verdict = if plugin.is_some() { Verdict::Pass } else { Verdict::Fail };
        begun.checks.push(Check::new(BUILD, "", verdict, summary).with_hint(hint));
        if plugin.is_some() {
            step("submission", "built");
        }
        begun.built = plugin.map(|library| (library, built));
        Ok(())
    }
}

/// Why there is no source, where it may lie under a name that only some systems take for the right one.
fn no_source(root: &Path) -> String {
    let entries = std::fs::read_dir(root).into_iter().flatten().flatten();
    let mut names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    match names.find(|name| name != "src" && name.eq_ignore_ascii_case("src")) {
        Some(name) => format!("there is no src/lib.rs: the folder is called {name}, expected src"),
        None => "there is no src/lib.rs".to_owned(),
    }
}
