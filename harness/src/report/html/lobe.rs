//! The lobe of a BSDF as a polar plot: what is right, and what was answered.

use super::super::number::value;
use super::markup::Html;
use crate::evidence::Lobe;

/// The radius of the plot in SVG units.
const RADIUS: f64 = 150.0;
/// A logarithmic plot shows so many powers of ten below its largest value.
const DECADES: f64 = 4.0;

/// The plot, with its legend in words.
pub(super) fn lobe(html: &mut Html, lobe: &Lobe) {
    let finite = lobe.expected.iter().chain(&lobe.found).map(|point| point[1].abs());
    let largest = finite.filter(|value| value.is_finite()).fold(0.0, f64::max);
    if largest <= 0.0 {
        return;
    }
    let radius = |value: f64| {
        let part = (value / largest).clamp(0.0, 1.0);
        RADIUS * if lobe.log { (1.0 + part.log10() / DECADES).max(0.0) } else { part }
    };
    let place = |[angle, value]: [f64; 2]| {
        let (sin, cos) = angle.to_radians().sin_cos();
        let r = if value.is_finite() { radius(value.abs()) } else { RADIUS };
        (r * sin, -r * cos)
    };
    html.raw("<figure class=\"lobe\">\n<svg viewBox=\"-190 -170 380 190\" width=\"380\" height=\"190\" role=\"img\" ");
    html.raw("aria-label=\"Polar plot of the BSDF: expected as a line, found as dots\">\n");
    for ring in [0.25, 0.5, 0.75, 1.0] {
        let r = short(ring * RADIUS);
        html.raw("<path class=\"grid\" d=\"M-").text(&r).raw(" 0A").text(&r).raw(" ").text(&r);
        html.raw(" 0 0 1 ").text(&r).raw(" 0\"/>");
    }
    html.raw("<path class=\"grid\" d=\"M-160 0H160M0 0V-160\"/>\n");
    let (sin, cos) = lobe.wo_deg.to_radians().sin_cos();
    let (x, y) = (short(-160.0 * sin), short(-160.0 * cos));
    html.raw("<line class=\"wo\" x1=\"0\" y1=\"0\" x2=\"").text(&x).raw("\" y2=\"").text(&y);
    html.raw("\"/><text class=\"tick\" x=\"").text(&x).raw("\" y=\"").text(&y);
    html.raw("\" dx=\"-4\" text-anchor=\"end\">wo</text>\n<polygon class=\"right\" points=\"0,0 ");
    for &point in &lobe.expected {
        let (x, y) = place(point);
        html.text(&short(x)).raw(",").text(&short(y)).raw(" ");
    }
    html.raw("\"/>\n");
    // The curve ends where the values are none of a BSDF.
    for run in lobe.found.split(|&[_, value]| mark(value) != "found") {
        html.raw("<polyline class=\"found\" points=\"");
        for &point in run {
            let (x, y) = place(point);
            html.text(&short(x)).raw(",").text(&short(y)).raw(" ");
        }
        html.raw("\"/>\n");
    }
    for &point in &lobe.found {
        let (x, y) = place(point);
        html.raw("<circle class=\"").raw(mark(point[1])).raw("\" r=\"3\" cx=\"");
        html.text(&short(x)).raw("\" cy=\"").text(&short(y)).raw("\"/>");
    }
    html.raw("\n</svg>\n<figcaption>Your BSDF (dots) and the right one (filled) for ");
    html.text(&lobe.material).raw(", in the plane of wo and the normal; ");
    html.raw(if lobe.log { "logarithmic, four powers of ten to " } else { "to " });
    html.text(&value(largest)).raw(" sr⁻¹ at the outer ring");
    for (name, words) in [
        ("bad", "; magenta, at the outer ring: not finite"),
        ("negative", "; hollow: negative, by its size"),
    ] {
        let is_there = lobe.found.iter().any(|point| mark(point[1]) == name);
        html.raw(if is_there { words } else { "" });
    }
    html.raw("</figcaption></figure>\n");
}

/// The class of the dot for a value: what no BSDF may answer has its own.
fn mark(value: f64) -> &'static str {
    match value {
        _ if !value.is_finite() => "bad",
        _ if value < 0.0 => "negative",
        _ => "found",
    }
}

fn short(value: f64) -> String {
    format!("{value:.1}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_bsdf_answers_is_marked() {
        let drawn = |found: Vec<[f64; 2]>| {
            let expected = vec![[0.0, 0.5]];
            let material = "kd".to_owned();
            let own = Lobe { material, wo_deg: 40.0, log: false, expected, found };
            let mut html = Html::default();
            lobe(&mut html, &own);
            html.finish()
        };
        let marks =
            |page: &str, name: &str| page.matches(&format!("<circle class=\"{name}\"")).count();
        let right = [[-30.0, 0.2], [0.0, 0.0], [30.0, 0.25]];
        let page = drawn(right.to_vec());
        assert_eq!(["found", "bad", "negative"].map(|name| marks(&page, name)), [3, 0, 0]);
        assert!(page.contains("at the outer ring</figcaption>"), "{page}");
        for (odd, counts) in [(f64::NAN, [3, 1, 0]), (f64::INFINITY, [3, 1, 0]), (-0.1, [3, 0, 1])]
        {
            let page = drawn([&right[..2], &[[15.0, odd]], &right[2..]].concat());
            assert_eq!(
                ["found", "bad", "negative"].map(|name| marks(&page, name)),
                counts,
                "{odd}"
            );
            assert_eq!(page.matches("<polyline").count(), 2, "no curve leads through it");
            assert_eq!(page.contains("magenta, at the outer ring: not finite"), !odd.is_finite());
            assert_eq!(
                page.contains("hollow: negative, by its size"),
                odd < 0.0 && odd.is_finite()
            );
        }
    }
}
