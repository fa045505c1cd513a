//! The submission that an instructor's word means, in a report.

use std::path::Path;

use anyhow::{bail, ensure};

use super::assemble::KeptReport;
use crate::class::overrides::Subject;
use crate::report::{BatchReport, SubmissionReport, harmless};

/// A submission of a report, as it was kept.
pub struct Graded {
    /// What it is worth before anything is decided.
    pub entry: SubmissionReport,
    /// By what decisions name it.
    pub key: String,
    /// The folders of all attempts of the same person.
    attempts: Vec<String>,
}

impl Graded {
    /// What decisions are on.
    pub fn subject(&self) -> Subject<'_> {
        let record = &self.entry.record;
        Subject { slug: &record.slug, digest: &record.digest, evidence: &record.evidence }
    }

    /// Why a report shows nothing of it, if it does not count there.
    pub fn not_counting(&self, report: &BatchReport) -> Option<String> {
        let counts = |slug: &String| report.entries.iter().any(|own| own.record.slug == *slug);
        let slug = &self.entry.record.slug;
        let others: Vec<&str> =
            self.attempts.iter().filter(|own| counts(own)).map(String::as_str).collect();
        let words = match others[..] {
            [] => format!("the submission {slug} does not count"),
            _ => format!("the submission {slug} does not count, {} does", others.join(", ")),
        };
        (!counts(slug)).then(|| harmless(&words))
    }
}

/// The one submission of a student in a report. Of several attempts, a number or a name means the one that counts.
///
/// # Errors
/// When there is none, when several students are called so, and when it is open which attempt counts.
pub fn one(wanted: &str, output: &Path, kept: &KeptReport) -> anyhow::Result<Graded> {
    let claims = kept.claims(output);
    let owners = kept.owners(&claims, output)?;
    let meant = owners.meant(wanted);
    let report = kept.report(output, kept.decided()?)?.report;
    let counts = |at: &usize| report.entries.iter().any(|own| own.record.slug == claims[*at].slug);
    let counting: Vec<usize> = meant.iter().copied().filter(counts).collect();
    let at = match (&meant[..], &counting[..]) {
        ([at], _) => *at,
        ([], _) => {
            if let Some(who) = owners.listed_as(wanted) {
                let undecided = report.class.is_some_and(|class| {
                    class.undecided.iter().any(|own| {
                        own.candidates.is_empty()
                            || own
                                .candidates
                                .iter()
                                .any(|student| owners.listed_is(wanted, student))
                    })
                });
                ensure!(undecided, "{}: {who} has no submission", output.display());
                bail!(
                    "{}: {who} has no submission that is theirs for certain; hint: decide in matches.toml whose it \
                     is, or name the submission's folder",
                    output.display()
                );
            }
            let first = claims.first().map_or("a2_ada_lampglow", |claim| &claim.slug);
            bail!(
                "nobody in {} is \"{wanted}\"; expected a student number, a name, or a submission's folder such as \
                 {first}",
                output.display()
            )
        }
        (several, _) if !owners.is_one(several) => bail!(
            "{} submissions are \"{wanted}\"; name the folder of one: {}",
            several.len(),
            owners.folders(several).join(", ")
        ),
        (_, [at]) => *at,
        (several, []) => bail!(
            "\"{wanted}\" has {} attempts, and none of them counts; name the folder of one: {}",
            several.len(),
            owners.folders(several).join(", ")
        ),
        (_, open) => bail!(
            "\"{wanted}\" has {} attempts, and which of them counts is not decided; hint: decide in matches.toml, or \
             name the folder of one: {}",
            open.len(),
            owners.folders(open).join(", ")
        ),
    };
    let attempts = owners.folders(&owners.attempts(at)).into_iter().map(str::to_owned).collect();
    let mut entry = kept.graded(output, &claims[at].slug)?;
    // Messages name the student as all reports do.
    entry.standing.student = owners.student(at).cloned();
    Ok(Graded { entry, key: owners.key(at, wanted), attempts })
}
