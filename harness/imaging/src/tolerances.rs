//! The tolerances that images are judged by.

use serde::{Deserialize, Serialize};

/// Where "different" begins; each default says which measurement set it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Tolerances {
    /// A pixel fails when it lies further off than this many standard errors.
    /// Measured: correct images have 2e-5 to 6e-5 of their pixels above 4, wrong ones 1e-3 to 0.8.
    pub z_limit: f64,
    /// The largest fraction of interior pixels that may fail: the geometric mean of 6e-5 and 1e-3.
    pub interior_fraction: f64,
    /// Number of further pixels that may fail, in the interior and on edges, on any film. Gaussian noise puts 6e-5 of
    /// the pixels above 4: on 6,000 pixels 6 or more come once in 300,000 images, 3 or more once in 150.
    pub spare_pixels: u32,
    /// The largest fraction of the edge mask that may fail. A correct image has under 1 % there (binomial coverage at
    /// 16 spp, this module's tests); an image half a pixel off at 1 spp has 16 % of a mask three pixels wide.
    pub edge_fraction: f64,
    /// The part of the standard error that does not shrink with samples, as a fraction of the median lit value:
    /// measured on right renderers (5e-4), made relative.
    pub floor_of_median: f64,
    /// The same as a fraction of the expected value: measured on right renderers (0.002 b).
    pub floor_relative: f64,
    /// The largest signed bias of a region, relative to its mean. Measured: correct under 0.03 %, weakest mistake
    /// (n + 1 for n + 2) 1.56 %.
    pub bias_relative: f64,
    /// Or so many standard errors of the region's mean, if that is more: small regions and few samples are noisy.
    pub bias_standard_errors: f64,
    /// Regions with fewer interior pixels than this are judged pixel by pixel only: their variance is not well known.
    pub min_region_pixels: u32,
    /// Below minus this a value is negative. Measured: a missing test of `wi` goes far below, rounding does not.
    pub negative_limit: f64,
    /// Realtime, interior: the largest relative difference.
    pub realtime_relative: f64,
    /// More of it per unit of Phong exponent n. WGSL's pow is exp2(n log2 x) with log2 good to 2^-21, that is 3.3e-7 n,
    /// and cos(alpha) itself carries about 1e-6 from the interpolated normal; three times their sum.
    pub realtime_per_exponent: f64,
    /// And more of it where neighbors differ: this part of a pixel's way to them. Graphics hardware snaps vertices to
    /// 1/256 of a pixel and interpolates from there (lavapipe does not); an H100 was 0.73 of that off in a highlight
    /// one pixel wide. Twice that, for room.
    pub realtime_snap_px: f64,
    /// Realtime in 8-bit sRGB levels: a pixel fails when it is this many levels off. One level is rounding (2.5 to 45 %
    /// of pixels by driver).
    pub srgb_levels: u32,
    /// The largest fraction of interior pixels that may fail by levels: the geometric mean of 0.115 % (normal not
    /// renormalized, accepted) and 0.54 % (weakest real mistake). Correct images have 0 to 2 such pixels.
    pub srgb_fraction: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            z_limit: 4.0,
            interior_fraction: 2.5e-4,
            spare_pixels: 4,
            edge_fraction: 0.05,
            floor_of_median: 5e-4,
            floor_relative: 2e-3,
            bias_relative: 3e-3,
            bias_standard_errors: 10.0,
            min_region_pixels: 16,
            negative_limit: 1e-6,
            realtime_relative: 2e-3,
            realtime_per_exponent: 4e-6,
            realtime_snap_px: 1.0 / 128.0,
            srgb_levels: 2,
            srgb_fraction: 2.5e-3,
        }
    }
}
