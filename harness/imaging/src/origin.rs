//! Whether two images of a scene come from one renderer, right or wrong.

use basecode::image::Image;
use glam::Vec3;

use super::blob;
use super::reference::RegionMask;
use super::srgb;
use super::tolerances::Tolerances;

/// The largest fraction of pixels by which two draws of one renderer may differ.
const DRAWS_APART: f64 = 1e-3;

/// Whether two offline images of `spp` samples a pixel are draws of one renderer.
///
/// The renderer may be a wrong one, so the reference's variance does not hold. A sample lies within the range R of the
/// 3x3 pixels around. The difference of two means of n samples then has a standard deviation of at most R / 2 sqrt(2 /
/// n).
pub fn same_draws(a: &Image, b: &Image, spp: u32, scale: f32, tolerances: &Tolerances) -> bool {
    if (a.width, a.height) != (b.width, b.height) {
        return false;
    }
    let (floor, relative) =
        ((tolerances.floor_of_median * f64::from(scale)) as f32, tolerances.floor_relative as f32);
    let noise = 0.25 * 2.0 / spp.max(1) as f32;
    let limit = tolerances.z_limit as f32;
    let apart: Vec<bool> = (0..a.pixels.len())
        .map(|i| {
            let (p, q) = (finite(a.pixels[i]), finite(b.pixels[i]));
            let range = range(a, i).max(range(b, i));
            let floor = Vec3::splat(floor) + relative * p.abs().max(q.abs());
            let deviation = (noise * range * range + floor * floor).map(f32::sqrt);
            (p - q).abs().cmpgt(limit * deviation).any()
        })
        .collect();
    let pixels = apart.iter().filter(|apart| **apart).count() as f64;
    let few = DRAWS_APART * apart.len() as f64 + f64::from(tolerances.spare_pixels);
    // Noise is scattered; a highlight that another version draws is not.
    pixels <= few && blob::solid_blocks(&apart, a.width) == 0
}

/// Whether two realtime images are equal in 8-bit sRGB levels, but for as few pixels as another
/// graphics driver puts elsewhere.
pub fn same_levels(a: &Image, b: &Image, mask: &RegionMask, tolerances: &Tolerances) -> bool {
    if (a.width, a.height) != (b.width, b.height) || mask.pixels.len() != a.pixels.len() {
        return false;
    }
    let few = |edge: bool, bound: f64| {
        let own = |flags: &u16| {
            flags & RegionMask::EMITTER == 0 && (flags & RegionMask::EDGE != 0) == edge
        };
        let pairs = a.pixels.iter().zip(&b.pixels).zip(&mask.pixels);
        let pairs = pairs.filter(|(_, flags)| own(flags)).map(|(pair, _)| pair);
        let (mut all, mut apart) = (0u32, 0u32);
        for (a, b) in pairs {
            all += 1;
            apart += u32::from(srgb::levels_apart(*a, *b) >= tolerances.srgb_levels);
        }
        f64::from(apart) <= bound * f64::from(all) + f64::from(tolerances.spare_pixels)
    };
    few(false, tolerances.srgb_fraction) && few(true, tolerances.edge_fraction)
}

/// What is not finite is black in both images alike.
fn finite(p: Vec3) -> Vec3 {
    if p.is_finite() { p } else { Vec3::ZERO }
}

/// Per channel the largest minus the smallest value of the 3x3 pixels around.
fn range(image: &Image, index: usize) -> Vec3 {
    let (width, height) = (image.width, image.height);
    let (x, y) = (index % width, index / width);
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for j in y.saturating_sub(1)..(y + 2).min(height) {
        for i in x.saturating_sub(1)..(x + 2).min(width) {
            let p = finite(image.pixels[j * width + i]);
            (low, high) = (low.min(p), high.max(p));
        }
    }
    high - low
}
