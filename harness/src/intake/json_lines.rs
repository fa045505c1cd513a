//! A small JSON reader that knows lines and goes on after the usual mistakes (other encodings, comments,
//! trailing or missing commas, other quotes), recording each as a warning. Strict parsers stop at the first
//! mistake and name none of them as a student would. Where it cannot go on, what was read so far counts.

mod scalars;

use super::encoding::decode;
use super::finding::Finding;
use crate::harmless::printable;

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

/// What was read of a file.
pub(super) struct Read {
    /// The value; none when nothing could be made out.
    pub(super) node: Option<Node>,
    /// Whether reading stopped before the end.
    pub(super) stopped: bool,
    /// What was not read, from the member or value at which reading stopped or ended, and its line from 1.
    pub(super) rest: (String, u32),
    /// The file as text.
    pub(super) text: String,
    /// Warnings; where there is none, the file is JSON.
    pub(super) findings: Vec<Finding>,
}

/// Reads `bytes`, whatever they are.
pub(super) fn parse(bytes: &[u8]) -> Read {
    let (text, encoding) = decode(bytes);
    let findings = encoding.into_iter().collect();
    let mut reader = Reader {
        chars: text.chars().collect(),
        at: 0,
        line: 1,
        begun: (0, 1),
        stopped: false,
        findings,
    };
    let node = reader.document();
    let (at, line) = if reader.stopped { reader.begun } else { (reader.at, reader.line) };
    let rest = (reader.chars[at..].iter().collect(), line);
    Read { node, stopped: reader.stopped, rest, text, findings: reader.findings }
}

/// The first slip in what should be JSON, if it is a usual one.
pub fn first_slip(text: &str) -> Option<Finding> {
    parse(text.as_bytes()).findings.into_iter().next()
}

/// The line of a key in a JSON file, from 1; `at` is the keys and indices on the way to it.
pub fn line_of(text: &str, at: &[String]) -> Option<u32> {
    let mut node = parse(text.as_bytes()).node?;
    let mut line = node.line;
    for step in at {
        (line, node) = match node.value {
            Value::Object(members) => members
                .into_iter()
                .find(|(key, ..)| key == step)
                .map(|(_, line, node)| (line, node))?,
            Value::List(items) => {
                let item = items.into_iter().nth(step.parse().ok()?)?;
                (item.line, item)
            }
            _ => return None,
        };
    }
    Some(line)
}

/// Quotes that editors and keyboards put in the place of `"`, also doubled single ones as they open and close.
fn is_quote(c: char) -> bool {
    matches!(
        c,
        '"' | '\'' | '`' | '\u{b4}' | '\u{2018}'..='\u{201f}' | '\u{ab}' | '\u{bb}' | '\u{ff02}'
    )
}

/// Whether a quote closes what another opened: curly ones and plain ones each by their own kind.
fn closes(open: char, c: char) -> bool {
    let single = |c: char| matches!(c, '\'' | '`' | '\u{b4}' | '\u{2018}'..='\u{201b}');
    match open {
        '"' | '\'' => c == open,
        _ => is_quote(c) && (single(c) == single(open) || c == '"'),
    }
}

/// Parsing cannot go on; the finding is recorded.
struct Stop;

/// Where a value stands.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    Member,
    Item,
}

struct Reader {
    chars: Vec<char>,
    at: usize,
    line: u32,
    /// Where the latest member begins, and its line.
    begun: (usize, u32),
    stopped: bool,
    findings: Vec<Finding>,
}

impl Reader {
    fn document(&mut self) -> Option<Node> {
        let node = self.value(0, Place::Member);
        self.stopped |= node.is_err();
        let node = node.ok()?;
        self.skip_space();
        if let Some(c) = self.peek().filter(|_| !self.stopped) {
            self.warn(
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

    /// Warns of what stands at character `at`.
    fn warn_at(&mut self, at: usize, code: &str, message: &str, hint: &str) {
        // One mistake may follow from another: a few are enough.
        if self.findings.len() >= 8 {
            return;
        }
        let before = &self.chars[..at];
        let line = 1 + before.iter().filter(|c| **c == '\n').count() as u32;
        let ends = |c: &char| matches!(c, '\n' | '\r');
        let begin = before.iter().rposition(ends).map_or(0, |end| end + 1);
        let text: String = self.chars[begin..].iter().take_while(|c| !ends(c)).collect();
        let finding = Finding::warning(code, message).on_line(line).hint(hint);
        self.findings.push(finding.showing(&text, at - begin));
    }

    fn warn(&mut self, code: &str, message: &str, hint: &str) {
        self.warn_at(self.at, code, message, hint);
    }

    fn stop<T>(&mut self, expected: &str) -> Result<T, Stop> {
        let found = match self.peek() {
            None => "the end of the file".to_owned(),
            Some(c) => format!("'{}'", printable(&c.to_string())),
        };
        self.warn(
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
            } else if self.at_merge_marker() {
                self.warn(
                    "json_merge",
                    "a merge conflict is not resolved",
                    "keep one of the two sides, and remove the lines of <<<<<<<, ======= and >>>>>>>",
                );
                self.skip_line();
            } else if c == '#' || (c == '/' && following == Some('/')) {
                self.warn("json_comment", "JSON has no comments", "remove the comment");
                self.skip_line();
            } else if c == '/' && following == Some('*') {
                self.warn("json_comment", "JSON has no comments", "remove the comment");
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

    fn skip_line(&mut self) {
        while self.peek().is_some_and(|c| !['\n', '\r'].contains(&c)) {
            self.next();
        }
    }

    /// Whether a line begins here that a version control system leaves round a conflict.
    fn at_merge_marker(&self) -> bool {
        let is_first = self.at == 0 || ['\n', '\r'].contains(&self.chars[self.at - 1]);
        let marks = self.chars[self.at..].iter().take_while(|c| **c == self.chars[self.at]).count();
        is_first && marks == 7 && "<|=>".contains(self.chars[self.at])
    }

    fn value(&mut self, depth: u32, place: Place) -> Result<Node, Stop> {
        self.skip_space();
        if depth > MAX_DEPTH {
            self.warn(
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
            Some(c) if is_quote(c) => Value::Text(self.text()),
            Some(c) if c == '-' || c.is_ascii_digit() => self.number(place),
            Some(c) if c.is_alphabetic() => {
                let begin = self.at;
                let word = self.words();
                match word.as_str() {
                    "null" => Value::Null,
                    "true" => Value::Bool(true),
                    "false" => Value::Bool(false),
                    _ => {
                        self.warn_at(
                            begin,
                            "json_quotes",
                            &format!("text needs double quotes: {}", printable(&word)),
                            "write \"...\" around it",
                        );
                        Value::Text(word)
                    }
                }
            }
            Some(',' | '}' | ']') => {
                self.warn("json_value", "expected a value, found none", "write it after the ':'");
                Value::Null
            }
            _ => return self.stop("a value"),
        };
        Ok(Node { line, value })
    }

    /// After a member or item: whether another follows.
    fn separator(&mut self, close: char) -> Result<bool, Stop> {
        self.skip_space();
        match self.peek() {
            Some(c) if c == close => {
                self.next();
                Ok(false)
            }
            Some(sign @ (',' | ';')) => {
                let at = self.at;
                self.next();
                self.skip_space();
                if sign == ';' {
                    self.warn_at(at, "json_separator", "expected a comma, found ';'", "write ','");
                }
                while self.peek() == Some(',') {
                    self.warn("json_trailing_comma", "two commas", "remove one of them");
                    self.next();
                    self.skip_space();
                }
                if self.peek() == Some(close) {
                    self.warn_at(
                        at,
                        "json_trailing_comma",
                        &format!("a comma before '{close}'"),
                        "remove the comma",
                    );
                    self.next();
                    return Ok(false);
                }
                Ok(true)
            }
            Some(c) if is_quote(c) || "{[".contains(c) || c.is_alphanumeric() => {
                self.warn(
                    "json_missing_comma",
                    "expected a comma before this",
                    "put a comma at the end of the line above",
                );
                Ok(true)
            }
            _ => {
                self.begun = (self.at, self.line);
                self.stop(&format!("',' or '{close}'"))
            }
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
            match self.value(depth + 1, Place::Item) {
                Ok(item) => items.push(item),
                Err(Stop) => self.stopped = true,
            }
            if self.given_up(']') {
                return Ok(Value::List(items));
            }
        }
    }

    /// Whether a list or an object ends here, by its end or because nothing more can be read.
    fn given_up(&mut self, close: char) -> bool {
        if !self.stopped {
            match self.separator(close) {
                Ok(more) => return !more,
                Err(Stop) => self.stopped = true,
            }
        }
        true
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
            match self.member(depth) {
                Ok(member) => members.push(member),
                Err(Stop) => self.stopped = true,
            }
            if self.given_up('}') {
                return Ok(Value::Object(members));
            }
        }
    }

    /// A key and its value.
    fn member(&mut self, depth: u32) -> Result<(String, u32, Node), Stop> {
        self.skip_space();
        let line = self.line;
        self.begun = (self.at, line);
        let key = match self.peek() {
            Some(c) if is_quote(c) => self.text(),
            Some(c) if c.is_alphabetic() => {
                let begin = self.at;
                let word = self.word();
                self.warn_at(
                    begin,
                    "json_quotes",
                    &format!("keys need double quotes: {}", printable(&word)),
                    "write \"...\" around it",
                );
                // Only the first of two may be missing.
                if self.peek().is_some_and(is_quote) {
                    self.next();
                }
                word
            }
            _ => return self.stop("a key in double quotes"),
        };
        self.skip_space();
        match self.peek() {
            Some(':') => {
                self.next();
            }
            Some('=') => {
                self.warn("json_colon", "expected ':' after the key, found '='", "write ':'");
                self.next();
                if self.peek() == Some('>') {
                    self.next();
                }
            }
            Some(c) if self.line == line && (is_quote(c) || c.is_ascii_digit()) => {
                self.warn("json_colon", "expected ':' after the key", "write ':' before the value");
            }
            _ => return self.stop("':' after the key"),
        }
        Ok((key, line, self.value(depth + 1, Place::Member)?))
    }
}

#[cfg(test)]
mod tests;
