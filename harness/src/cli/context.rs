//! The context of most commands: the assignment, workers, the reference renderer, Ctrl-C, progress.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context as _;

use super::terminal::Progress;
use crate::assignment::Assignment;
use crate::decode::Decoder;
use crate::files::Scratch;
use crate::store::{Store, reference_library};
use crate::worker::Supervisor;

/// Set by Ctrl-C; whatever runs ends soon after, and nothing half-written is left.
pub static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// The assignment and the means to run things.
pub struct Context {
    /// What is graded.
    pub assignment: Assignment,
    /// Starts workers.
    pub supervisor: Supervisor,
    /// Tells what is being done.
    pub progress: Progress,
    /// The supervisor's.
    _scratch: Scratch,
}

impl Context {
    /// The assignment at `root`, else at or above the current folder, else above the program.
    ///
    /// # Errors
    /// When there is none, or it cannot be used.
    pub fn assignment(root: Option<&Path>) -> anyhow::Result<Assignment> {
        if let Some(root) = root {
            return Ok(Assignment::load(root)?);
        }
        let here = std::env::current_dir().context("cannot tell the current folder")?;
        Ok(Assignment::find(&here).or_else(|missing| {
            let program = std::env::current_exe().unwrap_or_default();
            Assignment::find(&program).map_err(|_| missing)
        })?)
    }

    /// Finds the assignment and makes ready for running things.
    ///
    /// # Errors
    /// When there is no assignment, or no place to work in.
    pub fn new(root: Option<&Path>) -> anyhow::Result<Self> {
        let assignment = Self::assignment(root)?;
        let scratch = assignment.scratch()?;
        catch_interrupts();
        let supervisor = Supervisor::of_this_program(scratch.path().to_owned())?;
        Ok(Self { assignment, supervisor, progress: Progress::new(), _scratch: scratch })
    }

    /// Where the reference renderer's library should be, if it is there.
    pub fn reference(&self) -> Option<PathBuf> {
        reference_library(&self.assignment.root, &self.supervisor.umbra)
    }

    /// Runs `body` with the store of expected images, showing what it does.
    pub fn with_store<T>(&self, body: impl FnOnce(&Store) -> T) -> T {
        let progress = |message: &str| self.say(message);
        let store = Store {
            assignment: &self.assignment,
            reference: self.reference(),
            supervisor: &self.supervisor,
            threads: cores(),
            progress: &progress,
        };
        body(&store)
    }

    /// What decodes submissions.
    pub fn decoder(&self) -> Decoder<'_> {
        Decoder::new(&self.supervisor, &self.assignment.limits.decode, &INTERRUPTED)
    }

    /// Shows what is being done.
    pub fn say(&self, message: &str) {
        self.progress.say(message);
    }
}

/// The number of cores to use.
pub fn cores() -> u32 {
    std::thread::available_parallelism().map_or(1, |cores| cores.get() as u32)
}

/// Where a word goes when Ctrl-C came, if anybody waits for it.
#[cfg(unix)]
static WAITING: std::sync::atomic::AtomicI32 = std::sync::atomic::AtomicI32::new(-1);

/// Calls `body` in a thread of its own when Ctrl-C has come, without looking for it until then.
///
/// # Errors
/// When the system gives no pipe.
pub fn on_interrupt(body: impl FnOnce() + Send + 'static) -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use std::io::Read as _;
        use std::os::fd::IntoRawFd as _;
        let (mut told, tell) = std::io::pipe()?;
        // Open as long as the program.
        WAITING.store(tell.into_raw_fd(), Ordering::SeqCst);
        std::thread::spawn(move || {
            // It may have come before anybody waited.
            if INTERRUPTED.load(Ordering::SeqCst) || told.read_exact(&mut [0]).is_ok() {
                body();
            }
        });
    }
    #[cfg(not(unix))]
    drop(body); // Ctrl-C ends the program there.
    Ok(())
}

/// Ends the program in good order at Ctrl-C, a polite kill, and when its terminal is closed. A second Ctrl-C ends it at
/// once.
pub fn catch_interrupts() {
    #[cfg(unix)]
    {
        extern "C" fn interrupted(signal: i32) {
            // A terminal that closes may say so twice.
            if INTERRUPTED.swap(true, Ordering::SeqCst) && signal != nix::libc::SIGHUP {
                crate::process::exit_now(i32::from(super::EXIT_INTERRUPTED));
            }
            let waiting = WAITING.load(Ordering::SeqCst);
            if waiting >= 0 {
                // SAFETY: `write` is allowed in a handler; the descriptor is never closed, the byte is there.
                unsafe { nix::libc::write(waiting, [0u8].as_ptr().cast(), 1) };
            }
        }
        use nix::sys::signal::{SaFlags, SigAction, SigHandler, SigSet, Signal, sigaction};
        let action =
            SigAction::new(SigHandler::Handler(interrupted), SaFlags::SA_RESTART, SigSet::empty());
        for signal in [Signal::SIGINT, Signal::SIGTERM] {
            // SAFETY: the handler touches one atomic and may call `_exit`: both are allowed there.
            let _ = unsafe { sigaction(signal, &action) };
        }
        // SAFETY: as above. Where it was ignored, as `nohup` does, it still is.
        unsafe {
            if let Ok(before) = sigaction(Signal::SIGHUP, &action)
                && matches!(before.handler(), SigHandler::SigIgn)
            {
                let _ = sigaction(Signal::SIGHUP, &before);
            }
        }
    }
}
