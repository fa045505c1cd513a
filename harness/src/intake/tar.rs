//! Tar archives, plain and gzipped, read block by block: header fields by the `tar` crate, and
//! everything that gives an entry its name or meaning decided here.
//!
//! Formats: POSIX pax interchange (IEEE 1003.1, `pax`), and GNU tar's long names.

use std::io::{self, Read};

use flate2::bufread::GzDecoder;
use tar::{EntryType, Header};

use super::copy::{EntryAction, Kind, PrivateCopy, Stop};
use super::finding::Finding;
use super::limits::{Limits, mib};
use crate::harmless::{printable, printable_bytes};

const BLOCK: usize = 512;
/// Longest extended header that is read [bytes]; macOS writes a few KB of attributes.
const MAX_EXTENDED: u64 = 1 << 20;
/// Zero blocks after the end; GNU tar pads to 10 KiB [bytes].
const MAX_PADDING: u64 = 1 << 20;
/// Members of gzip data; programs that pack in pieces take 64 KiB or more for each.
const MAX_MEMBERS: u64 = 1 << 14;
const AGAIN: &str =
    "make the archive again with 'tar czf a2_first_last.tar.gz FOLDER', or with umbra pack";

/// Whether the first block is a tar header, or the zeros of an empty tar.
pub(super) fn looks_like_tar(bytes: &[u8]) -> bool {
    let Some(block) = bytes.get(..BLOCK) else {
        return false;
    };
    block.iter().all(|b| *b == 0) || is_header(block)
}

/// The checksum is the sum of the block's bytes with its own field as spaces.
fn is_header(block: &[u8]) -> bool {
    let sum = block
        .iter()
        .enumerate()
        .map(|(i, b)| if (148..156).contains(&i) { 32 } else { u32::from(*b) });
    let sum: u32 = sum.sum();
    block.len() == BLOCK && Header::from_byte_slice(block).cksum().is_ok_and(|found| found == sum)
}

/// Reads a gzipped tar.
pub(super) fn read_gz(bytes: &[u8], copy: &mut PrivateCopy<'_>) -> Result<(), Stop> {
    let mut gz = Gz {
        packed: bytes.len(),
        member: GzDecoder::new(bytes),
        members: 1,
        rest: None,
        unpacked: 0,
        limits: copy.limits,
    };
    read(&mut gz, copy)?;
    match gz.rest {
        None => Ok(()),
        Some(rest) if rest.iter().all(|byte| *byte == 0) => {
            let message = format!("{} zeros after the gzip data", rest.len());
            copy.findings.push(Finding::note("gz_padding", message));
            Ok(())
        }
        Some(rest) => {
            let message = format!("{} bytes follow the gzip data", rest.len());
            Err(copy.refuse(Finding::error("gz_data_after", message).hint(AGAIN)))
        }
    }
}

/// Gzip data under the limits: a series of members (RFC 1952, 2.2), one after the other.
struct Gz<'a> {
    member: GzDecoder<&'a [u8]>,
    members: u64,
    /// What follows the last member, if anything.
    rest: Option<&'a [u8]>,
    packed: usize,
    unpacked: u64,
    limits: &'a Limits,
}

impl Read for Gz<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() || self.rest.is_some() {
            return Ok(0);
        }
        let n = loop {
            let n = self.member.read(buffer)?;
            let rest = *self.member.get_ref();
            if n > 0 || rest.is_empty() {
                break n;
            }
            if !rest.starts_with(b"\x1f\x8b") {
                self.rest = Some(rest);
                break 0;
            }
            self.members += 1;
            // Each costs more than it weighs.
            if self.members > MAX_MEMBERS {
                return Err(io::Error::other(GzLimit::Members));
            }
            self.member = GzDecoder::new(rest);
        };
        self.unpacked += n as u64;
        let consumed = self.packed - self.member.get_ref().len();
        if self.limits.ratio_exceeded(self.unpacked, consumed as u64) {
            return Err(io::Error::other(GzLimit::Ratio));
        }
        // Headers and padding come on top of the contents: at most two blocks an entry.
        let overhead = self.limits.max_entries.saturating_mul(2 * BLOCK as u64) + 2 * MAX_PADDING;
        if self.unpacked > mib(self.limits.max_total_mib).saturating_add(overhead) {
            return Err(io::Error::other(GzLimit::Total));
        }
        Ok(n)
    }
}

/// A limit that gzip data exceed, on its way through an [`io::Error`].
#[derive(Debug, thiserror::Error)]
enum GzLimit {
    #[error("ratio limit")]
    Ratio,
    #[error("total limit")]
    Total,
    #[error("members limit")]
    Members,
}

/// What a reading error means.
fn unreadable(error: &io::Error, limits: &Limits) -> Finding {
    const HINT: &str = "submit only the files of the tree";
    match error.get_ref().and_then(|inner| inner.downcast_ref()) {
        Some(GzLimit::Ratio) => {
            let message =
                format!("unpacks to more than {} times its packed size", limits.max_ratio);
            Finding::error("limit_ratio", message).hint(HINT)
        }
        Some(GzLimit::Total) => {
            let message = format!("unpacks to more than the limit of {} MiB", limits.max_total_mib);
            Finding::error("limit_total", message).hint(HINT)
        }
        Some(GzLimit::Members) => {
            let message = format!("more than {MAX_MEMBERS} pieces of gzip data");
            Finding::error("limit_members", message).hint(AGAIN)
        }
        None => {
            let message =
                format!("the compressed data cannot be read: {}", printable(&error.to_string()));
            Finding::error("gz_corrupt", message)
                .hint("the upload may have been cut off; submit it again")
        }
    }
}

/// Extended headers that stand before an entry.
#[derive(Default)]
struct Extended {
    long_name: Option<Vec<u8>>,
    pax: Vec<(String, Vec<u8>)>,
}

/// Reads a tar from `reader` into the copy.
pub(super) fn read(mut reader: impl Read, copy: &mut PrivateCopy<'_>) -> Result<(), Stop> {
    let mut extended: Option<Extended> = None;
    let mut first = true;
    loop {
        let Some(block) = next_block(&mut reader, first, copy)? else {
            copy.findings.push(
                Finding::warning(
                    "tar_no_end",
                    "expected two blocks of zeros at the end, found none",
                )
                .hint("the upload may have been cut off"),
            );
            break;
        };
        if block.iter().all(|b| *b == 0) {
            check_padding(&mut reader, copy)?;
            break;
        }
        if !is_header(&block) {
            if first {
                return Err(copy.refuse(not_a_tar()));
            }
            let message = "expected an entry's header with a right checksum, found something else";
            return Err(copy.refuse(Finding::error("tar_checksum", message).hint(AGAIN)));
        }
        first = false;
        copy.count_entry()?;
        let header = Header::from_byte_slice(&block);
        let raw_name = header.path_bytes().into_owned();
        let size = match header.entry_size() {
            Ok(size) => size,
            Err(_) => {
                let finding = Finding::error("tar_header", "the size field is not a number");
                return Err(copy.refuse(finding.at(printable_bytes(&raw_name)).hint(AGAIN)));
            }
        };
        let entry_type = header.entry_type();
        match entry_type {
            EntryType::GNULongName
            | EntryType::GNULongLink
            | EntryType::XHeader
            | EntryType::XGlobalHeader => {
                let data = read_extended(&mut reader, size, copy)?;
                let pending = extended.get_or_insert_default();
                take_extended(entry_type, data, pending, copy)?;
                if entry_type == EntryType::XGlobalHeader
                    && pending.long_name.is_none()
                    && pending.pax.is_empty()
                {
                    extended = None;
                }
            }
            _ => {
                let extended = extended.take().unwrap_or_default();
                read_entry(&mut reader, entry_type, &raw_name, size, extended, copy)?;
            }
        }
    }
    if extended.is_some() {
        return Err(copy.refuse(
            Finding::error("tar_header", "an extended header without an entry after it")
                .hint(AGAIN),
        ));
    }
    Ok(())
}

fn next_block(
    reader: &mut impl Read,
    first: bool,
    copy: &mut PrivateCopy<'_>,
) -> Result<Option<[u8; BLOCK]>, Stop> {
    let mut block = [0; BLOCK];
    let mut filled = 0;
    while filled < BLOCK {
        match reader.read(&mut block[filled..]) {
            Ok(0) if filled == 0 => return Ok(None),
            Ok(0) if first => return Err(copy.refuse(not_a_tar())),
            Ok(0) => return Err(copy.refuse(truncated("the last block is not whole"))),
            Ok(n) => filled += n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(copy.refuse(unreadable(&e, copy.limits))),
        }
    }
    Ok(Some(block))
}

fn not_a_tar() -> Finding {
    Finding::error("not_a_tar", "the packed data is not a tar archive").hint(AGAIN)
}

fn truncated(message: &str) -> Finding {
    Finding::error("tar_truncated", message)
        .hint("the upload may have been cut off; submit it again")
}

/// After the first zero block only zeros may follow.
fn check_padding(reader: &mut impl Read, copy: &mut PrivateCopy<'_>) -> Result<(), Stop> {
    let mut buffer = [0; 8 * BLOCK];
    let mut padding = 0u64;
    loop {
        let n = match reader.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(n) => n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(e) => return Err(copy.refuse(unreadable(&e, copy.limits))),
        };
        padding += n as u64;
        if padding > MAX_PADDING || buffer[..n].iter().any(|b| *b != 0) {
            return Err(copy.refuse(
                Finding::error("tar_data_after", "data follow the end of the archive").hint(AGAIN),
            ));
        }
    }
}

/// The data of an extended header, without its padding.
fn read_extended(
    reader: &mut impl Read,
    size: u64,
    copy: &mut PrivateCopy<'_>,
) -> Result<Vec<u8>, Stop> {
    if size > MAX_EXTENDED {
        let message =
            format!("an extended header of {size} bytes, over the limit of {MAX_EXTENDED}");
        return Err(copy.refuse(Finding::error("tar_header", message).hint(AGAIN)));
    }
    copy.count_bytes(size, "extended header")?;
    let mut data = Vec::new();
    match reader.take(padded(size)).read_to_end(&mut data) {
        Ok(n) if n as u64 == padded(size) => {}
        Ok(_) => return Err(copy.refuse(truncated("an extended header is cut off"))),
        Err(e) => return Err(copy.refuse(unreadable(&e, copy.limits))),
    }
    data.truncate(size as usize);
    Ok(data)
}

fn padded(size: u64) -> u64 {
    size.saturating_add((BLOCK as u64 - size % BLOCK as u64) % BLOCK as u64)
}

fn take_extended(
    entry_type: EntryType,
    mut data: Vec<u8>,
    extended: &mut Extended,
    copy: &mut PrivateCopy<'_>,
) -> Result<(), Stop> {
    match entry_type {
        EntryType::GNULongName => {
            // One NUL ends the name; more would hide something.
            if data.last() == Some(&0) {
                data.pop();
            }
            if extended.long_name.replace(data).is_some() {
                return Err(copy.refuse(
                    Finding::error("tar_header", "two long names for one entry").hint(AGAIN),
                ));
            }
        }
        // Links are refused whatever they point to.
        EntryType::GNULongLink => {}
        _ => {
            let Some(records) = pax_records(&data) else {
                return Err(copy.refuse(
                    Finding::error("tar_header", "an extended header that cannot be read")
                        .hint(AGAIN),
                ));
            };
            if entry_type == EntryType::XHeader {
                extended.pax.extend(records);
            } else if let Some((key, _)) = records.iter().find(|(key, _)| changes_entry(key)) {
                let message = format!("a global header sets '{}' for all entries", printable(key));
                return Err(copy.refuse(Finding::error("tar_global_override", message).hint(AGAIN)));
            }
        }
    }
    Ok(())
}

/// Pax keys that change what an entry is.
fn changes_entry(key: &str) -> bool {
    matches!(key, "path" | "size" | "linkpath") || key.starts_with("GNU.sparse")
}

/// Records `LENGTH KEY=VALUE\n`, where LENGTH counts the whole record.
fn pax_records(mut data: &[u8]) -> Option<Vec<(String, Vec<u8>)>> {
    let mut records = Vec::new();
    while !data.is_empty() {
        let space = data.iter().take(10).position(|b| *b == b' ')?;
        let length: usize = std::str::from_utf8(&data[..space]).ok()?.parse().ok()?;
        let record = data.get(space + 1..length)?.strip_suffix(b"\n")?;
        let equals = record.iter().position(|b| *b == b'=')?;
        let key = String::from_utf8(record[..equals].to_vec()).ok()?;
        records.push((key, record[equals + 1..].to_vec()));
        data = &data[length..];
    }
    Some(records)
}

fn read_entry(
    reader: &mut impl Read,
    entry_type: EntryType,
    header_name: &[u8],
    size: u64,
    extended: Extended,
    copy: &mut PrivateCopy<'_>,
) -> Result<(), Stop> {
    let name = entry_name(header_name, size, extended, copy)?;
    // Old tars mark a folder by its name alone.
    let kind = match entry_type {
        EntryType::Directory => Kind::Folder,
        EntryType::Regular | EntryType::Continuous if name.ends_with(b"/") => Kind::Folder,
        EntryType::Regular | EntryType::Continuous => Kind::File,
        // Nothing of it is copied, and nothing lies behind it.
        _ if copy.is_ignored(&name) => return skip(reader, padded(size), &name, copy),
        other => {
            copy.findings.push(special(other).at(printable_bytes(&name)));
            return skip(reader, padded(size), &name, copy);
        }
    };
    match copy.accept(&name, kind) {
        EntryAction::File(path) => {
            let mut data = reader.by_ref().take(size);
            match copy.write(&path, &mut data, None)? {
                Ok(written) if written.bytes == size => {}
                Ok(written) => {
                    let message = format!("expected {size} bytes, found {}", written.bytes);
                    return Err(copy.refuse(truncated(&message).at(path)));
                }
                Err(e) => return Err(copy.refuse(unreadable(&e, copy.limits).at(path))),
            }
            skip(reader, padded(size) - size, &name, copy)
        }
        EntryAction::Folder if size > 0 => {
            let message = format!("a folder that holds {size} bytes");
            Err(copy.refuse(
                Finding::error("tar_header", message).at(printable_bytes(&name)).hint(AGAIN),
            ))
        }
        _ => skip(reader, padded(size), &name, copy),
    }
}

/// The name that counts: pax before GNU before the header's own, as GNU tar and bsdtar do.
fn entry_name(
    header_name: &[u8],
    size: u64,
    extended: Extended,
    copy: &mut PrivateCopy<'_>,
) -> Result<Vec<u8>, Stop> {
    let mut name = extended.long_name.unwrap_or_else(|| header_name.to_owned());
    let mut paths = 0;
    for (key, value) in extended.pax {
        match key.as_str() {
            "path" => {
                name = value;
                paths += 1;
            }
            "size" if value != size.to_string().as_bytes() => {
                let message = format!(
                    "size: the entry's header says {size}, the pax header {}",
                    printable_bytes(&value)
                );
                return Err(copy.refuse(
                    Finding::error("tar_pax_size", message).at(printable_bytes(&name)).hint(AGAIN),
                ));
            }
            key if key.starts_with("GNU.sparse") => {
                let finding = special(EntryType::GNUSparse).at(printable_bytes(&name));
                return Err(copy.refuse(finding));
            }
            _ => {}
        }
    }
    if paths > 1 {
        let message = "two pax headers name the same entry";
        return Err(copy
            .refuse(Finding::error("tar_header", message).at(printable_bytes(&name)).hint(AGAIN)));
    }
    Ok(name)
}

fn special(entry_type: EntryType) -> Finding {
    let (code, found, hint) = match entry_type {
        EntryType::Symlink => ("link", "a symbolic link", "put the file itself there"),
        EntryType::Link => ("link", "a hard link", "put the file itself there"),
        EntryType::Char | EntryType::Block => ("special_file", "a device", "leave it out"),
        EntryType::Fifo => ("special_file", "a fifo", "leave it out"),
        EntryType::GNUSparse => {
            ("tar_sparse", "a sparse file", "make the archive without --sparse")
        }
        _ => ("tar_type", "an entry of another type", AGAIN),
    };
    Finding::error(code, format!("expected a file or folder, found {found}")).hint(hint)
}

/// Passes over `size` bytes, counting them.
fn skip(
    reader: &mut impl Read,
    size: u64,
    name: &[u8],
    copy: &mut PrivateCopy<'_>,
) -> Result<(), Stop> {
    let mut data = reader.take(size);
    let mut buffer = [0; 8 * BLOCK];
    let mut skipped = 0;
    while skipped < size {
        match data.read(&mut buffer) {
            Ok(0) => {
                return Err(copy.refuse(truncated("its data is cut off").at(printable_bytes(name))));
            }
            Ok(n) => {
                skipped += n as u64;
                copy.count_bytes(n as u64, &printable_bytes(name))?;
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => {
                return Err(copy.refuse(unreadable(&e, copy.limits).at(printable_bytes(name))));
            }
        }
    }
    Ok(())
}
