//! The report on two images, as text.

use std::fmt::{Display, LowerExp};

use super::{Comparison, Difference, Pixels};
use crate::harmless::harmless;

/// All of it, line by line.
pub(super) fn text(comparison: &Comparison) -> anyhow::Result<String> {
    use std::fmt::Write;
    let mut out = String::new();
    for (name, side) in [("actual", &comparison.actual), ("expected", &comparison.expected)] {
        if !side.layer.is_empty() {
            writeln!(out, "{name}: layer {}", harmless(&side.layer))?;
        }
        for note in &side.notes {
            writeln!(out, "{name}: {note}")?;
        }
        for (pixels, what) in [(&side.not_finite, "not finite"), (&side.negative, "negative")] {
            if let Some(Pixels { count, first: [x, y] }) = pixels {
                let are = if *count == 1 { "pixel is" } else { "pixels are" };
                writeln!(out, "{name}: {count} {are} {what}; first at ({x}, {y})")?;
            }
        }
    }
    for note in &comparison.notes {
        writeln!(out, "{note}")?;
    }
    let Some(values) = &comparison.values else {
        let [a, b] =
            [&comparison.actual, &comparison.expected].map(|side| (side.width, side.height));
        writeln!(out, "actual is {}x{} but expected is {}x{}", a.0, a.1, b.0, b.1)?;
        if !comparison.pictures.is_empty() {
            writeln!(out, "there is no picture of the difference")?;
        }
        files(&mut out, comparison)?;
        return Ok(out);
    };
    writeln!(out, "{} of {} pixels differ", values.differing, values.pixels)?;
    let mut tell = |what: &str, found: &Difference| {
        let color = |color: [f32; 3]| format!("[{}]", color.map(short).join(", "));
        let (a, b) = (color(found.actual), color(found.expected));
        let by = found.difference.map(|size| format!(", difference {}", short(size)));
        let by = by.unwrap_or_default();
        writeln!(out, "{what} at ({}, {}): actual {a}, expected {b}{by}", found.x, found.y)
    };
    if let Some(largest) = &values.largest {
        tell("largest", largest)?;
    }
    match (&values.largest, &values.largest_finite) {
        (Some(Difference { difference: None, .. }), Some(finite)) => {
            tell("largest finite difference", finite)?;
        }
        (Some(Difference { difference: None, .. }), None) => {
            writeln!(out, "no pixel with finite values differs")?;
        }
        _ => {}
    }
    if let Some(metrics) = &values.metrics {
        writeln!(out, "{}", serde_json::to_string_pretty(metrics)?)?;
    }
    files(&mut out, comparison)?;
    Ok(out)
}

/// A number with all its digits, with an exponent where zeros would make it long.
fn short<T: Display + LowerExp + Copy>(value: T) -> String {
    /// Digits and zeros that are easily read.
    const LONG: usize = 14;
    let plain = value.to_string();
    if plain.len() > LONG { format!("{value:e}") } else { plain }
}

/// What has been written.
fn files(out: &mut String, comparison: &Comparison) -> std::fmt::Result {
    use std::fmt::Write;
    for (file, caption) in &comparison.pictures {
        writeln!(out, "{file}: {caption}")?;
    }
    if let Some(page) = &comparison.page {
        writeln!(out, "{page}")?;
    }
    Ok(())
}
