//! The pixels of a file, a few rows at a time, from several threads at once.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use exr::block;
use exr::block::chunk::{
    CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates,
};
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{IntegerBounds, SampleType};
use exr::meta::header::Header;

use super::header::{Channels, Checks, name_of, provenance, visible};
use super::{ExrLayers, ImageError, MAX_FILE_BYTES, read_file};
use crate::Vec3;
use crate::image::Image;

/// Bytes in which a header's windows are looked for; most headers have a few hundred.
const HEAD: u64 = 1 << 16;
/// About so many bytes of samples are decoded at a time: what a core's own cache holds.
const BAND_BYTES: usize = 256 << 10;

/// An EXR file whose header has been checked and whose blocks have been found. No pixel is in memory.
pub struct ExrRows<'a> {
    source: Source<'a>,
    path: PathBuf,
    header: Header,
    /// From top to bottom, then from left to right; they cover every pixel once.
    blocks: Vec<Block>,
    /// Bytes of a pixel's samples before those of each channel.
    before: Vec<usize>,
    width: usize,
    height: usize,
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

/// Where a block's samples lie in the file, and in the image.
struct Block {
    /// Its number in the file, from 1.
    number: usize,
    at: u64,
    bytes: usize,
    place: IntegerBounds,
}

impl Block {
    fn rows(&self) -> Range<usize> {
        let top = self.place.position.y() as usize;
        top..top + self.place.size.height()
    }
}

impl ExrRows<'static> {
    /// Opens a file and reads all but its pixels.
    ///
    /// # Errors
    /// See [`ImageError`]; nothing that a file can hold makes this panic.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ImageError> {
        let path = path.as_ref();
        let io = |source| ImageError::Io { path: path.into(), source };
        let file = File::open(path).map_err(io)?;
        let meta = file.metadata().map_err(io)?;
        // A pipe can be read only once.
        let source = match meta.is_file() {
            true => Source::File(file, meta.len()),
            false => Source::Memory(read_file(file, path)?.into()),
        };
        Self::new(source, path)
    }
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
        guarded(path, || Self::index(source, path))
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Where the first column and row lie in the plane of all images; mostly (0, 0).
    pub fn origin(&self) -> [i32; 2] {
        let Vec2(x, y) = self.header.data_window().position;
        [x, y]
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The names of all channels, as the file has them.
    pub fn channels(&self) -> Vec<String> {
        self.header.channels.list.iter().map(|channel| name_of(&channel.name)).collect()
    }

    /// Whether a channel (an index of [`ExrRows::channels`]) holds integers.
    pub fn is_integer(&self, channel: usize) -> bool {
        self.header.channels.list[channel].sample_type == SampleType::U32
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
    /// reader may want to know about the file, such as channels of no layer.
    ///
    /// # Errors
    /// When there is none, because each lacks a channel or holds integers.
    pub fn layers(&self) -> Result<(Channels, Vec<String>), ImageError> {
        let mut notes = self.notes.clone();
        let layers = self.checks().layers(&self.header.channels, &mut notes)?;
        Ok((layers, notes))
    }

    /// How many rows are best read at once: whole blocks, and about as much as a core's cache holds.
    pub fn band_height(&self) -> usize {
        let block = self.blocks.first().map_or(1, |block| block.place.size.height());
        let row = 4 * self.width * self.header.channels.list.len();
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
        assert!(rows.end <= self.height, "rows {rows:?} of an image {} high", self.height);
        band.width = self.width;
        band.planes.resize_with(channels.len(), Vec::new);
        for plane in &mut band.planes {
            plane.resize(rows.len() * self.width, 0.0);
        }
        let first = self.blocks.partition_point(|block| block.rows().end <= rows.start);
        let blocks = self.blocks[first..].iter().take_while(|block| block.rows().start < rows.end);
        guarded(&self.path, || {
            for block in blocks {
                self.read_block(block, &rows, channels, band)?;
            }
            Ok(())
        })
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
        let mut images = vec![Image::new(self.width, self.height); layers.len()];
        let mut band = Band::default();
        let height = self.band_height();
        for top in (0..self.height).step_by(height) {
            let rows = top..self.height.min(top + height);
            self.read(rows.clone(), &channels, &mut band)?;
            for (index, image) in images.iter_mut().enumerate() {
                for y in rows.clone() {
                    let [r, g, b] = [0, 1, 2].map(|c| band.row(3 * index + c, y - top));
                    let pixels = &mut image.pixels[y * self.width..][..self.width];
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
    fn index(source: Source<'a>, path: &Path) -> Result<Self, ImageError> {
        let checks = Checks { path, file_bytes: source.len() };
        let mut start = [0; 24];
        let start = &mut start[..source.len().min(24) as usize];
        source.read(start, 0).map_err(|source| ImageError::Io { path: path.into(), source })?;
        checks.signature(start)?;
        let mut head = vec![0; source.len().min(HEAD) as usize];
        source.read(&mut head, 0).map_err(|source| ImageError::Io { path: path.into(), source })?;
        checks.windows(&head)?;
        let mut cursor = BufReader::new(Cursor { source: &source, at: 0 });
        let reader = block::read(&mut cursor, false).map_err(|e| checks.error(e, "the header"))?;
        let [header] = reader.headers() else {
            return Err(checks.unsupported("several parts", "one part"));
        };
        let header = header.clone();
        drop(reader);
        let mut notes = Vec::new();
        let (width, height) = checks.header(&header, &mut notes)?;
        let after_header = cursor
            .stream_position()
            .map_err(|source| ImageError::Io { path: path.into(), source })?;
        let blocks = find_blocks(&source, &checks, &header, after_header)?;
        let mut before = Vec::new();
        let mut bytes = 0;
        for channel in &header.channels.list {
            before.push(bytes);
            bytes += channel.sample_type.bytes_per_sample();
        }
        Ok(Self { path: path.into(), source, header, blocks, before, width, height, notes })
    }

    /// Puts what a block holds of these rows into the band.
    fn read_block(
        &self,
        block: &Block,
        rows: &Range<usize>,
        channels: &[usize],
        band: &mut Band,
    ) -> Result<(), ImageError> {
        let Band { planes, bytes, .. } = band;
        let samples = self.samples(block, bytes)?;
        let (left, columns) = (block.place.position.x() as usize, block.place.size.width());
        let line_bytes = columns * self.header.channels.bytes_per_pixel;
        let inside = block.rows();
        for y in inside.start.max(rows.start)..inside.end.min(rows.end) {
            let line = &samples[(y - inside.start) * line_bytes..][..line_bytes];
            for (plane, &channel) in planes.iter_mut().zip(channels) {
                let row = &mut plane[(y - rows.start) * self.width + left..][..columns];
                let from = &line[columns * self.before[channel]..];
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
        }
        Ok(())
    }

    /// The decompressed samples of a block, line by line, channel by channel, in this machine's byte order.
    fn samples<'b>(&self, block: &Block, buffer: &'b mut Vec<u8>) -> Result<&'b [u8], ImageError> {
        let place = || format!("pixel block {} of {}", block.number, self.blocks.len());
        let (columns, rows) = (block.place.size.width(), block.place.size.height());
        let expected = columns * rows * self.header.channels.bytes_per_pixel;
        buffer.resize(block.bytes, 0);
        self.source.read(buffer, block.at).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => self.checks().truncated(&place()),
            _ => ImageError::Io { path: self.path.clone(), source: error },
        })?;
        // Samples that compression would have made longer are stored as they are.
        if buffer.len() != expected || cfg!(target_endian = "big") {
            *buffer = self
                .header
                .compression
                .decompress_image_section_from_le(
                    &self.header,
                    std::mem::take(buffer),
                    block.place,
                    false,
                )
                .map_err(|e| self.checks().error(e, &place()))?;
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

/// Walks through the blocks of a file. The table of their offsets is not needed, and often wrong.
fn find_blocks(
    source: &Source<'_>,
    checks: &Checks<'_>,
    header: &Header,
    after_header: u64,
) -> Result<Vec<Block>, ImageError> {
    let count = header.chunk_count;
    let mut at = after_header + 8 * count as u64;
    let mut blocks = Vec::with_capacity(count);
    for number in 1..=count {
        let place = || format!("pixel block {number} of {count}");
        let read = |bytes: &mut [u8], at: u64| {
            source.read(bytes, at).map_err(|error| match error.kind() {
                io::ErrorKind::UnexpectedEof => checks.truncated(&place()),
                _ => ImageError::Io { path: checks.path.into(), source: error },
            })
        };
        let mut head = [0; 20];
        let head = match header.blocks {
            BlockDescription::ScanLines => &mut head[..8],
            BlockDescription::Tiles(_) => &mut head[..],
        };
        read(head, at)?;
        at += head.len() as u64;
        let block = match *head.as_chunks::<4>().0 {
            [y, _] => CompressedBlock::ScanLine(CompressedScanLineBlock {
                y_coordinate: i32::from_le_bytes(y),
                compressed_pixels_le: Vec::new(),
            }),
            _ => CompressedBlock::Tile(CompressedTileBlock {
                coordinates: TileCoordinates::read(&mut &*head)
                    .map_err(|e| checks.error(e, &place()))?,
                compressed_pixels_le: Vec::new(),
            }),
        };
        let size = head.last_chunk::<4>().map_or(0, |size| i32::from_le_bytes(*size));
        let bytes = usize::try_from(size)
            .ok()
            .filter(|&bytes| bytes <= header.max_block_byte_size())
            .ok_or_else(|| checks.malformed(format!("{}: it claims {size} bytes", place())))?;
        if at + bytes as u64 > source.len() {
            return Err(checks.truncated(&place()));
        }
        let found = header.get_block_data_indices(&block).and_then(|indices| {
            let place = header.get_absolute_block_pixel_coordinates(indices)?;
            place.validate(Some(header.layer_size))?;
            Ok((indices.level_index, place))
        });
        let (level, place) = found.map_err(|e| checks.error(e, &place()))?;
        if level != Vec2(0, 0) {
            let what = "a pixel block of a resolution level that is not there";
            return Err(checks.malformed(what.into()));
        }
        blocks.push(Block { number, at, bytes, place });
        at += bytes as u64;
    }
    let corner = |block: &Block| (block.place.position.y(), block.place.position.x());
    blocks.sort_by_key(corner);
    if let Some(pair) = blocks.windows(2).find(|pair| corner(&pair[0]) == corner(&pair[1])) {
        let (row, column) = corner(&pair[0]);
        return Err(
            checks.malformed(format!("the pixels at column {column}, row {row} are stored twice"))
        );
    }
    Ok(blocks)
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

pub(super) fn too_long(path: &Path) -> ImageError {
    ImageError::Size {
        path: path.into(),
        found: "the file is too long".into(),
        expected: format!("at most {MAX_FILE_BYTES} bytes"),
    }
}

/// The bytes of a file, read at any place by any thread.
enum Source<'a> {
    Memory(Cow<'a, [u8]>),
    /// And its length when it was opened.
    File(File, u64),
}

impl Source<'_> {
    fn len(&self) -> u64 {
        match self {
            Self::Memory(bytes) => bytes.len() as u64,
            Self::File(_, bytes) => *bytes,
        }
    }

    /// Fills `out`.
    fn read(&self, out: &mut [u8], at: u64) -> io::Result<()> {
        match self {
            Self::Memory(bytes) => {
                let inside = usize::try_from(at).ok().and_then(|at| bytes.get(at..));
                let inside = inside.and_then(|rest| rest.get(..out.len()));
                out.copy_from_slice(inside.ok_or(io::ErrorKind::UnexpectedEof)?);
                Ok(())
            }
            #[cfg(unix)]
            Self::File(file, _) => std::os::unix::fs::FileExt::read_exact_at(file, out, at),
            #[cfg(windows)]
            Self::File(file, _) => {
                let (mut out, mut at) = (out, at);
                while !out.is_empty() {
                    let read = std::os::windows::fs::FileExt::seek_read(file, out, at)?;
                    if read == 0 {
                        return Err(io::ErrorKind::UnexpectedEof.into());
                    }
                    out = &mut out[read..];
                    at += read as u64;
                }
                Ok(())
            }
        }
    }
}

/// A source that is read from its start, as the decoder wants its header.
struct Cursor<'s, 'a> {
    source: &'s Source<'a>,
    at: u64,
}

impl Read for Cursor<'_, '_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let left = self.source.len().saturating_sub(self.at);
        let count = out.len().min(usize::try_from(left).unwrap_or(usize::MAX));
        self.source.read(&mut out[..count], self.at)?;
        self.at += count as u64;
        Ok(count)
    }
}

impl Seek for Cursor<'_, '_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let from = |base: u64, by: i64| base.checked_add_signed(by);
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::Current(by) => from(self.at, by),
            SeekFrom::End(by) => from(self.source.len(), by),
        };
        self.at = at.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.at)
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
