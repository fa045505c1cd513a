//! A small JSON reader that knows lines and goes on after the usual mistakes (byte order mark,
//! comments, trailing or missing commas, single quotes), recording each as a finding. Strict
//! parsers stop at the first mistake and name none of them as a student would.

use super::finding::{Finding, printable};

/// A value and the line on which it starts, from 1.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Node {
    pub(super) line: u32,
    pub(super) value: Value,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Null,
    Bool(bool),
    /// The number as written: a student number must not pass through a float.
    Number(String),
    Text(String),
    List(Vec<Node>),
    /// Members in their order: key, line of the key, value.
    Object(Vec<(String, u32, Node)>),
}

impl Value {
    /// What it is, for messages.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Null => "null",
            Self::Bool(_) => "true or false",
            Self::Number(_) => "a number",
            Self::Text(_) => "text",
            Self::List(_) => "a list",
            Self::Object(_) => "an object",
        }
    }
}

const MAX_DEPTH: u32 = 32;

/// Reads `bytes`. Errors in the findings mean that the file is not JSON, even where a value could
/// be made out of it.
pub(super) fn parse(bytes: &[u8]) -> (Option<Node>, Vec<Finding>) {
    let mut findings = Vec::new();
    let mut text = bytes;
    if let Some(rest) = bytes.strip_prefix(b"\xef\xbb\xbf") {
        text = rest;
        findings.push(
            Finding::error("json_bom", "expected plain UTF-8, found a byte order mark")
                .on_line(1)
                .hint("save as UTF-8 without BOM"),
        );
    }
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        findings.push(
            Finding::error("json_encoding", "expected UTF-8, found UTF-16")
                .on_line(1)
                .hint("save as UTF-8"),
        );
        return (None, findings);
    }
    if text.contains(&0) {
        findings.push(
            Finding::error("json_encoding", "expected text, found NUL bytes")
                .on_line(1)
                .hint("save as plain UTF-8 text"),
        );
        return (None, findings);
    }
    let text = match std::str::from_utf8(text) {
        Ok(text) => text.to_owned(),
        Err(e) => {
            let line = 1 + text[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count() as u32;
            findings.push(
                Finding::error("json_encoding", "expected UTF-8, found another encoding")
                    .on_line(line)
                    .hint("save as UTF-8"),
            );
            String::from_utf8_lossy(text).into_owned()
        }
    };
    let mut reader = Reader { chars: text.chars().collect(), at: 0, line: 1, findings };
    let node = reader.document();
    (node, reader.findings)
}

/// Parsing cannot go on; the finding is recorded.
struct Stop;

struct Reader {
    chars: Vec<char>,
    at: usize,
    line: u32,
    findings: Vec<Finding>,
}

impl Reader {
    fn document(&mut self) -> Option<Node> {
        let node = self.value(0).ok()?;
        self.skip_space();
        if let Some(c) = self.peek() {
            self.error(
                "json_syntax",
                &format!("expected the end of the file, found '{}'", printable(&c.to_string())),
                "remove what follows the last '}'",
            );
        }
        Some(node)
    }

    fn peek(&self) -> Option<char> {
        self.chars.get(self.at).copied()
    }

    fn next(&mut self) -> Option<char> {
        let c = self.peek()?;
        self.at += 1;
        if c == '\n' {
            self.line += 1;
        }
        Some(c)
    }

    fn error_on(&mut self, line: u32, code: &str, message: &str, hint: &str) {
        // One mistake may follow from another: a few are enough.
        if self.findings.len() < 8 {
            self.findings.push(Finding::error(code, message).on_line(line).hint(hint));
        }
    }

    fn error(&mut self, code: &str, message: &str, hint: &str) {
        self.error_on(self.line, code, message, hint);
    }

    fn stop<T>(&mut self, expected: &str) -> Result<T, Stop> {
        let found = match self.peek() {
            None => "the end of the file".to_owned(),
            Some(c) => format!("'{}'", printable(&c.to_string())),
        };
        self.error(
            "json_syntax",
            &format!("expected {expected}, found {found}"),
            "compare with the template's config.json",
        );
        Err(Stop)
    }

    fn skip_space(&mut self) {
        while let Some(c) = self.peek() {
            let following = self.chars.get(self.at + 1).copied();
            if c.is_whitespace() {
                self.next();
            } else if c == '#' || (c == '/' && following == Some('/')) {
                self.error("json_comment", "JSON has no comments", "remove the comment");
                while self.peek().is_some_and(|c| c != '\n') {
                    self.next();
                }
            } else if c == '/' && following == Some('*') {
                self.error("json_comment", "JSON has no comments", "remove the comment");
                self.next();
                self.next();
                while self.peek().is_some() {
                    if self.next() == Some('*') && self.peek() == Some('/') {
                        self.next();
                        break;
                    }
                }
            } else {
                break;
            }
        }
    }

    fn value(&mut self, depth: u32) -> Result<Node, Stop> {
        self.skip_space();
        if depth > MAX_DEPTH {
            self.error(
                "json_depth",
                "lists and objects nested too deeply",
                "compare with the template's config.json",
            );
            return Err(Stop);
        }
        let line = self.line;
        let value = match self.peek() {
            Some('{') => self.object(depth)?,
            Some('[') => self.list(depth)?,
            Some('"' | '\'' | '\u{201c}' | '\u{201d}') => Value::Text(self.text()?),
            Some(c) if c == '-' || c.is_ascii_digit() => Value::Number(self.word()),
            Some(c) if c.is_alphabetic() => {
                let word = self.word();
                match word.as_str() {
                    "null" => Value::Null,
                    "true" => Value::Bool(true),
                    "false" => Value::Bool(false),
                    _ => {
                        self.error(
                            "json_quotes",
                            &format!("text needs double quotes: {}", printable(&word)),
                            "write \"...\" around it",
                        );
                        Value::Text(word)
                    }
                }
            }
            _ => return self.stop("a value"),
        };
        Ok(Node { line, value })
    }

    /// A number, keyword or unquoted word.
    fn word(&mut self) -> String {
        let mut word = String::new();
        while let Some(c) = self.peek().filter(|c| c.is_alphanumeric() || "+-._".contains(*c)) {
            word.push(c);
            self.next();
        }
        word
    }

    fn text(&mut self) -> Result<String, Stop> {
        let line = self.line;
        let open = self.next();
        let is_plain = open == Some('"');
        if !is_plain {
            self.error("json_quotes", "text needs plain double quotes", "write \"...\" around it");
        }
        let mut text = String::new();
        loop {
            match self.peek() {
                None | Some('\n') => {
                    self.error_on(
                        line,
                        "json_syntax",
                        "the text has no closing quote on its line",
                        "close it with \"",
                    );
                    return Err(Stop);
                }
                Some('"') if is_plain => break,
                Some('\'') if open == Some('\'') => break,
                Some('\u{201c}' | '\u{201d}' | '"') if !is_plain && open != Some('\'') => break,
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
        Ok(text)
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
                self.error(
                    "json_escape",
                    "'\\u' needs four hexadecimal digits",
                    "use '/' between folders",
                );
                text.push('\\');
                return;
            }
            _ => {
                self.error(
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

    /// After a member or item: whether another follows.
    fn separator(&mut self, close: char) -> Result<bool, Stop> {
        self.skip_space();
        match self.peek() {
            Some(c) if c == close => {
                self.next();
                Ok(false)
            }
            Some(',') => {
                let line = self.line;
                self.next();
                self.skip_space();
                if self.peek() == Some(close) {
                    self.error_on(
                        line,
                        "json_trailing_comma",
                        &format!("a comma before '{close}'"),
                        "remove the comma",
                    );
                    self.next();
                    return Ok(false);
                }
                Ok(true)
            }
            Some('"' | '{') => {
                self.error(
                    "json_missing_comma",
                    "expected a comma before this",
                    "put a comma at the end of the line above",
                );
                Ok(true)
            }
            _ => self.stop(&format!("',' or '{close}'")),
        }
    }

    fn list(&mut self, depth: u32) -> Result<Value, Stop> {
        self.next();
        let mut items = Vec::new();
        self.skip_space();
        if self.peek() == Some(']') {
            self.next();
            return Ok(Value::List(items));
        }
        loop {
            items.push(self.value(depth + 1)?);
            if !self.separator(']')? {
                return Ok(Value::List(items));
            }
        }
    }

    fn object(&mut self, depth: u32) -> Result<Value, Stop> {
        self.next();
        let mut members = Vec::new();
        self.skip_space();
        if self.peek() == Some('}') {
            self.next();
            return Ok(Value::Object(members));
        }
        loop {
            self.skip_space();
            let line = self.line;
            let key = match self.peek() {
                Some('"' | '\'' | '\u{201c}' | '\u{201d}') => self.text()?,
                Some(c) if c.is_alphabetic() => {
                    let word = self.word();
                    self.error(
                        "json_quotes",
                        &format!("keys need double quotes: {}", printable(&word)),
                        "write \"...\" around it",
                    );
                    word
                }
                _ => return self.stop("a key in double quotes"),
            };
            self.skip_space();
            if self.peek() != Some(':') {
                return self.stop("':' after the key");
            }
            self.next();
            members.push((key, line, self.value(depth + 1)?));
            if !self.separator('}')? {
                return Ok(Value::Object(members));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn codes(text: &str) -> Vec<String> {
        parse(text.as_bytes())
            .1
            .iter()
            .map(|f| format!("{}@{}", f.code, f.line.unwrap_or(0)))
            .collect()
    }

    #[test]
    fn good_json_has_no_findings_and_lines() {
        let (node, findings) =
            parse(b"{\n \"a\": [1, -2.5e3, true, null],\n \"b\": \"x\\n\\u00e9\"\n}\n");
        assert_eq!(findings, []);
        let Some(Node { value: Value::Object(members), line: 1 }) = node else {
            panic!("an object")
        };
        assert_eq!((members[0].1, members[1].1), (2, 3));
        assert_eq!(members[1].2.value, Value::Text("x\n\u{e9}".to_owned()));
        let Value::List(items) = &members[0].2.value else { panic!("a list") };
        assert_eq!(items[1].value, Value::Number("-2.5e3".to_owned()));
    }

    #[test]
    fn mistakes_have_code_and_line() {
        assert_eq!(codes("\u{feff}{}"), ["json_bom@1"]);
        assert_eq!(codes("{\n\"a\": 1,\n}"), ["json_trailing_comma@2"]);
        assert_eq!(codes("{\n// x\n\"a\": 1 /* y\n */ }"), ["json_comment@2", "json_comment@3"]);
        assert_eq!(codes("{\"a\": 1\n\"b\": 2}"), ["json_missing_comma@2"]);
        assert_eq!(codes("{'a': 1}"), ["json_quotes@1"]);
        assert_eq!(codes("{a: b}"), ["json_quotes@1", "json_quotes@1"]);
        assert_eq!(codes("{\n\"a\": \"b\n}"), ["json_syntax@2"]);
        assert_eq!(codes("{\"a\": 1} x"), ["json_syntax@1"]);
        assert_eq!(codes("{\"a\": \"r\\teapot\\x\"}"), ["json_escape@1"]);
        assert_eq!(codes(""), ["json_syntax@1"]);
        assert_eq!(codes(&"[".repeat(100_000)), ["json_depth@1"]);
        assert_eq!(parse(b"\xff\xfe{\0}\0").1[0].code, "json_encoding");
        assert_eq!(parse(b"{\n\"a\": \"\xe9\"}").1[0].line, Some(2));
    }
}
