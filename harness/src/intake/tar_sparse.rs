//! Files of which a tar leaves out the zeros: GNU tar writes them with `--sparse`, libarchive (the `tar` of macOS
//! and Windows) wherever the file system says that a file has holes.
//!
//! Four forms, all of which GNU tar, libarchive and Python read alike: GNU's own header (type `S`), and pax records of
//! version 0.0, 0.1 and 1.0 (GNU tar's manual, "Storing Sparse Files"). Each gives the size of the file and
//! a list of its pieces; what lies between them is zero.

use std::io::{self, Read};

use tar::{GnuExtSparseHeader, GnuSparseHeader, Header};

/// Pieces of one file; a picture has some thousand rows.
const MAX_PIECES: usize = 1 << 16;
const BLOCK: usize = 512;

/// Where the stored bytes of a file belong.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Map {
    /// The size of the file [bytes].
    pub(super) size: u64,
    /// Offset and length of each piece, in order.
    pieces: Vec<(u64, u64)>,
}

impl Map {
    /// A map that makes sense: pieces in order, none beyond the end, and `stored` bytes in all.
    fn new(size: u64, pieces: Vec<(u64, u64)>, stored: u64) -> Option<Self> {
        let mut end = 0u64;
        let mut sum = 0u64;
        for &(offset, length) in &pieces {
            if offset < end {
                return None;
            }
            end = offset.checked_add(length)?;
            sum = sum.checked_add(length)?;
        }
        (end <= size && sum == stored && pieces.len() <= MAX_PIECES)
            .then_some(Self { size, pieces })
    }

    /// Of a file without holes.
    pub(super) fn whole(size: u64) -> Self {
        Self { size, pieces: vec![(0, size)] }
    }

    /// The whole file, of which `stored` holds the pieces.
    pub(super) fn expand<R: Read>(self, stored: R) -> Expanded<R> {
        Expanded { stored, size: self.size, at: 0, pieces: self.pieces.into_iter(), piece: (0, 0) }
    }
}

/// What pax records say of a sparse file.
#[derive(Default)]
pub(super) struct Records {
    name: Option<Vec<u8>>,
    size: Option<u64>,
    /// Version 1.0, whose map stands before the data.
    in_data: bool,
    numbers: Vec<u64>,
}

impl Records {
    /// Takes a record; returns whether it makes sense.
    pub(super) fn take(&mut self, key: &str, value: &[u8]) -> bool {
        let number = || std::str::from_utf8(value).ok()?.parse::<u64>().ok();
        match key {
            "GNU.sparse.major" | "GNU.sparse.minor" => {
                self.in_data |= key.ends_with("major") && value == b"1";
                matches!((key, value), ("GNU.sparse.major", b"0" | b"1") | (_, b"0" | b"1"))
            }
            "GNU.sparse.name" => self.name.replace(value.to_owned()).is_none(),
            "GNU.sparse.size" | "GNU.sparse.realsize" => {
                let size = number();
                size.is_some()
                    && self.size.replace(size.unwrap_or_default()).is_none_or(|s| Some(s) == size)
            }
            "GNU.sparse.numblocks" => number().is_some(),
            "GNU.sparse.offset" | "GNU.sparse.numbytes" => {
                let expected = usize::from(key.ends_with("numbytes"));
                let fits =
                    self.numbers.len() % 2 == expected && self.numbers.len() < 2 * MAX_PIECES;
                self.numbers.extend(number().filter(|_| fits));
                fits && number().is_some()
            }
            "GNU.sparse.map" => {
                let numbers: Option<Vec<u64>> = std::str::from_utf8(value).ok().and_then(|text| {
                    text.split(',').filter(|n| !n.is_empty()).map(|n| n.parse().ok()).collect()
                });
                let fits = self.numbers.is_empty() && numbers.is_some();
                self.numbers = numbers.unwrap_or_default();
                fits
            }
            _ => false,
        }
    }

    /// The name that the file had, where the entry's own is made up.
    pub(super) fn name(&self) -> Option<Vec<u8>> {
        self.name.clone()
    }

    /// The map of an entry of which `stored` bytes are kept, and how many of these were read for it: of
    /// version 1.0 it stands in blocks before the data.
    pub(super) fn map(self, stored: u64, reader: &mut impl Read) -> io::Result<Option<(Map, u64)>> {
        let Some(size) = self.size else { return Ok(None) };
        if !self.in_data {
            let pieces = self.numbers.as_chunks::<2>();
            let whole = pieces.1.is_empty();
            let pieces = pieces.0.iter().map(|&[offset, length]| (offset, length)).collect();
            return Ok(Map::new(size, pieces, stored).filter(|_| whole).map(|map| (map, 0)));
        }
        let mut lines = Lines { reader, left: stored, block: [0; BLOCK], at: BLOCK, read: 0 };
        let count = lines.number()?.filter(|&count| count <= MAX_PIECES as u64);
        let mut pieces = Vec::new();
        for _ in 0..count.unwrap_or_default() {
            match (lines.number()?, lines.number()?) {
                (Some(offset), Some(length)) => pieces.push((offset, length)),
                _ => return Ok(None),
            }
        }
        let read = lines.read;
        let map = count.and_then(|_| Map::new(size, pieces, stored.checked_sub(read)?));
        Ok(map.map(|map| (map, read)))
    }
}

/// Decimal numbers, one a line, in whole blocks.
struct Lines<'a, R> {
    reader: &'a mut R,
    left: u64,
    block: [u8; BLOCK],
    at: usize,
    read: u64,
}

impl<R: Read> Lines<'_, R> {
    /// The next number; none where the text is none.
    fn number(&mut self) -> io::Result<Option<u64>> {
        let mut number = None::<u64>;
        loop {
            if self.at == BLOCK {
                if self.left < BLOCK as u64 {
                    return Ok(None);
                }
                self.reader.read_exact(&mut self.block)?;
                (self.left, self.read, self.at) =
                    (self.left - BLOCK as u64, self.read + BLOCK as u64, 0);
            }
            let byte = self.block[self.at];
            self.at += 1;
            match byte {
                b'\n' => return Ok(number),
                b'0'..=b'9' => {
                    let digit = u64::from(byte - b'0');
                    let more =
                        number.unwrap_or(0).checked_mul(10).and_then(|n| n.checked_add(digit));
                    let Some(more) = more else { return Ok(None) };
                    number = Some(more);
                }
                _ => return Ok(None),
            }
        }
    }
}

/// The map in a header of GNU's own form, which may go on in blocks after it. The outer error is
/// `reader`'s; none where it makes no sense.
pub(super) fn gnu_map(
    header: &Header,
    stored: u64,
    reader: &mut impl Read,
) -> io::Result<Option<Map>> {
    let Some(gnu) = header.as_gnu() else { return Ok(None) };
    let mut pieces = Vec::new();
    let mut makes_sense = true;
    let mut take = |entries: &[GnuSparseHeader]| {
        for entry in entries.iter().filter(|entry| !entry.is_empty()) {
            match (entry.offset(), entry.length()) {
                (Ok(offset), Ok(length)) => pieces.push((offset, length)),
                _ => makes_sense = false,
            }
        }
        makes_sense && pieces.len() <= MAX_PIECES
    };
    let mut good = take(&gnu.sparse);
    let mut goes_on = gnu.is_extended();
    while good && goes_on {
        let mut more = GnuExtSparseHeader::new();
        reader.read_exact(more.as_mut_bytes())?;
        good = take(more.sparse());
        goes_on = more.is_extended();
    }
    let Some(size) = gnu.real_size().ok().filter(|_| good) else { return Ok(None) };
    Ok(Map::new(size, pieces, stored))
}

/// A file with its zeros.
pub(super) struct Expanded<R> {
    stored: R,
    size: u64,
    at: u64,
    pieces: std::vec::IntoIter<(u64, u64)>,
    /// The piece at or after `at`: where it begins and ends.
    piece: (u64, u64),
}

impl<R: Read> Read for Expanded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.at >= self.piece.1 {
            let Some((offset, length)) = self.pieces.next() else {
                self.piece = (self.size, u64::MAX);
                break;
            };
            self.piece = (offset, offset + length);
        }
        let is_hole = self.at < self.piece.0;
        let end = if is_hole { self.piece.0 } else { self.piece.1 };
        let most = end.min(self.size).saturating_sub(self.at).min(buffer.len() as u64) as usize;
        let n = if is_hole {
            buffer[..most].fill(0);
            most
        } else {
            self.stored.read(&mut buffer[..most])?
        };
        self.at += n as u64;
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_are_zeros() {
        for (size, pieces, stored, whole) in [
            (6, vec![(1, 2), (4, 1)], &b"abc"[..], &b"\0ab\0c\0"[..]),
            (3, vec![(0, 3)], b"abc", b"abc"),
            (2, vec![], b"", b"\0\0"),
            (2, vec![(2, 0)], b"", b"\0\0"),
            (4, vec![(0, 1), (1, 1), (1 + 1, 0), (3, 1)], b"abc", b"ab\0c"),
        ] {
            let map = Map::new(size, pieces.clone(), stored.len() as u64).unwrap();
            let mut found = Vec::new();
            map.expand(stored).read_to_end(&mut found).unwrap();
            assert_eq!(found, whole, "{pieces:?}");
        }
    }

    #[test]
    fn maps_that_make_no_sense_are_none() {
        for (size, pieces, stored) in [
            (6, vec![(4, 1), (1, 2)], 3),
            (6, vec![(0, 3), (2, 1)], 4),
            (2, vec![(1, 2)], 2),
            (9, vec![(1, 2)], 3),
            (9, vec![(u64::MAX, 2)], 2),
        ] {
            assert_eq!(Map::new(size, pieces.clone(), stored), None, "{pieces:?}");
        }
    }
}
