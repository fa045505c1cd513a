//! The proof of the grader: right renderers lose nothing, known mistakes cost the parts that they
//! belong to and no other. The renderer is the reference with a switch on.

mod choice;
mod confirm;
mod deletion;
mod figures;
mod price;
mod row;
mod sources;
mod together;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use reference_impl::stages;
use umbra::assignment::Assignment;
use umbra::cli::AdapterChoice;
use umbra::diagnosis::Catalogue;
use umbra::evidence::Check;
use umbra::files::library_name;
use umbra::grading::{Grading, RenderPath, Stages};
use umbra::rubric;
use umbra::store::Store;
use umbra::worker::{STAGES, Supervisor};

use choice::{Subject, pairs, singles, variants};
use figures::{Figure, Matrix};
use row::Row;

use crate::parallel;

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
    /// A fast selection, as CI runs it: some right renderers, an eighth of the mistakes at 4 spp, 60 pairs, 20 triples,
    /// a sixth of the samples, two held-back seeds. Each mistake runs only on the path that shows it
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

/// Grades everything, prints the matrix and returns the line of figures.
///
/// # Errors
/// When a verdict is not what the catalogue says, with the figures, or nothing can be graded here.
pub fn run(root: &Path, arguments: &Arguments) -> Result<String> {
    let catalogue = Catalogue::known()?;
    let mut assignment = Assignment::load(root)?;
    for scene in &mut assignment.scenes {
        // The images that a submission must contain are no matter here.
        if scene.submitted.take().is_some() && !arguments.full {
            scene.film = Some(SMALL_FILM);
        }
    }
    let release = |file: String| root.join("target/release").join(file);
    let umbra = release(format!("umbra{}", std::env::consts::EXE_SUFFIX));
    let library = release(library_name("reference_impl"));
    for file in [&umbra, &library] {
        ensure!(
            file.is_file(),
            "{} is missing; hint: cargo build --release --workspace",
            file.display()
        );
    }
    let scratch = assignment.scratch()?;
    let supervisor = Supervisor::available(umbra.clone(), scratch.path().to_owned());
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let store = Store {
        assignment: &assignment,
        reference: Some(library.clone()),
        supervisor: &supervisor,
        threads: cores as u32,
        progress: &|message| eprintln!("{message}"),
    };
    let cancel = AtomicBool::new(false);
    let grading =
        Grading::prepare(&store, arguments.adapter.adapter(), arguments.held_back_seed, &cancel)?;
    if let Err(why) = &grading.adapter {
        anyhow::bail!("realtime cannot be judged here: {why}");
    }
    let mut bench = Bench {
        root,
        assignment: &assignment,
        grading,
        library,
        explain: arguments.explain,
        all_shown: true,
        plain: Vec::new(),
    };
    let jobs = arguments.jobs.unwrap_or(cores + 1).max(1);
    let named = |name: &str| {
        arguments.only.is_empty() || arguments.only.iter().any(|only| name.contains(only.as_str()))
    };
    let chosen = |subjects: Vec<Subject>| {
        subjects.into_iter().filter(|subject| named(&subject.name())).collect::<Vec<_>>()
    };

    row::print_header(&assignment);
    if arguments.quick || arguments.table.is_some() {
        bench.grade_plain()?;
    }
    if let Some(file) = &arguments.table {
        let singles = bench.grade_all(&chosen(singles(&catalogue)), jobs)?;
        std::fs::write(file, price::table(&catalogue, &singles))
            .with_context(|| file.display().to_string())?;
        return summary(&[figures::singles(&singles), figures::prices(&singles)]);
    }
    // What finds most comes first: a run of all takes long.
    let mut single = singles(&catalogue);
    if arguments.quick {
        bench.grading.cases.iter_mut().for_each(|case| case.spp = choice::QUICK_SPP);
        single = single.into_iter().step_by(choice::QUICK_STEP).collect();
    }
    let together = Together::new(&bench, &catalogue, &single, arguments.quick, &chosen);
    let pairs = if arguments.quick { Vec::new() } else { pairs(&catalogue)? };
    let single = bench.grade_all(&chosen(single), jobs)?;
    let combined = together.pairs.len() + together.triples.len();
    let together = together.figures(&bench, &catalogue, &single, jobs)?;
    let pairs = bench.grade_all(&chosen(pairs), jobs)?;
    bench.reset(&store)?;
    let mut right = Vec::new();
    for (index, spp) in choice::SPP.into_iter().enumerate() {
        let all = variants(&catalogue, spp);
        let chosen = chosen(if arguments.quick { choice::few(all, index) } else { all });
        for case in &mut bench.grading.cases {
            case.spp = spp.unwrap_or(case.spp);
        }
        for threads in choice::THREADS {
            let chosen: Vec<Subject> =
                chosen.iter().filter(|subject| subject.threads == threads).cloned().collect();
            bench.grading.threads = threads;
            right.extend(bench.grade_all(&chosen, jobs)?);
        }
    }
    bench.reset(&store)?;
    let matrix = Matrix { variants: right, singles: single, pairs };
    let mut figures = figures::of_matrix(&matrix);
    figures.extend(together);
    let rules = deletion::figure(&matrix, &assignment.rules);
    // Some rules show in pairs alone, some in right variants.
    if arguments.only.is_empty() && !arguments.quick {
        figures.push(rules);
    }
    let held_back = named(confirm::NAME) && arguments.held_back_seed.is_none();
    if held_back {
        let few = arguments.quick;
        figures.push(confirm::figure(&bench, &store, few, jobs)?);
    }
    let sources = sources::grade(root, &umbra, &assignment.rules, &named, arguments)?;
    let graded = matrix.variants.len() + matrix.singles.len() + matrix.pairs.len() + combined;
    ensure!(graded > 0 || held_back || sources.is_some(), "nothing has a name like that");
    figures.extend(sources);
    summary(&figures)
}

/// Mistakes that are made together, to see that no part gains by it.
struct Together {
    pairs: Vec<Subject>,
    triples: Vec<Subject>,
}

impl Together {
    fn new(
        bench: &Bench,
        catalogue: &Catalogue,
        single: &[Subject],
        quick: bool,
        chosen: &dyn Fn(Vec<Subject>) -> Vec<Subject>,
    ) -> Self {
        let fits = |names: &[String]| bench.stages(names).is_ok();
        let names: Vec<&str> =
            single.iter().flat_map(|s| &s.mistakes).map(String::as_str).collect();
        let drawn = |size, count| together::drawn(catalogue, &names, size, count, &fits);
        let (pairs, triples) = if quick {
            (drawn(2, choice::QUICK_PAIRS), drawn(3, choice::QUICK_TRIPLES))
        } else {
            (together::pairs(catalogue, &fits), drawn(3, choice::TRIPLES))
        };
        Self { pairs: chosen(pairs), triples: chosen(triples) }
    }

    /// Grades them, and each of their mistakes alone that is not among `known`.
    fn figures(
        &self,
        bench: &Bench,
        catalogue: &Catalogue,
        known: &[Row],
        jobs: usize,
    ) -> Result<Vec<Figure>> {
        let wanted = |single: &Subject| {
            let name = &single.mistakes[0];
            let own = self.pairs.iter().chain(&self.triples).any(|s| s.mistakes.contains(name));
            own && !known.iter().any(|row| row.subject.mistakes == single.mistakes)
        };
        let missing: Vec<Subject> = singles(catalogue).into_iter().filter(wanted).collect();
        let missing = bench.grade_all(&missing, jobs)?;
        let singles: BTreeMap<&str, &Row> = known
            .iter()
            .chain(&missing)
            .map(|row| (row.subject.mistakes[0].as_str(), row))
            .collect();
        let of = |name, subjects: &[Subject]| {
            let rows = bench.grade_all(subjects, jobs)?;
            Ok::<_, anyhow::Error>(together::figure(name, &rows, &singles))
        };
        Ok(vec![of("monotone_pairs", &self.pairs)?, of("monotone_triples", &self.triples)?])
    }
}

/// The line of figures; an error with all complaints before it when a figure is not full.
fn summary(figures: &[Figure]) -> Result<String> {
    let texts: Vec<&str> = figures.iter().map(|figure| figure.text.as_str()).collect();
    let line = format!("verdicts: {}", texts.join(" "));
    let complaints: Vec<String> = figures.iter().flat_map(|f| f.complaints.clone()).collect();
    ensure!(complaints.is_empty(), "{}\n{line}", complaints.join("\n"));
    Ok(line)
}

/// What it takes to grade a renderer.
struct Bench<'a> {
    root: &'a Path,
    assignment: &'a Assignment,
    grading: Grading<'a>,
    library: PathBuf,
    explain: bool,
    /// Whether the scenes show every mistake.
    all_shown: bool,
    /// What was found out about the reference on each path, to stand for renderers that differ from
    /// it on the other alone; empty when every path of every renderer is to be seen.
    plain: Vec<(RenderPath, Vec<Check>)>,
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
    fn grade_all(&self, subjects: &[Subject], jobs: usize) -> Result<Vec<Row>> {
        parallel::each(subjects, jobs, |_, subject| {
            let row = self.grade(subject)?;
            row.print(self.explain);
            Ok(row)
        })
    }

    /// Finds out about the reference as it is.
    fn grade_plain(&mut self) -> Result<()> {
        let stages = self.stages(&[])?;
        for path in RenderPath::ALL {
            let (found, _) =
                self.grading.plugin(&self.library, "", choice::PLAIN_SEED, &stages, &[path])?;
            self.plain.push((path, found.checks));
        }
        Ok(())
    }

    fn grade(&self, subject: &Subject) -> Result<Row> {
        let since = Instant::now();
        let paths = if self.plain.is_empty() { RenderPath::ALL.to_vec() } else { subject.paths() };
        let options: Vec<String> =
            switches(&subject.mistakes).map(|name| format!("mistake={name}")).collect();
        let stages = self.stages(&subject.mistakes)?;
        let options = options.join(",");
        let (mut evidence, diagnoses) =
            self.grading.plugin(&self.library, &options, subject.seed, &stages, &paths)?;
        let others = self.plain.iter().filter(|(path, _)| !paths.contains(path));
        evidence.checks.extend(others.flat_map(|(_, checks)| checks.clone()));
        let grade = rubric::grade(&self.assignment.rules, &evidence);
        let seconds = since.elapsed().as_secs_f64();
        let (subject, all_shown) = (subject.clone(), self.all_shown);
        Ok(Row { subject, all_shown, evidence, diagnoses, grade, seconds })
    }

    /// The reference's stage texts with mistakes, and the template's.
    fn stages(&self, mistakes: &[String]) -> Result<Stages> {
        let names: Vec<&str> = switches(mistakes).collect();
        let reference = self.root.join("reference_impl/src");
        let mut own = Stages::read(&reference, &self.assignment.template());
        for (index, name) in STAGES.into_iter().enumerate() {
            let right =
                own.own[index].take().with_context(|| format!("the reference has no {name}"))?;
            let text = stages::apply(name, &right, &names).map_err(anyhow::Error::msg)?;
            own.set_text(&format!("shaders/{name}.wgsl"), &text);
            own.own[index] = Some(text.into_owned());
        }
        if mistakes.iter().any(|name| name == choice::ELSEWHERE) {
            own.own = [const { None }; 3];
        }
        Ok(own)
    }
}

/// The mistakes that the reference has a switch for.
fn switches(mistakes: &[String]) -> impl Iterator<Item = &str> {
    mistakes.iter().map(String::as_str).filter(|name| *name != choice::ELSEWHERE)
}
