//! Decides whether a reported environment failure (no adapter, a lost device, a full disk, a worker that could not
//! begin) is real, by repeating the request with the reference renderer or Umbra's own pass.

use std::path::Path;

use basecode::Matrices;

use super::session::Session;
use super::stages::named;
use crate::evidence::stages::{SHOW_NORMAL, VERTEX};
use crate::process::ProcessLimits;
use crate::worker::{
    Adapter, AdapterKind, CameraValue, Fault, Job, Outcome, Request, is_environment_failure,
};

impl Session<'_> {
    /// Runs requests on a plugin, or on Umbra's neutral pass without one.
    pub fn run(&self, plugin: Option<&Path>, requests: Vec<Request>) -> Vec<Outcome> {
        if requests.is_empty() {
            return Vec::new();
        }
        let job = Job { plugin: plugin.map(Path::to_owned), requests };
        let mut outcomes = self.run_job(&job);
        attribute_failures(self, &job, &mut outcomes);
        outcomes
    }
}

/// Settles the outcomes of `job` that report an environment failure. The requests are repeated while retries are left:
/// a worker may have met somebody else's signal. If a renderer of ours then succeeds, the failure is the submission's
/// own. Otherwise they stay ungraded.
fn attribute_failures(session: &Session, job: &Job, outcomes: &mut [Outcome]) {
    loop {
        let blaming = |&index: &usize| is_environment_failure(&outcomes[index]);
        let blaming: Vec<usize> = (0..outcomes.len()).filter(blaming).collect();
        let Some(&first) = blaming.first() else { return };
        if session.is_cancelled() {
            return;
        }
        if !session.retries.try_take() {
            let witness = control_run(session, job, &job.requests[first]);
            for index in blaming {
                let reason = said(&outcomes[index]).to_owned();
                outcomes[index] = match witness {
                    Some(witness) => Outcome::Failed(format!("{reason} ({witness})")),
                    None => Outcome::NotRun { reason, fault: Fault::Environment },
                };
            }
            return;
        }
        let requests = blaming.iter().map(|&index| job.requests[index].clone()).collect();
        let again = session.run_job(&Job { plugin: job.plugin.clone(), requests });
        for (index, outcome) in blaming.into_iter().zip(again) {
            outcomes[index] = outcome;
        }
    }
}

/// An outcome in words.
fn said(outcome: &Outcome) -> &str {
    match outcome {
        Outcome::NoAdapter(said) | Outcome::Failed(said) | Outcome::Panicked(said) => said,
        Outcome::NotRun { reason, .. } => reason,
        _ => "",
    }
}

/// Repeats the request in a fresh worker with a renderer of ours: the reference, or Umbra's own pass for stages and
/// where there is no reference. Says which one succeeded; `None` if it fails too.
fn control_run(session: &Session, job: &Job, request: &Request) -> Option<&'static str> {
    let mut request = request.clone();
    request.scene_mut().options.clear();
    let reference = session.reference.filter(|_| job.plugin.is_some());
    if reference.is_none() {
        request = own_pass(&request);
    }
    let control = Job { plugin: reference.map(Into::into), requests: vec![request] };
    // The limits of submissions do not apply to our own renderers.
    let limits = ProcessLimits { threads: session.limits.threads, ..ProcessLimits::default() };
    let report = session.supervisor.run_job(&control, &limits, session.cancel, &mut |_| ());
    let outcome = report.outcomes.first()?;
    let offline = !matches!(job.requests.first(), Some(Request::RenderRealtime { .. }));
    match reference {
        Some(_) if outcome.answer().is_some() => Some("but the reference renderer can do it here"),
        None if outcome.answer().is_some() => Some("but Umbra's own pass draws here"),
        // Offline needs no adapter, but a worker that begins.
        None if offline && !matches!(outcome, Outcome::NotRun { .. }) => {
            Some("but other workers run here")
        }
        _ => None,
    }
}

/// A frame of the same scene by Umbra's own pass, under stages of ours.
fn own_pass(request: &Request) -> Request {
    let stages = named([VERTEX, SHOW_NORMAL, SHOW_NORMAL].map(str::to_owned));
    match request.clone() {
        Request::RenderRealtime { scene, width, height, shadow_map, adapter, cameras, .. } => {
            Request::RenderRealtime { scene, width, height, shadow_map, adapter, stages, cameras }
        }
        offline => Request::RenderRealtime {
            scene: offline.scene().clone(),
            width: 16,
            height: 16,
            shadow_map: false,
            adapter: Adapter { kind: AdapterKind::Software, name: String::new() },
            stages,
            cameras: vec![CameraValue {
                eye: [0.0, 0.0, 1.0],
                at: [0.0; 3],
                up: [0.0, 1.0, 0.0],
                fov_y_deg: 40.0,
                matrices: Matrices::Usual,
            }],
        },
    }
}
