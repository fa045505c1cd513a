//! Words, numbers and texts of a JSON file, with the slips that are usual in them.

use super::{Place, Reader, Value, closes, is_quote};

impl Reader {
    /// A number, keyword or unquoted word.
    pub(super) fn word(&mut self) -> String {
        let mut word = String::new();
        while let Some(c) = self.peek().filter(|c| c.is_alphanumeric() || "+-._".contains(*c)) {
            word.push(c);
            self.next();
        }
        word
    }

    /// Unquoted words of one line, up to a sign, or to a word that is a key.
    pub(super) fn words(&mut self) -> String {
        let mut words = self.word();
        loop {
            let rest = &self.chars[self.at..];
            let gap =
                rest.iter().take_while(|c| c.is_whitespace() && !['\n', '\r'].contains(*c)).count();
            let word = rest[gap..]
                .iter()
                .take_while(|c| c.is_alphanumeric() || "-._'".contains(**c))
                .count();
            let after = rest[gap + word..].iter().find(|c| !c.is_whitespace() || **c == '\n');
            let ends =
                after.is_none_or(|c| [',', ';', '}', ']', '\n'].contains(c) || c.is_alphabetic());
            let begins = rest.get(gap).is_some_and(|c| c.is_alphabetic());
            if gap == 0 || !begins || !ends {
                return words;
            }
            words.push(' ');
            words.extend(&rest[gap..gap + word]);
            self.at += gap + word;
        }
    }

    /// A number, also one in groups: `260 123 456`, `260,123,456`. Whatever else stands behind it up to the next key or
    /// item is part of it, so that no piece of a number is taken for the whole.
    pub(super) fn number(&mut self, place: Place) -> Value {
        let (begin, mut number) = (self.at, self.word());
        let mut is_plain = true;
        loop {
            let rest = &self.chars[self.at..];
            let space = |c: &&char| c.is_whitespace() && !['\n', '\r'].contains(*c);
            let gap = rest.iter().take_while(space).count();
            let is_digit = |at: usize| rest.get(at).is_some_and(char::is_ascii_digit);
            let more = match rest.get(gap) {
                Some('0'..='9') => gap > 0,
                Some(',' | ';') => {
                    let more = rest[gap + 1..].iter().take_while(space).count();
                    place == Place::Member && is_digit(gap + 1 + more)
                }
                Some('/') => !matches!(rest.get(gap + 1), Some('/' | '*')),
                Some(c) if c.is_alphabetic() => {
                    let word = rest[gap..].iter().take_while(|c| !"\n\r,;}]:=\"".contains(**c));
                    let after = rest.get(gap + word.count());
                    after.is_none_or(|c| !":=\"".contains(*c))
                }
                Some('\'') => is_digit(gap + 1),
                Some(c) => !"\n\r}]#\"".contains(*c) && !is_quote(*c),
                None => false,
            };
            if !more {
                break;
            }
            is_plain &= is_digit(gap);
            let end = gap + 1;
            let piece: String = rest[..end].iter().collect();
            number.push_str(if gap > 0 && is_digit(gap) { " " } else { piece.trim_end() });
            self.at += if is_digit(gap) { gap } else { end };
            number.push_str(&self.word());
        }
        if number.chars().any(|c| !(c.is_alphanumeric() || "+-._".contains(c))) {
            let signs = if is_plain { "spaces" } else { "other signs" };
            let message = format!("a number with {signs} in it");
            self.warn_at(
                begin,
                "json_number",
                &message,
                "write its digits without spaces or signs",
            );
        }
        if is_plain { Value::Number(number) } else { Value::Text(number) }
    }

    /// A text in quotes; one that is not closed ends with its line.
    pub(super) fn text(&mut self) -> String {
        let begin = self.at;
        let open = self.next().unwrap_or('"');
        if open != '"' {
            self.warn_at(
                begin,
                "json_quotes",
                "text needs plain double quotes",
                "write \"...\" around it",
            );
        }
        let mut text = String::new();
        loop {
            match self.peek() {
                None | Some('\n' | '\r') => {
                    self.warn_at(
                        begin,
                        "json_open_text",
                        "the text has no closing quote on its line",
                        "close it with \"",
                    );
                    let end = |c: char| c.is_whitespace() || is_quote(c) || ",}]".contains(c);
                    return text.trim_end_matches(end).to_owned();
                }
                Some(c) if closes(open, c) => break,
                Some('\\') => {
                    self.next();
                    self.escape(&mut text);
                }
                Some(c) => {
                    text.push(c);
                    self.next();
                }
            }
        }
        self.next();
        text
    }

    fn escape(&mut self, text: &mut String) {
        let escaped = self.peek();
        let plain = match escaped {
            Some(c @ ('"' | '\\' | '/')) => c,
            Some('n') => '\n',
            Some('t') => '\t',
            Some('r') => '\r',
            Some('b') => '\u{8}',
            Some('f') => '\u{c}',
            Some('u') => {
                let digits: String = self.chars.iter().skip(self.at + 1).take(4).collect();
                let code = u32::from_str_radix(&digits, 16).ok().filter(|_| digits.len() == 4);
                if let Some(code) = code {
                    for _ in 0..5 {
                        self.next();
                    }
                    // Halves of surrogate pairs have no use in names and paths.
                    text.push(char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER));
                    return;
                }
                self.warn(
                    "json_escape",
                    "'\\u' needs four hexadecimal digits",
                    "use '/' between folders",
                );
                text.push('\\');
                return;
            }
            _ => {
                self.warn(
                    "json_escape",
                    "a backslash that starts no escape",
                    "use '/' between folders",
                );
                text.push('\\');
                return;
            }
        };
        self.next();
        text.push(plain);
    }
}
