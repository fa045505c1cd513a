//! The samples of a block: read, decompressed, and put into a band.

use std::io;
use std::ops::Range;

use exr::meta::attribute::{ChannelDescription, SampleType};
use exr::meta::header::Header;

use super::{Band, ExrRows};
use crate::exr_io::ImageError;
use crate::exr_io::blocks::Block;

impl ExrRows<'_> {
    /// Puts what a block holds of these rows into the band: its rows, and what is wanted of the stored ones. A sample
    /// is put in all the pixels that it stands for.
    pub(super) fn read_block(
        &self,
        block: &Block,
        (rows, wanted): (&Range<usize>, &Range<usize>),
        channels: &[usize],
        band: &mut Band,
    ) -> Result<(), ImageError> {
        let Band { planes, bytes, width } = band;
        let [left, top] = self.placed.at;
        let mut samples = self.samples(block, bytes)?;
        let (first, columns) = (block.place.position.x() as usize, block.place.size.width());
        let mut values = Vec::new();
        for y in block.rows() {
            for (channel, described) in self.header.channels.list.iter().enumerate() {
                let [across, down] = self.sampling.get(channel).copied().unwrap_or([1, 1]);
                if y % down != 0 {
                    continue;
                }
                let (count, kind) = (columns / across, described.sample_type);
                let (line, rest) = samples.split_at(count * kind.bytes_per_sample());
                samples = rest;
                let shown = y.max(wanted.start)..(y + down).min(wanted.end);
                if shown.is_empty() {
                    continue;
                }
                let targets = planes.iter_mut().zip(channels).filter(|(_, own)| **own == channel);
                for (plane, _) in targets {
                    let start = |y: usize| (y + top - rows.start) * *width + left + first;
                    if [across, down] == [1, 1] {
                        decode(kind, line, &mut plane[start(y)..][..columns]);
                        continue;
                    }
                    values.resize(count, 0.0);
                    decode(kind, line, &mut values);
                    for y in shown.clone() {
                        let row = &mut plane[start(y)..][..columns];
                        for (pixels, value) in row.chunks_exact_mut(across).zip(&values) {
                            pixels.fill(*value);
                        }
                    }
                }
            }
        }
        Ok(())
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

/// Turns samples into values.
fn decode(kind: SampleType, from: &[u8], row: &mut [f32]) {
    match kind {
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
