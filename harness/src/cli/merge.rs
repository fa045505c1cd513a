//! `umbra merge`: the reports of a batch that several tasks graded into one folder. It relies on records, never on how
//! a task ended.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};

use super::assemble;
use super::batch::{Batch, BatchOutcome};
use super::choices::{HeldBackSeed, IsolationChoice};
use super::class::{self, some};
use super::context::Context;
use super::found::{BatchIndex, Seen};
use super::grade;
use super::join::join;
use super::outputs::{at_root, shell_path};
use crate::class::{Decisions, Pins, Stated};
use crate::columns::count;
use crate::evidence::{Check, Evidence};
use crate::grading::{Conditions, Mode, Record, RecordCache, StoredRecord};
use crate::report::{self, harmless};
use crate::rubric;

/// Options of `umbra merge`.
#[derive(clap::Args)]
pub struct MergeArguments {
    /// The folder that all tasks graded into
    #[arg(
        long = "report",
        alias = "output",
        short_alias = 'o',
        value_name = "DIR",
        default_value = "umbra-report"
    )]
    output: PathBuf,
    /// Merge records of machines that differ in isolation, graphics adapter or compiler
    ///
    /// One submission of each other kind of machine is graded again on this one. Verdicts that differ are printed.
    #[arg(long)]
    allow_mixed: bool,
}

/// Writes the reports and prints the table. Refuses a class that is incomplete, or was not judged by one program and
/// one kind of machine.
///
/// # Errors
/// When it refuses, or a record cannot be read or a report written.
pub fn merge(arguments: &MergeArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let MergeArguments { output, allow_mixed } = arguments;
    let instructor = output.join(report::INSTRUCTOR);
    let begun = BatchIndex::begun(output)?;
    let files: Vec<PathBuf> = begun.iter().map(|(file, _)| file.clone()).collect();
    // What is merged already is made again, with what the instructor decided since.
    let found = match BatchIndex::read(output)?.filter(|_| begun.is_empty()) {
        Some(merged) => merged,
        None => one(output, begun)?,
    };
    let (mut records, mut absent) = (Vec::new(), Vec::new());
    for Seen { slug, name, .. } in found.counting() {
        let earlier = RecordCache::earlier(&instructor.join(slug), &found.conditions)?;
        match earlier.filter(|earlier| earlier.comparable) {
            Some(earlier) => records.push(earlier),
            None => absent.push(name.clone()),
        }
    }
    ensure!(
        absent.is_empty(),
        "{} of {} not graded yet: {}; run the tasks again, those that are done take seconds",
        absent.len(),
        count(found.counting().count(), "submission"),
        harmless(&some(&absent))
    );
    let machines = machines(&records);
    if machines.len() > 1 {
        let words: Vec<String> = machines.iter().map(in_words).collect();
        ensure!(
            *allow_mixed,
            "the tasks ran on machines that may judge differently: {}; hint: grade again on machines of one kind, or \
             --allow-mixed",
            words.join("; ")
        );
        compare(root, output, &found, &machines)?;
    }
    let mut pins = Pins::read(&instructor)?;
    let pinned = &pins.current().context("nothing is pinned; run a task again")?.decided;
    let (stated, attempt) = (pinned.assignment.clone(), pinned.attempt);
    if let Ok(assignment) = Context::assignment(root) {
        let differs = Stated::from(&assignment).differs(&stated);
        if !differs.is_empty() {
            eprintln!(
                "umbra: config.json has other {} than the tasks pinned; `umbra regrade --report {}{}` shows what would \
                 change",
                differs.join(", "),
                shell_path(output),
                at_root(root)
            );
        }
    }
    let decided = Decisions::read(output, stated, attempt)?;
    decided.check(output)?;
    join(output, &found, &mut records);
    let skipped = crate::class::skipped(&found.skipped);
    let report = assemble::finish(output, &mut pins, &decided, found, records)?;
    for file in files {
        std::fs::remove_file(&file).with_context(|| format!("cannot remove {}", file.display()))?;
    }
    grade::shown(&report, output, skipped)
}

/// What all tasks found.
fn one(output: &Path, begun: Vec<(PathBuf, BatchIndex)>) -> anyhow::Result<BatchIndex> {
    let instructor = output.join(report::INSTRUCTOR);
    ensure!(
        !begun.is_empty(),
        "{}: nothing to merge; expected tasks that ran `umbra grade --partition slice:K/N --report {}`",
        output.display(),
        shell_path(output)
    );
    let mut judged: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for slug in class::folders(output) {
        if let Some(conditions) = RecordCache::conditions_of(&instructor.join(&slug)) {
            judged.entry(conditions).or_default().push(slug);
        }
    }
    // Other tasks repeated the work of tasks that left nothing.
    let made = |found: &BatchIndex| judged.contains_key(&found.conditions);
    let any = begun.iter().any(|(_, found)| made(found));
    let mut begun: Vec<_> = begun.into_iter().filter(|(_, found)| !any || made(found)).collect();
    // A class that grew between two runs.
    begun.sort_by_key(|(_, found)| found.seen.len());
    let (file, last) = begun.pop().context("nothing to merge")?;
    for (other_file, other) in &begun {
        if other.conditions != last.conditions {
            let line = |file: &Path, found: &BatchIndex| {
                let own = judged.get(&found.conditions).map(|slugs| some(slugs));
                let seed = found.held_back.as_ref().map(|held_back| held_back.seed);
                format!(
                    "{} (Umbra {}, {}): {}",
                    file.display(),
                    found.umbra,
                    seed.map_or_else(
                        || "no held-back scenes".into(),
                        |seed| format!("seed {seed}")
                    ),
                    own.unwrap_or_else(|| "no record".into())
                )
            };
            bail!(
                "the tasks judged by different programs, scenes, limits or seeds: {}; {}; hint: delete the file of the \
                 wrong ones, and run their tasks again",
                line(other_file, other),
                line(&file, &last)
            );
        }
        let holds = |seen: &Seen| last.seen.iter().any(|own| own.slug == seen.slug);
        let lost = other.counting().find(|&seen| !holds(seen));
        if let Some(lost) = lost {
            bail!(
                "the tasks were given different submissions: {} has {}, {} does not; hint: give all tasks the same \
                 paths, and delete the file of the wrong ones",
                other_file.display(),
                harmless(&lost.name),
                file.display()
            );
        }
    }
    Ok(last)
}

/// Records by the machine that made them.
fn machines(records: &[StoredRecord]) -> Vec<(Conditions, Vec<StoredRecord>)> {
    let mut machines: Vec<(Conditions, Vec<StoredRecord>)> = Vec::new();
    for earlier in records {
        let conditions = &earlier.record.conditions;
        match machines.iter_mut().find(|(own, _)| own == conditions) {
            Some((_, own)) => own.push(earlier.clone()),
            None => machines.push((conditions.clone(), vec![earlier.clone()])),
        }
    }
    machines
}

fn in_words((conditions, records): &(Conditions, Vec<StoredRecord>)) -> String {
    let Conditions { isolation, adapter, compiler, .. } = conditions;
    let names: Vec<String> = records.iter().map(|own| own.record.name.clone()).collect();
    let compiler = compiler.get(..12).unwrap_or(compiler);
    harmless(&format!(
        "isolation {isolation}, adapter {adapter}, compiler {compiler}: {}",
        some(&names)
    ))
}

/// Grades one submission of each machine again on this one, and prints the verdicts that differ.
fn compare(
    root: Option<&Path>,
    output: &Path,
    found: &BatchIndex,
    machines: &[(Conditions, Vec<StoredRecord>)],
) -> anyhow::Result<()> {
    let scratch =
        crate::files::private_folder("umbra-merge-").context("cannot make a temporary folder")?;
    let samples = machines.iter().filter_map(|(_, own)| own.first()).map(StoredRecord::whole);
    let samples = samples.collect::<anyhow::Result<Vec<Record>>>()?;
    let only: Vec<String> = samples.iter().map(|record| record.slug.clone()).collect();
    let again = scratch.path().join("again");
    let batch = Batch {
        jobs: 1,
        isolation: IsolationChoice::Reduced,
        held_back_seed: Some(HeldBackSeed(
            found.held_back.as_ref().map(|held_back| held_back.seed),
        )),
        only: &only,
        from: Some(found.kind),
        ..Batch::of(found.paths.clone(), &again, Mode::Grade)
    };
    eprintln!("umbra: {} graded again on this machine", count(samples.len(), "submission"));
    let BatchOutcome::Report(made, _) = batch.run(root)? else { bail!("interrupted") };
    for record in samples {
        let folder = again.join(report::INSTRUCTOR).join(&record.slug);
        let Some(here) = RecordCache::record(&folder)? else {
            println!("{}: not found again below {}", harmless(&record.name), output.display());
            continue;
        };
        let settled = |record: &Record| rubric::settle(&made.rules, &record.evidence);
        let differs = differing(&settled(&record), &settled(&here));
        match differs.as_slice() {
            [] => println!("{}: the same verdicts on this machine", harmless(&record.name)),
            lines => println!("{}: {}", harmless(&record.name), harmless(&lines.join("; "))),
        }
    }
    Ok(())
}

/// Verdicts that are others in `here`.
fn differing(there: &Evidence, here: &Evidence) -> Vec<String> {
    let named = |check: &Check| {
        let held_back = if check.held_back { ", held back" } else { "" };
        format!("{}{held_back}", check.name())
    };
    let verdicts = |evidence: &Evidence| -> BTreeMap<String, &'static str> {
        let own = evidence.checks.iter();
        own.map(|check| (named(check), check.verdict.name())).collect()
    };
    let (there, here) = (verdicts(there), verdicts(here));
    // Findings that compare submissions of a class do not depend on the machine.
    let both = there.iter().filter_map(|(name, old)| Some((name, old, here.get(name)?)));
    let differ = both.filter(|(_, old, new)| old != new);
    differ.map(|(name, old, new)| format!("{name} is {old} there and {new} here")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{CheckId, Verdict};

    #[test]
    fn verdicts_that_differ_are_named() {
        let check = |verdict| Check::new(CheckId::ImageOffline, "cbox", verdict, "");
        let evidence = |verdict, held_back| Evidence {
            checks: vec![check(Verdict::Pass), Check { held_back, ..check(verdict) }],
        };
        let there = evidence(Verdict::Pass, true);
        assert_eq!(differing(&there, &there), [""; 0]);
        assert_eq!(
            differing(&there, &evidence(Verdict::Fail, true)),
            ["image.offline @ cbox, held back is pass there and fail here"]
        );
    }
}
