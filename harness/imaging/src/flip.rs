//! FLIP, the perceived difference of two images that are flipped between, 0 (none) to 1.
//!
//! LDR-FLIP: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images", HPG 2020. HDR-FLIP: Andersson, Nilsson, Shirley, Akenine-Moller, "Visualizing Errors in
//! Rendered High Dynamic Range Images", EG 2021: the largest LDR-FLIP over a range of exposures. Constants are the
//! papers'. FLIP informs readers of a report and decides nothing.

use std::ops::Range;

use basecode::image::Image;
use glam::{Mat3, Vec3, vec3};
use rayon::prelude::*;

/// Pixels per degree of the papers' viewer: 0.7 m from a display 0.7 m and 3840 pixels wide.
pub const PIXELS_PER_DEGREE: f32 = 67.020_64;

/// Rows that are filtered at a time: so many that the filters' overlap costs little, and so few that what is between
/// two filters stays small.
const BAND: usize = 96;

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
    let tone = |p: Vec3| p.clamp(Vec3::ZERO, Vec3::ONE);
    Some(Filters::new(pixels_per_degree).worst(actual, expected, &[tone], BAND))
}

/// HDR-FLIP with the ACES tone mapper and the exposures that the papers derive from the expected image. Negative values
/// count as 0, as no display shows them.
///
/// `None` when the sizes differ, a value is not a number, or the expected image is black.
pub fn flip_hdr(actual: &Image, expected: &Image, pixels_per_degree: f32) -> Option<FlipMap> {
    check(actual, expected)?;
    let (start, stop) = exposure_range(expected)?;
    let count = ((stop - start).ceil() as usize).max(2);
    let tone = |i: usize| {
        let gain = (start + (stop - start) * i as f32 / (count - 1) as f32).exp2();
        move |p: Vec3| aces(gain * p.max(Vec3::ZERO))
    };
    let tones: Vec<_> = (0..count).map(tone).collect();
    Some(Filters::new(pixels_per_degree).worst(actual, expected, &tones, BAND))
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

/// Linearized CIELAB, the papers' YCxCz, of tone-mapped pixels.
fn opponent(pixels: &[Vec3], tone: impl Fn(Vec3) -> Vec3, planes: &mut [Vec<f32>; 3]) {
    let matrix = to_xyz();
    planes.iter_mut().for_each(|plane| plane.clear());
    for &p in pixels {
        let xyz = matrix * tone(p) / WHITE;
        planes[0].push(116.0 * xyz.y - 16.0);
        planes[1].push(500.0 * (xyz.x - xyz.y));
        planes[2].push(200.0 * (xyz.y - xyz.z));
    }
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

    /// The largest FLIP of two images over some tone mappers, in bands of so many rows.
    fn worst(
        &self,
        actual: &Image,
        expected: &Image,
        tones: &[impl Fn(Vec3) -> Vec3 + Sync],
        band: usize,
    ) -> FlipMap {
        let (width, height) = (expected.width, expected.height);
        let mut errors = vec![0.0f32; width * height];
        let bands = errors.par_chunks_mut(width * band).enumerate();
        bands.for_each_init(Room::default, |room, (index, out)| {
            let rows = Rows::new(index * band, out.len() / width, (width, height), self.radius());
            for (nth, tone) in tones.iter().enumerate() {
                for (image, seen) in [actual, expected].into_iter().zip(&mut room.seen) {
                    let pixels = &image.pixels[rows.around.start * width..rows.around.end * width];
                    opponent(pixels, tone, &mut room.planes);
                    self.colors(&rows, &room.planes, &mut room.between, &mut seen.colors);
                    self.features(&rows, &room.planes[0], &mut room.between, &mut seen.features);
                }
                self.difference(&room.seen, &mut room.errors);
                match nth {
                    0 => out.copy_from_slice(&room.errors),
                    _ => out.iter_mut().zip(&room.errors).for_each(|(w, e)| *w = w.max(*e)),
                }
            }
        });
        FlipMap { width, height, errors }
    }

    /// How many rows beyond a pixel's own decide what is seen there.
    fn radius(&self) -> usize {
        let color = self.color.iter().flatten().flatten();
        color.chain([&self.smooth]).map(|weights| weights.len() / 2).max().unwrap_or(0)
    }

    /// FLIP of what is seen of two images.
    fn difference(&self, [a, b]: &[Seen; 2], errors: &mut Vec<f32>) {
        let back = to_xyz().inverse();
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
        errors.clear();
        errors.extend((0..a.colors[0].len()).map(|i| {
            let pick = |c: &[Vec<f32>; 3]| lab(vec3(c[0][i], c[1][i], c[2][i]));
            let color = hyab(pick(&a.colors), pick(&b.colors)).powf(0.7);
            let color = if color < knee {
                0.95 * color / knee
            } else {
                0.95 + 0.05 * (color - knee) / (largest - knee)
            };
            let apart = |k: usize| (a.features[k][i] - b.features[k][i]).abs();
            let feature = (apart(0).max(apart(1)) * std::f32::consts::FRAC_1_SQRT_2).sqrt();
            color.powf(1.0 - feature)
        }));
    }

    /// The rows as the eye's contrast sensitivity lets them through.
    fn colors(
        &self,
        rows: &Rows,
        planes: &[Vec<f32>; 3],
        between: &mut Between,
        out: &mut [Vec<f32>; 3],
    ) {
        let Between { padded, across: middle, down: part, .. } = between;
        for (c, sum) in out.iter_mut().enumerate() {
            zeros(sum, rows.samples());
            for [across, down] in &self.color[c] {
                rows.convolve_across(&planes[c], across, padded, middle);
                rows.convolve_down(middle, down, part);
                for (s, p) in sum.iter_mut().zip(part.iter()) {
                    *s += p;
                }
            }
        }
    }

    /// Strength of edges and of points.
    fn features(&self, rows: &Rows, y: &[f32], between: &mut Between, out: &mut [Vec<f32>; 2]) {
        let Between { padded, across: middle, down: part, gray, smooth } = between;
        gray.clear();
        gray.extend(y.iter().map(|y| (y + 16.0) / 116.0));
        rows.convolve_across(gray, &self.smooth, padded, smooth);
        for (out, derivative) in out.iter_mut().zip([&self.first, &self.second]) {
            rows.convolve_across(gray, derivative, padded, middle);
            rows.convolve_down(middle, &self.smooth, out);
            rows.convolve_down(smooth, derivative, part);
            out.iter_mut().zip(part.iter()).for_each(|(x, y)| *x = x.hypot(*y));
        }
    }
}

/// Memory that a thread needs again and again.
#[derive(Default)]
struct Room {
    planes: [Vec<f32>; 3],
    between: Between,
    seen: [Seen; 2],
    errors: Vec<f32>,
}

/// What lies between two filters.
#[derive(Default)]
struct Between {
    padded: Vec<f32>,
    across: Vec<f32>,
    down: Vec<f32>,
    gray: Vec<f32>,
    smooth: Vec<f32>,
}

/// What the eye sees of some rows of an image.
#[derive(Default)]
struct Seen {
    colors: [Vec<f32>; 3],
    features: [Vec<f32>; 2],
}

/// Rows of an image, and those around them that filters need.
struct Rows {
    width: usize,
    /// Of the whole image.
    height: usize,
    wanted: Range<usize>,
    around: Range<usize>,
}

impl Rows {
    fn new(top: usize, rows: usize, (width, height): (usize, usize), radius: usize) -> Self {
        let around = top.saturating_sub(radius)..height.min(top + rows + radius);
        Self { width, height, wanted: top..top + rows, around }
    }

    fn samples(&self) -> usize {
        self.wanted.len() * self.width
    }

    /// Correlates every row around with `weights`; pixels outside repeat the border.
    fn convolve_across(
        &self,
        image: &[f32],
        weights: &[f32],
        padded: &mut Vec<f32>,
        out: &mut Vec<f32>,
    ) {
        let (width, radius) = (self.width, weights.len() / 2);
        zeros(out, image.len());
        for (out, row) in out.chunks_exact_mut(width).zip(image.chunks_exact(width)) {
            padded.clear();
            padded.resize(radius, row[0]);
            padded.extend_from_slice(row);
            padded.resize(width + 2 * radius, row[width - 1]);
            for (k, w) in weights.iter().enumerate() {
                for (o, p) in out.iter_mut().zip(&padded[k..]) {
                    *o += w * p;
                }
            }
        }
    }

    /// Correlates every column with `weights`, where rows are wanted; pixels outside repeat the border.
    fn convolve_down(&self, image: &[f32], weights: &[f32], out: &mut Vec<f32>) {
        let (width, radius) = (self.width, weights.len() / 2);
        zeros(out, self.samples());
        for (y, out) in self.wanted.clone().zip(out.chunks_exact_mut(width)) {
            for (k, w) in weights.iter().enumerate() {
                let source = (y + k).saturating_sub(radius).min(self.height - 1);
                let row = &image[(source - self.around.start) * width..][..width];
                for (o, p) in out.iter_mut().zip(row) {
                    *o += w * p;
                }
            }
        }
    }
}

/// Makes a buffer so many zeros.
fn zeros(buffer: &mut Vec<f32>, count: usize) {
    buffer.clear();
    buffer.resize(count, 0.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_change_no_bit() {
        for (width, height) in [(37, 61), (5, 3), (64, 1)] {
            let image = |scale: f32| {
                let wave = |i: usize, k: f32| (1.0 + (i as f32 * k).sin()) * scale;
                let pixel = |i| vec3(wave(i, 0.37), wave(i, 0.11), wave(i, 0.73));
                Image { width, height, pixels: (0..width * height).map(pixel).collect() }
            };
            let (actual, expected) = (image(0.9), image(1.0));
            let filters = Filters::new(PIXELS_PER_DEGREE);
            let tones = [0.5, 2.0].map(|gain| move |p: Vec3| aces(gain * p));
            let bits = |band: usize| {
                let map = filters.worst(&actual, &expected, &tones, band);
                map.errors.iter().map(|error| error.to_bits()).collect::<Vec<_>>()
            };
            let whole = bits(height);
            assert!(whole.iter().any(|bits| *bits != 0));
            for band in [1, 7, 20] {
                assert_eq!(bits(band), whole, "{band} rows of {width}x{height}");
            }
        }
    }
}
