//! Text in columns of a terminal, by display width, and nouns with their number. The input must already be harmless to
//! print.

use unicode_width::UnicodeWidthStr;

/// `1 submission`, `2 submissions`.
pub fn count(number: usize, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}

/// `1 point`, `2.5 points`, `0..3 points`: with a number that is written already.
pub fn of_points(number: &str) -> String {
    format!("{number} point{}", if number == "1" { "" } else { "s" })
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
