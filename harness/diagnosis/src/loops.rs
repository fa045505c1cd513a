//! Mistakes between pixels and image. Each is tried on the renderer's own radiance, so it is found whatever else is
//! wrong.

use basecode::{Image, Vec3};

use super::view::LoopSeen;

/// A name in the catalogue, and what it does to an image.
type Loop = (&'static str, fn(&Image) -> Image);

const LOOPS: [Loop; 5] = [
    ("film-flipped-rows", |image| at(image, |x, y| (x, image.height - 1 - y))),
    ("film-mirrored-columns", |image| at(image, |x, y| (image.width - 1 - x, y))),
    ("film-transposed", transposed),
    ("film-gamma", |image| each(image, |pixel| pixel.powf(1.0 / 2.2))),
    ("film-clamped", |image| each(image, |pixel| pixel.clamp(Vec3::ZERO, Vec3::ONE))),
];

/// An image that is made of the rays' radiance differs from it by less than this, relatively; what
/// silhouettes show may differ.
const SAME: f32 = 1e-3;
/// Fraction of the pixels that may still differ.
const STRAY: f64 = 0.02;

/// The one thing that turns the radiance along the rays into the image on every scene where the two
/// differ, with the fraction of pixels that it leaves unexplained.
pub fn explain<'a>(seen: impl Iterator<Item = &'a LoopSeen>) -> Option<(&'static str, f64)> {
    let different = seen.filter(|seen| wrong(&seen.rays, &seen.image) > STRAY);
    let different: Vec<&LoopSeen> = different.collect();
    if different.is_empty() {
        return None;
    }
    let left = |make: fn(&Image) -> Image| {
        let each = different.iter().map(|seen| wrong(&make(&seen.rays), &seen.image));
        each.fold(0.0, f64::max)
    };
    let mut fits: Vec<_> = LOOPS.iter().map(|(name, make)| (*name, left(*make))).collect();
    fits.retain(|(_, left)| *left <= STRAY);
    // Scenes that are symmetrical cannot tell.
    if fits.len() == 1 { fits.pop() } else { None }
}

/// Fraction of the pixels that differ.
fn wrong(a: &Image, b: &Image) -> f64 {
    if (a.width, a.height) != (b.width, b.height) {
        return 1.0;
    }
    let differ = |(a, b): &(&Vec3, &Vec3)| {
        let (finite_a, finite_b) = (a.is_finite(), b.is_finite());
        if !(finite_a && finite_b) {
            return finite_a != finite_b;
        }
        (**a - **b).abs().element_sum() > SAME * (a.abs() + b.abs()).element_sum()
    };
    let count = a.pixels.iter().zip(&b.pixels).filter(differ).count();
    count as f64 / a.pixels.len().max(1) as f64
}

fn at(image: &Image, from: impl Fn(usize, usize) -> (usize, usize)) -> Image {
    let pixel = |index: usize| {
        let (x, y) = from(index % image.width, index / image.width);
        image.pixels[y * image.width + x]
    };
    Image { pixels: (0..image.pixels.len()).map(pixel).collect(), ..*image }
}

fn each(image: &Image, f: impl Fn(Vec3) -> Vec3) -> Image {
    Image { pixels: image.pixels.iter().map(|&pixel| f(pixel)).collect(), ..*image }
}

/// Column by column into a buffer that is read row by row.
fn transposed(image: &Image) -> Image {
    let (width, height) = (image.width, image.height);
    let mut turned = image.clone();
    for (index, &pixel) in image.pixels.iter().enumerate() {
        turned.pixels[(index % width) * height + index / width] = pixel;
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rays() -> Image {
        let value = |i: usize| Vec3::new(i as f32 / 100.0, 0.3, (i % 16) as f32 / 10.0);
        Image { width: 16, height: 12, pixels: (0..192).map(value).collect() }
    }

    #[test]
    fn each_is_found_whatever_the_radiance() {
        for (name, make) in LOOPS {
            let seen = LoopSeen { image: make(&rays()), rays: rays() };
            let right = LoopSeen { image: rays(), rays: rays() };
            assert_eq!(explain([&seen].into_iter()), Some((name, 0.0)));
            assert_eq!(explain([&right, &seen].into_iter()), Some((name, 0.0)));
            assert_eq!(explain([&right].into_iter()), None);
        }
    }

    #[test]
    fn nothing_is_said_of_what_is_unknown_or_not_one_thing() {
        let darker = LoopSeen { image: each(&rays(), |p| p * p), rays: rays() };
        assert_eq!(explain([&darker].into_iter()), None);
        let [a, b] =
            [LOOPS[0].1, LOOPS[1].1].map(|make| LoopSeen { image: make(&rays()), rays: rays() });
        assert_eq!(explain([&a, &b].into_iter()), None);
        // Mirrored or flipped: a constant tells neither.
        let constant = each(&rays(), |_| Vec3::ONE);
        let seen = LoopSeen { image: constant.clone(), rays: constant };
        assert_eq!(explain([&seen].into_iter()), None);
    }
}
