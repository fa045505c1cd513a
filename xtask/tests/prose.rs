//! All prose keeps to what CONTRIBUTING.md says: lines of at most 120 columns, sentences of at most 40 words, and on
//! average at most 20 words in a sentence. Prose is in Markdown files, comments, the help and texts in the code.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::Value;

/// Columns of a line, tables and code included.
const LINE: usize = 120;
/// Words of a sentence, in a paragraph, a list or the cell of a table.
const SENTENCE: usize = 40;
/// Words of the sentences of a page, or of a crate's comments, on average. Cells of tables are left out: most are no
/// sentences.
const AVERAGE: f64 = 20.0;

#[test]
fn documents_are_short_of_breath() {
    let root = root();
    let mut files = files_below(root, "md");
    // A table that `xtask verdicts --table` writes.
    files.retain(|file| !file.ends_with("docs/points.md"));
    assert!(files.len() > 20, "only {} files", files.len());
    let faults: Vec<String> = files
        .iter()
        .flat_map(|file| {
            let text = std::fs::read_to_string(file).expect("UTF-8");
            let name = file.strip_prefix(root).unwrap_or(file).display().to_string();
            faults(&text).into_iter().map(move |fault| format!("{name}:{fault}"))
        })
        .collect();
    assert!(faults.is_empty(), "{} faults\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn comments_messages_and_help_are_short_of_breath() {
    let root = root();
    let mut faults = Vec::new();
    let mut crates: BTreeMap<PathBuf, Average> = BTreeMap::new();
    for file in files_below(root, "rs") {
        let text = std::fs::read_to_string(&file).expect("UTF-8");
        let path = file.strip_prefix(root).unwrap_or(&file);
        if path.starts_with("samples") || path.starts_with("expected") {
            continue; // Students' code, and a copy of the template.
        }
        let comments = comments(&text);
        let mut of_file = wide_lines(&text, |line| {
            line.trim_start().starts_with("//") && !line.contains("//! # ")
        });
        of_file.extend(long_sentences(&blocks(&comments)));
        let roots = ["src", "tests", "examples", "benches", "build.rs"];
        let is_crate =
            |at: &&Path| at.components().all(|part| !roots.iter().any(|r| part.as_os_str() == *r));
        let of_crate = path.ancestors().find(is_crate).unwrap_or(path);
        crates.entry(of_crate.to_owned()).or_default().add(&blocks(&comments));
        if path.components().any(|part| part.as_os_str() == "src") {
            of_file.extend(long_sentences(&texts(&text)));
        }
        faults.extend(of_file.into_iter().map(|fault| format!("{}:{fault}", path.display())));
    }
    assert!(crates.len() > 5, "{:?}", crates.keys());
    for (of_crate, average) in crates {
        faults.extend(average.fault().map(|fault| format!("{}: {fault}", of_crate.display())));
    }
    let help = "harness/src/cli/snapshots/umbra__cli__tests__help.snap";
    let lines = std::fs::read_to_string(root.join(help)).expect("UTF-8").replace('\n', "\n\n");
    faults
        .extend(long_sentences(&blocks(&lines)).into_iter().map(|fault| format!("{help}:{fault}")));
    assert!(faults.is_empty(), "{} faults\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn every_page_is_in_the_book() {
    let docs = root().join("docs");
    let summary = std::fs::read_to_string(docs.join("SUMMARY.md")).expect("UTF-8");
    for page in files_below(&docs, "md") {
        let path = page.strip_prefix(&docs).unwrap_or(&page).display().to_string();
        let is_named = path == "SUMMARY.md" || summary.contains(&format!("]({path})"));
        assert!(is_named, "docs/SUMMARY.md lacks a line for {path}");
    }
    let targets = summary.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    for target in targets {
        assert!(docs.join(target).is_file(), "docs/SUMMARY.md names {target}, which is not there");
    }
}

#[test]
fn every_key_of_config_json_is_in_its_reference() {
    let read = |path: &str| std::fs::read_to_string(root().join(path)).expect("UTF-8");
    let config: Value = serde_json::from_str(&read("config.json")).expect("JSON");
    let page = read("docs/reference/config.md");
    let code = page.lines().flat_map(|line| line.split('`').skip(1).step_by(2));
    let documented: BTreeSet<&str> =
        code.flat_map(|code| code.split(['.', '[', ']', '*'])).collect();
    let keys = keys(&config);
    assert!(keys.len() > 50, "{keys:?}");
    let missing: Vec<_> = keys.into_iter().filter(|key| !documented.contains(key)).collect();
    assert!(missing.is_empty(), "docs/reference/config.md lacks {missing:?}");
}

/// All keys in a value, at any depth.
fn keys(value: &Value) -> BTreeSet<&str> {
    match value {
        Value::Object(map) => {
            let own = map.keys().map(String::as_str);
            own.chain(map.values().flat_map(keys)).collect()
        }
        Value::Array(items) => items.iter().flat_map(keys).collect(),
        _ => BTreeSet::new(),
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository")
}

/// The files of the tree with this extension, without what is built or hidden.
fn files_below(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in folder.read_dir().expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && name != "target" && (!name.starts_with('.') || name == ".github") {
            found.extend(files_below(&path, extension));
        } else if path.extension().is_some_and(|own| own == extension) {
            found.push(path);
        }
    }
    found
}

/// What is too long in a page.
fn faults(text: &str) -> Vec<String> {
    let blocks = blocks(text);
    let mut faults = wide_lines(text, |_| true);
    faults.extend(long_sentences(&blocks));
    let mut average = Average::default();
    average.add(&blocks);
    faults.extend(average.fault());
    faults
}

fn wide_lines(text: &str, counts: impl Fn(&str) -> bool) -> Vec<String> {
    let lines = text.lines().enumerate().filter(|(_, line)| counts(line));
    let wide = lines.filter_map(|(index, line)| {
        let width = line.chars().count();
        (width > LINE).then(|| format!("{}: {width} columns", index + 1))
    });
    wide.collect()
}

fn long_sentences(blocks: &[Block]) -> Vec<String> {
    let mut faults = Vec::new();
    for block in blocks {
        for sentence in sentences_of(&block.text) {
            let count = words_of(sentence);
            if count > SENTENCE {
                let begin: String = sentence.chars().take(60).collect();
                faults.push(format!("{}: {count} words: {begin}...", block.line));
            }
        }
    }
    faults
}

#[derive(Default)]
struct Average {
    words: usize,
    sentences: usize,
}

impl Average {
    fn add(&mut self, blocks: &[Block]) {
        for block in blocks.iter().filter(|block| !block.is_cell) {
            let counts = sentences_of(&block.text).into_iter().map(words_of);
            for count in counts.filter(|count| *count > 0) {
                self.words += count;
                self.sentences += 1;
            }
        }
    }

    fn fault(&self) -> Option<String> {
        let average = self.words as f64 / self.sentences.max(1) as f64;
        (average > AVERAGE).then(|| format!("{average:.1} words in a sentence on average"))
    }
}

/// The comments of Rust code as Markdown; every line stays in its place.
fn comments(code: &str) -> String {
    let comment = |line: &str| {
        let text = line.trim_start().strip_prefix("//")?;
        Some(text.trim_start_matches(['/', '!']).trim_start().to_owned())
    };
    code.lines().map(|line| comment(line).unwrap_or_default() + "\n").collect()
}

/// The texts between quotes in Rust code before its tests, a block for each line of them.
fn texts(code: &str) -> Vec<Block> {
    let code = code.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let mut blocks = Vec::new();
    let (mut line, mut text) = (1, None::<Block>);
    let mut rest = code.chars().peekable();
    while let Some(c) = rest.next() {
        line += usize::from(c == '\n');
        match (&mut text, c) {
            (None, '"') => text = Some(Block { line, text: String::new(), is_cell: false }),
            (None, '/') if rest.peek() == Some(&'/') => {
                while rest.next_if(|c| *c != '\n').is_some() {}
            }
            // A character: '"' begins no text.
            (None, '\'') if rest.peek() == Some(&'"') => drop(rest.next()),
            (None, _) => {}
            (Some(_), '"') => blocks.extend(text.take()),
            (Some(open), '\\') => match rest.next() {
                // The text goes on in the next line.
                Some('\n') => {
                    line += 1;
                    while rest.next_if(|c| c.is_whitespace() && *c != '\n').is_some() {}
                }
                Some('n') => open.text.push_str(". "),
                Some(escaped) => open.text.push(escaped),
                None => {}
            },
            (Some(open), '\n') => open.text.push_str(". "),
            (Some(open), c) => open.text.push(c),
        }
    }
    blocks
}

/// A paragraph, an item of a list or a cell of a table.
struct Block {
    /// Where it begins, from 1.
    line: usize,
    text: String,
    is_cell: bool,
}

/// The prose of a text: without headings and code.
fn blocks(text: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    let mut in_code = false;
    for (index, line) in text.lines().enumerate() {
        let (line, number) = (line.trim(), index + 1);
        if line.starts_with("```") {
            in_code = !in_code;
        }
        let is_row = line.starts_with('|');
        if in_code || line.is_empty() || line.starts_with("```") || line.starts_with('#') || is_row
        {
            blocks.extend(open.take());
            if is_row && !in_code {
                let cells = line.replace("\\|", " ");
                blocks.extend(cells.split('|').map(|cell| Block {
                    line: number,
                    text: cell.to_owned(),
                    is_cell: true,
                }));
            }
            continue;
        }
        let item = line.strip_prefix("- ").or_else(|| line.strip_prefix("* ")).or_else(|| {
            let rest = line.trim_start_matches(|c: char| c.is_ascii_digit());
            rest.strip_prefix(". ").filter(|_| rest.len() < line.len())
        });
        if item.is_some() {
            blocks.extend(open.take());
        }
        let text = item.unwrap_or(line);
        match &mut open {
            Some(block) => block.text += &format!(" {text}"),
            None => open = Some(Block { line: number, text: text.to_owned(), is_cell: false }),
        }
    }
    blocks.extend(open);
    blocks
}

/// A sentence ends with a full stop, a question mark or an exclamation mark before a space. What is
/// between backticks is one word.
fn sentences_of(text: &str) -> Vec<&str> {
    let mut sentences = Vec::new();
    let (mut begin, mut in_code) = (0, false);
    for (at, c) in text.char_indices() {
        in_code ^= c == '`';
        let rest = &text[at + c.len_utf8()..];
        let after = rest.trim_start_matches(['*', '_', ')', '"', '`']);
        let is_end = matches!(c, '.' | '?' | '!') && (after.is_empty() || after.starts_with(' '));
        if is_end && !in_code {
            let end = text.len() - after.len();
            sentences.push(&text[begin..end]);
            begin = end;
        }
    }
    sentences.push(&text[begin..]);
    sentences
}

/// Words hold a letter or a digit. A span of code is one, and the target of a link none.
fn words_of(sentence: &str) -> usize {
    let parts = sentence.split('`').enumerate();
    let mut plain: String =
        parts.map(|(index, part)| if index % 2 == 1 { "code" } else { part }).collect();
    while let Some((begin, end)) = plain.find("](").and_then(|begin| {
        let end = plain[begin..].find(')')?;
        Some((begin, begin + end + 1))
    }) {
        plain.replace_range(begin..end, "");
    }
    plain.split_whitespace().filter(|word| word.chars().any(char::is_alphanumeric)).count()
}

#[test]
fn what_is_too_long_is_found() {
    let many = |count: usize| vec!["word"; count].join(" ") + ".";
    assert_eq!(faults(&format!("# {}\n\n{}", many(20), many(20))), [""; 0]);
    assert_eq!(faults(&format!("{}\n{}", many(20), many(21))).len(), 1, "the average");
    // Paragraphs, items and cells are apart; code is not counted, a span of it is one word.
    let fifteen = many(15);
    let text =
        format!("a\nb {fifteen}\n- {fifteen}\n1. {fifteen}\n\n```\n{fifteen} {fifteen}\n```\n");
    assert_eq!(faults(&text), ["7: 151 columns"]);
    let cells = format!("| {} | {} |", "w ".repeat(30), "w ".repeat(20));
    assert_eq!(faults(&cells), [""; 0]);
    assert_eq!(faults(&format!("| {} |", "w ".repeat(41))).len(), 1);
    let wrapped = "one two three four five six seven eight nine ten\n".repeat(5);
    assert_eq!(faults(&wrapped).len(), 2, "a long sentence is also the average");
    assert_eq!(words_of("see [the `a b c` page](https://example.org/x y), and so on"), 7);
    assert_eq!(sentences_of("One. Two `a. b` is. 3.5 is (no end.) Four? ").len(), 5);
    // Comments keep their lines and lose their code; texts are what stands between quotes.
    let code = format!(
        "//! {}\n//! ```\n//! {}\n//! ```\nlet a = '\"';\nbail!(\"{}\\\n {}\\n{}\"); // \"{}\"\n",
        many(41),
        many(41),
        "w ".repeat(20),
        "w ".repeat(21),
        "w ".repeat(40),
        "w ".repeat(41)
    );
    let of = |blocks: &[Block]| -> Vec<usize> {
        let faults = long_sentences(blocks).into_iter();
        faults.map(|fault| fault.split(':').next().unwrap().parse().unwrap()).collect()
    };
    assert_eq!(of(&blocks(&comments(&code))), [1]);
    assert_eq!(of(&texts(&code)), [6]);
}
