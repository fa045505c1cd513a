//! `umbra check`: one working folder through all stages, for its author.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::ensure;
use serde::{Deserialize, Serialize};

use super::batch::Batch;
use super::context::Context;
use super::grade::{BudgetChoice, IsolationChoice, Perturb};
use super::render::AdapterChoice;
use super::{class, terminal};
use crate::assignment::Assignment;
use crate::class::Source;
use crate::files::{files_below, write_whole};
use crate::grading::{Mode, RenderPath};
use crate::intake::{format_of_bytes, read_archive};
use crate::report::{self, Closing, Look};
use crate::rubric::{Grade, Part};

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
    #[arg(long, short, value_name = "DIR", default_value = "umbra-report")]
    output: PathBuf,
    /// Which adapter draws realtime scenes
    #[arg(long, value_enum, default_value_t = AdapterChoice::Auto)]
    adapter: AdapterChoice,
    /// Print what each stage cost
    #[arg(long)]
    timings: bool,
    /// Open the report in the browser
    #[arg(long)]
    open: bool,
}

/// What of an assignment is asked.
pub struct Asked {
    /// The parts; empty for all.
    parts: Vec<String>,
    /// The scenes; empty for all.
    scenes: Vec<String>,
}

impl Asked {
    /// Whether nothing is left out.
    pub fn is_all(&self) -> bool {
        self.parts.is_empty() && self.scenes.is_empty()
    }

    /// Takes out of an assignment what is not asked.
    ///
    /// # Errors
    /// When there is no such part or scene.
    pub fn restrict(&self, assignment: &mut Assignment) -> anyhow::Result<()> {
        let ids: Vec<&str> = assignment.rules.parts.iter().map(|part| part.id.as_str()).collect();
        for part in &self.parts {
            ensure!(
                ids.contains(&part.as_str()),
                "there is no part {part}; expected one of {}",
                ids.join(", ")
            );
        }
        let names: Vec<&str> = assignment.scenes.iter().map(|scene| scene.name.as_str()).collect();
        for scene in &self.scenes {
            ensure!(
                names.contains(&scene.as_str()),
                "there is no scene {scene}; expected one of {}",
                names.join(", ")
            );
        }
        if !self.scenes.is_empty() {
            assignment.scenes.retain(|scene| self.scenes.contains(&scene.name));
        }
        let bonus = assignment.rules.parts.iter().any(|part| part.bonus && self.asks(&part.id));
        if !bonus {
            assignment.scenes.iter_mut().for_each(|scene| scene.bonus = None);
        }
        Ok(())
    }

    /// The halves of the assignment that the parts belong to. The bonus is drawn.
    pub fn paths(&self, context: &Context) -> Vec<RenderPath> {
        let path = |part: &Part| match part.path.as_str() {
            "offline" => RenderPath::Offline,
            _ => RenderPath::Realtime,
        };
        let parts = &context.assignment.rules.parts;
        let asked =
            |path_asked| parts.iter().any(|part| self.asks(&part.id) && path(part) == path_asked);
        RenderPath::ALL.into_iter().filter(|&path| asked(path)).collect()
    }

    /// Takes out of a grade what was not asked.
    pub fn only_of(&self, grade: &mut Grade) {
        if self.is_all() {
            return;
        }
        grade.parts.retain(|part| self.asks(&part.id));
        grade.points = grade.parts.iter().map(|part| part.points).sum();
        grade.points_max = grade.parts.iter().map(|part| part.points_max).sum();
        grade.out_of = grade.parts.iter().map(|part| part.out_of).sum();
        grade.remarks.push(format!("only {} was checked, not the rest", self.in_words()));
    }

    fn asks(&self, part: &str) -> bool {
        self.parts.is_empty() || self.parts.iter().any(|asked| asked == part)
    }

    /// `part 2.3 on scene cbox`; empty for all.
    fn in_words(&self) -> String {
        let list = |noun: &str, names: &[String]| match names {
            [] => None,
            [one] => Some(format!("{noun} {one}")),
            many => Some(format!("{noun}s {}", many.join(", "))),
        };
        match (list("part", &self.parts), list("scene", &self.scenes)) {
            (Some(parts), Some(scenes)) => format!("{parts} on {scenes}"),
            (parts, scenes) => parts.or(scenes).unwrap_or_default(),
        }
    }
}

/// What the last check found.
#[derive(Default, Serialize, Deserialize)]
struct LastCheck {
    /// The points of each part when it was asked last, least and most.
    parts: BTreeMap<String, (f64, f64)>,
    /// How long it took, by what was asked, in seconds.
    seconds: BTreeMap<String, f64>,
}

/// Checks one working folder and prints what is to be known of it; exit 1 when points are missing.
pub fn check(arguments: &CheckArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let (parts, scenes) = (arguments.part.clone(), arguments.scene.clone());
    let asked = Asked { parts, scenes };
    let folder = &arguments.submission;
    // What cannot be done is said before it is said what is done.
    let mut assignment = Context::assignment(root)?;
    asked.restrict(&mut assignment)?;
    ensure!(folder.exists(), "{} does not exist", folder.display());
    if folder.is_file() {
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
    let slug = class::sources(&given, &arguments.output).remove(0).slug;
    let last_file = arguments.output.join(&slug).join(LAST);
    let last = fs::read(&last_file).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let mut last: LastCheck = last.unwrap_or_default();
    let what = asked.in_words();
    eprintln!("umbra: {}", plan(folder, &what, last.seconds.get(&what).copied()));
    let batch = Batch {
        paths: vec![source],
        output: &arguments.output,
        adapter: arguments.adapter,
        jobs: 1,
        mode: Mode::Check,
        isolation: IsolationChoice::Reduced,
        perturb: Some(Perturb(None)),
        budget: BudgetChoice::Config,
        asked: Some(&asked),
        only: &[],
        from: None,
        list: None,
        attempt: None,
        force: false,
        timings: arguments.timings,
    };
    let begun = Instant::now();
    let Some((report, _)) = batch.run(root)? else { return Ok(super::EXIT_INTERRUPTED) };
    let entry = &report.entries[0].for_student(&report.rules);
    let width = terminal::width().min(READABLE_COLUMNS);
    let look = Look { width, colours: terminal::colours() };
    print!("{}", report::text_detail(&report, entry, look, arguments.verbose));
    let page = arguments.output.join(&entry.record.slug).join(report::HTML_FILE);
    let program = std::env::args().next().unwrap_or_else(|| "umbra".to_owned());
    let closing = Closing {
        folder: &folder.display().to_string(),
        umbra: &program,
        page: &page.display().to_string(),
        files: &task_files(root, &report.rules.parts),
        last: &last.parts,
        asked: &what,
    };
    print!("{}", report::text_closing(&report, entry, &closing, look));
    let points = entry.grade.parts.iter();
    last.parts.extend(points.map(|part| (part.id.clone(), (part.points, part.points_max))));
    last.seconds.insert(what, begun.elapsed().as_secs_f64());
    write_whole(&last_file, &serde_json::to_vec_pretty(&last)?)?;
    if arguments.open {
        super::view::open_page(&page);
    }
    let whole = entry.grade.points >= entry.grade.out_of;
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

    fn asked(parts: &[&str], scenes: &[&str]) -> Asked {
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        Asked { parts: owned(parts), scenes: owned(scenes) }
    }

    #[test]
    fn what_is_not_asked_is_taken_out() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let load = || Assignment::load(&root).unwrap();
        let restricted = |asked: Asked| {
            let mut assignment = load();
            asked.restrict(&mut assignment).map(|()| assignment)
        };
        let whole = restricted(asked(&[], &[])).unwrap();
        assert_eq!(whole.scenes, load().scenes);
        let pixels = restricted(asked(&["2.3"], &["cbox", "scale"])).unwrap();
        let names: Vec<&str> = pixels.scenes.iter().map(|scene| scene.name.as_str()).collect();
        assert_eq!(names, ["cbox", "scale"]);
        assert!(pixels.scenes.iter().all(|scene| scene.bonus.is_none()));
        assert!(restricted(asked(&["2.5"], &["cbox"])).unwrap().scenes[0].bonus.is_some());
        let error = restricted(asked(&["2.9"], &[])).unwrap_err().to_string();
        assert_eq!(
            error,
            "there is no part 2.9; expected one of 1.1, 1.2, 1.3, 1.4, 2.1, 2.2, 2.3, 2.4, 2.5"
        );
        let error = restricted(asked(&[], &["teepot"])).unwrap_err().to_string();
        assert!(
            error.starts_with("there is no scene teepot; expected one of teapot, cbox"),
            "{error}"
        );
    }

    #[test]
    fn what_is_asked_has_words() {
        assert_eq!(asked(&[], &[]).in_words(), "");
        assert_eq!(asked(&["1.1"], &[]).in_words(), "part 1.1");
        assert_eq!(asked(&["1.1", "2.5"], &["cbox"]).in_words(), "parts 1.1, 2.5 on scene cbox");
        assert_eq!(asked(&[], &["a", "b"]).in_words(), "scenes a, b");
    }

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
