//! Thresholds were set on public scenes and on those of one seed. This module tests them on scenes that nobody has
//! looked at: a right renderer must lose nothing there, and a mistake must cost only its own parts.

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use umbra::diagnosis::Catalogue;
use umbra::grading::Grading;
use umbra::store::Store;

use super::choice::{Subject, singles, variants};
use super::figures::Figure;
use super::grader::Grader;
use super::row::Row;
use crate::parallel;

/// Its name in `--only`.
pub const NAME: &str = "held-back scenes";

/// Primes after a million. A seed is spent once a threshold was changed by what it showed: then
/// all ten are replaced by the next ten. (So were the first ten, by what hardware showed on them.)
const HELD_BACK_SEEDS: [u64; 10] = [
    1_000_159, 1_000_171, 1_000_183, 1_000_187, 1_000_193, 1_000_199, 1_000_211, 1_000_213,
    1_000_231, 1_000_249,
];
/// Samples per pixel of right renderers, in turn.
const SPP: [u32; 3] = [16, 4, 64];

/// Grades on the held-back scenes of each of several seeds and on no others: right renderers on each, the
/// known mistakes dealt out among them. With `few`, one right renderer on those of every fifth seed, and no
/// mistakes.
///
/// # Errors
/// When scenes cannot be made or graded: the machine's matters.
pub fn figure(grader: &Grader, store: &Store, few: bool) -> Result<Figure> {
    let mut assignment = grader.assignment.clone();
    assignment.scenes.retain(|scene| scene.held_back_copies);
    let mistakes = if few { Vec::new() } else { singles(grader.catalogue) };
    let adapter = grader.grading.adapter.clone().map_err(anyhow::Error::msg)?;
    let seeds: Vec<u64> = HELD_BACK_SEEDS.into_iter().step_by(if few { 5 } else { 1 }).collect();
    let complaints = parallel::each(&seeds, grader.jobs, |index, seed| {
        let reference = store.reference.clone();
        let store = Store { assignment: &assignment, reference, progress: &|_| {}, ..*store };
        let never = AtomicBool::new(false);
        let mut grading = Grading::prepare(&store, adapter.clone(), Some(*seed), &never)?;
        // What is right on the public ones is the matrix' matter too. Here there are no others.
        grading.cases.retain(|case| case.held_back);
        grading.cases.iter_mut().for_each(|case| case.held_back = false);
        let mut own = Grader {
            assignment: &assignment,
            grading,
            library: grader.library.clone(),
            right: grader.right.clone(),
            jobs: 1,
            // That a mistake costs what it should is the matrix' fault: three scenes do not show all.
            all_shown: false,
            plain: Vec::new(),
            ..*grader
        };
        println!("held-back scenes of seed {seed}");
        let spp = SPP[index % SPP.len()];
        let right = right(grader.catalogue, index, spp, few);
        let dealt = mistakes.iter().skip(index).step_by(HELD_BACK_SEEDS.len());
        let mut rows = own.grade_all(&dealt.cloned().collect::<Vec<_>>())?;
        for case in &mut own.grading.cases {
            case.spp = spp;
        }
        rows.extend(own.grade_all(&right)?);
        rows.retain(|row| !row.as_declared());
        let complaint = |row: &Row| {
            format!("held-back seed {seed}: {}: {}", row.subject.name(), row.complaint())
        };
        Ok(rows.iter().map(complaint).collect::<Vec<_>>())
    })?;
    let confirmed = complaints.iter().filter(|complaints| complaints.is_empty()).count();
    let complaints = complaints.concat();
    let text = format!("confirmed={confirmed}/{}", seeds.len());
    Ok(Figure { text, complaints })
}

/// Right renderers for the `index`th seed.
fn right(catalogue: &Catalogue, index: usize, spp: u32, few: bool) -> Vec<Subject> {
    let mut plain = variants(catalogue, Some(spp));
    let first = index % plain.len();
    plain.rotate_left(first);
    plain.truncate(if few { 1 } else { 3 });
    if !few {
        // What is done otherwise is dealt out among the seeds.
        let others = variants(catalogue, None).into_iter();
        plain.extend(others.skip(index).step_by(HELD_BACK_SEEDS.len()));
    }
    plain
}
