//! Zip archives. The central directory and every local header are read and compared here. The data is inflated from
//! exactly the bytes that both agree on. So there is one reading of the archive, and no second parser can see another
//! tree in it.
//!
//! Bytes before, between and after the parts (a self-extracting program, an archiver's zeros, a line that a mailer
//! added) are skipped with a warning, unless another parser could take them for parts.
//!
//! Field offsets are those of PKWARE's APPNOTE 6.3 (4.3.7 local header, 4.3.9 data descriptor,
//! 4.3.12 central directory, 4.3.14 zip64 end record and 4.3.15 its locator, 4.3.16 end record, 4.5.3
//! zip64 sizes).

use std::io::Read;
use std::ops::Range;

use flate2::read::DeflateDecoder;

use super::copy::{EntryAction, EntryKind, PrivateCopy, Stop};
use super::finding::Finding;
use super::limits::ArchiveLimits;
pub(super) use super::zip_headers::AGAIN;
use super::zip_headers::{
    CENTRAL, Central, Entry, LOCAL, ZIP64, check_entry, u16_at, u32_at, u64_at,
};
use crate::columns::count;
use crate::harmless::printable_bytes;

const END: &[u8] = b"PK\x05\x06";
const ZIP64_END: &[u8] = b"PK\x06\x06";
const ZIP64_LOCATOR: &[u8] = b"PK\x06\x07";

const END_SIZE: usize = 22;
const ZIP64_END_SIZE: usize = 56;
const ZIP64_LOCATOR_SIZE: usize = 20;

/// Whether an end record stands anywhere.
pub(super) fn has_end_record(bytes: &[u8]) -> bool {
    last_end_record(bytes).is_some()
}

/// The last end record. None can stand in a comment or in bytes after it: those must hold no record.
fn last_end_record(bytes: &[u8]) -> Option<usize> {
    let last = bytes.len().checked_sub(END_SIZE)?;
    (0..=last).rev().find(|&at| bytes[at..].starts_with(END))
}

/// Reads a zip archive into the copy. Nothing is written before all headers are checked.
pub(super) fn read(bytes: &[u8], copy: &mut PrivateCopy<'_>) -> Result<(), Stop> {
    let directory = find_directory(bytes, copy.limits).map_err(|f| copy.refuse(f))?;
    let mut entries = read_directory(bytes, &directory, copy)?;
    check_ranges(bytes, &entries, &directory, copy);
    for entry in &mut entries {
        entry.name = copy.backslashes.read(std::mem::take(&mut entry.name), entry.of_windows);
    }
    let mut files = Vec::new();
    for entry in &entries {
        let kind = if entry.is_folder() { EntryKind::Folder } else { EntryKind::File };
        match copy.accept(&entry.name, kind) {
            EntryAction::File(path) => files.push((entry, path)),
            EntryAction::Folder if entry.unpacked_bytes > 0 => {
                let message = format!("a folder that holds data (size {})", entry.unpacked_bytes);
                copy.findings.push(Finding::error("zip_folder_data", message).at(entry.shown()));
            }
            EntryAction::Folder | EntryAction::Ignored | EntryAction::Refused => {}
        }
    }
    if copy.findings.has_errors() {
        return Err(Stop::Refused);
    }
    for (entry, path) in files {
        extract(entry, &path, copy)?;
    }
    Ok(())
}

/// Where the central directory lies and how many entries it announces.
struct Directory {
    /// Bytes before the place that the archive's own offsets count from.
    base: usize,
    start: usize,
    end: usize,
    count: u64,
    /// Where the end record ends; a comment of so many bytes follows.
    records_end: usize,
    comment: usize,
}

/// What the end record says, or the zip64 one before it.
struct End {
    disks: [u32; 2],
    counts: [u64; 2],
    size: u64,
    offset: u64,
}

fn find_directory(bytes: &[u8], limits: &ArchiveLimits) -> Result<Directory, Finding> {
    let Some(at) = last_end_record(bytes) else {
        return Err(Finding::error(
            "zip_truncated",
            "expected a zip directory at the end, found none",
        )
        .hint(
            "the upload may have been cut off, or this is one volume of several; submit all of it",
        ));
    };
    let comment = usize::from(u16_at(bytes, at + 20).unwrap_or(0));
    let (end, records) = end_record(bytes, at)?;
    if end.disks != [0, 0] || end.counts[0] != end.counts[1] {
        return Err(
            Finding::error("zip_multi_disk", "one part of a zip over several disks").hint(AGAIN)
        );
    }
    let count = end.counts[1];
    if count > limits.most_headers() {
        let message = format!("{count} entries, over the limit of {}", limits.most_headers());
        return Err(Finding::error("limit_entries", message)
            .hint("submit only the files of the tree, no build folder"));
    }
    let start = usize::try_from(end.size).ok().and_then(|size| records.checked_sub(size));
    let offset = usize::try_from(end.offset).ok();
    let base = start.zip(offset).and_then(|(start, offset)| start.checked_sub(offset));
    let (Some(start), Some(offset), Some(base)) = (start, offset, base) else {
        let message = format!(
            "the directory (at {}, {} bytes) reaches past its end record at byte {records}",
            end.offset, end.size
        );
        return Err(Finding::error("zip_directory", message).hint(AGAIN));
    };
    if start < records && !bytes[start..].starts_with(CENTRAL) {
        let message = format!("expected the directory at byte {start}, found something else");
        return Err(Finding::error("zip_directory", message).hint(AGAIN));
    }
    if base > 0 && bytes[offset..].starts_with(CENTRAL) {
        let message = format!("two directories end this zip, at byte {offset} and at byte {start}");
        return Err(Finding::error("zip_two_directories", message).hint(AGAIN));
    }
    Ok(Directory { base, start, end: records, count, records_end: at + END_SIZE, comment })
}

/// What the end record at `at` says, and where the directory ends: at it, or at a zip64 record before it.
/// Both must say the same.
fn end_record(bytes: &[u8], at: usize) -> Result<(End, usize), Finding> {
    let field16 = |offset| u16_at(bytes, at + offset).unwrap_or(0);
    let field32 = |offset| u32_at(bytes, at + offset).unwrap_or(0);
    let end = End {
        disks: [field16(4).into(), field16(6).into()],
        counts: [field16(8).into(), field16(10).into()],
        size: field32(12).into(),
        offset: field32(16).into(),
    };
    let locator = at.checked_sub(ZIP64_LOCATOR_SIZE);
    let locator = locator.filter(|&at| bytes[at..].starts_with(ZIP64_LOCATOR));
    let full = |value: u64, max: u32| value == u64::from(max);
    let wide = [end.size, end.offset].iter().any(|value| full(*value, ZIP64))
        || full(end.counts[1], u16::MAX.into());
    let refuse = |message: &str| Err(Finding::error("zip64", message).hint(AGAIN));
    let Some(locator) = locator else {
        return if wide { refuse("the zip64 records are missing") } else { Ok((end, at)) };
    };
    let record = locator.checked_sub(ZIP64_END_SIZE);
    let record = record.filter(|&at| bytes[at..].starts_with(ZIP64_END));
    let Some(record) = record.filter(|&at| u64_at(bytes, at + 4) == Some(44)) else {
        return refuse("expected a zip64 record before its locator, found something else");
    };
    let field32 = |offset| u32_at(bytes, record + offset).unwrap_or(u32::MAX);
    let field64 = |offset| u64_at(bytes, record + offset).unwrap_or(u64::MAX);
    let wide = End {
        disks: [field32(16), field32(20)],
        counts: [field64(24), field64(32)],
        size: field64(40),
        offset: field64(48),
    };
    // A field of the plain record is full where the zip64 one counts.
    let same = |plain: u64, full: u64, wide: u64| plain == full || plain == wide;
    let (full16, full32) = (u64::from(u16::MAX), u64::from(ZIP64));
    let agree = same(end.size, full32, wide.size)
        && same(end.offset, full32, wide.offset)
        && (0..2).all(|i| same(end.counts[i], full16, wide.counts[i]))
        && (0..2).all(|i| same(end.disks[i].into(), full16, wide.disks[i].into()));
    // The locator's place, counted as all offsets are.
    let place = u64_at(bytes, locator + 8);
    let expected = wide.offset.checked_add(wide.size);
    if !agree || place.is_none() || place != expected {
        return refuse("the zip64 records say something else than the end record");
    }
    if u32_at(bytes, locator + 4) != Some(0) || u32_at(bytes, locator + 16) > Some(1) {
        return Err(
            Finding::error("zip_multi_disk", "one part of a zip over several disks").hint(AGAIN)
        );
    }
    Ok((wide, record))
}

fn read_directory<'a>(
    bytes: &'a [u8],
    directory: &Directory,
    copy: &mut PrivateCopy<'_>,
) -> Result<Vec<Entry<'a>>, Stop> {
    let mut entries = Vec::new();
    let mut at = directory.start;
    let mut count = 0;
    while at < directory.end {
        let Some(header) = Central::at(&bytes[..directory.end], at) else {
            let message = format!("expected a directory entry at byte {at}, found something else");
            return Err(copy.refuse(Finding::error("zip_directory", message).hint(AGAIN)));
        };
        at = header.end;
        count += 1;
        copy.count_entry()?;
        match check_entry(bytes, &header, directory.base, directory.start) {
            Ok(entry) => entries.push(entry),
            Err(finding) => copy.findings.push(finding.at(printable_bytes(header.name))),
        }
    }
    if count != directory.count {
        let message = format!(
            "the end record announces {} entries, the directory holds {count}",
            directory.count
        );
        return Err(copy.refuse(Finding::error("zip_directory", message).hint(AGAIN)));
    }
    Ok(entries)
}

/// Entries must not overlap, and bytes that belong to no entry must hold no record: another reader could
/// find another archive in them.
fn check_ranges(
    bytes: &[u8],
    entries: &[Entry<'_>],
    directory: &Directory,
    copy: &mut PrivateCopy<'_>,
) {
    let mut order: Vec<&Entry<'_>> = entries.iter().collect();
    order.sort_by_key(|entry| (entry.start, entry.end));
    let mut free = Vec::new();
    let mut end = 0;
    for (i, entry) in order.iter().enumerate() {
        if entry.start < end {
            let message =
                format!("overlaps '{}' in the archive's bytes", order[i.saturating_sub(1)].shown());
            copy.findings
                .push(Finding::error("zip_overlap", message).at(entry.shown()).hint(AGAIN));
        }
        free.push(end..entry.start.max(end));
        end = end.max(entry.end);
    }
    free.push(end..directory.start.max(end));
    free.push(directory.records_end..bytes.len());
    if copy.findings.has_errors() {
        return;
    }
    let holds_record = |range: &Range<usize>| {
        let free = bytes[range.clone()].windows(4);
        free.filter(|bytes| bytes.starts_with(b"PK")).any(|b| [LOCAL, CENTRAL, END].contains(&b))
    };
    if let Some(range) = free.iter().find(|range| holds_record(range)) {
        let message = format!(
            "bytes {} to {} belong to no entry, but hold records of another zip: this one can be read in two \
             ways",
            range.start, range.end
        );
        copy.findings.push(Finding::error("zip_two_directories", message).hint(AGAIN));
        return;
    }
    let mut lengths = free.iter().map(Range::len);
    let before = lengths.next().unwrap_or_default();
    let after = lengths.next_back().unwrap_or_default();
    // Without an entry, what stands before the directory is before and between.
    let between: usize = lengths.sum();
    let mut warn =
        |code: &str, message: String| copy.findings.push(Finding::warning(code, message));
    if before > 0 {
        warn("zip_data_before", format!("{} before the zip: no part of it", bytes_of(before)));
    }
    if between > 0 {
        warn("zip_gap", format!("{} between the entries: part of none", bytes_of(between)));
    }
    if after < directory.comment {
        let message =
            format!("expected a comment of {}, found {after}", bytes_of(directory.comment));
        warn("zip_comment_cut", message);
    }
    let tail = &bytes[bytes.len() - after.saturating_sub(directory.comment)..];
    if tail.iter().any(|byte| *byte != 0) {
        warn("zip_data_after", format!("{} after the zip: no part of it", bytes_of(tail.len())));
    } else if !tail.is_empty() {
        let message = format!("{} after the zip", count(tail.len(), "zero"));
        copy.findings.push(Finding::note("zip_padding", message));
    }
}

fn bytes_of(number: usize) -> String {
    count(number, "byte")
}

/// Unpacks one entry and checks that its data keep what the headers promise.
fn extract(entry: &Entry<'_>, path: &str, copy: &mut PrivateCopy<'_>) -> Result<(), Stop> {
    let packed = entry.data.len() as u64;
    // One byte more than promised is enough to see a lie.
    let promised = entry.unpacked_bytes.saturating_add(1);
    let (written, consumed) = if entry.deflated {
        let mut decoder = DeflateDecoder::new(entry.data).take(promised);
        let written = copy.write(path, &mut decoder, Some(packed))?;
        (written, decoder.into_inner().total_in())
    } else {
        (copy.write(path, &mut &entry.data[..], Some(packed))?, packed)
    };
    let refuse = |code: &str, message: String| Finding::error(code, message).at(path).hint(AGAIN);
    let finding = match written {
        Err(e) => refuse("zip_corrupt", format!("its compressed data cannot be read: {e}")),
        Ok(written) if written.bytes != entry.unpacked_bytes => {
            let found = if written.bytes > entry.unpacked_bytes { "more" } else { "fewer" };
            refuse(
                "zip_size",
                format!("expected {} unpacked bytes, found {found}", entry.unpacked_bytes),
            )
        }
        Ok(written) if written.crc32 != entry.crc32 => refuse(
            "zip_crc",
            format!("expected checksum {:08x}, found {:08x}", entry.crc32, written.crc32),
        ),
        Ok(_) if consumed != packed => refuse(
            "zip_entry_slack",
            format!("{} bytes follow its compressed data", packed - consumed.min(packed)),
        ),
        Ok(_) => return Ok(()),
    };
    Err(copy.refuse(finding))
}
