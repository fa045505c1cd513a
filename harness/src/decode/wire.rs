//! The format of questions to the child and of its answers: JSON, and after an answer the bytes that it describes.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::intake::{self, Finding, Refusal, Submission, TreeSpec, Validation};

/// What a child is asked, about one file or folder.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum DecodeQuestion {
    /// What the archive holds.
    Unpack {
        /// What messages call it.
        name: String,
        /// The expected tree.
        tree: TreeSpec,
        /// How much it may hold.
        limits: intake::ArchiveLimits,
    },
    /// The findings on a private copy; its root is the folder in question.
    Inspect {
        /// The copy.
        submission: Submission,
        /// The expected tree.
        tree: TreeSpec,
    },
    /// The pixels of an EXR file.
    Image {
        /// What messages call it.
        name: String,
    },
}

/// What a child answers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum DecodeAnswer {
    /// The archive's files; their contents follow, in order.
    Unpacked(Submission),
    /// The archive is refused.
    Refused(Refusal),
    /// The findings on a copy.
    Inspected {
        /// Beside the expected tree.
        validation: Validation,
        /// About its source.
        source: Vec<Finding>,
    },
    /// The size of an image in pixels; R, G, B as floats of the machine follow, row by row.
    Image {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// It cannot be decoded; says why.
    Failed(String),
}

/// The files of a child's private folder.
pub struct DecodeFolder<'a>(pub &'a Path);

impl DecodeFolder<'_> {
    /// The question, and the path of what it is about.
    pub fn question(&self) -> PathBuf {
        self.0.join("question.json")
    }
    /// What it is about, where the parent makes it.
    pub fn input(&self) -> PathBuf {
        self.0.join("input")
    }
    /// The answer.
    pub fn output(&self) -> PathBuf {
        self.0.join("output")
    }
    /// The scratch where there is no mount namespace.
    pub fn scratch(&self) -> PathBuf {
        self.0.join("scratch")
    }
}

/// Writes an answer: the length of its JSON (u64, little endian), that, and the content.
///
/// # Errors
/// When it cannot be written.
pub fn write_answer(
    out: &mut impl Write,
    answer: &DecodeAnswer,
    content: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let json = serde_json::to_vec(answer)?;
    out.write_all(&(json.len() as u64).to_le_bytes())?;
    out.write_all(&json)?;
    content(out)
}

/// Parses an answer and its content from untrusted bytes.
pub fn read_answer(bytes: Vec<u8>) -> Option<(DecodeAnswer, Vec<u8>)> {
    let length = u64::from_le_bytes(*bytes.first_chunk::<8>()?);
    let end = usize::try_from(length).ok()?.checked_add(8)?;
    let answer = serde_json::from_slice(bytes.get(8..end)?).ok()?;
    let mut content = bytes;
    content.drain(..end);
    Some((answer, content))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_comes_is_an_answer_or_none() {
        let answer = DecodeAnswer::Image { width: 3, height: 1 };
        let mut bytes = Vec::new();
        write_answer(&mut bytes, &answer, &mut |out| out.write_all(b"pixels")).unwrap();
        assert_eq!(read_answer(bytes.clone()), Some((answer, b"pixels".to_vec())));
        for end in 0..bytes.len() - b"pixels".len() {
            assert_eq!(read_answer(bytes[..end].to_vec()), None, "{end} bytes");
        }
        let mut long = bytes;
        long[..8].copy_from_slice(&u64::MAX.to_le_bytes());
        assert_eq!(read_answer(long), None);
    }
}
