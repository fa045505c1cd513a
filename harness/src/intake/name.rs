//! Names of entries: from hostile bytes to a relative path that cannot leave the destination.

use super::finding::Finding;
use super::limits::ArchiveLimits;
use super::tree::CONFIG_FILE;
use crate::harmless::{printable_bytes, reorders};

/// A checked path, relative, with `/` between plain components.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct SafePath {
    /// The path; empty for the root itself (`./` in a tar).
    pub(super) path: String,
    /// The bytes of the path, where some that are not UTF-8 were replaced.
    pub(super) replaced: Option<Vec<u8>>,
}

/// How an archive's names are read that hold a backslash, and what is known of its names so far. Some Windows programs
/// write a backslash between folders. It is one where no name holds a slash, or where those with a backslash hold no
/// slash and were made on Windows.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Backslashes {
    read_as: Option<Separator>,
    slash: bool,
    backslash: bool,
    /// One in a name that holds a slash too, or was not made on Windows.
    elsewhere: bool,
    /// Whether a file is called `config.json`, by either reading.
    config: [bool; 2],
}

/// Which backslashes separate folders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    /// Those that are not the second byte of a letter.
    Whole,
    /// All.
    Every,
}

impl Separator {
    fn places(self, raw: &[u8]) -> Vec<usize> {
        let halves = if self == Self::Whole { halves(raw) } else { Vec::new() };
        let all = raw.iter().enumerate().filter(|(_, byte)| **byte == b'\\');
        all.map(|(at, _)| at).filter(|at| !halves.contains(at)).collect()
    }
}

impl Backslashes {
    /// Takes in the name of an entry, and reads it as was decided.
    pub(super) fn read(&mut self, mut raw: Vec<u8>, of_windows: bool) -> Vec<u8> {
        let slash = raw.contains(&b'/');
        self.slash |= slash;
        let readings = [Separator::Whole, Separator::Every].map(|reading| reading.places(&raw));
        for (known, places) in self.config.iter_mut().zip(&readings) {
            let last = places.last().map_or(0, |at| at + 1);
            *known |= raw[last..].eq_ignore_ascii_case(CONFIG_FILE.as_bytes());
        }
        let [whole, every] = readings;
        self.backslash |= !whole.is_empty();
        self.elsewhere |= !whole.is_empty() && (slash || !of_windows);
        let places = match self.read_as {
            None => Vec::new(),
            Some(Separator::Whole) => whole,
            Some(Separator::Every) => every,
        };
        places.into_iter().for_each(|at| raw[at] = b'/');
        raw
    }

    /// How to read all names again after all are known; nothing where they were read right.
    pub(super) fn other_reading(&self) -> Option<Self> {
        let is_clear = self.backslash && !(self.slash && self.elsewhere);
        // Behind a letter with an accent in a code page of one byte a letter, it is no second byte.
        let separator = match self.config {
            [false, true] if !self.slash => Separator::Every,
            _ => Separator::Whole,
        };
        (self.read_as.is_none() && is_clear)
            .then(|| Self { read_as: Some(separator), ..Self::default() })
    }
}

/// Where a backslash is the second byte of a letter: in Shift-JIS, Big5 or GBK. A name in UTF-8 holds none.
fn halves(raw: &[u8]) -> Vec<usize> {
    if std::str::from_utf8(raw).is_ok() {
        return Vec::new();
    }
    let is_first: [fn(u8) -> bool; 2] =
        [|byte| matches!(byte, 0x81..=0x9f | 0xe0..=0xfc), |byte| matches!(byte, 0x81..=0xfe)];
    let mut found = Vec::new();
    for is_first in is_first {
        let mut at = 0;
        while at < raw.len() {
            let second = raw.get(at + 1).filter(|second| **second >= 0x40 && is_first(raw[at]));
            if second == Some(&b'\\') {
                found.push(at + 1);
            }
            at += if second.is_some() { 2 } else { 1 };
        }
    }
    found
}

/// Checks a name as an archive or folder gives it.
///
/// Bytes that are not UTF-8 become `_xHH`: the name stays distinct and readable, and the file is
/// kept. Everything that could leave the destination, or that means another path on another
/// system, is refused.
///
/// # Errors
/// The finding that refuses the name.
pub(super) fn safe_path(raw: &[u8], limits: &ArchiveLimits) -> Result<SafePath, Finding> {
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
    if !Separator::Whole.places(raw).is_empty() {
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
    let parts = raw.split(|byte| *byte == b'/').filter(|part| !matches!(*part, b"" | b"."));
    let replaced = replaced.then(|| parts.collect::<Vec<_>>().join(&b'/'));
    Ok(SafePath { path: components.join("/"), replaced })
}

/// UTF-8 text of `raw`, with every other byte written as `_xHH`, and a backslash that is half a letter.
fn decode(raw: &[u8]) -> (String, bool) {
    let halves = halves(raw);
    let mut text = String::new();
    let mut replaced = false;
    let mut at = 0;
    for chunk in raw.utf8_chunks() {
        for (place, c) in chunk.valid().char_indices() {
            match halves.contains(&(at + place)) {
                true => text.push_str("_x5C"),
                false => text.push(c),
            }
        }
        for byte in chunk.invalid() {
            replaced = true;
            text.push_str(&format!("_x{byte:02X}"));
        }
        at += chunk.valid().len() + chunk.invalid().len();
    }
    (text, replaced)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(raw: &[u8]) -> String {
        match safe_path(raw, &ArchiveLimits::default()) {
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
        // Half a letter: of Shift-JIS, also behind half-width kana, of Big5, of GBK.
        assert_eq!(code(b"\x83\x5c\x81\x5b/a.rs"), "_x83_x5C_x81[/a.rs");
        assert_eq!(code(b"\xb1\x83\x5ca.rs"), "_xB1_x83_x5Ca.rs");
        assert_eq!(code(b"\xb3\x5c/a.rs"), "_xB3_x5C/a.rs");
        assert_eq!(code(b"\xd5\x5c.rs"), "_xD5_x5C.rs");
    }

    #[test]
    fn bad_names_are_refused() {
        for (raw, want) in [
            (&b""[..], "!name_empty"),
            (b"a\0b", "!name_nul"),
            (b"..\\x", "!name_backslash"),
            (b"\xe9/..\\x", "!name_backslash"),
            ("\u{e9}\\x".as_bytes(), "!name_backslash"),
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
