//! The published curve from error to points, drawn as inline SVG.

use super::super::number::value;
use super::markup::Html;
use crate::rubric::Curve;

/// The drawing's inner size in SVG units.
const SIZE: [f64; 2] = [560.0, 200.0];

/// The curve, with the parts that it decided marked at their errors. The axis of errors is
/// stretched near 0 (a square root), where most of it happens.
pub(super) fn curve(html: &mut Html, curve: &Curve, marks: &[(f64, &str)]) {
    let points = curve.points();
    let last = points.last().map_or(1.0, |point| point[0]).max(1e-9);
    let x = |error: f64| (error.clamp(0.0, last) / last).sqrt() * SIZE[0];
    let y = |fraction: f64| (1.0 - fraction) * SIZE[1];
    html.raw(
        "<figure class=\"curve\">\n<svg viewBox=\"-52 -16 632 262\" role=\"img\" aria-label=\"",
    );
    html.raw(
        "Fraction of a part's points that is left, over the error of its worst failed check\">\n",
    );
    for step in 0..=4 {
        let fraction = f64::from(step) / 4.0;
        html.raw("<line class=\"grid\" x1=\"0\" x2=\"560\" y1=\"").show(y(fraction));
        html.raw("\" y2=\"").show(y(fraction)).raw("\"/><text class=\"tick\" x=\"-8\" y=\"");
        html.show(y(fraction) + 4.0).raw("\" text-anchor=\"end\">");
        html.show(100.0 * fraction).raw(" %</text>\n");
    }
    for point in points {
        html.raw("<line class=\"grid\" y1=\"0\" y2=\"200\" x1=\"").text(&short(x(point[0])));
        html.raw("\" x2=\"")
            .text(&short(x(point[0])))
            .raw("\"/><text class=\"tick\" y=\"218\" x=\"");
        html.text(&short(x(point[0]))).raw("\" text-anchor=\"middle\">").text(&value(point[0]));
        html.raw("</text>\n");
    }
    html.raw("<text class=\"tick\" x=\"280\" y=\"240\" text-anchor=\"middle\">error</text>\n");
    html.raw("<polyline points=\"");
    for step in 0..=140 {
        // Equal steps on the paper, not in the error.
        let error = last * (f64::from(step) / 140.0).powi(2);
        html.text(&short(x(error))).raw(",").text(&short(y(curve.fraction(error)))).raw(" ");
    }
    html.raw("\"/>\n");
    for (error, id) in marks {
        let (cx, cy) = (x(*error), y(curve.fraction(*error)));
        html.raw("<circle r=\"5\" cx=\"").text(&short(cx)).raw("\" cy=\"").text(&short(cy));
        html.raw("\"/><text class=\"mark\" x=\"").text(&short(cx + 9.0)).raw("\" y=\"");
        html.text(&short((cy - 8.0).max(4.0))).raw("\">").text(id).raw("</text>\n");
    }
    html.raw(
        "</svg>\n<figcaption>What a failed check leaves of a part's points, by its error: 0 is ",
    );
    html.raw(
        "right, 1 as large as the answer itself. A check that passes leaves everything; one that fails, even by very \
         little, at most what stands at 0. In numbers: an error of ",
    );
    for (index, [error, fraction]) in points.iter().enumerate() {
        html.raw(if index == 0 { "" } else { ", of " }).text(&value(*error)).raw(" leaves ");
        html.text(&value(100.0 * fraction)).raw(" %");
    }
    html.raw(".</figcaption>\n</figure>\n");
}

fn short(value: f64) -> String {
    format!("{value:.1}")
}
