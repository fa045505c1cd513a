//! Replaces the live worker on systems without named pipes: there is none.

use std::io;
use std::path::PathBuf;

use super::job::{CameraValue, Request};
use super::outcome::Outcome;
use super::supervise::Supervisor;
use crate::process::ProcessLimits;

/// Not available here.
pub enum LiveWorker {}

impl LiveWorker {
    /// Fails.
    ///
    /// # Errors
    /// Always.
    pub fn start(_: &Supervisor, _: PathBuf, _: Request, _: &ProcessLimits) -> io::Result<Self> {
        Err(io::Error::other("realtime is not drawn live on this system"))
    }

    /// Is never called.
    ///
    /// # Errors
    /// None.
    pub fn frame(&mut self, _: &CameraValue) -> io::Result<Option<Outcome>> {
        match *self {}
    }
}
