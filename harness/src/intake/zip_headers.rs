//! The headers of a zip's entries: each stands twice in the archive, and both must agree.

use flate2::Crc;

use super::finding::{Finding, printable_bytes};
use super::zip::AGAIN;

const LOCAL: &[u8] = b"PK\x03\x04";
pub(super) const CENTRAL: &[u8] = b"PK\x01\x02";
const DESCRIPTOR: &[u8] = b"PK\x07\x08";
const CENTRAL_SIZE: usize = 46;
const LOCAL_SIZE: usize = 30;
pub(super) const ZIP64: u32 = u32::MAX;

/// One entry whose two headers agree.
pub(super) struct Entry<'a> {
    pub(super) name: Vec<u8>,
    pub(super) deflated: bool,
    pub(super) unpacked_bytes: u64,
    pub(super) crc32: u32,
    pub(super) data: &'a [u8],
    /// Bytes of the archive that it takes: local header, data, descriptor.
    pub(super) start: usize,
    pub(super) end: usize,
}

impl Entry<'_> {
    pub(super) fn shown(&self) -> String {
        printable_bytes(&self.name)
    }
}

/// A header of the central directory.
pub(super) struct Central<'a> {
    pub(super) flags: u16,
    pub(super) method: u16,
    pub(super) crc32: u32,
    pub(super) packed: u32,
    pub(super) unpacked: u32,
    pub(super) disk: u16,
    pub(super) attributes: u32,
    pub(super) local: usize,
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
pub(super) fn check_entry<'a>(
    bytes: &'a [u8],
    central: &Central<'_>,
    limit: usize,
) -> Result<Entry<'a>, Finding> {
    check_kind(central)?;
    let at = central.local;
    let header = bytes[..limit].get(at..).and_then(|rest| rest.get(..LOCAL_SIZE));
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
        let message =
            format!("the directory names it so, its own header '{}'", printable_bytes(name));
        return Err(disagree(message));
    }
    // Flags that change the meaning of the data or of the header: encryption and descriptor.
    const MEANING: u16 = 1 | 8 | 0x20 | 0x40 | 0x2000;
    let same_flags = flags & MEANING == central.flags & MEANING;
    if !same_flags {
        let message =
            format!("flags: directory {:#06x}, its own header {flags:#06x}", central.flags);
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
        + if has_descriptor { descriptor_size(&bytes[data_end..limit], central)? } else { 0 };
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
    let has_zip64 = [central.packed, central.unpacked, central.local as u32].contains(&ZIP64)
        || extra_field(central.extra, 1).is_some();
    if has_zip64 {
        return Err(
            Finding::error("zip64", "zip64 sizes, which no hand-in of this size needs").hint(AGAIN)
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
    Err(disagree(format!("{what}: the directory says {central}, the entry's own header {local}")))
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
    Err(disagree("the descriptor after its data says something else than the directory".to_owned()))
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
