//! The steps by which the payload confines itself, in an order in which each is still allowed.

use std::path::PathBuf;

use nix::errno::Errno;
use nix::sys::prctl;
use nix::sys::resource::{Resource, setrlimit};
use nix::sys::signal::Signal;
use nix::sys::stat::{Mode, umask};
use nix::unistd::{AccessFlags, access, chdir, setsid};

use super::privileges::{self, Identity};
use super::{InForce, KernelLimits, Policy, SandboxError, filter, landlock};

/// Confines this process, a child of init. The last step but the report: the system call filter.
///
/// # Errors
/// When a layer that the policy wants cannot be had.
pub fn confine(policy: &Policy, identity: &Identity) -> Result<InForce, SandboxError> {
    let error = |step: &str, cause: Errno| SandboxError::new("launcher", step, cause);
    // Without a process namespace nothing else ends it with init.
    prctl::set_pdeathsig(Signal::SIGKILL).map_err(|cause| error("follow process 1", cause))?;
    setsid().map_err(|cause| error("begin a session", cause))?;
    umask(Mode::from_bits_truncate(0o077));
    readable(policy)?;
    let scratch = policy.scratch_path();
    if policy.has_scratch() {
        chdir(&scratch).map_err(|cause| error("enter the scratch", cause))?;
    }
    if policy.layers.rlimits {
        limit(&policy.limits)?;
    }
    let landlock_abi = if policy.layers.landlock { landlock::restrict(policy)? } else { 0 };
    if policy.layers.drop_privileges && !privileges::powerless()? {
        let cause = "some are still there";
        return Err(SandboxError::new("drop_privileges", "drop all capabilities", cause));
    }
    if policy.layers.seccomp {
        filter::install(policy)?;
    }
    Ok(InForce {
        isolation: policy.layers.isolation(),
        layers: policy.layers,
        started_as_root: identity.root,
        host_uid: identity.host_uid,
        landlock_abi,
    })
}

/// Finds now what would later look like the submission's fault.
fn readable(policy: &Policy) -> Result<(), SandboxError> {
    let given = policy.read_only.iter().map(|bind| (bind, AccessFlags::R_OK));
    let writable = policy.read_write.iter();
    let writable = writable.map(|bind| (bind, AccessFlags::R_OK | AccessFlags::W_OK));
    for (bind, wanted) in given.chain(writable) {
        let path: PathBuf = policy.seen(&bind.host);
        access(&path, wanted).map_err(|cause| {
            let step = format!("use {} as {}", bind.host.display(), path.display());
            SandboxError::new("launcher", step, cause)
                .hint("as root, what a child uses must be readable by everyone")
        })?;
    }
    Ok(())
}

fn limit(limits: &KernelLimits) -> Result<(), SandboxError> {
    let all = [
        ("core", Resource::RLIMIT_CORE, 0, 0),
        ("cpu", Resource::RLIMIT_CPU, limits.cpu_s, limits.cpu_s + 1),
        ("as", Resource::RLIMIT_AS, limits.memory_mib << 20, limits.memory_mib << 20),
        ("fsize", Resource::RLIMIT_FSIZE, limits.file_size_mib << 20, limits.file_size_mib << 20),
        ("nofile", Resource::RLIMIT_NOFILE, limits.open_files, limits.open_files),
        ("nproc", Resource::RLIMIT_NPROC, limits.tasks, limits.tasks),
        ("memlock", Resource::RLIMIT_MEMLOCK, 0, 0),
        ("msgqueue", Resource::RLIMIT_MSGQUEUE, 0, 0),
    ];
    for (name, resource, soft, hard) in all {
        setrlimit(resource, soft, hard).map_err(|cause| {
            SandboxError::new("rlimits", format!("set {name} to {soft}"), cause)
                .hint("a limit of the session may be lower already")
        })?;
    }
    Ok(())
}
