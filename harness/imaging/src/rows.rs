//! One pass over the rows of one or two image files, on all cores.

use std::ops::Range;

use basecode::exr_io::{Band, ExrRows, ImageError};
use rayon::prelude::*;

/// The most rows that two files' bands are rounded up to so that no block is decoded twice.
const MOST_ROWS: usize = 512;

/// Some channels of an open image.
#[derive(Clone, Copy)]
pub struct Channels<'a> {
    /// The file.
    pub file: &'a ExrRows<'static>,
    /// Indices of its channels.
    pub channels: &'a [usize],
}

/// A row of each image: `row(image, channel)` are its values.
pub struct Row<'a> {
    /// Its place in the image, 0 on top.
    pub y: usize,
    bands: &'a [Band],
    in_band: usize,
}

impl<'a> Row<'a> {
    /// The values of a channel, counted as in [`Channels::channels`], of an image.
    pub fn values(&self, image: usize, channel: usize) -> &'a [f32] {
        self.bands[image].row(channel, self.in_band)
    }

    /// The values of the first three channels of an image.
    pub fn colors(&self, image: usize) -> [&'a [f32]; 3] {
        [0, 1, 2].map(|channel| self.values(image, channel))
    }
}

/// Reads images of one size band by band and hands each row to `visit`, with what it makes of the
/// band so far. Answers that of all bands, from the top. Their height depends on the files alone,
/// so the answer does not depend on the number of threads.
///
/// # Errors
/// The first of the first image that cannot be read.
pub fn visit_rows<T: Default + Send>(
    images: &[Channels],
    visit: impl Fn(&mut T, Row) + Sync,
) -> Result<Vec<T>, ImageError> {
    let height = images.first().map_or(0, |image| image.file.height());
    let rows = band_height(images);
    let bands: Vec<Range<usize>> =
        (0..height).step_by(rows).map(|top| top..height.min(top + rows)).collect();
    let new_bands = || images.iter().map(|_| Band::default()).collect::<Vec<_>>();
    let read = |bands: &mut Vec<Band>, rows: Range<usize>| {
        for (which, (image, band)) in images.iter().zip(bands.iter_mut()).enumerate() {
            image.file.read(rows.clone(), image.channels, band).map_err(|error| (which, error))?;
        }
        let mut made = T::default();
        for (in_band, y) in rows.enumerate() {
            visit(&mut made, Row { y, bands, in_band });
        }
        Ok(made)
    };
    // A small image is done before threads have started.
    let made: Vec<Result<T, (usize, ImageError)>> = match &bands[..] {
        [only] => vec![read(&mut new_bands(), only.clone())],
        _ => bands.into_par_iter().map_init(new_bands, read).collect(),
    };
    let mut first: Option<(usize, ImageError)> = None;
    let mut all = Vec::with_capacity(made.len());
    for band in made {
        match band {
            Ok(band) => all.push(band),
            Err(error) if first.as_ref().is_none_or(|first| error.0 < first.0) => {
                first = Some(error);
            }
            Err(_) => {}
        }
    }
    first.map_or(Ok(all), |(_, error)| Err(error))
}

/// Whole blocks of both files where that is not much more than each wants.
fn band_height(images: &[Channels]) -> usize {
    let heights: Vec<usize> = images.iter().map(|image| image.file.band_height()).collect();
    let most = heights.iter().copied().max().unwrap_or(1);
    let common = heights.iter().copied().fold(1, |a, b| a / greatest_divisor(a, b) * b);
    if common <= MOST_ROWS { common } else { most }
}

fn greatest_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_divisor(b, a % b) }
}
