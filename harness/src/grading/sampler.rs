//! Findings about the sampler: they cost nothing by themselves, but a student wants to know.

use std::path::Path;

use basecode::scene::SceneConfig;

use super::ask::Asker;
use crate::evidence::{Check, Verdict};
use crate::worker::{Outcome, Request};

/// Renders the scene of vertical stripes with one and several threads, one seed and two, and looks
/// at what may differ and what may not.
pub fn judge(asker: &Asker, plugin: &Path, scene: &Path) -> anyhow::Result<Vec<Check>> {
    let config = SceneConfig::load(scene)?;
    let (width, height) = (config.width as u32, config.height as u32);
    let render = |seed, threads| Request::RenderOffline {
        scene: asker.scene(scene),
        width,
        height,
        spp: 4,
        seed,
        threads,
        shadows: true,
    };
    let outcomes =
        asker.ask(Some(plugin), vec![render(7, 1), render(7, 4), render(7, 4), render(1_000_007, 1)]);
    let images: Vec<&[f32]> = outcomes
        .iter()
        .filter_map(Outcome::answer)
        .map(|answer| answer.values.as_slice())
        .collect();
    let &[one, four, again, other] = images.as_slice() else { return Ok(Vec::new()) };
    let check = |id: &str, good: bool, said: &str, hint: &str| {
        let verdict = if good { Verdict::Pass } else { Verdict::Fail };
        Check::new(id, "", verdict, said).with_hint(if good { "" } else { hint })
    };
    let bits = |image: &[f32]| image.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let same = bits(one) == bits(four) && bits(four) == bits(again);
    let row = |y: u32| &one[(3 * width * y) as usize..(3 * width * (y + 1)) as usize];
    let repeated = (1..height).filter(|&y| row(y) == row(y - 1)).count();
    Ok(vec![
        check(
            "sampler.threads",
            same,
            if same { "the image does not depend on the number of threads" } else { "the same seed gives another image with several threads" },
            "threads share a sampler: give every row one of its own",
        ),
        check(
            "sampler.rows",
            (repeated as u32) < height / 2,
            &format!("{repeated} of {} rows repeat the one above", height - 1),
            "every row starts with the same seed: offset it by the row",
        ),
        check(
            "sampler.seed",
            bits(one) != bits(other),
            if bits(one) == bits(other) { "two seeds give the same image" } else { "two seeds give two images" },
            "seed the samplers with the job's seed, the student id",
        ),
    ])
}
