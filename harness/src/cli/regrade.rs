//! `umbra regrade`: recomputes the grades of a class under other rules, policies, matches or overrides.

use std::path::Path;

use anyhow::Context as _;

use super::assemble::{self, KeptReport};
use super::changes::{changes, summary};
use super::context::Context;
use super::report_folder::ReportFolder;
use crate::class::overrides::OVERRIDES;
use crate::class::pins::Change;
use crate::class::{Decisions, MATCHES, Stated};
use crate::columns::{left, right};
use crate::files::write_whole;
use crate::report::harmless;

/// Options of `umbra regrade`.
#[derive(clap::Args)]
pub struct RegradeArguments {
    /// Write the new points into the reports, and keep the change with its time and reason
    #[arg(long, requires = "reason")]
    apply: bool,
    /// Undo the last applied change and restore `matches.toml` and `overrides.toml`
    #[arg(long, conflicts_with = "apply")]
    undo: bool,
    /// The reason, kept with the change
    #[arg(long, value_name = "TEXT")]
    reason: Option<String>,
    #[command(flatten)]
    report: ReportFolder,
}

/// Shows what changes; applies it where that is asked.
///
/// # Errors
/// When there is no report, a change means nothing, or it cannot be kept.
pub fn regrade(arguments: &RegradeArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let RegradeArguments { apply, undo, reason, report: ReportFolder { path: output } } = arguments;
    let reason = reason.as_deref().map(str::trim);
    anyhow::ensure!(reason != Some(""), "--reason: expected a reason, found nothing");
    let kept = KeptReport::read(output)?;
    let (_lock, mut kept) = match *apply || *undo {
        true => kept.locked(output).map(|(lock, kept)| (Some(lock), kept))?,
        false => (None, kept),
    };
    let current = kept.pins.current().context("nothing is pinned")?.clone();
    println!(
        "settled by change {} of {}: {}",
        current.number,
        current.when,
        harmless(&current.reason)
    );
    let decided = if *undo {
        let read =
            Decisions::read(output, current.decided.assignment.clone(), current.decided.attempt)?;
        let edited = read.differs(&current.decided, output)?;
        anyhow::ensure!(
            edited.is_empty(),
            "{}: --undo would lose what {} says by now and no report shows; hint: --apply it, or take it out of the file",
            output.display(),
            edited.join(" and ")
        );
        kept.pins.before()?.decided.clone()
    } else {
        let stated = Stated::from(&Context::assignment(root)?);
        anyhow::ensure!(
            stated.name == current.decided.assignment.name,
            "{} is a report of assignment \"{}\", not \"{}\"; hint: --root",
            output.display(),
            current.decided.assignment.name,
            stated.name
        );
        let decided = Decisions::read(output, stated, current.decided.attempt)?;
        decided.check(output)?;
        decided
    };
    let differs = decided.differs(&current.decided, output)?;
    let before = kept.report(output, &current.decided)?;
    if differs.is_empty() && !undo {
        println!("config.json, {MATCHES} and {OVERRIDES} say what is pinned: nothing changes");
        if *apply {
            assemble::write(output, &before)?;
        }
        return Ok(super::EXIT_OK);
    }
    println!("what differs: {}", differs.join(", "));
    let after = kept.report(output, &decided)?;
    print!("{}", table(&changes(&before.report, &after.report)));
    println!("{}", summary(&before.report, &after.report));
    for line in after.report.class.iter().flat_map(|class| &class.unused) {
        println!(
            "warning: decision on a submission that is not in this report or does not count: {}",
            harmless(line)
        );
    }
    if *undo {
        let undone = kept.pins.undone().map(|pin| pin.reason.clone()).unwrap_or_default();
        // The files first: a change that is applied without them would come back with the next run.
        for (name, text, old) in [
            (MATCHES, &decided.matches, &current.decided.matches),
            (OVERRIDES, &decided.overrides, &current.decided.overrides),
        ] {
            let file = output.join(name);
            if text != old {
                write_whole(&file, text.as_bytes())
                    .with_context(|| format!("cannot write {}", file.display()))?;
            }
        }
        let reason = reason.map_or_else(|| format!("undone: {undone}"), str::to_owned);
        kept.apply(output, decided, &reason, true)?;
        println!("undone; the reports are written");
    } else if *apply {
        kept.apply(output, decided, reason.unwrap_or_default(), false)?;
        println!("applied; the reports are written, and --undo takes it back");
    } else {
        println!("nothing is written; --apply --reason TEXT does");
    }
    Ok(super::EXIT_OK)
}

/// Old and new points, a line for each part and total that changes.
fn table(changes: &[Change]) -> String {
    let points = |range: Option<[f64; 2]>| match range {
        None => "-".to_owned(),
        Some([least, most]) if least == most => least.to_string(),
        Some([least, most]) => format!("{least}..{most}"),
    };
    let mut rows = vec![["student", "part", "old", "new"].map(str::to_owned)];
    for (at, Change { slug, who, part, before, after }) in changes.iter().enumerate() {
        let first = at == 0 || (&changes[at - 1].slug, &changes[at - 1].who) != (slug, who);
        let who = if first { harmless(who) } else { String::new() };
        let part = if part.is_empty() { "total".to_owned() } else { harmless(part) };
        rows.push([who, part, points(*before), points(*after)]);
    }
    if rows.len() == 1 {
        return String::new();
    }
    use unicode_width::UnicodeWidthStr as _;
    let width = |column: usize| rows.iter().map(|row| row[column].width()).max().unwrap_or(0);
    let widths = [width(0), width(1), width(2), width(3)];
    let line = |[who, part, old, new]: &[String; 4]| {
        format!(
            "{}  {}  {}  {}\n",
            left(who, widths[0]),
            left(part, widths[1]),
            right(old, widths[2]),
            right(new, widths[3])
        )
    };
    rows.iter().map(line).collect()
}
