//! The proof of the grader: right renderers lose nothing, known mistakes cost the parts that they
//! belong to and no other. The renderer is the reference with a switch on.

mod choice;
mod confirm;
mod deletion;
mod figures;
mod grader;
mod price;
mod row;
mod sources;
mod together;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result, ensure};
use umbra::assignment::Assignment;
use umbra::cli::AdapterChoice;
use umbra::diagnosis::Catalogue;
use umbra::files::library_name;
use umbra::grading::{Grading, Stages};
use umbra::store::Store;
use umbra::worker::Supervisor;

use choice::{Subject, pairs, singles, variants};
use figures::{Figure, Matrix};
use grader::Grader;
use row::Row;
use together::Combinations;

/// The film of the scenes that a submission holds images of, unless `--full`.
const SMALL_FILM: [u32; 2] = [128, 96];

/// Options of `xtask verdicts`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Grade only mistakes, pairs, variants and samples whose name holds this (repeatable); `plain` for the
    /// reference, `held-back scenes` for what confirms the thresholds
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// Scenes on their own films; without it the large ones are drawn at 128x96
    #[arg(long)]
    full: bool,
    /// A fast selection, as CI runs it: some right renderers, an eighth of the mistakes, 60 pairs, 20 triples, a sixth
    /// of the samples, two held-back seeds. Each mistake runs only on the path that shows it, at 4 spp and with shadow
    /// maps of 1024 texels a side
    #[arg(long, conflicts_with = "full")]
    quick: bool,
    /// Grade mistakes alone and write what they cost to this file, nothing else
    #[arg(long, value_name = "FILE", conflicts_with = "quick")]
    table: Option<PathBuf>,
    /// Print the evidence behind every point lost
    #[arg(long)]
    explain: bool,
    /// Seed of held-back scenes to grade on as well [default: none are made]
    #[arg(long = "held-back", alias = "perturb", value_name = "SEED")]
    held_back_seed: Option<u64>,
    /// Graphics adapter for realtime scenes
    #[arg(long, value_enum, default_value_t = AdapterChoice::Software)]
    adapter: AdapterChoice,
    /// Renderers graded at the same time [default: one more than there are cores]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
}

impl Arguments {
    /// Whether `--only` asks for what has this name.
    fn names(&self, name: &str) -> bool {
        self.only.is_empty() || self.only.iter().any(|only| name.contains(only.as_str()))
    }

    /// The subjects that `--only` asks for.
    fn chosen(&self, subjects: Vec<Subject>) -> Vec<Subject> {
        subjects.into_iter().filter(|subject| self.names(&subject.name())).collect()
    }
}

/// Grades everything, prints the matrix and returns the line of figures.
///
/// # Errors
/// When a verdict is not what the catalogue says, with the figures, or nothing can be graded here.
pub fn run(root: &Path, arguments: &Arguments) -> Result<String> {
    let catalogue = Catalogue::known()?;
    let assignment = assignment(root, arguments.full)?;
    let [umbra, library] = built(root)?;
    let scratch = assignment.scratch()?;
    let mut supervisor = Supervisor::available(umbra.clone(), scratch.path().to_owned());
    supervisor.compiles_quickly = arguments.quick;
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let store = Store {
        assignment: &assignment,
        reference: Some(library.clone()),
        supervisor: &supervisor,
        threads: cores as u32,
        progress: &|message| eprintln!("{message}"),
    };
    let cancel = AtomicBool::new(false);
    let mut grading =
        Grading::prepare(&store, arguments.adapter.adapter(), arguments.held_back_seed, &cancel)?;
    // Most renderers share all stages but one.
    grading.keep_frames(scratch.path().join("frames"));
    if let Err(why) = &grading.adapter {
        anyhow::bail!("realtime cannot be judged here: {why}");
    }
    let mut grader = Grader {
        assignment: &assignment,
        catalogue: &catalogue,
        grading,
        library,
        right: Stages::read(&root.join("reference_impl/src"), &assignment.template()),
        jobs: arguments.jobs.unwrap_or(cores + 1).max(1),
        explain: arguments.explain,
        all_shown: true,
        beside: arguments.quick.then_some(choice::QUICK_BESIDE),
        plain: Vec::new(),
    };

    row::print_header(&assignment);
    if arguments.quick || arguments.table.is_some() {
        grader.grade_plain()?;
    }
    if let Some(file) = &arguments.table {
        return write_table(&grader, arguments, file);
    }
    let (matrix, combined) = grade_matrix(&mut grader, &store, arguments)?;
    let mut figures = figures::of_matrix(&matrix);
    let mut graded = matrix.variants.len() + matrix.singles.len() + matrix.pairs.len();
    for (count, figure) in combined {
        graded += count;
        figures.push(figure);
    }
    let rules = deletion::figure(&matrix, &assignment.rules);
    // Some rules show in pairs alone, some in right variants.
    if arguments.only.is_empty() && !arguments.quick {
        figures.push(rules);
    }
    let held_back = arguments.names(confirm::NAME) && arguments.held_back_seed.is_none();
    if held_back {
        figures.push(confirm::figure(&grader, &store, arguments.quick)?);
    }
    let sources = sources::grade(root, &umbra, &assignment.rules, arguments)?;
    ensure!(graded > 0 || held_back || sources.is_some(), "nothing has a name like that");
    figures.extend(sources);
    summary(&figures)
}

/// The assignment, with smaller films unless all is to be full.
fn assignment(root: &Path, full: bool) -> Result<Assignment> {
    let mut assignment = Assignment::load(root)?;
    for scene in &mut assignment.scenes {
        // The images that a submission must contain are no matter here.
        if scene.submitted.take().is_some() && !full {
            scene.film = Some(SMALL_FILM);
        }
    }
    Ok(assignment)
}

/// The program and the reference as they were built.
fn built(root: &Path) -> Result<[PathBuf; 2]> {
    let umbra = format!("umbra{}", std::env::consts::EXE_SUFFIX);
    let files = [umbra, library_name("reference_impl")];
    let files = files.map(|file| root.join("target/release").join(file));
    for file in &files {
        ensure!(
            file.is_file(),
            "{} is missing; hint: cargo build --release --workspace",
            file.display()
        );
    }
    Ok(files)
}

/// Grades mistakes alone, writes what they cost, and returns the line of figures.
fn write_table(grader: &Grader, arguments: &Arguments, file: &Path) -> Result<String> {
    let singles = grader.grade_all(&arguments.chosen(singles(grader.catalogue)))?;
    std::fs::write(file, price::table(grader.catalogue, &singles))
        .with_context(|| file.display().to_string())?;
    summary(&[figures::singles(&singles), figures::prices(&singles)])
}

/// Grades mistakes, combinations of them and right renderers. Returns the matrix, and the number of
/// combinations of each size with their figure.
fn grade_matrix<'a>(
    grader: &mut Grader<'a>,
    store: &Store<'a>,
    arguments: &Arguments,
) -> Result<(Matrix, [(usize, Figure); 2])> {
    // What finds most comes first: a run of all takes long.
    let mut single = singles(grader.catalogue);
    if arguments.quick {
        grader.grading.cases.iter_mut().for_each(|case| case.spp = choice::QUICK_SPP);
        single = single.into_iter().step_by(choice::QUICK_STEP).collect();
    }
    let combinations = Combinations::new(grader, &single, arguments);
    let pairs = if arguments.quick { Vec::new() } else { pairs(grader.catalogue)? };
    let singles = grader.grade_all(&arguments.chosen(single))?;
    let combined = combinations.figures(grader, &singles)?;
    let pairs = grader.grade_all(&arguments.chosen(pairs))?;
    grader.reset(store)?;
    let variants = grade_variants(grader, arguments)?;
    grader.reset(store)?;
    Ok((Matrix { variants, singles, pairs }, combined))
}

/// Grades right renderers with each number of samples and threads.
fn grade_variants(grader: &mut Grader, arguments: &Arguments) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for (index, spp) in choice::SPP.into_iter().enumerate() {
        let all = variants(grader.catalogue, spp);
        let all = if arguments.quick { choice::few(all, index) } else { all };
        let chosen = arguments.chosen(all);
        for case in &mut grader.grading.cases {
            case.spp = spp.unwrap_or(case.spp);
        }
        for threads in choice::THREADS {
            let chosen = chosen.iter().filter(|subject| subject.threads == threads).cloned();
            grader.grading.threads = threads;
            rows.extend(grader.grade_all(&chosen.collect::<Vec<_>>())?);
        }
    }
    Ok(rows)
}

/// The line of figures; an error with all complaints before it when a figure is not full.
fn summary(figures: &[Figure]) -> Result<String> {
    let texts: Vec<&str> = figures.iter().map(|figure| figure.text.as_str()).collect();
    let line = format!("verdicts: {}", texts.join(" "));
    let complaints: Vec<String> = figures.iter().flat_map(|f| f.complaints.clone()).collect();
    ensure!(complaints.is_empty(), "{}\n{line}", complaints.join("\n"));
    Ok(line)
}
