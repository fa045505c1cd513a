//! `umbra defend`: why a part has its points, for an appeal.

use std::path::Path;

use anyhow::Context as _;

use super::assemble::KeptReport;
use super::chosen::one;
use super::context::Context;
use super::location::Location;
use super::outputs::at_root;
use super::report_folder::ReportFolder;
use super::{EXIT_OK, class, terminal};
use crate::class::overrides::Subject;
use crate::held_back::in_words;
use crate::program::graded;
use crate::report::{self, Look, SubmissionReport};
use crate::rubric::{self, Rules};

/// Options of `umbra defend`.
#[derive(clap::Args)]
pub struct DefendArguments {
    /// Student number, name, or the submission's folder in the report
    student: String,
    /// The part, such as 1.3
    part: String,
    #[command(flatten)]
    report: ReportFolder,
}

/// Prints the evidence, its bounds, how to reproduce it, and what a right part would have earned.
///
/// # Errors
/// When there is no such part or student in the report, or the submission does not count.
pub fn run(arguments: &DefendArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let DefendArguments { student, part, report: ReportFolder { path: output } } = arguments;
    let kept = KeptReport::read(output)?;
    let decided = kept.decided()?;
    let chosen = one(student, output, &kept)?;
    let slug = chosen.entry.record.slug.clone();
    let settled = kept.report(output, decided)?;
    let report = &settled.report;
    let entry = report.entries.iter().find(|entry| entry.record.slug == slug);
    let entry = entry.with_context(|| chosen.not_counting(report).unwrap_or_default())?;
    let entry = &mut settled.whole(entry)?;
    let is_mended = entry.standing.mended.as_ref().is_some_and(|mended| mended.counts);
    let mended = class::mended_record(output, &slug)?.filter(|_| is_mended);
    if let Some(mended) = &mended {
        // The points are those of the mended source, so its evidence belongs to them.
        entry.record.evidence = rubric::settle(&report.rules, &mended.evidence);
    }
    let look = Look { width: terminal::width(), colors: terminal::colors() };
    let text = report::defend(report, entry, part, look).map_err(anyhow::Error::msg)?;
    print!("{text}");
    // How to see it again.
    println!("\nTo reproduce it");
    println!("  the student, on public scenes:  umbra check DIR --part {part}");
    let source = class::mended(output, &slug).join(report::MENDED_SOURCE);
    let location = match &mended {
        Some(_) => Location::Here(source.canonicalize().unwrap_or(source)),
        None => Location::of(output, &slug),
    };
    let seed = in_words(report.held_back.as_ref().map(|own| own.seed));
    println!(
        "  the instructor, on all:  umbra grade {} --held-back {seed} --report ANOTHER{}",
        location.arguments(),
        at_root(root)
    );
    if let Location::Gone(place) = &location {
        println!("  (SUBMISSION: it was graded from {}, where it is no more)", place.display());
    }
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
    if let Some(mend) = mend {
        let with = with_part_right(&kept, output, &report.rules, entry, part, mend.penalty)?;
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

/// What a settled submission would be worth, had a mend made a part right: after the instructor's decisions, the
/// mend's penalty and lateness, as [`KeptReport::report`] settles it.
fn with_part_right(
    kept: &KeptReport,
    output: &Path,
    rules: &Rules,
    entry: &SubmissionReport,
    part: &str,
    penalty: f64,
) -> anyhow::Result<f64> {
    let record = &entry.record;
    let mut grade = graded(record.clone(), rules).grade;
    let full = grade.parts.iter().find(|own| own.id == part).map_or(0.0, |own| own.out_of);
    // A fix of the source opens no gate, such as that of a wrong tree.
    grade.set_part(part, full * rubric::ceiling(rules, &record.evidence));
    let claims = kept.claims(output);
    let decided = kept.decided()?;
    let overrides = decided.overrides(output)?.on(&kept.owners(&claims, output)?);
    let subject =
        Subject { slug: &record.slug, digest: &record.digest, evidence: &record.evidence };
    overrides.apply(&subject, &mut grade);
    grade.points = (grade.points_max - penalty).max(0.0);
    grade.points_max = grade.points;
    if let (Some(policy), Some(late)) = (&decided.assignment.late, &entry.standing.late) {
        policy.charge(&mut late.clone(), &mut grade);
    }
    Ok(grade.points)
}
