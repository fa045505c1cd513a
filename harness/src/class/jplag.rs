//! JPlag's result file: which pairs of submissions it found alike, and where.
//!
//! A result is a zip of JSON files. The list of pairs is in `submissionMappings.json` (JPlag 6) or `overview.json` (3
//! to 5); each pair has a file of its own, below `comparisons/` in JPlag 6. Keys changed with version 6; both spellings
//! are read, and keys that are not needed may be missing.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{Cursor, ErrorKind, Read as _};
use std::path::Path;

use anyhow::{Context as _, bail, ensure};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use zip::ZipArchive;

use crate::files::write_whole;

/// Largest file in a result that is read [bytes].
const MAX_FILE: u64 = 64 << 20;

/// Two submissions that are alike.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// The two, by the names of their folders.
    pub who: [String; 2],
    /// The share of their tokens that match, in [0, 1]: JPlag's average similarity.
    pub similarity: f64,
    /// Where.
    pub matches: Vec<SharedPassage>,
    /// The digest of each submission whose sources were compared.
    #[serde(default)]
    pub digests: [String; 2],
}

impl Pair {
    /// Whether it is of what the two submitted last; `digest` is that of the submission in a folder.
    pub fn holds<'a>(&self, digest: impl Fn(&str) -> Option<&'a str>) -> bool {
        self.who.iter().zip(&self.digests).all(|(who, own)| digest(who) == Some(own))
    }
}

/// A passage that two submissions share.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SharedPassage {
    /// In the first and in the second one.
    pub places: [PassagePlace; 2],
    /// Number of tokens.
    pub tokens: usize,
}

/// Where a passage stands.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PassagePlace {
    /// The file, by its path in the submission.
    pub path: String,
    /// First and last line, counted from 1.
    pub lines: [usize; 2],
}

/// What was kept of results.
const PAIRS: &str = "pairs.json";

/// Keeps pairs in a folder.
///
/// # Errors
/// When they cannot be written.
pub fn keep(folder: &Path, pairs: &[Pair]) -> anyhow::Result<()> {
    let file = folder.join(PAIRS);
    write_whole(&file, &serde_json::to_vec_pretty(pairs)?)
        .with_context(|| format!("cannot write {}", file.display()))
}

/// The pairs that were kept in a folder; none before there were any. They may be of what was submitted earlier, see
/// [`Pair::holds`].
///
/// # Errors
/// When they cannot be read.
pub fn kept(folder: &Path) -> anyhow::Result<Vec<Pair>> {
    let file = folder.join(PAIRS);
    match std::fs::read(&file) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Vec::new()),
        bytes => {
            let bytes = bytes.with_context(|| format!("cannot read {}", file.display()))?;
            serde_json::from_slice(&bytes)
                .with_context(|| format!("{}: not of this version of Umbra", file.display()))
        }
    }
}

/// The pairs of a result, most alike first.
///
/// # Errors
/// When it is no result of JPlag's, or one of a form that is not known.
pub fn read(bytes: &[u8]) -> anyhow::Result<Vec<Pair>> {
    let mut zip = ZipArchive::new(Cursor::new(bytes))
        .context("expected a result of JPlag's, which is a zip archive")?;
    let mappings: Mappings = if zip.index_for_name(MAPPINGS).is_some() {
        json(&mut zip, MAPPINGS)?
    } else if zip.index_for_name(OVERVIEW).is_some() {
        json(&mut zip, OVERVIEW)?
    } else {
        bail!("expected {MAPPINGS} or {OVERVIEW} in a result of JPlag's, found neither");
    };
    let files = mappings.files.values().flat_map(BTreeMap::values);
    let files: BTreeSet<&String> = files.collect();
    let mut pairs = Vec::new();
    for file in files {
        let below = format!("comparisons/{file}");
        let name = if zip.index_for_name(&below).is_some() { &below } else { file };
        let comparison: Comparison = json(&mut zip, name)?;
        pairs.push(
            comparison.pair(&mappings.names).with_context(|| format!("{name} in the result"))?,
        );
    }
    pairs.sort_by(|a, b| b.similarity.total_cmp(&a.similarity).then_with(|| a.who.cmp(&b.who)));
    Ok(pairs)
}

const MAPPINGS: &str = "submissionMappings.json";
const OVERVIEW: &str = "overview.json";

/// What of `submissionMappings.json` or `overview.json` is needed.
#[derive(Deserialize)]
struct Mappings {
    /// The name of a submission's folder, by its identifier.
    #[serde(rename = "submissionIds", alias = "submission_id_to_display_name")]
    names: BTreeMap<String, String>,
    /// The file of a pair, by both identifiers.
    #[serde(
        rename = "submissionIdsToComparisonFileName",
        alias = "submission_ids_to_comparison_file_name"
    )]
    files: BTreeMap<String, BTreeMap<String, String>>,
}

/// The file of a pair.
#[derive(Deserialize)]
struct Comparison {
    #[serde(rename = "firstSubmissionId", alias = "id1")]
    first: String,
    #[serde(rename = "secondSubmissionId", alias = "id2")]
    second: String,
    /// By the name of the measure.
    #[serde(default)]
    similarities: BTreeMap<String, f64>,
    /// The same before measures had names.
    similarity: Option<f64>,
    matches: Vec<Passage>,
}

#[derive(Deserialize)]
struct Passage {
    #[serde(rename = "firstFileName", alias = "file1")]
    first_file: String,
    #[serde(rename = "secondFileName", alias = "file2")]
    second_file: String,
    #[serde(rename = "startInFirst", alias = "start1")]
    first_start: Line,
    #[serde(rename = "endInFirst", alias = "end1")]
    first_end: Line,
    #[serde(rename = "startInSecond", alias = "start2")]
    second_start: Line,
    #[serde(rename = "endInSecond", alias = "end2")]
    second_end: Line,
    tokens: Option<usize>,
    /// The tokens in versions that count them for each of the two.
    #[serde(rename = "lengthOfFirst")]
    length: Option<usize>,
}

/// A line alone, or with its column.
#[derive(Clone, Copy, Deserialize)]
#[serde(untagged)]
enum Line {
    Alone(usize),
    Position { line: usize },
}

impl Comparison {
    fn pair(self, names: &BTreeMap<String, String>) -> anyhow::Result<Pair> {
        let Self { first, second, similarities, similarity, matches } = self;
        let similarity = similarities.get("AVG").copied().or(similarity);
        let similarity = similarity.context("it says no average similarity (AVG)")?;
        ensure!(
            (0.0..=1.0).contains(&similarity),
            "a similarity of {similarity}; expected one from 0 to 1"
        );
        ensure!(first != second, "it compares {first} with itself");
        let name = |id: &String| names.get(id).unwrap_or(id).clone();
        let own = |passage: Passage| SharedPassage {
            places: [
                place(&passage.first_file, &first, passage.first_start, passage.first_end),
                place(&passage.second_file, &second, passage.second_start, passage.second_end),
            ],
            tokens: passage.tokens.or(passage.length).unwrap_or_default(),
        };
        let matches = matches.into_iter().map(own).collect();
        let (who, digests) = ([name(&first), name(&second)], Default::default());
        Ok(Pair { who, similarity, matches, digests })
    }
}

/// A file's path begins with the submission's identifier, and has backslashes where JPlag ran on Windows.
fn place(file: &str, id: &str, start: Line, end: Line) -> PassagePlace {
    let line = |line| match line {
        Line::Alone(line) | Line::Position { line } => line,
    };
    let file = file.replace('\\', "/");
    let below = file.strip_prefix(id).and_then(|rest| rest.strip_prefix('/'));
    PassagePlace { path: below.unwrap_or(&file).to_owned(), lines: [line(start), line(end)] }
}

fn json<T: DeserializeOwned>(zip: &mut ZipArchive<Cursor<&[u8]>>, name: &str) -> anyhow::Result<T> {
    let file = zip.by_name(name).with_context(|| format!("{name} is not in the result"))?;
    let mut bytes = Vec::new();
    file.take(MAX_FILE).read_to_end(&mut bytes).with_context(|| format!("{name} in the result"))?;
    serde_json::from_slice(&bytes)
        .with_context(|| format!("{name} is of a form of JPlag's that is not known"))
}

#[cfg(test)]
pub(crate) mod tests {
    use std::io::Write as _;

    use serde_json::{Value, json};
    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    use super::*;

    /// A result with these files.
    pub fn result(files: &[(&str, Value)]) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, value) in files {
            zip.start_file(*name, SimpleFileOptions::default()).unwrap();
            zip.write_all(value.to_string().as_bytes()).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    /// A result as JPlag 6 lays it out, of one pair that shares lines 10 to 30 of one file.
    pub fn of_version_6(first: &str, second: &str, similarity: f64) -> Vec<u8> {
        let file = format!("{first}-{second}.json");
        let at =
            |line: usize, token: usize| json!({"line": line, "column": 1, "tokenListIndex": token});
        result(&[
            ("options.json", json!({"language": "rust", "minimumTokenMatch": 8})),
            (
                "runInformation.json",
                json!({
                    "version": {"major": 6, "minor": 2, "patch": 0}, "failedSubmissionNames": [],
                    "dateOfExecution": "29/11/26", "executionTime": 912, "totalComparisons": 1,
                }),
            ),
            (
                "submissionMappings.json",
                json!({
                    "submissionIds": {first: first, second: second},
                    "submissionIdsToComparisonFileName": {first: {second: file}, second: {first: file}},
                }),
            ),
            (
                "topComparisons.json",
                json!([{
                    "firstSubmission": first, "secondSubmission": second,
                    "similarities": {"AVG": similarity, "MAX": 1.0},
                }]),
            ),
            (
                &format!("comparisons/{file}"),
                json!({
                    "firstSubmissionId": first, "secondSubmissionId": second,
                    "similarities": {"AVG": similarity, "MAX": 1.0, "LONGEST_MATCH": 139},
                    "matches": [{
                        "firstFileName": format!("{first}/src/integrators/simple.rs"),
                        "secondFileName": format!("{second}/src/integrators/simple.rs"),
                        "startInFirst": at(10, 0), "endInFirst": at(30, 138),
                        "startInSecond": at(12, 5), "endInSecond": at(32, 143),
                        "lengthOfFirst": 139, "lengthOfSecond": 139,
                    }],
                    "firstSimilarity": 0.8, "secondSimilarity": 0.94,
                }),
            ),
        ])
    }

    fn expected(similarity: f64) -> Vec<Pair> {
        let place = |lines| PassagePlace { path: "src/integrators/simple.rs".into(), lines };
        let matches =
            vec![SharedPassage { places: [place([10, 30]), place([12, 32])], tokens: 139 }];
        let digests = Default::default();
        vec![Pair { who: ["ada".into(), "bob-2".into()], similarity, matches, digests }]
    }

    #[test]
    fn a_result_of_version_6_is_read() {
        assert_eq!(read(&of_version_6("ada", "bob-2", 0.87)).unwrap(), expected(0.87));
    }

    #[test]
    fn results_of_versions_3_to_5_are_read_from_windows_too() {
        let bytes = result(&[
            (
                "overview.json",
                json!({
                    "jplag_version": {"major": 4, "minor": 3, "patch": 0}, "language": "Rust Language Module",
                    "submission_id_to_display_name": {"ada": "ada", "bob_2": "bob-2"},
                    "submission_ids_to_comparison_file_name":
                        {"ada": {"bob_2": "ada-bob_2.json"}, "bob_2": {"ada": "ada-bob_2.json"}},
                }),
            ),
            (
                "ada-bob_2.json",
                json!({
                    "id1": "ada", "id2": "bob_2", "similarities": {"AVG": 0.69, "MAX": 0.99},
                    "matches": [{
                        "file1": "ada\\src\\integrators\\simple.rs", "file2": "bob_2\\src\\integrators\\simple.rs",
                        "start1": 10, "end1": 30, "start2": 12, "end2": 32, "tokens": 139,
                    }],
                    "first_similarity": 0.6, "second_similarity": 0.8,
                }),
            ),
        ]);
        assert_eq!(read(&bytes).unwrap(), expected(0.69));
    }

    #[test]
    fn what_is_no_result_is_said() {
        let said = |bytes: &[u8]| format!("{:#}", read(bytes).unwrap_err());
        assert!(said(b"nothing").contains("which is a zip archive"), "{}", said(b"nothing"));
        let other = result(&[("overview.txt", json!(1))]);
        assert!(said(&other).contains("found neither"), "{}", said(&other));
        let names = json!({"submissionIds": {}, "submissionIdsToComparisonFileName": {"a": {"b": "a-b.json"}}});
        let missing = result(&[("submissionMappings.json", names.clone())]);
        assert!(said(&missing).contains("a-b.json is not in the result"), "{}", said(&missing));
        let pair = json!({"firstSubmissionId": "a", "secondSubmissionId": "b", "matches": []});
        let alone = json!({"firstSubmissionId": "a", "secondSubmissionId": "a", "similarity": 1.0, "matches": []});
        let alone = [("submissionMappings.json", names.clone()), ("comparisons/a-b.json", alone)];
        assert!(said(&result(&alone)).contains("it compares a with itself"));
        let unknown = result(&[("submissionMappings.json", names), ("comparisons/a-b.json", pair)]);
        assert!(said(&unknown).contains("no average similarity"), "{}", said(&unknown));
    }
}
