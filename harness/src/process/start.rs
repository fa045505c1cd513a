//! The start of a child, on both sides: what the parent does stands in [`start`], what the child does to itself in
//! [`confine_self`]. Both call `sandbox` for what is more than limits.

use std::ffi::{OsStr, OsString};
use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitCode, Stdio};

use super::{Confinement, ProcessLimits};
use crate::sandbox::{self, EXIT_NOT_CONFINED};

/// Carries the [`Confinement`] to the child, which removes it.
const CONFINEMENT_VARIABLE: &str = "UMBRA_CONFINEMENT";
/// Carries the parent's process id to the child.
const PARENT_VARIABLE: &str = "UMBRA_PARENT";

/// A command that confines itself by `confinement`, then executes `program`, a path as the child sees it.
/// `umbra` is this program. The environment is empty but for what the caller adds.
pub fn command(umbra: &Path, confinement: &Confinement, program: &Path) -> Command {
    let hidden = if confinement.sandbox.is_some() { sandbox::LAUNCH_COMMAND } else { "__exec" };
    let mut command = Command::new(umbra);
    command.arg(hidden).arg(program).env_clear();
    command
}

/// Starts `command`, which must be Umbra with a hidden command, or `umbra-worker`: either calls [`confine_self`] before
/// anything hostile is touched. Its standard input is taken. The child must be waited for on the thread that calls
/// this: it is killed when that thread ends.
///
/// # Errors
/// When the process cannot be made.
pub fn start(mut command: Command, confinement: &Confinement) -> io::Result<Child> {
    command.stdin(Stdio::null());
    #[cfg(target_os = "linux")]
    if let Some(policy) = &confinement.sandbox {
        use std::os::unix::process::CommandExt;
        // A group of its own: the terminal's Ctrl-C is for Umbra, which ends its children itself.
        return command.stdin(sandbox::orders(policy)?).process_group(0).spawn();
    }
    if confinement.sandbox.is_some() {
        return Err(io::Error::other("there is no isolation on this system"));
    }
    command.env(CONFINEMENT_VARIABLE, serde_json::to_string(confinement)?);
    command.env(PARENT_VARIABLE, std::process::id().to_string());
    command.spawn()
}

/// Confines this process by what [`start`] was given: in a sandbox or, where there is no isolation at
/// all, by a session and process group of its own, death with its parent, and its limits.
///
/// Call it first thing in `main`, while there is one thread.
///
/// # Errors
/// When there is no confinement, or any part of it cannot be applied: then nothing hostile may be touched.
pub fn confine_self() -> io::Result<()> {
    #[cfg(target_os = "linux")]
    if std::env::var_os(CONFINEMENT_VARIABLE).is_none() {
        return sandbox::confine_self().map(drop).map_err(io::Error::other);
    }
    confine_plainly()
}

fn confine_plainly() -> io::Result<()> {
    let text = std::env::var(CONFINEMENT_VARIABLE)
        .map_err(|_| io::Error::other("this command is for Umbra's own use"))?;
    let confinement: Confinement = serde_json::from_str(&text)?;
    let parent = std::env::var(PARENT_VARIABLE).ok().and_then(|id| id.parse::<i32>().ok());
    // SAFETY: the caller promises that this process has no other thread yet.
    unsafe {
        std::env::remove_var(CONFINEMENT_VARIABLE);
        std::env::remove_var(PARENT_VARIABLE);
    }
    detach(parent)?;
    limit(&confinement.limits)
}

/// Confines this process, then turns it into `program`: the hidden command `__exec`.
pub fn exec_main(program: &OsStr, args: &[OsString]) -> ExitCode {
    let failure = match confine_plainly() {
        Ok(()) => exec(Command::new(program).args(args)),
        Err(error) => error,
    };
    eprintln!("umbra: cannot execute {}: {failure}", program.display());
    ExitCode::from(EXIT_NOT_CONFINED)
}

#[cfg(unix)]
fn exec(command: &mut Command) -> io::Error {
    std::os::unix::process::CommandExt::exec(command)
}

#[cfg(not(unix))]
fn exec(command: &mut Command) -> io::Error {
    match command.status() {
        Ok(status) => std::process::exit(status.code().unwrap_or(1)),
        Err(error) => error,
    }
}

#[cfg(unix)]
fn detach(parent: Option<i32>) -> io::Result<()> {
    nix::unistd::setsid()?;
    #[cfg(target_os = "linux")]
    nix::sys::prctl::set_pdeathsig(nix::sys::signal::Signal::SIGKILL)?;
    // The parent may have died before the line above: then nobody would end this process.
    if parent != Some(nix::unistd::getppid().as_raw()) {
        return Err(io::Error::other("the parent is gone"));
    }
    Ok(())
}

#[cfg(not(unix))]
fn detach(_parent: Option<i32>) -> io::Result<()> {
    Ok(())
}

#[cfg(unix)]
fn limit(limits: &ProcessLimits) -> io::Result<()> {
    use nix::sys::resource::{Resource, setrlimit};
    setrlimit(Resource::RLIMIT_CORE, 0, 0)?;
    setrlimit(Resource::RLIMIT_NOFILE, limits.open_files, limits.open_files)?;
    setrlimit(Resource::RLIMIT_FSIZE, limits.file_size_mib << 20, limits.file_size_mib << 20)?;
    // SIGXCPU at the first, SIGKILL at the second.
    setrlimit(Resource::RLIMIT_CPU, limits.cpu_s, limits.cpu_s + 1)?;
    setrlimit(Resource::RLIMIT_AS, limits.memory_mib << 20, limits.memory_mib << 20)?;
    Ok(())
}

#[cfg(not(unix))]
fn limit(_limits: &ProcessLimits) -> io::Result<()> {
    Ok(())
}

/// Ends this process at once, without running exit handlers or destructors: in a worker they may
/// be a plugin's.
pub fn exit_now(code: i32) -> ! {
    #[cfg(unix)]
    // SAFETY: `_exit` ends the process and touches nothing of it.
    unsafe {
        nix::libc::_exit(code)
    }
    #[cfg(not(unix))]
    std::process::exit(code)
}
