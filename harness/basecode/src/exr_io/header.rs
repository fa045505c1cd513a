//! The header of an OpenEXR file, checked before memory for pixels is allocated.

use std::collections::BTreeMap;
use std::path::Path;

use exr::compression::Compression;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelList, IntegerBounds, LevelMode, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::Vec2;

use super::attributes::{DEEP, Hidden, PARTS};
use super::{ImageError, MAX_PIXELS, MAX_SIDE};

/// The most channels a file may hold.
const MAX_CHANNELS: usize = 1024;
/// No codec that is read shrinks pixels more: deflate 1032 to 1 (zlib's technical notes), after PXR24 has made three
/// bytes of four.
const MAX_COMPRESSION_RATIO: usize = 1376;

/// What is not read, and what is expected in its place.
const DEEP_DATA: (&str, &str) = ("deep data", "one colour a pixel");

/// What is read.
const COMPRESSIONS: &str = "none, RLE, ZIP, PIZ, PXR24 or B44";

/// The components of a color, in the order of an [`crate::Image`]'s pixels.
const RGB: [&str; 3] = ["R", "G", "B"];

/// A name as a message shows it: without characters that act on a terminal or end a line.
pub(super) fn visible(name: &str) -> String {
    let shown = |c: char| match c.is_control() {
        true => c.escape_default().collect(),
        false => String::from(c),
    };
    name.chars().map(shown).collect()
}

/// The name of a channel: UTF-8, as OpenEXR writes it, or else Latin-1.
pub(super) fn name_of(name: &Text) -> String {
    String::from_utf8(name.bytes().to_vec()).unwrap_or_else(|_| name.to_string())
}

/// Splits `mean.R` into (`mean`, `R`) and `R` into (``, `R`): EXR's convention for layers.
fn split_channel(name: &str) -> (&str, &str) {
    name.rsplit_once('.').unwrap_or(("", name))
}

/// The layers of a file: their names, sorted, and the channels that hold their R, G and B.
pub(super) type Channels = Vec<(String, [usize; 3])>;

/// Where the stored pixels lie in the picture.
pub(super) struct Placed {
    /// Size of the picture.
    pub width: usize,
    pub height: usize,
    /// Its first column and row in the plane of all images.
    pub origin: [i32; 2],
    /// The column and row of the first stored pixel.
    pub at: [usize; 2],
    /// The columns and rows that are stored.
    pub stored: [usize; 2],
}

impl Placed {
    /// A picture of which all is stored.
    fn of(data: IntegerBounds) -> Self {
        let Vec2(width, height) = data.size;
        let origin = [data.position.0, data.position.1];
        Self { width, height, origin, at: [0, 0], stored: [width, height] }
    }

    /// The smallest picture with all that is stored and all that is to be shown, or, if that were too large, all that
    /// is stored.
    fn within(data: IntegerBounds, display: IntegerBounds) -> Self {
        let start = |axis: fn(Vec2<i32>) -> i32| axis(data.position).min(axis(display.position));
        let end = |at: i32, size: usize| i64::from(at) + size as i64;
        let span = |start: i32, a: i64, b: i64| (a.max(b) - i64::from(start)) as usize;
        let (left, top) = (start(|p| p.0), start(|p| p.1));
        let width =
            span(left, end(data.position.0, data.size.0), end(display.position.0, display.size.0));
        let height =
            span(top, end(data.position.1, data.size.1), end(display.position.1, display.size.1));
        if !fits(width, height) {
            return Self::of(data);
        }
        let offset = |at: i32, start: i32| (i64::from(at) - i64::from(start)) as usize;
        Self {
            width,
            height,
            origin: [left, top],
            at: [offset(data.position.0, left), offset(data.position.1, top)],
            stored: [data.size.0, data.size.1],
        }
    }

    /// Whether some of the picture is not stored.
    pub(super) fn has_margin(&self) -> bool {
        self.stored != [self.width, self.height]
    }
}

/// Whether an image has pixels, and not too many.
fn fits(width: usize, height: usize) -> bool {
    (1..=MAX_SIDE).contains(&width)
        && (1..=MAX_SIDE).contains(&height)
        && width * height <= MAX_PIXELS
}

/// A window in words.
fn words(window: IntegerBounds) -> String {
    let (Vec2(width, height), Vec2(x, y)) = (window.size, window.position);
    format!("{width}x{height} at ({x}, {y})")
}

/// The layers that hold luminance: their names, and the channels of red, green and blue, counted on after those of the
/// file where they are computed of chroma; and of each of those the channels Y, RY and BY.
pub(super) fn luminance_layers(channels: &ChannelList) -> (Channels, Vec<[usize; 3]>) {
    let names: Vec<String> = channels.list.iter().map(|c| name_of(&c.name)).collect();
    let (mut layers, mut chroma) = (Channels::new(), Vec::new());
    let find = |layer: &str, component: &str| {
        let at = names.iter().position(|name| split_channel(name) == (layer, component));
        at.filter(|&at| channels.list[at].sample_type != SampleType::U32)
    };
    for name in &names {
        let (layer, component) = split_channel(name);
        let Some(y) = find(layer, "Y").filter(|_| component == "Y") else { continue };
        match (find(layer, "RY"), find(layer, "BY")) {
            (Some(ry), Some(by)) => {
                let first = names.len() + 3 * chroma.len();
                layers.push((layer.to_owned(), [first, first + 1, first + 2]));
                chroma.push([y, ry, by]);
            }
            // Coordinates and vectors have a Y too.
            _ if find(layer, "X").is_none() => layers.push((layer.to_owned(), [y; 3])),
            _ => {}
        }
    }
    (layers, chroma)
}

/// A file that is being read, for checks and messages.
pub(super) struct Checks<'a> {
    pub path: &'a Path,
    pub file_bytes: u64,
}

impl Checks<'_> {
    /// Magic number and version field, of the first bytes, for messages that the decoder would not give.
    /// `refused` are flags of [`super::attributes`].
    pub(super) fn signature(&self, start: &[u8], refused: u8) -> Result<(), ImageError> {
        let found = match start {
            [] => "nothing (the file is empty)".to_owned(),
            bytes => {
                let first: Vec<String> = bytes.iter().take(4).map(|b| format!("{b:02x}")).collect();
                let first = first.join(" ");
                kind_of(bytes).map_or(first.clone(), |kind| format!("{first}, as {kind}"))
            }
        };
        let magic = &exr::meta::magic_number::BYTES[..];
        if start.is_empty() || !start.starts_with(&magic[..start.len().min(4)]) {
            return Err(ImageError::NotExr { path: self.path.into(), found });
        }
        let Some(flags) = start.get(5) else {
            return Err(self.truncated("the version field"));
        };
        match flags & refused {
            f if f & DEEP != 0 => Err(self.unsupported(DEEP_DATA.0, DEEP_DATA.1)),
            f if f & PARTS != 0 => Err(self.unsupported("several parts", "one part")),
            _ => Ok(()),
        }
    }

    /// A window must not end before it starts; the decoder would turn it round.
    pub(super) fn windows(&self, header: &[u8]) -> Result<(), ImageError> {
        for (name, what) in [("dataWindow", "data"), ("displayWindow", "display")] {
            let attribute = [name.as_bytes(), b"\0box2i\0\x10\0\0\0"].concat();
            let at = header.windows(attribute.len()).position(|bytes| bytes == attribute);
            let Some(value) = at.and_then(|at| header.get(at + attribute.len()..)) else {
                continue;
            };
            let [left, top, right, bottom] = [0, 1, 2, 3]
                .map(|i| value.as_chunks::<4>().0.get(i).map(|b| i32::from_le_bytes(*b)));
            if let (Some(left), Some(top), Some(right), Some(bottom)) = (left, top, right, bottom)
                && (right < left || bottom < top)
            {
                return Err(self.malformed(format!(
                    "the {what} window ends at ({right}, {bottom}), before it starts at ({left}, {top})"
                )));
            }
        }
        Ok(())
    }

    /// Everything that must hold before memory for pixels is taken.
    pub(super) fn header(
        &self,
        header: &Header,
        notes: &mut Vec<String>,
    ) -> Result<Placed, ImageError> {
        let (data, display) = (header.data_window(), header.shared_attributes.display_window);
        self.size(header)?;
        if data != display {
            let (data, display) = (words(data), words(display));
            return Err(ImageError::Windows { path: self.path.into(), data, display });
        }
        if data.position != Vec2(0, 0) {
            notes.push(format!(
                "both windows start at ({}, {}) instead of (0, 0)",
                data.position.0, data.position.1
            ));
        }
        if let BlockDescription::Tiles(tiles) = header.blocks
            && tiles.level_mode != LevelMode::Singular
        {
            return Err(self.unsupported("several resolution levels", "full resolution only"));
        }
        self.pixels(header, header.channels.bytes_per_pixel * data.size.area())?;
        Ok(Placed::of(data))
    }

    /// As [`Checks::header`], of a part of any kind.
    pub(super) fn any_header(
        &self,
        header: &Header,
        hidden: &Hidden,
        notes: &mut Vec<String>,
    ) -> Result<Placed, ImageError> {
        if hidden.deep {
            return Err(self.unsupported(DEEP_DATA.0, DEEP_DATA.1));
        }
        self.size(header)?;
        let (data, display) = (header.data_window(), header.shared_attributes.display_window);
        if let BlockDescription::Tiles(tiles) = header.blocks
            && tiles.level_mode != LevelMode::Singular
        {
            notes.push("only the full one of several resolutions is read".into());
        }
        let mut bytes = 0;
        for (channel, factors) in header.channels.list.iter().zip(&hidden.sampling) {
            let name = || visible(&name_of(&channel.name));
            let [across, down] = *factors;
            if *factors != [1, 1] {
                notes.push(format!("channel {} has a sample for {across}x{down} pixels", name()));
                let whole = |at: i32, size: usize, factor: usize| {
                    i64::from(at) % factor as i64 == 0 && size.is_multiple_of(factor)
                };
                let (Vec2(x, y), Vec2(width, height)) = (data.position, data.size);
                if !whole(x, width, across) || !whole(y, height, down) {
                    let what = format!(
                        "channel {} has a sample for {across}x{down} pixels of {}",
                        name(),
                        words(data)
                    );
                    return Err(self.malformed(what));
                }
                // The decoder has them wrong.
                use Compression::{RLE, Uncompressed, ZIP1, ZIP16};
                if !matches!(header.compression, Uncompressed | RLE | ZIP1 | ZIP16)
                    || header.blocks != BlockDescription::ScanLines
                {
                    let what = format!("channel {} is subsampled, {}", name(), header.compression);
                    return Err(
                        self.unsupported(&what, "scan lines, compressed by none, RLE or ZIP")
                    );
                }
            }
            bytes += channel.sample_type.bytes_per_sample() * data.size.area() / (across * down);
        }
        self.pixels(header, bytes)?;
        let placed = Placed::within(data, display);
        if data != display {
            let margin = match placed.has_margin() {
                true => "; pixels that are not stored are black",
                false => "; all stored pixels are taken",
            };
            let (data, display) = (words(data), words(display));
            notes.push(format!("the pixels cover {data}, the picture is {display}{margin}"));
        }
        Ok(placed)
    }

    /// The stored pixels must be some, and not too many.
    fn size(&self, header: &Header) -> Result<(), ImageError> {
        let Vec2(width, height) = header.layer_size;
        if fits(width, height) {
            return Ok(());
        }
        Err(ImageError::Size {
            path: self.path.into(),
            found: format!("the image is {width}x{height}"),
            expected: format!("1 to {MAX_SIDE} pixels a side and at most {MAX_PIXELS} pixels"),
        })
    }

    /// The channels and how they are stored, in so many bytes before compression.
    fn pixels(&self, header: &Header, pixel_bytes: usize) -> Result<(), ImageError> {
        if let BlockDescription::Tiles(tiles) = header.blocks
            && (tiles.tile_size.0 > MAX_SIDE || tiles.tile_size.1 > MAX_SIDE)
        {
            return Err(self.malformed(format!(
                "tiles of {}x{} pixels",
                tiles.tile_size.0, tiles.tile_size.1
            )));
        }
        let mut names = header.channels.list.windows(2);
        if let Some([twice, _]) = names.find(|pair| pair[0].name == pair[1].name) {
            let name = visible(&name_of(&twice.name));
            return Err(self.malformed(format!("channel {name} is listed twice")));
        }
        use Compression::{B44, B44A, PIZ, PXR24, RLE, Uncompressed, ZIP1, ZIP16};
        if !matches!(
            header.compression,
            Uncompressed | RLE | ZIP1 | ZIP16 | PIZ | PXR24 | B44 | B44A
        ) {
            let found = header.compression.to_string();
            return Err(self.unsupported(&found, COMPRESSIONS));
        }
        if header.channels.list.len() > MAX_CHANNELS {
            let found = format!("{} channels", header.channels.list.len());
            return Err(self.unsupported(&found, &format!("at most {MAX_CHANNELS}")));
        }
        let least = 8 * header.chunk_count
            + if header.compression == Uncompressed {
                pixel_bytes
            } else {
                pixel_bytes / MAX_COMPRESSION_RATIO
            };
        if self.file_bytes < least as u64 {
            let Vec2(width, height) = header.layer_size;
            return Err(self.truncated(&format!(
                "the pixels of a {width}x{height} image, which take {least} bytes or more"
            )));
        }
        Ok(())
    }

    /// Finds R, G and B of each layer. What cannot be a color image is ignored, with a note, where another layer can.
    pub(super) fn layers(
        &self,
        channels: &ChannelList,
        notes: &mut Vec<String>,
    ) -> Result<Channels, ImageError> {
        let all: Vec<String> = channels.list.iter().map(|c| name_of(&c.name)).collect();
        let mut names: Vec<&str> = all.iter().map(|name| split_channel(name).0).collect();
        names.sort_unstable();
        names.dedup();
        let is_in = |layer: &str, c: &str| all.iter().any(|name| split_channel(name) == (layer, c));
        names.retain(|layer| RGB.iter().any(|c| is_in(layer, c)));
        if names.is_empty() {
            let of_luminance = |name: &String| ["Y", "RY", "BY", "A"].contains(&name.as_str());
            return Err(match all.iter().any(|name| name == "Y") && all.iter().all(of_luminance) {
                true => ImageError::LuminanceOnly { path: self.path.into() },
                false => self.missing_channel("R", &all),
            });
        }
        let mut layers = Vec::with_capacity(names.len());
        let mut ignored = Vec::new();
        for layer in names {
            match self.colors(layer, channels) {
                Ok(found) => layers.push((layer.to_owned(), found)),
                Err(error) => ignored.push((layer, error)),
            }
        }
        if layers.is_empty() && !ignored.is_empty() {
            return Err(ignored.swap_remove(0).1);
        }
        for (index, name) in all.iter().enumerate() {
            let (layer, component) = split_channel(name);
            let of_ignored =
                RGB.contains(&component) && ignored.iter().any(|(own, _)| *own == layer);
            // Subsampled channels have been refused with the header.
            if !of_ignored && !layers.iter().any(|(_, found)| found.contains(&index)) {
                notes.push(format!("channel {} is ignored", visible(name)));
            }
        }
        for (layer, error) in ignored {
            let layer = if layer.is_empty() { "without a name".to_owned() } else { visible(layer) };
            let why = match error {
                ImageError::MissingChannel { channel, .. } => format!("no channel {channel}"),
                ImageError::Unsupported { what, .. } => what,
                other => other.to_string(),
            };
            notes.push(format!("layer {layer} is ignored: {why}"));
        }
        Ok(layers)
    }

    /// The channels that hold R, G and B of a layer as floats.
    pub(super) fn colors(
        &self,
        layer: &str,
        channels: &ChannelList,
    ) -> Result<[usize; 3], ImageError> {
        let all: Vec<String> = channels.list.iter().map(|c| name_of(&c.name)).collect();
        let mut found = [0; 3];
        for (index, c) in found.iter_mut().zip(RGB) {
            let at = all.iter().rposition(|name| split_channel(name) == (layer, c));
            *index = at.ok_or_else(|| {
                let full = if layer.is_empty() { c.to_owned() } else { format!("{layer}.{c}") };
                self.missing_channel(&full, &all)
            })?;
            if channels.list[*index].sample_type == SampleType::U32 {
                return Err(self.integers(&all[*index]));
            }
        }
        Ok(found)
    }

    pub(super) fn integers(&self, channel: &str) -> ImageError {
        self.unsupported(&format!("channel {} holds integers", visible(channel)), "half or float")
    }

    /// What the decoder said of a place in the file.
    pub(super) fn error(&self, error: exr::error::Error, place: &str) -> ImageError {
        match error {
            exr::error::Error::Io(source) => ImageError::Io { path: self.path.into(), source },
            // The crate's only name for an unexpected end of file.
            exr::error::Error::Invalid(what) if what == "reference to missing bytes" => {
                self.truncated(place)
            }
            exr::error::Error::NotSupported(what) => {
                let expected = match &*what {
                    what if what.contains("compression") => COMPRESSIONS,
                    what if what.contains("version") => "version 2",
                    what if what.contains("subsampling") => "R, G and B for every pixel",
                    _ => "R, G and B in scan lines",
                };
                self.unsupported(&what, expected)
            }
            other => self.malformed(format!("{place}: {other}")),
        }
    }

    pub(super) fn truncated(&self, missing: &str) -> ImageError {
        ImageError::Truncated {
            path: self.path.into(),
            found_bytes: self.file_bytes,
            missing: missing.into(),
        }
    }

    pub(super) fn unsupported(&self, what: &str, expected: &str) -> ImageError {
        ImageError::Unsupported {
            path: self.path.into(),
            what: what.into(),
            expected: expected.into(),
        }
    }

    pub(super) fn malformed(&self, what: String) -> ImageError {
        ImageError::Malformed { path: self.path.into(), what }
    }

    fn missing_channel(&self, channel: &str, all: &[String]) -> ImageError {
        ImageError::MissingChannel {
            path: self.path.into(),
            channel: visible(channel),
            found: visible(&all.join(", ")),
        }
    }
}

/// The `name = text` lines of a file's `comments`.
pub(super) fn provenance(header: &Header) -> BTreeMap<String, String> {
    let comments = header.own_attributes.comments.as_ref().map(Text::to_string).unwrap_or_default();
    comments
        .lines()
        .filter_map(|l| l.split_once(" = "))
        .map(|(k, v)| (k.to_owned(), v.to_owned()))
        .collect()
}

/// The format that the first bytes of a file suggest, if it is not an EXR.
pub(crate) fn kind_of(bytes: &[u8]) -> Option<&'static str> {
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
