//! Files that a Rust source names in another spelling: Windows and macOS find them all the same, Linux does not.

use unicode_normalization::UnicodeNormalization as _;

use super::finding::Finding;
use super::lexer::{Token, TokenKind, tokens};

/// Macros that read a file at compile time.
const INCLUDES: [&str; 4] = ["include_str", "include_bytes", "include", "include_wgsl"];

/// A file that a source names.
struct Named<'a> {
    /// Where it may lie.
    wanted: Vec<String>,
    /// As it is written.
    written: String,
    /// The first token of the module or macro.
    token: &'a Token,
}

/// The modules and included files that the source at `path` names, whatever the build.
fn named_files<'a>(path: &str, tokens: &'a [Token]) -> Vec<Named<'a>> {
    let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let mut named = Vec::new();
    let optional = optional(tokens);
    for (at, token) in tokens.iter().enumerate().filter(|(at, _)| !optional[*at]) {
        let (wanted, written) = match &tokens[at..] {
            [mod_word, Token { kind: TokenKind::Word(name), .. }, semicolon, ..]
                if is_word(mod_word, "mod") && semicolon.kind == TokenKind::Sign(';') =>
            {
                // A path of its own is said by an attribute before it.
                let has_attribute = at > 0 && tokens[at - 1].kind == TokenKind::Sign(']');
                let candidates = if has_attribute { Vec::new() } else { module_files(path, name) };
                (candidates, name.clone())
            }
            [name, bang, open, Token { kind: TokenKind::Text(file), .. }, ..]
                if INCLUDES.iter().any(|own| is_word(name, own))
                    && bang.kind == TokenKind::Sign('!')
                    && matches!(open.kind, TokenKind::Sign('(' | '[' | '{')) =>
            {
                (join(folder, file).into_iter().collect(), file.clone())
            }
            _ => continue,
        };
        named.push(Named { wanted, written, token });
    }
    named
}

/// Whether a build may leave each token out: what a `cfg` attribute stands before, and the rules of a macro.
fn optional(tokens: &[Token]) -> Vec<bool> {
    let mut optional = vec![false; tokens.len()];
    for (at, token) in tokens.iter().enumerate() {
        let kinds: Vec<&TokenKind> = tokens[at..].iter().take(4).map(|token| &token.kind).collect();
        let end = match kinds[..] {
            [TokenKind::Sign('#'), TokenKind::Sign('['), TokenKind::Word(name), ..]
                if name == "cfg" =>
            {
                item_end(tokens, at)
            }
            [TokenKind::Sign('#'), TokenKind::Sign('!'), _, TokenKind::Word(name)]
                if name == "cfg" =>
            {
                tokens.len()
            }
            _ if is_word(token, "macro_rules") => item_end(tokens, at),
            _ => continue,
        };
        optional[at..end].fill(true);
    }
    optional
}

/// Where the item, statement or element that begins at a token ends.
fn item_end(tokens: &[Token], start: usize) -> usize {
    let (mut depth, mut has_generics) = (0, false);
    for (at, token) in tokens.iter().enumerate().skip(start) {
        match &token.kind {
            TokenKind::Word(word) => {
                has_generics |=
                    ["fn", "impl", "struct", "enum", "trait", "type"].contains(&word.as_str());
            }
            TokenKind::Sign('(' | '[' | '{') => depth += 1,
            TokenKind::Sign(')' | ']' | '}') if depth == 0 => return at,
            TokenKind::Sign(')' | ']') => depth -= 1,
            TokenKind::Sign('}') => {
                depth -= 1;
                if depth == 0 {
                    return at + 1;
                }
            }
            TokenKind::Sign(';') if depth == 0 => return at + 1,
            TokenKind::Sign(',') if depth == 0 && !has_generics => return at + 1,
            _ => {}
        }
    }
    tokens.len()
}

/// Whether the source at `path` names a file that is not there; `files` are all paths of the submission.
pub(super) fn lacks_files(path: &str, text: &str, files: &[&str]) -> bool {
    let is_there = |own: &String| files.contains(&own.as_str());
    let lacks = |own: &Named| !own.wanted.is_empty() && !own.wanted.iter().any(is_there);
    named_files(path, &tokens(text)).iter().any(lacks)
}

/// The warnings on the modules and included files that sources name and that are there in another spelling only.
/// A source that every build holds counts, as far as that can be seen. `sources` are paths and texts, `files` all paths
/// of the submission.
pub(super) fn misspelt(sources: &[(&str, String)], files: &[&str]) -> Vec<Finding> {
    let lexed: Vec<_> = sources.iter().map(|(path, text)| (*path, tokens(text))).collect();
    let named: Vec<_> =
        lexed.iter().map(|(path, tokens)| (*path, named_files(path, tokens))).collect();
    let is_root = |path: &str| path.rsplit('/').next().is_some_and(|name| is_alike(name, "lib.rs"));
    let mut open: Vec<&str> =
        named.iter().map(|(path, _)| *path).filter(|path| is_root(path)).collect();
    let mut built = open.clone();
    while let Some(source) = open.pop() {
        let names = named.iter().find(|(path, _)| *path == source).into_iter();
        let wanted: Vec<&String> =
            names.flat_map(|(_, names)| names).flat_map(|own| &own.wanted).collect();
        for (path, _) in &named {
            if !built.contains(path) && wanted.iter().any(|own| is_alike(own, path)) {
                built.push(path);
                open.push(path);
            }
        }
    }
    let built = named.into_iter().filter(|(path, _)| built.contains(path));
    built.flat_map(|(path, named)| misspelt_in(path, named, files)).collect()
}

/// The warnings on what the source at `path` names.
fn misspelt_in(path: &str, named: Vec<Named>, files: &[&str]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for Named { wanted, written, token } in named {
        let has_backslash = written.contains('\\');
        if !has_backslash && wanted.iter().any(|own| files.contains(&own.as_str())) {
            continue;
        }
        let alike = wanted.iter().find_map(|own| files.iter().find(|file| is_alike(own, file)));
        let Some(found) = alike else {
            // A module may be left out of some builds.
            if let ([only], false) = (&wanted[..], is_word(token, "mod")) {
                let message = format!("'{written}' is not there: {only}");
                let finding = Finding::warning("source_lacks_file", message).at(path);
                let finding = finding.on_line(token.line);
                findings.push(finding.hint("add it; the source does not compile without it"));
            }
            continue;
        };
        let (why, hint) = if has_backslash {
            ("a backslash between folders is one on Windows only", "write '/' between folders")
        } else if found.to_lowercase() == wanted[0].to_lowercase() || written.is_ascii() {
            ("upper and lower case count", "write both alike")
        } else {
            ("accents are written in another way", "use names without accents")
        };
        let message = format!("'{written}' is not there, but {found} is: {why}");
        let finding = Finding::warning("source_spelling", message).at(path).on_line(token.line);
        findings.push(finding.hint(format!("{hint}; it does not compile on Linux")));
    }
    findings
}

fn is_word(token: &Token, word: &str) -> bool {
    matches!(&token.kind, TokenKind::Word(own) if own == word)
}

/// Where the module `name` of the file at `path` may lie.
fn module_files(path: &str, name: &str) -> Vec<String> {
    let (folder, file) = path.rsplit_once('/').unwrap_or(("", path));
    let stem = file.strip_suffix(".rs").unwrap_or(file);
    let own =
        if ["lib", "main", "mod"].contains(&stem) { String::new() } else { format!("{stem}/") };
    [format!("{own}{name}.rs"), format!("{own}{name}/mod.rs")]
        .iter()
        .filter_map(|file| join(folder, file))
        .collect()
}

/// A path with slashes and without `..`; none where it leads out.
fn join(folder: &str, file: &str) -> Option<String> {
    let file = file.replace("\\\\", "/").replace('\\', "/");
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in file.split('/') {
        match part {
            "" | "." => {}
            ".." => _ = parts.pop()?,
            part => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

fn is_alike(one: &str, other: &str) -> bool {
    let plain = |text: &str| text.nfc().flat_map(char::to_lowercase).collect::<String>();
    plain(one) == plain(other)
}

#[cfg(test)]
mod tests {
    use super::misspelt;

    #[test]
    fn other_spellings_are_found_and_nothing_else() {
        let files = ["src/lib.rs", "src/bsdfs/mod.rs", "src/bsdfs/Phong.rs", "src/shaders/a.wgsl"];
        let said = |path: &str, text: &str| {
            let others = [
                ("src/lib.rs", "mod bsdfs; #[cfg(test)] mod tests;"),
                ("src/bsdfs/mod.rs", "mod phong;"),
            ];
            let others = others.iter().filter(|(other, _)| *other != path);
            let sources: Vec<_> = others
                .chain([&(path, text)])
                .map(|(path, text)| (*path, (*text).to_owned()))
                .collect();
            let found = misspelt(&sources, &files).into_iter().map(|finding| finding.to_string());
            found.filter(|found| found.contains(&format!("{path}:"))).collect::<Vec<_>>().join("\n")
        };
        for (path, text, expected) in [
            (
                "src/bsdfs/mod.rs",
                "\npub mod phong;",
                "src/bsdfs/mod.rs:2: 'phong' is not there, but src/bsdfs/Phong.rs is",
            ),
            ("src/bsdfs.rs", "mod phong;", "upper and lower case count"),
            ("src/lib.rs", "mod Bsdfs;", "but src/bsdfs/mod.rs is: upper"),
            (
                "src/bsdfs/Phong.rs",
                "include_str!(\"../Shaders/a.wgsl\")",
                "'../Shaders/a.wgsl' is not there",
            ),
            ("src/lib.rs", "wgpu::include_wgsl!(\"shaders/A.wgsl\")", "upper and lower case count"),
        ] {
            assert!(said(path, text).contains(expected), "{text}: {}", said(path, text));
        }
        for backslash in
            ["include_str!(\"shaders\\\\a.wgsl\")", "include_str!(r\"shaders\\a.wgsl\")"]
        {
            let found = said("src/lib.rs", backslash);
            assert!(found.contains("on Windows only"), "{backslash}: {found}");
        }
        let gone = said("src/bsdfs/mod.rs", "include_str!(\"../gone.wgsl\")");
        assert!(gone.contains("mod.rs:1: '../gone.wgsl' is not there: src/gone.wgsl"), "{gone}");
        for text in [
            "mod bsdfs;",
            "mod gone;",
            "mod Phong { }",
            "// mod Bsdfs;",
            "#[path = \"x.rs\"] mod Bsdfs;",
            "include_str!(\"shaders/a.wgsl\")",
            "include_str!(\"shaders/./../shaders/a.wgsl\")",
            "// include_str!(\"gone.wgsl\")",
            "include_str!(concat!(\"a\", \"b\"))",
            "#[cfg(test)] mod tests { #[test] fn t() { g(); include_str!(\"gone.txt\"); } }",
            "#[cfg(feature = \"extra\")] const LUT: &[u8; 4] = include_bytes!(\"gone.bin\");",
            "#[cfg(test)] fn f<A, B>() -> [u8; 2] { include!(\"gone.rs\") }",
            "f(#[cfg(windows)] include_str!(\"gone\"), 1)",
            "macro_rules! m { () => { include_str!(\"gone\") }; }",
            "#![cfg(test)] fn f() {} const A: &str = include_str!(\"gone\");",
        ] {
            assert_eq!(said("src/lib.rs", text), "", "{text}");
        }
        for text in [
            "#[cfg(test)] mod tests { } const A: &str = include_str!(\"gone\");",
            "#[cfg(test)] use a::b; const A: &str = include_str!(\"gone\");",
            "S { #[cfg(test)] a: 1, b: include_str!(\"gone\") }",
        ] {
            assert!(said("src/lib.rs", text).contains("'gone' is not there"), "{text}");
        }
        // Files that no build reaches, or tests alone.
        for path in ["src/old.rs", "src/tests.rs", "src/tests/a.rs"] {
            assert_eq!(said(path, "include_str!(\"gone\")"), "", "{path}");
        }
    }
}
