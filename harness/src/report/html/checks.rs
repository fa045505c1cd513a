//! The checks on a submission's page: what failed in full and with pictures, the rest folded.

use super::super::number::{self, is_failure, value};
use super::markup::Html;
use crate::columns::count;
use crate::evidence::{Check, Measure, Picture, Verdict};

/// All checks, those that cost points first. `public_pictures` leads from the page to the folder of
/// the pictures that are not held back: empty, or ending with a slash.
pub(super) fn checks(html: &mut Html, checks: &[Check], public_pictures: &str) {
    // A check is linked by its place in the evidence, wherever it is shown.
    let pick = |wanted: fn(&Check) -> bool| -> Vec<(usize, &Check)> {
        checks.iter().enumerate().filter(|(_, check)| wanted(check)).collect()
    };
    let failed = pick(is_failure);
    if !failed.is_empty() {
        html.raw("<section>\n<h2>What is wrong</h2>\n");
        for (place, check) in failed {
            article(html, place, check, public_pictures);
        }
        html.raw("</section>\n");
    }
    let silent = |check: &Check| matches!(check.verdict, Verdict::NotJudged | Verdict::NotRun);
    let passed = |check: &Check| check.verdict == Verdict::Pass;
    folded(html, "could not be judged", true, &pick(silent), public_pictures);
    folded(html, "passed", false, &pick(passed), public_pictures);
}

fn folded(
    html: &mut Html,
    what: &str,
    open: bool,
    checks: &[(usize, &Check)],
    public_pictures: &str,
) {
    if checks.is_empty() {
        return;
    }
    html.raw(if open { "<details open>" } else { "<details>" }).raw("\n<summary>");
    html.text(&count(checks.len(), "check")).raw(" ").text(what).raw("</summary>\n");
    for (place, check) in checks {
        article(html, *place, check, public_pictures);
    }
    html.raw("</details>\n");
}

fn article(html: &mut Html, place: usize, check: &Check, public_pictures: &str) {
    html.raw("<article id=\"check-").show(place).raw("\">\n<h3>");
    badge(html, check.verdict);
    html.raw(" <code>").text(check.id.name()).raw("</code>");
    if !check.scene.is_empty() {
        html.raw(" <span class=\"scene\">on ").text(&check.scene).raw("</span>");
    }
    if check.held_back {
        html.raw(" <span class=\"badge unsure\">held back</span>");
    }
    html.raw("</h3>\n<p>").text(&check.summary).raw("</p>\n");
    if !check.hint.is_empty() {
        html.raw("<p class=\"hint\"><b>Hint</b> ").text(&check.hint).raw("</p>\n");
    }
    if !check.private.is_empty() {
        html.raw("<p class=\"notice\">For the instructor: ").text(&check.private).raw("</p>\n");
    }
    // Without a measure the error is only "wrong", which the verdict says.
    if check.verdict == Verdict::Fail && !check.measures.is_empty() {
        html.raw("<p class=\"error\">Error <b>").text(&value(check.error));
        html.raw(
            "</b> <span class=\"of\">(0 is right, 1 as large as the answer itself)</span></p>\n",
        );
    }
    measures(html, &check.measures);
    let folder = if check.held_back { "" } else { public_pictures };
    pictures(html, &check.name(), folder, &check.pictures);
    html.raw("</article>\n");
}

fn badge(html: &mut Html, verdict: Verdict) {
    // A sign and a word, so that nothing hangs on the colour.
    html.raw(match verdict {
        Verdict::Pass => "<span class=\"badge good\">✓ ",
        Verdict::Fail | Verdict::NotImplemented => "<span class=\"badge bad\">✗ ",
        Verdict::NotJudged | Verdict::NotRun => "<span class=\"badge unsure\">? ",
    });
    html.text(number::verdict(verdict)).raw("</span>");
}

fn measures(html: &mut Html, measures: &[Measure]) {
    if measures.is_empty() {
        return;
    }
    html.raw("<table class=\"measures\">\n<thead><tr><th scope=\"col\">Measure</th>");
    html.raw("<th scope=\"col\" class=\"number\">Value</th><th scope=\"col\" class=\"number\">");
    html.raw("At most</th><th scope=\"col\">Verdict</th></tr></thead>\n<tbody>\n");
    for measure in measures {
        html.raw(if measure.passed { "<tr>" } else { "<tr class=\"failed\">" });
        html.raw("<th scope=\"row\">").text(&measure.name).raw("</th><td class=\"number\">");
        html.text(&value(measure.value)).raw("</td><td class=\"number\">");
        html.text(&value(measure.bound)).raw("</td><td>");
        html.raw(if measure.passed { "✓ pass" } else { "✗ fail" }).raw("</td></tr>\n");
    }
    html.raw("</tbody>\n</table>\n");
}

/// Pictures side by side, of the thing called `name`; their files lie in `folder`, which ends in a
/// slash or is empty.
pub(super) fn pictures(html: &mut Html, name: &str, folder: &str, pictures: &[Picture]) {
    if pictures.is_empty() {
        return;
    }
    html.raw("<div class=\"pictures\">\n");
    for Picture { title, file } in pictures {
        let file = format!("{folder}{file}");
        html.raw("<figure><a href=\"").address(&file).raw("\"><img loading=\"lazy\" src=\"");
        html.address(&file).raw("\" alt=\"").text(name).raw(": ").text(title);
        html.raw("\"></a><figcaption>").text(title).raw("</figcaption></figure>\n");
    }
    html.raw("</div>\n");
}
