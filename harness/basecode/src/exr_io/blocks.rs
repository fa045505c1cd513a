//! Where the pixels lie in an EXR file.

use std::io;
use std::ops::Range;

use exr::block::chunk::{
    CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates,
};
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::IntegerBounds;
use exr::meta::header::Header;

use super::ImageError;
use super::header::Checks;
use super::source::Source;

/// Where a block's samples lie in the file, and in the part's own pixels.
pub(super) struct Block {
    /// Its number in the file, from 1.
    pub number: usize,
    pub at: u64,
    pub bytes: usize,
    pub place: IntegerBounds,
}

impl Block {
    /// The rows, counted from the first that the part stores.
    pub(super) fn rows(&self) -> Range<usize> {
        let top = self.place.position.y() as usize;
        top..top + self.place.size.height()
    }
}

/// A part of a file, for the walk through its blocks.
pub(super) struct Part<'a> {
    pub header: &'a Header,
    /// Whether its pixels hold any number of samples. Its blocks are passed over.
    pub deep: bool,
}

/// Walks through the blocks of a file, and returns those of each part, from top to bottom. Blocks of smaller resolution
/// levels are passed over. The table of their offsets is not needed, and often wrong.
pub(super) fn find_blocks(
    source: &Source<'_>,
    checks: &Checks<'_>,
    parts: &[Part],
    (after_header, numbered): (u64, bool),
) -> Result<Vec<Vec<Block>>, ImageError> {
    let count = parts.iter().fold(0usize, |sum, part| sum.saturating_add(part.header.chunk_count));
    if (source.len() / 8) < count as u64 {
        return Err(checks.truncated(&format!("the table of {count} pixel blocks")));
    }
    let mut at = after_header + 8 * count as u64;
    let mut found: Vec<Vec<Block>> = parts.iter().map(|_| Vec::new()).collect();
    for number in 1..=count {
        let place = || format!("pixel block {number} of {count}");
        let read = |bytes: &mut [u8], at: u64| {
            source.read(bytes, at).map_err(|error| match error.kind() {
                io::ErrorKind::UnexpectedEof => checks.truncated(&place()),
                _ => ImageError::Io { path: checks.path.into(), source: error },
            })
        };
        let mut part = [0; 4];
        if numbered {
            read(&mut part, at)?;
            at += 4;
        }
        let part = u32::from_le_bytes(part);
        let (Some(Part { header, deep }), Some(found)) =
            (parts.get(part as usize), found.get_mut(part as usize))
        else {
            return Err(checks.malformed(format!("{}: there is no part {part}", place())));
        };
        let tiles = matches!(header.blocks, BlockDescription::Tiles(_));
        if *deep {
            // The place, the bytes of a table and of samples, and their number.
            let mut head = [0; 40];
            let head = &mut head[..if tiles { 40 } else { 28 }];
            read(head, at)?;
            let sizes = head[head.len() - 24..].as_chunks::<8>().0;
            let bytes = sizes[..2].iter().try_fold(head.len() as u64, |sum, size| {
                sum.checked_add(u64::from_le_bytes(*size)).filter(|sum| *sum <= source.len())
            });
            at += bytes.ok_or_else(|| checks.truncated(&place()))?;
            continue;
        }
        let mut head = [0; 20];
        let head = if tiles { &mut head[..] } else { &mut head[..8] };
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
        let placed = header.get_block_data_indices(&block).and_then(|indices| {
            let place = header.get_absolute_block_pixel_coordinates(indices)?;
            place.validate(Some(header.layer_size))?;
            Ok((indices.level_index, place))
        });
        let (level, place) = placed.map_err(|e| checks.error(e, &place()))?;
        if level == Vec2(0, 0) {
            found.push(Block { number, at, bytes, place });
        }
        at += bytes as u64;
    }
    for (blocks, part) in found.iter_mut().zip(parts).filter(|(_, part)| !part.deep) {
        sort(blocks, part.header, checks)?;
    }
    Ok(found)
}

/// Sorts a part's blocks, which must cover every pixel once.
fn sort(blocks: &mut [Block], header: &Header, checks: &Checks<'_>) -> Result<(), ImageError> {
    let corner = |block: &Block| (block.place.position.y(), block.place.position.x());
    blocks.sort_by_key(corner);
    if let Some(pair) = blocks.windows(2).find(|pair| corner(&pair[0]) == corner(&pair[1])) {
        let (row, column) = corner(&pair[0]);
        return Err(
            checks.malformed(format!("the pixels at column {column}, row {row} are stored twice"))
        );
    }
    let expected = match header.blocks {
        BlockDescription::ScanLines => header.chunk_count,
        BlockDescription::Tiles(tiles) => {
            let (size, tile) = (header.layer_size, tiles.tile_size);
            size.width().div_ceil(tile.width()) * size.height().div_ceil(tile.height())
        }
    };
    if blocks.len() != expected {
        let what = format!("{} pixel blocks where {expected} cover the image", blocks.len());
        return Err(checks.malformed(what));
    }
    Ok(())
}
