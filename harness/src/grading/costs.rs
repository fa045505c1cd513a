//! The CPU time of stages, and of the reference renderer on this machine.

use std::collections::BTreeMap;
use std::sync::{Mutex, OnceLock};
use std::time::Instant;

use serde::Serialize;

use super::record::StageCost;

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

/// What the stages cost so far.
pub(super) struct Costs {
    since: Instant,
    stages: Vec<StageCost>,
}

impl Costs {
    /// Begins with the first stage.
    pub(super) fn begin() -> Self {
        Self { since: Instant::now(), stages: Vec::new() }
    }

    /// Adds a stage that was measured by itself.
    pub(super) fn push(&mut self, name: &str, wall_s: f64, cpu_s: f64) {
        self.since = Instant::now();
        self.stages.push(StageCost { name: name.to_owned(), wall_s, cpu_s });
    }

    /// Ends a stage; answers all so far.
    pub(super) fn end(&mut self, name: &str, cpu_s: f64) -> Vec<StageCost> {
        let now = Instant::now();
        let wall_s = (now - std::mem::replace(&mut self.since, now)).as_secs_f64();
        self.stages.push(StageCost { name: name.to_owned(), wall_s, cpu_s });
        self.stages.clone()
    }
}
