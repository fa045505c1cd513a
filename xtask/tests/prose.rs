//! Every Markdown file keeps to what CONTRIBUTING.md says of prose: lines of at most 120 columns,
//! sentences of at most 40 words, and on average at most 20 words in a sentence.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde_json::Value;

/// Columns of a line, tables and code included.
const LINE: usize = 120;
/// Words of a sentence, in a paragraph, a list or the cell of a table.
const SENTENCE: usize = 40;
/// Words of a file's sentences on average. Cells of tables are left out: most are no sentences.
const AVERAGE: f64 = 20.0;

#[test]
fn documents_are_short_of_breath() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let mut files = markdown_below(root);
    // A table that `xtask verdicts --table` writes.
    files.retain(|file| !file.ends_with("docs/points.md"));
    assert!(files.len() > 20, "only {} files", files.len());
    let faults: Vec<String> = files
        .iter()
        .flat_map(|file| {
            let text = std::fs::read_to_string(file).expect("UTF-8");
            let name = file.strip_prefix(root).unwrap_or(file).display().to_string();
            faults(&text).into_iter().map(move |fault| format!("{name}: {fault}"))
        })
        .collect();
    assert!(faults.is_empty(), "{} faults\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn every_page_is_in_the_book() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let docs = root.join("docs");
    let summary = std::fs::read_to_string(docs.join("SUMMARY.md")).expect("UTF-8");
    for page in markdown_below(&docs) {
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
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let read = |path: &str| std::fs::read_to_string(root.join(path)).expect("UTF-8");
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

/// The Markdown files of the tree, without what is built or hidden.
fn markdown_below(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in folder.read_dir().expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && name != "target" && (!name.starts_with('.') || name == ".github") {
            found.extend(markdown_below(&path));
        } else if path.extension().is_some_and(|extension| extension == "md") {
            found.push(path);
        }
    }
    found
}

/// What is too long in a text.
fn faults(text: &str) -> Vec<String> {
    let wide = text.lines().enumerate().filter_map(|(index, line)| {
        let width = line.chars().count();
        (width > LINE).then(|| format!("{}: {width} columns", index + 1))
    });
    let mut faults: Vec<String> = wide.collect();
    let (mut words, mut sentences) = (0, 0);
    for block in blocks(text) {
        for sentence in sentences_of(&block.text) {
            let count = words_of(sentence);
            if count > SENTENCE {
                let begin: String = sentence.chars().take(60).collect();
                faults.push(format!("{}: {count} words: {begin}...", block.line));
            }
            if !block.is_cell && count > 0 {
                words += count;
                sentences += 1;
            }
        }
    }
    let average = words as f64 / f64::from(sentences.max(1));
    if average > AVERAGE {
        faults.push(format!("{average:.1} words in a sentence on average"));
    }
    faults
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
}
