//! The instructor's decisions on points: parts set by hand, and confirmations. They are kept in `overrides.toml`, which
//! commands only append to: the last decision on an item counts.

use std::path::Path;

use anyhow::bail;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use toml::Spanned;

use super::matches::line_of;
use super::owners::Owners;
use crate::columns::{point_range, range};
use crate::evidence::Evidence;
use crate::files::hex;
use crate::plain_errors::toml_error;
use crate::rubric::{Grade, IMAGES_EARN, ONCE_CONFIRMED, PartGrade, Rules};

/// What takes the place of [`ONCE_CONFIRMED`] in the reason of a part whose images are confirmed.
const CONFIRMED: &str = ", confirmed by the instructor";

/// The file of decisions, in the report's folder.
pub const OVERRIDES: &str = "overrides.toml";

/// One decision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Decision {
    /// The student's number, account or name by the class list or the platform, or the submission's folder.
    pub student: String,
    /// The part that is set; none where what was left to the instructor is confirmed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<String>,
    /// Points of the part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<f64>,
    /// The fix as a unified diff, where the submission is mended.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patch: Option<String>,
    /// What the fix costs, in points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub penalty: Option<f64>,
    /// Why; the student reads it.
    pub reason: String,
    /// Who decided; left out where nobody knows.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub by: String,
    /// When, RFC 3339.
    #[serde(default)]
    pub when: String,
    /// What the evidence was then, as [`fingerprint`] says; empty where that does not matter.
    #[serde(default)]
    pub evidence: String,
}

/// All decisions, in the order in which they were made.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overrides(Vec<Entry>);

/// A decision in the file.
#[derive(Clone, Debug, PartialEq)]
struct Entry {
    decision: Decision,
    line: usize,
    /// The folders of the submissions that it is on; see [`Overrides::on`].
    slugs: Vec<String>,
    /// Why it is on none, if it is on none.
    unused: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OverridesFile {
    #[serde(default, rename = "override")]
    overrides: Vec<Spanned<Decision>>,
    #[serde(default, rename = "confirm")]
    confirmed: Vec<Spanned<Decision>>,
    #[serde(default, rename = "mend")]
    mended: Vec<Spanned<Decision>>,
}

/// A decision as it was applied.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Applied {
    /// The decision.
    pub decision: Decision,
    /// Points before it, least and most: of the part, or of the whole.
    pub before: [f64; 2],
    /// Points after it.
    pub after: [f64; 2],
    /// Whether the evidence has changed since it was made.
    pub stale: bool,
}

/// A submission, as far as decisions name one.
pub struct Subject<'a> {
    /// Its folder in the report.
    pub slug: &'a str,
    /// Digest of what was submitted.
    pub digest: &'a str,
    /// What was found out.
    pub evidence: &'a Evidence,
}

impl Overrides {
    /// Reads the text of a file of decisions.
    ///
    /// # Errors
    /// When it says what means nothing; names the file and line.
    pub fn parse(text: &str, path: &Path) -> anyhow::Result<Self> {
        let place = |at: usize| format!("{}:{}", path.display(), line_of(text, at));
        let file: OverridesFile =
            toml::from_str(text).map_err(|error| toml_error(&error, text, path))?;
        let mut decisions = Vec::new();
        let of = |kind: &'static str, entries: Vec<Spanned<Decision>>| {
            entries.into_iter().map(move |entry| (entry, kind))
        };
        for (entry, kind) in of("override", file.overrides)
            .chain(of("confirm", file.confirmed))
            .chain(of("mend", file.mended))
        {
            let at = entry.span().start;
            let decision = entry.into_inner();
            let place = place(at);
            let points = decision.points;
            let sets = kind == "override";
            if sets && (decision.part.is_none() || points.is_none()) {
                bail!("{place}: an override needs part = \"1.3\" and points = 15");
            }
            if !sets && (decision.part.is_some() || points.is_some()) {
                bail!("{place}: a confirmation has neither part nor points; use [[override]]");
            }
            let mends = [decision.patch.is_some(), decision.penalty.is_some()];
            if mends != [kind == "mend"; 2] {
                bail!("{place}: patch and penalty belong to [[mend]], and both of them");
            }
            if points
                .or(decision.penalty)
                .is_some_and(|points| !(points.is_finite() && points >= 0.0))
            {
                bail!("{place}: expected points of 0 or more");
            }
            if decision.reason.trim().is_empty() {
                bail!("{place}: expected a reason");
            }
            let line = line_of(text, at);
            decisions.push(Entry { decision, line, slugs: Vec::new(), unused: None });
        }
        decisions.sort_by_key(|entry| entry.line);
        Ok(Self(decisions))
    }

    /// Makes sure that all parts that are set are there, and worth that much. `path` is the file.
    ///
    /// # Errors
    /// When one is not; names the line.
    pub fn check(&self, rules: &Rules, path: &Path) -> anyhow::Result<()> {
        for Entry { decision, line, .. } in &self.0 {
            let (Some(id), Some(points)) = (&decision.part, decision.points) else { continue };
            let place = format!("{}:{line}", path.display());
            let Some(part) = rules.parts.iter().find(|part| part.id == *id) else {
                let ids: Vec<&str> = rules.parts.iter().map(|part| part.id.as_str()).collect();
                bail!("{place}: there is no part {id}; it has {}", ids.join(", "));
            };
            if points > part.points {
                bail!("{place}: part {id} is worth 0 to {} points, found {points}", part.points);
            }
        }
        Ok(())
    }

    /// What is decided, in its order.
    pub fn says(&self) -> Vec<&Decision> {
        self.0.iter().map(|entry| &entry.decision).collect()
    }

    /// The decisions with the submissions that they are on. What may mean submissions of two persons is on none.
    #[must_use]
    pub fn on(mut self, owners: &Owners) -> Self {
        for entry in &mut self.0 {
            let word = &entry.decision.student;
            let meant = owners.meant(word);
            let folders = owners.folders(&meant).join(", ");
            entry.unused = match (meant.is_empty(), owners.is_one(&meant)) {
                (true, _) => Some(match owners.listed_as(word) {
                    Some(who) => format!("{who} has no submission that is theirs for certain"),
                    None => format!("there is no submission of \"{word}\""),
                }),
                (_, false) => Some(format!(
                    "\"{word}\" may be more than one person, so it is on nobody; name a folder: {folders}"
                )),
                _ => None,
            };
            if entry.unused.is_none() {
                entry.slugs = owners.folders(&meant).into_iter().map(str::to_owned).collect();
            }
        }
        self
    }

    /// The decisions on a submission, in their order.
    fn of(&self, subject: &Subject) -> impl DoubleEndedIterator<Item = &Decision> {
        let is = |entry: &&Entry| entry.slugs.iter().any(|slug| slug == subject.slug);
        self.0.iter().filter(is).map(|entry| &entry.decision)
    }

    /// Decisions on submissions that are not there or do not count, or on parts that the assignment does not have, with
    /// their lines. `counts` says whether the submission in a folder counts.
    pub fn unused(&self, counts: impl Fn(&str) -> bool, parts: &[&str]) -> Vec<String> {
        let unused = self.0.iter().filter_map(|Entry { decision, line, slugs, unused }| {
            let part = decision.part.as_deref().filter(|part| !parts.contains(part));
            let said = if let Some(unused) = unused {
                unused.clone()
            } else if let Some(part) = part {
                format!("there is no part {part}; it has {}", parts.join(", "))
            } else if slugs.iter().any(|slug| counts(slug)) {
                return None;
            } else {
                format!("{} does not count", slugs.join(", "))
            };
            Some(format!("{OVERRIDES}:{line}: {said}"))
        });
        unused.collect()
    }

    /// The last fix of a submission, if there is one; of several attempts' fixes, that of this one.
    pub fn mend(&self, subject: &Subject) -> Option<&Decision> {
        let fixes = || self.of(subject).filter(|own| own.patch.is_some());
        fixes().rfind(|own| own.evidence == subject.digest).or_else(|| fixes().next_back())
    }

    /// Applies to a grade what was decided on its submission, and notes it in the remarks. Fixes are no matter of
    /// points.
    pub fn apply(&self, subject: &Subject, grade: &mut Grade) -> Vec<Applied> {
        let own: Vec<&Decision> = self.of(subject).filter(|own| own.patch.is_none()).collect();
        let last = own
            .iter()
            .enumerate()
            .filter(|(at, decision)| own[at + 1..].iter().all(|later| later.part != decision.part));
        let original = grade.parts.clone();
        let mut applied = Vec::new();
        for (_, &decision) in last {
            let (before, after, now) = match (&decision.part, decision.points) {
                (Some(id), Some(points)) => {
                    let Some(at) = original.iter().position(|part| part.id == *id) else {
                        continue;
                    };
                    let now = fingerprint(subject, &original[at..=at]);
                    (set(&mut grade.parts[at], points, decision), [points; 2], now)
                }
                _ => {
                    let before = totals(&grade.parts);
                    for part in &mut grade.parts {
                        part.points += part.unconfirmed;
                        part.points_max += part.unconfirmed;
                        part.unconfirmed = 0.0;
                        part.reason = part.reason.replacen(ONCE_CONFIRMED, CONFIRMED, 1);
                    }
                    // What was to be confirmed is.
                    for remark in &mut grade.remarks {
                        if let Some(at) = remark.find(IMAGES_EARN)
                            && remark.ends_with(ONCE_CONFIRMED)
                        {
                            remark.truncate(at);
                        }
                    }
                    (before, totals(&grade.parts), fingerprint(subject, &original))
                }
            };
            let stale = !decision.evidence.is_empty() && decision.evidence != now;
            applied.push(Applied { decision: decision.clone(), before, after, stale });
        }
        if !applied.is_empty() {
            [grade.points, grade.points_max] = totals(&grade.parts);
            grade.unconfirmed = rounded(grade.parts.iter().map(|part| part.unconfirmed).sum());
            grade.remarks.extend(applied.iter().map(Applied::words));
        }
        applied
    }
}

fn rounded(points: f64) -> f64 {
    (points * 100.0).round() / 100.0
}

/// The least and the most that parts are worth together.
fn totals(parts: &[PartGrade]) -> [f64; 2] {
    let sum = |of: fn(&PartGrade) -> f64| rounded(parts.iter().map(of).sum());
    [sum(|part| part.points), sum(|part| part.points_max)]
}

/// Sets a part by hand; answers what it was.
fn set(part: &mut PartGrade, points: f64, decision: &Decision) -> [f64; 2] {
    let before = [part.points, part.points_max];
    [part.points, part.points_max] = [points; 2];
    part.unconfirmed = 0.0;
    part.reason =
        format!("set by the instructor: {}; before that: {}", decision.reason, part.reason);
    before
}

impl Decision {
    /// By whom and when, in brackets.
    pub fn who(&self) -> String {
        let day = self.when.get(..10).unwrap_or_default();
        let who = [self.by.as_str(), day].into_iter().filter(|text| !text.is_empty());
        let who = who.collect::<Vec<_>>().join(", ");
        if who.is_empty() { who } else { format!(" ({who})") }
    }
}

impl Applied {
    /// The decision in a sentence, for both reports.
    pub fn words(&self) -> String {
        let Decision { part, reason, .. } = &self.decision;
        let who = self.decision.who();
        match part {
            Some(part) => format!(
                "part {part} was set by the instructor to {} instead of {}: {reason}{who}",
                point_range(self.after),
                range(self.before)
            ),
            None if self.after == self.before => {
                format!("the instructor looked at it and confirms the points: {reason}{who}")
            }
            None => format!(
                "the instructor confirms what the images show, {} instead of {}: {reason}{who}",
                point_range(self.after),
                range(self.before)
            ),
        }
    }
}

/// Digest of everything that a decision on some parts depends on: the submission, and the evidence for these parts.
pub fn fingerprint(subject: &Subject, parts: &[PartGrade]) -> String {
    let mut hash = Sha256::new();
    hash.update(subject.digest);
    for part in parts {
        hash.update(format!(
            "\n{} {} {} {}",
            part.id, part.points, part.points_max, part.unconfirmed
        ));
        let decides = |name: &str| part.evidence.iter().any(|own| own == name);
        let checks = subject.evidence.checks.iter();
        let mut lines: Vec<String> = checks
            .filter(|check| decides(&check.name()))
            // With the digits that are published: the last bits of a sum do not matter.
            .map(|check| {
                format!(
                    "{} {} {:?} {:.5e}",
                    check.name(),
                    check.held_back,
                    check.verdict,
                    check.error
                )
            })
            .collect();
        lines.sort();
        hash.update(lines.join("\n"));
    }
    hex(&hash.finalize())[..16].to_owned()
}

/// A decision as the lines that are added to the file.
///
/// # Errors
/// When a text cannot be written as TOML.
pub fn entry(decision: &Decision) -> anyhow::Result<String> {
    let name = match (&decision.part, &decision.patch) {
        (_, Some(_)) => "mend",
        (Some(_), None) => "override",
        (None, None) => "confirm",
    };
    Ok(format!("\n[[{name}]]\n{}", toml::to_string(decision)?))
}

#[cfg(test)]
mod tests;
