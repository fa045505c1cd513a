//! A worker that stays: it loads a library and a scene once, and draws a frame for each camera it is sent.
//!
//! It is a worker like any other, confined before it loads anything, with its answer in the same files. Two pipes are
//! added: cameras go in, and a byte comes out for each frame that lies there. The parent still trusts none of it:
//! a byte too many shows an old frame or half of one, in a picture that nobody judges.

use std::fs::{self, File};
use std::io::{self, Read as _, Write as _};
use std::ops::ControlFlow;
use std::os::fd::AsFd as _;
use std::os::unix::fs::{OpenOptionsExt as _, PermissionsExt as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::fcntl::OFlag;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::stat::Mode;
use nix::unistd::mkfifo;
use tempfile::TempDir;

use super::files::Files;
use super::job::{CameraValue, Job, Request};
use super::outcome::{Outcome, Timeout};
use super::retry_budget::Allowed;
use super::supervise::{Ready, Supervisor, death, not_started};
use super::table::SlotState;
use super::wire::{WorkerFolder, camera_bytes};
use crate::process::{self, ChildOutcome, Exit, ProcessLimits};

/// Bytes of its output that are kept, besides a tail.
const KEEP_OUTPUT: usize = 16 << 10;
/// CPU seconds of a frame; the first one loads library and scene, and compiles shaders.
const FRAME_CPU_S: [f64; 2] = [5.0, 2.0];
/// A frame is given up after this long without computation.
const FRAME_STILL: Duration = Duration::from_secs(10);
/// What counts as nothing, in CPU seconds.
const NOTHING_S: f64 = 0.5;
/// A worker without requests for this long ends.
const IDLE: Duration = Duration::from_secs(30);
/// Time after which a worker's end is noticed, if its pipe does not tell.
const LOOK_MS: u16 = 50;

/// A worker that draws frames. Dropping it ends the process.
pub struct LiveWorker {
    request: Request,
    files: Files,
    cameras: File,
    frames: File,
    asked: Arc<FrameCounts>,
    cancel: Arc<AtomicBool>,
    thread: Option<JoinHandle<io::Result<ChildOutcome>>>,
    _private: TempDir,
}

/// How many frames were asked for and answered, for who watches the process.
#[derive(Default)]
struct FrameCounts {
    asked: AtomicU64,
    answered: AtomicU64,
    /// Whether the last one was given up on because nothing was done for it.
    stood_still: AtomicBool,
}

impl LiveWorker {
    /// Starts a worker that draws what `request` asks for, a [`Request::RenderRealtime`], with the library `plugin`.
    ///
    /// # Errors
    /// When its files cannot be made or it cannot be started.
    pub fn start(
        supervisor: &Supervisor,
        plugin: std::path::PathBuf,
        request: Request,
        limits: &ProcessLimits,
    ) -> io::Result<Self> {
        // How long it stands still is watched by the frame.
        let limits = ProcessLimits { wall_s: 86_400.0, cpu_s: 1 << 20, ..limits.clone() };
        let private = supervisor.private_folder()?;
        let [cameras, frames] = {
            let folder = WorkerFolder(private.path());
            [folder.cameras(), folder.frames()]
        };
        let pipe = |path: &std::path::Path, mode| -> io::Result<File> {
            mkfifo(path, Mode::S_IRUSR | Mode::S_IWUSR)?;
            // As root, the worker is another user; the folder lets nobody else in.
            fs::set_permissions(path, fs::Permissions::from_mode(mode))?;
            // Open for both, so that neither side waits for the other to open it.
            let flags = OFlag::O_NONBLOCK.bits();
            File::options().read(true).write(true).custom_flags(flags).open(path)
        };
        let (cameras, frames) = (pipe(&cameras, 0o644)?, pipe(&frames, 0o600)?);
        let job = Job { plugin: Some(plugin), requests: vec![request.clone()] };
        let Ready { files, command, confinement, _program: program } =
            supervisor.ready(private.path(), &job, &[&request], &limits, true)?;
        let (asked, cancel) = (Arc::<FrameCounts>::default(), Arc::<AtomicBool>::default());
        let (seen, ends) = (Arc::clone(&asked), Arc::clone(&cancel));
        let thread = std::thread::spawn(move || {
            let _program = program;
            let mut watch = Watch::new(&seen, &ends);
            process::run(command, &confinement, KEEP_OUTPUT, &ends, &mut |cpu_s| watch.look(cpu_s))
        });
        let thread = Some(thread);
        Ok(Self { request, files, cameras, frames, asked, cancel, thread, _private: private })
    }

    /// Draws one frame. None when the worker had ended for want of questions. After any outcome but an answer it is
    /// gone, and this must not be asked again.
    ///
    /// # Errors
    /// When its files cannot be read.
    pub fn frame(&mut self, camera: &CameraValue) -> io::Result<Option<Outcome>> {
        self.asked.asked.fetch_add(1, Ordering::Release);
        // A pipe holds far more than the one camera that is ever in it.
        self.cameras.write_all(&camera_bytes(camera))?;
        loop {
            let mut polled = [PollFd::new(self.frames.as_fd(), PollFlags::POLLIN)];
            let ready = poll(&mut polled, PollTimeout::from(LOOK_MS)).unwrap_or(0);
            let mut byte = [0];
            if ready > 0 && matches!(self.frames.read(&mut byte), Ok(1)) {
                let records = self.files.records()?;
                if let Some(noted @ SlotState::Answered { .. }) = records.get(1) {
                    let outcome = self.files.outcome(0, &self.request, noted)?;
                    self.asked.answered.fetch_add(1, Ordering::Release);
                    return Ok(Some(outcome));
                }
            }
            if self.thread.as_ref().is_none_or(JoinHandle::is_finished) {
                return self.ended();
            }
        }
    }

    /// What ends it, for who does not hold it: a frame that is being drawn then has no answer.
    pub fn canceller(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.cancel)
    }

    /// What it means that the process is gone.
    fn ended(&mut self) -> io::Result<Option<Outcome>> {
        let Some(thread) = self.thread.take() else { return Ok(None) };
        let ended =
            thread.join().map_err(|_| io::Error::other("the watching thread panicked"))??;
        let records = self.files.records()?;
        let late = |computing, limit_s| {
            Outcome::TimedOut(Timeout { computing, limit_s, reference_s: None })
        };
        Ok(Some(match (&records[..], ended.exit) {
            (_, Exit::Cancelled) => return Ok(None),
            // It said why and was gone before it was heard.
            ([_, noted @ SlotState::Answered { status, .. }, ..], _)
                if *status != renderer_api::STATUS_OK =>
            {
                self.files.outcome(0, &self.request, noted)?
            }
            ([SlotState::NotStarted, ..], _) => not_started(&ended),
            ([SlotState::Answered { status, message, .. }, ..], _)
                if *status != renderer_api::STATUS_OK =>
            {
                Outcome::Rejected(message.clone())
            }
            (_, Exit::OutOfCpu) if self.asked.stood_still.load(Ordering::Acquire) => {
                late(false, FRAME_STILL.as_secs_f64())
            }
            (_, Exit::OutOfCpu) => {
                let answered = self.asked.answered.load(Ordering::Acquire);
                late(true, FRAME_CPU_S[usize::from(answered > 0)])
            }
            _ => {
                let limits = ProcessLimits::default();
                death(&ended, &Allowed { limits, each_cpu_s: Vec::new() }, 0)
            }
        }))
    }
}

impl Drop for LiveWorker {
    fn drop(&mut self) {
        self.cancel.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Ends a worker whose frame takes too long, and one that nobody asks.
struct Watch<'a> {
    seen: &'a FrameCounts,
    cancel: &'a AtomicBool,
    /// The frame that is waited for, or the number of all when none is.
    at: (u64, u64),
    since: Instant,
    since_cpu_s: f64,
}

impl<'a> Watch<'a> {
    fn new(seen: &'a FrameCounts, cancel: &'a AtomicBool) -> Self {
        Self { seen, cancel, at: (0, 0), since: Instant::now(), since_cpu_s: 0.0 }
    }

    fn look(&mut self, cpu_s: f64) -> ControlFlow<()> {
        let answered = self.seen.answered.load(Ordering::Acquire);
        let now = (self.seen.asked.load(Ordering::Acquire), answered);
        if now != self.at {
            (self.at, self.since, self.since_cpu_s) = (now, Instant::now(), cpu_s);
        }
        let (waited, used_s) = (self.since.elapsed(), cpu_s - self.since_cpu_s);
        let (asked, answered) = now;
        if asked == answered {
            if waited > IDLE {
                self.cancel.store(true, Ordering::Release);
            }
        } else if used_s > FRAME_CPU_S[usize::from(answered > 0)] {
            return ControlFlow::Break(());
        } else if waited > FRAME_STILL && used_s < NOTHING_S {
            self.seen.stood_still.store(true, Ordering::Release);
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }
}
