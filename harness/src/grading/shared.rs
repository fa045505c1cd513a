//! What two submissions of a batch have in common that they should not: images, sources, or a student number.

use std::collections::{BTreeMap, BTreeSet};

use super::image_digest::ImageDigest;
use super::record::Record;
use super::similarity::SourceDigest;
use crate::evidence::{Check, CheckId, Verdict};

/// The check of images.
const SHARED: CheckId = CheckId::SubmittedShared;
/// The check of student numbers.
const NUMBER: CheckId = CheckId::SubmissionNumber;

/// Sources are much alike from this share of matching tokens on. It says only whom to look at: renderers of one handout
/// are alike in much, and nobody loses points by it.
pub const SIMILAR: f64 = 0.8;

/// Number of other submissions that a sentence names.
const NAMES: usize = 8;

/// The check of sources.
const SIMILARITY: CheckId = CheckId::SubmissionSimilarity;

/// Images, sources and student numbers of a batch, each with those who submitted it.
///
/// Only images with noise have digests, and every student's noise has the seed of the student's own
/// number: two persons' images are equal when one is a copy of the other, or when neither
/// was drawn with that seed. A number with two names may be a slip, or somebody who hides a copy.
#[derive(Default)]
pub struct Shared {
    images: BTreeMap<String, Owners>,
    numbers: BTreeMap<String, Owners>,
    sources: BTreeMap<String, BTreeSet<Author>>,
    /// Whose a submission is.
    persons: BTreeMap<String, String>,
    /// What is much like a submission, and how much in [0, 1].
    near: BTreeMap<String, Vec<(String, f64)>>,
}

/// Who it is, and in which submission.
type Owners = BTreeSet<(String, String)>;

/// Who wrote a file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Author {
    person: String,
    slug: String,
    path: String,
}

/// Two submissions with files that are the same but for comments, blanks and the template.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SameFiles {
    /// Their folders in the report.
    pub who: [String; 2],
    /// The paths of each file in the two.
    pub paths: Vec<[String; 2]>,
}

/// Files that are the same in all of some submissions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SharedFiles {
    /// Each file's path; of one that has several, all of them, as `a or b`.
    pub paths: Vec<String>,
    /// The submissions' folders in the report.
    pub who: Vec<String>,
}

/// Adds to every record of a batch what it shares with others, see [`Shared::judge`].
pub fn judge_shared(records: &mut [Record]) {
    let shared = Shared::of(records.iter());
    records.iter_mut().for_each(|record| shared.judge(record));
}

impl Shared {
    /// What is in the records of a batch; their evidence does not matter.
    pub fn of<'a>(records: impl Iterator<Item = &'a Record>) -> Self {
        let mut shared = Self::default();
        for record in records {
            shared.persons.insert(record.slug.clone(), person(record));
            for source in &record.sources {
                let (slug, path) = (record.slug.clone(), source.path.clone());
                let author = Author { person: person(record), slug, path };
                shared.sources.entry(source.sha256.clone()).or_default().insert(author);
            }
            for image in &record.images {
                let owner = (person(record), record.slug.clone());
                shared.images.entry(image.sha256.clone()).or_default().insert(owner);
            }
            if let (Some(number), Some(name)) = (number(record), plain_name(record)) {
                let owner = (name, record.slug.clone());
                shared.numbers.entry(number).or_default().insert(owner);
            }
        }
        shared
    }

    /// With pairs of submissions, by their folders, whose sources something else found alike, and how much in [0, 1].
    /// Those of one person and those below [`SIMILAR`] are left out.
    #[must_use]
    pub fn with_near<'a>(
        mut self,
        pairs: impl IntoIterator<Item = (&'a [String; 2], f64)>,
    ) -> Self {
        for (who, similarity) in pairs {
            let [first, second] = who.each_ref().map(|slug| self.persons.get(slug));
            if similarity < SIMILAR || first.is_none() || second.is_none() || first == second {
                continue;
            }
            for [own, other] in [[0, 1], [1, 0]] {
                let near = self.near.entry(who[own].clone()).or_default();
                near.push((who[other].clone(), similarity));
            }
        }
        self
    }

    /// Whether two submissions, by their folders, are one person's.
    pub fn is_one_person(&self, who: &[String; 2]) -> bool {
        let [first, second] = who.each_ref().map(|slug| self.persons.get(slug));
        first.is_some() && first == second
    }

    /// Which files several persons submitted; those of the same submissions together, the most files first.
    pub fn shared_files(&self) -> Vec<SharedFiles> {
        let mut groups: BTreeMap<Vec<&str>, Vec<String>> = BTreeMap::new();
        for authors in self.sources.values() {
            let persons: BTreeSet<&str> = authors.iter().map(|own| own.person.as_str()).collect();
            if persons.len() < 2 {
                continue;
            }
            let who: BTreeSet<&str> = authors.iter().map(|own| own.slug.as_str()).collect();
            let paths: BTreeSet<&str> = authors.iter().map(|own| own.path.as_str()).collect();
            let paths = Vec::from_iter(paths).join(" or ");
            groups.entry(who.into_iter().collect()).or_default().push(paths);
        }
        let groups = groups.into_iter().map(|(who, mut paths)| {
            paths.sort();
            SharedFiles { paths, who: who.into_iter().map(str::to_owned).collect() }
        });
        let mut groups: Vec<SharedFiles> = groups.collect();
        groups.sort_by_key(|group| std::cmp::Reverse(group.paths.len()));
        groups
    }

    /// Which submissions of two persons share files, in the order of their folders.
    pub fn same_files(&self) -> Vec<SameFiles> {
        let mut pairs: BTreeMap<[&str; 2], Vec<[String; 2]>> = BTreeMap::new();
        for authors in self.sources.values() {
            let authors: Vec<&Author> = authors.iter().collect();
            for (at, first) in authors.iter().enumerate() {
                for second in authors[at + 1..].iter().filter(|own| own.person != first.person) {
                    let mut pair = [first, second];
                    pair.sort_by_key(|author| &author.slug);
                    let paths = pair.map(|author| author.path.clone());
                    pairs.entry(pair.map(|author| author.slug.as_str())).or_default().push(paths);
                }
            }
        }
        let pairs = pairs.into_iter().map(|(who, mut paths)| {
            paths.sort();
            SameFiles { who: who.map(str::to_owned), paths }
        });
        pairs.collect()
    }

    /// Adds to a record of the batch which of its images and sources another person submitted too, and whether its
    /// student number is another person's. The result depends only on the set of records; calling this again changes
    /// nothing. Names of other submissions are private.
    pub fn judge(&self, record: &mut Record) {
        let person = person(record);
        record.evidence.checks.retain(|check| ![SHARED, NUMBER, SIMILARITY].contains(&check.id));
        let mut found = Vec::new();
        for ImageDigest { scene, path, sha256 } in &record.images {
            let others = others(&self.images[sha256], &person);
            found.push(if others.is_empty() {
                let summary = format!("nobody else of this batch submitted {path}");
                Check::new(SHARED, scene, Verdict::Pass, summary)
            } else {
                let summary = format!("{path} is the same image as another submission's");
                let hint =
                    "a copy, unless both were drawn with one seed instead of the student numbers";
                let check = Check::new(SHARED, scene, Verdict::Fail, summary).with_hint(hint);
                Check { private: format!("the same image is in {others}"), ..check }
            });
        }
        if let (Some(number), Some(name)) = (number(record), plain_name(record)) {
            let others = others(&self.numbers[&number], &name);
            if !others.is_empty() {
                let summary = format!("the student number {number} stands under two names");
                let check = Check::new(NUMBER, "", Verdict::Fail, summary);
                let private = format!("the same number, under another name, is in {others}");
                found.push(Check { private, ..check });
            }
        }
        found.extend(self.like(record, &person));
        record.evidence.checks.extend(found);
    }

    /// Which files of a source are others', too, and whose source is much like it. Nobody loses points by it.
    fn like(&self, record: &Record, person: &str) -> Option<Check> {
        let mut same = Vec::new();
        for SourceDigest { path, signs, sha256 } in &record.sources {
            let others = self.sources[sha256].iter().filter(|author| author.person != person);
            // The path is said where it is another one.
            let others = others.map(|author| match author.path == *path {
                true => author.slug.clone(),
                false => format!("{} (there {})", author.slug, author.path),
            });
            let others: Vec<String> = others.collect();
            if !others.is_empty() {
                let others = some(others.iter().map(String::as_str));
                same.push(format!(
                    "{path}, {signs} characters beyond the template, is also in {others}"
                ));
            }
        }
        let near = self.near.get(&record.slug).map(Vec::as_slice).unwrap_or_default();
        let summary = match (same.len(), near.len()) {
            (0, 0) => return None,
            (0, near) => format!("much like {near} other submission(s)"),
            (same, _) => format!(
                "{same} of {} files with a text of their own are another submission's too, but for comments and \
                 blanks",
                record.sources.len()
            ),
        };
        let near = near.iter().map(|(slug, similarity)| {
            format!("{:.0} % of the tokens match {slug} (JPlag)", 100.0 * similarity)
        });
        let more = near.len().saturating_sub(NAMES);
        same.extend(near.take(NAMES));
        if more > 0 {
            same.push(format!("as alike to {more} more"));
        }
        let check = Check::new(SIMILARITY, "", Verdict::Fail, summary);
        Some(Check { private: same.join("; "), ..check })
    }
}

/// The submissions of others than `own`.
fn others(all: &Owners, own: &str) -> String {
    let others = all.iter().filter(|(owner, _)| owner != own).map(|(_, slug)| slug.as_str());
    some(others)
}

/// The first names of a list, and how many more there are: of a large class all would be read by nobody.
fn some<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.collect();
    let first = names[..names.len().min(NAMES)].join(", ");
    match names.len().saturating_sub(NAMES) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

/// The student number, its digits alone.
fn number(record: &Record) -> Option<String> {
    let digits: String = record.student.id.chars().filter(char::is_ascii_digit).collect();
    (!digits.is_empty()).then_some(digits)
}

/// The words of a name in one order and one case.
fn plain_name(record: &Record) -> Option<String> {
    let name = record.student.full_name().to_lowercase();
    let mut words: Vec<&str> =
        name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    words.sort_unstable();
    (!words.is_empty()).then(|| words.join(" "))
}

/// Whose a submission is: the student number, or what else there is.
fn person(record: &Record) -> String {
    let known = number(record).or_else(|| plain_name(record));
    known.unwrap_or_else(|| format!("the submission {}", record.slug))
}

#[cfg(test)]
mod tests {
    use super::super::record::{Conditions, Student};
    use super::*;
    use crate::evidence::Evidence;

    /// A submission of one image, whose content is a letter.
    fn record(slug: &str, id: &str, content: &str) -> Record {
        let image = ImageDigest {
            scene: "teapot".into(),
            path: "offline/a.exr".into(),
            sha256: content.into(),
        };
        Record {
            name: format!("{slug}.zip"),
            slug: slug.into(),
            digest: String::new(),
            student: Student { id: id.into(), ..Student::default() },
            findings: Vec::new(),
            diagnostics: String::new(),
            evidence: Evidence {
                checks: vec![Check::new(CheckId::ImageOffline, "", Verdict::Pass, "")],
            },
            diagnoses: Vec::new(),
            views: Vec::new(),
            error_maps: Vec::new(),
            images: vec![image],
            sources: Vec::new(),
            stages: Vec::new(),
            conditions: Conditions::default(),
        }
    }

    /// What is said for the instructor of each that failed a check; to the student no other is named.
    fn failed(records: &[Record], id: CheckId) -> BTreeMap<&str, String> {
        let said = |record: &Record| {
            let own = record.evidence.checks.iter().filter(|check| check.id == id);
            let failed = own.filter(|check| check.verdict == Verdict::Fail);
            let public = failed.clone().map(Check::for_student);
            let public = public.map(|check| format!("{check:?}")).collect::<String>();
            let others = records.iter().filter(|other| other.slug != record.slug);
            for name in others.map(|other| &other.slug) {
                assert!(!public.contains(&format!("in {name}")), "{public}");
            }
            failed.map(|check| check.private.clone()).collect::<String>()
        };
        records.iter().map(|record| (record.slug.as_str(), said(record))).collect()
    }

    fn shared(records: &[Record]) -> BTreeMap<&str, String> {
        failed(records, SHARED)
    }

    #[test]
    fn one_number_with_two_names_is_said_of_both_and_of_nobody_else() {
        let named = |slug: &str, id: &str, first: &str, last: &str| {
            let mut record = record(slug, id, slug);
            (record.student.first_name, record.student.last_name) = (first.into(), last.into());
            record
        };
        let mut batch = vec![
            named("ada", "260 123-456", "Ada", "Lampglow"),
            named("ada-again", "260123456", "LAMPGLOW,", "ada"),
            named("eve", "260123456", "Eve", ""),
            named("bob", "260123457", "Eve", ""),
            named("nameless", "260123456", "", ""),
        ];
        judge_shared(&mut batch);
        let found = failed(&batch, NUMBER);
        assert!(found["ada"].ends_with("in eve") && found["ada-again"].ends_with("in eve"));
        assert!(found["eve"].ends_with("in ada, ada-again"), "{found:?}");
        assert_eq!((found["bob"].as_str(), found["nameless"].as_str()), ("", ""));
        let again = batch.clone();
        judge_shared(&mut batch);
        assert_eq!(again, batch);
    }

    #[test]
    fn the_same_source_is_said_of_both_and_is_private() {
        let with = |slug: &str, id: &str, sources: &[(&str, &str)]| {
            let mut record = record(slug, id, slug);
            let digest = |(path, sha256): &(&str, &str)| SourceDigest {
                path: (*path).into(),
                signs: 300,
                sha256: (*sha256).into(),
            };
            record.sources = sources.iter().map(digest).collect();
            record
        };
        let mut batch = vec![
            with("ada", "1", &[("src/a.rs", "A"), ("src/b.rs", "B")]),
            with("ada-again", "1", &[("src/a.rs", "A")]),
            with("bob", "2", &[("src/mine.rs", "A"), ("src/b.rs", "C")]),
            with("eve", "3", &[("src/a.rs", "E")]),
        ];
        judge_shared(&mut batch);
        let found = failed(&batch, SIMILARITY);
        assert_eq!(
            found["ada"],
            "src/a.rs, 300 characters beyond the template, is also in bob (there src/mine.rs)"
        );
        assert_eq!(
            found["bob"],
            "src/mine.rs, 300 characters beyond the template, is also in ada (there src/a.rs), ada-again (there src/a.rs)"
        );
        assert_eq!(found["eve"], "");
        let again = batch.clone();
        judge_shared(&mut batch);
        assert_eq!(again, batch);
    }

    #[test]
    fn the_order_of_a_batch_does_not_matter_and_a_person_shares_with_others_only() {
        let batch = [
            record("ada", "1", "A"),
            record("ada-again", "1", "A"),
            record("bob", "2", "A"),
            record("eve", "3", "B"),
            record("nobody", "", "C"),
            record("noone", " ", "C"),
        ];
        let mut first = batch.to_vec();
        judge_shared(&mut first);
        let found = shared(&first);
        assert!(found["bob"].ends_with("in ada, ada-again"), "{found:?}");
        assert!(found["ada"].ends_with("in bob") && found["ada-again"].ends_with("in bob"));
        assert_eq!(found["eve"], "");
        // Without a number or a name, two submissions are two persons.
        assert!(found["nobody"].ends_with("in noone"), "{found:?}");
        for turn in 1..batch.len() {
            let mut other = batch.to_vec();
            other.rotate_left(turn);
            other.reverse();
            judge_shared(&mut other);
            assert_eq!(shared(&other), found);
        }
        let mut again = first.clone();
        judge_shared(&mut again);
        assert_eq!(again, first);
        // One alone shares with nobody, whatever was said of an earlier batch.
        let mut alone = vec![again.remove(2)];
        judge_shared(&mut alone);
        assert_eq!(shared(&alone)["bob"], "");
        assert_eq!(alone[0].evidence.checks.len(), 2);
    }
}
