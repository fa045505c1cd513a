//! Names of entries: from hostile bytes to a relative path that cannot leave the destination.

use super::finding::Finding;
use super::limits::Limits;
use crate::harmless::{printable_bytes, reorders};

/// A checked path, relative, with `/` between plain components.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct SafePath {
    /// The path; empty for the root itself (`./` in a tar).
    pub(super) path: String,
    /// Whether bytes that are not UTF-8 were replaced.
    pub(super) replaced: bool,
}

/// Checks a name as an archive or folder gives it.
///
/// Bytes that are not UTF-8 become `_xHH`: the name stays distinct and readable, and the file is
/// kept. Everything that could leave the destination, or that means another path on another
/// system, is refused.
///
/// # Errors
/// The finding that refuses the name.
pub(super) fn safe_path(raw: &[u8], limits: &Limits) -> Result<SafePath, Finding> {
    let refuse = |code: &str, found: &str, hint: &str| {
        Err(Finding::error(
            code,
            format!("entry name refused: expected a plain relative path, found {found}"),
        )
        .at(printable_bytes(raw))
        .hint(hint))
    };
    const AGAIN: &str = "make the archive again with your system's own zip or tar program";
    if raw.is_empty() {
        return refuse("name_empty", "an empty name", AGAIN);
    }
    if raw.contains(&0) {
        return refuse("name_nul", "a NUL byte", AGAIN);
    }
    if raw.contains(&b'\\') {
        return refuse(
            "name_backslash",
            "a backslash",
            "use '/' between folders; some Windows programs write '\\'",
        );
    }
    if raw[0] == b'/' {
        return refuse(
            "path_absolute",
            "an absolute path",
            "archive the folder itself, with relative paths",
        );
    }
    if raw.len() >= 2 && raw[0].is_ascii_alphabetic() && raw[1] == b':' {
        return refuse(
            "path_drive",
            "a drive letter",
            "archive the folder itself, with relative paths",
        );
    }
    if raw.len() as u64 > limits.max_path_bytes {
        let found = format!("{} bytes, over the limit of {}", raw.len(), limits.max_path_bytes);
        return refuse("limit_path_bytes", &found, "use shorter names");
    }
    let (text, replaced) = decode(raw);
    let components: Vec<&str> = text.split('/').filter(|c| !c.is_empty() && *c != ".").collect();
    if components.contains(&"..") {
        return refuse("path_escape", "'..'", "archive the folder itself, without '..'");
    }
    // "Icon\r" is how macOS names a folder's picture; it is ignored later like .DS_Store.
    let hidden = components
        .iter()
        .filter(|c| !matches!(**c, "Icon\r" | "._Icon\r"))
        .flat_map(|c| c.chars())
        .find(|c| c.is_control() || reorders(*c));
    if let Some(c) = hidden {
        return refuse(
            "name_control",
            &format!("the control character U+{:04X}", c as u32),
            "rename the file",
        );
    }
    // Replaced bytes take four; no file system takes components longer than this.
    if components.iter().any(|c| c.len() > 255) {
        return refuse("limit_path_bytes", "a name longer than 255 bytes", "use shorter names");
    }
    if components.len() as u64 > limits.max_depth {
        let found = format!("{} levels, over the limit of {}", components.len(), limits.max_depth);
        return refuse("limit_depth", &found, "put the folders nearer to the root");
    }
    Ok(SafePath { path: components.join("/"), replaced })
}

/// UTF-8 text of `raw`, with every other byte written as `_xHH`.
fn decode(raw: &[u8]) -> (String, bool) {
    let mut text = String::new();
    let mut replaced = false;
    for chunk in raw.utf8_chunks() {
        text.push_str(chunk.valid());
        for byte in chunk.invalid() {
            replaced = true;
            text.push_str(&format!("_x{byte:02X}"));
        }
    }
    (text, replaced)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(raw: &[u8]) -> String {
        match safe_path(raw, &Limits::default()) {
            Ok(safe) => safe.path,
            Err(finding) => format!("!{}", finding.code),
        }
    }

    #[test]
    fn plain_names_pass() {
        assert_eq!(code(b"src/lib.rs"), "src/lib.rs");
        assert_eq!(code(b"./src//./lib.rs/"), "src/lib.rs");
        assert_eq!(code(b"./"), "");
        assert_eq!(code("src/\u{e9}t\u{e9}.rs".as_bytes()), "src/\u{e9}t\u{e9}.rs");
        assert_eq!(code(b"src/\xe9.rs"), "src/_xE9.rs");
        assert_eq!(code(b"src/..a.rs"), "src/..a.rs");
        assert_eq!(code(b"x/Icon\r"), "x/Icon\r");
    }

    #[test]
    fn bad_names_are_refused() {
        for (raw, want) in [
            (&b""[..], "!name_empty"),
            (b"a\0b", "!name_nul"),
            (b"..\\x", "!name_backslash"),
            (b"/etc/passwd", "!path_absolute"),
            (b"C:/x", "!path_drive"),
            (b"c:x", "!path_drive"),
            (b"a/../b", "!path_escape"),
            (b"..", "!path_escape"),
            (b"a\nb", "!name_control"),
            ("a\u{202e}b".as_bytes(), "!name_control"),
            (b"a\x7f", "!name_control"),
            (&b"a/".repeat(17), "!limit_depth"),
            (&b"a".repeat(241), "!limit_path_bytes"),
            (&b"\xff".repeat(100), "!limit_path_bytes"),
        ] {
            assert_eq!(code(raw), want);
        }
    }
}
