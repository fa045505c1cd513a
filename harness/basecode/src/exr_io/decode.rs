//! The way in: header first, then pixels.

use std::collections::{BTreeMap, HashSet};
use std::io::Cursor;
use std::path::Path;

use exr::block::{self, UncompressedBlock, reader::ChunksReader};
use exr::compression::Compression;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelList, LevelMode, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::{Vec2, f16};

use super::{ExrLayers, ImageError, MAX_PIXELS, MAX_SIDE};
use crate::image::Image;

/// The most channels a file may hold.
const MAX_CHANNELS: usize = 64;
/// No codec of the format shrinks pixels more than deflate can: 1032 to 1 (zlib's technical notes).
const MAX_COMPRESSION_RATIO: usize = 1032;

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
pub(super) struct Decoder<'a> {
    pub bytes: &'a [u8],
    pub path: &'a Path,
}

impl Decoder<'_> {
    pub fn decode(&self) -> Result<ExrLayers, ImageError> {
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
        let chunks = reader.all_chunks(false).map_err(|e| self.error(e, "the offset table"))?;
        let blocks = chunks.sequential_decompressor(false);
        let mut seen = HashSet::new();
        for block in blocks {
            let block = block.map_err(|e| {
                self.error(e, &format!("pixel block {} of {}", seen.len() + 1, header.chunk_count))
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
            chromaticities: header
                .shared_attributes
                .chromaticities
                .map(|c| [c.red, c.green, c.blue, c.white].map(|Vec2(x, y)| [x, y])),
            attributes: provenance(&header),
            notes,
        })
    }

    /// Magic number and version field, for messages that the decoder would not give.
    fn check_signature(&self) -> Result<(), ImageError> {
        let found = match self.bytes {
            [] => "nothing (the file is empty)".to_owned(),
            bytes => {
                let start: Vec<String> = bytes.iter().take(4).map(|b| format!("{b:02x}")).collect();
                let start = start.join(" ");
                kind_of(bytes).map_or(start.clone(), |kind| format!("{start}, as {kind}"))
            }
        };
        let magic = &exr::meta::magic_number::BYTES[..];
        if self.bytes.is_empty() || !self.bytes.starts_with(&magic[..self.bytes.len().min(4)]) {
            return Err(ImageError::NotExr { path: self.path.into(), found });
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
            let words =
                |w: Vec2<usize>, p: Vec2<i32>| format!("{}x{} at ({}, {})", w.0, w.1, p.0, p.1);
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
            return Err(
                self.unsupported(&format!("{} channels", header.channels.list.len()), "R, G and B")
            );
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
            let of_luminance = |name: &String| ["Y", "RY", "BY", "A"].contains(&name.as_str());
            return Err(match all.iter().any(|name| name == "Y") && all.iter().all(of_luminance) {
                true => ImageError::LuminanceOnly { path: self.path.into() },
                false => self.missing_channel("R", &all),
            });
        }
        for layer in &layers {
            for c in ["R", "G", "B"] {
                if !has(layer, c) {
                    let full = if layer.is_empty() { c.to_owned() } else { format!("{layer}.{c}") };
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
        ImageError::Malformed { path: self.path.into(), what }
    }

    fn missing_channel(&self, channel: &str, all: &[String]) -> ImageError {
        ImageError::MissingChannel {
            path: self.path.into(),
            channel: channel.into(),
            found: all.join(", "),
        }
    }
}

/// What a file is by its first bytes, when it is no EXR.
fn kind_of(bytes: &[u8]) -> Option<&'static str> {
    const KINDS: [(&[u8], &str); 15] = [
        (b"\x89PNG", "a PNG image does"),
        (b"\xff\xd8\xff", "a JPEG image does"),
        (b"#?RA", "a Radiance HDR image does"),
        (b"#?RGBE", "a Radiance HDR image does"),
        (b"PF\n", "a PFM image does"),
        (b"Pf\n", "a PFM image does"),
        (b"P6", "a PPM image does"),
        (b"II*\0", "a TIFF image does"),
        (b"MM\0*", "a TIFF image does"),
        (b"GIF8", "a GIF image does"),
        (b"BM", "a BMP image does"),
        (b"PK\x03\x04", "a zip archive does"),
        (b"\x1f\x8b", "gzip data do"),
        (b"<", "a web page does"),
        (b"version https://git-lfs", "the pointer does that Git LFS leaves in a file's place"),
    ];
    KINDS.iter().find(|(start, _)| bytes.starts_with(start)).map(|(_, kind)| *kind)
}

/// The `name = text` lines of a file's `comments`.
fn provenance(header: &Header) -> BTreeMap<String, String> {
    let comments = header.own_attributes.comments.as_ref().map(Text::to_string).unwrap_or_default();
    comments
        .lines()
        .filter_map(|l| l.split_once(" = "))
        .map(|(k, v)| (k.to_owned(), v.to_owned()))
        .collect()
}
