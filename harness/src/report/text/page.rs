//! Lines of text that keep within the terminal's width, whatever is in them.

use unicode_width::UnicodeWidthStr;

use super::super::harmless;
use crate::columns::{cut, wrap};

/// How a piece of text is shown; without colors all look the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    Plain,
    Heading,
    Good,
    Bad,
    Open,
    Faint,
}

impl Style {
    /// The style of points that lie in `[least, most]` of `out_of`.
    pub(super) fn of_points(least: f64, most: f64, out_of: f64) -> Self {
        if super::super::number::is_range(least, most) {
            Self::Open
        } else if least >= out_of {
            Self::Good
        } else {
            Self::Bad
        }
    }

    /// The ANSI code (select graphic rendition) that begins it.
    fn code(self) -> Option<&'static str> {
        match self {
            Self::Plain => None,
            Self::Heading => Some("1"),
            Self::Good => Some("32"),
            Self::Bad => Some("31"),
            Self::Open => Some("33"),
            Self::Faint => Some("2"),
        }
    }
}

/// How a text is to look.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Terminal columns; no line is wider.
    pub width: usize,
    /// Whether ANSI colors are allowed.
    pub colors: bool,
}

/// Text in the making.
pub(super) struct Page {
    /// No line is wider, in terminal columns, but what is quoted.
    pub(super) width: usize,
    colors: bool,
    out: String,
}

impl Page {
    /// An empty page; `width` in terminal columns.
    pub(super) fn new(width: usize, colors: bool) -> Self {
        Self { width: width.max(1), colors, out: String::new() }
    }

    /// The text, each line ending with a newline.
    pub(super) fn finish(self) -> String {
        self.out
    }

    /// An empty line.
    pub(super) fn gap(&mut self) {
        self.out.push('\n');
    }

    /// One line of pieces; what does not fit is cut off.
    pub(super) fn line(&mut self, pieces: &[(Style, &str)]) {
        let mut left = self.width;
        let last = pieces.iter().rposition(|(_, text)| !text.trim_end().is_empty());
        let used = &pieces[..last.map_or(0, |last| last + 1)];
        for (index, (style, text)) in used.iter().enumerate() {
            let clean = harmless(text);
            let text = if index + 1 == used.len() { clean.trim_end() } else { &clean };
            let shown = cut(text, left);
            left -= shown.width();
            self.styled(*style, &shown);
            if shown != *text {
                break;
            }
        }
        self.gap();
    }

    /// Text in as many lines as it needs, the first after `lead`, the others indented as deep.
    pub(super) fn wrapped(&mut self, lead: &[(Style, &str)], style: Style, text: &str) {
        let indent: usize = lead.iter().map(|(_, text)| harmless(text).width()).sum();
        // Where the lead leaves no room the text begins on a line of its own.
        let roomy = indent + 16.min(self.width / 2) <= self.width;
        let indent = if roomy { indent } else { 2.min(self.width - 1) };
        let spaces = " ".repeat(indent);
        let mut lines = wrap(&harmless(text), self.width - indent).into_iter();
        if roomy {
            let first = lines.next().unwrap_or_default();
            let mut pieces = lead.to_vec();
            pieces.push((style, &first));
            self.line(&pieces);
        } else {
            self.line(lead);
        }
        for line in lines {
            self.line(&[(Style::Plain, &spaces), (style, &line)]);
        }
    }

    /// A line of somebody else's, indented, as it is: neither wrapped nor cut off.
    pub(super) fn verbatim(&mut self, text: &str) {
        self.out.push_str("  ");
        self.out.push_str(harmless(text).trim_end());
        self.gap();
    }

    fn styled(&mut self, style: Style, text: &str) {
        match style.code().filter(|_| self.colors && !text.trim().is_empty()) {
            Some(code) => {
                self.out.push_str("\x1b[");
                self.out.push_str(code);
                self.out.push('m');
                self.out.push_str(text);
                self.out.push_str("\x1b[0m");
            }
            None => self.out.push_str(text),
        }
    }
}

/// Columns that a text takes once it is harmless.
pub(super) fn columns(text: &str) -> usize {
    harmless(text).width()
}

/// The text, once it is harmless, in exactly `width` columns, cut or filled at its end.
pub(super) fn left(text: &str, width: usize) -> String {
    crate::columns::left(&harmless(text), width)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_into_a_page_is_harmless() {
        let mut page = Page::new(80, false);
        page.line(&[(Style::Plain, "a\u{1b}[2J\nb")]);
        page.wrapped(&[(Style::Plain, "\0")], Style::Plain, "c\u{202e}");
        assert_eq!(page.finish(), "a\\u{1b}[2J\\nb\n\\u{0}c\\u{202e}\n");
        assert_eq!((columns("\0"), left("\u{1b}", 9).as_str()), (5, "\\u{1b}   "));
    }

    #[test]
    fn colors_only_when_asked() {
        for (colors, expected) in [(false, "a bc\n"), (true, "a \u{1b}[31mbc\u{1b}[0m\n")] {
            let mut page = Page::new(80, colors);
            page.line(&[(Style::Plain, "a "), (Style::Bad, "bc"), (Style::Good, "  ")]);
            assert_eq!(page.finish(), expected);
        }
    }
}
