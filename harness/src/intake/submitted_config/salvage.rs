//! What lines say that no reader of JSON could make out: a known key, a sign and a value.

use super::keys::{Key, known_key};
use super::numbers::{FEW_DIGITS, digit_runs, is_digits};
use super::said::{Said, Word, is_same_number};

/// A known key, and all that stands behind it up to the next key.
struct Statement {
    key: Key,
    written: String,
    /// From 1.
    line: u32,
    /// One, unless several texts or numbers stand there.
    texts: Vec<String>,
}

/// What the lines of `text` say, whose first is `line` of the file; `in_renders` says whether the list of renders has
/// begun, whose entries have names and numbers of their own. `before` is what is known.
pub(super) fn read(text: &str, line: u32, mut in_renders: bool, before: &Said) -> Said {
    let mut said = Said::default();
    // Where reading stopped at a number, it belongs to the key before it.
    let start: String = text.chars().skip_while(|c| !c.is_alphanumeric()).collect();
    let start = start.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
    let is_next = |last: &&Word| is_digits(start) && line <= last.line + 1;
    if let Some(last) = before.id.last().filter(is_next) {
        said.id.push(Word { text: start.to_owned(), ..last.clone() });
    }
    for (index, text) in text.lines().enumerate() {
        let number = line + index as u32;
        for Statement { key, written, line, texts } in statements(text, number) {
            let is_own =
                !in_renders || written.chars().filter(|c| c.is_alphanumeric()).count() >= 7;
            in_renders |= key == Key::Renders;
            let slot = match key {
                Key::First => &mut said.first,
                Key::Last => &mut said.last,
                Key::Full => &mut said.full,
                Key::Id => &mut said.id,
                Key::Email | Key::Renders => continue,
            };
            let words = texts.into_iter().filter(|text| is_own && !text.is_empty());
            slot.extend(words.map(|text| Word { key: written.clone(), text, line }));
        }
    }
    said
}

/// What stands beside the names and numbers that were read, on their lines, and was not: `"260181512" or "260181513"`.
pub(super) fn beside(text: &str, known: &Said) -> Said {
    let mut said = Said::default();
    let lines: Vec<&str> = text.lines().collect();
    for (key, known, slot) in [
        (Key::First, &known.first, &mut said.first),
        (Key::Last, &known.last, &mut said.last),
        (Key::Full, &known.full, &mut said.full),
        (Key::Id, &known.id, &mut said.id),
    ] {
        for word in known {
            let line = lines.get(word.line as usize - 1).copied().unwrap_or_default();
            for own in statements(line, word.line) {
                let is_it = |text: &String| *text == word.text || is_same_number(text, &word.text);
                if own.key == key && own.texts.len() > 1 && own.texts.iter().any(is_it) {
                    let texts = own.texts.into_iter().filter(|text| !text.is_empty());
                    slot.extend(texts.map(|text| Word { text, ..word.clone() }));
                }
            }
        }
    }
    said
}

/// The statements of a line.
fn statements(text: &str, line: u32) -> Vec<Statement> {
    let text = without_comments(text);
    // What has no key of its own belongs to the value before it.
    let has_key = |piece: &str| piece.contains(SIGNS);
    let mut pieces: Vec<String> = Vec::new();
    for part in text.split(['{', '}']) {
        let mut is_first = true;
        for piece in part.split_inclusive([',', ';']) {
            match pieces.last_mut().filter(|_| !is_first && !has_key(piece)) {
                Some(before) => before.push_str(piece),
                None => pieces.push(piece.to_owned()),
            }
            is_first = false;
        }
    }
    let statement = |piece: &String| {
        let (written, value) = piece.split_once(SIGNS)?;
        let written = plain(written);
        let (key, _) = known_key(&written)?;
        // Without the key that follows: a comma is missing.
        let value = match value.split_once(SIGNS) {
            Some((value, _)) if key != Key::Email => {
                let value = value.trim_end().trim_end_matches(['"', '\'']);
                let is_sign = |c: char| c.is_whitespace() || c == '"';
                value.rsplit_once(is_sign).map_or("", |(value, _)| value)
            }
            _ => value,
        };
        Some(Statement { key, written, line, texts: texts_of(key, value) })
    };
    pieces.iter().filter_map(statement).collect()
}

/// A line without what is a comment: `// ...`, `# ...` and `/* ... */`, outside of quotes.
fn without_comments(line: &str) -> String {
    let mut text = String::new();
    let (mut is_quoted, mut is_comment) = (false, false);
    let mut before = ' ';
    let mut rest = line;
    while let Some(c) = rest.chars().next() {
        let is_end = before.is_whitespace() && !text.trim_end().ends_with(SIGNS);
        if is_comment {
            is_comment = !rest.starts_with("*/");
            rest = &rest[if is_comment { c.len_utf8() } else { 2 }..];
            continue;
        } else if !is_quoted && rest.starts_with("/*") {
            is_comment = true;
        } else if !is_quoted && is_end && (c == '#' || rest.starts_with("//")) {
            break;
        } else {
            is_quoted ^= c == '"' && before != '\\';
            text.push(c);
        }
        before = c;
        rest = &rest[c.len_utf8()..];
    }
    text
}

/// What stands between a key and its value.
const SIGNS: [char; 3] = [':', '=', '\t'];

/// The text of a value; several where several texts or student numbers stand there.
fn texts_of(key: Key, value: &str) -> Vec<String> {
    const ESCAPED: &str = "\u{1}";
    let value = value.trim().trim_start_matches(['[', '(', '>', '=']).trim_start();
    let own = value.replace("\\\"", ESCAPED);
    let parts: Vec<&str> = own.split('"').collect();
    let mut texts: Vec<String> = if own.starts_with('"') {
        let quoted = parts.iter().skip(1).step_by(2).map(|part| {
            let part = part.replace(ESCAPED, "\\\"");
            serde_json::from_str(&format!("\"{part}\"")).unwrap_or(part)
        });
        quoted.map(|text: String| text.trim().to_owned()).filter(|text| !text.is_empty()).collect()
    } else {
        Vec::new()
    };
    if texts.is_empty() {
        texts.push(plain(value));
    }
    if key == Key::Id && !own.starts_with('"') {
        let mut runs: Vec<&str> = digit_runs(value).filter(|run| run.len() >= FEW_DIGITS).collect();
        runs.dedup();
        if runs.len() > 1 {
            texts = runs.into_iter().map(str::to_owned).collect();
        }
    }
    if key == Key::Id && own.starts_with('"') {
        // Outside of the quotes.
        let outside = parts.iter().step_by(2).flat_map(|part| digit_runs(part));
        texts.extend(outside.filter(|run| run.len() >= FEW_DIGITS).map(str::to_owned));
    }
    texts
}

fn plain(text: &str) -> String {
    text.trim_matches(|c: char| !c.is_alphanumeric()).to_owned()
}
