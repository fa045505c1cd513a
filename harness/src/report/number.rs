//! Formats numbers for reports.

use crate::diagnosis::Diagnosis;
use crate::evidence::{Check, Measure, Verdict};
use crate::rubric::{Grade, PartGrade};

/// Points with at most two digits and no trailing zeros: `95.5`, `100`.
pub(super) fn points(value: f64) -> String {
    let text = format!("{value:.2}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    // Rounding may leave "-0".
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

/// Points, or a range of them: `80..100`.
pub(super) fn range(least: f64, most: f64) -> String {
    if is_range(least, most) {
        format!("{}..{}", points(least), points(most))
    } else {
        points(least)
    }
}

/// Whether two values differ when shown.
pub(super) fn is_range(least: f64, most: f64) -> bool {
    points(least) != points(most)
}

/// The points of a part: `12.5`, `0..20`.
pub(super) fn of_part(part: &PartGrade) -> String {
    range(part.points, part.points_max)
}

/// What parts earned, a bonus by itself: `95.5 of 100 points, 20 of 20 bonus points`.
pub fn earned(parts: &[PartGrade]) -> String {
    let (bonus, plain): (Vec<&PartGrade>, Vec<&PartGrade>) =
        parts.iter().partition(|part| part.bonus);
    let mut said = Vec::new();
    for (parts, what) in [(plain, "points"), (bonus, "bonus points")] {
        if !parts.is_empty() {
            let sum = |value: fn(&PartGrade) -> f64| parts.iter().map(|part| value(part)).sum();
            let own = range(sum(|part| part.points), sum(|part| part.points_max));
            said.push(format!("{own} of {} {what}", points(sum(|part| part.out_of))));
        }
    }
    said.join(", ")
}

/// The total with what it is out of: `95.5/100`, `80..100/100`.
pub(super) fn total(grade: &Grade) -> String {
    format!("{}/{}", range(grade.points, grade.points_max), points(grade.out_of))
}

/// A value with four significant digits: `0.003`, `12.35`, `1.2e-7`, `nan`.
pub(super) fn value(value: f64) -> String {
    if value.is_nan() {
        return "nan".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "infinite" } else { "-infinite" }.to_owned();
    }
    let rounded = significant(value, 4);
    let size = rounded.abs();
    if size != 0.0 && !(1e-4..1e6).contains(&size) {
        format!("{rounded:e}")
    } else {
        format!("{rounded}")
    }
}

/// The value rounded to so many significant decimal digits.
pub(super) fn significant(value: f64, digits: usize) -> f64 {
    if !value.is_finite() {
        return value;
    }
    format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value)
}

/// A share of a whole in percent, without decimals; a share above 0 is never `0 %`.
pub(super) fn percent(part: usize, whole: usize) -> String {
    match (100.0 * part as f64 / whole.max(1) as f64).round() {
        0.0 if part > 0 => "under 1 %".to_owned(),
        percent => format!("{percent} %"),
    }
}

/// Seconds as `0.12 s`, `83.4 s`.
pub(super) fn seconds(value: f64) -> String {
    if value.abs() < 9.995 { format!("{value:.2} s") } else { format!("{value:.1} s") }
}

/// `0.53, at most 0.002`
pub(super) fn measure(measure: &Measure) -> String {
    format!("{}, at most {}", value(measure.value), value(measure.bound))
}

/// Whether a check costs points.
pub(super) fn is_failure(check: &Check) -> bool {
    matches!(check.verdict, Verdict::Fail | Verdict::NotImplemented)
}

/// The hints of the checks that decided a part and did not pass, each once.
pub(super) fn hints<'a>(part: &PartGrade, checks: &'a [Check]) -> Vec<&'a str> {
    let mut hints: Vec<&str> = Vec::new();
    for check in checks {
        let decided =
            part.evidence.iter().any(|name| name == check.id.name() || *name == check.name());
        let hint = check.hint.as_str();
        if decided && check.verdict != Verdict::Pass && !hint.is_empty() && !hints.contains(&hint) {
            hints.push(hint);
        }
    }
    hints
}

/// What a part that lost points looks like, in words; for `""` what costs nothing does.
pub(super) fn looks_like(part: &str, diagnoses: &[Diagnosis]) -> Vec<String> {
    let own = diagnoses.iter().filter(|diagnosis| diagnosis.part == part);
    let words = own.map(|diagnosis| {
        // Rounded down: 100 % is all of it.
        let percent = (100.0 * (1.0 - diagnosis.unexplained)).floor().max(0.0);
        format!("{} (explains {percent} % of the difference)", diagnosis.words)
    });
    words.collect()
}

/// A date as `2006-01-02 15:04 -07:00`; anything but RFC 3339 stays as it is.
pub(super) fn due(text: &str) -> String {
    let digits = |range: std::ops::Range<usize>| text.get(range).unwrap_or_default();
    match (text.parse::<jiff::Timestamp>(), text.get(19..)) {
        (Ok(_), Some(offset)) if digits(16..17) == ":" => {
            format!("{} {} {}", digits(0..10), digits(11..16), offset.replace('Z', "UTC"))
        }
        _ => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_short() {
        for (value, text) in [
            (100.0, "100"),
            (95.5, "95.5"),
            (12.25, "12.25"),
            (0.0, "0"),
            (-1e-9, "0"),
            (10.0, "10"),
        ] {
            assert_eq!(points(value), text);
        }
        assert_eq!(range(80.0, 100.0), "80..100");
        assert_eq!(range(80.0, 80.0 + 1e-9), "80");
    }

    #[test]
    fn shares_are_in_percent() {
        let shown = [(0, 7), (1, 300), (1, 3), (7, 7), (0, 0)].map(|(a, b)| percent(a, b));
        assert_eq!(shown, ["0 %", "under 1 %", "33 %", "100 %", "0 %"]);
    }

    #[test]
    fn dates_are_readable() {
        for (text, expected) in [
            ("2019-10-06T23:59:00-04:00", "2019-10-06 23:59 -04:00"),
            ("2019-10-06T23:59:00Z", "2019-10-06 23:59 UTC"),
            ("next week", "next week"),
            ("山田山田山田山田山田", "山田山田山田山田山田"),
        ] {
            assert_eq!(due(text), expected);
        }
    }

    #[test]
    fn values_have_four_digits() {
        for (number, text) in [
            (0.0, "0"),
            (0.003, "0.003"),
            (12.3456, "12.35"),
            (1.23456e-7, "1.235e-7"),
            (123456.0, "123500"),
            (2.5e9, "2.5e9"),
            (f64::NAN, "nan"),
            (f64::INFINITY, "infinite"),
        ] {
            assert_eq!(value(number), text);
        }
        assert_eq!(significant(0.1 + 0.2, 6), 0.3);
    }
}
