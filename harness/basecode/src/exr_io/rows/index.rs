//! Opening a file: its header is checked and its blocks are found.

use std::fs::File;
use std::io::{BufReader, Seek};
use std::path::Path;
use std::sync::Arc;

use exr::block;
use exr::math::Vec2;
use exr::meta::header::Header;

use super::{ExrRows, guarded};
use crate::exr_io::attributes::{DEEP, PARTS, headers};
use crate::exr_io::blocks::{Block, Part, find_blocks};
use crate::exr_io::header::{Checks, Placed, luminance_layers, name_of, visible};
use crate::exr_io::source::{Cursor, Source};
use crate::exr_io::{ImageError, MAX_FILE_BYTES, read_file};

/// Bytes in which a header's windows are looked for; most headers have a few hundred.
const HEAD: u64 = 1 << 16;
/// Bytes in which all headers of a file of any kind must lie.
const HEADERS: u64 = 16 << 20;

impl ExrRows<'static> {
    /// Opens a file and reads all but its pixels.
    ///
    /// # Errors
    /// See [`ImageError`]; nothing that a file can hold makes this panic.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ImageError> {
        let path = path.as_ref();
        let source = source_of(path)?;
        Self::new(source, path)
    }

    /// Opens all parts of a file of any kind: cropped or with overscan, with luminance or subsampled channels. Answers
    /// those that can be read, and what is to know of the others.
    ///
    /// # Errors
    /// See [`ImageError`]; also where no part can be read, as in a file of deep data.
    pub fn open_parts(path: impl AsRef<Path>) -> Result<(Vec<Self>, Vec<String>), ImageError> {
        let path = path.as_ref();
        let source = source_of(path)?;
        if source.len() > MAX_FILE_BYTES {
            return Err(too_long(path));
        }
        guarded(path, || Self::index_parts(Arc::new(source), path))
    }
}

impl<'a> ExrRows<'a> {
    /// A file held in memory; `path` only names it in messages.
    pub(in crate::exr_io) fn of_bytes(bytes: &'a [u8], path: &Path) -> Result<Self, ImageError> {
        Self::new(Source::Memory(bytes.into()), path)
    }

    fn new(source: Source<'a>, path: &Path) -> Result<Self, ImageError> {
        if source.len() > MAX_FILE_BYTES {
            return Err(too_long(path));
        }
        guarded(path, || Self::index(Arc::new(source), path))
    }

    /// Reads the header and finds the blocks, which follow each other in any order.
    fn index(source: Arc<Source<'a>>, path: &Path) -> Result<Self, ImageError> {
        let checks = Checks { path, file_bytes: source.len() };
        let start = beginning(&source, 24, path)?;
        checks.signature(&start, DEEP | PARTS)?;
        checks.windows(&beginning(&source, HEAD, path)?)?;
        let mut cursor = BufReader::new(Cursor { source: &source, at: 0 });
        let reader = block::read(&mut cursor, false).map_err(|e| checks.error(e, "the header"))?;
        let [header] = reader.headers() else {
            return Err(checks.unsupported("several parts", "one part"));
        };
        let header = header.clone();
        drop(reader);
        let mut notes = Vec::new();
        let placed = checks.header(&header, &mut notes)?;
        let after_header = cursor
            .stream_position()
            .map_err(|source| ImageError::Io { path: path.into(), source })?;
        drop(cursor);
        let part = Part { header: &header, deep: false };
        let blocks = find_blocks(&source, &checks, &[part], (after_header, false))?;
        let blocks = blocks.into_iter().flatten().collect();
        Ok(Self::of_part(source, path, header, blocks, placed, notes))
    }

    /// Reads all headers and finds the blocks of all parts that can be read; and says what the others are.
    fn index_parts(
        source: Arc<Source<'a>>,
        path: &Path,
    ) -> Result<(Vec<Self>, Vec<String>), ImageError> {
        let checks = Checks { path, file_bytes: source.len() };
        let head = beginning(&source, HEADERS, path)?;
        // Deep data beside flat ones are left out.
        let refused = if head.get(5).is_some_and(|flags| flags & PARTS != 0) { 0 } else { DEEP };
        checks.signature(&head, refused)?;
        let found = headers(&head).ok_or_else(|| checks.truncated("the header"))?;
        for (_, place) in &found.parts {
            checks.windows(&head[place.clone()])?;
        }
        let all = {
            let plain = Source::Memory(found.bytes.into());
            let cursor = BufReader::new(Cursor { source: &plain, at: 0 });
            let reader = block::read(cursor, false).map_err(|e| checks.error(e, "the header"))?;
            reader.headers().to_vec()
        };
        if all.len() != found.parts.len() {
            return Err(checks.malformed("its headers contradict each other".into()));
        }
        let walked: Vec<Part> = all
            .iter()
            .zip(&found.parts)
            .map(|(header, (hidden, _))| Part { header, deep: hidden.deep })
            .collect();
        let blocks = find_blocks(&source, &checks, &walked, (found.end, found.numbered))?;
        let several = all.len() > 1;
        let (mut parts, mut left_out, mut first) = (Vec::new(), Vec::new(), None);
        for ((header, (hidden, _)), blocks) in all.into_iter().zip(found.parts).zip(blocks) {
            let name = header.own_attributes.layer_name.as_ref().map(name_of);
            let name = name.filter(|_| several).unwrap_or_default();
            let mut notes = Vec::new();
            match checks.any_header(&header, &hidden, &mut notes) {
                Ok(placed) => {
                    let source = Arc::clone(&source);
                    let mut part = Self::of_part(source, path, header, blocks, placed, notes);
                    part.part = name;
                    if hidden.sampling.iter().any(|factors| *factors != [1, 1]) {
                        for (channel, factors) in
                            part.header.channels.list.iter_mut().zip(&hidden.sampling)
                        {
                            channel.sampling = Vec2(factors[0], factors[1]);
                        }
                        part.sampling = hidden.sampling;
                    }
                    (part.gray, part.chroma) = luminance_layers(&part.header.channels);
                    parts.push(part);
                }
                Err(error @ (ImageError::Unsupported { .. } | ImageError::Size { .. })) => {
                    let (what, expected) = match &error {
                        ImageError::Unsupported { what, expected, .. } => (what, expected),
                        ImageError::Size { found, expected, .. } => (found, expected),
                        _ => continue,
                    };
                    let name = visible(&name);
                    left_out.push(format!("part {name} is left out: {what}, expected {expected}"));
                    first.get_or_insert(error);
                }
                Err(error) => return Err(error),
            }
        }
        match first {
            Some(error) if parts.is_empty() => Err(error),
            _ => Ok((parts, left_out)),
        }
    }

    fn of_part(
        source: Arc<Source<'a>>,
        path: &Path,
        header: Header,
        blocks: Vec<Block>,
        placed: Placed,
        notes: Vec<String>,
    ) -> Self {
        let (path, part) = (path.into(), String::new());
        let (sampling, gray, chroma) = (Vec::new(), Vec::new(), Vec::new());
        Self { source, path, part, header, blocks, sampling, gray, chroma, placed, notes }
    }
}

/// A file's bytes.
fn source_of(path: &Path) -> Result<Source<'static>, ImageError> {
    let io = |source| ImageError::Io { path: path.into(), source };
    let file = File::open(path).map_err(io)?;
    let meta = file.metadata().map_err(io)?;
    // A pipe can be read only once.
    Ok(match meta.is_file() {
        true => Source::File(file, meta.len()),
        false => Source::Memory(read_file(file, path)?.into()),
    })
}

/// The first bytes of a file, at most so many.
fn beginning(source: &Source<'_>, most: u64, path: &Path) -> Result<Vec<u8>, ImageError> {
    let mut bytes = vec![0; source.len().min(most) as usize];
    source.read(&mut bytes, 0).map_err(|source| ImageError::Io { path: path.into(), source })?;
    Ok(bytes)
}

fn too_long(path: &Path) -> ImageError {
    ImageError::Size {
        path: path.into(),
        found: "the file is too long".into(),
        expected: format!("at most {MAX_FILE_BYTES} bytes"),
    }
}
