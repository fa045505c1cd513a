//! Zip archives. The central directory and every local header are read and compared here, and the
//! data is inflated from exactly the bytes that both agree on: one reading of the archive, so
//! that no second parser can see another tree in it.
//!
//! Field offsets are those of PKWARE's APPNOTE 6.3 (4.3.7 local header, 4.3.9 data descriptor,
//! 4.3.12 central directory, 4.3.16 end record).

use std::io::Read;

use flate2::read::DeflateDecoder;

use super::copy::{Admitted, Halt, Kind, PrivateCopy};
use super::finding::{Finding, printable_bytes};
use super::zip_headers::{CENTRAL, Central, Entry, ZIP64, check_entry, u16_at, u32_at};

const END: &[u8] = b"PK\x05\x06";
const ZIP64_LOCATOR: &[u8] = b"PK\x06\x07";
const END_SIZE: usize = 22;
pub(super) const AGAIN: &str =
    "make the archive again with your system's own zip program, or with umbra pack";

/// Whether an end record stands near the end.
pub(super) fn has_end_record(bytes: &[u8]) -> bool {
    end_records(bytes).next().is_some()
}

/// Places of end records' signatures, last first, as far back as a comment can reach.
fn end_records(bytes: &[u8]) -> impl Iterator<Item = usize> {
    let first = bytes.len().saturating_sub(END_SIZE + usize::from(u16::MAX));
    let last = bytes.len().saturating_sub(END_SIZE);
    (first..=last).rev().filter(|&i| bytes[i..].starts_with(END) && i + END_SIZE <= bytes.len())
}

/// Reads a zip archive into the copy. Nothing is written before all headers are checked.
pub(super) fn read(bytes: &[u8], copy: &mut PrivateCopy<'_>) -> Result<(), Halt> {
    let directory = find_directory(bytes, copy.limits.max_entries).map_err(|f| copy.refuse(f))?;
    let entries = read_directory(bytes, &directory, copy)?;
    check_ranges(&entries, directory.start, copy);
    let mut files = Vec::new();
    for entry in &entries {
        let kind = if entry.name.ends_with(b"/") { Kind::Folder } else { Kind::File };
        match copy.admit(&entry.name, kind) {
            Admitted::File(path) => files.push((entry, path)),
            Admitted::Folder if entry.unpacked_bytes > 0 => {
                let message = format!("a folder that holds {} bytes", entry.unpacked_bytes);
                copy.findings.push(Finding::error("zip_folder_data", message).at(entry.shown()));
            }
            Admitted::Folder | Admitted::Ignored | Admitted::Refused => {}
        }
    }
    if copy.findings.has_errors() {
        return Err(Halt::Refused);
    }
    for (entry, path) in files {
        extract(entry, &path, copy)?;
    }
    Ok(())
}

/// Where the central directory lies and how many entries it announces.
struct Directory {
    start: usize,
    end: usize,
    count: usize,
}

fn find_directory(bytes: &[u8], max_entries: u64) -> Result<Directory, Finding> {
    let mut records = end_records(bytes);
    let Some(at) = records.next() else {
        return Err(Finding::error(
            "zip_truncated",
            "expected a zip directory at the end, found none",
        )
        .hint("the upload may have been cut off; hand in again"));
    };
    let comment = usize::from(u16_at(bytes, at + 20).unwrap_or(0));
    let after = bytes.len() - at - END_SIZE;
    if let Some(other) = records.find(|&other| {
        other + END_SIZE + usize::from(u16_at(bytes, other + 20).unwrap_or(0)) == bytes.len()
    }) {
        let message = format!("two directories end this zip, at byte {other} and at byte {at}");
        return Err(Finding::error("zip_two_directories", message).hint(AGAIN));
    }
    if comment != after {
        let message = format!("expected {comment} bytes after the zip's directory, found {after}");
        return Err(Finding::error("zip_data_after", message).hint(AGAIN));
    }
    let field16 = |offset| u16_at(bytes, at + offset).unwrap_or(0);
    let field32 = |offset| u32_at(bytes, at + offset).unwrap_or(0);
    let (disk, directory_disk) = (field16(4), field16(6));
    let (count_here, count) = (field16(8), field16(10));
    let (size, offset) = (field32(12), field32(16));
    let has_locator = at >= 20 && bytes[at - 20..].starts_with(ZIP64_LOCATOR);
    if has_locator || count == u16::MAX || size == ZIP64 || offset == ZIP64 {
        return Err(Finding::error("zip64", "zip64 records, which no hand-in of this size needs")
            .hint(AGAIN));
    }
    if disk != 0 || directory_disk != 0 || count_here != count {
        return Err(
            Finding::error("zip_multi_disk", "one part of a zip over several disks").hint(AGAIN)
        );
    }
    if u64::from(count) > max_entries {
        let message = format!("{count} entries, over the limit of {max_entries}");
        return Err(Finding::error("limit_entries", message)
            .hint("hand in only the files of the tree, no build folder"));
    }
    let (size, offset) = (size as usize, offset as usize);
    if size > at || offset + size > at {
        let message = format!(
            "the directory (at {offset}, {size} bytes) reaches past its end record at byte {at}"
        );
        return Err(Finding::error("zip_directory", message).hint(AGAIN));
    }
    if offset + size < at {
        let extra = at - offset - size;
        let code = if bytes[at - size..].starts_with(CENTRAL) {
            "zip_data_before"
        } else {
            "zip_directory"
        };
        let message = format!("{extra} bytes before or inside the zip belong to no part of it");
        return Err(Finding::error(code, message).hint(AGAIN));
    }
    Ok(Directory { start: offset, end: at, count: usize::from(count) })
}

fn read_directory<'a>(
    bytes: &'a [u8],
    directory: &Directory,
    copy: &mut PrivateCopy<'_>,
) -> Result<Vec<Entry<'a>>, Halt> {
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
        match check_entry(bytes, &header, directory.start) {
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

/// Entries must follow each other without overlap from the first byte on.
fn check_ranges(entries: &[Entry<'_>], directory: usize, copy: &mut PrivateCopy<'_>) {
    let mut order: Vec<&Entry<'_>> = entries.iter().collect();
    order.sort_by_key(|entry| (entry.start, entry.end));
    let mut end = 0;
    let mut gap = 0;
    for (i, entry) in order.iter().enumerate() {
        if entry.start < end {
            let message =
                format!("overlaps '{}' in the archive's bytes", order[i.saturating_sub(1)].shown());
            copy.findings
                .push(Finding::error("zip_overlap", message).at(entry.shown()).hint(AGAIN));
        } else if i == 0 && entry.start > 0 && !copy.findings.has_errors() {
            let message = format!("{} bytes stand before the first entry", entry.start);
            copy.findings
                .push(Finding::error("zip_data_before", message).at(entry.shown()).hint(AGAIN));
        } else {
            gap += entry.start - end;
        }
        end = end.max(entry.end);
    }
    gap += directory.saturating_sub(end);
    if gap > 0 && !copy.findings.has_errors() {
        let message = format!("{gap} bytes between the entries belong to none of them");
        copy.findings.push(Finding::warning("zip_gap", message));
    }
}

/// Unpacks one entry and checks that its data keep what the headers promise.
fn extract(entry: &Entry<'_>, path: &str, copy: &mut PrivateCopy<'_>) -> Result<(), Halt> {
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
