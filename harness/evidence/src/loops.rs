//! Part 1.3: the render loop, judged apart from shading. A render must equal what the renderer's own integrator answers
//! along rays that the host chooses, right or wrong.

use super::film_slips::film_price;
use super::price::{Price, PriceClass};
use super::rays::{RELATIVE, STRAY_FRACTION};
use super::{Check, CheckId, Measure, RuleId, Verdict};
use imaging::reference::RegionMask;

/// Part 1.3: whether the full render agrees with the renderer's own radiance along the same pixel
/// centers; what differs is the loop's, the film's or the camera's fault.
///
/// `image` is a render at 1 spp, `rays` the renderer's radiance along the pixels' center rays, both
/// row by row; `mask` tells where an edge forgives.
pub fn judge_agreement(
    scene: &str,
    mask: &RegionMask,
    image: &[[f32; 3]],
    rays: &[[f32; 3]],
) -> Check {
    let id = CheckId::LoopAgreement;
    let largest = rays.iter().flatten().filter(|v| v.is_finite()).fold(0.0f32, |m, &v| m.max(v));
    if largest == 0.0 {
        let summary = "radiance along rays is black: there is nothing to agree with";
        return Check::new(id, scene, Verdict::NotJudged, summary);
    }
    let (mut wrong, mut counted, mut apart, mut total) = (0usize, 0usize, 0.0, 0.0);
    let mut first = None;
    for (index, ((a, b), &value)) in image.iter().zip(rays).zip(&mask.pixels).enumerate() {
        if value & RegionMask::EDGE != 0 {
            continue;
        }
        counted += 1;
        let mut differs = false;
        for c in 0..3 {
            let (a, b) = (f64::from(a[c]), f64::from(b[c]));
            let difference = match (a.is_finite(), b.is_finite()) {
                (true, true) => (a - b).abs(),
                (false, false) => 0.0,
                _ => f64::from(largest),
            };
            differs |= difference > RELATIVE * b.abs() + 1e-5 * f64::from(largest);
            apart += difference;
            total += if b.is_finite() { b.abs() } else { 0.0 };
        }
        if differs {
            wrong += 1;
            first = first.or(Some(index));
        }
    }
    let fraction = wrong as f64 / counted.max(1) as f64;
    let measure = Measure::at_most(
        RuleId::LoopAgreement,
        "pixels that differ (fraction)",
        fraction,
        STRAY_FRACTION,
    );
    let failed = !measure.passed;
    let mut measures = vec![measure];
    let mut check = match first.filter(|_| failed) {
        None => {
            let summary =
                format!("the image is what the integrator answers at {counted} pixel centers");
            Check::new(id, scene, Verdict::Pass, summary)
        }
        Some(index) => {
            let summary = format!(
                "{wrong} of {counted} pixels of a 1 spp render are not what the integrator answers along their \
                 center rays; first at ({}, {})",
                index % mask.width,
                index / mask.width
            );
            let hint = "look at the render loop, the film and the camera ray, not at the shading";
            let size = (mask.width, mask.height);
            let inside = |index: usize| mask.pixels[index] & RegionMask::EDGE == 0;
            let room = |index: usize| inside(index).then_some(0.0);
            let price = film_price(size, image, rays, &room, apart / total);
            measures.extend(price.measure());
            Check {
                error: price.error,
                mistake: price.name(),
                ..Check::new(id, scene, Verdict::Fail, summary)
            }
            .with_hint(hint)
        }
    };
    check.measures = measures;
    check
}

/// The price of a failed check that passes where the directions of rays are not normalized: `along` is what the
/// integrator answers along such rays, one way or another, and `judge` says whether the image is made of that.
pub fn priced_by_length(
    check: Check,
    image: &[[f32; 3]],
    mut along: impl Iterator<Item = Vec<[f32; 3]>>,
    judge: &dyn Fn(&[[f32; 3]]) -> Check,
) -> Check {
    if check.verdict != Verdict::Fail || check.error <= PriceClass::Slip.price() {
        return check;
    }
    // Where rays are no numbers they are not compared.
    let is_finite = |values: &[[f32; 3]]| values.iter().flatten().all(|value| value.is_finite());
    let agrees = |rays: Vec<[f32; 3]>| {
        (is_finite(&rays) || !is_finite(image)) && judge(&rays).verdict == Verdict::Pass
    };
    match along.any(agrees) {
        true => check.priced(|raw| {
            let name = "the directions of camera rays are not normalized";
            Price { error: PriceClass::Slip.price(), mistake: Some(name), ..Price::of_raw(raw) }
        }),
        false => check,
    }
}

/// Width of the film on which several samples a pixel are judged: odd, so that a loop that takes several pixels at once
/// shows what it makes of the rest of a row. On most films its height is odd too.
pub const SAMPLED_WIDTH: u32 = 63;
/// Samples per pixel that the renderer takes there: a square.
pub const SAMPLES: u32 = 16;
/// Rays per pixel that it is asked: one set to find edges by, one to judge by. Found and judged by
/// the same rays, an edge would be one where they happen to be off.
pub const RAYS: u32 = 2 * SAMPLES;

/// A film small enough to ask for every pixel's radiance along many rays.
#[derive(Clone, Debug, Default)]
pub struct SampledFilm {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Where in its pixel each ray goes through, [0, 1) from left and top; [`RAYS`] a pixel.
    pub offsets: Vec<[f32; 2]>,
}

impl SampledFilm {
    /// Offsets in strata, from a fixed seed.
    pub fn new(width: u32, height: u32) -> Self {
        let sampler = basecode::Sampler::new(0x5A3D);
        let side = SAMPLES.isqrt();
        let mut offsets = Vec::new();
        for _ in 0..width * height {
            for cell in (0..RAYS).map(|ray| ray % SAMPLES) {
                let at = |cell: u32, random: f32| (cell as f32 + random) / side as f32;
                offsets
                    .push([at(cell % side, sampler.next_1d()), at(cell / side, sampler.next_1d())]);
            }
        }
        Self { width, height, offsets }
    }
}

/// One pixel of a sampled film, as its own rays have it.
#[derive(Clone, Copy, Default)]
struct Pixel {
    /// Mean of the rays that judge, summed over channels.
    mean: f64,
    /// Variance of one ray.
    variance: f64,
    /// Largest less smallest value where an edge runs through the pixel, at least a tenth of it on
    /// either side; elsewhere 0.
    range: f64,
    /// Slope across the pixel, in x and in y.
    slope: [f64; 2],
    /// By how much the mean of the rays near the center column, and of those near the center row, is larger than that
    /// of all. Other rays than those that judge.
    line: [f64; 2],
}

impl Pixel {
    /// `None` if a ray is NaN.
    fn of(values: &[[f32; 3]], offsets: &[[f32; 2]]) -> Option<Self> {
        let sum = |value: &[f32; 3]| value.iter().map(|&v| f64::from(v)).sum::<f64>();
        let sums: Vec<f64> = values.iter().map(sum).collect();
        let (sums, judging) = sums.split_at(SAMPLES as usize);
        let n = f64::from(SAMPLES);
        let (mean, judged) = (sums.iter().sum::<f64>() / n, judging.iter().sum::<f64>() / n);
        let variance = sums.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0);
        let largest = sums.iter().copied().fold(f64::MIN, f64::max);
        let smallest = sums.iter().copied().fold(f64::MAX, f64::min);
        let slope = [0, 1].map(|axis| {
            let pairs = sums.iter().zip(offsets);
            pairs.map(|(v, offset)| (v - mean) * (f64::from(offset[axis]) - 0.5)).sum::<f64>()
        });
        let line = [0, 1].map(|axis| {
            let near = |offset: &[f32; 2]| (offset[axis] - 0.5).abs() < 0.25;
            let own = sums.iter().zip(offsets).filter(|(_, offset)| near(offset));
            // Half of the strata lie there.
            own.map(|(v, _)| v).sum::<f64>() / (0.5 * n) - mean
        });
        // The larger of both sets': a small one makes much of little.
        let other = judging.iter().map(|v| (v - judged) * (v - judged)).sum::<f64>() / (n - 1.0);
        let found = variance > EDGE_VARIANCE * (largest - smallest).powi(2);
        let range = if found { largest - smallest } else { 0.0 };
        let pixel = Self { mean: judged, variance: variance.max(other), range, slope, line };
        (mean + judged).is_finite().then_some(pixel)
    }

    fn is_edge(&self, typical: f64) -> bool {
        self.range > 0.2 * typical
    }

    /// In which of [`DIRECTIONS`] an edge's brightness rises or falls most.
    fn direction(&self) -> usize {
        let [x, y] = self.slope;
        let turns = y.atan2(x) / std::f64::consts::PI;
        (turns * DIRECTIONS as f64).round().rem_euclid(DIRECTIONS as f64) as usize
    }

    /// The axis that an edge lies across, if it lies aslant. Along one that is parallel to the rows of pixels all
    /// pixels are alike: a right grid may be off there as samples of one row are.
    fn across(&self) -> Option<usize> {
        let [x, y] = self.slope.map(f64::abs);
        (x.min(y) > ASLANT * x.max(y)).then_some(usize::from(y > x))
    }
}

/// Edges are told apart by direction, half a turn in so many steps: where both axes have the same
/// number, all samples lie on one side of the edges of one direction.
const DIRECTIONS: usize = 8;
/// Variance over squared range, at least, where an edge leaves a tenth of the pixel on either side.
const EDGE_VARIANCE: f64 = 0.1;
/// A pixel is off from this many standard errors on.
const Z_LIMIT: f64 = 4.0;
/// Fraction of pixels that may be off: a variance from 16 rays is not well known.
const OFF_FRACTION: f64 = 0.01;
/// Number of further pixels that may be off, on any film.
const SPARE_PIXELS: f64 = 4.0;
/// Mean square of z, by the largest variance around, on edges of one direction: 0.4 for independent samples and rays in
/// strata, less where the samples are spread better; 4 where all samples of a pixel are the same.
const EDGE_RATIO: f64 = 1.1;
/// Slope along an edge over that across it, at least, where the pixels along it differ.
const ASLANT: f64 = 0.25;
/// Error on edges over that of samples on a pixel's center column or row alone, at most, and in standard deviations.
/// It is about 0 for samples that spread along both axes, 1 for those on one line.
const LINE_SHARE: (f64, f64) = (0.4, 6.0);
/// One standard deviation of that share, at most, that a verdict needs.
const LINE_DEVIATION: f64 = 0.13;
/// Sum of z on all edges over its standard deviation: under 4 for a right renderer, for points of a
/// Sobol sequence too, whose mean is half a stratum off; 17 where black samples are not counted.
const EDGE_BIAS: f64 = 8.0;
/// A pixel is stray that is off by more than this, relative, where nothing around differs by more than
/// [`CALM`]: one that is never written, or written over. Two of its 16 samples may meet what no ray met.
const STRAY: f64 = 0.15;
/// Standard error of a pixel, at most, where all around is smooth, relative to its mean.
const CALM: f64 = 0.01;
/// Least number of pixels on edges that a verdict needs.
const LEAST_EDGES: usize = 40;

/// Judges a render of `film` at [`SAMPLES`] samples per pixel against the radiance that the renderer
/// answers along the film's rays: average, count and spread of the samples, and what lies behind all
/// surfaces. Random, stratified, Sobol, lattice and grid samples are all right.
pub fn judge_samples(
    scene: &str,
    film: &SampledFilm,
    image: &[[f32; 3]],
    rays: &[[f32; 3]],
) -> (Check, Edges) {
    let id = CheckId::LoopSamples;
    let per = RAYS as usize;
    let (width, height) = (film.width as usize, film.height as usize);
    let own: Vec<Option<Pixel>> = rays
        .chunks(per)
        .zip(film.offsets.chunks(per))
        .map(|(values, offsets)| Pixel::of(values, offsets))
        .collect();
    let mut means: Vec<f64> = own.iter().flatten().map(|p| p.mean).filter(|m| *m > 0.0).collect();
    means.sort_by(f64::total_cmp);
    let Some(&typical) = means.get(means.len() / 2) else {
        let summary = "radiance along rays is black: there is nothing to agree with";
        return (Check::new(id, scene, Verdict::NotJudged, summary), Edges::default());
    };
    // Both the image's samples and the rays scatter.
    let both = 2.0 / f64::from(SAMPLES);
    let sum = |value: &[f32; 3]| value.iter().map(|&v| f64::from(v)).sum::<f64>();
    let near = |index: usize| {
        let (x, y) = (index % width, index / width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |y| {
            (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x)
        })
    };
    let around =
        |index: usize| near(index).filter_map(|i| own[i]).map(|p| p.variance).fold(0.0, f64::max);
    let (mut counted, mut off, mut inside) = (0usize, 0usize, 0usize);
    let mut stray = Vec::new();
    let (mut apart, mut total) = (0.0, 0.0);
    let mut first = None;
    let mut edges = Edges::default();
    let (mut bias, mut edge_count) = (0.0, 0usize);
    for (index, pixel) in own.iter().enumerate() {
        // Beside rays that are not a number, a sample may be none either.
        let Some(pixel) = pixel.filter(|_| near(index).all(|i| own[i].is_some())) else { continue };
        let found = sum(&image[index]);
        counted += 1;
        let difference = if found.is_finite() { found - pixel.mean } else { typical };
        let error = (around(index) * both).sqrt();
        let room = Z_LIMIT * error + RELATIVE * pixel.mean.abs() + 1e-3 * typical;
        apart += difference.abs();
        total += pixel.mean.abs();
        if !found.is_finite() || difference.abs() > room {
            off += 1;
            // Where all is black no shading is computed that could be no number.
            let is_black = pixel.mean == 0.0 && error == 0.0;
            let calm = error < CALM * pixel.mean.abs() || (is_black && !found.is_finite());
            if calm && difference.abs() > STRAY * pixel.mean.abs() {
                stray.push((index, found, pixel.mean));
            }
            inside += usize::from(!near(index).any(|i| own[i].is_some_and(|p| p.is_edge(typical))));
            first = first.or(Some((index, found, pixel.mean)));
        }
        let z = difference / error;
        // One that is off counts above: a glint that no ray met is no edge.
        if pixel.is_edge(typical) && z.abs() <= Z_LIMIT {
            let (count, squares) = &mut edges.spread[pixel.direction()];
            (*count, *squares) = (*count + 1, *squares + z * z);
            if let Some(axis) = pixel.across() {
                let error = pixel.variance / f64::from(SAMPLES);
                let (products, squares) = &mut edges.lines[axis];
                *products += pixel.line[axis] * difference / error;
                *squares += pixel.line[axis] * pixel.line[axis] / error;
            }
            (bias, edge_count) = (bias + z, edge_count + 1);
        }
    }
    if counted == 0 {
        let summary =
            "radiance along rays is not a number nearly everywhere: there is nothing to agree with";
        return (Check::new(id, scene, Verdict::NotJudged, summary), Edges::default());
    }
    let off_fraction = off as f64 / counted as f64;
    let worst = edges.worst();
    let bias = if edge_count < LEAST_EDGES { 0.0 } else { bias.abs() / (edge_count as f64).sqrt() };
    let mut measures = vec![
        Measure::at_most(
            RuleId::LoopPixels,
            "pixels that are not the average of the integrator's answers (fraction)",
            off_fraction,
            OFF_FRACTION + SPARE_PIXELS / counted as f64,
        ),
        Measure::at_most(
            RuleId::LoopEdges,
            "mean square error on edges over that of independent samples",
            worst,
            EDGE_RATIO,
        ),
        Measure::at_most(
            RuleId::LoopEdgeBias,
            "mean error on edges, in standard deviations",
            bias,
            EDGE_BIAS,
        ),
        Measure::at_most(
            RuleId::LoopStray,
            "pixels far from what all rays around them answer",
            stray.len() as f64,
            0.0,
        ),
    ];
    let [pixels, spread] = [0, 1].map(|i| measures[i].passed);
    if measures.iter().all(|measure| measure.passed) {
        let summary = format!(
            "{SAMPLES} samples a pixel average what the integrator answers at {counted} pixels"
        );
        return (Check { measures, ..Check::new(id, scene, Verdict::Pass, summary) }, edges);
    }
    let at = |(index, found, mean): (usize, f64, f64)| {
        let (x, y, expected, found) = (index % width, index / width, mean / 3.0, found / 3.0);
        format!("first at ({x}, {y}): expected {expected:.4}, found {found:.4}")
    };
    let summary = match first.filter(|_| !pixels) {
        Some(first) => format!(
            "{off} of {counted} pixels of a render at {SAMPLES} samples a pixel are not the average of what the \
             integrator answers in them; {}",
            at(first)
        ),
        None if !stray.is_empty() => format!(
            "{} of {counted} pixels are far from what all rays in and around them answer; {}",
            stray.len(),
            at(stray[0])
        ),
        None if !spread => format!(
            "edges are {worst:.1} times as far off as {SAMPLES} independent samples a pixel would leave them"
        ),
        None => format!("edges are off in one direction, by {bias:.0} standard deviations"),
    };
    let hint = match (pixels && stray.is_empty(), spread) {
        (false, _) => {
            "look at the sum over samples, what it is divided by, and the pixel it is written to"
        }
        (true, false) => {
            "look at how many samples are taken, and whether they spread over the pixel on both axes"
        }
        (true, true) => "look at which samples are counted",
    };
    let raw = apart / f64::max(total, f64::MIN_POSITIVE);
    let mut price = Price::of_raw(raw);
    if inside as f64 <= OFF_FRACTION * counted as f64 + SPARE_PIXELS {
        // All but edges is right, or a few pixels.
        price = match stray.is_empty() {
            true => price.or("samples that do not cover their pixels", PriceClass::Slip, 0.0),
            false => Price {
                error: PriceClass::Slip.price(),
                mistake: Some("a few pixels are wrong"),
                ..price
            },
        };
    } else {
        let mean = |values: &[[f32; 3]]| {
            let judging = &values[SAMPLES as usize..];
            std::array::from_fn(|c| judging.iter().map(|v| v[c]).sum::<f32>() / SAMPLES as f32)
        };
        let means: Vec<[f32; 3]> = rays.chunks(per).map(mean).collect();
        // Where edges are, a slip that moves the image leaves more than noise.
        let room = |index: usize| {
            let noise = Z_LIMIT * (around(index) * both).sqrt() + 1e-3 * typical;
            Some(noise as f32)
        };
        price = film_price((width, height), image, &means, &room, raw);
    }
    measures.extend(price.measure());
    let check = Check::new(id, scene, Verdict::Fail, summary).with_hint(hint);
    (Check { error: price.error, mistake: price.name(), measures, ..check }, edges)
}

/// Judges the edges of all scenes together: each scene alone has few of most directions.
pub fn judge_edges(edges: &Edges) -> Check {
    let id = CheckId::LoopSamples;
    let name = "mean square error on the edges of one direction over that of independent samples";
    let spread = Measure::at_most(RuleId::LoopEdges, name, edges.worst(), EDGE_RATIO);
    let name = "error on edges over that of samples on one column or row alone (fraction)";
    let (share, bound) = edges.line_share();
    let line = Measure::at_most(RuleId::LoopEdges, name, share, bound);
    let summary = match (spread.passed, line.passed) {
        (true, true) => {
            let summary = "samples spread over their pixels in every direction";
            let measures = vec![spread, line];
            return Check { measures, ..Check::new(id, "", Verdict::Pass, summary) };
        }
        (false, _) => format!(
            "edges of one direction are {:.1} times as far off as {SAMPLES} independent samples a pixel would leave \
             them",
            spread.value
        ),
        (true, false) => {
            "edges are off as if the samples of a pixel had one place along one of its axes"
                .to_owned()
        }
    };
    let check = Check::new(id, "", Verdict::Fail, summary);
    let check = Check { error: PriceClass::Slip.price(), measures: vec![spread, line], ..check };
    check.with_hint("look at whether both axes have random numbers of their own")
}

/// How far off the pixels on edges are.
#[derive(Clone, Copy, Debug, Default)]
pub struct Edges {
    /// By direction: how many, and the sum of their squared z.
    spread: [(usize, f64); DIRECTIONS],
    /// By the axis that they lie across: what the center column or row would leave times the error, and squared, both
    /// summed over the variance of independent samples.
    lines: [(f64, f64); 2],
}

impl Edges {
    /// Adds those of another scene.
    pub fn add(&mut self, other: &Self) {
        for (own, other) in self.spread.iter_mut().zip(other.spread) {
            *own = (own.0 + other.0, own.1 + other.1);
        }
        for (own, other) in self.lines.iter_mut().zip(other.lines) {
            *own = (own.0 + other.0, own.1 + other.1);
        }
    }

    /// How much of what one column or row alone would leave is there, by least squares, and its bound; of the
    /// axis that comes closest to its own.
    fn line_share(&self) -> (f64, f64) {
        let (least, deviations) = LINE_SHARE;
        let known = |(_, squares): &&(f64, f64)| *squares > LINE_DEVIATION.powi(-2);
        let shares = self.lines.iter().filter(known).map(|(products, squares)| {
            (products / squares, f64::max(least, deviations / squares.sqrt()))
        });
        let closest = shares.max_by(|(a, of_a), (b, of_b)| (a / of_a).total_cmp(&(b / of_b)));
        closest.unwrap_or((0.0, least))
    }

    /// The largest mean of any direction, or of all, that has enough pixels.
    fn worst(&self) -> f64 {
        let all = self.spread.iter().fold((0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
        let told = self.spread.iter().chain([&all]).filter(|(count, _)| *count >= LEAST_EDGES);
        told.map(|(count, squares)| squares / *count as f64).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests;
