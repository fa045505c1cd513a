//! `umbra defend`: why a part has its points, for an appeal.

use std::path::Path;

use anyhow::Context as _;

use super::assemble::Kept;
use super::context::Context;
use super::decide::one;
use super::report_folder::ReportFolder;
use super::{EXIT_OK, class, terminal};
use crate::report::{self, Look};

/// Options of `umbra defend`.
#[derive(clap::Args)]
pub struct DefendArguments {
    /// Whose: a student number, a name, or the submission's folder in the report
    student: String,
    /// The part, such as 1.3
    part: String,
    #[command(flatten)]
    report: ReportFolder,
}

/// Prints the evidence, its bounds, how to reproduce it, and what a right part would have earned.
pub fn run(arguments: &DefendArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let DefendArguments { student, part, report: ReportFolder { path: output } } = arguments;
    let kept = Kept::read(output)?;
    let decided = kept.decided()?;
    let slug = one(student, output, &kept)?.entry.record.slug;
    let settled = kept.report(output, decided)?;
    let report = &settled.report;
    let entry = report.entries.iter().find(|entry| entry.record.slug == slug).with_context(|| {
        format!("the submission {slug} does not count; `umbra status` and report.html say which does")
    })?;
    let entry = &settled.whole(entry)?;
    let look = Look { width: terminal::width(), colours: terminal::colours() };
    let text = report::defend(report, entry, part, look).map_err(anyhow::Error::msg)?;
    print!("{text}");
    // How to see it again.
    println!("\nTo reproduce it");
    println!("  the student, on public scenes:  umbra check DIR --part {part}");
    let source = class::place_of(output, &slug).unwrap_or_else(|| "SUBMISSION".to_owned());
    let seed = report.held_back.as_ref().map_or("off".to_owned(), |own| own.seed.to_string());
    println!(
        "  the instructor, on all:  umbra grade \"{source}\" --perturb {seed} --report ANOTHER"
    );
    match (report.held_back.is_some(), report.released) {
        (false, _) => {}
        (true, true) => println!(
            "  the student, on the scenes that were held back:  umbra render with a scene of {}",
            output.join("held-back-scenes.zip").display()
        ),
        (true, false) => {
            println!("  scenes are held back from the student until `umbra release`");
        }
    }
    let mend = Context::assignment(root).ok().and_then(|assignment| assignment.mend);
    if let (Some(mend), Some(own)) = (mend, entry.grade.parts.iter().find(|own| own.id == *part)) {
        let with = entry.grade.points_max - own.points_max + own.out_of - mend.penalty;
        println!(
            "\nMended\n  with this part right, `umbra mend` would give {:.2} points instead of {:.2} (at most {} lines, less {} \
             points), never fewer",
            with.max(entry.grade.points),
            entry.grade.points,
            mend.lines,
            mend.penalty
        );
    }
    Ok(EXIT_OK)
}
