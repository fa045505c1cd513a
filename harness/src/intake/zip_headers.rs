//! The headers of a zip's entries: each stands twice in the archive, and both must agree.

use flate2::Crc;

use super::finding::Finding;
use crate::harmless::printable_bytes;

/// What to do about an archive that is not as it should be.
pub(super) const AGAIN: &str =
    "make the archive again with your system's own zip program, or with umbra pack";
pub(super) const LOCAL: &[u8] = b"PK\x03\x04";
pub(super) const CENTRAL: &[u8] = b"PK\x01\x02";
const DESCRIPTOR: &[u8] = b"PK\x07\x08";
const CENTRAL_SIZE: usize = 46;
const LOCAL_SIZE: usize = 30;
/// What a field holds when a zip64 record or field holds its value.
pub(super) const ZIP64: u32 = u32::MAX;
/// The attribute of folders of MS-DOS and Windows.
const DOS_FOLDER: u32 = 0x10;

/// One entry whose two headers agree.
pub(super) struct Entry<'a> {
    pub(super) name: Vec<u8>,
    pub(super) deflated: bool,
    pub(super) unpacked_bytes: u64,
    pub(super) crc32: u32,
    pub(super) data: &'a [u8],
    /// Whether the file system that it comes from says that it is a folder.
    pub(super) marked_folder: bool,
    /// Whether a backslash cannot be part of its name, where it was made.
    pub(super) of_windows: bool,
    /// Bytes of the archive that it takes: local header, data, descriptor.
    pub(super) start: usize,
    pub(super) end: usize,
}

impl Entry<'_> {
    /// A folder's name ends with a slash, but some programs only mark it.
    pub(super) fn is_folder(&self) -> bool {
        self.name.ends_with(b"/") || self.marked_folder && self.unpacked_bytes == 0
    }

    pub(super) fn shown(&self) -> String {
        printable_bytes(&self.name)
    }
}

/// A header of the central directory.
pub(super) struct Central<'a> {
    /// The kind of file system that it was made on (4.4.2): 0 FAT, 10 NTFS, 14 VFAT, 11 MVS in the
    /// specification and NTFS in Info-ZIP's programs.
    pub(super) host: u8,
    pub(super) flags: u16,
    pub(super) method: u16,
    pub(super) crc32: u32,
    /// Plain fields; [`ZIP64`] where a zip64 field counts.
    pub(super) packed: u32,
    pub(super) unpacked: u32,
    pub(super) disk: u16,
    pub(super) attributes: u32,
    pub(super) local: u32,
    pub(super) name: &'a [u8],
    pub(super) extra: &'a [u8],
    pub(super) end: usize,
}

impl<'a> Central<'a> {
    pub(super) fn at(bytes: &'a [u8], at: usize) -> Option<Self> {
        if !bytes.get(at..)?.starts_with(CENTRAL) {
            return None;
        }
        let name_end = at + CENTRAL_SIZE + usize::from(u16_at(bytes, at + 28)?);
        let extra_end = name_end + usize::from(u16_at(bytes, at + 30)?);
        let end = extra_end + usize::from(u16_at(bytes, at + 32)?);
        bytes.get(..end)?;
        Some(Self {
            host: *bytes.get(at + 5)?,
            flags: u16_at(bytes, at + 8)?,
            method: u16_at(bytes, at + 10)?,
            crc32: u32_at(bytes, at + 16)?,
            packed: u32_at(bytes, at + 20)?,
            unpacked: u32_at(bytes, at + 24)?,
            disk: u16_at(bytes, at + 34)?,
            attributes: u32_at(bytes, at + 38)?,
            local: u32_at(bytes, at + 42)?,
            name: &bytes[at + CENTRAL_SIZE..name_end],
            extra: &bytes[name_end..extra_end],
            end,
        })
    }
}

/// Checks one entry: what it is, and that its local header says the same as the directory. `base` is what
/// the archive's offsets count from, `limit` where the directory begins.
pub(super) fn check_entry<'a>(
    bytes: &'a [u8],
    central: &Central<'_>,
    base: usize,
    limit: usize,
) -> Result<Entry<'a>, Finding> {
    check_kind(central)?;
    let plain = [central.unpacked, central.packed, central.local];
    let [unpacked, packed, local] = wide(plain, central.disk == u16::MAX, central.extra)?;
    let at = usize::try_from(local).ok().and_then(|local| local.checked_add(base));
    let header = at.and_then(|at| bytes[..limit].get(at..)?.get(..LOCAL_SIZE));
    let (Some(at), Some(header)) = (at, header.filter(|header| header.starts_with(LOCAL))) else {
        let message =
            format!("expected the entry's own header at byte {local}, found something else");
        return Err(Finding::error("zip_local_missing", message).hint(AGAIN));
    };
    let field16 = |offset| u16_at(header, offset).unwrap_or(0);
    let field32 = |offset| u32_at(header, offset).unwrap_or(0);
    let name_end = at + LOCAL_SIZE + usize::from(field16(26));
    let data_start = name_end + usize::from(field16(28));
    let data_end = usize::try_from(packed).ok().and_then(|packed| data_start.checked_add(packed));
    let Some(data_end) = data_end.filter(|&end| end <= limit) else {
        let message =
            format!("its {packed} bytes of data would reach into the directory at {limit}");
        return Err(Finding::error("zip_data_outside", message).hint(AGAIN));
    };
    let name = &bytes[at + LOCAL_SIZE..name_end];
    let extra = &bytes[name_end..data_start];
    if name != central.name {
        let message =
            format!("the directory names it so, its own header '{}'", printable_bytes(name));
        return Err(disagree(message));
    }
    // Flags that change the meaning of the data: encryption, patches. Whether a descriptor follows the data is
    // the local header's to say.
    const MEANING: u16 = 1 | 0x20 | 0x40 | 0x2000;
    let flags = field16(6);
    if flags & MEANING != central.flags & MEANING {
        let message =
            format!("flags: directory {:#06x}, its own header {flags:#06x}", central.flags);
        return Err(disagree(message));
    }
    agree("compression method", central.method.into(), field16(8).into())?;
    let has_descriptor = flags & 8 != 0;
    let [local_unpacked, local_packed] = wide([field32(22), field32(18)], false, extra)?;
    // A writer that streams leaves zeros for what it does not know yet, one by one.
    let mut is_deferred = false;
    for (what, central, local) in [
        ("crc32", u64::from(central.crc32), u64::from(field32(14))),
        ("packed size", packed, local_packed),
        ("unpacked size", unpacked, local_unpacked),
    ] {
        if has_descriptor && local == 0 {
            is_deferred |= central != 0;
        } else {
            agree(what, central, local)?;
        }
    }
    let rest = &bytes[data_end..limit];
    let descriptor = match descriptor_size(rest, central.crc32, packed, unpacked) {
        Some(size) if has_descriptor => size,
        // A descriptor may be promised and left out where nothing was deferred, as of folders.
        _ if has_descriptor && (is_deferred || rest.starts_with(DESCRIPTOR)) => {
            let message = "the descriptor after its data says something else than the directory";
            return Err(disagree(message.to_owned()));
        }
        _ => 0,
    };
    if central.method == 0 && packed != unpacked {
        let message = format!(
            "stored without compression, yet {packed} bytes packed and {unpacked} unpacked"
        );
        return Err(Finding::error("zip_size", message).hint(AGAIN));
    }
    Ok(Entry {
        name: effective_name(central.name, central.extra)?,
        deflated: central.method == 8,
        unpacked_bytes: unpacked,
        crc32: central.crc32,
        data: &bytes[data_start..data_end],
        of_windows: matches!(central.host, 0 | 10 | 11 | 14),
        marked_folder: central.attributes >> 28 == 0o4 || central.attributes & DOS_FOLDER != 0,
        start: at,
        end: data_end + descriptor,
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
        let message =
            format!("expected compression store or deflate, found {method} ({})", central.method);
        return Err(
            Finding::error("zip_compression", message).hint("choose the normal zip compression")
        );
    }
    if central.flags & 0x20 != 0 {
        return Err(Finding::error("zip_compression", "expected plain data, found patched data")
            .hint(AGAIN));
    }
    // The upper half of the attributes is st_mode where the archive was made on Unix.
    match central.attributes >> 28 {
        0 | 0o4 | 0o10 => {}
        0o12 => {
            return Err(Finding::error("link", "expected a file or folder, found a symbolic link")
                .hint("put the file itself there"));
        }
        _ => {
            return Err(Finding::error(
                "special_file",
                "expected a file or folder, found a device, fifo or socket",
            )
            .hint("leave it out"));
        }
    }
    if ![0, u16::MAX].contains(&central.disk) {
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
    Err(disagree(format!("{what}: the directory says {central}, the entry's own header {local}")))
}

/// The fields of a header that a zip64 field may hold instead, in its order (unpacked size, packed size, place
/// of the local header). It holds those that are full in the header; some writers repeat the others, which
/// must then agree.
fn wide<const N: usize>(
    plain: [u32; N],
    disk_too: bool,
    extra: &[u8],
) -> Result<[u64; N], Finding> {
    let refuse = |message: &str| Err(Finding::error("zip64", message).hint(AGAIN));
    let is_full = plain.map(|value| value == ZIP64);
    let full = is_full.iter().filter(|full| **full).count();
    let mut values = plain.map(u64::from);
    let Some(field) = extra_field(extra, 1) else {
        return if full > 0 { refuse("the zip64 sizes are missing") } else { Ok(values) };
    };
    let given: Vec<u64> = (0..field.len() / 8).filter_map(|i| u64_at(field, 8 * i)).collect();
    // The disk's number follows where it is full, or where all is repeated.
    let disk = field.get(8 * given.len()..).unwrap_or_default();
    let disk_fits = match disk.len() {
        0 => !disk_too,
        4 => disk == [0; 4],
        _ => false,
    };
    let fits = if given.len() == full {
        let own = values.iter_mut().zip(is_full).filter(|(_, full)| *full);
        own.zip(&given).for_each(|((value, _), given)| *value = *given);
        true
    } else {
        let beyond = is_full.iter().skip(given.len()).any(|full| *full);
        let mut own = values.iter_mut().zip(is_full).zip(&given);
        !beyond
            && given.len() <= N
            && own.all(|((value, full), given)| {
                let agrees = full || *value == *given;
                *value = *given;
                agrees
            })
    };
    if fits && disk_fits { Ok(values) } else { refuse("zip64 sizes that do not fit together") }
}

/// Size of the descriptor after an entry's data, when it repeats what the directory says: with or
/// without signature, with 64- or 32-bit sizes. The longer one first: the shorter one is its beginning where an
/// entry is empty.
fn descriptor_size(rest: &[u8], crc32: u32, packed: u64, unpacked: u64) -> Option<usize> {
    for signature in [DESCRIPTOR, b""] {
        let Some(body) = rest.strip_prefix(signature) else {
            continue;
        };
        if u32_at(body, 0) != Some(crc32) {
            continue;
        }
        if (u64_at(body, 4), u64_at(body, 12)) == (Some(packed), Some(unpacked)) {
            return Some(signature.len() + 20);
        }
        let sizes = (u32_at(body, 4).map(u64::from), u32_at(body, 8).map(u64::from));
        if sizes == (Some(packed), Some(unpacked)) {
            return Some(signature.len() + 12);
        }
    }
    None
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
        let message =
            format!("a second name hides in an extra field: '{}'", printable_bytes(unicode));
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

pub(super) fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at.checked_add(2)?)?.try_into().ok()?))
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?))
}

pub(super) fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.get(at..at.checked_add(8)?)?.try_into().ok()?))
}
