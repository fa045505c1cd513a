use super::super::{ReportError, sample};
use super::*;

#[test]
fn pages_say_what_matters() {
    let report = sample::report();
    let page = batch(&report, &[]).unwrap();
    for words in [
        "<a href=\"./instructor/two_cosines/report.html\">Jörg Müller</a><small>two_cosines.tar.gz</small>",
        "<td class=\"number total open\" data-sort=\"64.85\">64.85..84.85</td>",
        "<td class=\"number open\" data-sort=\"0\"><a href=\"./instructor/two_cosines/report.html#part-2.5\">0..20</a>",
        "<strong>33 %</strong> <span class=\"id\">1.3</span> the cosine is multiplied twice",
        "1 submission: not wholly judged",
        "1 submission: images without code",
        "Part 1.3: 1 of 3 with all points, 1 with none, mean 9.95",
        "3 submissions, 1 not wholly judged",
        "not graded under the same conditions",
        "<td class=\"findings\">1 warning</td>",
        "<a href=\"./instructor/a2_ada/report.html\">Ada",
        "--held-back 18446744073709551557",
    ] {
        assert!(page.contains(words), "{words:?} is not in the batch's page");
    }
    let page = submission(&report, &report.entries[1], Reader::Instructor);
    for words in [
        "<strong>64.85..84.85</strong> of 75 points",
        "<b>Hint</b> cos theta_i is multiplied twice: eval() holds it already",
        "<a href=\"#check-2\">radiance.lit @ cbox</a>",
        "<article id=\"check-2\">",
        "src=\"./radiance_lit_cbox_expected.png\" alt=\"radiance.lit @ cbox: expected\"",
        "For the instructor: held-back scenes",
        "<b>Looks like</b> the cosine is multiplied twice: eval() holds it already (explains 98 % of the difference)",
        "rel=\"prev\" href=\"./../../instructor/a2_ada/report.html\">Previous</a>",
        "rel=\"next\" href=\"./../../instructor/hand_in_3/report.html\">Next</a>",
        "<summary>4 parts right: 1.1, 1.2, 1.4, 2.4</summary>",
        "<p class=\"of\">On the scene <b>cbox</b>, by <code>radiance.lit</code></p>",
        "<summary>1 note</summary>",
        "<summary>2 checks passed</summary>",
        "<summary>2 checks could not be judged</summary>",
        "<code>src/lib.rs:12</code> the source uses unsafe",
    ] {
        assert!(page.contains(words), "{words:?} is not in the submission's page");
    }
    let page = submission(&report, &report.entries[2], Reader::Student);
    assert!(page.contains("expected `Vec3`, found `f32`"));
    assert!(!submission(&report, &report.entries[0], Reader::Student).contains("What was lost"));
}

#[test]
fn checks_that_say_the_same_are_one() {
    let mut report = sample::report();
    let checks = &mut report.entries[1].record.evidence.checks;
    let mut silent = checks[2].clone();
    silent.summary = "not answered: phong.fs.wgsl does not compile".into();
    silent.pictures = Vec::new();
    checks.extend(
        ["a", "b", "c"]
            .map(|scene| crate::evidence::Check { scene: scene.into(), ..silent.clone() }),
    );
    let page = submission(&report, &report.entries[1], Reader::Instructor);
    assert!(page.contains("<summary>2 more checks say the same</summary>"), "{page}");
    let whole = "</h3>\n<p>not answered: phong.fs.wgsl does not compile</p>";
    assert_eq!(page.matches(whole).count(), 1);
    for place in 0..report.entries[1].record.evidence.checks.len() {
        assert_eq!(page.matches(&format!("id=\"check-{place}\"")).count(), 1, "{place}");
    }
}

#[test]
fn a_student_reads_nothing_of_held_back_scenes_but_that_they_are_wrong() {
    let mut report = sample::report();
    let words =
        ["sums", "hints", "measures", "titles", "files"].map(|what| format!("SECRET-{what}"));
    let record = &mut report.entries[1].record;
    for check in record.evidence.checks.iter_mut().filter(|check| check.held_back) {
        let [summary, hint, measure, title, file] = words.clone();
        check.summary = summary;
        check.hint = hint;
        check.error = 0.123_456;
        check.measures[0].name = measure;
        check.pictures[0] = crate::evidence::Picture { title, file, ..Default::default() };
    }
    let [student, instructor] = [Reader::Student, Reader::Instructor]
        .map(|reader| submission(&report, &report.entries[1], reader));
    for word in &words {
        assert!(instructor.contains(word), "{word:?} is not on the instructor's page");
    }
    let page = student.split("<h2>What was lost</h2>").nth(1).unwrap();
    assert!(page.contains("wrong on a held-back scene (error 0.12)"));
    for word in ["SECRET", "0.1234", "18446744073709551557", "instructor", "<img"] {
        assert!(!student.contains(word), "{word:?} is on the student's page");
    }
    // The instructor's page lies one folder deeper, beside the pictures of held-back scenes alone.
    assert!(instructor.contains("<a href=\"../../report.html\">"));
    assert!(instructor.contains("src=\"./SECRET-files\""));
    report.entries[1].record.evidence.checks[2].held_back = false;
    let instructor = submission(&report, &report.entries[1], Reader::Instructor);
    assert!(instructor.contains("src=\"./../../two_cosines/SECRET-files\""));
}

/// Every tag that stands in a page, in order: what a browser sees of structure.
fn tags(page: &str) -> Vec<&str> {
    page.split('<').skip(1).map(|rest| rest.split(['>', ' ', '\n']).next().unwrap()).collect()
}

#[test]
fn hostile_words_stay_words() {
    let evil = "</title></pre><script>alert(1)</script><img src=x onerror=alert(1)>\"'><b>\u{1b}[2J\u{202e}\0";
    let mut report = sample::report();
    let plain = report.clone();
    for entry in &mut report.entries {
        let record = &mut entry.record;
        record.name = evil.into();
        record.student.first_name = evil.into();
        record.student.last_name = evil.into();
        record.student.id = evil.into();
        record.conditions.adapter.push_str(evil);
        for finding in &mut record.findings {
            finding.path = finding.path.as_ref().map(|_| evil.into());
            finding.message = evil.into();
            finding.hint = finding.hint.as_ref().map(|_| evil.into());
        }
        if !record.diagnostics.is_empty() {
            record.diagnostics = evil.into();
        }
        for check in &mut record.evidence.checks {
            check.summary = evil.into();
            if !check.hint.is_empty() {
                check.hint = evil.into();
            }
            for measure in &mut check.measures {
                measure.name = evil.into();
            }
            for picture in &mut check.pictures {
                picture.title = evil.into();
                picture.file = "\" onerror=alert(1) javascript:x".into();
            }
        }
        for diagnosis in &mut record.diagnoses {
            diagnosis.words = evil.into();
        }
        for part in &mut entry.grade.parts {
            part.reason = evil.into();
        }
    }
    let mut pages = vec![(batch(&plain, &[]).unwrap(), batch(&report, &[]).unwrap())];
    for (plain_entry, entry) in plain.entries.iter().zip(&report.entries) {
        for reader in [Reader::Student, Reader::Instructor] {
            pages.push((
                submission(&plain, plain_entry, reader),
                submission(&report, entry, reader),
            ));
        }
    }
    for (plain, page) in pages {
        similar_asserts::assert_eq!(tags(&plain), tags(&page));
        assert!(page.contains("&lt;script&gt;alert(1)"));
        assert!(!page.chars().any(|c| c != '\n' && (c.is_control() || c == '\u{202e}')));
        assert!(!page.contains("\" onerror") && !page.contains("javascript:"));
    }
}

#[test]
fn pages_load_nothing_from_elsewhere() {
    let report = sample::report();
    let mut pages = vec![batch(&report, &[]).unwrap()];
    for reader in [Reader::Student, Reader::Instructor] {
        pages.extend(report.entries.iter().map(|entry| submission(&report, entry, reader)));
    }
    for page in pages {
        assert!(!page.contains("http:") && !page.contains("https:") && !page.contains("url("));
        assert!(page.contains("default-src 'none'"));
    }
}

#[test]
fn an_empty_batch_is_an_error() {
    let report = BatchReport { entries: Vec::new(), ..sample::report() };
    assert!(matches!(batch(&report, &[]), Err(ReportError::Empty)));
}

/// Writes pages to look at: `UMBRA_LOOK=DIR cargo test --release -p umbra --lib look -- --ignored`.
#[test]
#[ignore = "for eyes, not for machines"]
fn look() {
    let Some(out) = std::env::var_os("UMBRA_LOOK") else { return };
    let mut report = sample::report();
    // A batch has many rows and the handout nine parts.
    for id in ["2.1", "2.2", "2.3"] {
        let mut part = report.rules.parts[0].clone();
        part.id = id.into();
        report.rules.parts.insert(report.rules.parts.len() - 2, part);
        for entry in &mut report.entries {
            let mut own = entry.grade.parts[0].clone();
            own.id = id.into();
            let place = entry.grade.parts.len() - 2;
            entry.grade.parts.insert(place, own);
        }
    }
    for index in 0..24 {
        let mut entry = report.entries[index % 3].clone();
        entry.record.slug.push_str(&format!("_{index}"));
        report.entries.push(entry);
    }
    super::super::write(std::path::Path::new(&out), &report).unwrap();
}
