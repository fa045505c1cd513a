//! FLIP, the perceived difference of two images that are flipped between, 0 (none) to 1.
//!
//! LDR-FLIP: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images", HPG 2020. HDR-FLIP: Andersson, Nilsson, Shirley, Akenine-Moller, "Visualizing Errors in
//! Rendered High Dynamic Range Images", EG 2021: the largest LDR-FLIP over a range of exposures. Constants are the
//! papers'. FLIP informs readers of a report and decides nothing.

use basecode::image::Image;
use glam::{Mat3, Vec3, vec3};
use rayon::prelude::*;

/// Pixels per degree of the papers' viewer: 0.7 m from a display 0.7 m and 3840 pixels wide.
pub const PIXELS_PER_DEGREE: f32 = 67.020_64;

/// XYZ of the white point D65.
const WHITE: Vec3 = vec3(0.950_428_55, 1.0, 1.088_900_4);

/// The error of every pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct FlipMap {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Row by row, 0 to 1.
    pub errors: Vec<f32>,
}

impl FlipMap {
    /// The mean error, FLIP's single number; 0 for an empty image.
    pub fn mean(&self) -> f64 {
        let sum: f64 = self.errors.iter().map(|&e| f64::from(e)).sum();
        sum / self.errors.len().max(1) as f64
    }
}

/// LDR-FLIP of two linear images as a display shows them: clamped to [0, 1].
///
/// `None` when the sizes differ or a value is not a number.
pub fn flip_ldr(actual: &Image, expected: &Image, pixels_per_degree: f32) -> Option<FlipMap> {
    check(actual, expected)?;
    let shown = |image: &Image| opponent(image, |p| p.clamp(Vec3::ZERO, Vec3::ONE));
    let filters = Filters::new(pixels_per_degree);
    Some(filters.difference(&shown(actual), &shown(expected), expected))
}

/// HDR-FLIP with the ACES tone mapper and the exposures that the papers derive from the expected image. Negative values
/// count as 0, as no display shows them.
///
/// `None` when the sizes differ, a value is not a number, or the expected image is black.
pub fn flip_hdr(actual: &Image, expected: &Image, pixels_per_degree: f32) -> Option<FlipMap> {
    check(actual, expected)?;
    let (start, stop) = exposure_range(expected)?;
    let count = ((stop - start).ceil() as usize).max(2);
    let filters = Filters::new(pixels_per_degree);
    let mut worst: Option<FlipMap> = None;
    for i in 0..count {
        let gain = (start + (stop - start) * i as f32 / (count - 1) as f32).exp2();
        let shown = |image: &Image| opponent(image, |p| aces(gain * p.max(Vec3::ZERO)));
        let map = filters.difference(&shown(actual), &shown(expected), expected);
        match &mut worst {
            None => worst = Some(map),
            Some(worst) => {
                for (w, e) in worst.errors.iter_mut().zip(map.errors) {
                    *w = w.max(e);
                }
            }
        }
    }
    worst
}

fn check(actual: &Image, expected: &Image) -> Option<()> {
    let same = (actual.width, actual.height) == (expected.width, expected.height);
    let numbers = |image: &Image| image.pixels.iter().all(|p| p.is_finite());
    (same && !expected.pixels.is_empty() && numbers(actual) && numbers(expected)).then_some(())
}

/// Coefficients of Narkowicz' fit to the ACES curve, (a x + b) x / ((c x + d) x + e), with its 0.6 pre-exposure.
const ACES: [f32; 5] = [0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14];

fn aces(x: Vec3) -> Vec3 {
    let [a, b, c, d, e] = ACES;
    // Beyond this the curve is past 1, and squares would overflow.
    let x = x.min(Vec3::splat(1e6));
    (x * (a * x + b) / (x * (c * x + d) + e)).min(Vec3::ONE)
}

/// First and last exposure in stops: the brightest luminance, then the median, comes to 0.85 on the display.
fn exposure_range(expected: &Image) -> Option<(f32, f32)> {
    let [a, b, c, d, e] = ACES;
    let t = 0.85;
    // aces(x) = t solved for x.
    let (p, q) = ((b - d * t) / (a - c * t), -e * t / (a - c * t));
    let x = -0.5 * p + (0.25 * p * p - q).sqrt();
    let weights = vec3(0.2126, 0.7152, 0.0722);
    let mut luminance: Vec<f32> = expected.pixels.iter().map(|l| l.dot(weights)).collect();
    let middle = luminance.len() / 2;
    let (_, median, above) = luminance.select_nth_unstable_by(middle, f32::total_cmp);
    let brightest = above.iter().fold(*median, |m, l| m.max(*l));
    // The published tool keeps a median of 0 away from the logarithm in the same way.
    let median = median.max(f32::EPSILON);
    (brightest > 0.0)
        .then(|| ((x / brightest).log2(), (x / median).log2()))
        .filter(|(start, stop)| start <= stop)
}

/// Linear Rec. 709 to XYZ, from the primaries' chromaticities; the columns are R, G, B.
fn to_xyz() -> Mat3 {
    let n = 73_733_382.0f64;
    let column = |x: f64, y: f64, z: f64| vec3((x / n) as f32, (y / n) as f32, (z / n) as f32);
    Mat3::from_cols(
        column(30_406_656.0, 15_678_432.0, 1_425_312.0),
        column(26_366_430.0, 52_732_860.0, 8_788_810.0),
        column(13_305_225.0, 5_322_090.0, 70_074_185.0),
    )
}

/// Linearized CIELAB, the papers' YCxCz, of a tone-mapped image.
fn opponent(image: &Image, tone: impl Fn(Vec3) -> Vec3 + Sync) -> [Vec<f32>; 3] {
    let matrix = to_xyz();
    let colors: Vec<Vec3> = image
        .pixels
        .par_iter()
        .map(|&p| {
            let xyz = matrix * tone(p) / WHITE;
            vec3(116.0 * xyz.y - 16.0, 500.0 * (xyz.x - xyz.y), 200.0 * (xyz.y - xyz.z))
        })
        .collect();
    [0, 1, 2].map(|c| colors.iter().map(|p| p[c]).collect())
}

/// CIELAB with Hunt's adjustment: colors count for less where it is dark.
fn hunt_lab(xyz: Vec3) -> Vec3 {
    const DELTA: f32 = 6.0 / 29.0;
    let f = (xyz / WHITE)
        .map(|t| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 });
    let l = 116.0 * f.y - 16.0;
    vec3(l, 0.01 * l * 500.0 * (f.x - f.y), 0.01 * l * 200.0 * (f.y - f.z))
}

/// HyAB, the distance for large differences of color: city block in lightness, Euclidean in the rest.
fn hyab(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}

/// The filters for one viewing distance, all separable.
struct Filters {
    /// Contrast sensitivity of Y, Cx, Cz: for each the Gaussians it is the sum of, the weight folded into the second.
    color: [Vec<[Vec<f32>; 2]>; 3],
    /// The edge detector's profile: smoothing, first and second derivative.
    smooth: Vec<f32>,
    first: Vec<f32>,
    second: Vec<f32>,
}

/// Weights at -radius..=radius.
fn profile(radius: i32, weight: impl Fn(f32) -> f32) -> Vec<f32> {
    (-radius..=radius).map(|x| weight(x as f32)).collect()
}

/// Scales the positive weights to a sum of 1 and the negative ones to -1.
fn normalized(weights: Vec<f32>) -> Vec<f32> {
    let positive: f32 = weights.iter().filter(|w| **w > 0.0).sum();
    let negative: f32 = -weights.iter().filter(|w| **w < 0.0).sum::<f32>();
    weights
        .into_iter()
        .map(|w| if w > 0.0 { w / positive } else { w / negative.max(f32::MIN_POSITIVE) })
        .collect()
}

impl Filters {
    fn new(pixels_per_degree: f32) -> Self {
        use std::f32::consts::PI;
        // (a, b) of a sqrt(pi / b) exp(-pi^2 z / b), z in degrees squared: table 1 of the 2020 paper.
        let table: [&[(f32, f32)]; 3] =
            [&[(1.0, 0.0047)], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]];
        // Three standard deviations of the widest of them.
        let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
        let color = table.map(|terms| {
            let mut gaussians: Vec<_> = terms
                .iter()
                .map(|&(a, b)| {
                    let g = profile(radius, |x| (-(PI * x / pixels_per_degree).powi(2) / b).exp());
                    (a * (PI / b).sqrt(), g)
                })
                .collect();
            let total: f32 = gaussians.iter().map(|(w, g)| w * g.iter().sum::<f32>().powi(2)).sum();
            gaussians
                .drain(..)
                .map(|(w, g)| {
                    let down = g.iter().map(|v| v * w / total).collect();
                    [g, down]
                })
                .collect()
        });
        // Width of the eye's edge detector: 0.082 degrees from peak to trough.
        let sigma = 0.5 * 0.082 * pixels_per_degree;
        let radius = (3.0 * sigma).ceil() as i32;
        let g = |x: f32| (-x * x / (2.0 * sigma * sigma)).exp();
        Self {
            color,
            smooth: normalized(profile(radius, g)),
            first: normalized(profile(radius, |x| -x * g(x))),
            second: normalized(profile(radius, |x| (x * x / (sigma * sigma) - 1.0) * g(x))),
        }
    }

    /// FLIP of two images in YCxCz; `like` gives the size.
    fn difference(&self, a: &[Vec<f32>; 3], b: &[Vec<f32>; 3], like: &Image) -> FlipMap {
        let width = like.width;
        let back = to_xyz().inverse();
        let (colors_a, colors_b) = (self.seen(a, width), self.seen(b, width));
        let (features_a, features_b) = (self.features(&a[0], width), self.features(&b[0], width));
        let forth = to_xyz();
        let (green, blue) = (hunt_lab(forth.y_axis), hunt_lab(forth.z_axis));
        let largest = hyab(green, blue).powf(0.7);
        // Color differences up to 0.4 of the largest take up 0.95 of the range.
        let knee = 0.4 * largest;
        let lab = |ycc: Vec3| {
            let y = (ycc.x + 16.0) / 116.0;
            let xyz = vec3(y + ycc.y / 500.0, y, y - ycc.z / 200.0) * WHITE;
            hunt_lab(forth * (back * xyz).clamp(Vec3::ZERO, Vec3::ONE))
        };
        let errors = (0..a[0].len())
            .into_par_iter()
            .map(|i| {
                let pick = |c: &[Vec<f32>; 3]| lab(vec3(c[0][i], c[1][i], c[2][i]));
                let color = hyab(pick(&colors_a), pick(&colors_b)).powf(0.7);
                let color = if color < knee {
                    0.95 * color / knee
                } else {
                    0.95 + 0.05 * (color - knee) / (largest - knee)
                };
                let apart = |k: usize| (features_a[k][i] - features_b[k][i]).abs();
                let feature = (apart(0).max(apart(1)) * std::f32::consts::FRAC_1_SQRT_2).sqrt();
                color.powf(1.0 - feature)
            })
            .collect();
        FlipMap { width, height: like.height, errors }
    }

    /// The image as the eye's contrast sensitivity lets it through.
    fn seen(&self, planes: &[Vec<f32>; 3], width: usize) -> [Vec<f32>; 3] {
        [0, 1, 2].map(|c| {
            let mut sum = vec![0.0; planes[c].len()];
            for [across, down] in &self.color[c] {
                let part = convolve_down(&convolve_across(&planes[c], width, across), width, down);
                for (s, p) in sum.iter_mut().zip(part) {
                    *s += p;
                }
            }
            sum
        })
    }

    /// Strength of edges and of points.
    fn features(&self, y: &[f32], width: usize) -> [Vec<f32>; 2] {
        let gray: Vec<f32> = y.iter().map(|y| (y + 16.0) / 116.0).collect();
        let smooth = convolve_across(&gray, width, &self.smooth);
        [&self.first, &self.second].map(|derivative| {
            let across =
                convolve_down(&convolve_across(&gray, width, derivative), width, &self.smooth);
            let down = convolve_down(&smooth, width, derivative);
            across.iter().zip(&down).map(|(x, y)| x.hypot(*y)).collect()
        })
    }
}

/// Correlates every row with `weights`; pixels outside repeat the border.
fn convolve_across(image: &[f32], width: usize, weights: &[f32]) -> Vec<f32> {
    let radius = weights.len() / 2;
    let mut out = vec![0.0; image.len()];
    out.par_chunks_mut(width).zip(image.par_chunks(width)).for_each(|(out, row)| {
        let mut padded = vec![row[0]; radius];
        padded.extend_from_slice(row);
        padded.resize(width + 2 * radius, row[width - 1]);
        for (k, w) in weights.iter().enumerate() {
            for (o, p) in out.iter_mut().zip(&padded[k..]) {
                *o += w * p;
            }
        }
    });
    out
}

/// Correlates every column with `weights`; pixels outside repeat the border.
fn convolve_down(image: &[f32], width: usize, weights: &[f32]) -> Vec<f32> {
    let radius = weights.len() / 2;
    let height = image.len() / width;
    let mut out = vec![0.0; image.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (k, w) in weights.iter().enumerate() {
            let source = (y + k).saturating_sub(radius).min(height - 1);
            for (o, p) in out.iter_mut().zip(&image[source * width..][..width]) {
                *o += w * p;
            }
        }
    });
    out
}
