//! The reference renderer's time on this machine: measured when a submission is slow, once for all of a batch.

use std::sync::{OnceLock, PoisonError};

use sha2::{Digest, Sha256};

use super::costs::Cost;
use super::pipeline::Grading;
use super::stages::Stages;
use crate::files::hex;
use crate::process::ProcessLimits;
use crate::worker::{Job, Reference, Request, RetryBudget};

impl Grading<'_> {
    /// All that was measured of the reference renderer.
    pub fn costs_of_reference(&self) -> Vec<Cost> {
        let questions =
            self.reference_costs.questions.lock().unwrap_or_else(PoisonError::into_inner);
        let path = |what: &str, cost: &OnceLock<Option<f64>>| {
            cost.get().map(|&cpu_s| Cost { what: what.to_owned(), cpu_s })
        };
        let paths = [
            path("offline", &self.reference_costs.offline),
            path("realtime", &self.reference_costs.realtime),
        ];
        questions.values().cloned().chain(paths.into_iter().flatten()).collect()
    }

    /// CPU seconds of all that the reference is asked on a path, if it can be asked.
    fn measure_path(&self, offline: bool) -> Option<f64> {
        let reference = self.reference.as_deref()?;
        let mut session = self.session("");
        session.retries = RetryBudget::none();
        session.reference = None;
        let (mut checks, mut drawn) = (Vec::new(), Vec::new());
        let done = if offline {
            self.offline(&session, reference, 0, &|_| (), &mut checks, &mut drawn)
        } else {
            self.realtime(&session, reference, &Stages::default(), &mut checks, &mut drawn)
        };
        done.ok().map(|()| session.end_path()).filter(|cpu_s| *cpu_s > 0.0)
    }
}

impl Reference for Grading<'_> {
    fn question_cpu_s(&self, request: &Request) -> Option<f64> {
        let reference = self.reference.clone()?;
        let mut request = request.clone();
        request.scene_mut().options.clear();
        let key = hex(&Sha256::digest(serde_json::to_vec(&request).unwrap_or_default()));
        // Other threads that ask the same meanwhile wait.
        let mut known =
            self.reference_costs.questions.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cost) = known.get(&key) {
            return cost.cpu_s;
        }
        let what = format!("{} of {}", request.kind(), request.scene().path.display());
        let job = Job { plugin: Some(reference), requests: vec![request] };
        let limits = ProcessLimits { threads: self.threads, ..ProcessLimits::default() };
        let report = self.supervisor.run_job(&job, &limits, self.cancel, &mut |_| ());
        let answered = report.outcomes.iter().all(|outcome| outcome.answer().is_some());
        let cpu_s = report.runs.iter().map(|run| run.ended.cpu_s).sum::<f64>();
        let cpu_s = (answered && cpu_s > 0.0).then_some(cpu_s);
        known.insert(key, Cost { what, cpu_s });
        cpu_s
    }

    fn path_cpu_s(&self, request: &Request) -> Option<f64> {
        let offline = !matches!(request, Request::RenderRealtime { .. });
        let cost =
            if offline { &self.reference_costs.offline } else { &self.reference_costs.realtime };
        *cost.get_or_init(|| self.measure_path(offline))
    }
}
