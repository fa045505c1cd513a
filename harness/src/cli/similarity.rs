//! `umbra similarity`: submissions whose sources are alike, side by side. Umbra finds files that are equal apart from
//! comments and white space. JPlag finds renamed or moved code, in a folder that is written for it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};

use super::assemble::{self, KeptReport};
use super::class;
use super::context::{Context, INTERRUPTED};
use super::outputs::shell_path;
use super::report_folder::ReportFolder;
use crate::class::jplag::{self, Pair, PassagePlace, SharedPassage};
use crate::class::{CollectOptions, collect};
use crate::columns::count;
use crate::files::{files_below, write_whole};
use crate::grading::{Mode, SIMILAR, Shared};
use crate::harmless::harmless;
use crate::report::{self, BatchReport, SimilarPair, SimilarityPage};

/// A folder of sources for each submission, in [`report::SIMILARITY`].
const SUBMISSIONS: &str = "submissions";
/// The file with the digest of each submission whose sources were written, beside that folder.
const DIGESTS: &str = "digests.json";
/// The template's folder in it, which all submissions started from.
const TEMPLATE: &str = "template";
/// Number of pairs that are shown, JPlag's and those with equal files each: further pairs tell nothing more.
const SHOWN: usize = 100;

/// Options of `umbra similarity`.
#[derive(clap::Args)]
pub struct SimilarityArguments {
    /// The result of JPlag; without one, sources are written for JPlag and pairs of equal files are shown
    result: Option<PathBuf>,
    #[command(flatten)]
    report: ReportFolder,
}

/// Writes sources for JPlag or takes its result, and shows all pairs.
///
/// # Errors
/// When the result is not JPlag's of these sources, or a file cannot be read or written.
pub fn run(arguments: &SimilarityArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let output = &arguments.report.path;
    let kept = KeptReport::read(output)?;
    let folder = output.join(report::INSTRUCTOR).join(report::SIMILARITY);
    match &arguments.result {
        Some(result) => take(result, output, &folder)?,
        None => write_sources(&kept, output, root, &folder)?,
    }
    let settled = kept.report(output, kept.decided()?)?;
    show(&kept, &settled.report, &folder)?;
    // The reports name what is alike.
    assemble::write(output, &kept.report(output, kept.decided()?)?)?;
    Ok(super::EXIT_OK)
}

/// Reads a result and keeps its pairs.
fn take(result: &Path, output: &Path, folder: &Path) -> anyhow::Result<()> {
    let bytes = fs::read(result).with_context(|| format!("cannot read {}", result.display()))?;
    let mut pairs = jplag::read(&bytes).with_context(|| result.display().to_string())?;
    let known = submissions(folder)?;
    ensure!(
        !known.is_empty(),
        "no sources were written for JPlag yet; hint: run `umbra similarity --report {}` first",
        shell_path(output)
    );
    let whose = pairs.iter().flat_map(|pair| &pair.who);
    let unknown: BTreeSet<&String> = whose.filter(|who| !known.contains(*who)).collect();
    ensure!(
        unknown.is_empty(),
        "{}: compares {}, expected the folders of {}; hint: run JPlag with that folder",
        result.display(),
        harmless(&unknown.into_iter().cloned().collect::<Vec<_>>().join(", ")),
        folder.join(SUBMISSIONS).display()
    );
    let digests = digests(folder)?;
    for pair in &mut pairs {
        pair.digests = pair.who.each_ref().map(|who| digests.get(who).cloned().unwrap_or_default());
    }
    jplag::keep(folder, &pairs)
}

/// The digest of each submission when its sources were written.
fn digests(folder: &Path) -> anyhow::Result<BTreeMap<String, String>> {
    let file = folder.join(DIGESTS);
    if !file.is_file() {
        return Ok(BTreeMap::new());
    }
    let bytes = fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
    serde_json::from_slice(&bytes).with_context(|| format!("{}: expected digests", file.display()))
}

fn say_lost(pairs: usize) {
    if pairs > 0 {
        println!(
            "{} of JPlag's {} of sources that changed since, and no longer shown: run JPlag again",
            count(pairs, "pair"),
            if pairs == 1 { "is" } else { "are" }
        );
    }
}

/// Of pairs whose sources were compared, keeps those of sources that did not change since; answers how many are lost.
fn keep_unchanged(folder: &Path, changed: &BTreeSet<String>) -> anyhow::Result<usize> {
    let digests = digests(folder)?;
    let mut pairs = jplag::kept(folder)?;
    let before = pairs.len();
    pairs.retain(|pair| !pair.who.iter().any(|who| changed.contains(who)));
    for pair in &mut pairs {
        pair.digests = pair.who.each_ref().map(|who| digests.get(who).cloned().unwrap_or_default());
    }
    jplag::keep(folder, &pairs)?;
    Ok(before - pairs.len())
}

/// The submissions whose sources are in the folder.
fn submissions(folder: &Path) -> anyhow::Result<BTreeSet<String>> {
    let folder = folder.join(SUBMISSIONS);
    if !folder.is_dir() {
        return Ok(BTreeSet::new());
    }
    let entries =
        fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
    Ok(entries.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect())
}

/// Writes the sources of all submissions, and of the template, as JPlag reads them. What JPlag found earlier holds for
/// those that did not change.
fn write_sources(
    kept: &KeptReport,
    output: &Path,
    root: Option<&Path>,
    folder: &Path,
) -> anyhow::Result<()> {
    let context = Context::new(root)?;
    let scratch = tempfile::tempdir_in(&context.supervisor.scratch)?;
    let (tree, limits) = (&context.assignment.tree, &context.assignment.limits.archive);
    let wanted =
        CollectOptions { tree, limits, from: None, output: Some(output), scratch: scratch.path() };
    let there: Vec<PathBuf> = kept.paths().iter().filter(|path| path.exists()).cloned().collect();
    let collected = collect(&there, &wanted)?;
    let sources = class::sources(Mode::Grade, &collected.sources, output, &kept.names());
    let path_of = |slug: &str| {
        let found = sources.iter().find(|source| source.slug == slug);
        let place = || class::place_of(output, slug).map(PathBuf::from);
        found.map(|source| source.path.clone()).or_else(place).filter(|path| path.exists())
    };
    let (mut changed, mut missing) = (BTreeSet::new(), Vec::new());
    let mut written = digests(folder)?;
    let copies = tempfile::tempdir_in(&context.supervisor.scratch)?;
    for record in kept.records() {
        let slug = &record.slug;
        // What could not be unpacked has no sources.
        if record.digest.is_empty() {
            continue;
        }
        context.say(&format!("sources of {slug}"));
        let copy = copies.path().join(slug);
        fs::create_dir(&copy)?;
        let received = match path_of(slug) {
            Some(path) => Some(context.decoder().receive(&path, &copy, tree, limits)?),
            None => None,
        };
        ensure!(!INTERRUPTED.load(std::sync::atomic::Ordering::Relaxed), "interrupted");
        let received = received.filter(|own| own.submission.digest == record.digest);
        let Some(received) = received else {
            missing.push(slug.clone());
            continue;
        };
        let from = received.submission.root.join("src");
        if copy_sources(&from, &folder.join(SUBMISSIONS).join(slug).join("src"))? {
            changed.insert(slug.clone());
        }
        written.insert(slug.clone(), record.digest.clone());
        let _ = fs::remove_dir_all(&copy);
    }
    context.progress.end();
    copy_sources(&context.assignment.template(), &folder.join(TEMPLATE).join("src"))?;
    let file = folder.join(DIGESTS);
    write_whole(&file, &serde_json::to_vec_pretty(&written)?)
        .with_context(|| format!("cannot write {}", file.display()))?;
    say_lost(keep_unchanged(folder, &changed)?);
    if !missing.is_empty() {
        println!(
            "without sources, since they do not lie any more where they were graded from: {}",
            harmless(&missing.join(", "))
        );
    }
    println!(
        "{}: the sources of {} for JPlag, which finds what was renamed or moved about:\n  \
         java -jar jplag.jar -l rust -bc {} -r {} {}\n  \
         umbra similarity {} --report {}\n(JPlag before version 6 writes a .zip)",
        folder.display(),
        count(submissions(folder)?.len(), "submission"),
        shell_path(&folder.join(TEMPLATE)),
        shell_path(&folder.join("result")),
        shell_path(&folder.join(SUBMISSIONS)),
        shell_path(&folder.join("result.jplag")),
        shell_path(output)
    );
    Ok(())
}

/// Replaces the sources in `to` by those in `from`; whether any is another.
fn copy_sources(from: &Path, to: &Path) -> anyhow::Result<bool> {
    let read = |folder: &Path| -> anyhow::Result<BTreeMap<PathBuf, Vec<u8>>> {
        let mut texts = BTreeMap::new();
        for file in if folder.is_dir() { files_below(folder)? } else { Vec::new() } {
            let ending = file.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
            if ["rs", "wgsl"].contains(&ending) {
                let below = file.strip_prefix(folder).unwrap_or(&file).to_owned();
                texts.insert(below, fs::read(&file)?);
            }
        }
        Ok(texts)
    };
    let (new, old) = (read(from)?, read(to)?);
    if new == old && to.is_dir() {
        return Ok(false);
    }
    if to.exists() {
        fs::remove_dir_all(to).with_context(|| format!("cannot replace {}", to.display()))?;
    }
    fs::create_dir_all(to).with_context(|| format!("cannot write {}", to.display()))?;
    for (below, bytes) in new {
        let file = to.join(below);
        write_whole(&file, &bytes).with_context(|| format!("cannot write {}", file.display()))?;
    }
    Ok(true)
}

/// Writes the pages, and says what is alike.
fn show(kept: &KeptReport, settled: &BatchReport, folder: &Path) -> anyhow::Result<()> {
    let shared = Shared::of(kept.records());
    let mut near = jplag::kept(folder)?;
    let before = near.len();
    near.retain(|pair| {
        pair.holds(|slug| Some(kept.records().find(|own| own.slug == slug)?.digest.as_str()))
    });
    say_lost(before - near.len());
    let mut all: BTreeMap<[String; 2], SimilarPair> = BTreeMap::new();
    let name = |slug: &String| {
        // As all pages call them: by the class list, where it knows them.
        if let Some(entry) = settled.entries.iter().find(|own| own.record.slug == *slug) {
            return entry.student().full_name();
        }
        let record = kept.records().find(|record| record.slug == *slug);
        record.map(|record| record.student.full_name()).unwrap_or_default()
    };
    let alike = |who: &[String; 2]| SimilarPair {
        who: who.clone(),
        names: who.each_ref().map(name),
        ..SimilarPair::default()
    };
    let other = |pair: &&Pair| !shared.is_one_person(&pair.who);
    for pair in near.iter().filter(other).take(SHOWN) {
        let mut pair = pair.clone();
        if pair.who[0] > pair.who[1] {
            pair.who.reverse();
            pair.matches.iter_mut().for_each(|own| own.places.reverse());
        }
        let own = all.entry(pair.who.clone()).or_insert_with(|| alike(&pair.who));
        own.similarity = Some(pair.similarity);
        own.matches = pair.matches;
    }
    // Those with the most files first: in a large class many share one, and the class page names all of them.
    let mut same_files = shared.same_files();
    same_files.sort_by_key(|same| std::cmp::Reverse(same.paths.len()));
    for same in same_files.into_iter().take(SHOWN) {
        let own = all.entry(same.who.clone()).or_insert_with(|| alike(&same.who));
        own.same_files = same.paths.len();
        for paths in same.paths {
            // A passage of JPlag's is smaller than its file.
            own.matches.retain(|passage| passage.places[0].path != paths[0]);
            let places = paths.map(|path| PassagePlace { path, lines: [1, usize::MAX] });
            own.matches.push(SharedPassage { places, tokens: 0 });
        }
    }
    let mut all: Vec<SimilarPair> = all.into_values().collect();
    let submitted =
        kept.records().map(|record| (record.slug.clone(), record.name.clone())).collect();
    tell_attempts_apart(&mut all, &submitted);
    for pair in &mut all {
        let texts = |who: &String| sources_of(&folder.join(SUBMISSIONS).join(who));
        let [first, second] = pair.who.each_ref().map(texts);
        pair.texts = [first?, second?];
    }
    all.sort_by(|a, b| {
        let key = |own: &SimilarPair| (own.same_files, own.similarity.unwrap_or_default());
        let (a, b) = (key(a), key(b));
        b.0.cmp(&a.0).then(b.1.total_cmp(&a.1))
    });
    let page = SimilarityPage {
        title: kept.decided()?.assignment.title.clone(),
        compared: near.len(),
        median: near.get(near.len() / 2).map(|pair| pair.similarity),
        pairs: all,
    };
    report::write_similarity(folder, &page)?;
    let clear = |own: &&SimilarPair| own.same_files > 0 || own.similarity >= Some(SIMILAR);
    println!(
        "{}: {} side by side, {} of them to be looked at; it costs nobody anything",
        folder.join(report::HTML_FILE).display(),
        count(page.pairs.len(), "pair"),
        page.pairs.iter().filter(clear).count()
    );
    Ok(())
}

/// Adds to names that several submissions have, such as attempts of one student, what each was submitted as.
fn tell_attempts_apart(pairs: &mut [SimilarPair], submitted: &BTreeMap<String, String>) {
    let mut slugs: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for pair in pairs.iter() {
        for (name, slug) in pair.names.iter().zip(&pair.who) {
            slugs.entry(name.clone()).or_default().insert(slug.clone());
        }
    }
    for pair in pairs {
        for (name, slug) in pair.names.iter_mut().zip(&pair.who) {
            if slugs[name].len() > 1 && !name.is_empty() {
                *name += &format!(" ({})", submitted.get(slug).unwrap_or(slug));
            }
        }
    }
}

/// The sources of a submission, by path.
fn sources_of(folder: &Path) -> anyhow::Result<BTreeMap<String, String>> {
    let mut texts = BTreeMap::new();
    for file in if folder.is_dir() { files_below(folder)? } else { Vec::new() } {
        let below: Vec<_> = file.strip_prefix(folder).unwrap_or(&file).iter().collect();
        let below: Vec<_> = below.iter().map(|name| name.to_string_lossy()).collect();
        texts.insert(below.join("/"), String::from_utf8_lossy(&fs::read(&file)?).into_owned());
    }
    Ok(texts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attempts_of_one_student_are_told_apart() {
        let pair = |who: [&str; 2], names: [&str; 2]| SimilarPair {
            who: who.map(str::to_owned),
            names: names.map(str::to_owned),
            ..SimilarPair::default()
        };
        let mut pairs = [
            pair(["a1", "b"], ["Ann Lee", "Bo Ode"]),
            pair(["a2", "b"], ["Ann Lee", "Bo Ode"]),
            pair(["c", "d"], ["", ""]),
        ];
        let submitted = [("a1", "a2.zip"), ("a2", "a2_v2.zip"), ("b", "b.zip")];
        let submitted = submitted.map(|(slug, name)| (slug.to_owned(), name.to_owned()));
        tell_attempts_apart(&mut pairs, &submitted.into());
        let names = pairs.map(|pair| pair.names.join(", "));
        assert_eq!(names, ["Ann Lee (a2.zip), Bo Ode", "Ann Lee (a2_v2.zip), Bo Ode", ", "]);
    }
}
