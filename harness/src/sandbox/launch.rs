//! Both ends of a start: the caller's [`command`], and the child's [`confine_self`].

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{self, Read, Seek, Write};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

use nix::libc;
use nix::sys::memfd::{MFdFlags, memfd_create};
use serde::{Deserialize, Serialize};

use super::process_tree::{self, Ready};
use super::{EXIT_NOT_CONFINED, InForce, LAUNCH_COMMAND, Policy, SandboxError};

/// What the child reads from its standard input.
#[derive(Serialize, Deserialize)]
struct Orders {
    policy: Policy,
    /// The caller's process id: the child stops when the caller is already gone.
    parent: u32,
}

/// The orders for a child, to be its standard input: there they leave no trace in its arguments,
/// environment or files, and nobody else can write them.
///
/// # Errors
/// When there is no memory for them.
pub fn orders(policy: &Policy) -> io::Result<Stdio> {
    let orders = Orders { policy: policy.clone(), parent: std::process::id() };
    let mut file = File::from(memfd_create(c"umbra orders", MFdFlags::MFD_CLOEXEC)?);
    file.write_all(&serde_json::to_vec(&orders)?)?;
    file.rewind()?;
    Ok(file.into())
}

/// A command that executes `program` (a path inside) under `policy`. `umbra` is the binary that
/// calls [`launch_main`]. The environment is empty but for what the caller adds; standard output and
/// error are the caller's to set; standard input is taken.
///
/// Wait for the child on the thread that starts it: it is killed when that thread ends. Killing
/// the child ends everything inside.
///
/// # Errors
/// When the orders cannot be written.
pub fn command<I, S>(umbra: &Path, policy: &Policy, program: &Path, args: I) -> io::Result<Command>
where
    I: IntoIterator<Item = S>,
    S: AsRef<OsStr>,
{
    let mut command = Command::new(umbra);
    command.arg(LAUNCH_COMMAND).arg(program).args(args).env_clear().stdin(orders(policy)?);
    Ok(command)
}

/// The hidden command `__launch PROGRAM ARGS...`: confines this process, then becomes the program.
/// Returns only when that failed.
pub fn launch_main(program: &OsStr, args: &[OsString]) -> ExitCode {
    let error = match receive().and_then(|policy| process_tree::confine(&policy)) {
        Ok(ready) => {
            // The standard library's `exec` also undoes what the Rust runtime did to SIGPIPE.
            let cause = Command::new(program).args(args).exec();
            let step = format!("execute {}", program.display());
            ready.failed(SandboxError::new("launcher", step, cause))
        }
        Err(error) => error,
    };
    eprintln!("umbra: {error}");
    ExitCode::from(EXIT_NOT_CONFINED)
}

/// Confines this process by the orders on its standard input, which is empty afterwards; every other
/// file descriptor but standard output and error is closed. Call it first thing in `main`.
///
/// It returns in a grandchild of the process that called it; the other two never return.
///
/// # Errors
/// When there are no orders, this process has threads, or any layer that was asked for cannot be
/// had. Then nothing foreign may be touched.
pub fn confine_self() -> Result<InForce, SandboxError> {
    receive().and_then(|policy| process_tree::confine(&policy)).map(Ready::go)
}

/// Reads the orders and puts `/dev/null` in their place.
fn receive() -> Result<Policy, SandboxError> {
    let error = |cause: String| {
        SandboxError::new("launcher", "read its orders from standard input", cause)
            .hint("this command is for Umbra's own use")
    };
    let mut text = String::new();
    io::stdin().lock().read_to_string(&mut text).map_err(|cause| error(cause.to_string()))?;
    let orders: Orders = serde_json::from_str(&text).map_err(|cause| error(cause.to_string()))?;
    let null = File::open("/dev/null").map_err(|cause| error(cause.to_string()))?;
    nix::unistd::dup2_stdin(&null).map_err(|cause| error(cause.to_string()))?;
    process_tree::follow(orders.parent)?;
    Ok(orders.policy)
}

/// The host's process id of the payload behind a launcher, once there is one: its
/// `/proc/PID` shows the memory in use.
pub fn payload_pid(launcher: u32) -> Option<u32> {
    child_of(child_of(launcher)?)
}

/// Ends everything inside by killing the payload: process 1 then ends and reaps the others,
/// so that the launcher's usage counts all. With `at_once`, or before there is one, process 1 itself is
/// killed. False when there is nothing to kill (any more).
pub fn kill_inside(launcher: u32, at_once: bool) -> bool {
    let Some(init) = child_of(launcher) else { return false };
    (!at_once && kill_child(init)) || kill_child(launcher)
}

/// Kills a process's first child.
fn kill_child(parent: u32) -> bool {
    let Some(child) = child_of(parent) else { return false };
    // SAFETY: plain integers.
    let fd = unsafe { libc::syscall(libc::SYS_pidfd_open, child, 0) };
    if fd < 0 {
        return false;
    }
    // SAFETY: a new descriptor that nobody else knows.
    let fd = unsafe { OwnedFd::from_raw_fd(fd as i32) };
    // Only now is it certain whom the descriptor means: the id may have gone to another before.
    if child_of(parent) != Some(child) {
        return false;
    }
    let (fd, info) = (fd.as_raw_fd(), std::ptr::null::<libc::siginfo_t>());
    // SAFETY: the descriptor is open, and no information is passed.
    unsafe { libc::syscall(libc::SYS_pidfd_send_signal, fd, libc::SIGKILL, info, 0) == 0 }
}

fn child_of(pid: u32) -> Option<u32> {
    let list = std::fs::read_to_string(format!("/proc/{pid}/task/{pid}/children")).ok()?;
    list.split_whitespace().next()?.parse().ok()
}
