//! Text in columns of a terminal, by display width, and nouns with their number. The input must already be harmless to
//! print.

use unicode_width::UnicodeWidthStr;

/// `1 submission`, `2 submissions`.
pub fn count(number: usize, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}

/// `1 point`, `0.5 points`.
pub fn points(number: f64) -> String {
    point_range([number; 2])
}

/// `1 point`, `3..5 points`.
pub fn point_range(ends: [f64; 2]) -> String {
    of_points(&range(ends))
}

/// The same for a number or range that is written already.
pub fn of_points(number: &str) -> String {
    if number == "1" { "1 point".to_owned() } else { format!("{number} points") }
}

/// `3`, `3..5`.
pub fn range([least, most]: [f64; 2]) -> String {
    if least == most { least.to_string() } else { format!("{least}..{most}") }
}

/// The text in exactly `width` columns, cut or filled at its end.
pub fn left(text: &str, width: usize) -> String {
    let mut shown = cut(text, width);
    shown.push_str(&" ".repeat(width - shown.width()));
    shown
}

/// The text in at least `width` columns, filled at its beginning.
pub fn right(text: &str, width: usize) -> String {
    format!("{}{text}", " ".repeat(width.saturating_sub(text.width())))
}

/// The text, or its beginning and `…` when it is wider than `width`.
pub fn cut(text: &str, width: usize) -> String {
    if text.width() <= width {
        return text.to_owned();
    }
    let mut shown = String::new();
    for c in text.chars() {
        shown.push(c);
        // The width of a sequence may differ from the sum of its characters'.
        if shown.width() + 1 > width {
            shown.pop();
            break;
        }
    }
    if width > 0 {
        shown.push('…');
    }
    shown
}

/// The text in lines of at most `width` columns, broken at spaces, and inside a word only where the
/// word is longer than a line. Spaces at the beginning are kept.
pub fn wrap(text: &str, width: usize) -> Vec<String> {
    let options = textwrap::Options::new(width.max(1))
        .word_separator(textwrap::WordSeparator::AsciiSpace)
        .word_splitter(textwrap::WordSplitter::NoHyphenation);
    textwrap::wrap(text, options).into_iter().map(String::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_singular() {
        assert_eq!(count(1, "day"), "1 day");
        assert_eq!(count(0, "day"), "0 days");
        let texts = [1.0, 0.5, 0.0, 15.0].map(points);
        assert_eq!(texts, ["1 point", "0.5 points", "0 points", "15 points"]);
        assert_eq!(point_range([0.0, 1.0]), "0..1 points");
    }

    #[test]
    fn cuts_and_fills_by_display_width() {
        assert_eq!(left("abc", 5), "abc  ");
        assert_eq!(left("abcdef", 5), "abcd…");
        assert_eq!(left("山田花子", 5), "山田…");
        assert_eq!(left("山田花子", 6), "山田… ");
        assert_eq!(left("e\u{301}tude", 4), "e\u{301}tu…");
        assert_eq!(left("abc", 0), "");
        assert_eq!(right("7", 3), "  7");
    }

    #[test]
    fn wraps_at_spaces_and_inside_long_words() {
        assert_eq!(wrap("one two three", 7), ["one two", "three"]);
        assert_eq!(wrap("abcdefghij k", 4), ["abcd", "efgh", "ij k"]);
        assert_eq!(wrap("", 4), [""]);
        assert_eq!(wrap("   | x", 8), ["   | x"]);
        for width in 1..40 {
            for line in
                wrap("unshadowed 山田 radiance is wrong along 12345678901234567890 rays", width)
            {
                assert!(line.width() <= width.max(2), "{line:?}");
            }
        }
    }
}
