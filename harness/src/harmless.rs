//! Makes text from a submission safe to show; all such text passes through here.

/// The text with every character made visible that could act on a terminal, reorder or hide the
/// text around it, or break a file format: control characters (ANSI sequences begin with one),
/// bidirectional marks, invisible characters, noncharacters. They become `\u{1b}` and the like.
///
/// Applying it twice changes nothing. What a format gives a meaning to (`<`, `=`) stays: escaping
/// that is the format's own task.
pub fn harmless(text: &str) -> String {
    escaped(text, is_harmful, |c, out| out.extend(escape(c)))
}

/// Text of several lines that may hold names and values from files: [`harmless`] but for line ends
/// and tabs. All output passes through here; a name on a line of its own is [`harmless`] before.
pub(crate) fn harmless_output(text: &str) -> String {
    let acts = |c| is_harmful(c) && !matches!(c, '\n' | '\t');
    escaped(text, acts, |c, out| out.extend(escape(c)))
}

/// A value as JSON that is harmless and loses nothing: JSON has escapes of its own.
pub(crate) fn harmless_json(value: &impl serde::Serialize) -> serde_json::Result<String> {
    let text = serde_json::to_string_pretty(value)?;
    let acts = |c| is_harmful(c) && c != '\n';
    Ok(escaped(&text, acts, |c, out| {
        for unit in c.encode_utf16(&mut [0; 2]) {
            out.push_str(&format!("\\u{unit:04x}"));
        }
    }))
}

/// The text with each character that acts as `escape` writes it.
fn escaped(text: &str, acts: impl Fn(char) -> bool, escape: impl Fn(char, &mut String)) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if acts(c) {
            escape(c, &mut out);
        } else {
            out.push(c);
        }
    }
    out
}

/// A foreign name or value as harmless text of at most about 160 characters.
pub(crate) fn printable(text: &str) -> String {
    const SHOWN: usize = 160;
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => harmless(&text[..end]) + "...",
        None => harmless(text),
    }
}

/// The same of bytes, which should be UTF-8.
pub(crate) fn printable_bytes(bytes: &[u8]) -> String {
    printable(&String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]))
}

/// The lines of a text, each [`harmless`], tabs as four spaces. At most `most` lines: the first
/// and the last ones when there are more, with a line between them that says how many are left out.
pub(crate) fn harmless_lines(text: &str, most: usize) -> Vec<String> {
    /// A line of a compiler or a flood of output need not be read to its end.
    const COLUMNS: usize = 2000;
    let all: Vec<&str> = text.trim_end().lines().collect();
    let clean = |line: &&str| {
        let mut clean = harmless(&line.replace('\t', "    "));
        if let Some((end, _)) = clean.char_indices().nth(COLUMNS) {
            clean.truncate(end);
            clean.push('…');
        }
        clean
    };
    if all.len() <= most {
        return all.iter().map(clean).collect();
    }
    let tail = most / 4;
    let (head, rest) = all.split_at(most - tail);
    let (hidden, tail) = rest.split_at(rest.len() - tail);
    let between = format!("… {} more lines …", hidden.len());
    head.iter().map(clean).chain([between]).chain(tail.iter().map(clean)).collect()
}

/// The visible form of a harmful character.
fn escape(c: char) -> impl Iterator<Item = char> {
    // `escape_default` knows \n, \r and \t and escapes what is not printable ASCII.
    c.escape_default()
}

fn is_harmful(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}' | '\u{200e}' | '\u{200f}'
            // Line and paragraph separators, embeddings and overrides.
            | '\u{2028}'..='\u{202e}'
            // Word joiner, invisible operators, isolates, deprecated format characters.
            | '\u{2060}'..='\u{206f}'
            | '\u{feff}' | '\u{fff9}'..='\u{fffb}'
            // Tags: invisible text.
            | '\u{e0000}'..='\u{e0fff}')
        // Noncharacters, two of which XML forbids.
        || matches!(u32::from(c) & 0xffff, 0xfffe | 0xffff)
}

/// A cell that no spreadsheet takes for a formula: one that begins like it gets an apostrophe.
pub fn csv_cell(text: &str) -> String {
    let begins_as_formula = text.trim_start_matches(' ').starts_with([
        '=', '+', '-', '@', '\t', '\r', '\n', '\u{ff1d}', '\u{ff0b}', '\u{ff0d}', '\u{ff20}',
    ]);
    let clean = harmless(text);
    if begins_as_formula && !is_number(text) { format!("'{clean}") } else { clean }
}

/// `-12.5` and the like; nothing that a spreadsheet could read in another way.
fn is_number(text: &str) -> bool {
    let digits = text.strip_prefix(['+', '-']).unwrap_or(text);
    digits.chars().all(|c| c.is_ascii_digit() || c == '.') && text.parse::<f64>().is_ok()
}

/// Whether a character turns round the text after it: bidirectional overrides and isolates.
pub fn reorders(c: char) -> bool {
    matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_values_are_short_and_harmless() {
        assert_eq!(printable("a\u{1b}[2Jb\u{202e}c"), "a\\u{1b}[2Jb\\u{202e}c");
        assert_eq!(printable_bytes(b"a\0\xff"), "a\\u{0}\u{fffd}");
        assert_eq!(printable("\u{feff}\u{61c}\u{2028}"), "\\u{feff}\\u{61c}\\u{2028}");
        assert_eq!(printable(&"x".repeat(1000)).len(), 163);
    }

    #[test]
    fn makes_visible_what_acts() {
        for (text, expected) in [
            ("plain Ünïcode 日本 👩‍🚀", "plain Ünïcode 日本 👩‍🚀"),
            ("\u{1b}[31mred\u{1b}[0m", "\\u{1b}[31mred\\u{1b}[0m"),
            ("\u{9b}31m", "\\u{9b}31m"),
            ("a\0b\u{7f}", "a\\u{0}b\\u{7f}"),
            ("a\r\nb\tc", "a\\r\\nb\\tc"),
            ("gpj\u{202e}exe", "gpj\\u{202e}exe"),
            ("\u{2066}x\u{2069}\u{200b}\u{feff}", "\\u{2066}x\\u{2069}\\u{200b}\\u{feff}"),
            ("\u{e0041}\u{fffe}\u{10ffff}", "\\u{e0041}\\u{fffe}\\u{10ffff}"),
            ("<b>&'\"=", "<b>&'\"="),
        ] {
            assert_eq!(harmless(text), expected);
            assert_eq!(harmless(expected), expected);
        }
    }

    #[test]
    fn json_stays_json_and_the_same() {
        let names = ["a\u{1b}[2J", "\u{9b}", "\u{202e}\u{e0041}", "\n\t\"\\"];
        let json = harmless_json(&names).unwrap();
        assert!(!json.chars().any(|c| is_harmful(c) && c != '\n'), "{json}");
        assert_eq!(serde_json::from_str::<Vec<String>>(&json).unwrap(), names);
        assert_eq!(harmless_output("a\n\tb\u{1b}[2J\r\n"), "a\n\tb\\u{1b}[2J\\r\n");
    }

    #[test]
    fn nothing_harmful_is_left_of_any_character() {
        for c in '\0'..=char::MAX {
            assert!(!harmless(&c.to_string()).chars().any(is_harmful), "{c:?}");
        }
    }

    #[test]
    fn keeps_head_and_tail_of_many_lines() {
        let text = (0..100).map(|i| format!("{i}\n")).collect::<String>();
        let lines = harmless_lines(&text, 8);
        assert_eq!(lines, ["0", "1", "2", "3", "4", "5", "… 92 more lines …", "98", "99"]);
        assert_eq!(harmless_lines("a\r\n\tb\u{1b}[K\n\n", 8), ["a", "    b\\u{1b}[K"]);
        assert_eq!(harmless_lines(&"x".repeat(5000), 8)[0].chars().count(), 2001);
        assert!(harmless_lines("", 8).is_empty());
    }
}
