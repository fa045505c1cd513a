//! The text of scene files, however an editor or exporter saved it.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use crate::exr_io::kind_of;

/// The bytes of a file. To read a pipe would be to wait for its writer.
///
/// # Errors
/// When it cannot be read, or is no file.
pub(super) fn read(path: &Path) -> io::Result<Vec<u8>> {
    let kind = std::fs::metadata(path)?.file_type();
    if kind.is_file() {
        return std::fs::read(path);
    }
    let found = if kind.is_dir() { "a folder" } else { "a pipe or device" };
    Err(io::Error::other(format!("expected a file, found {found}")))
}

/// Stand for bytes of a character of two bytes that would be a backslash or white space by themselves.
const HIDDEN: [(u8, char); 3] = [(b'\\', SECOND_BACKSLASH), (0x85, '\u{f785}'), (0xa0, '\u{f7a0}')];
/// Stands for a second byte 0x5C, as Shift-JIS, Big5 and GBK have it; in a path it may be a backslash all the same.
pub(super) const SECOND_BACKSLASH: char = '\u{f75c}';

/// A text in no Unicode encoding: a character for each byte, so that equal names stay equal whatever encoding it is.
/// What may be a character of two bytes (Shift-JIS, Big5, GBK, EUC) is no line continuation and no space.
fn decode_bytes(bytes: &[u8]) -> String {
    let hidden = |byte: u8| {
        let found = HIDDEN.iter().find(|(own, _)| *own == byte);
        found.map_or(char::from(byte), |(_, stands)| *stands)
    };
    let mut text = String::with_capacity(bytes.len() + bytes.len() / 8);
    let mut at = 0;
    while at < bytes.len() {
        // Without 0xA0, which is a space of Latin-1 before any letter.
        let is_pair =
            matches!(bytes[at..], [0x81..=0x9f | 0xa1..=0xfe, 0x40..=0x7e | 0x80..=0xfe, ..]);
        if is_pair {
            text.extend([hidden(bytes[at]), hidden(bytes[at + 1])]);
            at += 2;
        } else {
            text.push(char::from(bytes[at]));
            at += 1;
        }
    }
    text
}

/// The bytes of a name in a text that was read byte by byte.
#[cfg(unix)]
pub(super) fn bytes_of(name: &str) -> Option<Vec<u8>> {
    let byte = |c: char| {
        let found = HIDDEN.iter().find(|(_, stands)| *stands == c);
        found.map(|(byte, _)| *byte).or_else(|| u8::try_from(c).ok())
    };
    name.chars().map(byte).collect()
}

/// The text of a file: UTF-8 or UTF-16 by its byte order mark, UTF-16 by its zeros, else each line by itself: UTF-8,
/// else a character for each byte, as in Latin-1. A comment in another encoding so changes no name.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    if let Some(rest) = bytes.strip_prefix(b"\xef\xbb\xbf") {
        return decode(rest);
    }
    let utf16 = |rest: &[u8], unit: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = rest.as_chunks::<2>().0.iter().map(|&pair| unit(pair)).collect();
        Cow::Owned(String::from_utf16_lossy(&units))
    };
    match bytes {
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        // A text begins with a character of ASCII here.
        [1..=127, 0, 1..=127, 0, ..] => utf16(bytes, u16::from_le_bytes),
        [0, 1..=127, 0, 1..=127, ..] => utf16(bytes, u16::from_be_bytes),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => Cow::Borrowed(text),
            Err(_) => {
                let lines = bytes.split_inclusive(|byte| matches!(byte, b'\n' | b'\r'));
                let texts = lines.map(|line| match std::str::from_utf8(line) {
                    Ok(text) => Cow::Borrowed(text),
                    Err(_) => Cow::Owned(decode_bytes(line)),
                });
                Cow::Owned(texts.collect())
            }
        },
    }
}

/// A line without the white space around it and the byte order mark before it, which joined files leave inside.
fn trimmed(line: &str) -> &str {
    line.trim_start_matches(|c: char| c.is_whitespace() || c == '\u{feff}').trim_end()
}

/// The statements of an OBJ or MTL text: non-empty lines, each with the number (from 1) of the line
/// it begins on. Lines end with LF, CR or CRLF; one that ends with a backslash goes on in the next.
pub(super) struct Statements<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Statements<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self::from_line(text, 0)
    }

    /// A text behind so many lines.
    pub(super) fn from_line(text: &'a str, line: usize) -> Self {
        Self { rest: text, line }
    }

    /// What has not been read.
    pub(super) fn rest(&self) -> &'a str {
        self.rest
    }

    /// Lines that have been read.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// The next line without its end.
    fn physical_line(&mut self) -> Option<&'a str> {
        if self.rest.is_empty() {
            return None;
        }
        self.line += 1;
        let bytes = self.rest.as_bytes();
        let Some(at) = memchr::memchr2(b'\n', b'\r', bytes) else {
            return Some(std::mem::take(&mut self.rest));
        };
        let end = if bytes[at..].starts_with(b"\r\n") { at + 2 } else { at + 1 };
        let line = &self.rest[..at];
        self.rest = &self.rest[end..];
        Some(line)
    }
}

impl<'a> Iterator for Statements<'a> {
    type Item = (usize, Cow<'a, str>);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let mut line = Cow::Borrowed(trimmed(self.physical_line()?));
            let number = self.line;
            // A comment that happens to end with a backslash (a Windows path) does not go on.
            while line.ends_with('\\') && without_comment(&line).ends_with('\\') {
                let next = self.physical_line().unwrap_or_default().trim();
                let so_far = line.trim_end_matches('\\').trim_end();
                line = Cow::Owned(format!("{so_far} {next}").trim().to_owned());
            }
            if !line.is_empty() && !line.starts_with('#') {
                return Some((number, line));
            }
        }
    }
}

/// The first word of a statement and what follows it, trimmed.
pub(super) fn split_keyword(statement: &str) -> (&str, &str) {
    let end = statement.find(char::is_whitespace).unwrap_or(statement.len());
    (&statement[..end], statement[end..].trim())
}

/// A text up to its comment: a `#` at its start or behind white space.
pub(super) fn without_comment(text: &str) -> &str {
    let mut before = ' ';
    for (at, c) in text.char_indices() {
        if c == '#' && before.is_whitespace() {
            return text[..at].trim_end();
        }
        before = c;
    }
    text
}

/// A name without the quotes around it.
pub(super) fn unquoted(name: &str) -> &str {
    let name = name.trim();
    name.strip_prefix('"').and_then(|name| name.strip_suffix('"')).map_or(name, str::trim)
}

/// Keywords of ignored statements that are remarked on at most.
const LISTED: usize = 12;

/// The remarks on statements that are not supported: how many of each keyword, and the first's line.
pub(super) fn ignored_remarks(
    path: &Path,
    ignored: &BTreeMap<String, (usize, usize)>,
) -> Vec<String> {
    let path = path.display();
    let mut ignored: Vec<_> = ignored.iter().collect();
    ignored.sort_by_key(|(_, (_, line))| *line);
    let remark = |(keyword, (count, line)): &(&String, &(usize, usize))| {
        let keyword: String = keyword.chars().take(40).map(visible).collect();
        let words = if *count == 1 { "statement is" } else { "statements are" };
        format!("{path}:{line}: {count} {keyword} {words} ignored")
    };
    let mut remarks: Vec<String> = ignored.iter().take(LISTED).map(remark).collect();
    if let Some((_, (_, line))) = ignored.get(LISTED) {
        let more = ignored.len() - LISTED;
        remarks.push(format!("{path}:{line}: {more} more kinds of statements are ignored"));
    }
    remarks
}

/// What a file begins as that is none of those expected.
pub(super) fn begins_as(bytes: &[u8], text: &str) -> String {
    if let Some(kind) = kind_of(bytes) {
        return format!("begins as {kind}");
    }
    if bytes.starts_with(&[0; 4]) {
        return "begins with zeros".to_owned();
    }
    let first = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default().trim();
    let first: String = first.chars().take(40).map(visible).collect();
    format!("begins with \"{first}\"")
}

/// A character as a message shows it.
fn visible(c: char) -> char {
    if c.is_control() { '?' } else { c }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statements(text: &str) -> Vec<(usize, String)> {
        Statements::new(text).map(|(line, text)| (line, text.into_owned())).collect()
    }

    #[test]
    fn every_line_end_counts_and_backslashes_join() {
        let expected = vec![(1, "v 1 2 3".to_owned()), (3, "f 1 2 3".to_owned())];
        for end in ["\n", "\r", "\r\n"] {
            let text = "\tv 1 2 3  \n # no \\\nf 1 \\\n 2 \\\n 3\n\n".replace('\n', end);
            assert_eq!(statements(&text), expected, "{end:?}");
        }
        assert_eq!(statements("a\\"), [(1, "a".to_owned())]);
        assert_eq!(statements("\\\n\\\n"), []);
        assert_eq!(statements("map_Kd a\\b.png # c:\\\nx")[1].0, 2);
    }

    #[test]
    fn encodings_are_told_apart() {
        assert_eq!(decode("\u{feff}grün".as_bytes()), "grün");
        assert_eq!(decode(b"gr\xfcn"), "grün");
        // A name is the same in two files, whatever a comment in one of them holds.
        for end in ["\n", "\r\n", "\r"] {
            let mixed =
                [b"# k\xfcche".as_slice(), end.as_bytes(), "usemtl Böden".as_bytes()].concat();
            assert_eq!(decode(&mixed), format!("# küche{end}usemtl Böden"));
        }
        // 表 in Shift-JIS, 許 in Big5: the second byte is no continuation.
        for name in [b"\x95\x5c", b"\xb3\x5c"] {
            let text = [b"usemtl ".as_slice(), name, b"\nf 1 2 3\n"].concat();
            let text = decode(&text);
            let found = statements(&text);
            assert_eq!(found.len(), 2, "{found:?}");
            #[cfg(unix)]
            assert_eq!(bytes_of(&found[0].1["usemtl ".len()..]).as_deref(), Some(&name[..]));
        }
        assert_eq!(
            statements(&decode(b"usemtl gr\xfcn \\\n b")),
            [(1, "usemtl grün b".to_owned())]
        );
        assert_eq!(statements(&decode(b"a \x83\x85\x83\xa0 \n"))[0].1.chars().count(), 6);
        let little: Vec<u8> = "\u{feff}ü".encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = "\u{feff}ü".encode_utf16().flat_map(u16::to_be_bytes).collect();
        assert_eq!((decode(&little), decode(&big)), ("ü".into(), "ü".into()));
        let little: Vec<u8> = "v 1".encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = "v 1".encode_utf16().flat_map(u16::to_be_bytes).collect();
        assert_eq!((decode(&little), decode(&big)), ("v 1".into(), "v 1".into()));
    }

    #[test]
    fn comments_begin_behind_white_space() {
        assert_eq!(without_comment("floor # below"), "floor");
        assert_eq!(without_comment("floor#1"), "floor#1");
        assert_eq!(without_comment("# all"), "");
        assert_eq!(unquoted(" \"a b.png\" "), "a b.png");
        assert_eq!(split_keyword("usemtl\t a b "), ("usemtl", "a b"));
    }
}
