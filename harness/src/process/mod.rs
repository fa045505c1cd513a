//! Child processes. Each confines itself before it touches anything hostile, is watched while it runs, and is ended
//! with all reachable descendants and reaped on every path.
//!
//! Everything of Umbra that runs foreign code (the compiler, the worker) goes through [`run`].
//! `start` is the one place where a process is made; what the child does to itself first is
//! [`confine_self`].

mod capture;
mod limits;
#[cfg(unix)]
mod pipes;
#[cfg(unix)]
mod standstill;
mod start;
#[cfg(unix)]
mod watch;
#[cfg(not(unix))]
#[path = "watch_fallback.rs"]
mod watch;

pub use crate::sandbox::EXIT_NOT_CONFINED;
pub use capture::Captured;
pub use limits::{Confinement, ProcessLimits};
pub use start::{command, confine_self, exec_main, exit_now, start};
pub use watch::run;

use serde::{Deserialize, Serialize};

use crate::sandbox::InForce;

/// Receives the CPU seconds that a child has used so far, and says whether it may continue: see [`run`].
pub type Watcher<'a> = dyn FnMut(f64) -> std::ops::ControlFlow<()> + 'a;

/// How a child ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Exit {
    /// By itself, with this code.
    Code(i32),
    /// By this signal, which Umbra did not send.
    Signal(i32),
    /// At its memory limit, or so it said.
    OutOfMemory,
    /// By the kernel, out of CPU time, or by Umbra, because its watcher broke off.
    OutOfCpu,
    /// By Umbra, because it stood still too long: it neither computed nor waited for a processor.
    TimedOut,
    /// By Umbra, because the machine was too busy for it: nobody's fault.
    Starved,
    /// By the kernel, because it wrote a larger file than allowed.
    FileTooLarge,
    /// By Umbra, because the user asked to stop.
    Cancelled,
}

impl Exit {
    /// Turns an end into [`Exit::OutOfMemory`] where that is likely: the child died within a tenth of its limit, or its
    /// last message is that of a failed allocation (Rust's, C++'s, LLVM's). A child that forges the message fools only
    /// its own report.
    fn with_memory(self, stderr: &Captured, peak_mib: u64, limit_mib: u64) -> Self {
        let says = ["memory allocation of ", "std::bad_alloc", "LLVM ERROR: out of memory"];
        let said = says.iter().any(|words| stderr.contains(words));
        match self {
            Self::Signal(_) if said || peak_mib >= limit_mib - limit_mib / 10 => Self::OutOfMemory,
            Self::Code(code) if said && code != 0 => Self::OutOfMemory,
            other => other,
        }
    }

    /// Whether it got a signal that ends processes from outside: an operator's, a scheduler's, or that of a machine
    /// out of memory. A program that fails gets others.
    pub fn is_from_outside(self) -> bool {
        #[cfg(unix)]
        {
            use nix::libc::{SIGHUP, SIGINT, SIGKILL, SIGQUIT, SIGTERM};
            matches!(self, Self::Signal(SIGHUP | SIGINT | SIGQUIT | SIGTERM | SIGKILL))
        }
        #[cfg(not(unix))]
        false
    }

    /// Whether it ran out of time, its own or the machine's.
    pub fn is_out_of_time(self) -> bool {
        matches!(self, Self::OutOfCpu | Self::TimedOut | Self::Starved)
    }
}

/// In words that follow the child's name: "the compiler ran out of memory".
impl std::fmt::Display for Exit {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Code(code) => write!(f, "ended with code {code}"),
            Self::Signal(signal) => write!(f, "was ended by {}", signal_name(*signal)),
            Self::OutOfMemory => f.write_str("ran out of memory"),
            Self::OutOfCpu | Self::TimedOut => f.write_str("ran out of time"),
            Self::Starved => f.write_str("got no processor: this machine is too busy"),
            Self::FileTooLarge => f.write_str("wrote a larger file than is allowed"),
            Self::Cancelled => f.write_str("was interrupted"),
        }
    }
}

/// What is known about a child that is gone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChildOutcome {
    /// How it ended.
    pub exit: Exit,
    /// What its process id was, and its group's.
    pub pid: u32,
    /// Its standard output.
    pub stdout: Captured,
    /// Its standard error.
    pub stderr: Captured,
    /// From start to reaping, in seconds, as the parent's clock saw it.
    pub wall_s: f64,
    /// User and system time of the child and its reaped children, in seconds; 0 when unknown.
    pub cpu_s: f64,
    /// How long it stood still, in seconds: it neither computed nor waited for a processor or a disk.
    /// Where the system does not tell, all its time counts.
    #[serde(default)]
    pub still_s: f64,
    /// Largest resident size in MiB; 0 when unknown.
    pub peak_resident_mib: u64,
    /// Largest address space that was seen in MiB, by sampling; 0 when unknown.
    pub peak_address_mib: u64,
    /// The isolation that was in force; none without any, and when it ended before it was confined.
    pub in_force: Option<InForce>,
    /// Whether some process outside the child's group still held its output open in the end.
    pub left_process: bool,
}

impl ChildOutcome {
    /// Bytes that it printed, kept or not.
    pub fn printed(&self) -> u64 {
        self.stdout.bytes + self.stderr.bytes
    }
}

/// The error for a child whose end is nobody's fault: it was [`Exit::Starved`], or ended from outside. Its kind is
/// `TimedOut`: doing it again may help.
pub fn nobodys_fault(what: &str, exit: Exit) -> std::io::Error {
    std::io::Error::new(std::io::ErrorKind::TimedOut, format!("{what} {exit}"))
}

/// The usual name of a signal.
pub fn signal_name(signal: i32) -> String {
    #[cfg(unix)]
    if let Ok(known) = nix::sys::signal::Signal::try_from(signal) {
        return known.as_str().to_owned();
    }
    format!("signal {signal}")
}
