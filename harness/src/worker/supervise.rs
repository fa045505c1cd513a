//! The parent's side: prepares a worker's files, runs it, and judges what it left.

use std::fs;
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};
use std::time::{Duration, Instant};

use renderer_api as api;
use tempfile::TempDir;

use super::command::{Program, command, program_beside, software_driver};
use super::files::Files;
use super::job::{Job, Request};
use super::outcome::{Fault, JobReport, Outcome, Timeout, WorkerRun};
use super::policy::WorkerPolicy;
use super::retry_budget::{Allowed, CANNOT_RUN, RetryBudget};
use super::table::SlotState;
use super::wire::WorkerFolder;
use crate::process::{self, ChildOutcome, Confinement, Exit, ProcessLimits, signal_name};
use crate::sandbox::{self, Bind, Layers};

/// Bytes of a worker's output that are kept, besides a tail.
const KEEP_OUTPUT: usize = 16 << 10;
/// How often a running worker's table is looked at.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(100);

/// Starts workers.
#[derive(Clone, Debug)]
pub struct Supervisor {
    /// Umbra itself, which starts compilers and decoders; `umbra-worker`, which loads plugins, lies beside it.
    pub umbra: PathBuf,
    /// Where each worker's private folder is made, and removed in the end.
    pub scratch: PathBuf,
    /// What isolates workers and compilers. A layer that is not available is an error of the machine.
    pub isolation: Layers,
    /// Folders with compiled shaders of trusted workers, which each worker that draws gets copies of.
    pub shaders: Vec<PathBuf>,
    /// Where workers leave the shaders that they compile; only for those that run no foreign code.
    pub leaves_shaders: Option<PathBuf>,
    /// Shaders are compiled in half of the time to the same pixels, and draw slower: for few and small frames.
    pub compiles_quickly: bool,
    /// Whatever runs holds it for reading; who must have the machine for itself, for writing.
    pub machine: Arc<RwLock<()>>,
}

/// How far a job is, by the worker's word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobProgress {
    /// Requests with an outcome.
    pub answered: usize,
    /// Requests in all.
    pub requests: usize,
    /// Finished and total rows of the image that is being rendered; 0 of 0 otherwise.
    pub rows: (u32, u32),
}

impl Supervisor {
    /// Starts workers of the running program, with as much isolation as this machine gives.
    ///
    /// # Errors
    /// When its path cannot be found out.
    pub fn of_this_program(scratch: PathBuf) -> io::Result<Self> {
        Ok(Self::available(std::env::current_exe()?, scratch))
    }

    /// Starts workers of the program `umbra`, with full isolation where there is a sandbox.
    pub fn new(umbra: PathBuf, scratch: PathBuf) -> Self {
        Self {
            umbra,
            scratch,
            isolation: Layers::of_this_system(),
            shaders: Vec::new(),
            leaves_shaders: None,
            compiles_quickly: false,
            machine: Arc::default(),
        }
    }

    /// The same with as much isolation as this machine gives, tried for real.
    pub fn available(umbra: PathBuf, scratch: PathBuf) -> Self {
        let isolation = sandbox::available(&umbra);
        Self { isolation, ..Self::new(umbra, scratch) }
    }

    /// Umbra and the program that loads plugins.
    pub fn programs(&self) -> [PathBuf; 2] {
        [self.umbra.clone(), program_beside(&self.umbra)]
    }

    /// Returns a guard for work that may run in parallel. Blocks while a confirmation has the machine to itself.
    pub fn beside_others(&self) -> RwLockReadGuard<'_, ()> {
        self.machine.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Runs `once` in parallel with other work. If it timed out, runs it again alone on the machine, since a busy
    /// machine is nobody's fault. For work that is done only once; jobs have a [`RetryBudget`].
    pub fn confirming_timeouts<T>(
        &self,
        once: impl Fn() -> T,
        timed_out: impl Fn(&T) -> bool,
    ) -> T {
        let beside = self.beside_others();
        let first = once();
        drop(beside);
        if !timed_out(&first) {
            return first;
        }
        let _alone = self.machine.write().unwrap_or_else(PoisonError::into_inner);
        once()
    }

    /// Asks all requests of `job` in one worker. When it dies, those answered keep their answers,
    /// and the rest is asked in a fresh worker. The request that it was at gets the blame when it
    /// was the worker's first; otherwise it is asked again as the first of the next. So `limits`,
    /// which hold for each worker, leave no request less than it would have alone. A `cancel` that
    /// becomes true ends it at once.
    pub fn run_job(
        &self,
        job: &Job,
        limits: &ProcessLimits,
        cancel: &AtomicBool,
        progress: &mut dyn FnMut(JobProgress),
    ) -> JobReport {
        self.run_job_with_retries(job, limits, &RetryBudget::none(), cancel, progress)
    }

    /// The same for one job of a submission's path: timeouts are confirmed as `retries` says.
    pub fn run_job_with_retries(
        &self,
        job: &Job,
        limits: &ProcessLimits,
        retries: &RetryBudget,
        cancel: &AtomicBool,
        progress: &mut dyn FnMut(JobProgress),
    ) -> JobReport {
        let count = job.requests.len();
        let mut outcomes: Vec<Option<Outcome>> = vec![None; count];
        let mut report = JobReport { outcomes: Vec::new(), renderer: None, runs: Vec::new() };
        let mut pending: Vec<usize> = (0..count).collect();
        let used_up = || job.plugin.is_some() && retries.used_up().is_some();
        // Which requests were asked again because their worker was ended from outside, or could not be started. A
        // renderer can end itself so: then it does again, and is to blame.
        let mut asked_again = vec![false; count];
        loop {
            // Each worker settles one request, or is the second that was ended from outside at it or could not be
            // started for it, so this ends.
            pending.retain(|&index| outcomes[index].is_none());
            for &index in &pending {
                outcomes[index] = retries.given_up(job, &job.requests[index]);
            }
            pending.retain(|&index| outcomes[index].is_none());
            if pending.is_empty() {
                break;
            }
            let answered = count - pending.len();
            let mut worker_progress = |in_worker, rows| {
                progress(JobProgress { answered: answered + in_worker, requests: count, rows });
            };
            let allowed = retries.allowed(job, &pending, limits);
            let beside = self.beside_others();
            let run = self.run_worker(job, &pending, &allowed, cancel, &mut worker_progress);
            drop(beside);
            let run = match run {
                Ok(run) => run,
                Err(error) => {
                    for &index in &pending {
                        if std::mem::replace(&mut asked_again[index], true) {
                            outcomes[index] = Some(cannot_run(&error));
                        }
                    }
                    continue;
                }
            };
            for (&index, outcome) in pending.iter().zip(run.outcomes) {
                outcomes[index] = outcome;
            }
            retries.spent(job, &run.ended);
            report.renderer = report.renderer.or(run.renderer);
            let exit = run.ended.exit;
            report.runs.push(WorkerRun { requests: pending.clone(), ended: run.ended });
            if exit.is_from_outside() {
                for &index in &pending {
                    if is_of_its_end(outcomes[index].as_ref())
                        && !std::mem::replace(&mut asked_again[index], true)
                    {
                        outcomes[index] = None;
                    }
                }
            }
            if !exit.is_out_of_time() {
                continue;
            }
            let open = |&index: &usize| match &outcomes[index] {
                None | Some(Outcome::TimedOut(_)) => true,
                outcome => exit == Exit::Starved && *outcome == Some(starved()),
            };
            let late: Vec<usize> = pending.iter().copied().filter(open).collect();
            let Some((&first, others)) = late.split_first() else { continue };
            // One that hangs while it is loaded is late for all that it is asked.
            others.iter().for_each(|&index| outcomes[index] = None);
            let was = outcomes[first].take();
            if used_up() {
                continue;
            }
            if let Some(allowed) = retries.again(job, first, limits) {
                let own = (first, &mut asked_again[first]);
                outcomes[first] =
                    self.run_again_alone(job, own, &allowed, retries, cancel, &mut report.runs);
            } else if let Some(was) = was {
                let late = match was {
                    Outcome::TimedOut(late) => Some(late),
                    _ => None,
                };
                outcomes[first] = Some(retries.timed_out(job, first, late, false));
            }
        }
        report.outcomes = outcomes.into_iter().flatten().collect();
        report
    }

    /// Runs one late request again, alone on the machine. Returns nothing when no time is left to settle it, or when
    /// its worker was ended from outside or could not be started and it was not asked again before.
    fn run_again_alone(
        &self,
        job: &Job,
        (index, asked_again): (usize, &mut bool),
        allowed: &Allowed,
        retries: &RetryBudget,
        cancel: &AtomicBool,
        runs: &mut Vec<WorkerRun>,
    ) -> Option<Outcome> {
        let alone = self.machine.write().unwrap_or_else(PoisonError::into_inner);
        let run = self.run_worker(job, &[index], allowed, cancel, &mut |_, _| ());
        drop(alone);
        let run = match run {
            Ok(run) => run,
            Err(error) => {
                return std::mem::replace(asked_again, true).then(|| cannot_run(&error));
            }
        };
        retries.spent(job, &run.ended);
        let exit = run.ended.exit;
        let is_late = exit.is_out_of_time();
        runs.push(WorkerRun { requests: vec![index], ended: run.ended });
        let outcome = run.outcomes.into_iter().next().flatten();
        let is_ended = exit.is_from_outside() && is_of_its_end(outcome.as_ref());
        if is_ended && !std::mem::replace(asked_again, true) {
            return None;
        }
        if !is_late {
            return outcome;
        }
        match outcome {
            _ if job.plugin.is_some() && retries.used_up().is_some() => None,
            Some(Outcome::TimedOut(late)) => Some(retries.timed_out(job, index, Some(late), true)),
            None | Some(Outcome::NotRun { .. }) => Some(retries.timed_out(job, index, None, true)),
            outcome => outcome,
        }
    }

    /// A folder for one worker's files.
    pub(super) fn private_folder(&self) -> io::Result<TempDir> {
        tempfile::Builder::new().prefix("umbra-worker-").tempdir_in(&self.scratch)
    }

    /// Prepares the files of a worker in its private folder, and how it is started. A `live` one draws
    /// frames as long as it is asked for them.
    pub(super) fn ready(
        &self,
        private: &Path,
        job: &Job,
        requests: &[&Request],
        limits: &ProcessLimits,
        live: bool,
    ) -> io::Result<Ready> {
        fs::create_dir(WorkerFolder(private).scratch())?;
        let mut own = WorkerPolicy::new(private, job, requests, self.isolation)?;
        own.shaders(requests, &self.shaders, self.leaves_shaders.as_deref());
        if live {
            own.live(private);
        }
        let files = Files::prepare(private, &own, requests, live)?;
        let program = Program::open(&program_beside(&self.umbra))?;
        let driver = software_driver();
        let elsewhere = |driver: &PathBuf| !driver.starts_with("/usr/share/vulkan");
        let mut command = command(&program, private, &own, requests, limits, driver.as_deref());
        if self.compiles_quickly {
            command.env("GALLIVM_PERF", "nopt");
        }
        let mut policy = own.policy;
        policy.read_only.extend(driver.filter(elsewhere).map(Bind::same));
        let confinement = Confinement::new(limits, policy);
        Ok(Ready { files, command, confinement, _program: program })
    }

    fn run_worker(
        &self,
        job: &Job,
        pending: &[usize],
        allowed: &Allowed,
        cancel: &AtomicBool,
        progress: &mut dyn FnMut(usize, (u32, u32)),
    ) -> io::Result<Run> {
        let private = self.private_folder()?;
        let requests: Vec<_> = pending.iter().map(|&index| &job.requests[index]).collect();
        let ready = self.ready(private.path(), job, &requests, &allowed.limits, false)?;
        let Ready { mut files, command, confinement, .. } = ready;
        let mut last = Instant::now();
        // The question that is being worked at, and the CPU time at its beginning. Both are the worker's
        // word; the kernel limits them all together.
        let (mut current, mut since_cpu_s) = (0, 0.0);
        let ended = process::run(command, &confinement, KEEP_OUTPUT, cancel, &mut |cpu_s| {
            if last.elapsed() >= PROGRESS_INTERVAL {
                last = Instant::now();
                if let Ok(records) = files.records() {
                    let (answered, rows) = how_far(&records);
                    progress(answered, rows);
                    if answered != current {
                        (current, since_cpu_s) = (answered, cpu_s);
                    }
                }
            }
            let own = allowed.each_cpu_s.get(current).copied().unwrap_or(f64::INFINITY);
            if cpu_s - since_cpu_s > own {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })?;
        // From here on the worker is gone, and what lies in the files stays as it is.
        let records = files.records()?;
        let mut run = Run { outcomes: vec![None; requests.len()], renderer: None, ended };
        let all = |outcome: Outcome| vec![Some(outcome); requests.len()];
        match &records[0] {
            SlotState::NotStarted => run.outcomes = all(not_started(&run.ended)),
            SlotState::Started { .. } => run.outcomes = all(death(&run.ended, allowed, current)),
            SlotState::Answered { status: api::STATUS_OK, message, .. } => {
                run.renderer = job.plugin.is_some().then(|| message.clone());
                for (index, (request, noted)) in requests.iter().zip(&records[1..]).enumerate() {
                    if matches!(noted, SlotState::Answered { .. }) {
                        run.outcomes[index] = Some(files.outcome(index, request, noted)?);
                        continue;
                    }
                    // The limits hold for all that a worker is asked, and others may have left
                    // something behind: only who came first in it is to blame for its end.
                    if index == 0 {
                        run.outcomes[index] = Some(death(&run.ended, allowed, current));
                    }
                    break;
                }
            }
            SlotState::Answered { message, .. } => {
                run.outcomes = all(Outcome::Rejected(message.clone()));
            }
        }
        if run.ended.exit == Exit::Cancelled {
            run.outcomes.iter_mut().for_each(|outcome| {
                outcome.get_or_insert_with(|| death(&run.ended, allowed, current));
            });
        }
        Ok(run)
    }
}

/// Whether an outcome may be that of a worker's end and nothing else; one that had not begun has no other.
fn is_of_its_end(outcome: Option<&Outcome>) -> bool {
    matches!(outcome, Some(Outcome::CrashedBySignal(_) | Outcome::NotRun { .. }))
}

fn cannot_run(error: &io::Error) -> Outcome {
    let reason = format!("{CANNOT_RUN}: {error}");
    Outcome::NotRun { reason, fault: Fault::Environment }
}

/// One worker's result: an outcome for each request up to the one that it died at.
struct Run {
    outcomes: Vec<Option<Outcome>>,
    renderer: Option<String>,
    ended: ChildOutcome,
}

/// A worker that is ready to be started.
pub(super) struct Ready {
    pub files: Files,
    pub command: Command,
    pub confinement: Confinement,
    /// To be held until it has started.
    pub _program: Program,
}

/// Number of answers, and the rows of the request that is being worked at.
fn how_far(records: &[SlotState]) -> (usize, (u32, u32)) {
    let mut rows = (0, 0);
    let mut answered = 0;
    for record in records.iter().skip(1) {
        match record {
            SlotState::Answered { .. } => answered += 1,
            SlotState::Started { rows: now } => rows = *now,
            SlotState::NotStarted => {}
        }
    }
    (answered, rows)
}

/// What it means that the worker did not even come to loading its plugin.
pub(super) fn not_started(ended: &ChildOutcome) -> Outcome {
    let (reason, fault) = match ended.exit {
        Exit::Cancelled => ("cancelled".to_owned(), Fault::Environment),
        exit if exit.is_out_of_time() => {
            ("the worker had no time to begin".to_owned(), Fault::Environment)
        }
        exit => {
            (format!("the worker did not begin, it {exit}: {}", ended.stderr.head), Fault::Internal)
        }
    };
    Outcome::NotRun { reason, fault }
}

fn starved() -> Outcome {
    let reason = process::nobodys_fault("the worker", Exit::Starved).to_string();
    Outcome::NotRun { reason, fault: Fault::Environment }
}

/// The outcome of the request at which a worker ended, the one with this index among its own.
pub(super) fn death(ended: &ChildOutcome, allowed: &Allowed, index: usize) -> Outcome {
    let limits = &allowed.limits;
    let late =
        |computing, limit_s| Outcome::TimedOut(Timeout { computing, limit_s, reference_s: None });
    match ended.exit {
        Exit::OutOfCpu => {
            let own = allowed.each_cpu_s.get(index).copied().unwrap_or(f64::INFINITY);
            late(true, own.min(limits.cpu_s as f64))
        }
        Exit::TimedOut => late(false, limits.wall_s),
        Exit::Starved => starved(),
        Exit::FileTooLarge => Outcome::FileTooLarge,
        Exit::Cancelled => {
            Outcome::NotRun { reason: "cancelled".to_owned(), fault: Fault::Environment }
        }
        Exit::Code(code) => Outcome::ExitedEarly(code),
        Exit::OutOfMemory => Outcome::OutOfMemory,
        Exit::Signal(signal) => {
            let name = signal_name(signal);
            // What Rust's runtime says; a plugin may say it too, and only fools its own report.
            let overflow = ended.stderr.contains("has overflowed its stack");
            Outcome::CrashedBySignal(if overflow {
                format!("{name}, stack overflow")
            } else {
                name
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn what_is_late_is_done_again_alone() {
        let supervisor = Supervisor::new("umbra".into(), "scratch".into());
        let calls = Cell::new(0);
        // Answers whether it had company; a second reader would be let in then.
        let once = || {
            calls.set(calls.get() + 1);
            supervisor.machine.try_read().is_ok()
        };
        assert!(!supervisor.confirming_timeouts(once, |_| true), "not alone the second time");
        assert_eq!(calls.replace(0), 2);
        assert!(supervisor.confirming_timeouts(once, |_| false));
        assert_eq!(calls.get(), 1);
    }
}
