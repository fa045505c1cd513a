//! What can go wrong in the base code.

use std::path::PathBuf;

/// Short for a result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// An error of the base code or of a renderer.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A scene, mesh, material or texture file cannot be used.
    #[error("{}{}: {message}", path.display(), line.map(|l| format!(":{l}")).unwrap_or_default())]
    File {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1, when it is known.
        line: Option<usize>,
        /// What was expected and found there.
        message: String,
    },
    /// An argument lies outside its range.
    #[error("{0}")]
    Argument(String),
    /// No graphics adapter fits the request, or the device was lost.
    #[error("{0}")]
    NoAdapter(String),
    /// The graphics library refused a shader, a pipeline or a command.
    #[error("{0}")]
    Gpu(String),
    /// The host asked to stop early.
    #[error("rendering was cancelled")]
    Cancelled,
    /// A part of the assignment is not implemented yet; names the task.
    #[error("not implemented yet: {0}")]
    NotImplemented(String),
}

impl Error {
    /// An error in a file, without a line.
    pub fn file(path: impl Into<PathBuf>, message: impl Into<String>) -> Self {
        Self::File { path: path.into(), line: None, message: message.into() }
    }

    /// The same error in a file, and the first of the remarks that may tell its cause.
    pub(crate) fn also(mut self, remarks: &[String]) -> Self {
        if let Self::File { message, .. } = &mut self {
            for remark in remarks.iter().take(3) {
                *message += &format!("; {remark}");
            }
        }
        self
    }
}
