//! What a child may use and see.

use serde::{Deserialize, Serialize};

use crate::sandbox::{self, Isolation, Policy};

/// What a child may use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProcessLimits {
    /// Seconds that it may stand still, neither computing nor waiting for a processor or a disk: a busy machine does
    /// not count. Where the system does not tell (it does on Linux), seconds by the clock. The parent enforces it, and
    /// gives up on a child that got no processor for 20 times as long.
    pub wall_s: f64,
    /// CPU time of all threads together, in whole seconds.
    pub cpu_s: u64,
    /// Address space in MiB. Drawing with Mesa's lavapipe needs 768.
    pub memory_mib: u64,
    /// Standard output and error together, in KiB: what is more is cut, and remarked on.
    pub output_kib: u64,
    /// Size of any file that is written, in MiB.
    pub file_size_mib: u64,
    /// All files that are written together, in MiB. Without a mount namespace nothing bounds them.
    pub scratch_mib: u64,
    /// Processes and threads together: a compiler and a graphics driver have some of their own.
    /// Without a user namespace every process of the user counts, and the session's limit holds.
    pub tasks: u64,
    /// Open files at a time.
    pub open_files: u64,
    /// Threads that thread pools and the software adapter are told to use; a request, not a cage.
    pub threads: u32,
}

impl Default for ProcessLimits {
    /// Enough for one case of the assignment on a slow machine.
    fn default() -> Self {
        Self {
            wall_s: 60.0,
            cpu_s: 120,
            memory_mib: 4096,
            output_kib: 1024,
            file_size_mib: 64,
            scratch_mib: 64,
            tasks: 160,
            open_files: 256,
            threads: 2,
        }
    }
}

/// What a child does to itself before anything else.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Confinement {
    /// What it may use.
    pub limits: ProcessLimits,
    /// What it may see: the sandbox confines it. None where there is no isolation at all: then it gets
    /// a session and limits only, by [`crate::process::confine_self`].
    pub sandbox: Option<Policy>,
}

impl Confinement {
    /// A confinement that isolates by `policy`, or by limits alone when the policy has no layer.
    /// The policy's limits and quota are replaced by these.
    pub fn new(limits: &ProcessLimits, mut policy: Policy) -> Self {
        let none = policy.layers.isolation() == Isolation::None;
        policy.scratch.quota_mib = limits.scratch_mib;
        policy.limits = sandbox::KernelLimits {
            cpu_s: limits.cpu_s,
            memory_mib: limits.memory_mib,
            file_size_mib: limits.file_size_mib,
            open_files: limits.open_files,
            tasks: if policy.layers.user_ns { limits.tasks } else { tasks_of_session() },
        };
        Self { limits: limits.clone(), sandbox: (!none).then_some(policy) }
    }
}

/// How many processes and threads the user may have in all.
fn tasks_of_session() -> u64 {
    #[cfg(target_os = "linux")]
    if let Ok((_, hard)) = nix::sys::resource::getrlimit(nix::sys::resource::Resource::RLIMIT_NPROC)
    {
        return hard;
    }
    1 << 15
}
