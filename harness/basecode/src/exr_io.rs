//! OpenEXR files in and out: linear radiance, row 0 on top, no clamping, no tone mapping.
//!
//! [`write_exr`] writes what the course has always asked for: one part, scan lines, no compression, channels B, G, R.
//! [`write_exr_layers`] stores several images of one size in one file as EXR layers (channels `mean.R`, `mean.G`, ...).
//!
//! Reading trusts nothing: sizes are checked before anything is allocated, every problem is an [`ImageError`] that
//! names the file, and NaN and infinity come through unchanged, for the caller to judge.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use exr::block::{self, UncompressedBlock, reader::ChunksReader, writer::ChunksWriter};
use exr::compression::Compression;
use exr::meta::BlockDescription;
use exr::meta::attribute::{
    ChannelDescription, ChannelList, LevelMode, LineOrder, SampleType, Text,
};
use exr::meta::header::Header;
use exr::prelude::{SmallVec, Vec2, f16};
use glam::Vec3;
use thiserror::Error;

use crate::image::Image;

/// The longest side that is read or written, in pixels.
pub const MAX_SIDE: usize = 16_384;
/// The most pixels that are read or written: 64 Mi, so 768 MiB as `Vec3`.
pub const MAX_PIXELS: usize = 64 << 20;
/// The largest file that is read, in bytes: [`MAX_PIXELS`] as three 32-bit floats, and room for a header.
pub const MAX_FILE_BYTES: u64 = 12 * MAX_PIXELS as u64 + (1 << 20);
/// The most channels a file may hold.
const MAX_CHANNELS: usize = 64;
/// No codec of the format shrinks pixels more than deflate can: 1032 to 1 (zlib's technical notes).
const MAX_COMPRESSION_RATIO: usize = 1032;

/// How a colour is stored in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 16-bit floats: 11 significant bits, largest finite value 65504; beyond it becomes infinite.
    Half,
    /// 32-bit floats: exactly what is in memory.
    Float,
}

/// Why an image file could not be read or written.
#[derive(Debug, Error)]
pub enum ImageError {
    /// The file system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file does not start as an EXR does.
    #[error("{}: not an EXR file: it starts with {found}, expected 76 2f 31 01", path.display())]
    NotExr {
        /// The file.
        path: PathBuf,
        /// Its first bytes, in hexadecimal or in words.
        found: String,
    },
    /// The file ends too early.
    #[error("{}: truncated: the file ends after {found_bytes} bytes, while reading {missing}", path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Its length in bytes.
        found_bytes: u64,
        /// What should have come.
        missing: String,
    },
    /// Too large, or without pixels.
    #[error("{}: {found}, expected {expected}", path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// The size in words.
        found: String,
        /// The limit in words.
        expected: String,
    },
    /// The data window is not the display window.
    #[error("{}: the pixels cover {data} but the picture is {display}; hint: write the whole film, uncropped", path.display())]
    Windows {
        /// The file.
        path: PathBuf,
        /// The data window.
        data: String,
        /// The display window.
        display: String,
    },
    /// A colour channel is not there.
    #[error("{}: no channel {channel}; expected R, G and B, found {found}", path.display())]
    MissingChannel {
        /// The file.
        path: PathBuf,
        /// The full name of the missing channel.
        channel: String,
        /// The names that are there.
        found: String,
    },
    /// Only luminance is stored.
    #[error("{}: luminance only (channel Y); expected R, G and B", path.display())]
    LuminanceOnly {
        /// The file.
        path: PathBuf,
    },
    /// A valid file of a kind that is not accepted.
    #[error("{}: {what}, expected {expected}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it uses.
        what: String,
        /// What it should use.
        expected: String,
    },
    /// Contradicting or damaged content.
    #[error("{}: damaged: {what}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        what: String,
    },
    /// The caller asked to write something that has no valid form.
    #[error("{}: cannot be written: {what}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
}

/// Several images of one size in one file, with a text that says where they come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExrLayers {
    /// Images by layer name; the unnamed layer (plain R, G, B) has the name "".
    pub layers: BTreeMap<String, Image>,
    /// Provenance: one line of printable Latin-1 each; stored together in the standard attribute `comments`.
    pub attributes: BTreeMap<String, String>,
    /// What a reader may want to know about the file; not written.
    pub notes: Vec<String>,
}

/// Reads the R, G, B channels of an EXR file as linear radiance.
///
/// # Errors
/// See [`ImageError`]; nothing that a file can hold makes this panic.
pub fn read_exr(path: impl AsRef<Path>) -> Result<Image, ImageError> {
    let path = path.as_ref();
    single_layer(decode_exr(&read_file(path)?, path)?, path)
}

/// Reads every layer of an EXR file that has R, G and B.
///
/// # Errors
/// See [`ImageError`]; nothing that a file can hold makes this panic.
pub fn read_exr_layers(path: impl AsRef<Path>) -> Result<ExrLayers, ImageError> {
    let path = path.as_ref();
    decode_exr(&read_file(path)?, path)
}

/// Writes `image` as the course's own files are: one part, scan lines, uncompressed, channels B, G, R.
///
/// `attributes` are (name, one line of text) pairs kept in the file's `comments`.
///
/// # Errors
/// When the image is empty or too large, a text cannot be stored, or the file system refuses.
pub fn write_exr(
    path: impl AsRef<Path>,
    image: &Image,
    precision: Precision,
    attributes: &[(&str, &str)],
) -> Result<(), ImageError> {
    let path = path.as_ref();
    let attributes = attributes
        .iter()
        .map(|&(k, v)| (k.to_owned(), v.to_owned()))
        .collect();
    let bytes = encode(
        &[("", image)],
        &attributes,
        precision,
        Compression::Uncompressed,
        path,
    )?;
    write_file(path, &bytes)
}

/// Writes all layers of `content` into one ZIP-compressed file; the same content gives the same bytes.
///
/// # Errors
/// When there is no layer, sizes differ, a name or text cannot be stored, or the file system refuses.
pub fn write_exr_layers(
    path: impl AsRef<Path>,
    content: &ExrLayers,
    precision: Precision,
) -> Result<(), ImageError> {
    let path = path.as_ref();
    let layers: Vec<_> = content
        .layers
        .iter()
        .map(|(name, image)| (name.as_str(), image))
        .collect();
    let bytes = encode(
        &layers,
        &content.attributes,
        precision,
        Compression::ZIP16,
        path,
    )?;
    write_file(path, &bytes)
}

/// Decodes a whole EXR file held in memory; `path` only names it in messages.
///
/// # Errors
/// See [`ImageError`]; no bytes make this panic, and memory stays within a fixed multiple of their number.
pub fn decode_exr(bytes: &[u8], path: &Path) -> Result<ExrLayers, ImageError> {
    // The decoder has been fuzzed by its authors, but a panic in it must not end a batch.
    std::panic::catch_unwind(|| Decoder { bytes, path }.decode()).unwrap_or_else(|_| {
        Err(ImageError::Malformed {
            path: path.into(),
            what: "the EXR decoder gave up on it (panicked)".into(),
        })
    })
}

/// The unnamed layer of a decoded file.
fn single_layer(mut content: ExrLayers, path: &Path) -> Result<Image, ImageError> {
    content
        .layers
        .remove("")
        .ok_or_else(|| ImageError::MissingChannel {
            path: path.into(),
            channel: "R".into(),
            found: format!(
                "only the layers {}",
                content
                    .layers
                    .keys()
                    .cloned()
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
        })
}

fn read_file(path: &Path) -> Result<Vec<u8>, ImageError> {
    use std::io::Read;
    let io = |source| ImageError::Io {
        path: path.into(),
        source,
    };
    let file = std::fs::File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    // One byte past the limit tells a file that is too long, even if it grows meanwhile.
    file.take(MAX_FILE_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(io)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(ImageError::Size {
            path: path.into(),
            found: "the file is too long".into(),
            expected: format!("at most {MAX_FILE_BYTES} bytes"),
        });
    }
    Ok(bytes)
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    std::fs::write(path, bytes).map_err(|source| ImageError::Io {
        path: path.into(),
        source,
    })
}

/// Splits `mean.R` into (`mean`, `R`) and `R` into (``, `R`): EXR's convention for layers.
fn split_channel(name: &str) -> (&str, &str) {
    name.rsplit_once('.').unwrap_or(("", name))
}

/// Where the samples of a file's channel go.
struct Target {
    layer: usize,
    component: usize,
}

/// One file on its way in.
struct Decoder<'a> {
    bytes: &'a [u8],
    path: &'a Path,
}

impl Decoder<'_> {
    fn decode(&self) -> Result<ExrLayers, ImageError> {
        self.check_signature()?;
        let reader =
            block::read(Cursor::new(self.bytes), false).map_err(|e| self.error(e, "the header"))?;
        let [header] = reader.headers() else {
            return Err(self.unsupported("several parts", "one part"));
        };
        let header = header.clone();
        let mut notes = Vec::new();
        let (width, height) = self.check_header(&header, &mut notes)?;
        let (names, targets) = self.assign_channels(&header.channels, &mut notes)?;

        let mut layers = vec![Image::new(width, height); names.len()];
        let chunks = reader
            .all_chunks(false)
            .map_err(|e| self.error(e, "the offset table"))?;
        let blocks = chunks.sequential_decompressor(false);
        let mut seen = std::collections::HashSet::new();
        for block in blocks {
            let block = block.map_err(|e| {
                self.error(
                    e,
                    &format!("pixel block {} of {}", seen.len() + 1, header.chunk_count),
                )
            })?;
            let Vec2(left, top) = block.index.pixel_position;
            if block.index.level != Vec2(0, 0) {
                return Err(
                    self.malformed("a pixel block of a resolution level that is not there".into())
                );
            }
            if !seen.insert((left, top)) {
                return Err(self.malformed(format!(
                    "the pixels at column {left}, row {top} are stored twice"
                )));
            }
            self.place(&block, &header.channels, &targets, &mut layers)?;
        }
        Ok(ExrLayers {
            layers: names.into_iter().zip(layers).collect(),
            attributes: provenance(&header),
            notes,
        })
    }

    /// Magic number and version field, for messages that the decoder would not give.
    fn check_signature(&self) -> Result<(), ImageError> {
        let found = match self.bytes {
            [] => "nothing (the file is empty)".to_owned(),
            bytes => bytes
                .iter()
                .take(4)
                .map(|b| format!("{b:02x}"))
                .collect::<Vec<_>>()
                .join(" "),
        };
        let magic = &exr::meta::magic_number::BYTES[..];
        if self.bytes.is_empty() || !self.bytes.starts_with(&magic[..self.bytes.len().min(4)]) {
            return Err(ImageError::NotExr {
                path: self.path.into(),
                found,
            });
        }
        let Some(flags) = self.bytes.get(5) else {
            return Err(self.truncated("the version field"));
        };
        match flags {
            f if f & 0x08 != 0 => Err(self.unsupported("deep data", "one colour a pixel")),
            f if f & 0x10 != 0 => Err(self.unsupported("several parts", "one part")),
            _ => Ok(()),
        }
    }

    /// Everything that must hold before memory for pixels is taken; returns width and height.
    fn check_header(
        &self,
        header: &Header,
        notes: &mut Vec<String>,
    ) -> Result<(usize, usize), ImageError> {
        let Vec2(width, height) = header.layer_size;
        if width == 0
            || height == 0
            || width > MAX_SIDE
            || height > MAX_SIDE
            || width * height > MAX_PIXELS
        {
            return Err(ImageError::Size {
                path: self.path.into(),
                found: format!("the image is {width}x{height}"),
                expected: format!("1 to {MAX_SIDE} pixels a side and at most {MAX_PIXELS} pixels"),
            });
        }
        let display = header.shared_attributes.display_window;
        let data = header.data_window();
        if data != display {
            let words = |w: exr::math::Vec2<usize>, p: Vec2<i32>| {
                format!("{}x{} at ({}, {})", w.0, w.1, p.0, p.1)
            };
            return Err(ImageError::Windows {
                path: self.path.into(),
                data: words(data.size, data.position),
                display: words(display.size, display.position),
            });
        }
        if data.position != Vec2(0, 0) {
            notes.push(format!(
                "both windows start at ({}, {}) instead of (0, 0)",
                data.position.0, data.position.1
            ));
        }
        if let BlockDescription::Tiles(tiles) = header.blocks {
            if tiles.level_mode != LevelMode::Singular {
                return Err(self.unsupported("several resolution levels", "full resolution only"));
            }
            if tiles.tile_size.0 > MAX_SIDE || tiles.tile_size.1 > MAX_SIDE {
                return Err(self.malformed(format!(
                    "tiles of {}x{} pixels",
                    tiles.tile_size.0, tiles.tile_size.1
                )));
            }
        }
        use Compression::{PIZ, RLE, Uncompressed, ZIP1, ZIP16};
        if !matches!(header.compression, Uncompressed | RLE | ZIP1 | ZIP16 | PIZ) {
            return Err(self.unsupported(&header.compression.to_string(), "none, RLE, ZIP or PIZ"));
        }
        if header.channels.list.len() > MAX_CHANNELS {
            return Err(self.unsupported(
                &format!("{} channels", header.channels.list.len()),
                "R, G and B",
            ));
        }
        let pixel_bytes = width * height * header.channels.bytes_per_pixel;
        let least = 8 * header.chunk_count
            + if header.compression == Uncompressed {
                pixel_bytes
            } else {
                pixel_bytes / MAX_COMPRESSION_RATIO
            };
        if self.bytes.len() < least {
            return Err(self.truncated(&format!(
                "the pixels of a {width}x{height} image, which take {least} bytes or more"
            )));
        }
        Ok((width, height))
    }

    /// Finds R, G, B of each layer; `targets` has one entry per channel of the file.
    fn assign_channels(
        &self,
        channels: &ChannelList,
        notes: &mut Vec<String>,
    ) -> Result<(Vec<String>, Vec<Option<Target>>), ImageError> {
        let all: Vec<String> = channels.list.iter().map(|c| c.name.to_string()).collect();
        let has = |layer: &str, c: &str| all.iter().any(|name| split_channel(name) == (layer, c));
        let mut layers: Vec<&str> = all.iter().map(|name| split_channel(name).0).collect();
        layers.sort_unstable();
        layers.dedup();
        layers.retain(|layer| ["R", "G", "B"].iter().any(|c| has(layer, c)));
        if layers.is_empty() {
            return Err(match all.iter().any(|name| name == "Y") {
                true => ImageError::LuminanceOnly {
                    path: self.path.into(),
                },
                false => self.missing_channel("R", &all),
            });
        }
        for layer in &layers {
            for c in ["R", "G", "B"] {
                if !has(layer, c) {
                    let full = if layer.is_empty() {
                        c.to_owned()
                    } else {
                        format!("{layer}.{c}")
                    };
                    return Err(self.missing_channel(&full, &all));
                }
            }
        }
        let mut targets = Vec::with_capacity(all.len());
        for (channel, name) in channels.list.iter().zip(&all) {
            let (layer, component) = split_channel(name);
            let place = ["R", "G", "B"]
                .iter()
                .position(|c| *c == component)
                .zip(layers.binary_search(&layer).ok());
            // Subsampled channels have been refused with the header.
            if place.is_some() && channel.sample_type == SampleType::U32 {
                return Err(
                    self.unsupported(&format!("channel {name} holds integers"), "half or float")
                );
            }
            if place.is_none() {
                notes.push(format!("channel {name} is ignored"));
            }
            targets.push(place.map(|(component, layer)| Target { layer, component }));
        }
        Ok((layers.into_iter().map(str::to_owned).collect(), targets))
    }

    /// Copies the samples of one decoded block into the images.
    fn place(
        &self,
        block: &UncompressedBlock,
        channels: &ChannelList,
        targets: &[Option<Target>],
        layers: &mut [Image],
    ) -> Result<(), ImageError> {
        let Vec2(columns, rows) = block.index.pixel_size;
        if block.data.len() != columns * rows * channels.bytes_per_pixel {
            return Err(self.malformed(format!(
                "a pixel block of {} bytes for {columns}x{rows} pixels",
                block.data.len()
            )));
        }
        for line in block.lines(channels) {
            let Some(target) = &targets[line.location.channel] else {
                continue;
            };
            let image = &mut layers[target.layer];
            let Vec2(x, y) = line.location.position;
            let start = y * image.width + x;
            let row = &mut image.pixels[start..start + line.location.sample_count];
            match channels.list[line.location.channel].sample_type {
                SampleType::F16 => {
                    for (pixel, b) in row.iter_mut().zip(line.value.chunks_exact(2)) {
                        pixel[target.component] = f16::from_ne_bytes([b[0], b[1]]).to_f32();
                    }
                }
                _ => {
                    for (pixel, b) in row.iter_mut().zip(line.value.chunks_exact(4)) {
                        pixel[target.component] = f32::from_ne_bytes([b[0], b[1], b[2], b[3]]);
                    }
                }
            }
        }
        Ok(())
    }

    fn error(&self, error: exr::error::Error, place: &str) -> ImageError {
        match error {
            // The crate's only name for an unexpected end of file.
            exr::error::Error::Invalid(what) if what == "reference to missing bytes" => {
                self.truncated(place)
            }
            exr::error::Error::NotSupported(what) => {
                self.unsupported(&what, "R, G and B in scan lines, each for every pixel")
            }
            other => self.malformed(format!("{place}: {other}")),
        }
    }

    fn truncated(&self, missing: &str) -> ImageError {
        ImageError::Truncated {
            path: self.path.into(),
            found_bytes: self.bytes.len() as u64,
            missing: missing.into(),
        }
    }

    fn unsupported(&self, what: &str, expected: &str) -> ImageError {
        ImageError::Unsupported {
            path: self.path.into(),
            what: what.into(),
            expected: expected.into(),
        }
    }

    fn malformed(&self, what: String) -> ImageError {
        ImageError::Malformed {
            path: self.path.into(),
            what,
        }
    }

    fn missing_channel(&self, channel: &str, all: &[String]) -> ImageError {
        ImageError::MissingChannel {
            path: self.path.into(),
            channel: channel.into(),
            found: all.join(", "),
        }
    }
}

/// The `name = text` lines of a file's `comments`.
fn provenance(header: &Header) -> BTreeMap<String, String> {
    let comments = header
        .own_attributes
        .comments
        .as_ref()
        .map(Text::to_string)
        .unwrap_or_default();
    comments
        .lines()
        .filter_map(|l| l.split_once(" = "))
        .map(|(k, v)| (k.to_owned(), v.to_owned()))
        .collect()
}

/// One part with the channels of all layers.
fn encode(
    layers: &[(&str, &Image)],
    attributes: &BTreeMap<String, String>,
    precision: Precision,
    compression: Compression,
    path: &Path,
) -> Result<Vec<u8>, ImageError> {
    let unwritable = |what: String| ImageError::Unwritable {
        path: path.into(),
        what,
    };
    let &(_, first) = layers
        .first()
        .ok_or_else(|| unwritable("there is no image".into()))?;
    let (width, height) = (first.width, first.height);
    if width == 0
        || height == 0
        || width > MAX_SIDE
        || height > MAX_SIDE
        || width * height > MAX_PIXELS
    {
        return Err(unwritable(format!("the image is {width}x{height}")));
    }
    // The format wants channels sorted by name: B, G, R within a layer.
    let mut channels = Vec::new();
    for &(layer, image) in layers {
        if (image.width, image.height, image.pixels.len()) != (width, height, width * height) {
            return Err(unwritable(format!(
                "layer \"{layer}\" is not {width}x{height}"
            )));
        }
        for (component, letter) in ["R", "G", "B"].into_iter().enumerate() {
            let name = if layer.is_empty() {
                letter.to_owned()
            } else {
                format!("{layer}.{letter}")
            };
            if !name.bytes().all(|b| b.is_ascii_graphic()) {
                return Err(unwritable(format!("\"{layer}\" is no name for a layer")));
            }
            channels.push((name, image, component));
        }
    }
    channels.sort_by(|a, b| a.0.cmp(&b.0));

    let sample_type = match precision {
        Precision::Half => SampleType::F16,
        Precision::Float => SampleType::F32,
    };
    let described = channels.iter().map(|(name, ..)| {
        ChannelDescription::new(
            Text::new_or_none(name).unwrap_or_default(),
            sample_type,
            false,
        )
    });
    let mut header = Header::new(
        Text::default(),
        (width, height),
        described.collect::<SmallVec<[_; 5]>>(),
    )
    .with_encoding(
        compression,
        BlockDescription::ScanLines,
        LineOrder::Increasing,
    );
    header.own_attributes.layer_name = None;
    header.own_attributes.software_name = Text::new_or_none("umbra");
    if !attributes.is_empty() {
        header.own_attributes.comments = Some(comments(attributes).map_err(unwritable)?);
    }

    let mut file = Cursor::new(Vec::new());
    let headers: exr::meta::Headers = std::iter::once(header).collect();
    block::write(&mut file, headers, true, |meta, writer| {
        for (index, position) in block::enumerate_ordered_header_block_indices(&meta.headers) {
            let block =
                UncompressedBlock::from_lines(&meta.headers[0].channels, position, |line| {
                    let (_, image, component) = &channels[line.location.channel];
                    let Vec2(x, y) = line.location.position;
                    let start = y * width + x;
                    store(
                        &image.pixels[start..start + line.location.sample_count],
                        *component,
                        precision,
                        line.value,
                    );
                });
            writer.write_chunk(index, block.compress_to_chunk(&meta.headers)?)?;
        }
        Ok(())
    })
    .map_err(|e| unwritable(e.to_string()))?;
    Ok(file.into_inner())
}

/// One component of a row of pixels as the file's samples.
fn store(row: &[Vec3], component: usize, precision: Precision, out: &mut [u8]) {
    match precision {
        Precision::Half => {
            for (pixel, sample) in row.iter().zip(out.chunks_exact_mut(2)) {
                sample.copy_from_slice(&f16::from_f32(pixel[component]).to_ne_bytes());
            }
        }
        Precision::Float => {
            for (pixel, sample) in row.iter().zip(out.chunks_exact_mut(4)) {
                sample.copy_from_slice(&pixel[component].to_ne_bytes());
            }
        }
    }
}

/// All attributes as `name = text` lines: one standard attribute keeps the file the same, byte for byte.
fn comments(attributes: &BTreeMap<String, String>) -> Result<Text, String> {
    let mut lines = String::new();
    for (name, text) in attributes {
        if name.is_empty() || name.contains(['=', '\n', '\r']) || text.contains(['\n', '\r']) {
            return Err(format!(
                "attribute \"{name}\" is not one line of text, or has no plain name"
            ));
        }
        lines += &format!("{name} = {text}\n");
    }
    Text::new_or_none(&lines).ok_or_else(|| "an attribute holds characters outside Latin-1".into())
}
