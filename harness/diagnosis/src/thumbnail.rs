//! Thumbnails: a renderer's answer to one question, reduced to 32x24 values.

use basecode::{Image, Vec3};

/// Values in a row of a thumbnail.
pub const COLUMNS: usize = 32;
/// Rows of a tile.
pub const ROWS: usize = 24;
/// Values of a tile.
pub const LENGTH: usize = COLUMNS * ROWS;

/// 32x24 values of a long answer. A value that is NaN was not asked for; what the renderer answered
/// as NaN or infinity is infinite in all three channels.
#[derive(Clone, Debug)]
pub struct Thumbnail(Vec<Vec3>);

impl Thumbnail {
    /// A tile of exactly [`LENGTH`] values, as they were stored.
    pub fn of_stored(values: Vec<Vec3>) -> Option<Self> {
        (values.len() == LENGTH).then(|| Self(values.into_iter().map(kept).collect()))
    }

    /// Every n-th value of a list, or all of a short one; the rest was not asked for.
    pub fn of_list(values: &[[f32; 3]]) -> Self {
        let stride = values.len().max(LENGTH);
        let at = |i: usize| values.get(i * stride / LENGTH).copied().map_or(Vec3::NAN, answer);
        Self((0..LENGTH).map(at).collect())
    }

    /// The pixels of a grid over an image, the same seen from either side.
    pub fn of_image(image: &Image) -> Self {
        let answered: Vec<_> = image.pixels.iter().map(|&pixel| answer(pixel.into())).collect();
        Self::sampled(image.width, image.height, &answered)
    }

    /// As [`Thumbnail::of_image`], where only some pixels were asked for: (index, value) of each.
    pub fn of_pixels(
        (width, height): (usize, usize),
        pixels: impl Iterator<Item = (usize, [f32; 3])>,
    ) -> Self {
        let mut values = vec![Vec3::NAN; width * height];
        for (index, value) in pixels {
            if let Some(place) = values.get_mut(index) {
                *place = answer(value);
            }
        }
        Self::sampled(width, height, &values)
    }

    /// Mean over each of 32x24 blocks of `with`, over that of `without`; not asked for where
    /// `without` is black or one is not finite. Blocks hold on any film.
    pub fn of_ratio(with: &Image, without: &Image) -> Self {
        if (with.width, with.height) != (without.width, without.height)
            || with.width < COLUMNS
            || with.height < ROWS
        {
            return Self(vec![Vec3::NAN; LENGTH]);
        }
        let sum = |image: &Image, column: usize, row: usize| -> f32 {
            let (w, h) = (image.width, image.height);
            let rows = row * h / ROWS..(row + 1) * h / ROWS;
            let columns = column * w / COLUMNS..(column + 1) * w / COLUMNS;
            rows.map(|y| {
                let row = &image.pixels[y * w..(y + 1) * w];
                row[columns.clone()].iter().map(|pixel| pixel.element_sum()).sum::<f32>()
            })
            .sum()
        };
        let value = |i: usize| {
            let (column, row) = (i % COLUMNS, i / COLUMNS);
            let ratio = sum(with, column, row) / sum(without, column, row);
            if ratio.is_finite() { Vec3::splat(ratio) } else { Vec3::NAN }
        };
        Self((0..LENGTH).map(value).collect())
    }

    fn sampled(width: usize, height: usize, values: &[Vec3]) -> Self {
        if width == 0 || height == 0 || values.len() != width * height {
            return Self(vec![Vec3::NAN; LENGTH]);
        }
        let value = |i: usize| {
            let (x, y) = (place(i % COLUMNS, COLUMNS, width), place(i / COLUMNS, ROWS, height));
            values[y * width + x]
        };
        Self((0..LENGTH).map(value).collect())
    }

    /// The values.
    pub fn values(&self) -> &[Vec3] {
        &self.0
    }

    /// The tile of an image as a small image again, every value `scale` pixels wide and high.
    pub fn enlarged(&self, scale: usize) -> Image {
        let (width, height) = (COLUMNS * scale, ROWS * scale);
        let pixel = |i: usize| self.0[i / width / scale * COLUMNS + i % width / scale];
        Image { width, height, pixels: (0..width * height).map(pixel).collect() }
    }

    /// Whether nothing was asked for.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|value| value.is_nan())
    }

    /// Takes what another tile was asked for and this one was not.
    pub fn fill(&mut self, other: &Self) {
        for (own, other) in self.0.iter_mut().zip(&other.0) {
            if own.is_nan() {
                *own = *other;
            }
        }
    }

    /// The same with every value mapped.
    pub fn map(&self, f: impl Fn(Vec3) -> Vec3) -> Self {
        Self(self.0.iter().map(|&value| if value.is_nan() { value } else { f(value) }).collect())
    }

    /// The same with every value combined with those of two others.
    pub fn combine(&self, a: &Self, b: &Self, f: impl Fn(Vec3, Vec3, Vec3) -> Vec3) -> Self {
        let values = self.0.iter().zip(&a.0).zip(&b.0);
        Self(values.map(|((&own, &a), &b)| kept(f(own, a, b))).collect())
    }
}

/// Column or row of a tile's value `i` of `count` on a side of `size` pixels; symmetrical, so that
/// a mirrored image gives the mirrored tile.
fn place(i: usize, count: usize, size: usize) -> usize {
    let at = |i: usize| (2 * i + 1) * size / (2 * count);
    if 2 * i < count { at(i).min(size - 1) } else { size - 1 - at(count - 1 - i).min(size - 1) }
}

/// The largest value that is told from infinity: what 16-bit floats hold.
const LARGEST: f32 = 6e4;

/// A renderer's answer as a tile's value.
fn answer(value: [f32; 3]) -> Vec3 {
    let value = Vec3::from(value);
    if value.is_finite() && value.abs().max_element() < LARGEST { value } else { Vec3::INFINITY }
}

/// A stored or computed value as a tile's value.
fn kept(value: Vec3) -> Vec3 {
    if value.is_nan() { Vec3::NAN } else { answer(value.into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: usize, height: usize, f: impl Fn(usize, usize) -> f32) -> Image {
        let pixels = (0..width * height).map(|i| Vec3::splat(f(i % width, i / width))).collect();
        Image { width, height, pixels }
    }

    #[test]
    fn a_mirrored_image_gives_the_mirrored_tile() {
        for (width, height) in [(96, 72), (128, 96), (800, 600), (33, 25)] {
            let plain =
                Thumbnail::of_image(&image(width, height, |x, y| (x + 1000 * y) as f32 / 64.0));
            let mirrored = image(width, height, |x, y| (width - 1 - x + 1000 * y) as f32 / 64.0);
            let mirrored = Thumbnail::of_image(&mirrored);
            for (a, b) in plain.0.chunks(COLUMNS).zip(mirrored.0.chunks(COLUMNS)) {
                let back: Vec<Vec3> = b.iter().rev().copied().collect();
                assert_eq!(a, back);
            }
        }
    }

    #[test]
    fn what_was_not_asked_is_told_from_what_is_not_finite() {
        let tile = Thumbnail::of_list(&[[1.0; 3], [f32::NAN; 3], [1e9, 0.0, 0.0]]);
        assert_eq!(tile.0[0], Vec3::ONE);
        assert_eq!(tile.0[1], Vec3::INFINITY);
        assert_eq!(tile.0[2], Vec3::INFINITY);
        assert!(tile.0[3].is_nan());
        let long: Vec<[f32; 3]> = (0..4 * LENGTH).map(|i| [i as f32; 3]).collect();
        let tile = Thumbnail::of_list(&long);
        assert_eq!((tile.0[0].x, tile.0[1].x, tile.0[LENGTH - 1].x), (0.0, 4.0, 3068.0));
        let holes = Thumbnail::of_pixels((96, 72), [(0, [1.0; 3])].into_iter());
        assert!(holes.is_empty(), "pixel 0 is no place of the grid");
        let large = Thumbnail::of_list(&long).enlarged(3);
        assert_eq!((large.width, large.height), (3 * COLUMNS, 3 * ROWS));
        assert_eq!((large.at(2, 2).x, large.at(3, 2).x), (0.0, 4.0));
        assert_eq!(large.at(0, 3).x, 4.0 * COLUMNS as f32);
    }

    #[test]
    fn block_ratios_hold_on_any_film() {
        let half = |x: usize, w: usize| if 2 * x < w { 1.0 } else { 0.25 };
        let tile = |w, h| {
            let with = image(w, h, |x, y| (y + 1) as f32 * half(x, w));
            Thumbnail::of_ratio(&with, &image(w, h, |_, y| (y + 1) as f32))
        };
        let (small, large) = (tile(128, 96), tile(768, 576));
        assert_eq!(small.0, large.0);
        assert_eq!((small.0[0].x, small.0[COLUMNS - 1].x), (1.0, 0.25));
        assert!(
            Thumbnail::of_ratio(&image(128, 96, |_, _| 1.0), &image(64, 96, |_, _| 1.0)).is_empty()
        );
        assert!(
            Thumbnail::of_ratio(&image(64, 48, |_, _| 1.0), &image(64, 48, |_, _| 0.0)).is_empty()
        );
    }
}
