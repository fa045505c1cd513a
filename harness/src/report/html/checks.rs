//! Checks on a submission's page: those that failed in full, the others a line each.

use super::super::number::{self, value};
use super::markup::Html;
use super::pictures::Places;
use crate::columns::count;
use crate::evidence::{Check, Measure, Verdict};

/// A check and its place in the evidence, by which it is linked.
pub(super) type Placed<'a> = (usize, &'a Check);

/// Checks behind a line that says how many of them did what: `3 more checks` `failed`.
pub(super) fn folded(
    html: &mut Html,
    (noun, what): (&str, &str),
    checks: &[Placed],
    show: impl Fn(&mut Html, Placed),
) {
    if checks.is_empty() {
        return;
    }
    html.raw("<details>\n<summary>")
        .text(&count(checks.len(), noun))
        .raw(" ")
        .text(what)
        .raw("</summary>\n");
    for &check in checks {
        show(html, check);
    }
    html.raw("</details>\n");
}

/// Failed checks in full, the worst first; of those that say the same, without pictures, the first.
pub(super) fn articles(html: &mut Html, checks: &[Placed], places: &Places) {
    let same = |a: &Check, b: &Check| {
        let plain = |check: &Check| check.pictures.is_empty() && !check.summary.is_empty();
        plain(a) && plain(b) && (&a.summary, &a.hint) == (&b.summary, &b.hint)
    };
    let mut rest = checks.to_vec();
    while !rest.is_empty() {
        let first = rest.remove(0);
        article(html, first, places);
        let (alike, others): (Vec<Placed>, Vec<Placed>) =
            rest.into_iter().partition(|(_, check)| same(first.1, check));
        let what = if alike.len() == 1 { "says the same" } else { "say the same" };
        folded(html, ("more check", what), &alike, line);
        rest = others;
    }
}

/// A check in full: what was found, its measures and pictures.
pub(super) fn article(html: &mut Html, (place, check): Placed, places: &Places) {
    html.raw("<article id=\"check-").show(place).raw("\">\n<h3>");
    title(html, check);
    html.raw("</h3>\n<p>").text(&check.summary).raw("</p>\n");
    if !check.hint.is_empty() {
        html.raw("<p class=\"hint\"><b>Hint</b> ").text(&check.hint).raw("</p>\n");
    }
    private(html, check);
    // Without a measure the error is only "wrong", which the verdict says.
    if check.verdict == Verdict::Fail && !check.measures.is_empty() {
        html.raw("<p class=\"error\">Error <b>").text(&value(check.error));
        html.raw(
            "</b> <span class=\"of\">(0 is right, 1 as large as the answer itself)</span></p>\n",
        );
    }
    measures(html, &check.measures);
    places.of_check(html, check);
    html.raw("</article>\n");
}

/// A check in a few lines: there are hundreds that passed.
pub(super) fn line(html: &mut Html, (place, check): Placed) {
    html.raw("<p class=\"check\" id=\"check-").show(place).raw("\">");
    title(html, check);
    html.raw(" ").text(&check.summary);
    let said = |own: &Measure| format!("{}: {}", own.name, number::measure(own));
    let said: Vec<String> = check.measures.iter().map(said).collect();
    if !said.is_empty() {
        html.raw(" <small>").text(&said.join("; ")).raw("</small>");
    }
    html.raw("</p>\n");
    private(html, check);
}

fn private(html: &mut Html, check: &Check) {
    if !check.private.is_empty() {
        html.raw("<p class=\"notice\">For the instructor: ").text(&check.private).raw("</p>\n");
    }
}

fn title(html: &mut Html, check: &Check) {
    // A sign and a word, so that nothing depends on the color.
    html.raw(match check.verdict {
        Verdict::Pass => "<span class=\"badge good\">✓ ",
        Verdict::Fail | Verdict::NotImplemented => "<span class=\"badge bad\">✗ ",
        Verdict::NotJudged | Verdict::NotRun => "<span class=\"badge unsure\">? ",
    });
    html.text(check.verdict.name()).raw("</span> <code>").text(check.id.name());
    html.raw("</code>");
    if !check.scene.is_empty() {
        html.raw(" <span class=\"scene\">on ").text(&check.scene).raw("</span>");
    }
    if check.held_back {
        html.raw(" <span class=\"badge unsure\">held back</span>");
    }
}

fn measures(html: &mut Html, measures: &[Measure]) {
    if measures.is_empty() {
        return;
    }
    html.raw("<div class=\"wide\" role=\"region\" aria-label=\"Measures\" tabindex=\"0\">\n");
    html.raw("<table class=\"measures\">\n<thead><tr><th scope=\"col\">Measure</th>");
    html.raw("<th scope=\"col\" class=\"number\">Value</th><th scope=\"col\" class=\"number\">");
    html.raw("At most</th><th scope=\"col\">Verdict</th></tr></thead>\n<tbody>\n");
    for measure in measures {
        html.raw(if measure.passed { "<tr>" } else { "<tr class=\"failed\">" });
        html.raw("<th scope=\"row\">").text(&measure.name).raw("</th><td class=\"number\">");
        html.text(&value(measure.value)).raw("</td><td class=\"number\">");
        if measure.only_informs() {
            html.raw("</td><td class=\"told\">not judged</td></tr>\n");
            continue;
        }
        html.text(&value(measure.bound)).raw("</td><td>");
        html.raw(if measure.passed { "✓ pass" } else { "✗ fail" }).raw("</td></tr>\n");
    }
    html.raw("</tbody>\n</table>\n</div>\n");
}
