//! The text of a class list and of its cells, as spreadsheets save them.

/// What a file is that is no text, if it is none.
pub(super) fn no_text(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [b'P', b'K', 3 | 5, 4 | 6, ..] => Some("an Excel workbook or another zip"),
        [0xd0, 0xcf, 0x11, 0xe0, ..] => Some("an old Excel workbook"),
        [b'%', b'P', b'D', b'F', ..] => Some("a PDF"),
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => None,
        bytes if bytes.contains(&0) => Some("a file that is no text"),
        _ => None,
    }
}

/// UTF-8 with or without its mark, UTF-16 with it, else Latin-1: as spreadsheets save.
pub(super) fn decode(bytes: &[u8]) -> String {
    let wide = |read: fn([u8; 2]) -> u16| {
        let units: Vec<u16> =
            bytes[2..].as_chunks::<2>().0.iter().map(|pair| read(*pair)).collect();
        String::from_utf16_lossy(&units)
    };
    match bytes {
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => text.trim_start_matches('\u{feff}').to_owned(),
            Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
        },
    }
}

/// The sign that stands between the columns of the first line.
pub(super) fn delimiter(text: &str) -> u8 {
    let head = text.lines().next().unwrap_or_default();
    let count = |sign: &u8| head.bytes().filter(|byte| byte == sign).count();
    [b',', b';', b'\t'].into_iter().rev().max_by_key(count).unwrap_or(b',')
}

/// The sign of Excel's line `sep=;`, if there is one.
pub(super) fn separator(text: &str) -> Option<u8> {
    let line = text.lines().next()?.trim_matches('"');
    let sign = line.get(..4).filter(|key| key.eq_ignore_ascii_case("sep=")).map(|_| &line[4..])?;
    match sign.as_bytes() {
        [sign @ (b',' | b';' | b'\t' | b'|')] => Some(*sign),
        _ => None,
    }
}

/// A quoted cell over several lines that is not closed, or closed where no cell ends: the line where it begins, and
/// that where it ends, if it does.
pub(super) fn open_quote(text: &str, delimiter: u8) -> Option<(usize, Option<usize>)> {
    let bytes = text.as_bytes();
    let (mut at, mut line, mut begins) = (0, 1, true);
    while at < bytes.len() {
        if !(begins && bytes[at] == b'"') {
            line += usize::from(bytes[at] == b'\n');
            begins = bytes[at] == delimiter || bytes[at] == b'\n';
            at += 1;
            continue;
        }
        let first = line;
        at += 1;
        loop {
            match (bytes.get(at), bytes.get(at + 1)) {
                (None, _) => return Some((first, None)),
                (Some(b'"'), Some(b'"')) => at += 2,
                (Some(b'"'), after) => {
                    let ends = after.is_none_or(|own| *own == delimiter || *own == b'\n');
                    if !ends && line != first {
                        return Some((first, Some(line)));
                    }
                    at += 1;
                    break;
                }
                (Some(byte), _) => {
                    line += usize::from(*byte == b'\n');
                    at += 1;
                }
            }
        }
        begins = false;
    }
    None
}

/// What is in `="0260"`, by which spreadsheets keep zeros.
pub(super) fn unwrapped(cell: &str) -> &str {
    cell.strip_prefix("=\"").and_then(|rest| rest.strip_suffix('"')).unwrap_or(cell)
}

/// `260000101` of `260000101.0`, as programs write numbers that they read as fractions.
pub(super) fn whole(number: &str) -> &str {
    let is = |part: &str, wanted: fn(&u8) -> bool| {
        !part.is_empty() && part.as_bytes().iter().all(wanted)
    };
    match number.split_once('.') {
        Some((digits, zeros)) if is(digits, u8::is_ascii_digit) && is(zeros, |b| *b == b'0') => {
            digits
        }
        _ => number,
    }
}

/// Whether a number is written as spreadsheets write large ones: `2.60000E+08`.
pub(super) fn is_rounded(number: &str) -> bool {
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let parts = number
        .split_once(['E', 'e'])
        .and_then(|(digits, power)| Some((digits.replace(',', "."), power.strip_prefix('+')?)));
    parts.is_some_and(|(number, power)| digits(&number.replacen('.', "", 1)) && digits(power))
}
