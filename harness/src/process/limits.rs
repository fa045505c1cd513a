//! What a child may use and see.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// What a child may use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Wall-clock time in seconds; the parent enforces it.
    pub wall_s: f64,
    /// CPU time of all threads together, in whole seconds.
    pub cpu_s: u64,
    /// Address space in MiB. Drawing with Mesa's lavapipe needs 768.
    pub memory_mib: u64,
    /// Standard output and error together, in KiB; the parent enforces it.
    pub output_kib: u64,
    /// Size of any file that is written, in MiB.
    pub file_size_mib: u64,
    /// Open files at a time.
    pub open_files: u64,
    /// Threads that thread pools and the software adapter are told to use; a request, not a cage.
    pub threads: u32,
}

impl Default for Limits {
    /// Enough for one case of the assignment on a slow machine.
    fn default() -> Self {
        Self {
            wall_s: 60.0,
            cpu_s: 120,
            memory_mib: 4096,
            output_kib: 1024,
            file_size_mib: 64,
            open_files: 256,
            threads: 2,
        }
    }
}

/// What a child is started for; a sandbox permits different system calls to each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Purpose {
    /// Loads a plugin and calls it.
    Worker,
    /// Executes the compiler, which starts the linker.
    Compiler,
}

/// What a child may see. Not enforced until a sandbox does.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Policy {
    /// What the child is for.
    pub purpose: Purpose,
    /// Files and folders it reads, besides the system's libraries.
    pub readable: Vec<PathBuf>,
    /// Folders it writes.
    pub writable: Vec<PathBuf>,
}

/// What a child does to itself before anything else: [`crate::process::lock_self`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lock {
    /// What it may use.
    pub limits: Limits,
    /// What it may see.
    pub policy: Policy,
}
