//! Where the errors of many images lie: a small map of each, and their mean as a picture.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use basecode::Image;
use serde::{Deserialize, Serialize};

use super::pictures::{DARKEST, Picture};
use super::reference::RegionMask;

/// A map is so many cells wide, where its image has as many pixels.
const ACROSS: usize = 96;
/// A cell's side in the picture of a mean, in pixels.
const SIDE: usize = 4;
/// Colors of the share of the largest mean, from 0 to 1: of growing lightness, so that everybody can tell them apart
/// (stops of matplotlib's "inferno").
const COLORS: [[u8; 3]; 5] =
    [[0, 0, 4], [87, 16, 110], [188, 55, 84], [249, 142, 9], [252, 255, 164]];

/// The error of an image, cell by cell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErrorMap {
    width: usize,
    height: usize,
    /// Base64 of a byte for each cell, row 0 on top: 255 is an error of 100 % or more.
    cells: String,
}

impl ErrorMap {
    /// The relative error of the mean of the channels, at most 100 %, which also stands for values that are not finite;
    /// emitters have none. `None` when the sizes differ.
    pub fn of(
        actual: &Image,
        expected: &Image,
        mask: &RegionMask,
        median_lit: f32,
    ) -> Option<Self> {
        let (width, height) = (expected.width, expected.height);
        let same = (actual.width, actual.height) == (width, height)
            && (mask.width, mask.height) == (width, height);
        if !same || width == 0 || height == 0 {
            return None;
        }
        let step = width.div_ceil(ACROSS);
        let darkest = (DARKEST * median_lit).max(f32::MIN_POSITIVE);
        let error = |index: usize| {
            let (a, b) = (actual.pixels[index], expected.pixels[index]);
            if mask.pixels[index] & RegionMask::EMITTER != 0 {
                return 0.0;
            }
            let (a, b) = (a.element_sum() / 3.0, b.element_sum() / 3.0);
            let error = (a - b).abs() / b.max(darkest);
            if error.is_finite() { f64::from(error.min(1.0)) } else { 1.0 }
        };
        let mut cells = Vec::new();
        for top in (0..height).step_by(step) {
            for left in (0..width).step_by(step) {
                let rows = top..(top + step).min(height);
                let columns = left..(left + step).min(width);
                let count = rows.len() * columns.len();
                let pixels = rows.flat_map(|y| columns.clone().map(move |x| y * width + x));
                let mean = pixels.map(error).sum::<f64>() / count as f64;
                cells.push((255.0 * mean).round() as u8);
            }
        }
        let (width, height) = (width.div_ceil(step), height.div_ceil(step));
        Some(Self { width, height, cells: STANDARD.encode(cells) })
    }
}

/// The mean of maps of one size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeanError {
    width: usize,
    height: usize,
    sums: Vec<f64>,
}

impl MeanError {
    /// Adds a map; one of another size than the first is left out.
    pub fn add(&mut self, map: &ErrorMap) {
        let Ok(cells) = STANDARD.decode(&map.cells) else { return };
        if self.sums.is_empty() {
            (self.width, self.height) = (map.width, map.height);
            self.sums = vec![0.0; map.width * map.height];
        }
        if (self.width, self.height) == (map.width, map.height) && cells.len() == self.sums.len() {
            self.sums.iter_mut().zip(cells).for_each(|(sum, cell)| *sum += f64::from(cell) / 255.0);
        }
    }

    /// The mean over `count` images, of which those without a map have no error; `None` where no image has any.
    pub fn picture(&self, count: usize) -> Option<Picture> {
        let most = self.sums.iter().copied().fold(0.0, f64::max);
        if most <= 0.0 || count == 0 {
            return None;
        }
        let (width, height) = (SIDE * self.width, SIDE * self.height);
        let cell = |index: usize| {
            let (x, y) = (index % width / SIDE, index / width / SIDE);
            color(self.sums[y * self.width + x] / most)
        };
        let pixels = (0..width * height).map(cell).collect();
        let percent = 100.0 * most / count as f64;
        let caption = format!("mean relative error: black none, light yellow {percent:.1} %");
        Some(Picture { width, height, pixels, caption })
    }
}

/// The color of a share in [0, 1].
fn color(share: f64) -> [u8; 3] {
    let place = share.clamp(0.0, 1.0) * (COLORS.len() - 1) as f64;
    let below = (place as usize).min(COLORS.len() - 2);
    let t = place - below as f64;
    let mix = |c: usize| {
        let [a, b] = [COLORS[below][c], COLORS[below + 1][c]].map(f64::from);
        (a + t * (b - a)).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}

#[cfg(test)]
mod tests {
    use basecode::Vec3;

    use super::*;

    fn image(width: usize, values: &[f32]) -> Image {
        let pixels: Vec<Vec3> = values.iter().map(|&value| Vec3::splat(value)).collect();
        Image { width, height: pixels.len() / width, pixels }
    }

    fn mask(width: usize, pixels: &[u16]) -> RegionMask {
        let (height, pixels) = (pixels.len() / width, pixels.to_vec());
        RegionMask { width, height, regions: Vec::new(), pixels }
    }

    fn cells(map: &ErrorMap) -> Vec<u8> {
        STANDARD.decode(&map.cells).unwrap()
    }

    #[test]
    fn an_error_is_relative_and_at_most_everything() {
        let expected = image(3, &[1.0, 1.0, 1.0, 1.0, 0.0, 1.0]);
        let actual = image(3, &[1.0, 1.2, 0.8, f32::NAN, 0.025, 9.0]);
        let flags = [0, 0, 0, 0, 0, RegionMask::EMITTER];
        let map = ErrorMap::of(&actual, &expected, &mask(3, &flags), 1.0).unwrap();
        // What is darker than a twentieth of the median counts as that bright.
        assert_eq!((map.width, map.height, cells(&map)), (3, 2, vec![0, 51, 51, 255, 128, 0]));
        assert_eq!(ErrorMap::of(&image(2, &[1.0; 6]), &expected, &mask(3, &flags), 1.0), None);
    }

    #[test]
    fn a_cell_is_the_mean_of_its_pixels() {
        // Two pixels for each cell across, and an odd row at the end.
        let width = 2 * ACROSS;
        let expected = image(width, &vec![1.0; 3 * width]);
        let mut actual = expected.clone();
        actual.pixels[0] = Vec3::splat(1.5);
        actual.pixels[2 * width] = Vec3::splat(1.5);
        let flags = vec![0; 3 * width];
        let map = ErrorMap::of(&actual, &expected, &mask(width, &flags), 1.0).unwrap();
        assert_eq!((map.width, map.height), (ACROSS, 2));
        let found = cells(&map);
        // Half of it in one of four pixels, then in one of two.
        assert_eq!((found[0], found[1], found[ACROSS]), (32, 0, 64));
    }

    #[test]
    fn a_mean_counts_those_without_an_error() {
        let map = |cells: &[u8]| ErrorMap { width: 2, height: 1, cells: STANDARD.encode(cells) };
        let mut mean = MeanError::default();
        assert_eq!(mean.picture(3), None);
        for cells in [[0, 51], [0, 102], [0, 0]] {
            mean.add(&map(&cells));
        }
        mean.add(&ErrorMap { width: 1, height: 1, cells: STANDARD.encode([255]) });
        let picture = mean.picture(6).unwrap();
        assert_eq!((picture.width, picture.height), (2 * SIDE, SIDE));
        assert_eq!((picture.pixels[0], picture.pixels[SIDE]), (COLORS[0], COLORS[4]));
        assert!(picture.caption.ends_with("light yellow 10.0 %"), "{}", picture.caption);
    }
}
