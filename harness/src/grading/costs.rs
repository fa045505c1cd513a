//! The reference renderer's CPU time on this machine.

use std::collections::BTreeMap;
use std::sync::{Mutex, OnceLock};

use serde::Serialize;

/// CPU seconds of the reference renderer, as far as they were needed.
#[derive(Default)]
pub(super) struct ReferenceCosts {
    /// Of single questions, by the digest of what is asked.
    pub(super) questions: Mutex<BTreeMap<String, Cost>>,
    pub(super) offline: OnceLock<Option<f64>>,
    pub(super) realtime: OnceLock<Option<f64>>,
}

/// What one question costs the reference renderer, in a worker of its own.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// The kind of question and its scene, or the path.
    pub what: String,
    /// CPU seconds; nothing when the reference gave no answer.
    pub cpu_s: Option<f64>,
}
