//! The proof of the grader: right renderers lose nothing, known mistakes cost the parts that they
//! belong to and no other. The renderer is the reference with a switch on.

#[path = "../../reference_impl/src/mistakes/stages.rs"]
mod stages;

mod choice;
mod row;

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use umbra::assignment::Assignment;
use umbra::diagnosis::Catalogue;
use umbra::expected::Store;
use umbra::grading::{Grading, Stages};
use umbra::rubric;
use umbra::worker::{Adapter, AdapterKind, Supervisor};

use choice::{Subject, pairs, singles, variants};
use row::Row;

/// The stages of a renderer, in the order of [`Stages`].
const STAGES: [&str; 3] = ["simple.vs", "diffuse.fs", "phong.fs"];
/// The film of the scenes that a hand-in holds images of, unless `--full`.
const SMALL_FILM: [u32; 2] = [128, 96];

/// What `xtask verdicts` is told.
#[derive(clap::Args)]
pub struct Arguments {
    /// Grade only mistakes, pairs and variants whose name holds this; `plain` for the reference
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
    /// Scenes on their own films; without it the large ones are drawn at 128x96
    #[arg(long)]
    full: bool,
    /// Print the evidence behind every point lost
    #[arg(long)]
    explain: bool,
    /// Renderers graded at the same time [default: one for each core]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
}

/// Grades everything, prints the matrix and answers the line of figures.
///
/// # Errors
/// When a verdict is not what the catalogue says, with the figures, or nothing can be graded here.
pub fn run(arguments: &Arguments) -> Result<String> {
    let root =
        Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the repository")?;
    let catalogue = Catalogue::known()?;
    let mut assignment = Assignment::load(root)?;
    for scene in &mut assignment.scenes {
        // The images that a hand-in must contain are no matter here.
        if scene.hand_in.take().is_some() && !arguments.full {
            scene.film = Some(SMALL_FILM);
        }
    }
    let release = |file: String| root.join("target/release").join(file);
    let umbra = release(format!("umbra{}", std::env::consts::EXE_SUFFIX));
    let (prefix, suffix) = (std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    let library = release(format!("{prefix}reference_impl{suffix}"));
    for file in [&umbra, &library] {
        ensure!(
            file.is_file(),
            "{} is missing; hint: cargo build --release --workspace",
            file.display()
        );
    }
    let scratch = assignment.cache().join("scratch");
    std::fs::create_dir_all(&scratch)?;
    let supervisor = Supervisor::available(umbra, scratch);
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let store = Store {
        assignment: &assignment,
        reference: Some(library.clone()),
        supervisor: &supervisor,
        threads: cores as u32,
        progress: &|message| eprintln!("{message}"),
    };
    let cancel = AtomicBool::new(false);
    let adapter = Adapter { kind: AdapterKind::Software, name: String::new() };
    let grading = Grading::prepare(&store, adapter, &cancel)?;
    if let Err(why) = &grading.adapter {
        anyhow::bail!("realtime cannot be judged here: {why}");
    }
    let mut bench =
        Bench { root, assignment: &assignment, grading, library, explain: arguments.explain };
    let jobs = arguments.jobs.unwrap_or(cores).max(1);
    let wanted = |subject: &Subject| {
        arguments.only.as_ref().is_none_or(|only| subject.name().contains(only))
    };

    row::print_header(&assignment);
    let (mut rejected, mut accepted) = (0, 0);
    for spp in choice::SPP {
        let chosen: Vec<Subject> = variants(spp).into_iter().filter(wanted).collect();
        for case in &mut bench.grading.cases {
            case.spp = spp.unwrap_or(case.spp);
        }
        for threads in choice::THREADS {
            let chosen: Vec<_> =
                chosen.iter().filter(|subject| subject.threads == threads).collect();
            bench.grading.threads = threads;
            let rows = bench.grade_all(&chosen, jobs)?;
            rejected += rows.iter().filter(|row| !row.as_declared()).count();
            accepted += rows.len();
        }
    }
    bench.reset(&store)?;
    let singles = bench
        .grade_all(&singles(&catalogue).iter().filter(|s| wanted(s)).collect::<Vec<_>>(), jobs)?;
    let pairs = bench
        .grade_all(&pairs(&catalogue)?.iter().filter(|s| wanted(s)).collect::<Vec<_>>(), jobs)?;
    let good = |rows: &[Row]| rows.iter().filter(|row| row.as_declared()).count();
    let figures = format!(
        "verdicts: false_rejects={rejected}/{accepted} singles={}/{} pairs={}/{}",
        good(&singles),
        singles.len(),
        good(&pairs),
        pairs.len()
    );
    let all = rejected == 0 && good(&singles) == singles.len() && good(&pairs) == pairs.len();
    ensure!(all, "{}\n{figures}", row::complaints(singles.iter().chain(&pairs)));
    Ok(figures)
}

/// What it takes to grade a renderer.
struct Bench<'a> {
    root: &'a Path,
    assignment: &'a Assignment,
    grading: Grading<'a>,
    library: PathBuf,
    explain: bool,
}

impl<'a> Bench<'a> {
    /// Undoes what variants changed: samples per pixel and threads.
    fn reset(&mut self, store: &Store<'a>) -> Result<()> {
        for case in &mut self.grading.cases {
            case.spp = umbra::expected::load_scene(&case.offline)?.config().spp as u32;
        }
        self.grading.threads = store.threads;
        Ok(())
    }

    /// Grades all and prints a row for each as it is done.
    fn grade_all(&self, subjects: &[&Subject], jobs: usize) -> Result<Vec<Row>> {
        let next = AtomicUsize::new(0);
        let rows = Mutex::new(Vec::new());
        let failure = Mutex::new(None);
        std::thread::scope(|scope| {
            for _ in 0..jobs.min(subjects.len()) {
                scope.spawn(|| {
                    while let Some(subject) = subjects.get(next.fetch_add(1, Ordering::Relaxed)) {
                        match self.grade(subject) {
                            Ok(row) => {
                                row.print(self.explain);
                                rows.lock().map(|mut rows| rows.push(row)).ok();
                            }
                            Err(error) => {
                                failure.lock().map(|mut failure| *failure = Some(error)).ok();
                                return;
                            }
                        }
                    }
                });
            }
        });
        match failure.into_inner() {
            Ok(Some(error)) => Err(error),
            _ => Ok(rows.into_inner().unwrap_or_default()),
        }
    }

    fn grade(&self, subject: &Subject) -> Result<Row> {
        let since = Instant::now();
        let options: Vec<String> =
            subject.mistakes.iter().map(|name| format!("mistake={name}")).collect();
        let stages = self.stages(&subject.mistakes)?;
        let evidence =
            self.grading.plugin(&self.library, &options.join(","), subject.seed, &stages)?;
        let grade = rubric::grade(&self.assignment.rules, &evidence);
        Ok(Row::new(subject, grade, &evidence, since.elapsed().as_secs_f64()))
    }

    /// The reference's stage texts with mistakes, and the template's.
    fn stages(&self, mistakes: &[String]) -> Result<Stages> {
        let names: Vec<&str> = mistakes.iter().map(String::as_str).collect();
        let source = |package: &str| self.root.join(package).join("src");
        let mut own = Stages::read(&source("reference_impl"), &source("student_template"));
        for (name, text) in STAGES.iter().zip(&mut own.own) {
            let right = text.take().with_context(|| format!("the reference has no {name}"))?;
            *text =
                Some(stages::apply(name, &right, &names).map_err(anyhow::Error::msg)?.into_owned());
        }
        Ok(own)
    }
}
