//! Error metrics of the literature, for the reader of a report. They decide nothing: globally they do not tell right
//! from wrong (a correct 1 spp render scores 43.3 dB, a gain error of 1 % 46.2 dB).

use basecode::Vec3;
use basecode::image::Image;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::difference::Sums;
use super::flip::{PIXELS_PER_DEGREE, flip_hdr, flip_ldr};

/// Number of pixels that one thread sums.
const PART: usize = 1 << 14;
/// Rows of SSIM's windows that a thread takes at a time.
const SSIM_BAND: usize = 64;

/// All metrics of an image against the expected one. A field is `None` where it is undefined: a value is not finite,
/// the images are equal (PSNR), or smaller than SSIM's window.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Metrics {
    /// Mean absolute error over pixels and channels.
    pub mae: Option<f64>,
    /// Root of the mean squared error.
    pub rmse: Option<f64>,
    /// Mean of d^2 / (expected^2 + 0.01).
    pub rel_mse: Option<f64>,
    /// Peak signal-to-noise ratio in dB; `None` if the images are equal.
    pub psnr_db: Option<f64>,
    /// The peak that PSNR and SSIM refer to: the largest expected value.
    pub peak: f64,
    /// Structural similarity, mean over the channels of linear RGB.
    pub ssim: Option<f64>,
    /// LDR-FLIP, mean, at [`PIXELS_PER_DEGREE`], both images clamped to [0, 1].
    pub flip_ldr: Option<f64>,
    /// HDR-FLIP (ACES), mean, at [`PIXELS_PER_DEGREE`].
    pub flip_hdr: Option<f64>,
}

/// The mean errors alone, which one pass over two images gives. A field is `None` where it is undefined, as in
/// [`Metrics`].
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// See [`Metrics::mae`].
    pub mae: Option<f64>,
    /// See [`Metrics::rmse`].
    pub rmse: Option<f64>,
    /// See [`Metrics::rel_mse`].
    pub rel_mse: Option<f64>,
    /// See [`Metrics::psnr_db`].
    pub psnr_db: Option<f64>,
    /// See [`Metrics::peak`].
    pub peak: f64,
}

impl Errors {
    /// From the sums over this many pixels.
    pub fn of_sums(sums: &Sums, pixels: usize) -> Self {
        let mean = |sum: f64| sum / (3 * pixels) as f64;
        let finite = |v: f64| v.is_finite().then_some(v);
        let (mse, peak) = (mean(sums.squared), f64::from(sums.peak));
        Self {
            mae: finite(mean(sums.absolute)),
            rmse: finite(mse.sqrt()),
            rel_mse: finite(mean(sums.relative)),
            psnr_db: finite(psnr_db(mse, peak)),
            peak,
        }
    }
}

impl Metrics {
    /// Measures everything; `None` when the sizes differ or there are no pixels.
    pub fn measure(actual: &Image, expected: &Image) -> Option<Self> {
        if (actual.width, actual.height) != (expected.width, expected.height)
            || expected.pixels.is_empty()
        {
            return None;
        }
        let peak = expected.pixels.iter().fold(0.0, |m: f64, p| m.max(f64::from(p.max_element())));
        let mse = mse(actual, expected);
        let finite = |v: f64| v.is_finite().then_some(v);
        let mean = |map: Option<super::flip::FlipMap>| map.and_then(|m| finite(m.mean()));
        Some(Self {
            mae: finite(mae(actual, expected)),
            rmse: finite(mse.sqrt()),
            rel_mse: finite(rel_mse(actual, expected)),
            psnr_db: finite(psnr_db(mse, peak)),
            peak,
            ssim: ssim(actual, expected, peak).and_then(finite),
            flip_ldr: mean(flip_ldr(actual, expected, PIXELS_PER_DEGREE)),
            flip_hdr: mean(flip_hdr(actual, expected, PIXELS_PER_DEGREE)),
        })
    }
}

/// Mean over pixels and channels of a function of (actual, expected).
fn mean(actual: &Image, expected: &Image, f: impl Fn(f64, f64) -> f64 + Sync) -> f64 {
    let part = |(actual, expected): (&[Vec3], &[Vec3])| {
        let mut sum = 0.0;
        for (a, b) in actual.iter().zip(expected) {
            for c in 0..3 {
                sum += f(f64::from(a[c]), f64::from(b[c]));
            }
        }
        sum
    };
    let parts = actual.pixels.par_chunks(PART).zip(expected.pixels.par_chunks(PART));
    // In their order, so that the sum does not depend on the number of threads.
    let sums: Vec<f64> = parts.map(part).collect();
    sums.iter().sum::<f64>() / (3 * expected.pixels.len()) as f64
}

/// Mean absolute error over pixels and channels of two images of one size.
pub fn mae(actual: &Image, expected: &Image) -> f64 {
    mean(actual, expected, |a, b| (a - b).abs())
}

/// Mean squared error over pixels and channels of two images of one size.
pub fn mse(actual: &Image, expected: &Image) -> f64 {
    mean(actual, expected, |a, b| (a - b) * (a - b))
}

/// Mean of d^2 / (expected^2 + 0.01) over pixels and channels of two images of one size.
pub fn rel_mse(actual: &Image, expected: &Image) -> f64 {
    mean(actual, expected, |a, b| (a - b) * (a - b) / (b * b + 0.01))
}

/// Peak signal-to-noise ratio in dB for a mean squared error: infinite at 0.
pub fn psnr_db(mse: f64, peak: f64) -> f64 {
    10.0 * (peak * peak / mse).log10()
}

/// Structural similarity (Wang, Bovik, Sheikh, Simoncelli 2004) with a Gaussian window of 11x11 pixels and sigma 1.5,
/// K1 = 0.01, K2 = 0.03: mean over the three linear channels and all pixels whose window lies inside.
///
/// `peak` is the range of values. The same as scikit-image with `gaussian_weights=True, use_sample_covariance=False`.
/// `None` when the sizes differ or an image is smaller than the window.
pub fn ssim(actual: &Image, expected: &Image, peak: f64) -> Option<f64> {
    const RADIUS: usize = 5;
    const WINDOW: usize = 2 * RADIUS + 1;
    let (width, height) = (expected.width, expected.height);
    if (actual.width, actual.height) != (width, height) || width < WINDOW || height < WINDOW {
        return None;
    }
    let mut weights = [0.0f64; WINDOW];
    for (i, w) in weights.iter_mut().enumerate() {
        let x = i as f64 - RADIUS as f64;
        *w = (-0.5 * (x / 1.5).powi(2)).exp();
    }
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= total);
    let (c1, c2) = ((0.01 * peak).powi(2), (0.03 * peak).powi(2));

    let inside = width - 2 * RADIUS;
    let mut sum = 0.0;
    let tops: Vec<usize> = (0..height - 2 * RADIUS).step_by(SSIM_BAND).collect();
    for channel in 0..3 {
        // Five moments of the window: a, b, a^2, b^2, ab; rows are smoothed across first, then down.
        let band = |(moments, smoothed): &mut (Vec<[f64; 5]>, Vec<[f64; 5]>), top: &usize| {
            let rows = SSIM_BAND.min(height - 2 * RADIUS - top);
            smoothed.clear();
            for y in *top..top + rows + 2 * RADIUS {
                moments.clear();
                moments.extend((y * width..(y + 1) * width).map(|i| {
                    let a = f64::from(actual.pixels[i][channel]);
                    let b = f64::from(expected.pixels[i][channel]);
                    [a, b, a * a, b * b, a * b]
                }));
                smoothed.extend((0..inside).map(|x| weighted(&weights, |k| &moments[x + k])));
            }
            let row = |y: usize| {
                let similarity = |x: usize| {
                    let [a, b, aa, bb, ab] =
                        weighted(&weights, |k| &smoothed[(y + k) * inside + x]);
                    let covariance = ab - a * b;
                    let variances = (aa - a * a) + (bb - b * b);
                    (2.0 * a * b + c1) * (2.0 * covariance + c2)
                        / ((a * a + b * b + c1) * (variances + c2))
                };
                (0..inside).map(similarity).sum()
            };
            (0..rows).map(row).collect::<Vec<f64>>()
        };
        let rows: Vec<Vec<f64>> = tops.par_iter().map_init(Default::default, band).collect();
        sum += rows.iter().flatten().sum::<f64>();
    }
    Some(sum / (3 * inside * (height - 2 * RADIUS)) as f64)
}

/// Sum of eleven moment vectors with weights.
fn weighted<'a>(weights: &[f64; 11], at: impl Fn(usize) -> &'a [f64; 5]) -> [f64; 5] {
    let mut sum = [0.0; 5];
    for (k, w) in weights.iter().enumerate() {
        for (s, m) in sum.iter_mut().zip(at(k)) {
            *s += w * m;
        }
    }
    sum
}
