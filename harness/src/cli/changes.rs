//! What is other in one report of a class than in another, by student.

use std::collections::BTreeMap;

use crate::class::Label;
use crate::class::pins::Change;
use crate::columns::count;
use crate::report::{BatchReport, SubmissionReport};

/// A student's submission that counts, before and after.
type Pair<'a> = [Option<&'a SubmissionReport>; 2];

/// Whose a submission is: a student of the class list, else whom the platform names, else nobody else's.
fn person(own: &SubmissionReport) -> String {
    match (&own.standing.student, &own.standing.label) {
        (Some(student), _) => format!("on the list {} {}", student.line, student.who()),
        (None, Some(label)) => label.person(),
        (None, None) => own.record.slug.clone(),
    }
}

/// The submissions of two reports by student: the same submission in both, else another one of theirs.
fn pairs<'a>(before: &'a BatchReport, after: &'a BatchReport) -> Vec<Pair<'a>> {
    let reports = [before, after];
    let mut people: BTreeMap<String, [Vec<&SubmissionReport>; 2]> = BTreeMap::new();
    for (side, report) in reports.into_iter().enumerate() {
        for entry in &report.entries {
            people.entry(person(entry)).or_default()[side].push(entry);
        }
    }
    let mut pairs: Vec<Pair> = Vec::new();
    for [old, mut new] in people.into_values() {
        let mut left = Vec::new();
        for old in old {
            match new.iter().position(|own| own.record.slug == old.record.slug) {
                Some(at) => pairs.push([Some(old), Some(new.remove(at))]),
                None => left.push(old),
            }
        }
        let all = left.len().max(new.len());
        pairs.extend((0..all).map(|at| [left.get(at).copied(), new.get(at).copied()]));
    }
    // Of one that is a student's on the other side, only the student gains or loses.
    let is_theirs = |own: &SubmissionReport, other: &BatchReport| {
        let label = own.standing.label.as_ref().map(Label::person);
        own.standing.student.is_none()
            && other.entries.iter().any(|other| {
                let same =
                    label.is_some() && other.standing.label.as_ref().map(Label::person) == label;
                same || other.record.slug == own.record.slug
            })
    };
    pairs.retain(|pair| match pair {
        [Some(old), None] => !is_theirs(old, after),
        [None, Some(new)] => !is_theirs(new, before),
        _ => true,
    });
    pairs.sort_by_key(|[old, new]| new.or(*old).map(|own| own.record.slug.to_lowercase()));
    pairs
}

/// Points that are others in `after`, by student and part.
pub fn changes(before: &BatchReport, after: &BatchReport) -> Vec<Change> {
    let mut changes = Vec::new();
    for [old, new] in pairs(before, after) {
        let Some(own) = new.or(old) else { continue };
        let (slug, who) = (&own.record.slug, own.who());
        let mut add = |part: &str, before: Option<[f64; 2]>, after: Option<[f64; 2]>| {
            if before != after {
                let (slug, part, who) = (slug.clone(), part.to_owned(), who.clone());
                changes.push(Change { slug, who, part, before, after });
            }
        };
        if let (Some(old), Some(new)) = (old, new) {
            let ids = old.grade.parts.iter().chain(&new.grade.parts).map(|part| part.id.as_str());
            let mut ids: Vec<&str> = ids.collect();
            ids.sort_unstable();
            ids.dedup();
            for id in ids {
                let points = |own: &SubmissionReport| {
                    let part = own.grade.parts.iter().find(|part| part.id == id);
                    part.map(|part| [part.points, part.points_max])
                };
                add(id, points(old), points(new));
            }
        }
        let total = |own: Option<&SubmissionReport>| {
            own.map(|own| [own.grade.points, own.grade.points_max])
        };
        add("", total(old), total(new));
    }
    changes
}

/// How many students rise and fall.
pub fn summary(before: &BatchReport, after: &BatchReport) -> String {
    let total = |own: &SubmissionReport| own.grade.points + own.grade.points_max;
    let (mut rise, mut fall, mut stay, mut new, mut gone) = (0, 0, 0, 0, 0);
    for pair in pairs(before, after) {
        match pair.map(|own| own.map(total)) {
            [Some(old), Some(now)] if now > old => rise += 1,
            [Some(old), Some(now)] if now < old => fall += 1,
            [Some(_), Some(_)] => stay += 1,
            [None, _] => new += 1,
            [Some(_), None] => gone += 1,
        }
    }
    let mut words = format!(
        "{}: {rise} rise, {fall} fall, {stay} stay",
        count(after.entries.len(), "submission")
    );
    if new > 0 {
        words += &format!(", {new} more now count");
    }
    if gone > 0 {
        words += &format!(", {gone} no longer count");
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::class::ListedStudent;
    use crate::report::sample;

    /// A report of one submission for each student of a class list, by number, with its points.
    fn report(all: &[(&str, u32, f64)]) -> BatchReport {
        let mut report = sample::report();
        let entry = report.entries.remove(0);
        let own = |(slug, number, points): &(&str, u32, f64)| {
            let mut own = entry.clone();
            own.record.slug = (*slug).to_owned();
            let number = number.to_string();
            own.standing.student = (number != "0").then(|| ListedStudent {
                first_name: format!("S{number}"),
                number,
                ..ListedStudent::default()
            });
            own.grade.parts.clear();
            (own.grade.points, own.grade.points_max) = (*points, *points);
            own
        };
        report.entries = all.iter().map(own).collect();
        report
    }

    #[test]
    fn who_gains_and_who_loses_is_told_by_student() {
        let before = [("a", 1, 52.0), ("b", 2, 0.0), ("c", 3, 9.0)];
        for (after, expected, words) in [
            // Another student's who had one, had none, and nobody's.
            (
                vec![("a", 2, 65.0), ("c", 3, 9.0)],
                vec!["S1 (a) 52 -", "S2 (a) 0 65"],
                "1 rise, 0 fall, 1 stay, 1 no longer count",
            ),
            (
                vec![("a", 4, 65.0), ("b", 2, 0.0), ("c", 3, 9.0)],
                vec!["S1 (a) 52 -", "S4 (a) - 65"],
                "0 rise, 0 fall, 2 stay, 1 more now count, 1 no longer count",
            ),
            (
                vec![("b", 2, 0.0), ("c", 3, 9.0)],
                vec!["S1 (a) 52 -"],
                "0 rise, 0 fall, 2 stay, 1 no longer count",
            ),
            // Two that change places, and another attempt.
            (
                vec![("a", 2, 52.0), ("b", 1, 0.0), ("c2", 3, 8.0)],
                vec!["S2 (a) 0 52", "S1 (b) 52 0", "S3 (c2) 9 8"],
                "1 rise, 2 fall, 0 stay",
            ),
            // Whose it is must be decided again.
            (
                vec![("a", 0, 52.0), ("b", 2, 0.0), ("c", 3, 9.0)],
                vec!["S1 (a) 52 -"],
                "0 rise, 0 fall, 2 stay, 1 no longer count",
            ),
        ] {
            let (before, after) = (report(&before), report(&after));
            let points =
                |own: Option<[f64; 2]>| own.map_or("-".to_owned(), |own| own[0].to_string());
            let line =
                |own: &Change| format!("{} {} {}", own.who, points(own.before), points(own.after));
            let found: Vec<String> = changes(&before, &after).iter().map(line).collect();
            assert_eq!(found, expected);
            assert!(summary(&before, &after).ends_with(words), "{}", summary(&before, &after));
            // The other way round, each gains what they lost.
            let back = summary(&after, &before);
            assert_eq!(back.contains("more now"), words.contains("no longer"), "{back}");
        }
    }
}
