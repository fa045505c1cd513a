//! Student numbers as students write them.

use unicode_normalization::UnicodeNormalization as _;

pub(super) fn is_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// Fewer digits than this are no student number by themselves: `1.5`, `+1`.
const FEW_DIGITS: usize = 5;
/// So many digits are a whole number, though a letter follows them at once; with fewer, the letter may stand in a
/// digit's place.
const MANY_DIGITS: usize = 9;

/// The digits of a student number that is written in groups (`260 123-456`), as a decimal number, in digits of another
/// script, or with words around it; none where it is not clear which digits count.
pub(super) fn number_in(text: &str) -> Option<String> {
    let between = |c: char| {
        c.is_whitespace()
            || "-_,'".contains(c)
            || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2060}' | '\u{feff}')
    };
    // Wide digits are digits.
    let text: String = text.nfkc().collect();
    let own = text.trim_start_matches('#').trim_matches(|c: char| between(c) && c != '-');
    let digits: String = own.chars().filter(|c| !between(*c)).collect();
    if is_digits(&digits) {
        return (!own.starts_with('-')).then_some(digits);
    }
    let groups: Vec<&str> = own.split('.').collect();
    let (first, rest) = groups.split_first()?;
    if is_digits(first) && rest.iter().all(|group| group.len() == 3 && is_digits(group)) {
        return Some(groups.concat());
    }
    // As a spreadsheet writes it.
    let value = own.parse::<f64>().ok().filter(|value| value.fract() == 0.0);
    if let Some(value) = value.filter(|value| (1e4..9e15).contains(value)) {
        return Some(format!("{value:.0}"));
    }
    let mut runs = text.split(|c: char| !c.is_ascii_digit()).filter(|run| !run.is_empty());
    let run = runs.next().filter(|run| run.len() >= FEW_DIGITS && runs.next().is_none())?;
    let (before, after) = text.split_once(run)?;
    let is_whole = run.len() >= MANY_DIGITS || !after.starts_with(char::is_alphanumeric);
    (is_whole && !before.ends_with(['-', '.'])).then(|| run.to_owned())
}
