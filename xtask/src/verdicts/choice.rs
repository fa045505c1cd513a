//! Which renderers are graded: right ones, with one mistake, with two.

use anyhow::{Context, Result};
use umbra::diagnosis::Catalogue;

/// Samples per pixel of right renderers; none for what the scenes ask for.
pub const SPP: [Option<u32>; 5] = [None, Some(1), Some(4), Some(16), Some(64)];
/// Threads of right renderers.
pub const THREADS: [u32; 3] = [1, 2, 4];
/// Seeds of right renderers: as student ids are.
const SEEDS: [u64; 4] = [260_000_001, 260_712_345, 261_999_999, 7];

/// Pairs of mistakes that a student may well make together. Not among them: one that hides the
/// other, such as an intensity that was never set.
const PAIRS: [[&str; 2]; 24] = [
    ["diffuse-no-pi", "phong-n-plus-1"],
    ["diffuse-no-cosine", "light-two-cosines"],
    ["diffuse-no-wi-test", "shadow-none"],
    ["diffuse-no-pi", "film-flipped-rows"],
    ["phong-no-scale", "light-no-falloff"],
    ["phong-blinn", "light-times-4pi"],
    ["phong-unnormalised", "shadow-no-max-t"],
    ["phong-reflect-sign", "phong-fs-reflect-sign"],
    ["phong-no-wo-test", "phong-fs-no-wo-test"],
    ["light-two-cosines", "shadow-acne"],
    ["light-over-r", "shadow-epsilon"],
    ["light-grey", "shadow-inverted"],
    ["frame-geometric-normal", "shadow-max-t-r2"],
    ["film-gamma", "shadow-none"],
    ["film-clamped", "phong-exponent-plus-1"],
    ["camera-horizontal-fov", "diffuse-channels-swapped"],
    ["loop-jitter-shifted", "pass-rho-s-unset"],
    ["pass-exponent-unset", "diffuse-fs-no-pi"],
    ["pass-rho-d-unset", "vertex-normal-view-space"],
    ["vertex-position-view-space", "phong-fs-two-cosines"],
    ["diffuse-fs-two-cosines", "phong-fs-two-cosines"],
    ["diffuse-fs-no-falloff", "phong-fs-n-plus-1"],
    ["phong-fs-unnormalised", "shadow-map-none"],
    ["light-two-cosines", "diffuse-fs-two-cosines"],
];

/// A renderer to be graded.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The reference's switches.
    pub mistakes: Vec<String>,
    /// Seed of its samplers.
    pub seed: u64,
    /// Threads of its renders.
    pub threads: u32,
    /// Samples per pixel, where they are not the scene's.
    pub spp: Option<u32>,
    /// The parts in which it must lose points.
    pub parts: Vec<String>,
    /// The findings that it must lead to.
    pub findings: Vec<String>,
}

impl Subject {
    fn right(switch: Option<&str>, seed: u64, threads: u32, spp: Option<u32>) -> Self {
        let mistakes = switch.map(str::to_owned).into_iter().collect();
        Self { mistakes, seed, threads, spp, parts: Vec::new(), findings: Vec::new() }
    }

    /// Its name in the matrix.
    pub fn name(&self) -> String {
        if !self.parts.is_empty() || !self.findings.is_empty() {
            return self.mistakes.join(" + ");
        }
        let mut name = if self.mistakes.is_empty() { "plain".into() } else { self.mistakes.join(" + ") };
        if let Some(spp) = self.spp {
            name += &format!(" {spp} spp");
        }
        format!("{name}, seed {}, {} threads", self.seed, self.threads)
    }
}

/// Right renderers at one number of samples.
pub fn variants(spp: Option<u32>) -> Vec<Subject> {
    if spp.is_none() {
        // What is no mistake, once each.
        let harmless = super::stages::HARMLESS.iter();
        return harmless.map(|switch| Subject::right(Some(switch.name), 1, THREADS[0], None)).collect();
    }
    let each = THREADS.iter().flat_map(|&threads| {
        // One thread draws with one seed more than the others: 5 + 5 + 5 of each.
        SEEDS.iter().chain(&[260_555_000 + u64::from(threads)]).map(move |&seed| (seed, threads)).collect::<Vec<_>>()
    });
    each.map(|(seed, threads)| Subject::right(None, seed, threads, spp)).collect()
}

/// Every mistake alone.
pub fn singles(catalogue: &Catalogue) -> Vec<Subject> {
    let single = |mistake: &umbra::diagnosis::KnownMistake| Subject {
        mistakes: vec![mistake.name.clone()],
        seed: SEEDS[0],
        threads: THREADS[1],
        spp: None,
        parts: mistake.parts.clone(),
        findings: mistake.findings.clone(),
    };
    catalogue.mistakes.iter().map(single).collect()
}

/// The pairs, each with the parts of both.
///
/// # Errors
/// When the catalogue lacks a name.
pub fn pairs(catalogue: &Catalogue) -> Result<Vec<Subject>> {
    let pair = |names: &[&str; 2]| {
        let [a, b] = names.map(|name| catalogue.named(name).with_context(|| format!("there is no mistake {name}")));
        let (a, b) = (a?, b?);
        let mut parts = [a.parts.as_slice(), b.parts.as_slice()].concat();
        parts.sort();
        parts.dedup();
        Ok(Subject {
            mistakes: names.map(str::to_owned).to_vec(),
            seed: SEEDS[1],
            threads: THREADS[1],
            spp: None,
            parts,
            findings: [a.findings.as_slice(), b.findings.as_slice()].concat(),
        })
    };
    PAIRS.iter().map(pair).collect()
}
