//! Adds the results of earlier runs into the same report, for submissions that this run did not grade.

use std::collections::HashSet;
use std::path::Path;

use super::class::{folders, some, who};
use super::found::BatchIndex;
use crate::columns::count;
use crate::grading::{Record, RecordCache, StoredRecord};
use crate::report;

/// Adds to `records`, made of some of the submissions that were found, what earlier runs into the same report
/// found out about others, and says so.
pub fn join(output: &Path, found: &BatchIndex, records: &mut Vec<StoredRecord>) {
    let graded: HashSet<String> = records.iter().map(|own| own.record.slug.clone()).collect();
    let mut gone = Vec::new();
    let before = BatchIndex::read(output).ok().flatten().unwrap_or_default();
    found.name(records);
    let slugs = |aside: bool| -> HashSet<&str> {
        let own = found.seen.iter().filter(|seen| seen.aside == aside && seen.empty.is_empty());
        own.map(|seen| seen.slug.as_str()).collect()
    };
    let (mut missing, aside) = (slugs(false), slugs(true));
    missing.retain(|slug| !graded.contains(*slug));
    for slug in folders(output) {
        let instructor = output.join(report::INSTRUCTOR).join(&slug);
        if graded.contains(&slug) {
            continue;
        }
        let earlier = match RecordCache::earlier(&instructor, &found.conditions) {
            Ok(Some(earlier)) => named(earlier, &before),
            Ok(None) => continue,
            Err(error) => {
                eprintln!("umbra: {} is skipped: {}", slug, super::told_once(&error));
                continue;
            }
        };
        let record = &earlier.record;
        let is_given = missing.remove(slug.as_str()) || aside.contains(slug.as_str());
        if !is_given && let Some(new) = records.iter().find(|new| is_newer(&new.record, record)) {
            match RecordCache::replace(&instructor) {
                Ok(()) => eprintln!(
                    "umbra: {} of {} is graded again as {}: it replaces the one in {}",
                    record.name,
                    who(&record.student),
                    new.record.slug,
                    instructor.display()
                ),
                Err(error) => eprintln!("umbra: {}: {error}", instructor.display()),
            }
            continue;
        }
        if !is_given {
            gone.push(record.name.clone());
        }
        records.push(earlier);
    }
    if !gone.is_empty() {
        let stay = if gone.len() == 1 { "stays" } else { "stay" };
        eprintln!(
            "umbra: {} {stay} in {} from earlier runs: {}; to remove one, delete its folder in {}",
            count(gone.len(), "submission"),
            output.display(),
            some(&gone),
            output.join(report::INSTRUCTOR).display()
        );
    }
    if !missing.is_empty() {
        let mut missing: Vec<String> = missing.into_iter().map(str::to_owned).collect();
        missing.sort();
        let are = if missing.len() == 1 { "is" } else { "are" };
        eprintln!(
            "umbra: {} {are} not graded yet, and not in the report: {}",
            count(missing.len(), "submission"),
            some(&missing)
        );
    }
}

/// A record under the name that reports call it by.
fn named(earlier: StoredRecord, before: &BatchIndex) -> StoredRecord {
    let mut own = [earlier];
    before.name(&mut own);
    let [earlier] = own;
    earlier
}

/// Whether `new` resubmits `old`: the same file name, by the same student.
fn is_newer(new: &Record, old: &Record) -> bool {
    let (a, b) = (&new.student, &old.student);
    let same = if a.id.is_empty() && b.id.is_empty() {
        !a.full_name().is_empty() && a.full_name() == b.full_name()
    } else {
        a.id.trim() == b.id.trim()
    };
    same && new.name == old.name
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grading::Student;
    use crate::report::sample;

    #[test]
    fn the_same_file_of_the_same_student_is_submitted_again() {
        let record = sample::report().entries.remove(0).record;
        assert!(is_newer(&record, &record));
        let with = |name: &str, id: &str, last: &str| {
            let mut other = record.clone();
            other.name = name.into();
            other.student.id = id.into();
            other.student.last_name = last.into();
            other
        };
        assert!(!is_newer(&record, &with("b.zip", "260000001", "Lampglow")));
        assert!(!is_newer(&record, &with("a2_ada.zip", "260000009", "Lampglow")));
        let (a, b) = (with("a.zip", "", "Lampglow"), with("a.zip", "", "Dimmoor"));
        assert!(is_newer(&a, &a) && !is_newer(&a, &b));
        let nobody = Record { student: Student::default(), ..a };
        assert!(!is_newer(&nobody, &nobody));
    }
}
