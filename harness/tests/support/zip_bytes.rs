//! Zip archives in which every header field can lie.

use std::io::Write;

use flate2::Compression;
use flate2::write::DeflateEncoder;

/// Header fields of one entry, once for each of its two headers.
#[derive(Clone)]
pub struct Header {
    pub name: Vec<u8>,
    pub flags: u16,
    pub method: u16,
    pub crc32: u32,
    pub packed: u32,
    pub unpacked: u32,
    pub extra: Vec<u8>,
}

/// One entry. A freshly made one is honest; tests change what they lie about.
#[derive(Clone)]
pub struct Entry {
    pub local: Header,
    pub central: Header,
    pub data: Vec<u8>,
    pub descriptor: Vec<u8>,
    /// External attributes; st_mode in the upper half.
    pub attributes: u32,
    pub disk: u16,
    /// Place of the local header as the directory says; `None` is the true one.
    pub offset: Option<u32>,
}

pub fn crc32(content: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(content);
    crc.sum()
}

pub fn deflated(content: &[u8]) -> Vec<u8> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(content).unwrap();
    encoder.finish().unwrap()
}

impl Entry {
    /// An uncompressed file.
    pub fn stored(name: &str, content: &[u8]) -> Self {
        Self::with(name.as_bytes(), 0, content.to_vec(), content)
    }

    /// A deflated file.
    pub fn deflated(name: &str, content: &[u8]) -> Self {
        Self::with(name.as_bytes(), 8, deflated(content), content)
    }

    pub fn with(name: &[u8], method: u16, data: Vec<u8>, content: &[u8]) -> Self {
        let header = Header {
            name: name.to_vec(),
            flags: 0,
            method,
            crc32: crc32(content),
            packed: data.len() as u32,
            unpacked: content.len() as u32,
            extra: Vec::new(),
        };
        Self {
            local: header.clone(),
            central: header,
            data,
            descriptor: Vec::new(),
            attributes: 0o100644 << 16,
            disk: 0,
            offset: None,
        }
    }

    /// Changes both headers alike.
    pub fn both(mut self, change: impl Fn(&mut Header)) -> Self {
        change(&mut self.local);
        change(&mut self.central);
        self
    }

    /// As a writer that streams: sizes and checksum after the data.
    pub fn streamed(mut self) -> Self {
        self.local.flags |= 8;
        self.central.flags |= 8;
        (self.local.crc32, self.local.packed, self.local.unpacked) = (0, 0, 0);
        self.descriptor = b"PK\x07\x08".to_vec();
        for field in [self.central.crc32, self.central.packed, self.central.unpacked] {
            self.descriptor.extend(field.to_le_bytes());
        }
        self
    }

    pub fn mode(mut self, mode: u32) -> Self {
        self.attributes = mode << 16;
        self
    }
}

/// A whole archive; its end record can lie too.
#[derive(Clone, Default)]
pub struct Zip {
    pub prefix: Vec<u8>,
    pub entries: Vec<Entry>,
    /// Bytes between the entries and the directory.
    pub gap: Vec<u8>,
    /// Bytes between the directory and its end record.
    pub before_end: Vec<u8>,
    pub comment: Vec<u8>,
    pub comment_length: Option<u16>,
    pub suffix: Vec<u8>,
    pub count: Option<u16>,
    pub directory_size: Option<u32>,
    pub directory_offset: Option<u32>,
    pub disk: u16,
}

impl Zip {
    pub fn of(entries: impl IntoIterator<Item = Entry>) -> Self {
        Self { entries: entries.into_iter().collect(), ..Self::default() }
    }

    pub fn bytes(&self) -> Vec<u8> {
        let mut out = self.prefix.clone();
        let mut offsets = Vec::new();
        for entry in &self.entries {
            offsets.push(out.len() as u32);
            out.extend(b"PK\x03\x04");
            push_fields(&mut out, &entry.local, 20);
            out.extend((entry.local.name.len() as u16).to_le_bytes());
            out.extend((entry.local.extra.len() as u16).to_le_bytes());
            out.extend(&entry.local.name);
            out.extend(&entry.local.extra);
            out.extend(&entry.data);
            out.extend(&entry.descriptor);
        }
        out.extend(&self.gap);
        let start = out.len();
        for (entry, offset) in self.entries.iter().zip(offsets) {
            out.extend(b"PK\x01\x02");
            out.extend([20, 3]);
            push_fields(&mut out, &entry.central, 20);
            out.extend((entry.central.name.len() as u16).to_le_bytes());
            out.extend((entry.central.extra.len() as u16).to_le_bytes());
            out.extend([0; 2]);
            out.extend(entry.disk.to_le_bytes());
            out.extend([0; 2]);
            out.extend(entry.attributes.to_le_bytes());
            out.extend(entry.offset.unwrap_or(offset).to_le_bytes());
            out.extend(&entry.central.name);
            out.extend(&entry.central.extra);
        }
        let size = out.len() - start;
        out.extend(&self.before_end);
        out.extend(b"PK\x05\x06");
        out.extend(self.disk.to_le_bytes());
        out.extend(self.disk.to_le_bytes());
        let count = self.count.unwrap_or(self.entries.len() as u16);
        out.extend(count.to_le_bytes());
        out.extend(count.to_le_bytes());
        out.extend(self.directory_size.unwrap_or(size as u32).to_le_bytes());
        out.extend(self.directory_offset.unwrap_or(start as u32).to_le_bytes());
        out.extend(self.comment_length.unwrap_or(self.comment.len() as u16).to_le_bytes());
        out.extend(&self.comment);
        out.extend(&self.suffix);
        out
    }
}

/// The fields that both headers have in the same order.
fn push_fields(out: &mut Vec<u8>, header: &Header, version: u16) {
    out.extend(version.to_le_bytes());
    out.extend(header.flags.to_le_bytes());
    out.extend(header.method.to_le_bytes());
    out.extend([0, 0, 0x21, 0]);
    out.extend(header.crc32.to_le_bytes());
    out.extend(header.packed.to_le_bytes());
    out.extend(header.unpacked.to_le_bytes());
}

/// An extra field.
pub fn extra(id: u16, data: &[u8]) -> Vec<u8> {
    let mut out = id.to_le_bytes().to_vec();
    out.extend((data.len() as u16).to_le_bytes());
    out.extend(data);
    out
}
