//! Samples of an image as the viewer reads them: zlib over differences between successive samples, all their highest
//! bytes first. Neighbors are alike, so these are alike.
//!
//! Parts of the stream are made on all cores, as pigz does, and handed on one after the other, so that nothing but the
//! samples is ever whole in memory. The bytes do not depend on the number of threads.

use std::io;
use std::ops::Range;

use basecode::Image;
use flate2::{Compress, Compression, FlushCompress, Status};
use half::f16;
use rayon::prelude::*;

/// Level of zlib: higher ones take three times as long for 2 % of the bytes, since most bits are noise.
const LEVEL: u32 = 3;
/// Bytes of a part: few enough for a core's cache, and enough that beginning anew costs a thousandth.
const PART: usize = 512 << 10;
/// Parts that are in memory at once.
const AT_ONCE: usize = 16;
/// First bytes of a zlib stream: deflate with a window of 32 KiB, made fast (RFC 1950).
const ZLIB: [u8; 2] = [0x78, 0x5e];

/// The samples of an image, channel by channel.
#[derive(Clone, Copy)]
pub enum Values<'a> {
    /// As they are.
    Words(&'a [u16]),
    /// As halves where these hold the very bits of each, else as 32-bit floats.
    Floats(&'a [f32]),
    /// The three channels of an image, as floats are.
    Image(&'a Image),
}

/// Samples that are ready to be packed.
pub struct Packing<'a> {
    values: Values<'a>,
    halves: bool,
}

impl<'a> Packing<'a> {
    /// Finds out how the samples are stored.
    pub fn new(values: Values<'a>) -> Self {
        let exact = |value: f32| f16::from_f32(value).to_f32().to_bits() == value.to_bits();
        let halves = match values {
            Values::Words(_) => false,
            Values::Floats(values) => values.par_iter().all(|&value| exact(value)),
            Values::Image(image) => {
                image.pixels.par_iter().all(|pixel| pixel.to_array().into_iter().all(exact))
            }
        };
        Self { values, halves }
    }

    /// Whether floats are stored as halves.
    pub fn halves(&self) -> bool {
        self.halves
    }

    /// The number of samples.
    fn len(&self) -> usize {
        match self.values {
            Values::Words(words) => words.len(),
            Values::Floats(values) => values.len(),
            Values::Image(image) => 3 * image.pixels.len(),
        }
    }

    /// The bytes of a sample.
    fn width(&self) -> usize {
        if self.halves || matches!(self.values, Values::Words(_)) { 2 } else { 4 }
    }

    /// The bits of some samples.
    fn bits(&self, range: Range<usize>) -> Vec<u32> {
        let bits = |value: f32| match self.halves {
            true => f16::from_f32(value).to_bits().into(),
            false => value.to_bits(),
        };
        match self.values {
            Values::Words(words) => words[range].iter().map(|&word| word.into()).collect(),
            Values::Floats(values) => values[range].iter().map(|&value| bits(value)).collect(),
            Values::Image(image) => {
                let count = image.pixels.len();
                range.map(|at| bits(image.pixels[at % count][at / count])).collect()
            }
        }
    }

    /// Hands on the bytes of all samples in their order, piece by piece.
    pub fn each_piece(&self, piece: &mut dyn FnMut(&[u8])) {
        for start in (0..self.len()).step_by(PART) {
            let bits = self.bits(start..self.len().min(start + PART));
            let bytes: Vec<u8> = match self.width() {
                2 => bits.iter().flat_map(|bits| (*bits as u16).to_le_bytes()).collect(),
                _ => bits.iter().flat_map(|bits| bits.to_le_bytes()).collect(),
            };
            piece(&bytes);
        }
    }

    /// Packs the samples and hands on the stream, piece by piece.
    ///
    /// # Errors
    /// What `write` says.
    pub fn pack(&self, write: &mut dyn FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
        let (count, width) = (self.len(), self.width());
        let mut parts: Vec<(usize, Range<usize>)> = Vec::new();
        for plane in 0..width {
            let starts = (0..count).step_by(PART);
            parts.extend(starts.map(|start| (plane, start..count.min(start + PART))));
        }
        write(&ZLIB)?;
        let mut adler = Adler::new();
        let last = parts.len().saturating_sub(1);
        let numbered: Vec<_> = parts.into_iter().enumerate().collect();
        for some in numbered.chunks(AT_ONCE) {
            let made: Vec<io::Result<(Vec<u8>, Adler)>> = some
                .par_iter()
                .map(|(number, (plane, range))| {
                    let bytes = self.plane(8 * (width - 1 - plane) as u32, range.clone());
                    let packed = deflated(&bytes, *number == last)?;
                    Ok((packed, Adler::of(&bytes)))
                })
                .collect();
            for part in made {
                let (packed, own) = part?;
                adler = adler.then(&own);
                write(&packed)?;
            }
        }
        if count == 0 {
            write(&deflated(&[], true)?)?;
        }
        write(&adler.sum().to_be_bytes())
    }

    /// One byte of the difference of each sample to the one before it.
    fn plane(&self, shift: u32, range: Range<usize>) -> Vec<u8> {
        let first = range.start.saturating_sub(1);
        let bits = self.bits(first..range.end);
        let mut last = if range.start == 0 { 0 } else { bits[0] };
        let step = |&sample: &u32| {
            let step = sample.wrapping_sub(last);
            last = sample;
            (step >> shift) as u8
        };
        bits[range.start - first..].iter().map(step).collect()
    }
}

/// A part of a deflate stream that ends with a whole byte, and, if it is the last, the stream.
fn deflated(bytes: &[u8], last: bool) -> io::Result<Vec<u8>> {
    let flush = if last { FlushCompress::Finish } else { FlushCompress::Sync };
    let mut compress = Compress::new(Compression::new(LEVEL), false);
    let mut packed = Vec::with_capacity(bytes.len() + bytes.len() / 64 + 64);
    loop {
        let read = compress.total_in() as usize;
        let status = compress.compress_vec(&bytes[read..], &mut packed, flush)?;
        let done = match last {
            true => status == Status::StreamEnd,
            // Room that is left means that all has been flushed.
            false => {
                compress.total_in() as usize == bytes.len() && packed.len() < packed.capacity()
            }
        };
        if done {
            return Ok(packed);
        }
        packed.reserve(packed.len().max(1024));
    }
}

/// The checksum of RFC 1950.
struct Adler {
    sum: u64,
    sums: u64,
    bytes: u64,
}

impl Adler {
    /// The largest prime below 2^16.
    const PRIME: u64 = 65521;

    fn new() -> Self {
        Self { sum: 1, sums: 0, bytes: 0 }
    }

    fn of(bytes: &[u8]) -> Self {
        let (mut sum, mut sums) = (1, 0);
        // So many can be added before 64 bits overflow by far.
        for some in bytes.chunks(1 << 16) {
            for byte in some {
                sum += u64::from(*byte);
                sums += sum;
            }
            sum %= Self::PRIME;
            sums %= Self::PRIME;
        }
        Self { sum, sums, bytes: bytes.len() as u64 }
    }

    /// The checksum of these bytes and then those of `next`.
    fn then(&self, next: &Self) -> Self {
        let more = (next.bytes % Self::PRIME) * (self.sum + Self::PRIME - 1);
        Self {
            sum: (self.sum + next.sum + Self::PRIME - 1) % Self::PRIME,
            sums: (self.sums + next.sums + more) % Self::PRIME,
            bytes: self.bytes + next.bytes,
        }
    }

    fn sum(&self) -> u32 {
        (self.sums << 16 | self.sum) as u32
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use flate2::read::ZlibDecoder;

    use super::*;

    #[test]
    fn parts_make_the_stream_of_the_whole() {
        // Several parts, the last of them short; and no sample at all.
        for count in [0, 1, PART, 2 * PART + 77] {
            let value = |at: usize| (at as f32 * 0.37).sin() * (at % 1000) as f32;
            let values: Vec<f32> = (0..count).map(value).collect();
            let packing = Packing::new(Values::Floats(&values));
            let mut packed = Vec::new();
            let mut write = |bytes: &[u8]| {
                packed.extend_from_slice(bytes);
                Ok(())
            };
            packing.pack(&mut write).unwrap();
            let mut found = Vec::new();
            // The decoder checks the checksum.
            ZlibDecoder::new(&packed[..]).read_to_end(&mut found).unwrap();
            let mut expected = vec![0; count * packing.width()];
            let mut last = 0u32;
            for (at, value) in values.iter().enumerate() {
                let bits = match packing.halves() {
                    true => f16::from_f32(*value).to_bits().into(),
                    false => value.to_bits(),
                };
                let step = bits.wrapping_sub(last).to_le_bytes();
                last = bits;
                for plane in 0..packing.width() {
                    expected[plane * count + at] = step[packing.width() - 1 - plane];
                }
            }
            assert!(found == expected, "{count} samples");
        }
    }
}
