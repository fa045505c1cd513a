//! Text files as editors save them: UTF-8, UTF-16 or the code page of western Windows.

use super::finding::Finding;

/// The text in these bytes.
pub fn text_of(bytes: &[u8]) -> String {
    decode(bytes).0
}

/// The text in these bytes, and a remark on its encoding: UTF-8, UTF-16 as some editors save it, or else the code page
/// of western Windows, in which every byte is a character.
pub(super) fn decode(bytes: &[u8]) -> (String, Option<Finding>) {
    let other = |line: u32, code: &str, message: &str| {
        Some(Finding::warning(code, message).on_line(line).hint("save as UTF-8 without BOM"))
    };
    let wide = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let units = bytes.as_chunks::<2>().0.iter().map(|pair| unit(*pair));
        let text = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
        (text.collect::<String>(), other(1, "json_encoding", "expected UTF-8, found UTF-16"))
    };
    let wider = |bytes: &[u8], unit: fn([u8; 4]) -> u32| {
        let units = bytes.as_chunks::<4>().0.iter().map(|four| unit(*four));
        let text = units.map(|unit| char::from_u32(unit).unwrap_or(char::REPLACEMENT_CHARACTER));
        (text.collect::<String>(), other(1, "json_encoding", "expected UTF-8, found UTF-32"))
    };
    match bytes {
        [0xff, 0xfe, 0, 0, rest @ ..] => return wider(rest, u32::from_le_bytes),
        [0, 0, 0xfe, 0xff, rest @ ..] => return wider(rest, u32::from_be_bytes),
        [1..=255, 0, 0, 0, ..] => return wider(bytes, u32::from_le_bytes),
        [0, 0, 0, 1..=255, ..] => return wider(bytes, u32::from_be_bytes),
        [0xff, 0xfe, rest @ ..] => return wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => return wide(rest, u16::from_be_bytes),
        // A text begins with a character of ASCII here.
        [1..=255, 0, 1..=255, 0, ..] => return wide(bytes, u16::from_le_bytes),
        [0, 1..=255, 0, 1..=255, ..] => return wide(bytes, u16::from_be_bytes),
        _ => {}
    }
    let (text, bom) = match bytes.strip_prefix(b"\xef\xbb\xbf") {
        Some(rest) => (rest, other(1, "json_bom", "expected plain UTF-8, found a byte order mark")),
        None => (bytes, None),
    };
    match std::str::from_utf8(text) {
        Ok(text) => (text.to_owned(), bom),
        Err(e) => {
            let line = 1 + text[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count() as u32;
            let message = "expected UTF-8, found another encoding: read as Windows-1252";
            (
                text.iter().map(|byte| western(*byte)).collect(),
                other(line, "json_encoding", message),
            )
        }
    }
}

/// A character of Windows-1252: Latin-1 with quotes and the like where that has control characters.
fn western(byte: u8) -> char {
    const UPPER: [char; 32] = [
        '\u{20ac}', '\u{81}', '\u{201a}', '\u{192}', '\u{201e}', '\u{2026}', '\u{2020}',
        '\u{2021}', '\u{2c6}', '\u{2030}', '\u{160}', '\u{2039}', '\u{152}', '\u{8d}', '\u{17d}',
        '\u{8f}', '\u{90}', '\u{2018}', '\u{2019}', '\u{201c}', '\u{201d}', '\u{2022}', '\u{2013}',
        '\u{2014}', '\u{2dc}', '\u{2122}', '\u{161}', '\u{203a}', '\u{153}', '\u{9d}', '\u{17e}',
        '\u{178}',
    ];
    match byte {
        0x80..=0x9f => UPPER[usize::from(byte - 0x80)],
        _ => char::from(byte),
    }
}
