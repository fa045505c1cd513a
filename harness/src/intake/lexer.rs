//! Rust source as tokens: enough to tell words from comments and strings. Not a compiler's lexer:
//! it accepts anything and never fails.

/// A token and its line, from 1.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Token {
    pub(super) line: u32,
    pub(super) kind: TokenKind,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum TokenKind {
    /// Identifier or keyword; `r#name` is `name`.
    Word(String),
    /// Text between the quotes of a string literal, escapes as written.
    Text(String),
    /// Any other single character outside literals.
    Sign(char),
    /// Character, byte and number literals, lifetimes.
    Other,
}

/// Splits `source` into tokens.
pub(super) fn tokens(source: &str) -> Vec<Token> {
    let mut lexer = Lexer { chars: source.chars().collect(), at: 0, line: 1, tokens: Vec::new() };
    // A `#!` line of a script is no attribute.
    if source.starts_with("#!") && !source.starts_with("#![") {
        lexer.skip_line();
    }
    while lexer.peek(0).is_some() {
        lexer.step();
    }
    lexer.tokens
}

struct Lexer {
    chars: Vec<char>,
    at: usize,
    line: u32,
    tokens: Vec<Token>,
}

impl Lexer {
    fn peek(&self, ahead: usize) -> Option<char> {
        self.chars.get(self.at + ahead).copied()
    }

    fn next(&mut self) -> Option<char> {
        let c = self.peek(0)?;
        self.at += 1;
        if c == '\n' {
            self.line += 1;
        }
        Some(c)
    }

    fn push(&mut self, line: u32, kind: TokenKind) {
        self.tokens.push(Token { line, kind });
    }

    fn skip_line(&mut self) {
        while self.peek(0).is_some_and(|c| c != '\n') {
            self.next();
        }
    }

    fn step(&mut self) {
        let line = self.line;
        let Some(c) = self.peek(0) else { return };
        match (c, self.peek(1)) {
            ('/', Some('/')) => self.skip_line(),
            ('/', Some('*')) => self.block_comment(),
            ('"', _) => {
                self.next();
                self.string(line);
            }
            ('\'', _) => self.quote(line),
            _ if c == '_' || c.is_alphabetic() => self.word(line),
            _ if c.is_ascii_digit() => {
                // `1..2` is two numbers: the dot is left alone.
                while self.peek(0).is_some_and(|c| c == '_' || c.is_alphanumeric()) {
                    self.next();
                }
                self.push(line, TokenKind::Other);
            }
            _ => {
                self.next();
                if !c.is_whitespace() {
                    self.push(line, TokenKind::Sign(c));
                }
            }
        }
    }

    /// Comments nest.
    fn block_comment(&mut self) {
        let mut depth = 0u32;
        loop {
            match (self.peek(0), self.peek(1)) {
                (Some('/'), Some('*')) => {
                    depth += 1;
                    self.next();
                }
                (Some('*'), Some('/')) => {
                    depth -= 1;
                    self.next();
                }
                (None, _) => return,
                _ => {}
            }
            self.next();
            if depth == 0 {
                return;
            }
        }
    }

    /// After the opening quote.
    fn string(&mut self, line: u32) {
        let mut text = String::new();
        while let Some(c) = self.next() {
            match c {
                '"' => break,
                '\\' => {
                    text.push(c);
                    text.extend(self.next());
                }
                _ => text.push(c),
            }
        }
        self.push(line, TokenKind::Text(text));
    }

    /// After `r`, at the first `#` or quote. Whether it was a raw string.
    fn raw_string(&mut self, line: u32) -> bool {
        let mut hashes = 0;
        while self.peek(hashes) == Some('#') {
            hashes += 1;
        }
        if self.peek(hashes) != Some('"') {
            return false;
        }
        self.at += hashes + 1;
        let mut text = String::new();
        while let Some(c) = self.next() {
            if c == '"' && (0..hashes).all(|i| self.peek(i) == Some('#')) {
                self.at += hashes;
                break;
            }
            text.push(c);
        }
        self.push(line, TokenKind::Text(text));
        true
    }

    fn word(&mut self, line: u32) {
        let mut word = String::new();
        while let Some(c) = self.peek(0).filter(|c| *c == '_' || c.is_alphanumeric()) {
            word.push(c);
            self.next();
        }
        match (word.as_str(), self.peek(0)) {
            ("r" | "br" | "cr", Some('"' | '#')) if self.raw_string(line) => {}
            ("r", Some('#')) if self.peek(1).is_some_and(|c| c == '_' || c.is_alphabetic()) => {
                self.next();
                self.word(line);
            }
            ("b" | "c", Some('"')) => {
                self.next();
                self.string(line);
            }
            ("b", Some('\'')) => self.quote(line),
            _ => self.push(line, TokenKind::Word(word)),
        }
    }

    /// A character literal or a lifetime: `'a'` against `'a`.
    fn quote(&mut self, line: u32) {
        self.next();
        match (self.peek(0), self.peek(1)) {
            (Some('\\'), _) => {
                self.next();
                self.next();
                // `'\u{1F600}'` has a longer rest, which stays on its line.
                while let Some(c) = self.peek(0).filter(|c| *c != '\n') {
                    self.next();
                    if c == '\'' {
                        break;
                    }
                }
            }
            (Some(_), Some('\'')) => {
                self.next();
                self.next();
            }
            _ => {
                while self.peek(0).is_some_and(|c| c == '_' || c.is_alphanumeric()) {
                    self.next();
                }
            }
        }
        self.push(line, TokenKind::Other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(source: &str) -> Vec<String> {
        tokens(source)
            .into_iter()
            .filter_map(|token| match token.kind {
                TokenKind::Word(word) => Some(format!("{word}@{}", token.line)),
                _ => None,
            })
            .collect()
    }

    #[test]
    fn comments_and_strings_hold_no_words() {
        assert_eq!(words("a // unsafe\nb"), ["a@1", "b@2"]);
        assert_eq!(words("a /* x /* unsafe */ unsafe */ b"), ["a@1", "b@1"]);
        assert_eq!(words("\"unsafe \\\" unsafe\" b"), ["b@1"]);
        assert_eq!(words("r\"\\\" b"), ["b@1"]);
        assert_eq!(words("r##\"unsafe\"# unsafe\"## b"), ["b@1"]);
        assert_eq!(words("b\"unsafe\" br#\"unsafe\"# c\"unsafe\" d"), ["d@1"]);
        assert_eq!(words("\"a\nb\nc\" d"), ["d@3"]);
        assert_eq!(words("/* never closed unsafe"), [""; 0]);
        assert_eq!(words("\"never closed unsafe"), [""; 0]);
    }

    #[test]
    fn characters_are_not_lifetimes() {
        assert_eq!(words("'\"' a '\"'"), ["a@1"]);
        assert_eq!(words("'\\'' a"), ["a@1"]);
        assert_eq!(words("'\\u{41}' a"), ["a@1"]);
        assert_eq!(words("b'\\\\' a"), ["a@1"]);
        assert_eq!(words("f<'a>(x: &'a str) { 'outer: loop }"), ["f@1", "x@1", "str@1", "loop@1"]);
        assert_eq!(words("'_' a"), ["a@1"]);
    }

    #[test]
    fn raw_identifiers_are_words() {
        assert_eq!(words("r#std::fs r#type"), ["std@1", "fs@1", "type@1"]);
        assert_eq!(words("1..2 0x1f_u32 x"), ["x@1"]);
        assert_eq!(words("#!/bin/unsafe\na"), ["a@2"]);
    }
}
