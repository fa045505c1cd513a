//! The way out.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use exr::block::{self, UncompressedBlock, writer::ChunksWriter};
use exr::compression::Compression;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, LineOrder, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::{SmallVec, Vec2, f16};
use glam::Vec3;

use super::{ImageError, MAX_PIXELS, MAX_SIDE, Precision};
use crate::image::Image;

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
            return Err(unwritable(format!("layer \"{layer}\" is not {width}x{height}")));
        }
        for (component, letter) in ["R", "G", "B"].into_iter().enumerate() {
            let name =
                if layer.is_empty() { letter.to_owned() } else { format!("{layer}.{letter}") };
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
        ChannelDescription::new(Text::new_or_none(name).unwrap_or_default(), sample_type, false)
    });
    let mut header =
        Header::new(Text::default(), (width, height), described.collect::<SmallVec<[_; 5]>>())
            .with_encoding(compression, BlockDescription::ScanLines, LineOrder::Increasing);
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
