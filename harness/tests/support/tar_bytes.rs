//! Tar archives in which every header field can lie.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;

/// One 512-byte header and what follows it.
#[derive(Clone)]
pub struct Entry {
    pub name: Vec<u8>,
    pub kind: u8,
    pub link: Vec<u8>,
    /// The size field as written; `None` is the true one.
    pub size_field: Option<Vec<u8>>,
    pub checksum: Option<u32>,
    pub content: Vec<u8>,
}

impl Entry {
    pub fn file(name: &str, content: &[u8]) -> Self {
        Self::of(name.as_bytes(), b'0', content)
    }

    pub fn of(name: &[u8], kind: u8, content: &[u8]) -> Self {
        Self {
            name: name.to_vec(),
            kind,
            link: Vec::new(),
            size_field: None,
            checksum: None,
            content: content.to_vec(),
        }
    }

    pub fn link(name: &str, kind: u8, target: &str) -> Self {
        Self { link: target.as_bytes().to_vec(), ..Self::of(name.as_bytes(), kind, b"") }
    }

    /// A pax header with these records.
    pub fn pax(kind: u8, records: &[(&str, &str)]) -> Self {
        let content: Vec<u8> =
            records.iter().flat_map(|(key, value)| pax_record(key, value)).collect();
        Self::of(b"PaxHeader", kind, &content)
    }

    /// A GNU long name for the next entry.
    pub fn long_name(name: &str) -> Self {
        let mut content = name.as_bytes().to_vec();
        content.push(0);
        Self::of(b"././@LongLink", b'L', &content)
    }

    fn push(&self, out: &mut Vec<u8>) {
        let mut header = [0u8; 512];
        let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, &self.name[..self.name.len().min(100)]);
        put(100, b"0000644\0");
        put(108, b"0000000\0");
        put(116, b"0000000\0");
        let size = format!("{:011o}\0", self.content.len()).into_bytes();
        put(124, self.size_field.as_ref().unwrap_or(&size));
        put(136, b"00000000000\0");
        put(156, &[self.kind]);
        put(157, &self.link);
        put(257, b"ustar\x0000");
        put(148, b"        ");
        let sum: u32 = header.iter().map(|b| u32::from(*b)).sum();
        let sum = format!("{:06o}\0 ", self.checksum.unwrap_or(sum));
        header[148..156].copy_from_slice(sum.as_bytes());
        out.extend(header);
        out.extend(&self.content);
        out.resize(out.len().next_multiple_of(512), 0);
    }
}

/// `LENGTH KEY=VALUE\n`, where LENGTH counts itself.
pub fn pax_record(key: &str, value: &str) -> Vec<u8> {
    let rest = format!(" {key}={value}\n");
    let mut length = rest.len();
    while length != rest.len() + length.to_string().len() {
        length = rest.len() + length.to_string().len();
    }
    format!("{length}{rest}").into_bytes()
}

/// Entries without the end.
pub fn open(entries: &[Entry]) -> Vec<u8> {
    let mut out = Vec::new();
    for entry in entries {
        entry.push(&mut out);
    }
    out
}

/// A whole tar.
pub fn tar(entries: &[Entry]) -> Vec<u8> {
    let mut out = open(entries);
    out.extend([0; 1024]);
    out
}

pub fn gz(content: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(content).unwrap();
    encoder.finish().unwrap()
}
