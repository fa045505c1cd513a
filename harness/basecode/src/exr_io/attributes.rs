//! The attributes of an EXR file's headers as bytes: what the decoder refuses to describe is found here, and taken out
//! of what it sees.

use std::ops::Range;

/// Where the version field's flags lie.
const FLAGS: usize = 5;
/// The flags of deep data and of several parts.
pub(super) const DEEP: u8 = 0x08;
pub(super) const PARTS: u8 = 0x10;

/// What the decoder does not see of a part.
#[derive(Default)]
pub(super) struct Hidden {
    /// Whether its pixels hold any number of samples.
    pub deep: bool,
    /// Of each channel, how many columns and rows have one sample.
    pub sampling: Vec<[usize; 2]>,
}

/// The headers of a file of any kind.
pub(super) struct Headers {
    /// The bytes of the file up to the end of its headers, as if all parts were flat and all channels whole.
    pub bytes: Vec<u8>,
    /// Where the headers end in the file itself.
    pub end: u64,
    /// Whether its blocks say which part they belong to.
    pub numbered: bool,
    /// The parts, each with the place of its header in the file.
    pub parts: Vec<(Hidden, Range<usize>)>,
}

/// Walks through the headers at the start of a file; none where they do not end.
pub(super) fn headers(file: &[u8]) -> Option<Headers> {
    let flags = *file.get(FLAGS)?;
    let numbered = flags & PARTS != 0;
    let mut bytes = file.get(..8)?.to_vec();
    bytes[FLAGS] &= !DEEP;
    let mut parts = Vec::new();
    let mut at = 8;
    loop {
        let start = at;
        let mut hidden = Hidden::default();
        loop {
            let name = text(file, &mut at)?;
            if name.is_empty() {
                bytes.push(0);
                break;
            }
            let kind = text(file, &mut at)?;
            let size = file.get(at..)?.first_chunk::<4>()?;
            let size = usize::try_from(i32::from_le_bytes(*size)).ok()?;
            at += 4;
            let mut value = file.get(at..at.checked_add(size)?)?.to_vec();
            at += size;
            match (name, kind) {
                (b"channels", b"chlist") => hidden.sampling = whole_channels(&mut value),
                (b"type", _) => {
                    let flat: Option<&[u8]> = match &*value {
                        b"deepscanline" => Some(b"scanlineimage"),
                        b"deeptile" => Some(b"tiledimage"),
                        _ => None,
                    };
                    if let Some(flat) = flat {
                        hidden.deep = true;
                        value = flat.to_vec();
                    }
                }
                _ => {}
            }
            for text in [name, kind] {
                bytes.extend_from_slice(text);
                bytes.push(0);
            }
            bytes.extend_from_slice(&(value.len() as i32).to_le_bytes());
            bytes.extend_from_slice(&value);
        }
        parts.push((hidden, start..at));
        if !numbered {
            break;
        }
        if *file.get(at)? == 0 {
            bytes.push(0);
            at += 1;
            break;
        }
    }
    Some(Headers { bytes, end: at as u64, numbered, parts })
}

/// The text that ends with a zero.
fn text<'a>(file: &'a [u8], at: &mut usize) -> Option<&'a [u8]> {
    let rest = file.get(*at..)?;
    let end = rest.iter().position(|byte| *byte == 0)?;
    *at += end + 1;
    Some(&rest[..end])
}

/// The sampling of all channels, which then say that they are whole.
fn whole_channels(list: &mut [u8]) -> Vec<[usize; 2]> {
    let mut all = Vec::new();
    let mut at = 0;
    while text(list, &mut at).is_some_and(|name| !name.is_empty()) {
        // The type, a flag, three bytes of nothing, and the sampling across and down.
        let Some(value) = list.get_mut(at + 8..at + 16) else { break };
        let factors =
            [0, 4].map(|i| value[i..].first_chunk::<4>().map_or(1, |b| u32::from_le_bytes(*b)));
        if !factors.contains(&0) {
            value.copy_from_slice(&[1, 0, 0, 0, 1, 0, 0, 0]);
            all.push(factors.map(|factor| factor as usize));
        } else {
            // The decoder says what is wrong.
            all.push([1, 1]);
        }
        at += 16;
    }
    all
}
