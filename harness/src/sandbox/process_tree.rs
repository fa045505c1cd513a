//! The three processes: launcher, init, payload.

use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use nix::errno::Errno;
use nix::fcntl::{OFlag, OpenHow, ResolveFlag, open, openat2};
use nix::libc;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::prctl;
use nix::sys::resource::{Resource, setrlimit};
use nix::sys::signal::{SigHandler, Signal, kill, signal};
use nix::sys::stat::Mode;
use nix::sys::wait::{WaitStatus, waitpid};
use nix::unistd::{ForkResult, Pid, fork, getppid, pipe2};

use super::cgroup::Group;
use super::policy::SCRATCH;
use super::privileges::{self, Identity};
use super::{Bind, EXIT_NOT_CONFINED, InForce, Policy, SandboxError, confine, root};

/// Ends this process with the thread that started it.
///
/// # Errors
/// When the caller is gone already.
pub fn follow(parent: u32) -> Result<(), SandboxError> {
    let error = |cause: String| SandboxError::new("launcher", "follow its parent", cause);
    prctl::set_pdeathsig(Signal::SIGKILL).map_err(|cause| error(cause.to_string()))?;
    if getppid().as_raw() as u32 == parent {
        Ok(())
    } else {
        Err(error(format!("process {parent} is not the parent (any more)")))
    }
}

/// The payload, ready to run foreign code, and its pipe to the launcher.
pub struct Ready {
    in_force: InForce,
    report: ReportFile,
}

impl Ready {
    /// Closes the pipe to the launcher: from here on foreign code may run.
    pub fn go(self) -> InForce {
        drop(self.report);
        self.in_force
    }

    /// Reports failure to the launcher.
    pub fn failed(mut self, error: SandboxError) -> SandboxError {
        self.report.send(&Err(error.clone()));
        error
    }
}

/// The pipe through which init and the payload tell the launcher how far they got.
struct ReportFile(File);

impl ReportFile {
    fn send(&mut self, report: &Result<InForce, SandboxError>) {
        if let Ok(mut line) = serde_json::to_vec(report) {
            line.push(b'\n');
            // The launcher may be gone; then this process is about to be.
            let _ = self.0.write_all(&line);
        }
    }
}

/// Confines this process by `policy`: returns in the payload. An error is returned in the
/// launcher; of the other two, the one that failed has ended.
///
/// # Errors
/// When a layer that the policy wants cannot be had, or a process of the sandbox cannot be made.
pub fn confine(policy: &Policy) -> Result<Ready, SandboxError> {
    let error = |step: &str, cause: Errno| SandboxError::new("launcher", step, cause);
    single_threaded()?;
    close_from_3().map_err(|cause| error("close inherited files", cause))?;
    nix::sys::stat::umask(Mode::from_bits_truncate(0o022));
    // Not dumpable: nobody else of this user may look into these processes or trace them.
    prctl::set_dumpable(false).map_err(|cause| error("hide its memory", cause))?;
    let report_file = policy.report.as_deref().map(begin_report).transpose();
    let report_file = report_file
        .map_err(|cause| SandboxError::new("launcher", "write the sandbox's report", cause))?;
    match begin(policy) {
        Ok(Side::Locked(ready)) => Ok(ready),
        Ok(Side::Launcher(launcher)) => launcher.attend(report_file),
        Err(error) => {
            write_report(report_file, &Err(error.clone()));
            Err(error)
        }
    }
}

/// The process that [`begin`] returns in.
enum Side {
    Launcher(Launcher),
    Locked(Ready),
}

fn begin(policy: &Policy) -> Result<Side, SandboxError> {
    let error = |step: &str, cause: Errno| SandboxError::new("launcher", step, cause);
    let pipe = || pipe2(OFlag::O_CLOEXEC).map_err(|cause| error("make a pipe", cause));
    let identity = Identity::of(policy);
    let group = if policy.layers.cgroup { Some(Group::make(&policy.limits)?) } else { None };
    privileges::enter_namespaces(policy, &identity)?;
    let (report_out, report_in) = pipe()?;
    let (status_out, status_in) = pipe()?;
    // Held by the launcher alone: init waits for a byte from it, and hangs up with it.
    let (life_out, life_in) = pipe()?;
    // SAFETY: this process has one thread (checked in `confine`).
    match unsafe { fork() }.map_err(|cause| error("make process 1", cause))? {
        ForkResult::Parent { child } => {
            let mut life = File::from(life_in);
            let joined = group.as_ref().map_or(Ok(()), |group| group.add(child));
            // When init could not join its group it is told nothing and ends by itself.
            if joined.is_ok() {
                let _ = life.write_all(b"!");
            }
            let (report, status) = (File::from(report_out), File::from(status_out));
            let launcher = Launcher { init: child, report, status, _life: life, group };
            joined.map(|()| Side::Launcher(launcher))
        }
        ForkResult::Child => {
            drop((report_out, status_out, life_in));
            // Its removal is the launcher's.
            std::mem::forget(group);
            let mut report = ReportFile(File::from(report_in));
            match init(policy, &identity, File::from(life_out)) {
                Ok(Some((payload, copies))) => {
                    drop(report);
                    watch(payload, copies, policy, File::from(status_in))
                }
                Ok(None) => {
                    drop(status_in);
                    match confine::confine(policy, &identity) {
                        Ok(in_force) => {
                            report.send(&Ok(in_force.clone()));
                            Ok(Side::Locked(Ready { in_force, report }))
                        }
                        Err(error) => give_up(&mut report, error),
                    }
                }
                Err(error) => give_up(&mut report, error),
            }
        }
    }
}

fn give_up(report: &mut ReportFile, error: SandboxError) -> ! {
    report.send(&Err(error));
    exit(EXIT_NOT_CONFINED.into())
}

/// What to copy when all is over.
struct Copies {
    /// The scratch, as it was before anybody could change it.
    scratch: OwnedFd,
    /// Paths beneath it, and the host's files.
    files: Vec<(PathBuf, OwnedFd)>,
}

impl Copies {
    fn prepare(policy: &Policy) -> Result<Vec<(PathBuf, OwnedFd)>, SandboxError> {
        let prepare = |bind: &Bind| {
            let error = |cause: &dyn ToString| {
                let step = format!("collect {}", bind.inside.display());
                SandboxError::new("launcher", step, cause.to_string())
            };
            let beneath = bind.inside.strip_prefix(SCRATCH).map_err(|cause| error(&cause))?;
            let flags = OFlag::O_WRONLY | OFlag::O_TRUNC | OFlag::O_NOFOLLOW | OFlag::O_CLOEXEC;
            let host = open(&bind.host, flags, Mode::empty()).map_err(|cause| error(&cause))?;
            Ok((beneath.to_owned(), host))
        };
        policy.collect.iter().map(prepare).collect()
    }

    /// A missing or oversized file leaves the host's empty, and so does a full disk: the caller sees that.
    fn make(self, limit: u64) {
        for (beneath, host) in self.files {
            let mut host = File::from(host);
            if copy(&self.scratch, &beneath, &mut host, limit).is_err() {
                let _ = host.set_len(0);
            }
        }
    }
}

/// Whatever was put there, nothing but a regular file of the scratch is read: no link is followed,
/// not even on the way, and no pipe is waited for.
fn copy(scratch: &OwnedFd, beneath: &Path, host: &mut File, limit: u64) -> io::Result<()> {
    let resolve = ResolveFlag::RESOLVE_BENEATH
        | ResolveFlag::RESOLVE_NO_SYMLINKS
        | ResolveFlag::RESOLVE_NO_XDEV;
    let flags = OFlag::O_RDONLY | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC;
    let how = OpenHow::new().flags(flags).resolve(resolve);
    let file = File::from(openat2(scratch, beneath, how)?);
    let meta = file.metadata()?;
    if meta.is_file() && meta.len() <= limit {
        io::copy(&mut file.take(limit), host)?;
    }
    Ok(())
}

/// Becomes process 1 and makes the payload: that one gets nothing back.
fn init(
    policy: &Policy,
    identity: &Identity,
    mut life: File,
) -> Result<Option<(Pid, Copies)>, SandboxError> {
    let error =
        |step: &str, cause: &dyn ToString| SandboxError::new("launcher", step, cause.to_string());
    life.read_exact(&mut [0]).map_err(|cause| error("hear from the launcher", &cause))?;
    let files = Copies::prepare(policy)?;
    let own_proc = privileges::own_proc()?;
    if policy.layers.mount_ns {
        root::enter(policy, identity)?;
    }
    let flags = OFlag::O_PATH | OFlag::O_DIRECTORY | OFlag::O_CLOEXEC;
    let scratch = if policy.has_scratch() { policy.scratch_path() } else { "/".into() };
    let scratch =
        open(&scratch, flags, Mode::empty()).map_err(|cause| error("open the scratch", &cause))?;
    let copies = Copies { scratch, files };
    privileges::drop_all(policy, identity, own_proc)?;
    // After the change of user, which clears both.
    prctl::set_pdeathsig(Signal::SIGKILL).map_err(|cause| error("follow the launcher", &cause))?;
    prctl::set_dumpable(false).map_err(|cause| error("hide its memory", &cause))?;
    let mut hung_up = [PollFd::new(std::os::fd::AsFd::as_fd(&life), PollFlags::POLLIN)];
    match poll(&mut hung_up, PollTimeout::ZERO) {
        Ok(0) => {}
        _ => return Err(error("follow the launcher", &"it is gone")),
    }
    // SAFETY: this process has one thread: it is a fork of one that had one.
    match unsafe { fork() }.map_err(|cause| error("make the payload", &cause))? {
        ForkResult::Parent { child } => Ok(Some((child, copies))),
        ForkResult::Child => Ok(None),
    }
}

/// Process 1: reaps children until the payload ends, kills all others, collects files, reports the exit code,
/// exits.
fn watch(payload: Pid, copies: Copies, policy: &Policy, mut status: File) -> ! {
    let code = loop {
        match waitpid(None, None) {
            Ok(WaitStatus::Exited(pid, code)) if pid == payload => break code & 0xff,
            Ok(WaitStatus::Signaled(pid, signal, _)) if pid == payload => {
                break 256 + signal as i32;
            }
            Ok(_) | Err(Errno::EINTR) => {}
            Err(_) => exit(EXIT_NOT_CONFINED.into()),
        }
    };
    if policy.layers.pid_ns {
        // Whatever still runs could change what is collected.
        let _ = kill(Pid::from_raw(-1), Signal::SIGKILL);
        while !matches!(waitpid(None, None), Err(Errno::ECHILD)) {}
    }
    if code == 0 {
        copies.make(policy.limits.file_size_mib << 20);
    }
    let _ = status.write_all(&code.to_le_bytes());
    exit(0)
}

/// The process that the caller sees.
struct Launcher {
    init: Pid,
    report: File,
    status: File,
    _life: File,
    group: Option<Group>,
}

impl Launcher {
    /// Waits for the payload and ends in the same way. Returns only if the child was not confined.
    fn attend(mut self, report_file: Option<File>) -> Result<Ready, SandboxError> {
        // Ends when the payload closes its end, or is gone.
        let mut text = String::new();
        let _ = self.report.read_to_string(&mut text);
        let report = text.lines().next_back().map_or_else(
            || Err(SandboxError::new("launcher", "confine its child", "it ended early")),
            |line| {
                serde_json::from_str::<Result<InForce, SandboxError>>(line)
                    .unwrap_or_else(|e| Err(SandboxError::new("launcher", "read its child", e)))
            },
        );
        write_report(report_file, &report);
        while let Err(Errno::EINTR) = waitpid(self.init, None) {}
        drop(self.group.take());
        report?;
        let mut code = [0; 4];
        let code = match self.status.read_exact(&mut code) {
            Ok(()) => i32::from_le_bytes(code),
            // Init always reports a code unless it was killed from outside.
            Err(_) => 256 + libc::SIGKILL,
        };
        mirror(code)
    }
}

/// Ends this process with an exit code, or (from 256 on) by a signal.
fn mirror(code: i32) -> ! {
    if let Ok(by) = Signal::try_from(code - 256) {
        // The core would be the launcher's own.
        let _ = setrlimit(Resource::RLIMIT_CORE, 0, 0);
        // SAFETY: no handler of ours is replaced by one of ours; the process ends here.
        let _ = unsafe { signal(by, SigHandler::SigDfl) };
        let _ = kill(Pid::this(), by);
        // A blocked signal would let it live.
        exit(128 + code - 256)
    }
    exit(code)
}

/// Room for a report: foreign code that fills the disk first must not hinder it. JSON may end in spaces.
const REPORT_BYTES: usize = 4096;

fn begin_report(path: &Path) -> io::Result<File> {
    let mut file = File::create(path)?;
    file.write_all(&[b' '; REPORT_BYTES])?;
    Ok(file)
}

fn write_report(file: Option<File>, report: &Result<InForce, SandboxError>) {
    if let (Some(file), Ok(text)) = (file, serde_json::to_vec(report)) {
        // A report that cannot be written is an empty one, which is an error to its reader.
        let _ = file.write_all_at(&text, 0);
    }
}

fn exit(code: i32) -> ! {
    // SAFETY: ends the process and touches nothing of it; buffers of a fork are its parent's.
    unsafe { libc::_exit(code) }
}

fn single_threaded() -> Result<(), SandboxError> {
    let error = |cause: &str| SandboxError::new("launcher", "confine itself", cause);
    let tasks = std::fs::read_dir("/proc/self/task").map_err(|e| error(&e.to_string()))?.count();
    if tasks == 1 { Ok(()) } else { Err(error(&format!("it has {tasks} threads, expected 1"))) }
}

fn close_from_3() -> Result<(), Errno> {
    // SAFETY: descriptors from 3 on belong to no object of this process: it has just begun.
    Errno::result(unsafe { libc::syscall(libc::SYS_close_range, 3u32, u32::MAX, 0u32) }).map(drop)
}
