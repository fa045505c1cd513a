//! Finds code in a submission that an instructor should look at. None of it is an error: the sandbox protects the
//! machine, and these findings save reading time.

use std::collections::HashMap;
use std::fs;

use super::finding::{Finding, Findings};
use super::lexer::{Token, TokenKind, tokens};
use super::submission::{IntakeError, Submission};
use crate::harmless::printable;

/// Findings of one kind that are listed per file.
const SHOWN_PER_FILE: usize = 5;

/// Largest file that is scanned [bytes]; tokens take some forty times their text.
const MAX_SCANNED: u64 = 2 << 20;

/// Scans `src/` of a private copy.
///
/// # Errors
/// The copy cannot be read.
pub fn scan_source(submission: &Submission) -> Result<Vec<Finding>, IntakeError> {
    let mut findings = Findings::default();
    for file in &submission.files {
        let name = file.path.rsplit('/').next().unwrap_or_default();
        if matches!(name, "build.rs" | "Cargo.toml" | "Cargo.lock") {
            findings.push(
                Finding::note("source_manifest", format!("{name} is submitted, but ours is used"))
                    .at(file.path.as_str()),
            );
        }
        if !file.path.starts_with("src/") || !file.path.ends_with(".rs") {
            continue;
        }
        if file.bytes > MAX_SCANNED {
            let message =
                format!("not scanned: {} bytes, over the limit of {MAX_SCANNED}", file.bytes);
            findings.push(Finding::warning("source_large", message).at(file.path.as_str()));
            continue;
        }
        let path = submission.root.join(&file.path);
        let bytes = fs::read(&path).map_err(|e| IntakeError::io("read", &path, e))?;
        for finding in scan_text(&file.path, &String::from_utf8_lossy(&bytes)) {
            findings.push(finding);
        }
    }
    Ok(findings.into_vec())
}

/// The code of the note on a file that is included from `src/` itself, as the template does with its shaders.
pub const INCLUDE_INSIDE: &str = "source_include_inside";

/// Scans one Rust file; `path` is its path in the submission.
pub fn scan_text(path: &str, source: &str) -> Vec<Finding> {
    let tokens = tokens(source);
    let mut found: Vec<(u32, &'static str, String)> = Vec::new();
    for at in 0..tokens.len() {
        scan_at(path, &tokens, at, &mut found);
    }
    let mut counts: HashMap<&str, usize> = HashMap::new();
    let mut findings = Vec::new();
    for (line, code, message) in found {
        let count = counts.entry(code).or_default();
        *count += 1;
        if *count <= SHOWN_PER_FILE {
            let is_harmless = code == INCLUDE_INSIDE;
            let finding = if is_harmless {
                Finding::note(code, message)
            } else {
                Finding::warning(code, message)
            };
            findings.push(finding.at(path).on_line(line));
        }
    }
    let mut more: Vec<_> =
        counts.into_iter().filter(|(_, count)| *count > SHOWN_PER_FILE).collect();
    more.sort_unstable();
    findings.extend(more.into_iter().map(|(code, count)| {
        Finding::note(
            "more_findings",
            format!("{} more {code} in this file", count - SHOWN_PER_FILE),
        )
        .at(path)
    }));
    findings
}

fn word(tokens: &[Token], at: usize) -> Option<&str> {
    match &tokens.get(at)?.kind {
        TokenKind::Word(word) => Some(word),
        _ => None,
    }
}

fn is_sign(tokens: &[Token], at: usize, sign: char) -> bool {
    tokens.get(at).is_some_and(|token| token.kind == TokenKind::Sign(sign))
}

fn is_path_separator(tokens: &[Token], at: usize) -> bool {
    is_sign(tokens, at, ':') && is_sign(tokens, at + 1, ':')
}

fn scan_at(path: &str, tokens: &[Token], at: usize, found: &mut Vec<(u32, &'static str, String)>) {
    let line = tokens[at].line;
    if is_sign(tokens, at, '#') {
        let open = if is_sign(tokens, at + 1, '!') { at + 2 } else { at + 1 };
        if is_sign(tokens, open, '[') {
            scan_attribute(path, tokens, open, found);
        }
        return;
    }
    let Some(text) = word(tokens, at) else { return };
    let is_macro = is_sign(tokens, at + 1, '!') && !is_sign(tokens, at + 2, '=');
    let is_renamed = word(tokens, at + 1) == Some("as");
    match text {
        "unsafe" => found.push((line, "source_unsafe", "unsafe code".to_owned())),
        "asm" | "global_asm" | "naked_asm" if is_macro || is_renamed => {
            found.push((line, "source_asm", format!("inline assembly: {text}!")));
        }
        "env" | "option_env" if is_macro => {
            found.push((line, "source_system", format!("{text}!")));
        }
        // Methods of paths need no `std::fs`.
        "read_dir" | "read_link" | "canonicalize" | "metadata" | "symlink_metadata" | "exists"
        | "try_exists"
            if is_sign(tokens, at + 1, '(') && at > 0 && is_sign(tokens, at - 1, '.') =>
        {
            found.push((line, "source_system", format!("file access: .{text}()")));
        }
        // Brought in under another name, `include_bytes as x` escapes the macro rule.
        _ if text.starts_with("include") && (is_macro || is_renamed) => {
            found.push(include(path, tokens, at, text));
        }
        "extern" => match tokens.get(at + 1).map(|token| &token.kind) {
            Some(TokenKind::Text(abi)) => {
                found.push((line, "source_extern", format!("extern \"{}\"", printable(abi))));
            }
            Some(TokenKind::Sign('{')) => {
                found.push((line, "source_extern", "extern block".to_owned()))
            }
            Some(TokenKind::Word(next)) if next == "fn" => {
                found.push((line, "source_extern", "extern function".to_owned()));
            }
            Some(TokenKind::Word(next)) if next == "crate" => {
                let name = word(tokens, at + 2).unwrap_or_default();
                found.push((
                    line,
                    "source_extern_crate",
                    format!("extern crate {}", printable(name)),
                ));
            }
            _ => {}
        },
        "proc_macro" => found.push((line, "source_proc_macro", "proc_macro".to_owned())),
        "libc" if is_path_separator(tokens, at + 1) => {
            found.push((line, "source_system", "libc".to_owned()));
        }
        "std" if is_path_separator(tokens, at + 1) => scan_std(tokens, at + 3, found),
        "std" if is_renamed => {
            found.push((line, "source_system", "std under another name".to_owned()));
        }
        _ => {}
    }
}

/// After `std::`: one module or a group.
fn scan_std(tokens: &[Token], at: usize, found: &mut Vec<(u32, &'static str, String)>) {
    let mut check = |at: usize| {
        if let Some(module @ ("process" | "fs" | "net" | "os" | "env")) = word(tokens, at) {
            found.push((tokens[at].line, "source_system", format!("std::{module}")));
        }
        if is_sign(tokens, at, '*') {
            found.push((tokens[at].line, "source_system", "all of std".to_owned()));
        }
    };
    if !is_sign(tokens, at, '{') {
        check(at);
        return;
    }
    let mut depth = 0;
    for i in at..tokens.len() {
        if is_sign(tokens, i, '{') {
            depth += 1;
        } else if is_sign(tokens, i, '}') {
            depth -= 1;
            if depth == 0 {
                break;
            }
        } else if is_sign(tokens, i, ';') {
            // Not a `use` after all.
            break;
        }
        let starts_item = is_sign(tokens, i, '{') || is_sign(tokens, i, ',');
        if depth == 1 && starts_item {
            check(i + 1);
        }
    }
}

/// `include_str!("shaders/phong.wgsl")` of a file inside `src/` is how shaders get in.
fn include(path: &str, tokens: &[Token], at: usize, name: &str) -> (u32, &'static str, String) {
    let line = tokens[at].line;
    let target = match tokens.get(at + 3).map(|token| &token.kind) {
        Some(TokenKind::Text(target)) => target,
        _ => {
            return (line, "source_include", format!("{}! of a computed path", printable(name)));
        }
    };
    let message = format!("{}! of \"{}\"", printable(name), printable(target));
    let code = if stays_in_src(path, target) { INCLUDE_INSIDE } else { "source_include" };
    (line, code, message)
}

/// Whether `target`, relative to the folder of the source file `path`, stays below `src/`.
fn stays_in_src(path: &str, target: &str) -> bool {
    if target.starts_with('/') || target.contains(['\\', ':']) {
        return false;
    }
    // Folders below src/ of the including file.
    let mut depth = path.split('/').count().saturating_sub(2);
    for component in target.split('/') {
        match component {
            "" | "." => {}
            ".." if depth == 0 => return false,
            ".." => depth -= 1,
            _ => depth += 1,
        }
    }
    true
}

/// From the `[` of an attribute to its `]`.
fn scan_attribute(
    path: &str,
    tokens: &[Token],
    open: usize,
    found: &mut Vec<(u32, &'static str, String)>,
) {
    let mut depth = 0;
    for at in open..tokens.len() {
        if is_sign(tokens, at, '[') {
            depth += 1;
        } else if is_sign(tokens, at, ']') {
            depth -= 1;
            if depth == 0 {
                return;
            }
        }
        let line = tokens[at].line;
        match word(tokens, at) {
            Some(
                name @ ("link" | "link_args" | "link_name" | "link_section" | "link_ordinal"
                | "no_mangle" | "export_name" | "global_allocator" | "used" | "linkage"),
            ) => {
                found.push((line, "source_link", format!("attribute {name}")));
            }
            Some("feature") if at == open + 1 => {
                found.push((line, "source_feature", "attribute feature".to_owned()))
            }
            Some("path") if is_sign(tokens, at + 1, '=') => {
                if let Some(TokenKind::Text(target)) = tokens.get(at + 2).map(|token| &token.kind)
                    && !stays_in_src(path, target)
                {
                    let message =
                        format!("attribute path leads outside src/: \"{}\"", printable(target));
                    found.push((line, "source_path", message));
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn codes(source: &str) -> Vec<String> {
        scan_text("src/bsdfs/phong.rs", source)
            .iter()
            .map(|f| format!("{}@{}", f.code, f.line.unwrap_or(0)))
            .collect()
    }

    #[test]
    fn ordinary_source_is_silent() {
        let source = "//! unsafe std::fs\nuse std::f32::consts::PI;\nuse std::{fmt, sync::Arc};\n\
            #![forbid(unsafe_code)]\n#[derive(Clone)]\nstruct S<'a>(&'a str);\n\
            fn f(include: bool) -> bool { let s = \"std::process::exit asm!()\"; include != s.is_empty() }\n\
            mod process { pub fn fs() {} }\nuse glam::Vec3;\nlet path = 1;\n\
            let exists = mesh.metadata + a.exists;";
        assert_eq!(codes(source), [""; 0]);
    }

    #[test]
    fn each_rule_fires_on_its_line() {
        for (source, want) in [
            ("\nunsafe { }", "source_unsafe@2"),
            ("core::arch::asm!(\"nop\")", "source_asm@1"),
            ("global_asm!(\".incbin \\\"x\\\"\")", "source_asm@1"),
            ("include_bytes!(\"/etc/passwd\")", "source_include@1"),
            ("include_str!(\"../../x\")", "source_include@1"),
            ("include!(concat!(\"a\", \"b\"))", "source_include@1"),
            ("use core::include_bytes as x;", "source_include@1"),
            ("include_str!(\"../shaders/phong.wgsl\")", "source_include_inside@1"),
            ("extern \"C\" { fn x(); }", "source_extern@1"),
            ("extern crate wgpu;", "source_extern_crate@1"),
            ("#[link(name = \"c\")]", "source_link@1"),
            ("#![link_args = \"-x\"]", "source_link@1"),
            ("#[cfg_attr(all(), no_mangle)]", "source_link@1"),
            ("#[path = \"../../other/mod.rs\"]", "source_path@1"),
            ("#[path = \"/abs.rs\"]", "source_path@1"),
            ("std::process::exit(0)", "source_system@1"),
            ("use ::std::fs::File;", "source_system@1"),
            ("use std::{fmt,\nfs::{self, File}};", "source_system@2"),
            ("use std::{io, collections::{env, x}, net};", "source_system@1"),
            ("r#std::r#env::var(\"x\")", "source_system@1"),
            ("use std as s;", "source_system@1"),
            ("use std::*;", "source_system@1"),
            ("use std::{fmt, *};", "source_system@1"),
            ("Path::new(\"/\")\n.read_dir()", "source_system@2"),
            ("option_env!(\"HOME\")", "source_system@1"),
            ("use core::arch::asm as x;", "source_asm@1"),
            ("libc::fork()", "source_system@1"),
            ("use proc_macro::TokenStream;", "source_proc_macro@1"),
            ("#![feature(asm)]", "source_feature@1"),
        ] {
            assert_eq!(codes(source), [want], "{source}");
        }
        assert_eq!(codes("#[unsafe(no_mangle)]"), ["source_link@1", "source_unsafe@1"]);
        assert_eq!(codes("#[path = \"../x.rs\"] mod x;"), [""; 0]);
    }

    #[test]
    fn many_findings_are_summed_up() {
        let findings = scan_text("src/lib.rs", &"unsafe {}\n".repeat(50));
        assert_eq!(findings.len(), 6);
        assert_eq!(findings[5].message, "45 more source_unsafe in this file");
    }
}
