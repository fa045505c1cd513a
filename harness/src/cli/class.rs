//! The class that a batch belongs to: the folder of each submission in the report, what earlier runs
//! into the same report found out, and whose submissions are asked for.

use std::collections::{HashMap, HashSet, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};

use super::context::Context;
use crate::class::slots::{content, slot};
use crate::class::{self, Claim, Label, MATCHES, Matches, Owners, Roster};
use crate::columns::count;
use crate::files::write_whole;
use crate::grading::{Folders, Mode, Record, RecordCache, Student};
use crate::report;
use crate::viewer;

/// The file that says where a submission lay, in its instructor's folder.
const SOURCE: &str = "source.txt";
/// The file with what a platform's names say of a submission, in its instructor's folder.
const LABEL: &str = "label.json";
/// The file with the digest of a submission that no platform names, in its instructor's folder.
const CONTENT: &str = "content.sha256";
/// The class list of a report, in the instructor's folder.
const LIST: &str = "class.csv";
/// The folder of what tasks of a partition found, in the instructor's folder.
pub const WORK: &str = "work";
/// Number of names in a message.
const NAMES: usize = 5;

/// A submission that is there.
pub struct Source {
    /// The archive or folder.
    pub path: PathBuf,
    /// What reports call it.
    pub name: String,
    /// Names of its folders in the report.
    pub slug: String,
    /// Where it was found, the same from run to run.
    pub place: PathBuf,
    /// What a platform's names say of it.
    pub label: Option<Label>,
    /// Where it was when it was graded before, if that was in an older download.
    pub moved: Option<String>,
}

impl Source {
    /// Whose it claims to be, before its content was read.
    pub fn claim(&self) -> Claim {
        Claim {
            name: self.name.clone(),
            slug: self.slug.clone(),
            label: self.label.clone(),
            ..Claim::default()
        }
    }
}

/// Where the class list of a report is kept.
pub fn kept_list(output: &Path) -> PathBuf {
    output.join(report::INSTRUCTOR).join(LIST)
}

/// Keeps a class list for later runs.
///
/// # Errors
/// When it cannot be read or written.
pub fn keep_roster(given: &Path, output: &Path) -> anyhow::Result<()> {
    let kept = kept_list(output);
    let bytes = fs::read(given).with_context(|| format!("cannot read {}", given.display()))?;
    write_whole(&kept, &bytes)
        .with_context(|| format!("cannot keep the class list as {}", kept.display()))
}

/// The class list of a report: the one that is given, else the one that was kept.
///
/// # Errors
/// When it cannot be read, or is no class list.
pub fn roster(given: Option<&Path>, output: &Path) -> anyhow::Result<Option<Roster>> {
    let kept = kept_list(output);
    match given {
        Some(given) => Roster::read(given).map(Some),
        None if kept.is_file() => Roster::read(&kept).map(Some),
        None => Ok(None),
    }
}

/// Writes the questions that are open, to be answered, unless the instructor has begun to.
///
/// # Errors
/// When they cannot be written.
pub fn ask(class: &class::Class, output: &Path) -> anyhow::Result<()> {
    let file = output.join(MATCHES);
    if class.undecided.is_empty() || file.exists() {
        return Ok(());
    }
    write_whole(&file, class.questions().as_bytes())
        .with_context(|| format!("cannot write {}", file.display()))
}

/// Submissions with the folders that they have in the report at `output`: those that they had before,
/// else what their names allow, made unique. Those of an older download are found by `names`, what reports call the
/// submission in each folder.
pub fn sources(
    mode: Mode,
    given: &[class::Source],
    output: &Path,
    names: &HashMap<String, String>,
) -> Vec<Source> {
    // Folders of the report's own; a check makes the first two alone, so that a student's may be called as they like.
    let own = [
        report::INSTRUCTOR,
        viewer::DATA_FOLDER,
        class::pins::FOLDER,
        WORK,
        report::SIMILARITY,
        report::ERRORS,
    ];
    let own = if mode == Mode::Check { &own[..2] } else { &own };
    let mut taken: HashSet<String> = own.iter().map(|&name| name.to_owned()).collect();
    let mut known: HashMap<String, VecDeque<String>> = HashMap::new();
    for slug in folders(output) {
        let file = output.join(report::INSTRUCTOR).join(&slug).join(SOURCE);
        if let Ok(place) = fs::read_to_string(file) {
            taken.insert(slug.to_lowercase());
            known.entry(place).or_default().push_back(slug);
        }
    }
    let places: HashSet<String> = given.iter().map(|given| place(&given.place)).collect();
    let gone: Vec<Gone> = known
        .iter()
        .filter(|(at, _)| !places.contains(*at))
        .flat_map(|(at, slugs)| slugs.iter().map(|slug| (slug.clone(), at.clone())))
        .collect();
    let is_known = |given: &class::Source| known.contains_key(&place(&given.place));
    let mut older = in_older_downloads(given, is_known, &gone, output, names);
    find_renamed(given, is_known, &gone, &mut older, output);
    let source = |(given, older): (&class::Source, Option<(String, String)>)| {
        let class::Source { path, name, place: at, label } = given.clone();
        let before = known.get_mut(&place(&at)).and_then(VecDeque::pop_front);
        let (slug, moved) = match (before, older) {
            (Some(slug), _) => (slug, None),
            (None, Some((slug, at))) => (slug, Some(at)),
            (None, None) => (new_slug(&name, &mut taken), None),
        };
        Source { path, name, slug, place: at, label, moved }
    };
    given.iter().zip(older).map(source).collect()
}

/// A submission that was graded and is not where it was: its folder in the report, and where it was.
type Gone = (String, String);

/// The same submission in an older download, where there is no doubt.
fn in_older_downloads(
    given: &[class::Source],
    is_known: impl Fn(&class::Source) -> bool,
    gone: &[Gone],
    output: &Path,
    names: &HashMap<String, String>,
) -> Vec<Option<Gone>> {
    let mut older: HashMap<String, Vec<&Gone>> = HashMap::new();
    for own in gone {
        if let Some(name) = names.get(&own.0) {
            older.entry(slot(label(output, &own.0).as_ref(), name)).or_default().push(own);
        }
    }
    let mut newer: HashMap<String, usize> = HashMap::new();
    for given in given.iter().filter(|given| !is_known(given)) {
        *newer.entry(slot(given.label.as_ref(), &given.name)).or_default() += 1;
    }
    let older = |given: &class::Source| -> Option<Gone> {
        let slot = slot(given.label.as_ref(), &given.name);
        let [own] = older.get(&slot)?[..] else { return None };
        // Where no platform tells submissions apart, the bytes do.
        let same = given.label.is_some()
            || noted_content(output, &own.0)
                .is_some_and(|noted| content(&given.path).is_ok_and(|own| own == noted));
        (newer.get(&slot) == Some(&1) && same).then(|| own.clone())
    };
    given.iter().map(older).collect()
}

/// Adds to `older` files that were only renamed: their bytes tell.
fn find_renamed(
    given: &[class::Source],
    is_known: impl Fn(&class::Source) -> bool,
    gone: &[Gone],
    older: &mut [Option<Gone>],
    output: &Path,
) {
    let is_new = |(given, older): (&class::Source, &Option<Gone>)| {
        older.is_none() && given.label.is_none() && !given.path.is_symlink() && !is_known(given)
    };
    if !given.iter().zip(&*older).any(is_new) {
        return;
    }
    let found: HashSet<&String> = older.iter().flatten().map(|(slug, _)| slug).collect();
    let mut noted: HashMap<String, Vec<&Gone>> = HashMap::new();
    for own in gone.iter().filter(|(slug, _)| !found.contains(slug)) {
        if let Some(content) = noted_content(output, &own.0) {
            noted.entry(content).or_default().push(own);
        }
    }
    let contents: Vec<Option<String>> = given
        .iter()
        .zip(&*older)
        .map(|own| is_new(own).then(|| content(&own.0.path).ok()).flatten())
        .collect();
    for (at, own) in contents.iter().enumerate() {
        let Some(own) = own else { continue };
        let alone = contents.iter().flatten().filter(|other| *other == own).count() == 1;
        if let (true, Some([only])) = (alone, noted.get(own).map(Vec::as_slice)) {
            older[at] = Some((*only).clone());
        }
    }
}

/// The digest of what was graded into a folder of the report, where no platform names it.
fn noted_content(output: &Path, slug: &str) -> Option<String> {
    fs::read_to_string(output.join(report::INSTRUCTOR).join(slug).join(CONTENT)).ok()
}

fn new_slug(name: &str, taken: &mut HashSet<String>) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || "-_".contains(c) { c } else { '-' };
    let stem: String = stem(name).chars().map(safe).take(80).collect();
    let stem = if stem.trim_matches('-').is_empty() { "submission".to_owned() } else { stem };
    let mut slug = stem.clone();
    let mut number = 2;
    while !taken.insert(slug.to_lowercase()) {
        slug = format!("{stem}-{number}");
        number += 1;
    }
    slug
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

fn stem(name: &str) -> &str {
    name.trim_end_matches(".gz").trim_end_matches(".tar").trim_end_matches(".zip")
}

/// Where a submission lies, as it is noted.
fn place(path: &Path) -> String {
    // What was in a zip has a place below the zip's.
    let canonical = path.ancestors().find_map(|above| {
        let inside = path.strip_prefix(above).ok()?;
        let above = above.canonicalize().ok()?;
        Some(if inside.as_os_str().is_empty() { above } else { above.join(inside) })
    });
    canonical.unwrap_or_else(|| path.to_owned()).to_string_lossy().into_owned()
}

/// Notes where a submission lies and what the platform says of it, beside what is found out about it.
///
/// # Errors
/// When it cannot be written.
pub fn note_source(out: &Folders, source: &Source) -> anyhow::Result<()> {
    let label = serde_json::to_vec_pretty(&source.label)?;
    let mut notes = vec![(SOURCE, place(&source.place).into_bytes()), (LABEL, label)];
    if source.label.is_none() && !source.path.is_symlink() {
        // What cannot be read is told as a finding of the submission.
        notes.extend(content(&source.path).ok().map(|own| (CONTENT, own.into_bytes())));
    }
    for (name, bytes) in notes {
        let file = out.instructor.join(name);
        if fs::read(&file).is_ok_and(|noted| noted == bytes) {
            continue;
        }
        write_whole(&file, &bytes).with_context(|| format!("cannot write {}", file.display()))?;
    }
    Ok(())
}

/// Where a submission lay when it was graded, as it was noted.
pub fn place_of(output: &Path, slug: &str) -> Option<String> {
    fs::read_to_string(output.join(report::INSTRUCTOR).join(slug).join(SOURCE)).ok()
}

/// The report of a mended submission, in the instructor's folder of the submission.
pub fn mended(output: &Path, slug: &str) -> PathBuf {
    output.join(report::INSTRUCTOR).join(slug).join(report::MENDED)
}

/// The record of a mended submission, if it is mended.
///
/// # Errors
/// When it cannot be read.
pub fn mended_record(output: &Path, slug: &str) -> anyhow::Result<Option<Record>> {
    let folder = mended(output, slug);
    for slug in folders(&folder) {
        let instructor = folder.join(report::INSTRUCTOR).join(slug);
        if let Some(record) = RecordCache::record(&instructor)? {
            return Ok(Some(record));
        }
    }
    Ok(None)
}

/// What a graded submission says of whose it is.
pub fn claim(output: &Path, record: &Record) -> Claim {
    Claim {
        name: record.name.clone(),
        slug: record.slug.clone(),
        label: label(output, &record.slug),
        number: record.student.id.clone(),
        full_name: record.student.full_name(),
        digest: record.digest.clone(),
    }
}

/// What the platform said of a submission that an earlier run graded.
pub fn label(output: &Path, slug: &str) -> Option<Label> {
    let file = output.join(report::INSTRUCTOR).join(slug).join(LABEL);
    serde_json::from_slice(&fs::read(file).ok()?).ok()?
}

/// The instructor's folders of a report's submissions, sorted.
pub fn folders(output: &Path) -> Vec<String> {
    let entries = output.join(report::INSTRUCTOR).read_dir().into_iter().flatten().flatten();
    let folders = entries.filter(|entry| entry.path().is_dir());
    let mut names: Vec<String> =
        folders.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    names
}

pub fn who(student: &Student) -> String {
    let name = student.full_name();
    if name.is_empty() { student.id.clone() } else { name }
}

/// The first of several names.
pub fn some(names: &[String]) -> String {
    let shown = names[..names.len().min(NAMES)].join(", ");
    match names.len().saturating_sub(NAMES) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

/// By what a batch tells whose submissions are.
#[derive(Default)]
pub struct Telling {
    /// The class list, if there is one.
    pub roster: Option<Roster>,
    /// The instructor's decisions.
    pub matches: Matches,
}

/// The submissions of some students: as [`Owners`] tell, else by file name; all when nobody is named. What submissions
/// say of themselves is known from earlier runs, else from the submissions themselves.
///
/// # Errors
/// When somebody has none, and when one cannot be looked into.
pub fn only<'a>(
    context: &Context,
    output: &Path,
    all: &'a [Source],
    wanted: &[String],
    telling: &Telling,
) -> anyhow::Result<Vec<&'a Source>> {
    if wanted.is_empty() {
        return Ok(all.iter().collect());
    }
    let student = |source: &Source| {
        let instructor = output.join(report::INSTRUCTOR).join(&source.slug);
        let known = RecordCache::student(&instructor);
        known.or_else(|| student_of(context, &source.path)).unwrap_or_default()
    };
    let claim = |source: &Source| {
        let student = student(source);
        let (number, full_name) = (student.id.clone(), student.full_name());
        (Claim { number, full_name, ..source.claim() }, student.last_name)
    };
    let (claims, last_names): (Vec<Claim>, Vec<String>) = all.iter().map(claim).unzip();
    let matches = telling.matches.among(&claims);
    let owners = Owners::of(&claims, telling.roster.as_ref(), &matches)?;
    let mut chosen = vec![false; all.len()];
    for wanted in wanted {
        let word = wanted.trim().to_lowercase();
        let of = |is: &dyn Fn(usize) -> bool| -> Vec<usize> {
            (0..all.len()).filter(|at| !word.is_empty() && is(*at)).collect()
        };
        let mut found = owners.meant(wanted);
        if found.is_empty() {
            found = of(&|at| is_file(&all[at], &word));
        }
        let listed = owners.listed_as(wanted);
        if found.is_empty() && listed.is_none() {
            found = of(&|at| last_names[at].trim().to_lowercase() == word);
        }
        ensure!(
            owners.is_one(&found),
            "--only: {} are \"{wanted}\", of several students; name the folder of one: {}",
            count(found.len(), "submission"),
            some(&owners.folders(&found).into_iter().map(str::to_owned).collect::<Vec<_>>())
        );
        found.iter().for_each(|at| chosen[*at] = true);
        if let (true, Some(who)) = (found.is_empty(), listed) {
            bail!(
                "--only: {who} has no submission among those given that is theirs for certain; hint: name the folder \
                 that it lies in, or its file"
            );
        }
        let mut names = claims
            .iter()
            .map(|claim| if claim.full_name.is_empty() { &claim.number } else { &claim.full_name });
        let like = names.find(|name| !name.is_empty()).cloned();
        let like = like.or_else(|| all.first().map(|source| file_name(&source.path)));
        ensure!(
            !found.is_empty(),
            "--only: nobody of {} is \"{wanted}\"; expected a student number, a first and last name or a \
             file name, such as \"{}\"",
            count(all.len(), "submission"),
            like.unwrap_or_default()
        );
    }
    Ok(all.iter().zip(chosen).filter(|(_, chosen)| *chosen).map(|(source, _)| source).collect())
}

/// Whether a word in lower case is the file of a submission.
fn is_file(source: &Source, word: &str) -> bool {
    let name = file_name(&source.path);
    let path = source.path.to_string_lossy();
    [source.slug.as_str(), &source.name, stem(&name), &name, &path]
        .iter()
        .any(|own| own.to_lowercase() == word)
}

/// Whose a submission is, by its config.json; nothing when it cannot be read.
fn student_of(context: &Context, source: &Path) -> Option<Student> {
    let (tree, limits) = (&context.assignment.tree, &context.assignment.limits.archive);
    let private = tempfile::tempdir_in(&context.supervisor.scratch).ok()?;
    let copy = private.path().join("copy");
    fs::create_dir(&copy).ok()?;
    context.say(&format!("reading whose submission {} is", source.display()));
    let received = context.decoder().receive(source, &copy, tree, limits).ok()?;
    received.validation.config.as_ref().map(Student::of)
}

#[cfg(test)]
mod tests;
