//! Which renderers are graded: right ones, with one mistake, with two.

use anyhow::{Context, Result};
use umbra::diagnosis::{Catalogue, MistakeClass, RightVariant};
use umbra::evidence::CheckId;
use umbra::grading::RenderPath;

/// Samples per pixel of right renderers; none for what the scenes ask for.
pub const SPP: [Option<u32>; 5] = [None, Some(1), Some(4), Some(16), Some(64)];
/// Threads of right renderers.
pub const THREADS: [u32; 3] = [1, 2, 4];
/// Seeds of right renderers: as student ids are.
const SEEDS: [u64; 4] = [260_000_001, 260_712_345, 261_999_999, 7];

/// `--quick` takes every n-th of the mistakes, and this many pairs and triples of them.
pub const QUICK_STEP: usize = 8;
pub const QUICK_PAIRS: usize = 60;
pub const QUICK_TRIPLES: usize = 20;
/// The samples per pixel of all these.
pub const QUICK_SPP: u32 = 4;
/// What all these have on besides: shadow maps of a quarter of the texels.
pub const QUICK_BESIDE: &str = "shadow-map-1024";
/// Number of triples without `--quick`.
pub const TRIPLES: usize = 500;

/// The seed of what stands for the other path.
pub const PLAIN_SEED: u64 = SEEDS[0];

/// Pairs of mistakes that a student may well make together, and mistakes of renderers that do something otherwise.
/// Not among them: one that hides the other, such as an intensity that was never set.
const PAIRS: [[&str; 2]; 41] = [
    ["diffuse-no-pi", "phong-n-plus-1"],
    ["diffuse-no-pi", "light-two-cosines"],
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
    ["pass-rho-s-unset", "vertex-normal-view-space"],
    ["vertex-position-view-space", "phong-fs-two-cosines"],
    ["diffuse-fs-two-cosines", "phong-fs-two-cosines"],
    ["diffuse-fs-no-falloff", "phong-fs-n-plus-1"],
    ["phong-fs-unnormalised", "shadow-map-none"],
    ["light-two-cosines", "diffuse-fs-two-cosines"],
    [ELSEWHERE, "diffuse-fs-no-pi"],
    [ELSEWHERE, "phong-fs-n-plus-1"],
    [ELSEWHERE, "vertex-normal-negated"],
    [ELSEWHERE, "vertex-depth-is-w"],
    [ELSEWHERE, "vertex-clip-w-zero"],
    [ELSEWHERE, "phong-fs-facing-reversed"],
    [ELSEWHERE, "pass-half-of-triangles"],
    [ELSEWHERE, "pass-rho-swapped"],
    [ELSEWHERE, "pass-camera-unset"],
    ["third-varying", "vertex-normal-negated"],
    ["directions-in-world", "shadow-none"],
    ["directions-in-world", "phong-no-scale"],
    ["wi-from-light", "phong-n-plus-1"],
    ["own-bsdfs", "diffuse-no-pi"],
    ["own-bsdfs", "phong-n-plus-1"],
    ["own-bsdfs", "shadow-none"],
    ["normals-negated-twice", "phong-fs-n-plus-1"],
];

/// The stages lie in no file of the contract's: none can be exchanged, pixels by material decide.
pub const ELSEWHERE: &str = "stages-elsewhere";

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
    pub findings: Vec<CheckId>,
    /// Whether the diagnosis must name it.
    pub named: bool,
    /// What the first part's loss must be like, where that is known.
    pub class: Option<MistakeClass>,
    /// Where a right variant shows; none for both.
    pub path: Option<RenderPath>,
}

impl Subject {
    fn right(switch: Option<&str>, seed: u64, threads: u32, spp: Option<u32>) -> Self {
        let mistakes = switch.map(str::to_owned).into_iter().collect();
        Self { seed, threads, spp, ..Self::together(mistakes, Vec::new()) }
    }

    /// Several mistakes at once.
    pub fn together(mistakes: Vec<String>, parts: Vec<String>) -> Self {
        Self {
            mistakes,
            // As of single mistakes, so that chance makes no difference between them.
            seed: PLAIN_SEED,
            threads: THREADS[1],
            spp: None,
            parts,
            findings: Vec::new(),
            named: false,
            class: None,
            path: None,
        }
    }

    /// The paths that its switches can show on. Seed, threads and samples are matters of offline.
    pub fn paths(&self) -> Vec<RenderPath> {
        let declares = |path: &RenderPath| match path {
            RenderPath::Offline => {
                !self.findings.is_empty() || self.parts.iter().any(|part| part.starts_with("1."))
            }
            RenderPath::Realtime => self.parts.iter().any(|part| part.starts_with("2.")),
        };
        match (self.is_right(), self.mistakes.is_empty()) {
            (true, true) => vec![RenderPath::Offline],
            (true, false) => self.path.map_or(RenderPath::ALL.to_vec(), |path| vec![path]),
            (false, _) => RenderPath::ALL.into_iter().filter(declares).collect(),
        }
    }

    /// Whether it must lose nothing.
    pub fn is_right(&self) -> bool {
        self.parts.is_empty() && self.findings.is_empty()
    }

    /// Whether it must lose what it declares; of others only that they gain nothing is asked.
    pub fn judged_alone(&self) -> bool {
        self.mistakes.len() < 2 || self.named
    }

    /// Its name in the matrix.
    pub fn name(&self) -> String {
        if !self.is_right() {
            return self.mistakes.join(" + ");
        }
        let mut name =
            if self.mistakes.is_empty() { "plain".into() } else { self.mistakes.join(" + ") };
        if let Some(spp) = self.spp {
            name += &format!(" {spp} spp");
        }
        format!("{name}, seed {}, {} threads", self.seed, self.threads)
    }
}

/// Right renderers at one number of samples.
pub fn variants(catalogue: &Catalogue, spp: Option<u32>) -> Vec<Subject> {
    if spp.is_none() {
        // What is done otherwise and right, once each.
        let variant = |(index, right): (usize, &RightVariant)| Subject {
            path: Some(match right.path.as_str() {
                "realtime" => RenderPath::Realtime,
                _ => RenderPath::Offline,
            }),
            ..Subject::right(Some(&right.name), 1, THREADS[index % THREADS.len()], None)
        };
        return catalogue.right.iter().enumerate().map(variant).collect();
    }
    let each = THREADS.iter().flat_map(|&threads| {
        // One thread draws with one seed more than the others: 5 + 5 + 5 of each.
        SEEDS
            .iter()
            .chain(&[260_555_000 + u64::from(threads)])
            .map(move |&seed| (seed, threads))
            .collect::<Vec<_>>()
    });
    each.map(|(seed, threads)| Subject::right(None, seed, threads, spp)).collect()
}

/// One of the right renderers at each number of samples, the `index`th: no two share seed and
/// threads; and half of those that do something otherwise.
pub fn few(variants: Vec<Subject>, index: usize) -> Vec<Subject> {
    let kept = index * (SEEDS.len() + 2) % variants.len().max(1);
    let keep = |(at, subject): &(usize, Subject)| {
        if subject.mistakes.is_empty() { *at == kept } else { at.is_multiple_of(2) }
    };
    variants.into_iter().enumerate().filter(keep).map(|(_, subject)| subject).collect()
}

/// Every mistake alone.
pub fn singles(catalogue: &Catalogue) -> Vec<Subject> {
    let single = |mistake: &umbra::diagnosis::KnownMistake| Subject {
        findings: mistake.findings.clone(),
        named: mistake.is_stored(),
        class: Some(mistake.class),
        ..Subject::together(vec![mistake.name.clone()], mistake.parts.clone())
    };
    catalogue.mistakes.iter().map(single).collect()
}

/// The pairs, each with the parts of both.
///
/// # Errors
/// When the catalogue lacks a name.
pub fn pairs(catalogue: &Catalogue) -> Result<Vec<Subject>> {
    let pair = |names: &[&str; 2]| {
        let (mut parts, mut findings) = (Vec::new(), Vec::new());
        // A right variant stays right beside a mistake.
        let is_right = |name: &str| catalogue.right.iter().any(|right| right.name == name);
        for name in names.iter().filter(|name| **name != ELSEWHERE && !is_right(name)) {
            let mistake = catalogue.named(name);
            let mistake = mistake.with_context(|| format!("there is no mistake {name}"))?;
            parts.extend(mistake.parts.iter().cloned());
            findings.extend(mistake.findings.iter().cloned());
        }
        parts.sort();
        parts.dedup();
        let names = names.map(str::to_owned).to_vec();
        Ok(Subject { findings, named: true, seed: SEEDS[1], ..Subject::together(names, parts) })
    };
    PAIRS.iter().map(pair).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_mistake_is_seen_on_the_paths_of_its_parts() {
        let subjects = singles(&Catalogue::known().unwrap());
        let count = |paths: &[RenderPath]| {
            subjects.iter().filter(|subject| subject.paths() == paths).count()
        };
        let [offline, realtime] = RenderPath::ALL.map(|path| count(&[path]));
        assert!(offline >= 40 && realtime >= 40, "{offline} {realtime}");
        assert_eq!(offline + realtime + count(&RenderPath::ALL), subjects.len());
        for pair in pairs(&Catalogue::known().unwrap()).unwrap() {
            assert!(!pair.paths().is_empty(), "{}", pair.name());
        }
    }

    #[test]
    fn few_variants_are_unlike_each_other() {
        let catalogue = Catalogue::known().unwrap();
        let few = SPP.iter().enumerate();
        let few = few.map(|(index, &spp)| super::few(variants(&catalogue, spp), index));
        let few: Vec<Subject> = few.flatten().collect();
        let plain = few.iter().filter(|subject| subject.mistakes.is_empty());
        let kinds: BTreeSet<_> = plain.clone().map(|subject| (subject.seed, subject.spp)).collect();
        assert_eq!((plain.count(), kinds.len()), (SPP.len() - 1, SPP.len() - 1));
        let threads: BTreeSet<_> = few.iter().map(|subject| subject.threads).collect();
        assert_eq!(threads, BTreeSet::from(THREADS));
        let harmless: Vec<Subject> = variants(&catalogue, None);
        assert_eq!(few.len(), harmless.len().div_ceil(2) + SPP.len() - 1);
        assert!(harmless.iter().all(|subject| subject.paths().len() == 1));
        let all = SPP.iter().map(|&spp| variants(&catalogue, spp).len()).sum::<usize>();
        assert!(all >= 100, "{all}");
    }
}
