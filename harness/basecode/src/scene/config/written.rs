//! A scene's file as it is written: its keys with their lines, and what to say of one that cannot be read.

use std::path::Path;

use toml::de::DeTable;

use crate::scene::text::decode;
use crate::{Error, Result};

const KNOWN_KEYS: &[&str] = &[
    "input.objfile",
    "camera.eye",
    "camera.at",
    "camera.up",
    "camera.fov",
    "film.width",
    "film.height",
    "renderer.realtime",
    "renderer.type",
    "renderer.spp",
    "renderer.bonus",
];

/// A file, whose sections are sections.
pub(super) struct Written<'a> {
    path: &'a Path,
    text: &'a str,
    table: DeTable<'a>,
}

impl<'a> Written<'a> {
    pub(super) fn read(path: &'a Path, text: &'a str) -> Result<Self> {
        let table = DeTable::parse(text).map_err(|error| misread(path, text, &error))?.into_inner();
        for (name, value) in &table {
            let name = name.get_ref();
            let is_section =
                KNOWN_KEYS.iter().any(|key| key.split('.').next() == Some(name.as_ref()));
            if is_section && !value.get_ref().is_table() {
                let found = value.get_ref().type_str();
                return Err(Error::File {
                    path: path.to_owned(),
                    line: Some(line_at(text, value.span().start)),
                    message: format!("{name} is of type {found}, expected a section [{name}]"),
                });
            }
        }
        Ok(Self { path, text, table })
    }

    /// The error of a key, which names its line where it stands in the file.
    pub(super) fn wrong(&self, section: &str, key: &str, message: String) -> Error {
        Error::File { path: self.path.to_owned(), line: self.line_of_key(section, key), message }
    }

    pub(super) fn line_of_key(&self, section: &str, key: &str) -> Option<usize> {
        key_at(&self.table, section, key).map(|at| line_at(self.text, at))
    }

    /// The number of values in a list.
    pub(super) fn numbers(&self, section: &str, key: &str) -> Option<usize> {
        let value = self.table.get(section)?.get_ref().get(key)?;
        Some(value.get_ref().as_array()?.len())
    }

    /// A value of at least 1 and at most `max`.
    pub(super) fn in_range(&self, section: &str, key: &str, value: i64, max: i64) -> Result<usize> {
        usize::try_from(value).ok().filter(|_| (1..=max).contains(&value)).ok_or_else(|| {
            let message = format!("{section}.{key} is {value} but must lie between 1 and {max}");
            self.wrong(section, key, message)
        })
    }

    /// A remark on each key that nobody knows.
    pub(super) fn unknown_keys(&self) -> Vec<String> {
        let remark = |key: &str, at: usize| {
            let line = line_at(self.text, at);
            format!("{}:{line}: unknown key {key}", self.path.display())
        };
        let mut remarks = Vec::new();
        for (section, value) in &self.table {
            let name = section.get_ref();
            match value.get_ref().as_table() {
                Some(keys) => remarks.extend(
                    keys.keys()
                        .map(|key| (format!("{name}.{}", key.get_ref()), key.span().start))
                        .filter(|(key, _)| !KNOWN_KEYS.contains(&key.as_str()))
                        .map(|(key, at)| remark(&key, at)),
                ),
                None => remarks.push(remark(name, section.span().start)),
            }
        }
        remarks
    }
}

/// What is wrong with a text that is no TOML, or that has another type of value than is expected.
pub(super) fn misread(path: &Path, text: &str, error: &toml::de::Error) -> Error {
    let line = error.span().map(|span| line_at(text, span.start));
    // The parser names Rust's types.
    let mut message = error.message().to_owned();
    for (own, plain) in [
        ("expected i64", "expected a whole number"),
        ("expected f32", "expected a number"),
        ("expected a sequence of 3 f32 values", "expected 3 numbers: [x, y, z]"),
        (" as i128", ""),
        (" as u128", ""),
    ] {
        message = message.replace(own, plain);
    }
    if message.starts_with("invalid type: integer") && message.ends_with("number") {
        message = message.replace("invalid type: integer", "out of range: integer");
    }
    let statement = line.and_then(|line: usize| text.lines().nth(line - 1)).unwrap_or_default();
    match statement.split_once('=') {
        Some((key, value)) => {
            if !message.contains(&format!("`{}`", key.trim())) {
                message = format!("{}: {message}", key.trim());
            }
            message += slip(value);
        }
        // A value of several lines goes on here.
        None if statement.contains(',') => message += slip(statement),
        None => {}
    }
    if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("toml")) {
        message = format!("expected a scene's TOML file: {message}");
    }
    Error::File { path: path.to_owned(), line, message }
}

pub(super) const SLASH: &str = "; hint: write / in a path";
const POINT: &str = "; hint: write a point in square brackets: [x, y, z]";

/// The hint on a value that was written as other languages, a calculator or a word processor have it.
fn slip(value: &str) -> &'static str {
    let value = value.split('#').next().unwrap_or_default().trim();
    if value.contains(['\u{201c}', '\u{201d}', '\u{201e}', '\u{2018}', '\u{2019}']) {
        return "; hint: write straight quotes: \"";
    }
    if value.contains(['"', '\'']) {
        return if value.contains('"') && value.contains('\\') { SLASH } else { "" };
    }
    if value.contains("//") {
        return "; hint: a comment begins with #";
    }
    if value.ends_with(';') {
        return "; hint: a line ends without ;";
    }
    if value.contains(['\u{2212}', '\u{2010}', '\u{2011}', '\u{2013}', '\u{2014}']) {
        return "; hint: write a minus sign as -";
    }
    match value.to_ascii_lowercase().as_str() {
        "true" | "on" | "yes" => return "; hint: write true",
        "false" | "off" | "no" => return "; hint: write false",
        _ => {}
    }
    if value.contains(['(', '<']) || value.contains('{') && !value.contains('=') {
        return POINT;
    }
    let words = || value.split([',', '[', ']', ' ', '\t']).filter(|word| !word.is_empty());
    let is_number = |word: &str| {
        word.trim_start_matches(['+', '-', '.']).starts_with(|c: char| c.is_ascii_digit())
    };
    // `50.0 deg`
    let has_unit = words().next().is_some_and(is_number)
        && words().skip(1).all(|word| word.chars().all(char::is_alphabetic));
    if has_unit && words().count() > 1 {
        return "; hint: write a number without letters or signs behind it";
    }
    if !words().all(is_number) {
        return "";
    }
    if words().any(|word| word.ends_with(|c: char| !c.is_ascii_digit() && c != '.')) {
        return "; hint: write a number without letters or signs behind it";
    }
    let has_bare_point = |word: &str| word.trim_start_matches(['+', '-']).starts_with('.');
    if words().any(|word| has_bare_point(word) || word.ends_with('.')) {
        return "; hint: write digits on both sides of a point, as in 0.5";
    }
    match (words().count(), value.matches(',').count(), value.contains('[')) {
        (3.., commas, true) if commas < 2 => "; hint: write commas between numbers: [x, y, z]",
        (3.., _, false) => POINT,
        (2, 1, false) => "; hint: write a point in a number, as in 50.0",
        _ => "",
    }
}

/// A text whose lines end with LF: TOML knows none that ends with CR alone.
pub(super) fn plain_lines(bytes: &[u8]) -> String {
    let text = decode(bytes).replace("\r\n", "\n").replace('\r', "\n");
    // Joined files hold a byte order mark inside.
    text.replace("\n\u{feff}", "\n")
}

/// The line (from 1) that holds byte `offset`.
pub(super) fn line_at(text: &str, offset: usize) -> usize {
    1 + text.as_bytes()[..offset.min(text.len())].iter().filter(|&&b| b == b'\n').count()
}

/// The byte where `key` of `section` stands, however it is written.
pub(super) fn key_at(table: &DeTable, section: &str, key: &str) -> Option<usize> {
    let keys = table.get(section)?.get_ref().as_table()?;
    keys.keys().find(|own| own.get_ref() == key).map(|own| own.span().start)
}
