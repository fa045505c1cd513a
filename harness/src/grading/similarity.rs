//! Digests of a student's own source text, to find it again in another submission. Comments, white space and the
//! template's lines are left out.
//!
//! This finds copies. JPlag finds renamed or moved code (`class/jplag.rs`).

use std::collections::BTreeSet;
use std::path::Path;
use std::{fs, io};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::files::{files_below, hex};
use crate::intake::Submission;

/// Number of own characters that two students do not write alike by chance: the shortest right answer to a task of the
/// handout has fewer.
const LEAST: usize = 200;
/// Largest file that is looked at [bytes].
const MAX_BYTES: u64 = 2 << 20;

/// The own text of one file, as a digest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SourceDigest {
    /// Its path in the submission.
    pub path: String,
    /// Length of the own text in characters, blanks not counted.
    pub signs: usize,
    /// SHA-256 over the own text, in hexadecimal.
    pub sha256: String,
}

/// The files of a private copy below `src/` that hold enough of the student's own, by path. `template` is the `src`
/// that they began from.
///
/// # Errors
/// When a file cannot be read.
pub fn digests(submission: &Submission, template: &Path) -> io::Result<Vec<SourceDigest>> {
    let mut given = BTreeSet::new();
    for file in files_below(template)? {
        given.extend(code(&String::from_utf8_lossy(&fs::read(file)?)));
    }
    let is_source =
        |path: &str| path.starts_with("src/") && (path.ends_with(".rs") || path.ends_with(".wgsl"));
    let files = submission.files.iter();
    let mut digests = Vec::new();
    for file in files.filter(|file| is_source(&file.path) && file.bytes <= MAX_BYTES) {
        let text = fs::read(submission.root.join(&file.path))?;
        digests.extend(digest(&file.path, &String::from_utf8_lossy(&text), &given));
    }
    Ok(digests)
}

fn digest(path: &str, text: &str, given: &BTreeSet<String>) -> Option<SourceDigest> {
    let own: Vec<String> = code(text).into_iter().filter(|line| !given.contains(line)).collect();
    let signs = own.iter().map(|line| line.chars().count()).sum();
    let sha256 = hex(&Sha256::digest(own.concat()));
    (signs >= LEAST).then(|| SourceDigest { path: path.to_owned(), signs, sha256 })
}

/// Lines of Rust or WGSL without comments, blanks and braces, which formatters move; empty ones are left out. Those in
/// strings go, too.
fn code(text: &str) -> Vec<String> {
    let (mut lines, mut line) = (Vec::new(), String::new());
    let mut signs = text.chars().peekable();
    let (mut depth, mut quoted) = (0, false);
    while let Some(sign) = signs.next() {
        match (sign, signs.peek().copied()) {
            ('\n', _) => lines.push(std::mem::take(&mut line)),
            ('/', Some('*')) if !quoted => {
                signs.next();
                depth += 1;
            }
            ('*', Some('/')) if depth > 0 => {
                signs.next();
                depth -= 1;
            }
            _ if depth > 0 => {}
            ('/', Some('/')) if !quoted => while signs.next_if(|sign| *sign != '\n').is_some() {},
            ('\\', Some(_)) if quoted => {
                line.push(sign);
                line.extend(signs.next_if(|sign| *sign != '\n'));
            }
            _ => {
                // The quote of a character, `'"'`, opens no string.
                quoted ^= sign == '"' && !line.ends_with('\'');
                let stays = !sign.is_whitespace() && !"{}".contains(sign);
                line.extend(stays.then_some(sign));
            }
        }
    }
    lines.push(line);
    lines.retain(|line| !line.is_empty());
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_and_blanks_are_no_code() {
        let text = "// a\nlet x = 1; // b\n\n/* c /* d */\n e */ let y = \"// no /* comment\";\n'\"' // f\n\"\\\"//\" g";
        assert_eq!(code(text), ["letx=1;", "lety=\"//no/*comment\";", "'\"'", "\"\\\"//\"g"]);
    }

    #[test]
    fn a_copy_is_found_again_and_the_template_is_nobody_s() {
        let template = "fn f() {\n    todo!()\n}\n";
        let given: BTreeSet<String> = code(template).into_iter().collect();
        let own: String = (0..30).map(|n| format!("    let value_{n} = {n};\n")).collect();
        let of = |text: &str| digest("src/a.rs", text, &given);
        assert_eq!(of(template), None);
        assert_eq!(of("fn f() {\n    1 + 1\n}\n"), None);
        let first = of(&format!("fn f() {{\n{own}}}\n")).unwrap();
        let copied = own.replace(" = ", "=").replace(";\n", "; // mine\n\n");
        let copy = of(&format!("// my own\nfn f()\n{{\n/* {own} */ {copied}}}\n")).unwrap();
        assert_eq!(copy.sha256, first.sha256);
        assert_eq!(copy.signs, own.chars().filter(|sign| !sign.is_whitespace()).count());
        let other = of(&format!("fn f() {{\n{}}}\n", own.replace("value_7", "value"))).unwrap();
        assert_ne!(other.sha256, first.sha256);
    }
}
