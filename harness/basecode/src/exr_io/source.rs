//! Where the bytes of an EXR file come from.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

/// The bytes of a file, read at any place by any thread.
pub(super) enum Source<'a> {
    Memory(Cow<'a, [u8]>),
    /// And its length when it was opened.
    File(File, u64),
}

impl Source<'_> {
    pub(super) fn len(&self) -> u64 {
        match self {
            Self::Memory(bytes) => bytes.len() as u64,
            Self::File(_, bytes) => *bytes,
        }
    }

    /// Fills `out`.
    pub(super) fn read(&self, out: &mut [u8], at: u64) -> io::Result<()> {
        match self {
            Self::Memory(bytes) => {
                let inside = usize::try_from(at).ok().and_then(|at| bytes.get(at..));
                let inside = inside.and_then(|rest| rest.get(..out.len()));
                out.copy_from_slice(inside.ok_or(io::ErrorKind::UnexpectedEof)?);
                Ok(())
            }
            #[cfg(unix)]
            Self::File(file, _) => std::os::unix::fs::FileExt::read_exact_at(file, out, at),
            #[cfg(windows)]
            Self::File(file, _) => {
                let (mut out, mut at) = (out, at);
                while !out.is_empty() {
                    let read = std::os::windows::fs::FileExt::seek_read(file, out, at)?;
                    if read == 0 {
                        return Err(io::ErrorKind::UnexpectedEof.into());
                    }
                    out = &mut out[read..];
                    at += read as u64;
                }
                Ok(())
            }
        }
    }
}

/// A source that is read from its start, as the decoder wants its header.
pub(super) struct Cursor<'s, 'a> {
    pub source: &'s Source<'a>,
    pub at: u64,
}

impl Read for Cursor<'_, '_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let left = self.source.len().saturating_sub(self.at);
        let count = out.len().min(usize::try_from(left).unwrap_or(usize::MAX));
        self.source.read(&mut out[..count], self.at)?;
        self.at += count as u64;
        Ok(count)
    }
}

impl Seek for Cursor<'_, '_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let from = |base: u64, by: i64| base.checked_add_signed(by);
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::Current(by) => from(self.at, by),
            SeekFrom::End(by) => from(self.source.len(), by),
        };
        self.at = at.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.at)
    }
}
