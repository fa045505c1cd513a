//! Student numbers as students write them.

use unicode_normalization::UnicodeNormalization as _;

pub(super) fn is_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// Fewer digits than this are no student number by themselves: `1.5`, `+1`.
pub(super) const FEW_DIGITS: usize = 5;
/// So many digits are a whole number, though a letter follows them at once; with fewer, the letter may stand in a
/// digit's place.
const MANY_DIGITS: usize = 9;

/// Digits of a group where a number is written in groups: `2601 234 567`.
const GROUP: std::ops::RangeInclusive<usize> = 3..=4;
/// Digits of the longest number that is written in groups; two of them would have more.
const LONGEST_IN_GROUPS: usize = 12;

/// The digits of a student number that is written in groups (`260 123-456`), as a decimal number, in digits of another
/// script, or with words around it; none where it is not clear which digits count. Groups are not put together where
/// they may be two numbers or a number and a date.
pub(super) fn number_in(text: &str) -> Option<String> {
    let is_hidden = |c: &char| matches!(c, '\u{200b}'..='\u{200f}' | '\u{2060}' | '\u{feff}');
    // Wide digits are digits.
    let text: String = text.nfkc().filter(|c| !is_hidden(c)).map(plain_digit).collect();
    let between = |c: char| c.is_whitespace() || "-_".contains(c);
    let own = text.trim_start_matches('#');
    let own = own.trim_matches(|c: char| c.is_whitespace() || "_,'".contains(c));
    if is_digits(own) {
        return Some(own.to_owned());
    }
    let in_groups = |groups: &[&str]| {
        let digits = groups.concat();
        let (first, rest) = groups.split_first()?;
        let fits = first.len() <= *GROUP.end() && rest.iter().all(|one| GROUP.contains(&one.len()));
        (fits && is_digits(&digits) && digits.len() <= LONGEST_IN_GROUPS && !first.is_empty())
            .then_some(digits)
    };
    let groups: Vec<&str> = own.split(between).filter(|group| !group.is_empty()).collect();
    if let Some(digits) = in_groups(&groups).filter(|_| !own.starts_with('-')) {
        return Some(digits);
    }
    for sign in ['.', ',', '\''] {
        let groups: Vec<&str> = own.split(sign).collect();
        let of_three = groups.iter().skip(1).all(|group| group.len() == 3);
        if let Some(digits) = in_groups(&groups).filter(|_| of_three) {
            return Some(digits);
        }
    }
    // As a spreadsheet writes it, with all digits.
    let value = own.parse::<f64>().ok().filter(|value| value.fract() == 0.0);
    if let Some(value) = value.filter(|value| (1e4..9e15).contains(value)) {
        let digits = format!("{value:.0}");
        return (mantissa_digits(own) >= digits.len()).then_some(digits);
    }
    let mut runs = digit_runs(&text);
    let run = runs.next().filter(|run| run.len() >= FEW_DIGITS && runs.next().is_none())?;
    let (before, after) = text.split_once(run)?;
    let is_whole = run.len() >= MANY_DIGITS || !after.starts_with(char::is_alphanumeric);
    (is_whole && !before.ends_with(['-', '.'])).then(|| run.to_owned())
}

pub(super) fn digit_runs(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_ascii_digit()).filter(|run| !run.is_empty())
}

/// A digit of another script as that of ASCII.
fn plain_digit(c: char) -> char {
    /// Zeros: Arabic-Indic and extended, Devanagari, Bengali, Thai.
    const ZEROS: [u32; 5] = [0x660, 0x6f0, 0x966, 0x9e6, 0xe50];
    let digit =
        ZEROS.iter().find_map(|zero| (c as u32).checked_sub(*zero).filter(|digit| *digit < 10));
    digit.and_then(|digit| char::from_digit(digit, 10)).unwrap_or(c)
}

/// Digits before the exponent.
fn mantissa_digits(text: &str) -> usize {
    let mantissa = text.split(['e', 'E']).next().unwrap_or(text);
    mantissa.chars().filter(char::is_ascii_digit).count()
}

/// Why there is no number in a text, where that is known.
pub(crate) fn why_no_number(text: &str) -> Option<&'static str> {
    let is_rounded = text.parse::<f64>().is_ok_and(|value| value >= 1e4);
    if is_rounded && text.contains(['e', 'E']) {
        return Some("a spreadsheet rounded it, and digits are lost");
    }
    let text: String = text.nfkc().collect();
    let numbers = digit_runs(&text).filter(|run| run.len() >= FEW_DIGITS).count();
    (numbers > 1).then_some("these are several numbers, and it is not clear which counts")
}
