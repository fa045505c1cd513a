//! `docs/performance.md`: the table, and plots as SVG.

use std::fmt::Write as _;
use std::path::Path;

use super::figures::Line;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 300.0;
/// Room for the axes' words, and for the legend.
const LEFT: f64 = 56.0;
const RIGHT: f64 = 200.0;
const TOP: f64 = 24.0;
const BOTTOM: f64 = 40.0;
/// Wong's palette for all kinds of sight (Nature Methods 8, 2011).
const COLORS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#56b4e9", "#e69f00", "#cc79a7"];

/// Points of one line of a plot; both axes are logarithmic.
pub struct Curve {
    name: String,
    points: Vec<(f64, f64)>,
}

impl Curve {
    /// Without points.
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned(), points: Vec::new() }
    }

    /// Adds one.
    pub fn push(&mut self, x: f64, y: f64) {
        self.points.push((x, y));
    }
}

/// Writes the page, and its plots beside it.
///
/// # Errors
/// When a file cannot be written.
pub fn write(
    root: &Path,
    about: &str,
    lines: &[Line],
    plots: &[(&str, &str, [&str; 2], Vec<Curve>)],
) -> anyhow::Result<()> {
    let mut page = include_str!("page.md").replace("ABOUT", about);
    page += "\n## The table\n| work | anchor | anchor's figure | Umbra's | ratio |\n|---|---|---|---|---|\n";
    for Line { work, anchor, theirs, ours, ratio } in lines {
        writeln!(page, "| {work} | {anchor} | {theirs} | {ours} | {ratio} |")?;
    }
    page += "\n## How cost grows\n";
    let folder = root.join("docs/performance");
    std::fs::create_dir_all(&folder)?;
    for (file, words, axes, curves) in plots {
        std::fs::write(folder.join(format!("{file}.svg")), svg(*axes, curves)?)?;
        writeln!(page, "{words}\n\n![{}](performance/{file}.svg)\n", axes[1])?;
    }
    std::fs::write(root.join("docs/performance.md"), page.trim_end().to_owned() + "\n")?;
    Ok(())
}

fn svg([x_words, y_words]: [&str; 2], curves: &[Curve]) -> anyhow::Result<String> {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let range = |pick: fn(&(f64, f64)) -> f64| {
        let low = points().map(pick).fold(f64::INFINITY, f64::min).log10();
        let high = points().map(pick).fold(f64::NEG_INFINITY, f64::max).log10();
        [low.floor(), high.ceil().max(low.floor() + 1.0)]
    };
    let (x_range, y_range) = (range(|p| p.0), range(|p| p.1));
    let along = |value: f64, [low, high]: [f64; 2]| (value.log10() - low) / (high - low);
    let x = |value: f64| LEFT + along(value, x_range) * (WIDTH - LEFT - RIGHT);
    let y = |value: f64| HEIGHT - BOTTOM - along(value, y_range) * (HEIGHT - TOP - BOTTOM);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
         font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n"
    );
    // One line of the grid for each power of ten, and its value beside it.
    let powers = |[low, high]: [f64; 2]| (low as i32..=high as i32).map(|p| 10f64.powi(p));
    let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
    let upright = powers(x_range).map(|value| {
        let x = x(value);
        (value, format!("M{x:.1} {TOP}V{bottom}"), "middle", x, bottom + 14.0)
    });
    let across = powers(y_range).map(|value| {
        let y = y(value);
        (value, format!("M{LEFT} {y:.1}H{right}"), "end", LEFT - 6.0, y + 4.0)
    });
    for (value, path, anchor, x, y) in upright.chain(across) {
        writeln!(out, "<path d=\"{path}\" stroke=\"#ddd\"/>")?;
        writeln!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{value}</text>")?;
    }
    for (i, curve) in curves.iter().enumerate() {
        let color = COLORS[i % COLORS.len()];
        let path: Vec<String> =
            curve.points.iter().map(|p| format!("{:.1},{:.1}", x(p.0), y(p.1))).collect();
        writeln!(
            out,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>",
            path.join(" ")
        )?;
        let (left, top) = (WIDTH - RIGHT + 12.0, TOP + 12.0 + 16.0 * i as f64);
        writeln!(out, "<text x=\"{left}\" y=\"{top}\" fill=\"{color}\">{}</text>", curve.name)?;
    }
    let middle = LEFT + 0.5 * (WIDTH - LEFT - RIGHT);
    writeln!(
        out,
        "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{x_words}</text>",
        HEIGHT - 8.0
    )?;
    writeln!(out, "<text x=\"4\" y=\"12\">{y_words}</text>\n</svg>")?;
    Ok(out)
}
