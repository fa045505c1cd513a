//! Isolation of whatever touches hostile bytes: the compiler, the worker, the decoders.
//!
//! Every such child is Umbra itself, or `umbra-worker`, started by [`command`] with its orders on standard input.
//! Before it has any thread and before it touches a hostile byte it confines itself ([`confine_self`]): namespaces with
//! a new root that holds the policy's binds at fixed paths, no privileges, Landlock, a system call filter, limits. A
//! worker then goes on in the same process; a compiler is executed ([`launch_main`]). A requested layer that is not
//! available is an error; it is never skipped silently.
//!
//! Three processes result. The *launcher*, which the caller sees, stays outside and mirrors how the
//! inner process ended. *Init* is process 1 of the inner process namespace: when it dies, so does
//! everything inside, daemons included. It dies with the launcher, and the launcher with the thread that
//! started it. The third is the *payload*, the only one that ever runs foreign code.

mod gpu;
pub mod policy;

#[cfg(target_os = "linux")]
mod cgroup;
#[cfg(target_os = "linux")]
mod confine;
#[cfg(target_os = "linux")]
pub mod doctor;
#[cfg(target_os = "linux")]
mod filter;
#[cfg(target_os = "linux")]
mod landlock;
#[cfg(target_os = "linux")]
mod launch;
#[cfg(target_os = "linux")]
mod privileges;
#[cfg(target_os = "linux")]
mod process_tree;
#[cfg(target_os = "linux")]
mod root;

pub use gpu::Gpu;
#[cfg(target_os = "linux")]
pub use launch::{command, confine_self, kill_inside, launch_main, orders, payload_pid};
pub use policy::{
    Bind, ChildKind, InForce, Isolation, KernelLimits, Layers, Policy, SandboxError, Scratch,
    read_report,
};

/// The layers that this machine gives and that work with each other, tried for real with `umbra`,
/// the binary that knows the hidden commands. Takes some ten milliseconds where isolation is full.
pub fn available(umbra: &std::path::Path) -> Layers {
    #[cfg(target_os = "linux")]
    return doctor::available(umbra);
    #[cfg(not(target_os = "linux"))]
    {
        let _ = umbra;
        Layers::NONE
    }
}

/// The exit code of a child that could not confine itself. It is EX_OSERR of sysexits.
/// Foreign code can exit with it too: [`read_report`] tells which it was.
pub const EXIT_NOT_CONFINED: u8 = 71;

/// The hidden command of the binary that ends in [`launch_main`].
pub const LAUNCH_COMMAND: &str = "__launch";
