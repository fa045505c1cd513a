//! What serde says of a value of another kind, in the words of JSON and TOML instead of Rust's.

use std::path::Path;

/// The message, without the names of Rust's types: `invalid type: floating point `1.5`, expected u32` becomes
/// `expected a whole number, 0 or more; found 1.5`. Other messages stay as they are.
pub fn plain(message: &str) -> String {
    // Of a number in a TOML file: `student = 0260000001`.
    if message.starts_with("unexpected leading zero") {
        return "a number begins with no 0; a student number is text in double quotes".to_owned();
    }
    // Of an object that is written as a list.
    if message.starts_with("invalid length ") && message.contains(", expected struct ") {
        return "expected an object { ... }; found a list [ ... ]".to_owned();
    }
    let told = || {
        let rest = message
            .strip_prefix("invalid type: ")
            .or_else(|| message.strip_prefix("invalid value: "))?;
        let (found, expected) = rest.split_once(", expected ")?;
        Some(format!("expected {}; found {}", wanted(expected), found_as(found)))
    };
    told().unwrap_or_else(|| message.to_owned())
}

/// What is wrong with the text of a TOML file, with its line.
pub fn toml_error(error: &toml::de::Error, text: &str, path: &Path) -> anyhow::Error {
    let at = error.span().map_or(0, |span| span.start);
    let line = 1 + text.bytes().take(at).filter(|byte| *byte == b'\n').count();
    let own = text.lines().nth(line - 1).unwrap_or_default();
    let own = own.split('#').next().unwrap_or_default();
    let hint = if own.contains(['\u{201c}', '\u{201d}', '\u{201e}', '\u{2018}', '\u{2019}']) {
        "; hint: write straight quotes: \""
    } else if own.contains('"') && own.contains('\\') {
        "; hint: write / in a path"
    } else {
        ""
    };
    anyhow::anyhow!("{}:{line}: {}{hint}", path.display(), plain(error.message()))
}

fn wanted(expected: &str) -> &str {
    match expected {
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, 0 or more",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "f32" | "f64" => "a number",
        "a string" | "a borrowed string" => "text in double quotes",
        "a boolean" => "true or false",
        "a sequence" => "a list [ ... ]",
        "a map" => "an object { ... }",
        other if other.starts_with("struct ") => "an object { ... }",
        other => other,
    }
}

fn found_as(found: &str) -> &str {
    match found {
        "map" => "an object { ... }",
        "sequence" => "a list [ ... ]",
        "null" | "unit value" => "null",
        other => {
            // Of text, the quotes belong to it; other values stand in `.
            let text = other.strip_prefix("string ");
            text.unwrap_or_else(|| other.split('`').nth(1).unwrap_or(other))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_told_in_the_words_of_the_file() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        #[allow(dead_code)]
        struct All {
            count: u32,
            share: f64,
            name: String,
            list: Vec<bool>,
        }
        for (text, said) in [
            (r#"{"count": -1}"#, "expected a whole number, 0 or more; found -1"),
            (r#"{"count": 1.5}"#, "expected a whole number, 0 or more; found 1.5"),
            (r#"{"share": "a"}"#, "expected a number; found \"a\""),
            (r#"{"name": 3}"#, "expected text in double quotes; found 3"),
            (r#"{"name": null}"#, "expected text in double quotes; found null"),
            (r#"{"list": {}}"#, "expected a list [ ... ]; found an object { ... }"),
            (r#"{"list": [1]}"#, "expected true or false; found 1"),
            (r#"[1, 2.0]"#, "expected an object { ... }; found a list [ ... ]"),
            (r#"{"counts": 1}"#, "unknown field `counts`, expected one of"),
        ] {
            let error = serde_json::from_str::<All>(text).unwrap_err().to_string();
            let found = plain(error.split(" at line ").next().unwrap());
            assert!(found.starts_with(said), "{text}: {found}");
        }
        for (text, said) in [
            ("name = 026", "a number begins with no 0; a student number is text in double quotes"),
            ("name = 26", "expected text in double quotes; found 26"),
            ("share = \"10\"", "expected a number; found \"10\""),
        ] {
            let error = toml::from_str::<All>(text).unwrap_err();
            assert_eq!(plain(error.message()), said);
        }
    }
}
