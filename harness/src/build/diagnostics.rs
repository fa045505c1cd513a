//! The compiler's messages.

use serde::{Deserialize, Serialize};

/// A place in the submission.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SourcePlace {
    /// The file, as `src/...`.
    pub file: String,
    /// The line, counted from 1.
    pub line: u32,
}

/// One error or warning.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Diagnostic {
    /// The message alone.
    pub message: String,
    /// Where, when the compiler says so.
    pub place: Option<SourcePlace>,
    /// The whole text with the source lines that it is about. It quotes the submission: it may hold
    /// anything at all.
    pub rendered: String,
}

impl Diagnostic {
    /// `FILE:LINE: message`, without the place where there is none.
    pub fn headline(&self) -> String {
        match &self.place {
            Some(SourcePlace { file, line }) => format!("{file}:{line}: {}", self.message),
            None => self.message.clone(),
        }
    }
}

/// What the compiler said.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Diagnostics {
    pub errors: Vec<Diagnostic>,
    pub warnings: Vec<Diagnostic>,
}

#[derive(Deserialize)]
struct Message {
    message: String,
    level: String,
    #[serde(default)]
    spans: Vec<Span>,
    rendered: Option<String>,
}

#[derive(Deserialize)]
struct Span {
    file_name: String,
    line_start: u32,
    is_primary: bool,
}

/// Reads rustc's `--error-format=json`, a message a line; other lines are left out.
pub fn parse(output: &str) -> Diagnostics {
    let mut found = Diagnostics::default();
    for line in output.lines() {
        let Ok(message) = serde_json::from_str::<Message>(line) else { continue };
        // The compiler's own counts, "aborting due to 2 previous errors" and "3 warnings emitted".
        let is_count = message.spans.is_empty()
            && (message.message.starts_with("aborting due to")
                || message.message.ends_with(" emitted"));
        if is_count {
            continue;
        }
        let primary = message.spans.into_iter().find(|span| span.is_primary);
        let diagnostic = Diagnostic {
            rendered: message.rendered.unwrap_or_else(|| message.message.clone()),
            message: message.message,
            place: primary.map(|span| SourcePlace { file: span.file_name, line: span.line_start }),
        };
        match &*message.level {
            "warning" => found.warnings.push(diagnostic),
            level if level.starts_with("error") => found.errors.push(diagnostic),
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_and_warnings_are_told_apart_and_counts_left_out() {
        let output = r#"{"message":"no","level":"error","spans":[{"file_name":"a.rs","line_start":1,"is_primary":false},{"file_name":"src/lib.rs","line_start":7,"is_primary":true}],"rendered":"error: no\n"}
{"message":"hm","level":"warning","spans":[],"rendered":null}
note: not json
{"message":"aborting due to 1 previous error; 1 warning emitted","level":"error","spans":[],"rendered":"x"}
{"message":"1 warning emitted","level":"warning","spans":[],"rendered":"x"}
{"message":"For more information","level":"failure-note","spans":[],"rendered":"x"}"#;
        let found = parse(output);
        assert_eq!((found.errors.len(), found.warnings.len()), (1, 1));
        assert_eq!(found.errors[0].place, Some(SourcePlace { file: "src/lib.rs".into(), line: 7 }));
        assert_eq!(found.errors[0].rendered, "error: no\n");
        assert_eq!((&*found.warnings[0].rendered, &found.warnings[0].place), ("hm", &None));
    }
}
