//! Findings about the sampler: they cost nothing by themselves, but a student wants to know.

use std::path::Path;

use basecode::scene::SceneConfig;

use super::session::Session;
use crate::evidence::{Check, CheckId, Verdict};
use crate::imaging::correlation::Moments;
use crate::worker::{Outcome, Request};

/// Rows whose noise is correlated by this much or more share their seeds: 1 when they do, 0 but for
/// chance when they do not.
pub const CORRELATED: f64 = 0.5;

/// Renders the scene of vertical stripes with one and several threads, one seed and two, and looks
/// at what may differ and what may not.
pub fn judge(session: &Session, plugin: &Path, scene: &Path) -> anyhow::Result<Vec<Check>> {
    let config = SceneConfig::load(scene)?;
    let (width, height) = (config.width as u32, config.height as u32);
    let render = |seed, threads| Request::RenderOffline {
        scene: session.scene(scene),
        width,
        height,
        spp: 4,
        seed,
        threads,
        shadows: true,
    };
    let outcomes = session
        .run(Some(plugin), vec![render(7, 1), render(7, 4), render(7, 4), render(1_000_007, 1)]);
    let images: Vec<&[f32]> = outcomes
        .iter()
        .filter_map(Outcome::answer)
        .map(|answer| answer.values.as_slice())
        .collect();
    let &[one, four, again, other] = images.as_slice() else { return Ok(Vec::new()) };
    let check = |id: CheckId, good: bool, said: &str, hint: &str| {
        let verdict = if good { Verdict::Pass } else { Verdict::Fail };
        Check::new(id, "", verdict, said).with_hint(if good { "" } else { hint })
    };
    let bits = |image: &[f32]| image.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let same = bits(one) == bits(four) && bits(four) == bits(again);
    let correlation = row_correlation(one, other, 3 * width as usize);
    let mut checks = vec![
        check(
            CheckId::SamplerThreads,
            same,
            if same {
                "the image does not depend on the number of threads"
            } else {
                "the same seed gives another image with several threads"
            },
            "threads share a sampler: give every row one of its own",
        ),
        check(
            CheckId::SamplerRows,
            correlation < CORRELATED,
            &format!("the noise of a row has a correlation of {correlation:.2} with the row above"),
            "every row starts with the same seed: offset it by the row",
        ),
        check(
            CheckId::SamplerSeed,
            bits(one) != bits(other),
            if bits(one) == bits(other) {
                "two seeds give the same image"
            } else {
                "two seeds give two images"
            },
            "seed the samplers with the job's seed, the student number",
        ),
    ];
    checks.retain(|check| {
        check.id == CheckId::SamplerThreads || shows_samples(one) || shows_samples(other)
    });
    Ok(checks)
}

/// Whether an image can tell of samples: one color, such as black, cannot.
fn shows_samples(image: &[f32]) -> bool {
    image.chunks(3).any(|pixel| pixel != &image[..3])
}

/// How alike the noise of neighboring rows is: 0 when it is independent, 1 when it is the same.
/// The difference of two images of other seeds is noise alone.
pub fn row_correlation(one: &[f32], other: &[f32], row_floats: usize) -> f64 {
    let noise: Vec<f64> = one.iter().zip(other).map(|(a, b)| f64::from(a - b)).collect();
    let next = noise.iter().skip(row_floats);
    Moments::of(noise.iter().copied().zip(next.copied())).cosine().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_color_tells_of_no_samples() {
        assert!(!shows_samples(&[0.0; 12]) && !shows_samples(&[]));
        assert!(!shows_samples(&[0.1, 0.2, 0.3, 0.1, 0.2, 0.3]));
        assert!(shows_samples(&[0.0, 0.0, 0.0, 0.0, 0.1, 0.0]));
    }

    #[test]
    fn rows_of_one_seed_are_told_from_rows_of_their_own() {
        let sampler = basecode::Sampler::new(1);
        let mut noise = || (0..64).map(|_| sampler.next_1d()).collect::<Vec<f32>>();
        let independent = |noise: &mut dyn FnMut() -> Vec<f32>| -> Vec<f32> {
            (0..32).flat_map(|_| noise()).collect()
        };
        let (a, b) = (independent(&mut noise), independent(&mut noise));
        assert!(row_correlation(&a, &b, 64).abs() < 0.1);
        // Rows that differ in brightness but not in noise.
        let rows = |row: &[f32]| {
            (0..32).flat_map(|y| row.iter().map(move |v| v * (1.0 + 0.01 * y as f32))).collect()
        };
        let (a, b): (Vec<f32>, Vec<f32>) = (rows(&noise()), rows(&noise()));
        assert!(row_correlation(&a, &b, 64) > 0.99);
        assert_eq!(row_correlation(&a, &a, 64), 0.0);
    }
}
