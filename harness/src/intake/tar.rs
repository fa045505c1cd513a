//! Tar archives, read block by block: header fields by the `tar` crate, and
//! everything that gives an entry its name or meaning decided here.
//!
//! Formats: POSIX pax interchange (IEEE 1003.1, `pax`), and GNU tar's long names.

use std::io::{self, Read};
use std::path::Path;

use tar::{EntryType, Header};

use super::copy::{EntryAction, EntryKind, PrivateCopy, Stop};
use super::finding::Finding;
use super::submission::IntakeError;
use super::tar_sparse::{Map, Records, gnu_map};
use crate::columns::count;
use crate::harmless::{printable, printable_bytes};

pub(super) const BLOCK: usize = 512;
/// Longest extended header that is read [bytes]; macOS writes a few KB of attributes.
const MAX_EXTENDED: u64 = 1 << 20;
/// What may stand after the end beside zeros, such as a line that a mailer added [bytes].
const MAX_AFTER: u64 = 1 << 20;
/// Zeros after the end that no limit counts; GNU tar pads to 10 KiB, by option to some MiB [bytes].
pub(super) const PADDING: u64 = 1 << 20;
pub(super) const AGAIN: &str =
    "make the archive again with 'tar czf a2_first_last.tar.gz FOLDER', or with umbra pack";

/// The type of the name of a whole tape, by `tar --label`.
const VOLUME_LABEL: u8 = b'V';
/// The type of a folder in an incremental backup, by `tar --listed-incremental`.
const DUMPED_FOLDER: u8 = b'D';

/// Whether the first block is a tar header. An empty tar is zeros, as is what a failed upload leaves.
pub(super) fn looks_like_tar(bytes: &[u8]) -> bool {
    let Some(block) = bytes.get(..BLOCK) else {
        return false;
    };
    is_header(block)
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

/// Extended headers that stand before an entry.
#[derive(Default)]
struct Extended {
    long_name: Option<Vec<u8>>,
    long_link: Option<Vec<u8>>,
    pax: Vec<(String, Vec<u8>)>,
}

/// What an entry is, by its headers.
struct Named {
    name: Vec<u8>,
    /// What a link leads to.
    link: Vec<u8>,
    /// Where the data of a sparse file belong, in pax.
    sparse: Option<Records>,
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
        let entry_type = header.entry_type();
        let size = match header.entry_size() {
            Ok(size) => size,
            // GNU tar leaves it blank.
            Err(_) if entry_type.as_byte() == VOLUME_LABEL => 0,
            Err(_) => {
                let finding = Finding::error("tar_header", "the size field is not a number");
                return Err(copy.refuse(finding.at(printable_bytes(&raw_name)).hint(AGAIN)));
            }
        };
        match entry_type {
            EntryType::GNULongName
            | EntryType::GNULongLink
            | EntryType::XHeader
            | EntryType::XGlobalHeader => {
                if entry_type == EntryType::XGlobalHeader {
                    copy.count_kept()?;
                }
                let data = read_extended(&mut reader, size, copy)?;
                let pending = extended.get_or_insert_default();
                take_extended(entry_type, data, pending, copy)?;
                if entry_type == EntryType::XGlobalHeader
                    && pending.long_name.is_none()
                    && pending.long_link.is_none()
                    && pending.pax.is_empty()
                {
                    extended = None;
                }
            }
            _ => {
                let extended = extended.take().unwrap_or_default();
                read_entry(&mut reader, header, size, extended, copy)?;
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
            Err(e) => return Err(copy.refuse(unreadable(&e))),
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

/// What follows the first zero block: zeros, or something that is surely no second archive.
fn check_padding(reader: &mut impl Read, copy: &mut PrivateCopy<'_>) -> Result<(), Stop> {
    let mut padding = 0u64;
    let mut after = 0u64;
    loop {
        let mut block = Vec::with_capacity(BLOCK);
        match reader.by_ref().take(BLOCK as u64).read_to_end(&mut block) {
            Ok(0) => break,
            Ok(n) => padding += n as u64,
            Err(e) => return Err(copy.refuse(unreadable(&e))),
        }
        if padding > PADDING {
            copy.count_bytes(block.len() as u64, "what follows the end")?;
        }
        if after > 0 || block.iter().any(|b| *b != 0) {
            after += block.len() as u64;
        }
        if after > MAX_AFTER || is_header(&block) {
            let message = "data follow the end of the archive";
            return Err(copy.refuse(Finding::error("tar_data_after", message).hint(AGAIN)));
        }
    }
    if after > 0 {
        let message = format!(
            "{} after the end of the archive: no part of it",
            count(usize::try_from(after).unwrap_or(usize::MAX), "byte")
        );
        copy.findings.push(Finding::warning("tar_data_after", message).hint(AGAIN));
    }
    Ok(())
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
        Err(e) => return Err(copy.refuse(unreadable(&e))),
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
        EntryType::GNULongLink => {
            if data.last() == Some(&0) {
                data.pop();
            }
            extended.long_link = Some(data);
        }
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
    header: &Header,
    size: u64,
    extended: Extended,
    copy: &mut PrivateCopy<'_>,
) -> Result<(), Stop> {
    let Named { name, link, sparse } = names(header, size, extended, copy)?;
    let entry_type = header.entry_type();
    let is_folder = entry_type.is_dir() || entry_type.as_byte() == DUMPED_FOLDER;
    // Old tars mark a folder by its name alone.
    let kind = match entry_type {
        _ if is_folder => EntryKind::Folder,
        EntryType::Regular | EntryType::Continuous if name.ends_with(b"/") => EntryKind::Folder,
        EntryType::Regular | EntryType::Continuous | EntryType::GNUSparse => EntryKind::File,
        // Nothing of it is copied, and nothing lies behind it.
        _ if copy.is_ignored(&name) => return skip(reader, padded(size), &name, copy),
        EntryType::Link => return read_link(reader, size, &name, &link, copy),
        other if other.as_byte() == VOLUME_LABEL => {
            let message = format!("the archive calls itself '{}'", printable_bytes(&name));
            copy.findings.push(Finding::note("tar_label", message));
            return skip(reader, padded(size), &name, copy);
        }
        other => {
            copy.findings.push(special(other).at(printable_bytes(&name)));
            return skip(reader, padded(size), &name, copy);
        }
    };
    // An incremental backup lists a folder in its data.
    let is_empty = size == 0 || entry_type.as_byte() == DUMPED_FOLDER;
    match copy.accept(&name, kind) {
        EntryAction::File(path) => {
            let map = match (sparse, entry_type) {
                (Some(records), _) => records.map(size, reader),
                (None, EntryType::GNUSparse) => {
                    gnu_map(header, size, reader).map(|map| map.map(|map| (map, 0)))
                }
                (None, _) => Ok(Some((Map::whole(size), 0))),
            };
            let (map, read) = match map {
                Ok(Some(map)) => map,
                Ok(None) => {
                    let message = "a sparse file whose pieces do not fit together";
                    let finding = Finding::error("tar_sparse", message).at(path);
                    return Err(copy.refuse(finding.hint("make the archive without --sparse")));
                }
                Err(e) => return Err(copy.refuse(unreadable(&e).at(path))),
            };
            let whole = map.size;
            let mut data = map.expand(reader.by_ref().take(size - read));
            match copy.write(&path, &mut data, None)? {
                Ok(written) if written.bytes == whole => {}
                Ok(written) => {
                    let message = format!("expected {whole} bytes, found {}", written.bytes);
                    return Err(copy.refuse(truncated(&message).at(path)));
                }
                Err(e) => return Err(copy.refuse(unreadable(&e).at(path))),
            }
            skip(reader, padded(size) - size, &name, copy)
        }
        EntryAction::Folder if !is_empty => {
            let message = format!("a folder that holds {size} bytes");
            Err(copy.refuse(
                Finding::error("tar_header", message).at(printable_bytes(&name)).hint(AGAIN),
            ))
        }
        _ => skip(reader, padded(size), &name, copy),
    }
}

/// A hard link is a second name of a file that came before. It holds no data.
fn read_link(
    reader: &mut impl Read,
    size: u64,
    name: &[u8],
    link: &[u8],
    copy: &mut PrivateCopy<'_>,
) -> Result<(), Stop> {
    let file = if size == 0 { copy.earlier(link)? } else { None };
    let Some(mut file) = file else {
        copy.findings.push(special(EntryType::Link).at(printable_bytes(name)));
        return skip(reader, padded(size), name, copy);
    };
    if let EntryAction::File(path) = copy.accept(name, EntryKind::File) {
        copy.write(&path, &mut file, None)?
            .map_err(|e| IntakeError::io("read", Path::new(&path), e))?;
    }
    Ok(())
}

/// The names that count: pax before GNU before the header's own, as GNU tar and bsdtar do.
fn names(
    header: &Header,
    size: u64,
    extended: Extended,
    copy: &mut PrivateCopy<'_>,
) -> Result<Named, Stop> {
    let mut name = extended.long_name.unwrap_or_else(|| header.path_bytes().into_owned());
    let own_link = || header.link_name_bytes().map(|link| link.into_owned()).unwrap_or_default();
    let mut link = extended.long_link.unwrap_or_else(own_link);
    let mut paths = 0;
    let mut sparse: Option<Records> = None;
    for (key, value) in extended.pax {
        match key.as_str() {
            "path" => {
                name = value;
                paths += 1;
            }
            "linkpath" => link = value,
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
                let makes_sense = sparse.get_or_insert_default().take(key, &value);
                if !makes_sense {
                    let finding = special(EntryType::GNUSparse).at(printable_bytes(&name));
                    return Err(copy.refuse(finding));
                }
            }
            _ => {}
        }
    }
    if paths > 1 {
        let message = "two pax headers name the same entry";
        return Err(copy
            .refuse(Finding::error("tar_header", message).at(printable_bytes(&name)).hint(AGAIN)));
    }
    let name = sparse.as_ref().and_then(Records::name).unwrap_or(name);
    let name = copy.backslashes.read(name, false);
    let link = if link.is_empty() { link } else { copy.backslashes.read(link, false) };
    Ok(Named { name, link, sparse })
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
                return Err(copy.refuse(unreadable(&e).at(printable_bytes(name))));
            }
        }
    }
    Ok(())
}

/// What a reader has against what it reads, on its way through an [`io::Error`].
#[derive(Debug, thiserror::Error)]
#[error("{}", .0)]
pub(super) struct Refused(pub Finding);

/// What a reading error means.
fn unreadable(error: &io::Error) -> Finding {
    if let Some(Refused(finding)) = error.get_ref().and_then(|inner| inner.downcast_ref()) {
        return finding.clone();
    }
    let message = format!("the compressed data cannot be read: {}", printable(&error.to_string()));
    // What ends too early was cut off; what has another checksum or code was changed on its way.
    let hint = match error.kind() {
        io::ErrorKind::UnexpectedEof => "the upload may have been cut off; submit it again",
        _ => "the file is damaged; make the archive again and submit it",
    };
    Finding::error("gz_corrupt", message).hint(hint)
}
