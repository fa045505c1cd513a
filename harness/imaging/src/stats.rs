//! The one pass over all pixels that every comparison makes, and the verdict on what it gathered.

use basecode::image::Image;
use glam::{DVec3, Vec3};

use super::blob;
use super::comparison::{
    ComparedWith, FailingArea, ImageEvidence, RegionBias, RuleCheck, WorstPixel,
};
use super::ratio::triple;
use super::reference::RegionMask;
use super::tolerances::Tolerances;

/// A dim lit region's bias is relative to this fraction of the median lit value at least.
const DIM: f64 = 0.01;

/// What a verdict is relative to.
pub(super) struct Scale {
    /// The median lit value of the expected image.
    pub median_lit: f32,
    /// The largest fraction of interior pixels that may fail.
    pub interior_fraction: f64,
}

/// One row as the rule of a comparison sees it.
pub(super) struct PixelRow<'a> {
    pub actual: &'a [Vec3],
    pub expected: &'a [Vec3],
    pub mask: &'a [u16],
    /// To fill in: (difference / allowed difference) squared, the worst channel; above 1 the pixel fails.
    pub excess2: &'a mut [f32],
    /// To fill in where noise is expected: the variance of the difference.
    pub variance: &'a mut [Vec3],
}

/// Pixels with a property, and where the first is.
#[derive(Default)]
struct PixelCount {
    count: u32,
    first: Option<(usize, usize)>,
}

impl PixelCount {
    fn add(&mut self, x: usize, y: usize) {
        self.count += 1;
        self.first.get_or_insert((x, y));
    }
}

#[derive(Default)]
struct Tally {
    pixels: u32,
    failing: u32,
}

impl Tally {
    fn fraction(&self) -> f64 {
        f64::from(self.failing) / f64::from(self.pixels.max(1))
    }
}

/// Sums over the interior pixels of a region.
#[derive(Clone, Default)]
pub(super) struct RegionSums {
    pixels: u32,
    non_finite: u32,
    actual: DVec3,
    expected: DVec3,
    variance: DVec3,
}

/// What one pass over all pixels gathers.
pub(super) struct ComparisonStats {
    width: usize,
    height: usize,
    non_finite: PixelCount,
    negative: PixelCount,
    interior: Tally,
    edge: Tally,
    /// Two for each region of the mask: without and with highlight.
    pub regions: Vec<RegionSums>,
    /// Failing interior pixels.
    failing: Vec<bool>,
    worst: Option<WorstPixel>,
    /// Sums of the squared difference, and of the value that noise predicts for it.
    noise: (f64, f64),
}

/// Applies `rule` row by row and gathers everything that the verdict needs; what each pixel's difference is over the
/// allowed one goes to `excess`, if somebody wants it.
pub(super) fn accumulate(
    actual: &Image,
    expected: &Image,
    mask: &RegionMask,
    tolerances: &Tolerances,
    mut excess: Option<&mut Vec<f32>>,
    mut rule: impl FnMut(usize, &mut PixelRow<'_>),
) -> ComparisonStats {
    let (width, height) = (expected.width, expected.height);
    let negative_limit = -tolerances.negative_limit as f32;
    let mut stats = ComparisonStats {
        width,
        height,
        non_finite: PixelCount::default(),
        negative: PixelCount::default(),
        interior: Tally::default(),
        edge: Tally::default(),
        regions: vec![RegionSums::default(); 2 * mask.regions.len()],
        failing: vec![false; width * height],
        worst: None,
        noise: (0.0, 0.0),
    };
    let mut excess2 = vec![0.0f32; width];
    let mut variance = vec![Vec3::ZERO; width];
    let mut worst2 = 0.0f32;
    for y in 0..height {
        let start = y * width;
        let mut row = PixelRow {
            actual: &actual.pixels[start..start + width],
            expected: &expected.pixels[start..start + width],
            mask: &mask.pixels[start..start + width],
            excess2: &mut excess2,
            variance: &mut variance,
        };
        rule(y, &mut row);
        if let Some(excess) = &mut excess {
            excess.extend(row.excess2.iter().map(|excess2| excess2.sqrt()));
        }
        for x in 0..width {
            let flags = row.mask[x];
            if flags & RegionMask::EMITTER != 0 {
                continue;
            }
            let (a, b) = (row.actual[x], row.expected[x]);
            let finite = a.is_finite();
            if !finite {
                stats.non_finite.add(x, y);
            } else if a.min_element() < negative_limit {
                stats.negative.add(x, y);
            }
            // Written so that a NaN fails.
            let within = finite && row.excess2[x] <= 1.0;
            if finite {
                let d = a - b;
                stats.noise.0 += f64::from((d * d).element_sum());
                stats.noise.1 += f64::from(row.variance[x].element_sum());
            }
            if flags & RegionMask::EDGE != 0 {
                stats.edge.pixels += 1;
                stats.edge.failing += u32::from(!within);
                continue;
            }
            stats.interior.pixels += 1;
            stats.interior.failing += u32::from(!within);
            stats.failing[start + x] = !within;
            let e2 = if finite { row.excess2[x] } else { f32::INFINITY };
            if e2 > worst2 {
                worst2 = e2;
                stats.worst = Some(WorstPixel {
                    x,
                    y,
                    actual: a.to_array(),
                    expected: b.to_array(),
                    excess: presentable(f64::from(e2).sqrt()),
                });
            }
            let highlight = usize::from(flags & RegionMask::HIGHLIGHT != 0);
            let sums = &mut stats.regions[2 * usize::from(flags & RegionMask::INDEX) + highlight];
            sums.pixels += 1;
            if finite {
                sums.actual += a.as_dvec3();
                sums.expected += b.as_dvec3();
                sums.variance += row.variance[x].as_dvec3();
            } else {
                sums.non_finite += 1;
            }
        }
    }
    stats
}

/// JSON has no infinity: what cannot be measured is the largest number.
fn presentable(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::MAX.copysign(value) }
}

impl ComparisonStats {
    /// Every check with its verdict.
    pub fn judge(
        self,
        mask: &RegionMask,
        compared_with: ComparedWith,
        scale: &Scale,
        tolerances: &Tolerances,
    ) -> ImageEvidence {
        let spots = |id: &str, spots: &PixelCount, what: &str| RuleCheck {
            id: id.into(),
            value: f64::from(spots.count),
            bound: 0.0,
            passed: spots.count == 0,
            detail: match spots.first {
                None => format!("no pixel is {what}"),
                Some((x, y)) if spots.count == 1 => {
                    format!("1 pixel is {what}; first at ({x}, {y})")
                }
                Some((x, y)) => format!("{} pixels are {what}; first at ({x}, {y})", spots.count),
            },
        };
        let largest_failing = blob::largest_area(&self.failing, self.width);
        let mut checks = vec![
            spots("non_finite", &self.non_finite, "not finite"),
            spots("negative", &self.negative, "negative"),
            self.interior_check(scale, tolerances),
            self.blob_check(&largest_failing),
            self.edge_check(tolerances),
        ];
        let mut regions = Vec::new();
        for (i, sums) in self.regions.iter().enumerate().filter(|(_, sums)| sums.pixels > 0) {
            let region = &mask.regions[i / 2];
            let (check, bias) = sums.judge(&region.name, i % 2 == 1, region.lit, scale, tolerances);
            checks.push(check);
            regions.push(bias);
        }
        let (found, predicted) = self.noise;
        ImageEvidence {
            width: self.width,
            height: self.height,
            compared_with,
            checks,
            regions,
            largest_failing,
            worst: self.worst,
            noise_ratio: (predicted > 0.0).then(|| presentable((found / predicted).sqrt())),
        }
    }

    fn interior_check(&self, scale: &Scale, tolerances: &Tolerances) -> RuleCheck {
        let Tally { pixels, failing } = self.interior;
        let few = f64::from(tolerances.spare_pixels) / f64::from(pixels.max(1));
        let bound = scale.interior_fraction + few;
        let worst = match &self.worst {
            Some(w) if failing > 0 => format!(
                "; worst at ({}, {}): {}, expected {}",
                w.x,
                w.y,
                triple(w.actual),
                triple(w.expected)
            ),
            _ => String::new(),
        };
        RuleCheck {
            id: "interior".into(),
            value: self.interior.fraction(),
            bound,
            // Without an interior there is nothing that could have been right.
            passed: pixels > 0 && self.interior.fraction() <= bound,
            detail: format!("{failing} of {pixels} pixels away from edges differ{worst}"),
        }
    }

    fn blob_check(&self, largest: &Option<FailingArea>) -> RuleCheck {
        let blocks = blob::solid_blocks(&self.failing, self.width);
        RuleCheck {
            id: "blob".into(),
            value: blocks as f64,
            bound: 0.0,
            passed: blocks == 0,
            detail: match largest {
                Some(a) if blocks > 0 => format!(
                    "{} of 2x2 differing pixels; the largest area has {} pixels, in columns {} to {} and rows {} to {}",
                    if blocks == 1 { "1 block".into() } else { format!("{blocks} blocks") },
                    a.pixels,
                    a.x,
                    a.x + a.width - 1,
                    a.y,
                    a.y + a.height - 1
                ),
                _ => "no 2x2 block of differing pixels away from edges".into(),
            },
        }
    }

    fn edge_check(&self, tolerances: &Tolerances) -> RuleCheck {
        let Tally { pixels, failing } = self.edge;
        let few = f64::from(tolerances.spare_pixels) / f64::from(pixels.max(1));
        let bound = tolerances.edge_fraction + few;
        RuleCheck {
            id: "edge".into(),
            value: self.edge.fraction(),
            bound,
            passed: self.edge.fraction() <= bound,
            detail: format!("{failing} of {pixels} pixels on edges differ"),
        }
    }
}

impl RegionSums {
    /// Signed bias per channel; the channel that is worst against its bound speaks for the region.
    fn judge(
        &self,
        region: &str,
        highlight: bool,
        lit: bool,
        scale: &Scale,
        tolerances: &Tolerances,
    ) -> (RuleCheck, RegionBias) {
        let median = f64::from(scale.median_lit);
        let finite = f64::from((self.pixels - self.non_finite).max(1));
        let (actual, expected) = (self.actual / finite, self.expected / finite);
        let standard_error = self.variance.max(DVec3::ZERO).map(f64::sqrt) / finite;
        let (mut bias, mut bound, mut worst) = (0.0, tolerances.bias_relative, -1.0);
        for c in 0..3 {
            // What should be black has no scale of its own.
            let unit = if lit { expected[c].max(DIM * median) } else { median };
            let b = (actual[c] - expected[c]) / unit;
            let limit = tolerances
                .bias_relative
                .max(tolerances.bias_standard_errors * standard_error[c] / unit);
            if b.abs() / limit > worst {
                (bias, bound, worst) = (b, limit, b.abs() / limit);
            }
        }
        let name = if highlight { format!("{region}, highlight") } else { region.to_owned() };
        let judged = self.pixels >= tolerances.min_region_pixels;
        let unit = if lit { "than expected" } else { "than expected, in median lit values" };
        let side = if bias < 0.0 { "darker" } else { "brighter" };
        let detail = match (self.non_finite, judged) {
            (0, true) => format!(
                "{name}: {:.3} % {side} {unit} (bound {:.3} %), {} pixels",
                100.0 * bias.abs(),
                100.0 * bound,
                self.pixels
            ),
            (0, false) => {
                format!("{name}: {} pixels are too few for a mean; judged one by one", self.pixels)
            }
            (n, _) if n == self.pixels => format!("{name}: no pixel of {n} is finite"),
            (n, _) => format!(
                "{name}: {n} of {} pixels are not finite, the others {:.3} % {side} {unit} (bound {:.3} %)",
                self.pixels,
                100.0 * bias.abs(),
                100.0 * bound
            ),
        };
        let check = RuleCheck {
            id: format!("bias: {name}"),
            value: if self.non_finite == self.pixels { f64::MAX } else { presentable(bias) },
            bound: presentable(bound),
            // A few that are not finite have a rule of their own.
            passed: self.non_finite < self.pixels && (!judged || bias.abs() <= bound),
            detail,
        };
        let found = RegionBias {
            region: region.to_owned(),
            highlight,
            pixels: self.pixels,
            actual: actual.to_array().map(presentable),
            expected: expected.to_array(),
            bias: check.value,
            bound: check.bound,
        };
        (check, found)
    }
}
