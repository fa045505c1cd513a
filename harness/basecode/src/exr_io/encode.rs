//! Writing OpenEXR files.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use exr::block::{self, UncompressedBlock, writer::ChunksWriter};
use exr::compression::Compression;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, LineOrder, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::{SmallVec, Vec2, f16};

use super::{ImageError, MAX_PIXELS, MAX_SIDE, Precision};
use crate::image::Image;

/// A channel: its name, and what puts the samples of pixels (from, how many) into a line of the file.
type Channel<'a> = (String, Box<dyn Fn(usize, usize, &mut [u8]) + 'a>);

/// One part with the channels of all layers.
pub(super) fn encode(
    layers: &[(&str, &Image)],
    attributes: &BTreeMap<String, String>,
    precision: Precision,
    compression: Compression,
    path: &Path,
) -> Result<Vec<u8>, ImageError> {
    let unwritable = |what: String| ImageError::Unwritable { path: path.into(), what };
    let &(_, first) = layers.first().ok_or_else(|| unwritable("there is no image".into()))?;
    let (width, height) = (first.width, first.height);
    let mut channels: Vec<Channel> = Vec::new();
    for &(layer, image) in layers {
        if (image.width, image.height, image.pixels.len()) != (width, height, width * height) {
            return Err(unwritable(format!("layer \"{layer}\" is not {width}x{height}")));
        }
        for (component, letter) in ["R", "G", "B"].into_iter().enumerate() {
            let name =
                if layer.is_empty() { letter.to_owned() } else { format!("{layer}.{letter}") };
            if !name.bytes().all(|b| b.is_ascii_graphic()) {
                return Err(unwritable(format!("\"{layer}\" is no name for a layer")));
            }
            let put = move |start: usize, count: usize, out: &mut [u8]| {
                store(
                    image.pixels[start..start + count].iter().map(|p| p[component]),
                    precision,
                    out,
                );
            };
            channels.push((name, Box::new(put)));
        }
    }
    write(channels, ([0, 0], width, height), attributes, precision, compression, path)
}

/// One part, uncompressed, with these channels of 32-bit floats, each as long as the others, from this pixel on.
pub(super) fn encode_channels(
    origin: [i32; 2],
    width: usize,
    planes: &[(&str, Vec<f32>)],
    path: &Path,
) -> Result<Vec<u8>, ImageError> {
    let unwritable = |what: &str| ImageError::Unwritable { path: path.into(), what: what.into() };
    let (_, first) = planes.first().ok_or_else(|| unwritable("there is no channel"))?;
    let height = first.len().checked_div(width).unwrap_or_default();
    if planes.iter().any(|(_, plane)| plane.len() != width * height) {
        return Err(unwritable("its channels are not of one size"));
    }
    let mut channels: Vec<Channel> = Vec::new();
    for (name, plane) in planes {
        let put = move |start: usize, count: usize, out: &mut [u8]| {
            store(plane[start..start + count].iter().copied(), Precision::Float, out);
        };
        channels.push(((*name).to_owned(), Box::new(put)));
    }
    let (place, attributes) = ((origin, width, height), BTreeMap::new());
    write(channels, place, &attributes, Precision::Float, Compression::Uncompressed, path)
}

fn write(
    mut channels: Vec<Channel>,
    ([left, top], width, height): ([i32; 2], usize, usize),
    attributes: &BTreeMap<String, String>,
    precision: Precision,
    compression: Compression,
    path: &Path,
) -> Result<Vec<u8>, ImageError> {
    let unwritable = |what: String| ImageError::Unwritable { path: path.into(), what };
    if width == 0
        || height == 0
        || width > MAX_SIDE
        || height > MAX_SIDE
        || width * height > MAX_PIXELS
    {
        return Err(unwritable(format!("the image is {width}x{height}")));
    }
    // The format wants channels sorted by name: B, G, R within a layer.
    channels.sort_by(|a, b| a.0.cmp(&b.0));

    let sample_type = match precision {
        Precision::Half => SampleType::F16,
        Precision::Float => SampleType::F32,
    };
    let described = channels.iter().map(|(name, _)| {
        ChannelDescription::new(Text::new_or_none(name).unwrap_or_default(), sample_type, false)
    });
    let mut header =
        Header::new(Text::default(), (width, height), described.collect::<SmallVec<[_; 5]>>())
            .with_encoding(compression, BlockDescription::ScanLines, LineOrder::Increasing)
            .with_position(Vec2(left, top));
    header.shared_attributes.display_window.position = Vec2(left, top);
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
                    let Vec2(x, y) = line.location.position;
                    let (_, put) = &channels[line.location.channel];
                    put(y * width + x, line.location.sample_count, line.value);
                });
            writer.write_chunk(index, block.compress_to_chunk(&meta.headers)?)?;
        }
        Ok(())
    })
    .map_err(|e| unwritable(e.to_string()))?;
    Ok(file.into_inner())
}

/// Values as the file's samples.
fn store(values: impl Iterator<Item = f32>, precision: Precision, out: &mut [u8]) {
    match precision {
        Precision::Half => {
            for (value, sample) in values.zip(out.chunks_exact_mut(2)) {
                sample.copy_from_slice(&f16::from_f32(value).to_ne_bytes());
            }
        }
        Precision::Float => {
            for (value, sample) in values.zip(out.chunks_exact_mut(4)) {
                sample.copy_from_slice(&value.to_ne_bytes());
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
