//! Outlines of submissions: the part of a record that the class pages read. Only outlines of all submissions are in
//! memory at the same time.

use std::collections::HashSet;

use super::SubmissionReport;
use super::html::{is_read_by_class, says_its_mistake};
use crate::diagnosis::Diagnosis;
use crate::evidence::{Check, CheckId};
use crate::grading::INTERNAL_ERROR;
use crate::intake::Finding;

/// An entry with what the files of the class are made from, `report.json` and the pages of submissions left out: of its
/// checks those that they read, and the first of each kind and mistake.
pub fn outline(mut entry: SubmissionReport) -> SubmissionReport {
    let mut kinds: HashSet<(CheckId, bool, String)> = HashSet::new();
    let record = &mut entry.record;
    let checks = std::mem::take(&mut record.evidence.checks).into_iter().filter(|check| {
        let mistake = Some(&check.mistake).filter(|_| says_its_mistake(check));
        let mistake = mistake.cloned().unwrap_or_default();
        let first = kinds.insert((check.id, check.held_back, mistake));
        first || check.id == INTERNAL_ERROR || is_read_by_class(check)
    });
    record.evidence.checks = fitting(checks.map(short));
    let findings = std::mem::take(&mut record.findings).into_iter().map(|found| Finding {
        message: String::new(),
        path: None,
        excerpt: None,
        hint: None,
        ..found
    });
    record.findings = fitting(findings);
    let diagnoses = std::mem::take(&mut record.diagnoses).into_iter();
    record.diagnoses = diagnoses.map(|found| Diagnosis { pictures: Vec::new(), ..found }).collect();
    record.diagnostics = String::new();
    record.views = Vec::new();
    record.error_maps = Vec::new();
    record.images = Vec::new();
    entry
}

/// Collects into a vector without room to spare: one that is collected from itself keeps all that it had.
fn fitting<T>(all: impl Iterator<Item = T>) -> Vec<T> {
    let mut all: Vec<T> = all.collect();
    all.shrink_to_fit();
    all
}

fn short(check: Check) -> Check {
    let is_read = is_read_by_class(&check) || says_its_mistake(&check);
    let summary = if is_read { check.summary } else { String::new() };
    Check {
        summary,
        hint: String::new(),
        measures: Vec::new(),
        pictures: Vec::new(),
        lobe: None,
        wrong_rays: Vec::new(),
        ..check
    }
}

#[cfg(test)]
mod tests {
    use similar_asserts::assert_eq;

    use super::super::{ReportError, csv_grades, html_batch, sample, text_table, write_outlined};
    use super::*;
    use crate::evidence::Verdict;
    use crate::evidence::price::PriceClass;
    use crate::report::{BatchReport, JSON_FILE, report_json};

    /// A class with all that its pages tell of.
    fn whole() -> BatchReport {
        let mut report = sample::report();
        let mut add = |index: usize, id, held_back, verdict, words: &str| {
            let checks = &mut report.entries[index].record.evidence.checks;
            let check = Check::new(id, "teapot", verdict, words);
            checks.push(Check { held_back, error: 0.25, ..check });
        };
        for index in 0..2 {
            add(index, CheckId::ImageOffline, true, Verdict::Fail, "differs");
            add(index, CheckId::ImageOffline, true, Verdict::Fail, "the worker ran out of time");
            for _ in 0..50 {
                add(index, CheckId::BsdfDiffuse, false, Verdict::Pass, "right");
            }
            add(index, CheckId::BsdfDiffuse, false, Verdict::NotImplemented, "not implemented");
        }
        // What decides a part of the first is not the first check of its kind.
        let slips = "one slip explains every frame: surfaces are missing";
        let entry = &mut report.entries[0];
        entry.record.diagnoses.clear();
        let part = &mut entry.grade.parts[1];
        (part.points, part.points_max, part.reason) = (4.0, 4.0, slips.into());
        let check = Check::new(CheckId::BsdfDiffuse, "teapot", Verdict::Fail, slips);
        let error = PriceClass::Slip.price();
        let mistake = "surfaces are missing".into();
        entry.record.evidence.checks.push(Check { error, mistake, ..check });
        let private = &mut report.entries[2].record.evidence.checks[0].private;
        *private = "the same image is in a2_ada".into();
        report
    }

    #[test]
    fn the_files_of_a_class_are_the_same_from_outlines() {
        let whole = whole();
        let entries = whole.entries.iter().cloned().map(outline).collect();
        let outlined = BatchReport { entries, ..whole.clone() };
        let pages = |report: &BatchReport| {
            [
                html_batch(report, &[]).unwrap(),
                csv_grades(report).unwrap(),
                text_table(report, 100, false).unwrap(),
            ]
        };
        assert_eq!(pages(&outlined), pages(&whole));
        assert!(pages(&whole)[0].contains("1.2</span> surfaces are missing"));
        let bytes = |report: &BatchReport| serde_json::to_vec(&report.entries).unwrap().len();
        assert!(bytes(&outlined) * 2 < bytes(&whole), "{} {}", bytes(&outlined), bytes(&whole));

        // What else there is comes one by one.
        let out = tempfile::tempdir().unwrap();
        let entry = |outlined: &SubmissionReport| {
            let slug = &outlined.record.slug;
            Ok(whole.entries.iter().find(|own| own.record.slug == *slug).unwrap().clone())
        };
        write_outlined(out.path(), &outlined, &|own| entry(own).map(std::borrow::Cow::Owned))
            .unwrap();
        let read = |name: &str| std::fs::read_to_string(out.path().join(name)).unwrap();
        assert_eq!(read(JSON_FILE), report_json(&whole).unwrap());
        let page = super::super::html_submission(
            &whole,
            &whole.entries[1],
            super::super::Reader::Instructor,
        );
        assert_eq!(read("instructor/two_cosines/report.html"), page);
        let error = write_outlined(out.path(), &outlined, &|own| {
            let slug = own.record.slug.clone();
            Err(ReportError::Entry { slug, reason: "gone".into() })
        });
        let error = error.unwrap_err();
        assert_eq!(error.to_string(), "a2_ada: gone");
    }
}
