use super::super::super::{html_batch, sample};
use super::mistakes::{NO_CODE, OTHER};
use super::*;
use crate::evidence::price::PriceClass;
use crate::evidence::{Check, CheckId, Verdict};
use crate::grading::SourceDigest;

#[test]
fn no_part_that_lost_points_is_left_out_of_the_mistakes() {
    let panics = "the renderer panicked: index out of bounds (at src/bsdfs/phong.rs:46)";
    for (reason, words) in [
        (panics, "the renderer panics"),
        (
            "endless loop in 1.4 on scene \"open\": no answer within 3 s of CPU time",
            "endless loop, or far too slow",
        ),
        (
            "stuck in 1.4: no answer, and nothing done for 30 s: a deadlock or a sleep",
            "endless loop, or far too slow",
        ),
        ("not asked: the renderer ran out of time before", "endless loop, or far too slow"),
        ("src/shaders/phong.fs.wgsl:69:1: expected `;`, found \"}\"", "a shader does not compile"),
        (
            "src/integrators/simple.rs:36: cannot divide `Vec3` by `f64`",
            "the code does not compile",
        ),
        ("the renderer crashed: SIGSEGV", "the renderer crashes"),
        ("1175 of 15477 directions are wrong", OTHER),
    ] {
        let mut report = sample::report();
        let entry = &mut report.entries[0];
        entry.record.diagnoses.clear();
        let part = &mut entry.grade.parts[1];
        (part.points, part.points_max, part.reason) = (0.0, 0.0, reason.into());
        let page = html_batch(&report, &[]).unwrap();
        let found = format!(
            "<span class=\"id\">1.2</span> {words} <span class=\"names\">\
             <a href=\"./instructor/a2_ada/report.html#part-1.2\">"
        );
        assert!(page.contains(&found), "{reason}");
        // Of one without code, all parts in one line.
        let found = format!("<span class=\"id\">1.1, 1.2, 1.3, 1.4, 2.4</span> {NO_CODE}");
        assert!(page.contains(&found), "{page}");
    }
}

#[test]
fn a_mistake_that_explains_all_frames_has_its_name_in_the_class_too() {
    let mut report = sample::report();
    let entry = &mut report.entries[0];
    entry.record.diagnoses.clear();
    let reason =
        "one slip explains the submission's own frames on every scene: surfaces are missing";
    let found = Check::new(CheckId::PassUniforms, "teapot", Verdict::Fail, reason);
    let error = PriceClass::Slip.price();
    entry.record.evidence.checks.push(Check {
        error,
        mistake: "surfaces are missing".into(),
        ..found
    });
    let part = &mut entry.grade.parts[1];
    (part.points, part.points_max, part.reason) = (4.0, 4.0, reason.into());
    let page = html_batch(&report, &[]).unwrap();
    assert!(page.contains("<span class=\"id\">1.2</span> surfaces are missing <span"), "{page}");
    // Of a mistake that the sentence does not name, nothing is claimed.
    let checks = &mut report.entries[0].record.evidence.checks;
    checks.last_mut().unwrap().mistake = "the picture is upside down".into();
    let page = html_batch(&report, &[]).unwrap();
    assert!(page.contains(&format!("<span class=\"id\">1.2</span> {OTHER} <span")), "{page}");
}

#[test]
fn files_that_many_share_are_named_once() {
    let mut report = sample::report();
    let mut first = report.entries[0].clone();
    first.record.sources = ["src/a.rs", "src/b.rs"]
        .map(|path| SourceDigest { path: path.into(), signs: 300, sha256: path.into() })
        .into();
    report.entries = Vec::new();
    for index in 0..200 {
        let mut entry = first.clone();
        entry.record.slug = format!("hand_in_{index:03}");
        entry.record.student.id = format!("{}", 100_000 + index);
        report.entries.push(entry);
    }
    let size = |report: &BatchReport| html_batch(report, &[]).unwrap().len();
    let without = size(&report);
    let mut records: Vec<_> = report.entries.iter().map(|entry| entry.record.clone()).collect();
    crate::grading::judge_shared(&mut records);
    for (entry, record) in report.entries.iter_mut().zip(records) {
        let private = &record.evidence.checks.last().unwrap().private;
        assert!(private.len() < 400 && private.ends_with(" and 191 more"), "{private}");
        entry.record = record;
    }
    let page = html_batch(&report, &[]).unwrap();
    let group = "<strong>200 submissions</strong> share src/a.rs, src/b.rs";
    assert_eq!(page.matches(group).count(), 1);
    // One link for each submission.
    assert!(page.len() < without + 200 * 150, "{} after {without}", page.len());
}
