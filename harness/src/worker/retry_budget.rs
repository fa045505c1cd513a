//! How long Umbra waits for a renderer, how often it repeats a request because the machine may be at fault, and when it
//! gives up. CPU time decides, never the machine's load.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::job::{Job, Request};
use super::outcome::{Fault, Outcome, Timeout};
use crate::process::{ChildOutcome, ProcessLimits};

/// Number of requests of a kind that may be repeated: each may cost its time limit.
const MAX_RETRIES: usize = 2;
/// Number of requests of a kind that may run out of time; after that, the rest of the kind is not asked.
const MAX_TIMEOUTS: usize = 2;
/// CPU seconds that every question has at first; the reference takes a tenth of that for nearly all.
const FIRST_S: f64 = 3.0;
/// Additional CPU seconds for each sample of a full render: five times what the reference took.
const FIRST_S_PER_SAMPLE: f64 = 1.2e-6;
/// A question that is repeated, alone, has this many times the reference's CPU time.
const TIMES_REFERENCE: f64 = 10.0;
/// Once a renderer is known to hang, other questions of that kind have this many times the reference's CPU time, or a
/// second if that is more.
const TIMES_REFERENCE_SHORT: f64 = 3.0;
/// They may then stand still for this fraction of the usual limit.
const SHORT: f64 = 0.2;
/// One worker may stand still for this fraction of the seconds that its submission has left for that, or for so many
/// seconds if that is more.
const SHARE: f64 = 0.25;
const SHARE_S: f64 = 2.0;

/// How the reason begins when this process could not run a worker, for want of disk space, memory, files.
pub(super) const CANNOT_RUN: &str = "cannot run a worker";

/// What the reference renderer takes on this machine.
pub trait Reference: Sync {
    /// CPU seconds for one question, asked in a worker of its own; nothing where there is no reference.
    fn question_cpu_s(&self, request: &Request) -> Option<f64>;
    /// CPU seconds for all questions of the path that the request belongs to.
    fn path_cpu_s(&self, request: &Request) -> Option<f64>;
}

/// What one submission may use on each path, offline and realtime.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// CPU time, as a multiple of what the reference renderer takes on this machine.
    pub times_reference: f64,
    /// CPU seconds that it has in any case.
    pub cpu_s: f64,
    /// Seconds in which its workers may stand still, neither computing nor waiting for a processor.
    pub still_s: f64,
}

/// Retries and time for one path of one submission, over all its jobs.
///
/// A timeout counts if the same request runs out of time again, alone on the machine. A confirmed timeout holds for all
/// requests of its kind: the others get a short limit, and their timeouts count at once. A timeout that can no longer
/// be confirmed does not count, and its request stays ungraded.
#[derive(Default)]
pub struct RetryBudget<'a> {
    reference: Option<&'a dyn Reference>,
    budget: Option<Budget>,
    /// Whether questions have limits of their own, or only the job's.
    own_limits: bool,
    state: Mutex<State>,
}

#[derive(Clone, Debug, Default)]
struct State {
    kinds: [OfKind; 8],
    retries: usize,
    cpu_s: f64,
    still_s: f64,
    /// Why the budget is used up, when it is.
    over: Option<String>,
}

#[derive(Clone, Copy, Debug, Default)]
struct OfKind {
    retries: usize,
    hangs: bool,
    timeouts: usize,
    /// How the first of them was late.
    late: Option<Timeout>,
}

/// What one worker may use.
pub(super) struct Allowed {
    /// All its questions together.
    pub limits: ProcessLimits,
    /// CPU seconds of each question.
    pub each_cpu_s: Vec<f64>,
}

/// A kind of question, as an index. Shadows are a kind of their own: a renderer that hangs in them may be right
/// without.
fn kind(job: &Job, request: &Request) -> usize {
    match request {
        Request::EvalBsdf { .. } => 0,
        Request::Radiance { shadows, .. } => 1 + usize::from(*shadows),
        Request::RenderOffline { shadows, .. } => 3 + usize::from(*shadows),
        Request::RenderRealtime { shadow_map, .. } if job.plugin.is_some() => {
            5 + usize::from(*shadow_map)
        }
        Request::RenderRealtime { .. } => 7,
    }
}

/// How much of an image is to be rendered at several samples, or nothing of it.
fn samples(request: &Request) -> f64 {
    match request {
        Request::RenderOffline { width, height, spp, .. } => {
            f64::from(*width) * f64::from(*height) * f64::from(*spp)
        }
        _ => 0.0,
    }
}

impl<'a> RetryBudget<'a> {
    /// For a submission of a batch: each question has its own limit, and all questions of a path share the budget, if
    /// there is one.
    pub fn with(reference: Option<&'a dyn Reference>, budget: Option<Budget>) -> Self {
        Self { reference, budget, own_limits: true, ..Self::default() }
    }

    /// Without any retries: every timeout counts at once.
    pub fn none() -> Self {
        let retries = Self::default();
        retries.state().kinds.iter_mut().for_each(|kind| kind.hangs = true);
        retries
    }

    /// Resets for another path.
    pub fn renew(&self) {
        *self.state() = State::default();
    }

    /// Runs `body` at no cost: afterwards as much is left as before. For what Umbra tries in the submission's favor.
    pub fn uncounted<T>(&self, body: impl FnOnce() -> T) -> T {
        let before = self.state().clone();
        let answer = body();
        *self.state() = before;
        answer
    }

    /// Takes one retry, if any is left.
    pub fn try_take(&self) -> bool {
        let mut state = self.state();
        let left = state.retries < MAX_RETRIES;
        state.retries += usize::from(left);
        left
    }

    /// Why the budget of this path is used up, when it is.
    pub fn used_up(&self) -> Option<String> {
        self.state().over.clone()
    }

    /// What a worker may use that is asked `pending` of a job, at first or once a kind hangs.
    pub(super) fn allowed(&self, job: &Job, pending: &[usize], limits: &ProcessLimits) -> Allowed {
        let mut limits = limits.clone();
        if !self.own_limits {
            let each_cpu_s = vec![f64::INFINITY; pending.len()];
            return Allowed { limits, each_cpu_s };
        }
        let requests = || pending.iter().map(|&index| &job.requests[index]);
        let each_cpu_s: Vec<f64> = requests()
            .map(|request| {
                if self.state().kinds[kind(job, request)].hangs {
                    self.short(request)
                } else {
                    first(request)
                }
            })
            .collect();
        if requests().all(|request| self.state().kinds[kind(job, request)].hangs) {
            limits.wall_s = (SHORT * limits.wall_s).max(1.0);
        }
        limits.cpu_s = each_cpu_s.iter().sum::<f64>().ceil() as u64 + 1;
        self.clamp(job, pending, &mut limits);
        Allowed { limits, each_cpu_s }
    }

    /// The limits under which a request that ran out of time is asked again, alone; nothing when it is
    /// not asked again.
    pub(super) fn again(&self, job: &Job, index: usize, limits: &ProcessLimits) -> Option<Allowed> {
        let request = &job.requests[index];
        {
            let of_kind = &mut self.state().kinds[kind(job, request)];
            if of_kind.hangs || of_kind.retries == MAX_RETRIES {
                return None;
            }
            of_kind.retries += 1;
        }
        let mut limits = limits.clone();
        if !self.own_limits {
            return Some(Allowed { limits, each_cpu_s: vec![f64::INFINITY] });
        }
        let fair = match self.reference_cpu_s(request) {
            Some(cpu_s) => first(request).max(TIMES_REFERENCE * cpu_s),
            // Without a reference: a student's machine may be slow.
            None => first(request).max((2.0 * first(request)).min(limits.cpu_s as f64)),
        };
        limits.cpu_s = fair.ceil() as u64 + 1;
        self.clamp(job, &[index], &mut limits);
        Some(Allowed { limits, each_cpu_s: vec![fair] })
    }

    /// What a request has once others of its kind are known to hang.
    fn short(&self, request: &Request) -> f64 {
        let times = self.reference_cpu_s(request).map(|cpu_s| TIMES_REFERENCE_SHORT * cpu_s);
        times.unwrap_or(first(request) / 3.0).max(1.0)
    }

    fn reference_cpu_s(&self, request: &Request) -> Option<f64> {
        self.reference?.question_cpu_s(request)
    }

    /// No worker of a submission may use more than is left of its budget.
    fn clamp(&self, job: &Job, pending: &[usize], limits: &mut ProcessLimits) {
        let (Some(budget), Some(&first)) = (&self.budget, pending.first()) else { return };
        let (cpu_s, still_s) = {
            let state = self.state();
            (state.cpu_s, state.still_s)
        };
        if job.plugin.is_none() {
            return;
        }
        // One question that stands still leaves time to ask others.
        let left_s = (budget.still_s - still_s).max(0.0);
        limits.wall_s = limits.wall_s.min((SHARE * left_s).max(SHARE_S)).min(left_s + 0.1);
        // Before, it is not worth measuring the reference.
        if cpu_s >= budget.cpu_s {
            let left = self.cpu_budget(budget, &job.requests[first]) - cpu_s;
            limits.cpu_s = limits.cpu_s.min(left.max(0.0).ceil() as u64 + 1);
        }
    }

    fn cpu_budget(&self, budget: &Budget, request: &Request) -> f64 {
        let path = self.reference.and_then(|reference| reference.path_cpu_s(request));
        budget.cpu_s.max(path.map_or(f64::INFINITY, |cpu_s| budget.times_reference * cpu_s))
    }

    /// Counts what a worker used.
    pub(super) fn spent(&self, job: &Job, ended: &ChildOutcome) {
        let (Some(budget), Some(request)) = (&self.budget, job.requests.first()) else { return };
        if job.plugin.is_none() {
            return;
        }
        let (cpu_s, still_s) = {
            let mut state = self.state();
            state.cpu_s += ended.cpu_s;
            state.still_s += ended.still_s;
            (state.cpu_s, state.still_s)
        };
        let over = if still_s >= budget.still_s {
            let allowed = budget.still_s;
            Some(format!("{still_s:.0} s of doing nothing, where {allowed:.0} s are allowed"))
        } else if cpu_s >= budget.cpu_s {
            let allowed = self.cpu_budget(budget, request);
            (cpu_s >= allowed).then(|| {
                let times = budget.times_reference;
                format!(
                    "{cpu_s:.0} s of CPU time, where {allowed:.0} s are allowed, {times} times what the \
                     reference renderer takes on this machine"
                )
            })
        } else {
            None
        };
        self.state().over = over;
    }

    /// What a timeout comes to; `confirmed` when the request had the machine for itself. A `late` that
    /// is the machine's own never counts.
    pub(super) fn timed_out(
        &self,
        job: &Job,
        index: usize,
        late: Option<Timeout>,
        confirmed: bool,
    ) -> Outcome {
        let request = &job.requests[index];
        let hangs = {
            let of_kind = &mut self.state().kinds[kind(job, request)];
            of_kind.timeouts += 1;
            of_kind.hangs |= confirmed && late.is_some();
            of_kind.late = of_kind.late.or(late);
            of_kind.hangs
        };
        match late.filter(|_| hangs) {
            Some(late) if self.own_limits => {
                Outcome::TimedOut(Timeout { reference_s: self.reference_cpu_s(request), ..late })
            }
            Some(late) => Outcome::TimedOut(late),
            None => unconfirmed(),
        }
    }

    /// The outcome of a request that is not asked any more because time or retries are used up.
    pub fn given_up(&self, job: &Job, request: &Request) -> Option<Outcome> {
        let state = self.state();
        if let (Some(over), Some(_)) = (&state.over, &job.plugin) {
            let reason = format!("not asked: the submission used {over}");
            return Some(Outcome::NotRun { reason, fault: Fault::Submission });
        }
        let of_kind = state.kinds[kind(job, request)];
        let fault = if of_kind.hangs { Fault::Submission } else { Fault::Environment };
        let mut reason = "not asked: the renderer ran out of time before".to_owned();
        if let Some(late) = of_kind.late.filter(|_| of_kind.hangs) {
            reason.push_str(&format!(" ({}: {late})", late.what()));
        }
        (of_kind.timeouts >= MAX_TIMEOUTS).then_some(Outcome::NotRun { reason, fault })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// CPU seconds that a request has at first.
fn first(request: &Request) -> f64 {
    FIRST_S + FIRST_S_PER_SAMPLE * samples(request)
}

fn unconfirmed() -> Outcome {
    let reason = "ran out of time beside other work, and was asked often enough".to_owned();
    Outcome::NotRun { reason, fault: Fault::Environment }
}

/// Whether an outcome claims a fault of the machine and could be forged. The claim is believed if a renderer of ours
/// fails on the same case.
pub fn is_environment_failure(outcome: &Outcome) -> bool {
    match outcome {
        Outcome::NoAdapter(_) => true,
        Outcome::NotRun { fault: Fault::Submission, .. } => false,
        // Timeouts, and failures of this process itself, cannot be forged.
        Outcome::NotRun { reason, .. } => {
            *outcome != unconfirmed() && !reason.starts_with(CANNOT_RUN)
        }
        Outcome::Failed(said) | Outcome::Panicked(said) => {
            let said = said.to_lowercase();
            (said.contains("device") && said.contains("lost"))
                || said.contains("no space left on device")
        }
        _ => false,
    }
}

#[cfg(test)]
#[path = "retry_budget_tests.rs"]
mod tests;
