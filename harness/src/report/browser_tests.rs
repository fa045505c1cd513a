//! Tests of the pages in a real browser.

use std::path::Path;

use serde_json::json;

use super::chromium::Chromium;
use super::*;
use crate::evidence::{Check, CheckId, Lobe, Picture, Verdict};

/// A page in a file of its own, opened.
fn open(browser: &mut Chromium, folder: &Path, page: &str) {
    let file = folder.join("page.html");
    std::fs::write(&file, page).unwrap();
    browser.open(&file, "");
}

#[test]
fn a_class_of_a_thousand_is_sorted_searched_and_filtered_at_once() {
    let Some(mut browser) = Chromium::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut report = sample::report();
    for index in 0..997 {
        let mut entry = report.entries[index % 3].clone();
        entry.record.slug.push_str(&format!("_{index}"));
        entry.record.student.id = format!("{}", 300_000_000 + index);
        entry.grade.points = (index * 7 % 76) as f64;
        entry.grade.points_max = entry.grade.points;
        if index == 5 {
            entry.record.student.first_name = "Łukasz".into();
            entry.record.student.last_name = "O’Neil-Björn".into();
        }
        report.entries.push(entry);
    }
    let browser = &mut browser;
    open(browser, folder.path(), &html_batch(&report, &[]).unwrap());
    assert_eq!(browser.value("document.querySelectorAll('.grades tbody tr').length"), 1000);
    // The quickest of some: an action and the layout after it. Beside it, laying out all rows once.
    let mut least_ms = |action: &str| {
        let timed = format!(
            "(() => {{ const begun = performance.now(); {action}; document.body.offsetHeight; return performance.now() - begun }})()"
        );
        let each = (0..4).map(|_| browser.value(&timed).as_f64().unwrap());
        each.fold(f64::INFINITY, f64::min)
    };
    let layout = least_ms(
        "const body = document.querySelector('.grades tbody'); body.replaceChildren(...body.rows)",
    );
    for action in [
        "document.querySelectorAll('.grades thead button')[1].click()",
        "search.value = '300000123'; search.dispatchEvent(new Event('input'))",
    ] {
        let ms = least_ms(action);
        assert!(ms < 20.0 * layout, "{action}: {ms} ms, all rows {layout} ms");
    }
    let totals = "[...document.querySelectorAll('.grades tbody tr')].map((row) => +row.cells[1].dataset.sort)";
    let sorted = format!("{totals}.every((points, i, all) => i === 0 || all[i - 1] >= points)");
    assert_eq!(browser.value(&sorted), true);
    let shown = "[...document.querySelectorAll('.grades tbody tr')].filter((row) => row.checkVisibility()).length";
    assert_eq!(browser.value(shown), 1);
    assert_eq!(browser.value("document.querySelector('.filters output').textContent"), "1 of 1000");
    browser.value("search.value = `lukasz o'neil-BJORN`; search.dispatchEvent(new Event('input'))");
    assert_eq!(browser.value(shown), 1);
    browser.value("search.value = ''; filter.value = 'td.total.zero'; filter.dispatchEvent(new Event('change'))");
    let none = report.entries.iter().filter(|entry| entry.grade.points_max == 0.0).count();
    assert_eq!(browser.value(shown), none);
    // Every way into the page leads to a part that is there.
    assert_eq!(
        browser
            .value("[...filter.options].filter((o) => o.text.startsWith('points lost in')).length"),
        6
    );
}

#[test]
fn nobody_is_shut_out() {
    let Some(mut browser) = Chromium::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let report = sample::report();
    let submission = |reader| {
        html_submission(&report, &report.entries[1], reader).replace("<details", "<details open")
    };
    let pages = [
        html_batch(&report, &[]).unwrap(),
        submission(Reader::Student),
        submission(Reader::Instructor),
    ];
    for page in pages {
        open(&mut browser, folder.path(), &page);
        assert_eq!(browser.serious_findings(), Vec::<String>::new());
        // On a phone nothing is wider than the page, unless it scrolls in a box of its own.
        browser.size(360, 800);
        let wide = browser
            .value("document.documentElement.scrollWidth - document.documentElement.clientWidth");
        assert_eq!(wide, 0);
        browser.size(1200, 800);
    }
}

#[test]
fn a_submissions_page_is_short_and_runs_nothing() {
    let Some(mut browser) = Chromium::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let evil = "</script><script>window.pwned = 1</script><img src=x onerror='window.pwned = 2'>";
    let mut report = sample::report();
    let entry = &mut report.entries[1];
    entry.record.student.first_name = evil.into();
    entry.record.name = evil.into();
    entry.record.diagnostics = evil.into();
    for scene in 0..20 {
        let lobe = Lobe {
            material: evil.into(),
            wo_deg: 40.0,
            log: scene % 2 == 0,
            expected: (-90..=90).map(|angle| [f64::from(angle), 0.3]).collect(),
            found: vec![[-40.0, 0.2], [0.0, f64::NAN], [40.0, 1e-9]],
        };
        let picture = |title: &str| Picture {
            title: title.into(),
            file: format!("{scene}-{title}.png"),
            width: 768,
            height: 576,
        };
        let scene = format!("scene-{scene}");
        entry.record.evidence.checks.push(Check {
            lobe: Some(lobe),
            pictures: ["actual", "expected", "difference"].map(picture).into(),
            ..Check::new(CheckId::RadianceLit, &scene, Verdict::Fail, evil)
        });
    }
    for reader in [Reader::Student, Reader::Instructor] {
        let page = html_submission(&report, &report.entries[1], reader);
        let browser = &mut browser;
        open(browser, folder.path(), &page);
        browser.value(
            "addEventListener('securitypolicyviolation', () => { window.refused = true }); \
             document.body.insertAdjacentHTML('beforeend', '<img src=x onerror=\"window.pwned = 3\">')",
        );
        browser.until("window.refused");
        assert!(browser.value("window.pwned ?? null").is_null());
        assert_eq!(browser.value("document.scripts.length"), 0);
        // The worst picture is there, and keeps its place before it is loaded.
        let sizes = "[...document.querySelectorAll('.part > .pictures img')].map((i) => [i.width > 0, Math.round(i.width / i.height * 100)])";
        assert_eq!(browser.value(sizes), json!([[true, 133], [true, 133], [true, 133]]));
        assert_eq!(browser.value("document.querySelectorAll('.lobe svg').length"), 1);
        let scenes = "[...document.querySelectorAll('.part > p')].filter((own) => own.textContent.includes('scene-')).length";
        assert_eq!(browser.value(scenes), 1, "the scene of a picture is named once");
        for (width, most) in [(1200, 2400), (390, 4800)] {
            browser.size(width, 800);
            let height = browser.value("document.documentElement.scrollHeight").as_i64().unwrap();
            assert!(height < most, "{height} px high at a width of {width}");
            let wide = browser.value("document.documentElement.scrollWidth").as_u64().unwrap();
            assert!(wide <= u64::from(width), "{wide} px wide at {width}");
        }
        browser.size(1200, 800);
    }
}
