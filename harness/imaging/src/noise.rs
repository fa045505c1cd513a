//! What the noise of an offline image says about how it was drawn.
//!
//! On silhouettes and shadow edges a pixel's value is a matter of chance: the mean of n samples of
//! known variance v. Over thousands of such pixels the squared distance from the reference,
//! v (1/n + 1/N) on average, tells n to a few per cent, whatever the seed.

use basecode::image::Image;

use super::correlation::Moments;
use super::reference::{ReferenceImage, RegionMask};
use super::srgb;

/// A pixel is noisy when one sample's standard deviation is at least this fraction of the brightest
/// value around it: far above what half precision and 8-bit levels round away at 16 spp.
const NOISY: f32 = 0.1;
/// Least number of noisy pixels that a measurement needs.
const FEWEST: usize = 200;
/// Noisy pixels near an interior pixel that differs by this fraction of its value (and by what no
/// noise does) are wrong, not noisy.
const WRONG: f32 = 0.02;
/// Distance that counts as near, in pixels: edges are three pixels wide.
const NEAR: usize = 2;
/// Two images are one when at most this fraction of the noisy pixels is further apart than one
/// 8-bit level. Of two draws at 16 spp most are.
const APART: f64 = 0.01;

/// The noisy pixels of a scene.
pub struct NoisyPixels<'a> {
    reference: &'a ReferenceImage,
    /// Index and weight of each.
    pixels: Vec<(usize, f64)>,
}

/// How much noise an image has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// The samples per pixel that would give as much noise, in [1e-6, 1e6].
    pub spp: f64,
    /// Standard error of `spp` by the spread over the pixels, as a fraction of it.
    pub relative_error: f64,
    /// How many pixels it rests on.
    pub pixels: usize,
    /// The fraction of the pixels away from edges that no number of samples explains: where this is
    /// not small, edges may be wrong too, which looks like more noise.
    pub wrong: f64,
}

impl<'a> NoisyPixels<'a> {
    /// The noisy pixels of a scene; nothing when there are too few.
    pub fn new(reference: &'a ReferenceImage) -> Option<Self> {
        let (width, height) = (reference.mean.width, reference.mean.height);
        let floor = 0.05 * reference.median_lit;
        let noisy = |index: usize| {
            let flags = reference.mask.pixels[index];
            if flags & RegionMask::EDGE == 0 || flags & RegionMask::EMITTER != 0 {
                return None;
            }
            let near = around(index, width, height, 1);
            let brightest =
                near.map(|i| reference.mean.pixels[i].max_element()).fold(floor, f32::max);
            let deviation = reference.variance.pixels[index].max_element().sqrt();
            // Equal weights for edges of equal contrast, so that highlights do not decide alone.
            let weight = 1.0 / f64::from(brightest).powi(2);
            (deviation >= NOISY * brightest).then_some((index, weight))
        };
        let pixels: Vec<_> = (0..width * height).filter_map(noisy).collect();
        (pixels.len() >= FEWEST).then_some(Self { reference, pixels })
    }

    /// How much noise an image has where it is right. Nothing when it has another size or too few
    /// of its noisy pixels lie where it is right.
    pub fn measure(&self, image: &Image) -> Option<Noise> {
        let ReferenceImage { mean, variance, mask, .. } = self.reference;
        let (width, height) = (mean.width, mean.height);
        if (image.width, image.height) != (width, height) {
            return None;
        }
        let wrong: Vec<bool> = (0..width * height).map(|i| self.is_wrong(image, i)).collect();
        let compared = RegionMask::EDGE | RegionMask::EMITTER;
        let interior = mask.pixels.iter().filter(|&&flags| flags & compared == 0).count();
        let right = |&&(index, _): &&(usize, f64)| {
            image.pixels[index].is_finite() && !around(index, width, height, NEAR).any(|i| wrong[i])
        };
        let terms: Vec<(f64, f64)> = self
            .pixels
            .iter()
            .filter(right)
            .map(|&(index, weight)| {
                let d = (image.pixels[index] - mean.pixels[index]).as_dvec3();
                let v = f64::from(variance.pixels[index].element_sum());
                (weight * d.length_squared(), weight * v)
            })
            .collect();
        if terms.len() < FEWEST {
            return None;
        }
        let found: f64 = terms.iter().map(|(d2, _)| d2).sum();
        let one_sample: f64 = terms.iter().map(|(_, v)| v).sum();
        let ratio = found / one_sample;
        let spread: f64 = terms.iter().map(|(d2, v)| (d2 - ratio * v).powi(2)).sum();
        // What the reference's own noise leaves; nothing or less for a converged image.
        let own = (ratio - 1.0 / f64::from(self.reference.n)).clamp(1e-6, 1e6);
        Some(Noise {
            spp: 1.0 / own,
            relative_error: spread.sqrt() / one_sample / own,
            pixels: terms.len(),
            wrong: wrong.iter().filter(|wrong| **wrong).count() as f64 / interior.max(1) as f64,
        })
    }

    /// How alike the noise of two images is, where the first one is right: the correlation of what is left
    /// when the reference is taken off, in [-1, 1]. Two draws of one scene have about 0, whatever their
    /// sizes; one and the same has 1. Nothing as for [`NoisyPixels::measure`].
    pub fn correlation(&self, image: &Image, other: &Image) -> Option<f64> {
        let mean = &self.reference.mean;
        let size = (mean.width, mean.height);
        if (image.width, image.height) != size || (other.width, other.height) != size {
            return None;
        }
        let wrong: Vec<bool> = (0..mean.pixels.len()).map(|i| self.is_wrong(image, i)).collect();
        let (mut moments, mut pixels) = (Moments::default(), 0);
        for &(index, weight) in &self.pixels {
            let [a, b] = [image, other].map(|image| image.pixels[index]);
            let near_wrong = around(index, size.0, size.1, NEAR).any(|i| wrong[i]);
            if !a.is_finite() || !b.is_finite() || near_wrong {
                continue;
            }
            let [a, b] = [a, b].map(|pixel| (pixel - mean.pixels[index]).as_dvec3());
            (0..3).for_each(|channel| moments.add(weight, a[channel], b[channel]));
            pixels += 1;
        }
        moments.cosine().filter(|_| pixels >= FEWEST)
    }

    /// Whether two images hold one and the same draw, whatever rounding to half precision or to
    /// 8-bit levels did to either.
    pub fn same_draw(&self, a: &Image, b: &Image) -> bool {
        if (a.width, a.height) != (b.width, b.height) {
            return false;
        }
        let apart = |&&(index, _): &&(usize, f64)| {
            let pair = a.pixels.get(index).zip(b.pixels.get(index));
            pair.is_none_or(|(a, b)| srgb::levels_apart(*a, *b) > 1)
        };
        let apart = self.pixels.iter().filter(apart).count();
        apart as f64 <= APART * self.pixels.len() as f64
    }

    /// Whether a pixel away from edges differs by more than any number of samples explains.
    fn is_wrong(&self, image: &Image, index: usize) -> bool {
        let ReferenceImage { mean, variance, mask, median_lit, .. } = self.reference;
        if mask.pixels[index] & (RegionMask::EDGE | RegionMask::EMITTER) != 0 {
            return false;
        }
        let (a, b) = (image.pixels[index], mean.pixels[index]);
        let deviation = variance.pixels[index].map(f32::sqrt);
        let allowed = WRONG * (b + 0.5 * *median_lit) + 4.0 * deviation;
        // Written so that a NaN is wrong.
        !(a - b).abs().cmple(allowed).all()
    }
}

/// The indices of the pixels at most `reach` columns and rows away, the pixel's own too.
fn around(index: usize, width: usize, height: usize, reach: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (index % width, index / width);
    let rows = y.saturating_sub(reach)..(y + reach + 1).min(height);
    rows.flat_map(move |j| {
        (x.saturating_sub(reach)..(x + reach + 1).min(width)).map(move |i| j * width + i)
    })
}
