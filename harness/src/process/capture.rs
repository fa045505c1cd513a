//! A child's output, bounded: its head and its tail.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// Bytes of the tail that are kept.
const TAIL: usize = 8 << 10;

/// Head and tail of an output stream. The text is the child's: it may hold anything at all.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Captured {
    /// The first bytes, as text.
    pub head: String,
    /// The last bytes, as text; empty when `head` holds everything.
    pub tail: String,
    /// How many bytes there were in all, as far as they were read.
    pub bytes: u64,
}

impl Captured {
    /// Whether `text` occurs in the head or the tail.
    pub fn contains(&self, text: &str) -> bool {
        self.head.contains(text) || self.tail.contains(text)
    }
}

/// Collects what is kept while a stream is read.
pub(super) struct Capture {
    head: Vec<u8>,
    keep: usize,
    tail: VecDeque<u8>,
    pub bytes: u64,
}

impl Capture {
    /// Keeps the first `keep` bytes and a short tail.
    pub fn new(keep: usize) -> Self {
        Self { head: Vec::new(), keep, tail: VecDeque::new(), bytes: 0 }
    }

    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes += bytes.len() as u64;
        let fits = bytes.len().min(self.keep - self.head.len());
        self.head.extend(&bytes[..fits]);
        self.tail.extend(&bytes[fits..]);
        self.tail.drain(..self.tail.len().saturating_sub(TAIL));
    }

    pub fn finish(self) -> Captured {
        let tail: Vec<u8> = self.tail.into();
        Captured {
            head: String::from_utf8_lossy(&self.head).into_owned(),
            tail: String::from_utf8_lossy(&tail).into_owned(),
            bytes: self.bytes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn head_and_tail_are_kept_and_the_middle_is_counted() {
        let mut capture = Capture::new(4);
        capture.push(b"abc");
        capture.push(b"de");
        capture.push(&[b'x'; TAIL]);
        capture.push(b"end");
        let captured = capture.finish();
        assert_eq!(captured.head, "abcd");
        assert_eq!((captured.tail.len(), captured.bytes), (TAIL, 8 + TAIL as u64));
        assert!(captured.tail.ends_with("xend") && captured.tail.starts_with('x'));
    }
}
