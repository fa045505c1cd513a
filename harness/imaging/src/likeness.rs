//! Whether a picture shows a scene at all, however wrongly it is shaded.

use basecode::image::Image;

use super::correlation::Moments;
use super::reference::RegionMask;

/// How much a picture's structure is that of a scene: the larger value of the picture as it is and mirrored, since rows
/// or columns may be in the wrong order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Likeness {
    /// Correlation of the brightness of pixels, in [-1, 1].
    pub brightness: f64,
    /// Correlation of the steepness of brightness, that is of the places of edges, in [-1, 1].
    pub edges: f64,
}

/// The likeness of a picture to right images of a scene, emitters left out. A picture of another
/// size is stretched.
pub fn likeness(picture: &Image, right: &[&Image], mask: &RegionMask) -> Likeness {
    let (width, height) = (mask.width, mask.height);
    let both = |image: &Image| {
        let bright = brightness(image, width, height);
        let steep = steepness(&bright, width, height);
        (bright, steep)
    };
    let (bright, steep) = both(picture);
    let mut best = Likeness { brightness: -1.0, edges: -1.0 };
    for (right_bright, right_steep) in right.iter().map(|image| both(image)) {
        for (rows, columns) in [(false, false), (true, false), (false, true), (true, true)] {
            let mirrored = |i: usize| {
                let (x, y) = (i % width, i / width);
                let x = if columns { width - 1 - x } else { x };
                if rows { (height - 1 - y) * width + x } else { y * width + x }
            };
            let compared = |i: &usize| mask.pixels[*i] & RegionMask::EMITTER == 0;
            let like = |a: &[f32], b: &[f32]| {
                let pixels = (0..mask.pixels.len()).filter(compared);
                let pairs = pixels.map(|i| (f64::from(a[mirrored(i)]), f64::from(b[i])));
                Moments::of(pairs).correlation()
            };
            best.brightness = best.brightness.max(like(&bright, &right_bright));
            best.edges = best.edges.max(like(&steep, &right_steep));
        }
    }
    best
}

/// The cube root of every pixel's mean, about what an eye sees; 0 for what is negative or not
/// finite.
fn brightness(image: &Image, width: usize, height: usize) -> Vec<f32> {
    let at = |i: usize| {
        let (x, y) = (i % width * image.width / width, i / width * image.height / height);
        let value = image.pixels.get(y * image.width + x).map_or(0.0, |p| p.element_sum() / 3.0);
        if value.is_finite() { value.max(0.0).cbrt() } else { 0.0 }
    };
    (0..width * height).map(at).collect()
}

/// How steep brightness is around each pixel: the largest step between neighbors in its 3x3.
fn steepness(values: &[f32], width: usize, height: usize) -> Vec<f32> {
    let step = |i: usize, j: usize| (values[i] - values[j]).abs();
    let own: Vec<f32> = (0..width * height)
        .map(|i| {
            let right = if i % width + 1 < width { step(i, i + 1) } else { 0.0 };
            let below = if i + width < width * height { step(i, i + width) } else { 0.0 };
            right.max(below)
        })
        .collect();
    (0..width * height)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let rows = y.saturating_sub(1)..(y + 2).min(height);
            rows.flat_map(|j| (x.saturating_sub(1)..(x + 2).min(width)).map(move |c| j * width + c))
                .map(|j| own[j])
                .fold(0.0, f32::max)
        })
        .collect()
}
