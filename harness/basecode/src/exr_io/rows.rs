//! The pixels of a file, a few rows at a time, from several threads at once.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Seek};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use exr::block;
use exr::math::Vec2;
use exr::meta::attribute::{ChannelDescription, SampleType};
use exr::meta::header::Header;

use super::attributes::{DEEP, PARTS, headers};
use super::blocks::{Block, Part, find_blocks};
use super::header::{Channels, Checks, Placed, luminance_layers, name_of, provenance, visible};
use super::luminance;
use super::source::{Cursor, Source};
use super::{ExrLayers, ImageError, MAX_FILE_BYTES, read_file};
use crate::Vec3;
use crate::image::Image;

/// Bytes in which a header's windows are looked for; most headers have a few hundred.
const HEAD: u64 = 1 << 16;
/// Bytes in which all headers of a file of any kind must lie.
const HEADERS: u64 = 16 << 20;
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
    /// Bytes of a pixel's samples before those of each channel.
    before: Vec<usize>,
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

impl ExrRows<'static> {
    /// Opens a file and reads all but its pixels.
    ///
    /// # Errors
    /// See [`ImageError`]; nothing that a file can hold makes this panic.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ImageError> {
        let path = path.as_ref();
        let source = source_of(path)?;
        Self::new(source, path)
    }

    /// Opens all parts of a file of any kind: cropped or with overscan, with luminance or subsampled channels. Answers
    /// those that can be read, and what is to know of the others.
    ///
    /// # Errors
    /// See [`ImageError`]; also where no part can be read, as in a file of deep data.
    pub fn open_parts(path: impl AsRef<Path>) -> Result<(Vec<Self>, Vec<String>), ImageError> {
        let path = path.as_ref();
        let source = source_of(path)?;
        if source.len() > MAX_FILE_BYTES {
            return Err(too_long(path));
        }
        guarded(path, || Self::index_parts(Arc::new(source), path))
    }
}

/// A file's bytes.
fn source_of(path: &Path) -> Result<Source<'static>, ImageError> {
    let io = |source| ImageError::Io { path: path.into(), source };
    let file = File::open(path).map_err(io)?;
    let meta = file.metadata().map_err(io)?;
    // A pipe can be read only once.
    Ok(match meta.is_file() {
        true => Source::File(file, meta.len()),
        false => Source::Memory(read_file(file, path)?.into()),
    })
}

impl<'a> ExrRows<'a> {
    /// A file held in memory; `path` only names it in messages.
    pub(super) fn of_bytes(bytes: &'a [u8], path: &Path) -> Result<Self, ImageError> {
        Self::new(Source::Memory(bytes.into()), path)
    }

    fn new(source: Source<'a>, path: &Path) -> Result<Self, ImageError> {
        if source.len() > MAX_FILE_BYTES {
            return Err(too_long(path));
        }
        guarded(path, || Self::index(Arc::new(source), path))
    }

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
        if channels.iter().any(|&channel| channel >= self.before.len()) {
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
                if self.sampling.is_empty() {
                    self.read_block(block, (&rows, &wanted), channels, band)?;
                } else {
                    self.spread_block(block, (&rows, &wanted), channels, band)?;
                }
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
        let count = self.before.len();
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

    /// Reads the header and finds the blocks, which follow each other in any order.
    fn index(source: Arc<Source<'a>>, path: &Path) -> Result<Self, ImageError> {
        let checks = Checks { path, file_bytes: source.len() };
        let start = beginning(&source, 24, path)?;
        checks.signature(&start, DEEP | PARTS)?;
        checks.windows(&beginning(&source, HEAD, path)?)?;
        let mut cursor = BufReader::new(Cursor { source: &source, at: 0 });
        let reader = block::read(&mut cursor, false).map_err(|e| checks.error(e, "the header"))?;
        let [header] = reader.headers() else {
            return Err(checks.unsupported("several parts", "one part"));
        };
        let header = header.clone();
        drop(reader);
        let mut notes = Vec::new();
        let placed = checks.header(&header, &mut notes)?;
        let after_header = cursor
            .stream_position()
            .map_err(|source| ImageError::Io { path: path.into(), source })?;
        drop(cursor);
        let part = Part { header: &header, deep: false };
        let blocks = find_blocks(&source, &checks, &[part], (after_header, false))?;
        let blocks = blocks.into_iter().flatten().collect();
        Ok(Self::of_part(source, path, header, blocks, placed, notes))
    }

    /// Reads all headers and finds the blocks of all parts that can be read; and says what the others are.
    fn index_parts(
        source: Arc<Source<'a>>,
        path: &Path,
    ) -> Result<(Vec<Self>, Vec<String>), ImageError> {
        let checks = Checks { path, file_bytes: source.len() };
        let head = beginning(&source, HEADERS, path)?;
        // Deep data beside flat ones are left out.
        let refused = if head.get(5).is_some_and(|flags| flags & PARTS != 0) { 0 } else { DEEP };
        checks.signature(&head, refused)?;
        let found = headers(&head).ok_or_else(|| checks.truncated("the header"))?;
        for (_, place) in &found.parts {
            checks.windows(&head[place.clone()])?;
        }
        let all = {
            let plain = Source::Memory(found.bytes.into());
            let cursor = BufReader::new(Cursor { source: &plain, at: 0 });
            let reader = block::read(cursor, false).map_err(|e| checks.error(e, "the header"))?;
            reader.headers().to_vec()
        };
        if all.len() != found.parts.len() {
            return Err(checks.malformed("its headers contradict each other".into()));
        }
        let walked: Vec<Part> = all
            .iter()
            .zip(&found.parts)
            .map(|(header, (hidden, _))| Part { header, deep: hidden.deep })
            .collect();
        let blocks = find_blocks(&source, &checks, &walked, (found.end, found.numbered))?;
        let several = all.len() > 1;
        let (mut parts, mut left_out, mut first) = (Vec::new(), Vec::new(), None);
        for ((header, (hidden, _)), blocks) in all.into_iter().zip(found.parts).zip(blocks) {
            let name = header.own_attributes.layer_name.as_ref().map(name_of);
            let name = name.filter(|_| several).unwrap_or_default();
            let mut notes = Vec::new();
            match checks.any_header(&header, &hidden, &mut notes) {
                Ok(placed) => {
                    let source = Arc::clone(&source);
                    let mut part = Self::of_part(source, path, header, blocks, placed, notes);
                    part.part = name;
                    if hidden.sampling.iter().any(|factors| *factors != [1, 1]) {
                        for (channel, factors) in
                            part.header.channels.list.iter_mut().zip(&hidden.sampling)
                        {
                            channel.sampling = Vec2(factors[0], factors[1]);
                        }
                        part.sampling = hidden.sampling;
                    }
                    (part.gray, part.chroma) = luminance_layers(&part.header.channels);
                    parts.push(part);
                }
                Err(error @ (ImageError::Unsupported { .. } | ImageError::Size { .. })) => {
                    let (what, expected) = match &error {
                        ImageError::Unsupported { what, expected, .. } => (what, expected),
                        ImageError::Size { found, expected, .. } => (found, expected),
                        _ => continue,
                    };
                    let name = visible(&name);
                    left_out.push(format!("part {name} is left out: {what}, expected {expected}"));
                    first.get_or_insert(error);
                }
                Err(error) => return Err(error),
            }
        }
        match first {
            Some(error) if parts.is_empty() => Err(error),
            _ => Ok((parts, left_out)),
        }
    }

    fn of_part(
        source: Arc<Source<'a>>,
        path: &Path,
        header: Header,
        blocks: Vec<Block>,
        placed: Placed,
        notes: Vec<String>,
    ) -> Self {
        let mut before = Vec::new();
        let mut bytes = 0;
        for channel in &header.channels.list {
            before.push(bytes);
            bytes += channel.sample_type.bytes_per_sample();
        }
        let (path, part) = (path.into(), String::new());
        let (sampling, gray, chroma) = (Vec::new(), Vec::new(), Vec::new());
        Self { source, path, part, header, blocks, before, sampling, gray, chroma, placed, notes }
    }

    /// Puts what a block holds of these rows into the band: its rows, and what is wanted of the stored ones.
    fn read_block(
        &self,
        block: &Block,
        (rows, wanted): (&Range<usize>, &Range<usize>),
        channels: &[usize],
        band: &mut Band,
    ) -> Result<(), ImageError> {
        let Band { planes, bytes, width } = band;
        let [left, top] = self.placed.at;
        let samples = self.samples(block, bytes)?;
        let (first, columns) = (block.place.position.x() as usize, block.place.size.width());
        let line_bytes = columns * self.header.channels.bytes_per_pixel;
        let inside = block.rows();
        for y in inside.start.max(wanted.start)..inside.end.min(wanted.end) {
            let line = &samples[(y - inside.start) * line_bytes..][..line_bytes];
            for (plane, &channel) in planes.iter_mut().zip(channels) {
                let start = (y + top - rows.start) * *width + left + first;
                let row = &mut plane[start..][..columns];
                self.decode(channel, &line[columns * self.before[channel]..], row);
            }
        }
        Ok(())
    }

    /// As [`ExrRows::read_block`], where channels have fewer samples: each is put in all the pixels that it stands for.
    fn spread_block(
        &self,
        block: &Block,
        (rows, wanted): (&Range<usize>, &Range<usize>),
        channels: &[usize],
        band: &mut Band,
    ) -> Result<(), ImageError> {
        let Band { planes, bytes, width } = band;
        let [left, top] = self.placed.at;
        let mut samples = self.samples(block, bytes)?;
        let columns = block.place.size.width();
        let mut values = vec![0.0; columns];
        for y in block.rows() {
            for (channel, &[across, down]) in self.sampling.iter().enumerate() {
                if y % down != 0 {
                    continue;
                }
                let count = columns / across;
                let kind = self.header.channels.list[channel].sample_type;
                let (line, rest) = samples.split_at(count * kind.bytes_per_sample());
                samples = rest;
                let targets = planes.iter_mut().zip(channels).filter(|(_, own)| **own == channel);
                for (plane, _) in targets {
                    self.decode(channel, line, &mut values[..count]);
                    for y in y.max(wanted.start)..(y + down).min(wanted.end) {
                        let row = &mut plane[(y + top - rows.start) * *width + left..][..columns];
                        for (pixels, value) in row.chunks_exact_mut(across).zip(&values) {
                            pixels.fill(*value);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Turns samples of a channel into values.
    fn decode(&self, channel: usize, from: &[u8], row: &mut [f32]) {
        match self.header.channels.list[channel].sample_type {
            SampleType::F16 => {
                for (value, b) in row.iter_mut().zip(from.as_chunks::<2>().0) {
                    *value = from_half(u16::from_ne_bytes(*b));
                }
            }
            SampleType::F32 => {
                for (value, b) in row.iter_mut().zip(from.as_chunks::<4>().0) {
                    *value = f32::from_ne_bytes(*b);
                }
            }
            SampleType::U32 => {
                for (value, b) in row.iter_mut().zip(from.as_chunks::<4>().0) {
                    *value = u32::from_ne_bytes(*b) as f32 / u32::MAX as f32;
                }
            }
        }
    }

    /// The bytes of all samples of a block.
    fn block_bytes(&self, block: &Block) -> usize {
        let (columns, rows) = (block.place.size.width(), block.rows());
        if self.sampling.is_empty() {
            return columns * rows.len() * self.header.channels.bytes_per_pixel;
        }
        let channels = self.header.channels.list.iter().zip(&self.sampling);
        let bytes = |(channel, &[across, down]): (&ChannelDescription, &[usize; 2])| {
            let lines = rows.clone().filter(|y| y % down == 0).count();
            lines * (columns / across) * channel.sample_type.bytes_per_sample()
        };
        channels.map(bytes).sum()
    }

    /// The decompressed samples of a block, line by line, channel by channel, in this machine's byte order.
    fn samples<'b>(&self, block: &Block, buffer: &'b mut Vec<u8>) -> Result<&'b [u8], ImageError> {
        let place = || format!("pixel block {} of {}", block.number, self.blocks.len());
        let (columns, rows) = (block.place.size.width(), block.place.size.height());
        let expected = self.block_bytes(block);
        buffer.resize(block.bytes, 0);
        self.source.read(buffer, block.at).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => self.checks().truncated(&place()),
            _ => ImageError::Io { path: self.path.clone(), source: error },
        })?;
        // Samples that compression would have made longer are stored as they are.
        if buffer.len() != expected || cfg!(target_endian = "big") {
            let packed = std::mem::take(buffer);
            let unpack = |header: &Header, packed: Vec<u8>| {
                let compression = header.compression;
                compression.decompress_image_section_from_le(header, packed, block.place, false)
            };
            let unpacked = if self.sampling.is_empty() {
                unpack(&self.header, packed)
            } else {
                // The decoder counts the bytes of all channels for every pixel.
                let mut header = self.header.clone();
                header.channels.bytes_per_pixel = expected / (columns * rows).max(1);
                unpack(&header, packed)
            };
            *buffer = unpacked.map_err(|e| self.checks().error(e, &place()))?;
        }
        if buffer.len() != expected {
            return Err(self.checks().malformed(format!(
                "a pixel block of {} bytes for {columns}x{rows} pixels",
                buffer.len()
            )));
        }
        Ok(buffer)
    }
}

/// The decoder has been fuzzed by its authors, but a panic in it must not end a batch.
pub(super) fn guarded<T>(
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

/// The first bytes of a file, at most so many.
fn beginning(source: &Source<'_>, most: u64, path: &Path) -> Result<Vec<u8>, ImageError> {
    let mut bytes = vec![0; source.len().min(most) as usize];
    source.read(&mut bytes, 0).map_err(|source| ImageError::Io { path: path.into(), source })?;
    Ok(bytes)
}

pub(super) fn too_long(path: &Path) -> ImageError {
    ImageError::Size {
        path: path.into(),
        found: "the file is too long".into(),
        expected: format!("at most {MAX_FILE_BYTES} bytes"),
    }
}

/// A 16-bit float as a 32-bit one, without a branch: the same as `half`'s, for all 65536.
fn from_half(half: u16) -> f32 {
    let sign = u32::from(half & 0x8000) << 16;
    let rest = u32::from(half & 0x7fff) << 13;
    // The exponents' biases differ by 112. A product gets subnormal numbers right too.
    let finite = f32::from_bits(rest) * f32::from_bits((112 + 127) << 23);
    let quiet = u32::from(half & 0x3ff != 0) << 22;
    let special = rest | 0x7f80_0000 | quiet;
    let bits = if half & 0x7c00 == 0x7c00 { special } else { finite.to_bits() };
    f32::from_bits(bits | sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_what_the_decoder_makes_of_them() {
        for bits in 0..=u16::MAX {
            let theirs = exr::prelude::f16::from_bits(bits).to_f32();
            assert_eq!(from_half(bits).to_bits(), theirs.to_bits(), "{bits:#x}");
        }
    }
}
