//! The pixels of a file, a few rows at a time, from several threads at once.

mod index;
mod samples;

use std::collections::BTreeMap;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use exr::math::Vec2;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;

use super::blocks::Block;
use super::header::{Channels, Checks, Placed, name_of, provenance, visible};
use super::luminance;
use super::source::Source;
use super::{ExrLayers, ImageError};
use crate::Vec3;
use crate::image::Image;

/// About so many bytes of samples are decoded at a time: what a core's own cache holds.
const BAND_BYTES: usize = 256 << 10;

/// An EXR file, or a part of one, whose header has been checked and whose blocks have been found. No pixel is in
/// memory.
///
/// Rows and columns are those of the picture: the stored pixels, and black ones where the display window has more.
pub struct ExrRows<'a> {
    source: Arc<Source<'a>>,
    path: PathBuf,
    /// The name of the part; empty where the file has only one.
    part: String,
    header: Header,
    /// From top to bottom, then from left to right; they cover every pixel once.
    blocks: Vec<Block>,
    /// How many columns and rows one sample of each channel stands for; empty where that is one for all.
    sampling: Vec<[usize; 2]>,
    /// Layers of luminance, whose channels are counted on after those of the file where they are computed.
    gray: Channels,
    /// The Y, RY and BY of the layers whose colors are computed.
    chroma: Vec<[usize; 3]>,
    placed: Placed,
    notes: Vec<String>,
}

/// Rows of some channels, and room that reading them needs again and again.
#[derive(Default)]
pub struct Band {
    planes: Vec<Vec<f32>>,
    width: usize,
    bytes: Vec<u8>,
}

impl Band {
    /// A row, counted from the first that was read, of a channel, counted as they were asked for.
    pub fn row(&self, channel: usize, row: usize) -> &[f32] {
        &self.planes[channel][row * self.width..][..self.width]
    }
}

impl<'a> ExrRows<'a> {
    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.placed.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.placed.height
    }

    /// Where the first column and row lie in the plane of all images; mostly (0, 0).
    pub fn origin(&self) -> [i32; 2] {
        self.placed.origin
    }

    /// The name of the part; empty where the file has only one.
    pub fn part(&self) -> &str {
        &self.part
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The name that a layer or channel of this part has in the whole file: that of the part comes first, unless it
    /// does anyway.
    pub fn name_in_file(&self, name: &str) -> String {
        let begins = |rest: &str| rest.is_empty() || rest.starts_with('.');
        match &*self.part {
            "" => name.to_owned(),
            part if name.strip_prefix(part).is_some_and(begins) => name.to_owned(),
            part if name.is_empty() => part.to_owned(),
            part => format!("{part}.{name}"),
        }
    }

    /// The names of all channels, as the file has them.
    pub fn channels(&self) -> Vec<String> {
        self.header.channels.list.iter().map(|channel| name_of(&channel.name)).collect()
    }

    /// Whether a channel (an index of [`ExrRows::channels`]) holds integers.
    pub fn is_integer(&self, channel: usize) -> bool {
        let channel = self.header.channels.list.get(channel);
        channel.is_some_and(|channel| channel.sample_type == SampleType::U32)
    }

    /// What a reader may want to know about the file, but for its channels.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The primaries that the file declares, see [`ExrLayers::chromaticities`].
    pub fn chromaticities(&self) -> Option<[[f32; 2]; 4]> {
        let found = self.header.shared_attributes.chromaticities?;
        let all = [found.red, found.green, found.blue, found.white];
        Some(all.map(|Vec2(x, y)| [x, y]))
    }

    /// Width over height of a pixel as it is shown; 1 for square ones.
    pub fn pixel_aspect(&self) -> f32 {
        self.header.shared_attributes.pixel_aspect
    }

    /// The layers with R, G and B: name, sorted, and the indices of the three channels; and what a
    /// reader may want to know about the file, such as channels of no layer. Of a part that was opened by
    /// [`ExrRows::open_parts`] and has none, the layers of luminance: one channel three times, or three that are
    /// computed of chroma.
    ///
    /// # Errors
    /// When there is none, because each lacks a channel or holds integers.
    pub fn layers(&self) -> Result<(Channels, Vec<String>), ImageError> {
        let mut notes = self.notes.clone();
        match self.checks().layers(&self.header.channels, &mut notes) {
            Err(_) if !self.gray.is_empty() => {
                notes.push(match self.chroma.is_empty() {
                    true => "luminance only (channel Y): red, green and blue are alike".into(),
                    false => "colors are made of luminance and chroma (Y, RY, BY)".into(),
                });
                Ok((self.gray.clone(), notes))
            }
            layers => Ok((layers?, notes)),
        }
    }

    /// How many rows are best read at once: whole blocks, and about as much as a core's cache holds.
    pub fn band_height(&self) -> usize {
        let block = self.blocks.first().map_or(1, |block| block.place.size.height());
        let row = 4 * self.placed.width * self.header.channels.list.len();
        (BAND_BYTES / row.max(1)).max(1).next_multiple_of(block)
    }

    /// Reads these rows of these channels (indices of [`ExrRows::channels`]) as 32-bit floats; integers as a fraction
    /// of the largest, as OpenImageIO does.
    ///
    /// # Errors
    /// When a block is damaged.
    ///
    /// # Panics
    /// When a row or channel is not there.
    pub fn read(
        &self,
        rows: Range<usize>,
        channels: &[usize],
        band: &mut Band,
    ) -> Result<(), ImageError> {
        let Placed { width, height, at: [_, above], stored: [_, stored], .. } = self.placed;
        assert!(rows.end <= height, "rows {rows:?} of an image {height} high");
        band.width = width;
        band.planes.resize_with(channels.len(), Vec::new);
        for plane in &mut band.planes {
            plane.resize(rows.len() * width, 0.0);
            if self.placed.has_margin() {
                plane.fill(0.0);
            }
        }
        if channels.iter().any(|&channel| channel >= self.header.channels.list.len()) {
            return self.read_colors(rows, channels, band);
        }
        let inside = |y: usize| y.saturating_sub(above).min(stored);
        let wanted = inside(rows.start)..inside(rows.end);
        // A sample of a row may stand for rows below it.
        let down = self.sampling.iter().map(|[_, down]| wanted.start % down).max().unwrap_or(0);
        let from = wanted.start - down;
        let first = self.blocks.partition_point(|block| block.rows().end <= from);
        let blocks =
            self.blocks[first..].iter().take_while(|block| block.rows().start < wanted.end);
        guarded(&self.path, || {
            for block in blocks {
                self.read_block(block, (&rows, &wanted), channels, band)?;
            }
            Ok(())
        })
    }

    /// As [`ExrRows::read`], where some channels are computed of chroma.
    fn read_colors(
        &self,
        rows: Range<usize>,
        channels: &[usize],
        band: &mut Band,
    ) -> Result<(), ImageError> {
        let count = self.header.channels.list.len();
        let weights = luminance::weights(self.chromaticities());
        let mut stored = Band::default();
        for (plane, &channel) in band.planes.iter_mut().zip(channels) {
            let sources = match channel.checked_sub(count) {
                Some(computed) => self.chroma[computed / 3],
                None => [channel; 3],
            };
            self.read(rows.clone(), &sources, &mut stored)?;
            let [y, ry, by] = [0, 1, 2].map(|source| &stored.planes[source]);
            match channel.checked_sub(count) {
                Some(computed) => {
                    let values = y.iter().zip(ry).zip(by);
                    for (value, ((&y, &ry), &by)) in plane.iter_mut().zip(values) {
                        *value = luminance::component(computed % 3, weights, [y, ry, by]);
                    }
                }
                None => plane.copy_from_slice(y),
            }
        }
        Ok(())
    }

    /// The whole image of plain R, G and B.
    pub(super) fn image(&self) -> Result<Image, ImageError> {
        let (layers, _) = self.layers()?;
        let colors = self.checks().colors("", &self.header.channels);
        let channels = colors.map_err(|error| match error {
            ImageError::MissingChannel { path, channel, .. } if channel == "R" => {
                let names: Vec<String> = layers.into_iter().map(|(name, _)| name).collect();
                let found = format!("only the layers {}", visible(&names.join(", ")));
                ImageError::MissingChannel { path, channel, found }
            }
            other => other,
        })?;
        let mut read = self.whole(vec![(String::new(), channels)])?;
        Ok(read.remove("").unwrap_or_default())
    }

    /// The whole image of every layer.
    pub(super) fn images(&self) -> Result<ExrLayers, ImageError> {
        let (layers, notes) = self.layers()?;
        Ok(ExrLayers {
            layers: self.whole(layers)?,
            chromaticities: self.chromaticities(),
            attributes: provenance(&self.header),
            notes,
        })
    }

    /// The whole images of these layers.
    fn whole(&self, layers: Channels) -> Result<BTreeMap<String, Image>, ImageError> {
        let channels: Vec<usize> = layers.iter().flat_map(|(_, found)| *found).collect();
        let mut images = vec![Image::new(self.placed.width, self.placed.height); layers.len()];
        let mut band = Band::default();
        let height = self.band_height();
        for top in (0..self.placed.height).step_by(height) {
            let rows = top..self.placed.height.min(top + height);
            self.read(rows.clone(), &channels, &mut band)?;
            for (index, image) in images.iter_mut().enumerate() {
                for y in rows.clone() {
                    let [r, g, b] = [0, 1, 2].map(|c| band.row(3 * index + c, y - top));
                    let pixels = &mut image.pixels[y * self.placed.width..][..self.placed.width];
                    for (((pixel, &r), &g), &b) in pixels.iter_mut().zip(r).zip(g).zip(b) {
                        *pixel = Vec3::new(r, g, b);
                    }
                }
            }
        }
        Ok(layers.into_iter().map(|(name, _)| name).zip(images).collect())
    }

    fn checks(&self) -> Checks<'_> {
        Checks { path: &self.path, file_bytes: self.source.len() }
    }
}

/// The decoder has been fuzzed by its authors, but a panic in it must not end a batch.
fn guarded<T>(
    path: &Path,
    decode: impl FnOnce() -> Result<T, ImageError>,
) -> Result<T, ImageError> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| {
        Err(ImageError::Malformed {
            path: path.into(),
            what: "the EXR decoder gave up on it (panicked)".into(),
        })
    })
}
