//! `umbra check`: takes one working folder through all stages, for its author.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::ensure;
use serde::{Deserialize, Serialize};

use super::batch::{Batch, BatchOutcome};
use super::choices::HeldBackSeed;
use super::context::Context;
use super::outputs::{ensure_apart, shell_word};
use super::render::AdapterChoice;
use super::selection::Selection;
use super::tree::ensure_working_folder;
use super::{class, terminal, terminal_pictures};
use crate::class::Source;
use crate::files::{files_below, write_whole};
use crate::grading::Mode;
use crate::intake::{format_of_bytes, read_archive};
use crate::report::{self, Closing, Look};
use crate::rubric::{Part, PartGrade};

/// What the last check found, in the submission's folder in the report.
const LAST: &str = "last-check.json";
/// What marks the place of a task in the template.
const TASK: &str = "TODO(A2) ";
/// Text is not wider than this, however wide the terminal is.
const READABLE_COLUMNS: usize = 110;

/// Options of `umbra check`.
#[derive(clap::Args)]
pub struct CheckArguments {
    /// Your working folder (config.json, src/, offline/, realtime/) or an archive
    submission: PathBuf,
    /// Check only this part, such as 2.3; may be repeated
    #[arg(long, value_name = "PART")]
    part: Vec<String>,
    /// Check only on this scene, such as teapot; may be repeated
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Print every check with its values and bounds
    #[arg(long, short)]
    verbose: bool,
    /// Where to write the report with its pictures
    #[arg(
        long = "report",
        alias = "output",
        short_alias = 'o',
        value_name = "DIR",
        default_value = "umbra-report"
    )]
    output: PathBuf,
    /// Graphics adapter for realtime scenes
    #[arg(long, value_enum, default_value_t = AdapterChoice::Auto)]
    adapter: AdapterChoice,
    /// Print what each step cost
    #[arg(long)]
    timings: bool,
    /// Open the report in the browser
    #[arg(long)]
    open: bool,
    /// Show the pictures of what was lost, in a terminal that can
    #[arg(long)]
    pictures: bool,
    /// Leave the library of what compiled in this file, for the live view of `umbra watch`
    #[arg(long, value_name = "FILE", hide = true)]
    keep_plugin: Option<PathBuf>,
    /// Judge realtime before anything is rendered offline, for a save of shaders alone
    #[arg(long, hide = true)]
    realtime_first: bool,
}

/// What the last check found.
#[derive(Default, Serialize, Deserialize)]
struct LastCheck {
    /// The points of each part when it was asked last, least and most.
    parts: BTreeMap<String, (f64, f64)>,
    /// How long it took, by what was asked, in seconds.
    seconds: BTreeMap<String, f64>,
}

/// Checks one working folder and prints the result; exit 1 when points are missing.
///
/// # Errors
/// When it is no working folder or archive, or the machine cannot grade it.
pub fn check(arguments: &CheckArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let (parts, scenes) = (arguments.part.clone(), arguments.scene.clone());
    let selection = Selection { parts, scenes };
    let folder = &arguments.submission;
    // Errors come before the announcement of the work.
    let mut assignment = Context::assignment(root)?;
    selection.restrict(&mut assignment)?;
    ensure!(folder.exists(), "{} does not exist", folder.display());
    if folder.is_dir() {
        ensure_working_folder(folder, &assignment.tree)?;
    } else {
        ensure!(
            folder.is_file(),
            "{} is a pipe or device, expected your working folder or what umbra pack made of it",
            folder.display()
        );
        let bytes = read_archive(folder, &assignment.limits.archive)?.unwrap_or_default();
        ensure!(
            format_of_bytes(&bytes).is_some(),
            "{} is no archive, expected your working folder or what umbra pack made of it",
            folder.display()
        );
    }
    // `.` has no name of its own.
    let named = || folder.canonicalize().ok();
    let source = Some(folder.clone()).filter(|folder| folder.file_name().is_some());
    let source = source.or_else(named).unwrap_or_else(|| folder.clone());
    let given = [Source::given(&source)];
    let slug =
        class::sources(Mode::Check, &given, &arguments.output, &HashMap::new()).remove(0).slug;
    ensure_apart(&arguments.output, &source, &slug, &assignment.tree)?;
    super::writable(&arguments.output)?;
    let last_file = arguments.output.join(&slug).join(LAST);
    let last = fs::read(&last_file).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let mut last: LastCheck = last.unwrap_or_default();
    let what = selection.in_words();
    eprintln!("umbra: {}", plan(folder, &what, last.seconds.get(&what).copied()));
    let batch = Batch {
        adapter: arguments.adapter,
        held_back_seed: Some(HeldBackSeed(None)),
        selection: Some(&selection),
        keeps_plugin: arguments.keep_plugin.as_deref(),
        realtime_first: arguments.realtime_first,
        timings: arguments.timings,
        ..Batch::of(vec![source], &arguments.output, Mode::Check)
    };
    let begun = Instant::now();
    let BatchOutcome::Report(report, _) = batch.run(root)? else {
        return Ok(super::EXIT_INTERRUPTED);
    };
    let entry = &report.entries[0].for_student(&report.rules, false);
    let width = terminal::width().min(READABLE_COLUMNS);
    let look = Look { width, colors: terminal::colors() };
    print_as_is!("{}", report::text_detail(&report, entry, look, arguments.verbose));
    let folder_of_page = arguments.output.join(&entry.record.slug);
    if arguments.pictures {
        print_as_is!("{}", terminal_pictures::pictures(entry, &report.rules, &folder_of_page));
    }
    let page = folder_of_page.join(report::HTML_FILE);
    let program = std::env::args().next().unwrap_or_else(|| "umbra".to_owned());
    let closing = Closing {
        folder: &shell_word(&folder.display().to_string()),
        umbra: &shell_word(&program),
        is_archive: folder.is_file(),
        page: &page.display().to_string(),
        files: &task_files(root, &report.rules.parts),
        last: &last.parts,
        asked: &what,
    };
    print_as_is!("{}", report::text_closing(&report, entry, &closing, look));
    let points = entry.grade.parts.iter();
    last.parts.extend(points.map(|part| (part.id.clone(), (part.points, part.points_max))));
    last.seconds.insert(what, begun.elapsed().as_secs_f64());
    write_whole(&last_file, &serde_json::to_vec_pretty(&last)?)?;
    if arguments.open {
        super::view::open_page(&page);
    }
    // A bonus makes up for no part.
    let grade = &entry.grade;
    let whole = grade.points >= grade.out_of && !grade.parts.iter().any(PartGrade::is_lost);
    Ok(if whole { super::EXIT_OK } else { super::EXIT_NOT_IN_ORDER })
}

/// What is going to be done, and how long it will take.
fn plan(folder: &Path, asked: &str, last_s: Option<f64>) -> String {
    let asked = if asked.is_empty() { String::new() } else { format!(", {asked} only") };
    let time = match last_s {
        Some(s) => format!("last time it took {} s", s.ceil()),
        None => "usually less than a minute, a few minutes on a slow machine".to_owned(),
    };
    format!(
        "checking {}{asked}: compiles src/, draws the scenes, compares; {time}",
        folder.display()
    )
}

/// The files in which the template marks the task of each part.
fn task_files(root: Option<&Path>, parts: &[Part]) -> BTreeMap<String, String> {
    let Ok(assignment) = Context::assignment(root) else { return BTreeMap::new() };
    let template = assignment.template();
    let mut found: BTreeMap<String, String> = BTreeMap::new();
    for file in files_below(&template).unwrap_or_default() {
        let Ok(text) = fs::read_to_string(&file) else { continue };
        let name = file.strip_prefix(&template).unwrap_or(&file);
        let name = format!("src/{}", name.display()).replace('\\', "/");
        for part in parts.iter().filter(|part| text.contains(&format!("{TASK}{}", part.id))) {
            let files = found.entry(part.id.clone()).or_default();
            if !files.is_empty() {
                files.push_str(", ");
            }
            files.push_str(&name);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assignment::Assignment;

    #[test]
    fn every_part_has_the_file_of_its_task() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let parts = Assignment::load(&root).unwrap().rules.parts;
        let files = task_files(Some(&root), &parts);
        assert_eq!(files.len(), parts.len());
        assert_eq!(files["1.2"], "src/bsdfs/phong.rs");
        assert_eq!(files["2.3"], "src/shaders/diffuse.fs.wgsl");
    }
}
