//! Which of a student's attempts counts.

use std::collections::{BTreeMap, BTreeSet};

use super::claim::Claim;
use super::layout::{Label, Platform, canvas_upload};
use super::stamps;
use super::standing::{Attempt, Deciding, Standing};
use crate::rubric::Grade;

/// Which attempts of a student need not be graded, by index: those that the platform's names alone tell do not
/// count. The best attempt is known only when all are graded; so is whether a late one costs points that another has,
/// as `is_late` says of a time stamp.
pub fn set_aside(
    labels: &[Option<&Label>],
    attempt: Attempt,
    is_late: impl Fn(&str) -> bool,
) -> BTreeSet<usize> {
    let mut people: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (index, label) in labels.iter().enumerate() {
        if let Some(label) = label {
            people.entry(label.person()).or_default().push(index);
        }
    }
    let mut aside = BTreeSet::new();
    for attempts in people.into_values() {
        let stamps: Vec<&str> = attempts
            .iter()
            .map(|&at| labels[at].map_or("", |label| label.submitted.as_str()))
            .collect();
        let counts = by_time(&stamps, attempt).filter(|_| attempt != Attempt::Best);
        if let Some(counts) = counts.filter(|at| !is_late(stamps[*at])) {
            aside.extend(
                attempts.iter().enumerate().filter(|(at, _)| *at != counts).map(|(_, own)| *own),
            );
        }
    }
    aside
}

/// The first or last of some time stamps; `None` if that is not certain.
fn by_time(stamps: &[&str], attempt: Attempt) -> Option<usize> {
    let zone = jiff::tz::TimeZone::UTC;
    let mut times = stamps
        .iter()
        .enumerate()
        .map(|(at, stamp)| Some((stamps::instant(stamp, &zone)?, at)))
        .collect::<Option<Vec<_>>>()?;
    times.sort();
    if attempt != Attempt::First {
        times.reverse();
    }
    match times[..] {
        [(_, only)] => Some(only),
        [(first, at), (second, _), ..] if first != second => Some(at),
        _ => None,
    }
}

/// The attempt that counts; `None` if that is not certain.
pub(super) fn choose(
    attempts: &[usize],
    claims: &[Claim],
    standings: &[Standing],
    grades: &[Grade],
    deciding: &Deciding,
) -> Option<usize> {
    if let [only] = attempts {
        return Some(*only);
    }
    // The one that the instructor names as the student's.
    let mut named =
        attempts.iter().copied().filter(|at| deciding.matches.word(&claims[*at]).is_some());
    let (named, is_alone) = (named.next(), named.next().is_none());
    if named.is_some() && is_alone {
        return named;
    }
    if deciding.attempt == Attempt::Best {
        let most = |at: &&usize| grades[**at].points_max;
        return attempts.iter().rev().max_by(|a, b| most(a).total_cmp(&most(b))).copied();
    }
    let stamps: Vec<&str> =
        attempts.iter().map(|at| stamp(&claims[*at], &standings[*at], deciding)).collect();
    let digest = |at: &usize| claims[*at].digest.as_str();
    let first = &attempts[0];
    let alike = !digest(first).is_empty()
        && attempts.iter().all(|at| digest(at) == digest(first))
        && stamps.iter().all(|stamp| *stamp == stamps[0]);
    by_time(&stamps, deciding.attempt).map(|at| attempts[at]).or_else(|| {
        let uploads: Option<Vec<(u64, String)>> =
            attempts.iter().map(|at| upload(&claims[*at])).collect();
        let by_upload = |uploads: &[(u64, String)]| {
            let all = uploads.iter().zip(attempts);
            let chosen = match deciding.attempt {
                Attempt::First => all.min_by_key(|(own, _)| own.0),
                _ => all.max_by_key(|(own, _)| own.0),
            };
            chosen.map(|(_, at)| *at)
        };
        // Which of two that are the same counts does not matter; Canvas takes feedback on the newer one.
        if alike {
            return uploads.as_deref().and_then(by_upload).or(Some(*first));
        }
        if named.is_some() {
            return None;
        }
        // One file of Canvas, submitted again: its numbers there tell. Others may be files of one attempt.
        let uploads = uploads?;
        let one_file = uploads.iter().all(|own| own.1 == uploads[0].1);
        one_file.then(|| by_upload(&uploads)).flatten()
    })
}

/// Of a file from Canvas, its number there and its name.
fn upload(claim: &Claim) -> Option<(u64, String)> {
    claim.label.as_ref().filter(|label| label.kind == Platform::Canvas)?;
    canvas_upload(claim.name.rsplit('/').next()?)
}

/// When a submission was submitted: as the instructor says, else the platform's names, else the class list.
pub(super) fn stamp<'a>(
    claim: &'a Claim,
    standing: &'a Standing,
    deciding: &'a Deciding,
) -> &'a str {
    let label = claim.label.as_ref().map(|label| label.submitted.as_str());
    let listed = standing.student.as_ref().map(|student| student.submitted.as_str());
    let said = deciding.matches.submitted(claim).into_iter().chain(label).chain(listed);
    said.into_iter().find(|stamp| !stamp.is_empty()).unwrap_or_default()
}
