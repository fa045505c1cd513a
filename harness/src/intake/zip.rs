//! Zip archives. The central directory and every local header are read and compared here, and the
//! data is inflated from exactly the bytes that both agree on: one reading of the archive, so
//! that no second parser can see another tree in it.
//!
//! Field offsets are those of PKWARE's APPNOTE 6.3 (4.3.7 local header, 4.3.9 data descriptor,
//! 4.3.12 central directory, 4.3.16 end record).

use std::io::Read;

use flate2::{Crc, read::DeflateDecoder};

use super::copy::{Admitted, Halt, Kind, PrivateCopy};
use super::finding::{Finding, printable_bytes};

const LOCAL: &[u8] = b"PK\x03\x04";
const CENTRAL: &[u8] = b"PK\x01\x02";
const END: &[u8] = b"PK\x05\x06";
const DESCRIPTOR: &[u8] = b"PK\x07\x08";
const ZIP64_LOCATOR: &[u8] = b"PK\x06\x07";
const END_SIZE: usize = 22;
const CENTRAL_SIZE: usize = 46;
const LOCAL_SIZE: usize = 30;
const ZIP64: u32 = u32::MAX;
const AGAIN: &str = "make the archive again with your system's own zip program, or with umbra pack";

/// One entry whose two headers agree.
struct Entry<'a> {
    name: Vec<u8>,
    deflated: bool,
    unpacked_bytes: u64,
    crc32: u32,
    data: &'a [u8],
    /// Bytes of the archive that it takes: local header, data, descriptor.
    start: usize,
    end: usize,
}

impl Entry<'_> {
    fn shown(&self) -> String {
        printable_bytes(&self.name)
    }
}

/// Whether an end record stands near the end.
pub(super) fn has_end_record(bytes: &[u8]) -> bool {
    end_records(bytes).next().is_some()
}

/// Places of end records' signatures, last first, as far back as a comment can reach.
fn end_records(bytes: &[u8]) -> impl Iterator<Item = usize> {
    let first = bytes.len().saturating_sub(END_SIZE + usize::from(u16::MAX));
    let last = bytes.len().saturating_sub(END_SIZE);
    (first..=last)
        .rev()
        .filter(|&i| bytes[i..].starts_with(END) && i + END_SIZE <= bytes.len())
}

/// Reads a zip archive into the copy. Nothing is written before all headers are checked.
pub(super) fn read(bytes: &[u8], copy: &mut PrivateCopy<'_>) -> Result<(), Halt> {
    let directory = find_directory(bytes, copy.limits.max_entries).map_err(|f| copy.refuse(f))?;
    let entries = read_directory(bytes, &directory, copy)?;
    check_ranges(&entries, directory.start, copy);
    let mut files = Vec::new();
    for entry in &entries {
        let kind = if entry.name.ends_with(b"/") {
            Kind::Folder
        } else {
            Kind::File
        };
        match copy.admit(&entry.name, kind) {
            Admitted::File(path) => files.push((entry, path)),
            Admitted::Folder if entry.unpacked_bytes > 0 => {
                let message = format!("a folder that holds {} bytes", entry.unpacked_bytes);
                copy.findings
                    .push(Finding::error("zip_folder_data", message).at(entry.shown()));
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
        return Err(Finding::error(
            "zip64",
            "zip64 records, which no hand-in of this size needs",
        )
        .hint(AGAIN));
    }
    if disk != 0 || directory_disk != 0 || count_here != count {
        return Err(
            Finding::error("zip_multi_disk", "one part of a zip over several disks").hint(AGAIN),
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
    Ok(Directory {
        start: offset,
        end: at,
        count: usize::from(count),
    })
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

/// A header of the central directory.
struct Central<'a> {
    flags: u16,
    method: u16,
    crc32: u32,
    packed: u32,
    unpacked: u32,
    disk: u16,
    attributes: u32,
    local: usize,
    name: &'a [u8],
    extra: &'a [u8],
    end: usize,
}

impl<'a> Central<'a> {
    fn at(bytes: &'a [u8], at: usize) -> Option<Self> {
        if !bytes.get(at..)?.starts_with(CENTRAL) {
            return None;
        }
        let name_end = at + CENTRAL_SIZE + usize::from(u16_at(bytes, at + 28)?);
        let extra_end = name_end + usize::from(u16_at(bytes, at + 30)?);
        let end = extra_end + usize::from(u16_at(bytes, at + 32)?);
        bytes.get(..end)?;
        Some(Self {
            flags: u16_at(bytes, at + 8)?,
            method: u16_at(bytes, at + 10)?,
            crc32: u32_at(bytes, at + 16)?,
            packed: u32_at(bytes, at + 20)?,
            unpacked: u32_at(bytes, at + 24)?,
            disk: u16_at(bytes, at + 34)?,
            attributes: u32_at(bytes, at + 38)?,
            local: u32_at(bytes, at + 42)? as usize,
            name: &bytes[at + CENTRAL_SIZE..name_end],
            extra: &bytes[name_end..extra_end],
            end,
        })
    }
}

/// Checks one entry: what it is, and that its local header says the same as the directory.
fn check_entry<'a>(
    bytes: &'a [u8],
    central: &Central<'_>,
    limit: usize,
) -> Result<Entry<'a>, Finding> {
    check_kind(central)?;
    let at = central.local;
    let header = bytes[..limit]
        .get(at..)
        .and_then(|rest| rest.get(..LOCAL_SIZE));
    let Some(header) = header.filter(|header| header.starts_with(LOCAL)) else {
        let message = format!("expected the entry's own header at byte {at}, found something else");
        return Err(Finding::error("zip_local_missing", message).hint(AGAIN));
    };
    let field16 = |offset| u16_at(header, offset).unwrap_or(0);
    let field32 = |offset| u32_at(header, offset).unwrap_or(0);
    let (flags, method) = (field16(6), field16(8));
    let (crc32, packed, unpacked) = (field32(14), field32(18), field32(22));
    let name_end = at + LOCAL_SIZE + usize::from(field16(26));
    let data_start = name_end + usize::from(field16(28));
    let data_end = data_start + central.packed as usize;
    if data_end > limit {
        let message = format!(
            "its data would end at byte {data_end}, inside or after the directory at {limit}"
        );
        return Err(Finding::error("zip_data_outside", message).hint(AGAIN));
    }
    let name = &bytes[at + LOCAL_SIZE..name_end];
    let extra = &bytes[name_end..data_start];
    if name != central.name {
        let message = format!(
            "the directory names it so, its own header '{}'",
            printable_bytes(name)
        );
        return Err(disagree(message));
    }
    // Flags that change the meaning of the data or of the header: encryption and descriptor.
    const MEANING: u16 = 1 | 8 | 0x20 | 0x40 | 0x2000;
    let same_flags = flags & MEANING == central.flags & MEANING;
    if !same_flags {
        let message = format!(
            "flags: directory {:#06x}, its own header {flags:#06x}",
            central.flags
        );
        return Err(disagree(message));
    }
    agree("compression method", central.method.into(), method.into())?;
    let sizes = local_sizes(packed, unpacked, extra)?;
    let has_descriptor = flags & 8 != 0;
    let is_deferred = has_descriptor && (crc32, sizes) == (0, (0, 0));
    if !is_deferred {
        agree("crc32", central.crc32.into(), crc32.into())?;
        agree("packed size", central.packed.into(), sizes.0)?;
        agree("unpacked size", central.unpacked.into(), sizes.1)?;
    }
    let end = data_end
        + if has_descriptor {
            descriptor_size(&bytes[data_end..limit], central)?
        } else {
            0
        };
    if central.method == 0 && central.packed != central.unpacked {
        let message = format!(
            "stored without compression, yet {} bytes packed and {} unpacked",
            central.packed, central.unpacked
        );
        return Err(Finding::error("zip_size", message).hint(AGAIN));
    }
    Ok(Entry {
        name: effective_name(central.name, central.extra)?,
        deflated: central.method == 8,
        unpacked_bytes: central.unpacked.into(),
        crc32: central.crc32,
        data: &bytes[data_start..data_end],
        start: at,
        end,
    })
}

/// Refuses what is neither a plain file nor a folder, or cannot be unpacked.
fn check_kind(central: &Central<'_>) -> Result<(), Finding> {
    if central.flags & (1 | 0x40 | 0x2000) != 0 || central.method == 99 {
        return Err(Finding::error("zip_encrypted", "the entry is encrypted")
            .hint("make the archive without a password"));
    }
    let method = match central.method {
        0 | 8 => None,
        1..=6 => Some("an obsolete method"),
        9 => Some("deflate64"),
        12 => Some("bzip2"),
        14 => Some("lzma"),
        93 => Some("zstd"),
        95 => Some("xz"),
        98 => Some("ppmd"),
        _ => Some("unknown"),
    };
    if let Some(method) = method {
        let message = format!(
            "expected compression store or deflate, found {method} ({})",
            central.method
        );
        return Err(
            Finding::error("zip_compression", message).hint("choose the normal zip compression")
        );
    }
    if central.flags & 0x20 != 0 {
        return Err(
            Finding::error("zip_compression", "expected plain data, found patched data")
                .hint(AGAIN),
        );
    }
    // The upper half of the attributes is st_mode where the archive was made on Unix.
    match central.attributes >> 28 {
        0 | 0o4 | 0o10 => {}
        0o12 => {
            return Err(
                Finding::error("link", "expected a file or folder, found a symbolic link")
                    .hint("put the file itself there"),
            );
        }
        _ => {
            return Err(Finding::error(
                "special_file",
                "expected a file or folder, found a device, fifo or socket",
            )
            .hint("leave it out"));
        }
    }
    let has_zip64 = [central.packed, central.unpacked, central.local as u32].contains(&ZIP64)
        || extra_field(central.extra, 1).is_some();
    if has_zip64 {
        return Err(
            Finding::error("zip64", "zip64 sizes, which no hand-in of this size needs").hint(AGAIN),
        );
    }
    if central.disk != 0 {
        return Err(Finding::error("zip_multi_disk", "the entry lies on another disk").hint(AGAIN));
    }
    Ok(())
}

fn disagree(message: String) -> Finding {
    Finding::error("zip_headers_disagree", message).hint(AGAIN)
}

fn agree(what: &str, central: u64, local: u64) -> Result<(), Finding> {
    if central == local {
        return Ok(());
    }
    Err(disagree(format!(
        "{what}: the directory says {central}, the entry's own header {local}"
    )))
}

/// Sizes (packed, unpacked) of a local header. Writers that stream use zip64 sizes here although
/// they are small; they must then agree like any other.
fn local_sizes(packed: u32, unpacked: u32, extra: &[u8]) -> Result<(u64, u64), Finding> {
    if packed != ZIP64 && unpacked != ZIP64 {
        return Ok((packed.into(), unpacked.into()));
    }
    let field = extra_field(extra, 1);
    let sizes = field.and_then(|field| Some((u64_at(field, 8)?, u64_at(field, 0)?)));
    match sizes {
        Some(sizes) if packed == ZIP64 && unpacked == ZIP64 => Ok(sizes),
        _ => Err(Finding::error("zip64", "zip64 sizes that do not fit together").hint(AGAIN)),
    }
}

/// Size of the descriptor after an entry's data, which must repeat what the directory says: with or
/// without signature, with 32- or 64-bit sizes.
fn descriptor_size(rest: &[u8], central: &Central<'_>) -> Result<usize, Finding> {
    for signature in [DESCRIPTOR, b""] {
        let Some(body) = rest.strip_prefix(signature) else {
            continue;
        };
        if u32_at(body, 0) != Some(central.crc32) {
            continue;
        }
        if (u32_at(body, 4), u32_at(body, 8)) == (Some(central.packed), Some(central.unpacked)) {
            return Ok(signature.len() + 12);
        }
        let sizes = (Some(central.packed.into()), Some(central.unpacked.into()));
        if (u64_at(body, 4), u64_at(body, 12)) == sizes {
            return Ok(signature.len() + 20);
        }
    }
    Err(disagree(
        "the descriptor after its data says something else than the directory".to_owned(),
    ))
}

/// The name, or its UTF-8 form from Info-ZIP's extra field 0x7075, which may only replace a name
/// that is not ASCII.
fn effective_name(name: &[u8], extra: &[u8]) -> Result<Vec<u8>, Finding> {
    let Some(field) = extra_field(extra, 0x7075) else {
        return Ok(name.to_owned());
    };
    let mut crc = Crc::new();
    crc.update(name);
    let unicode = field.get(5..).unwrap_or_default();
    if field.first() != Some(&1) || u32_at(field, 1) != Some(crc.sum()) || unicode == name {
        // Stale by the field's own rule: the header's name counts.
        return Ok(name.to_owned());
    }
    if name.is_ascii() {
        let message = format!(
            "a second name hides in an extra field: '{}'",
            printable_bytes(unicode)
        );
        return Err(Finding::error("zip_name_override", message).hint(AGAIN));
    }
    Ok(unicode.to_owned())
}

/// The data of the first extra field with this id.
fn extra_field(mut extra: &[u8], id: u16) -> Option<&[u8]> {
    loop {
        let size = usize::from(u16_at(extra, 2)?);
        let data = extra.get(4..4 + size)?;
        if u16_at(extra, 0) == Some(id) {
            return Some(data);
        }
        extra = &extra[4 + size..];
    }
}

/// Entries must follow each other without overlap from the first byte on.
fn check_ranges(entries: &[Entry<'_>], directory: usize, copy: &mut PrivateCopy<'_>) {
    let mut order: Vec<&Entry<'_>> = entries.iter().collect();
    order.sort_by_key(|entry| (entry.start, entry.end));
    let mut end = 0;
    let mut gap = 0;
    for (i, entry) in order.iter().enumerate() {
        if entry.start < end {
            let message = format!(
                "overlaps '{}' in the archive's bytes",
                order[i.saturating_sub(1)].shown()
            );
            copy.findings.push(
                Finding::error("zip_overlap", message)
                    .at(entry.shown())
                    .hint(AGAIN),
            );
        } else if i == 0 && entry.start > 0 && !copy.findings.has_errors() {
            let message = format!("{} bytes stand before the first entry", entry.start);
            copy.findings.push(
                Finding::error("zip_data_before", message)
                    .at(entry.shown())
                    .hint(AGAIN),
            );
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
        (
            copy.write(path, &mut &entry.data[..], Some(packed))?,
            packed,
        )
    };
    let refuse = |code: &str, message: String| Finding::error(code, message).at(path).hint(AGAIN);
    let finding = match written {
        Err(e) => refuse(
            "zip_corrupt",
            format!("its compressed data cannot be read: {e}"),
        ),
        Ok(written) if written.bytes != entry.unpacked_bytes => {
            let found = if written.bytes > entry.unpacked_bytes {
                "more"
            } else {
                "fewer"
            };
            refuse(
                "zip_size",
                format!(
                    "expected {} unpacked bytes, found {found}",
                    entry.unpacked_bytes
                ),
            )
        }
        Ok(written) if written.crc32 != entry.crc32 => refuse(
            "zip_crc",
            format!(
                "expected checksum {:08x}, found {:08x}",
                entry.crc32, written.crc32
            ),
        ),
        Ok(_) if consumed != packed => refuse(
            "zip_entry_slack",
            format!(
                "{} bytes follow its compressed data",
                packed - consumed.min(packed)
            ),
        ),
        Ok(_) => return Ok(()),
    };
    Err(copy.refuse(finding))
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(
        bytes.get(at..at.checked_add(2)?)?.try_into().ok()?,
    ))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(
        bytes.get(at..at.checked_add(4)?)?.try_into().ok()?,
    ))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(
        bytes.get(at..at.checked_add(8)?)?.try_into().ok()?,
    ))
}
