//! Watching a child on Unix.

use std::io;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use nix::errno::Errno;
use nix::libc;
use nix::sys::signal::{Signal, kill};
use nix::sys::wait::{Id, WaitPidFlag, WaitStatus, waitid};
use nix::unistd::Pid;

use super::pipes::Pipes;
use super::standstill::{self, Standstill};
use super::{ChildOutcome, Confinement, Exit, Watcher, start};
use crate::sandbox::{InForce, Policy, SandboxError, read_report};

/// How often time, the user's wish to stop and the memory in use are looked at.
const TICK: Duration = Duration::from_millis(20);
/// A child that is not done after so many times the seconds that it may stand still got no processor.
const STARVED: u32 = 20;
/// How long the output of a process that is gone may still be held open by another.
const DRAIN: Duration = Duration::from_millis(200);

/// Runs `command` (see `start`) to its end and reaps it. Of each output
/// stream the first `keep` bytes and a short tail are kept, the rest is read and forgotten. `watcher`
/// is told now and then how many CPU seconds it has had; when it breaks off, the child is
/// [`Exit::OutOfCpu`].
///
/// However it ends, its process group is killed and it is reaped before this returns.
///
/// # Errors
/// When the child cannot be started, confined or watched.
pub fn run(
    mut command: Command,
    confinement: &Confinement,
    keep: usize,
    cancel: &AtomicBool,
    watcher: &mut Watcher,
) -> io::Result<ChildOutcome> {
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let begin = Instant::now();
    let mut child = start(command, confinement)?;
    let pid = Pid::from_raw(child.id() as i32);
    let mut group = Group { pid, reaped: false };
    let mut pipes = Pipes::of(&mut child, keep)?;
    let mut watch = Watch::new(pid, begin, confinement);
    let ended_by_us = watch.until_end(&mut pipes, cancel, watcher)?;
    if ended_by_us.is_some() {
        watch.running.end_inside();
    }
    let (status, usage) = group.end()?;
    let wall_s = begin.elapsed().as_secs_f64();
    pipes.drain(DRAIN);
    let left_process = pipes.any_open();
    let cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
    let out_of_cpu = cpu_s >= confinement.limits.cpu_s as f64;
    let exit = ended_by_us.unwrap_or_else(|| exit_of(status, out_of_cpu));
    let in_force = match confinement.sandbox.as_ref().map(in_force) {
        // It was not confined, and nothing foreign ran: only the machine can be at fault.
        Some(Err(error)) if ended_by_us.is_none() => return Err(io::Error::other(error)),
        Some(in_force) => in_force.ok(),
        None => None,
    };
    let [stdout, stderr] = pipes.finish();
    // Kilobytes on Linux.
    let peak_resident_mib = usage.ru_maxrss as u64 >> 10;
    let peak_mib = peak_resident_mib.max(watch.peak_address_mib);
    Ok(ChildOutcome {
        exit: exit.with_memory(&stderr, peak_mib, confinement.limits.memory_mib),
        pid: pid.as_raw() as u32,
        stdout,
        stderr,
        wall_s,
        cpu_s,
        still_s: watch.still.so_far().as_secs_f64(),
        peak_resident_mib,
        peak_address_mib: watch.peak_address_mib,
        in_force,
        left_process,
    })
}

/// What is seen of a child while it runs.
struct Watch {
    running: Running,
    begin: Instant,
    may_stand_still: Duration,
    still: Standstill,
    /// Whether it has printed since the last look.
    printed: bool,
    peak_address_mib: u64,
}

impl Watch {
    fn new(child: Pid, begin: Instant, confinement: &Confinement) -> Self {
        Self {
            running: Running { child, sandboxed: confinement.sandbox.is_some(), payload: None },
            begin,
            may_stand_still: Duration::from_secs_f64(confinement.limits.wall_s),
            still: Standstill::new(begin),
            printed: false,
            peak_address_mib: 0,
        }
    }

    /// Reads the output until the child is gone or must be ended. Returns the reason to end it.
    fn until_end(
        &mut self,
        pipes: &mut Pipes,
        cancel: &AtomicBool,
        watcher: &mut Watcher,
    ) -> io::Result<Option<Exit>> {
        let mut looked = self.begin;
        loop {
            pipes.wait(TICK);
            // Who waits for us to read does not wait by choice.
            self.printed |= pipes.read();
            if has_exited(self.running.child)? {
                return Ok(None);
            }
            if cancel.load(Ordering::Relaxed) {
                return Ok(Some(Exit::Cancelled));
            }
            let now = Instant::now();
            if now - looked < TICK {
                continue;
            }
            looked = now;
            if let Some(exit) = self.look(now, watcher) {
                return Ok(Some(exit));
            }
        }
    }

    /// Looks at its memory and time. Returns the reason to end it, if it has used too much.
    fn look(&mut self, now: Instant, watcher: &mut Watcher) -> Option<Exit> {
        self.running.find();
        let stands_still = self.running.stands_still().map(|still| still && !self.printed);
        self.still.look(now, stands_still);
        self.printed = false;
        self.peak_address_mib = self.peak_address_mib.max(self.running.address_space_mib());
        let cpu_s = self.running.cpu_s();
        if watcher(cpu_s).is_break() {
            return Some(Exit::OutOfCpu);
        }
        if self.still.so_far() >= self.may_stand_still {
            return Some(Exit::TimedOut);
        }
        let passed = now - self.begin;
        (passed >= STARVED * self.may_stand_still).then(|| {
            let computed = 2.0 * cpu_s > passed.as_secs_f64();
            if computed { Exit::OutOfCpu } else { Exit::Starved }
        })
    }
}

/// How a child ended by itself, from its status.
fn exit_of(status: i32, out_of_cpu: bool) -> Exit {
    match libc::WIFSIGNALED(status).then(|| libc::WTERMSIG(status)) {
        Some(libc::SIGXCPU) => Exit::OutOfCpu,
        Some(libc::SIGXFSZ) => Exit::FileTooLarge,
        Some(libc::SIGKILL) if out_of_cpu => Exit::OutOfCpu,
        Some(signal) => Exit::Signal(signal),
        None => Exit::Code(libc::WEXITSTATUS(status)),
    }
}

/// What was in force, if it was what had been asked for.
fn in_force(policy: &Policy) -> Result<InForce, SandboxError> {
    let report = policy.report.as_deref().unwrap_or(Path::new(""));
    let in_force = read_report(report)?;
    if in_force.layers == policy.layers {
        Ok(in_force)
    } else {
        Err(SandboxError::new("launcher", "isolate its child", "other layers than asked for"))
    }
}

/// A child, and what runs inside when it is a sandbox's launcher.
struct Running {
    child: Pid,
    sandboxed: bool,
    /// The payload, once it is known.
    payload: Option<Pid>,
}

impl Running {
    /// Looks who runs foreign code now, as long as that is not known.
    fn find(&mut self) {
        if !self.sandboxed {
            self.payload = Some(self.child);
        }
        #[cfg(target_os = "linux")]
        if self.payload.is_none() {
            let payload = crate::sandbox::payload_pid(self.child.as_raw() as u32);
            self.payload = payload.map(|pid| Pid::from_raw(pid as i32));
        }
    }

    /// Its address space; 0 when it is not known.
    fn address_space_mib(&self) -> u64 {
        self.payload.map_or(0, address_space_mib)
    }

    /// CPU seconds of its threads; 0 when it is not known.
    fn cpu_s(&self) -> f64 {
        self.payload.map_or(0.0, standstill::cpu_s)
    }

    /// Whether it and all that it started stand still; `None` if that is not known.
    fn stands_still(&self) -> Option<bool> {
        match self.payload {
            Some(payload) => standstill::stands_still(payload),
            // The launcher at work.
            None => standstill::stands_still(self.child).filter(|still| !still),
        }
    }

    /// Ends what is inside first, so that the launcher reaps it: its usage counts it then, and
    /// nothing is alive when the launcher is gone.
    fn end_inside(&self) {
        #[cfg(target_os = "linux")]
        for at_once in [false, true] {
            let launcher = self.child.as_raw() as u32;
            if !self.sandboxed || !crate::sandbox::kill_inside(launcher, at_once) {
                return;
            }
            let until = Instant::now() + DRAIN;
            while Instant::now() < until && matches!(has_exited(self.child), Ok(false)) {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }
}

/// A child and its process group; both are ended when this is dropped, on error paths too.
struct Group {
    pid: Pid,
    reaped: bool,
}

impl Group {
    /// Kills the group, reaps the child, and answers its wait status and resource usage.
    fn end(&mut self) -> io::Result<(i32, libc::rusage)> {
        // The child is not reaped yet, so its id cannot have gone to another process. Before it
        // made its own session it has no descendants, and killing itself is enough.
        for target in [Pid::from_raw(-self.pid.as_raw()), self.pid] {
            match kill(target, Signal::SIGKILL) {
                Ok(()) | Err(Errno::ESRCH) => {}
                Err(error) => return Err(error.into()),
            }
        }
        let mut status = 0;
        // SAFETY: all-zero is a valid `rusage`, plain integers.
        let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
        // SAFETY: both places are valid for writing during the call.
        while unsafe { libc::wait4(self.pid.as_raw(), &mut status, 0, &mut usage) } < 0 {
            let error = Errno::last();
            if error != Errno::EINTR {
                return Err(error.into());
            }
        }
        self.reaped = true;
        Ok((status, usage))
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        if !self.reaped {
            let _ = self.end();
        }
    }
}

/// Whether the child is gone; it is not reaped by asking.
fn has_exited(pid: Pid) -> io::Result<bool> {
    let flags = WaitPidFlag::WEXITED | WaitPidFlag::WNOHANG | WaitPidFlag::WNOWAIT;
    match waitid(Id::Pid(pid), flags) {
        Ok(WaitStatus::StillAlive) | Err(Errno::EINTR) => Ok(false),
        Ok(_) => Ok(true),
        Err(error) => Err(error.into()),
    }
}

/// The address space of a process now; 0 when it is not known.
fn address_space_mib(pid: Pid) -> u64 {
    let pages = std::fs::read_to_string(format!("/proc/{pid}/statm"))
        .ok()
        .and_then(|text| text.split_whitespace().next()?.parse::<u64>().ok());
    pages.unwrap_or(0) * PAGE / (1 << 20)
}

/// Good enough for a figure that only tells "near its limit" from "far from it".
const PAGE: u64 = 4096;

fn seconds(time: libc::timeval) -> f64 {
    time.tv_sec as f64 + time.tv_usec as f64 * 1e-6
}
