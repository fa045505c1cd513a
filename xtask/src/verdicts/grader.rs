//! Grades renderers: the reference with switches on, and its stage texts with the same mistakes.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result};
use reference_impl::stages;
use umbra::assignment::Assignment;
use umbra::diagnosis::Catalogue;
use umbra::evidence::Check;
use umbra::grading::{Grading, RenderPath, Stages};
use umbra::rubric;
use umbra::store::Store;
use umbra::worker::STAGES;

use super::choice::{self, Subject};
use super::row::Row;
use crate::parallel;

/// What it takes to grade a renderer.
pub struct Grader<'a> {
    pub assignment: &'a Assignment,
    pub catalogue: &'a Catalogue,
    pub grading: Grading<'a>,
    /// The reference, with its switches.
    pub library: PathBuf,
    /// Its stages, and the template's.
    pub right: Stages,
    /// Number of renderers that are graded at the same time.
    pub jobs: usize,
    /// Whether the evidence behind lost points is printed.
    pub explain: bool,
    /// Whether the scenes show every mistake.
    pub all_shown: bool,
    /// A right switch that every wrong renderer has on besides.
    pub beside: Option<&'static str>,
    /// What was found out about the reference on each path, to stand for renderers that differ from
    /// it on the other alone; empty when every path of every renderer is to be seen.
    pub plain: Vec<(RenderPath, Vec<Check>)>,
}

impl<'a> Grader<'a> {
    /// Undoes what variants changed: samples per pixel and threads.
    ///
    /// # Errors
    /// When a scene cannot be loaded.
    pub fn reset(&mut self, store: &Store<'a>) -> Result<()> {
        for case in &mut self.grading.cases {
            case.spp = umbra::expected::load_scene(&case.offline)?.config().spp as u32;
        }
        self.grading.threads = store.threads;
        Ok(())
    }

    /// Grades all and prints a row for each as it is done.
    ///
    /// # Errors
    /// When one cannot be graded: the machine's fault, or ours.
    pub fn grade_all(&self, subjects: &[Subject]) -> Result<Vec<Row>> {
        parallel::each(subjects, self.jobs, |_, subject| {
            let row = self.grade(subject)?;
            row.print(self.explain);
            Ok(row)
        })
    }

    /// Finds out about the reference as it is.
    ///
    /// # Errors
    /// When it cannot be graded.
    pub fn grade_plain(&mut self) -> Result<()> {
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
        let beside = self.beside.filter(|_| !subject.is_right());
        let names = switches(&subject.mistakes).chain(beside);
        let options: Vec<String> = names.map(|name| format!("mistake={name}")).collect();
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
    ///
    /// # Errors
    /// When the reference lacks a stage, or two mistakes change the same text.
    pub fn stages(&self, mistakes: &[String]) -> Result<Stages> {
        let names: Vec<&str> = switches(mistakes).collect();
        let mut own = self.right.clone();
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
