//! What a batch needs before anything is graded, and what must be so.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};

use super::Batch;
use crate::assignment::Assignment;
use crate::class::{CollectOptions, Collected, Decisions, Label, Pins, Stated, collect};
use crate::cli::MachineLacks;
use crate::cli::choices::{HeldBackSeed, IsolationChoice};
use crate::cli::class::{self, Source, Telling};
use crate::cli::context::Context;
use crate::cli::export;
use crate::cli::found::BatchIndex;
use crate::cli::outputs::{at_root, ensure_apart, ensure_not_read, shell_path};
use crate::cli::settled;
use crate::columns::count;
use crate::grading::{Mode, RecordCache};
use crate::held_back::{in_words, recorded_seed};
use crate::report;
use crate::sandbox::Isolation;

impl Batch<'_> {
    /// The submissions at the paths, and what is none.
    pub(super) fn collect(&self, context: &Context, scratch: &Path) -> anyhow::Result<Collected> {
        let mut collected = match self.mode {
            Mode::Grade => {
                let wanted = CollectOptions {
                    tree: &context.assignment.tree,
                    limits: &context.assignment.limits.archive,
                    from: self.from,
                    output: Some(self.output),
                    scratch,
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
        Ok(collected)
    }

    /// Makes sure, before anything is written, that the report replaces nothing that is read.
    pub(super) fn ensure_apart(
        &self,
        context: &Context,
        collected: &Collected,
    ) -> anyhow::Result<()> {
        if !self.is_own {
            for source in
                class::sources(self.mode, &collected.sources, self.output, &HashMap::new())
            {
                ensure_apart(self.output, &source.path, &source.slug, &context.assignment.tree)?;
            }
        }
        if let Some(list) = self.list {
            // The files of a report, and the class list that it keeps of an earlier run.
            for name in [report::HTML_FILE, report::JSON_FILE, report::CSV_FILE] {
                ensure_not_read(&self.output.join(name), [list])?;
            }
        }
        Ok(())
    }

    /// Makes sure that there are a reference renderer and the isolation that is demanded.
    pub(super) fn ensure_means(&self, context: &Context) -> anyhow::Result<()> {
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
        Ok(())
    }

    /// What the report is settled by: what is pinned there, which takes the place of what `config.json` says by now,
    /// with the instructor's decisions as they are now.
    pub(super) fn pin(
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
    pub(super) fn seed(&self, file: &Path) -> anyhow::Result<Option<u64>> {
        let chosen = self.held_back_seed.map(|HeldBackSeed(seed)| seed);
        let seed = match (self.mode, chosen) {
            (Mode::Check, Some(seed)) => return Ok(seed),
            _ => recorded_seed(file, chosen)?,
        };
        // Before they are merged, tasks of a partition are compared with each other.
        let is_merged = self.slice.is_none() || BatchIndex::read(self.output)?.is_some();
        ensure!(
            chosen.is_none_or(|own| own == seed || !is_merged),
            "--held-back: {} is graded with {}, and all submissions of a report share their held-back scenes; hint: \
             another --report, or delete {} and grade all of them again",
            self.output.display(),
            in_words(seed),
            file.display()
        );
        Ok(chosen.unwrap_or(seed))
    }

    /// What tells whose submissions are: the class list and the instructor's decisions, which are checked and kept.
    pub(super) fn telling(&self, pins: &Pins, decided: &Decisions) -> anyhow::Result<Telling> {
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
        Ok(Telling { roster, matches })
    }

    /// The slugs of attempts that need not be graded: another one of the same student counts.
    pub(super) fn set_aside(
        &self,
        all: &[Source],
        decided: &Decisions,
    ) -> anyhow::Result<HashSet<String>> {
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
}

/// Says which submissions lie there several times, or under other names than before.
pub(super) fn tell_of_copies(
    collected: &Collected,
    all: &[Source],
    names: &HashMap<String, String>,
) {
    if !collected.copies.is_empty() {
        eprintln!(
            "umbra: {} in more than one download with the same content, graded once: {}",
            count(collected.copies.len(), "submission"),
            class::some(&collected.copies)
        );
    }
    for source in all.iter().filter(|source| source.moved.is_some()) {
        let last = |name: &str| name.rsplit('/').next().unwrap_or_default().to_owned();
        let before = names.get(&source.slug).map(|name| last(name));
        if let Some(before) = before.filter(|own| *own != last(&source.name)) {
            eprintln!("umbra: {} is {before} under another name: it holds the same", source.name);
        }
    }
}

/// Makes sure that a task of a partition uses the class list that other tasks at work use.
fn same_list(list: &Path, output: &Path) -> anyhow::Result<()> {
    let read = |path: &Path| {
        std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
    };
    let kept = class::kept_list(output);
    ensure!(
        BatchIndex::begun(output)?.is_empty() || !kept.is_file() || read(list)? == read(&kept)?,
        "--class: {} differs from {}, which the other tasks use; all tasks of a partition use the same list",
        list.display(),
        kept.display()
    );
    Ok(())
}

/// Makes sure that a task of a partition uses the seed of one of the tasks that graded something, if any did.
pub(super) fn same_seed(seed: Option<u64>, output: &Path) -> anyhow::Result<()> {
    let begun = BatchIndex::begun(output)?;
    let seed_of = |found: &BatchIndex| found.held_back.as_ref().map(|held_back| held_back.seed);
    if begun.iter().any(|(_, found)| seed_of(found) == seed) {
        return Ok(());
    }
    let instructor = output.join(report::INSTRUCTOR);
    let graded = |(_, found): &&(PathBuf, BatchIndex)| {
        let made = |slug: &String| RecordCache::conditions_of(&instructor.join(slug));
        class::folders(output).iter().filter_map(made).any(|made| made == found.conditions)
    };
    let Some((file, found)) = begun.iter().find(graded) else { return Ok(()) };
    let other = in_words(seed_of(found));
    bail!(
        "--held-back: this task would use {}, another one used {other}: all tasks of a partition use the same seed; \
         hint: --held-back {other}, or delete {} and run its task again",
        in_words(seed),
        file.display()
    );
}
