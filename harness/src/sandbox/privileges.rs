//! Namespaces, users, capabilities.

use std::fs::File;
use std::io::Write;
use std::os::fd::{AsRawFd, OwnedFd};

use nix::errno::Errno;
use nix::fcntl::{OFlag, open, openat};
use nix::libc;
use nix::sched::{CloneFlags, unshare};
use nix::sys::prctl;
use nix::sys::stat::Mode;
use nix::unistd::{Gid, Uid, getegid, geteuid, setgroups, setresgid, setresuid};

use super::{Policy, SandboxError};

/// "nobody": the user inside, and outside too when Umbra is root.
pub const NOBODY: u32 = 65534;

/// The user that starts the sandbox, and the user that runs foreign code.
pub struct Identity {
    /// Whether Umbra is root.
    pub root: bool,
    /// The host's user id of the payload.
    pub host_uid: u32,
    host_gid: u32,
    /// Its user id as it sees it itself.
    pub inside_uid: u32,
}

impl Identity {
    /// The identity for this process's user and the policy.
    pub fn of(policy: &Policy) -> Self {
        let (uid, gid) = (geteuid().as_raw(), getegid().as_raw());
        let root = uid == 0;
        let drops = root && policy.layers.drop_privileges;
        let (host_uid, host_gid) = if drops { (NOBODY, NOBODY) } else { (uid, gid) };
        let inside_uid = if root {
            host_uid
        } else if policy.layers.user_ns {
            NOBODY
        } else {
            uid
        };
        Self { root, host_uid, host_gid, inside_uid }
    }
}

/// Leaves the host's namespaces, but for the mount namespace, which is init's to leave: a change
/// of root would take the launcher along. Without root it begins with a user namespace; the
/// process namespace holds for the next child.
///
/// # Errors
/// When the kernel refuses a namespace or the map of its ids.
pub fn enter_namespaces(policy: &Policy, identity: &Identity) -> Result<(), SandboxError> {
    let layers = &policy.layers;
    let wanted = [
        ("user_ns", layers.user_ns && !identity.root, CloneFlags::CLONE_NEWUSER),
        ("pid_ns", layers.pid_ns, CloneFlags::CLONE_NEWPID),
        (
            "net_ns",
            layers.net_ns,
            CloneFlags::CLONE_NEWNET | CloneFlags::CLONE_NEWIPC | CloneFlags::CLONE_NEWUTS,
        ),
    ];
    for (layer, _, flags) in wanted.into_iter().filter(|(_, on, _)| *on) {
        enter(layer, flags, policy, identity)?;
        if layer == "user_ns" {
            let (uid, gid) = (identity.host_uid, identity.host_gid);
            dumpable(true)?;
            map_ids(own_proc()?, (NOBODY, uid), (NOBODY, gid))?;
            dumpable(false)?;
        }
    }
    Ok(())
}

/// Enters new namespaces of one layer.
///
/// # Errors
/// When the kernel refuses; with a hint.
pub fn enter(
    layer: &str,
    flags: CloneFlags,
    policy: &Policy,
    identity: &Identity,
) -> Result<(), SandboxError> {
    unshare(flags).map_err(|cause| {
        let error = SandboxError::new(layer, "enter a new namespace", cause);
        match (layer, identity.root, policy.layers.user_ns) {
            ("user_ns", ..) => error.hint("allow user namespaces, see `umbra doctor`"),
            (_, false, false) => error.hint("without root it needs the layer user_ns"),
            _ => error.hint("containers often forbid it, see `umbra doctor`"),
        }
    })
}

/// The files of this process in `/proc`, to be reached when `/proc` no longer is.
///
/// # Errors
/// When `/proc` is not there.
pub fn own_proc() -> Result<OwnedFd, SandboxError> {
    open("/proc/self", OFlag::O_PATH | OFlag::O_DIRECTORY | OFlag::O_CLOEXEC, Mode::empty())
        .map_err(|cause| SandboxError::new("launcher", "open /proc/self", cause))
}

/// One user and one group (inside, outside) and no others.
fn map_ids(proc: OwnedFd, uid: (u32, u32), gid: (u32, u32)) -> Result<(), SandboxError> {
    let maps = [
        ("setgroups", "deny".to_owned()),
        ("uid_map", format!("{} {} 1", uid.0, uid.1)),
        ("gid_map", format!("{} {} 1", gid.0, gid.1)),
    ];
    for (name, text) in maps {
        let error = |cause: &dyn ToString| {
            SandboxError::new("user_ns", format!("write {name}"), cause.to_string())
        };
        let file = openat(&proc, name, OFlag::O_WRONLY | OFlag::O_CLOEXEC, Mode::empty())
            .map_err(|cause| error(&cause))?;
        File::from(file).write_all(text.as_bytes()).map_err(|cause| error(&cause))?;
    }
    Ok(())
}

/// A process that is not dumpable may not even write its own id maps.
fn dumpable(yes: bool) -> Result<(), SandboxError> {
    prctl::set_dumpable(yes)
        .map_err(|cause| SandboxError::new("user_ns", "change whether it is dumpable", cause))
}

/// Drops root and all capabilities for good. As root with the user namespace layer, the new user then enters a
/// namespace of its own: its processes are counted apart.
///
/// # Errors
/// When the kernel refuses a step.
pub fn drop_all(
    policy: &Policy,
    identity: &Identity,
    own_proc: OwnedFd,
) -> Result<(), SandboxError> {
    let error =
        |step: &str, cause: Errno| SandboxError::new("drop_privileges", step.to_owned(), cause);
    if policy.layers.drop_privileges {
        drop_bounding_set().map_err(|cause| error("drop the bounding set", cause))?;
        if identity.root {
            let (uid, gid) = (Uid::from_raw(identity.host_uid), Gid::from_raw(identity.host_gid));
            setgroups(&[]).map_err(|cause| error("leave all groups", cause))?;
            setresgid(gid, gid, gid).map_err(|cause| error("change the group", cause))?;
            setresuid(uid, uid, uid).map_err(|cause| error("change the user", cause))?;
        }
    }
    if identity.root && policy.layers.user_ns {
        enter("user_ns", CloneFlags::CLONE_NEWUSER, policy, identity)?;
        dumpable(true)?;
        let (uid, gid) = (identity.host_uid, identity.host_gid);
        map_ids(own_proc, (uid, uid), (gid, gid))?;
        dumpable(false)?;
        if policy.layers.drop_privileges {
            drop_bounding_set().map_err(|cause| error("drop the bounding set", cause))?;
        }
    }
    if policy.layers.drop_privileges {
        drop_capabilities().map_err(|cause| error("drop capabilities", cause))?;
    }
    prctl::set_no_new_privs().map_err(|cause| error("give up new privileges", cause))
}

/// Ends the ways by which executing a file could give capabilities.
fn drop_bounding_set() -> Result<(), Errno> {
    for capability in 0.. {
        // SAFETY: plain integers.
        let held = unsafe { libc::prctl(libc::PR_CAPBSET_READ, capability, 0, 0, 0) };
        match Errno::result(held) {
            // Beyond the last capability of this kernel.
            Err(Errno::EINVAL) => break,
            Err(cause) => return Err(cause),
            Ok(0) => {}
            Ok(_) => {
                // SAFETY: plain integers.
                let dropped = unsafe { libc::prctl(libc::PR_CAPBSET_DROP, capability, 0, 0, 0) };
                match Errno::result(dropped) {
                    // Not ours to drop: without root and outside a user namespace.
                    Ok(_) | Err(Errno::EPERM) => {}
                    Err(cause) => return Err(cause),
                }
            }
        }
    }
    // SAFETY: plain integers.
    let cleared =
        unsafe { libc::prctl(libc::PR_CAP_AMBIENT, libc::PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0) };
    Errno::result(cleared).map(drop)
}

/// The kernel's `__user_cap_header_struct`.
#[repr(C)]
struct Header {
    version: u32,
    pid: i32,
}

/// `_LINUX_CAPABILITY_VERSION_3`: two words of each set.
const VERSION_3: u32 = 0x2008_0522;

/// Empties the effective, permitted and inheritable sets.
fn drop_capabilities() -> Result<(), Errno> {
    let header = Header { version: VERSION_3, pid: 0 };
    let sets = [0u32; 6];
    // SAFETY: both pointers are valid for the call, with the layout of version 3.
    Errno::result(unsafe { libc::syscall(libc::SYS_capset, &raw const header, sets.as_ptr()) })
        .map(drop)
}

/// Whether this process holds no capability at all.
///
/// # Errors
/// When the kernel does not tell.
pub fn powerless() -> Result<bool, SandboxError> {
    let header = Header { version: VERSION_3, pid: 0 };
    let mut sets = [0u32; 6];
    // SAFETY: both pointers are valid for the call, with the layout of version 3.
    let read = unsafe { libc::syscall(libc::SYS_capget, &raw const header, sets.as_mut_ptr()) };
    Errno::result(read)
        .map_err(|cause| SandboxError::new("drop_privileges", "read capabilities", cause))?;
    Ok(sets == [0; 6])
}

/// The raw number of a descriptor as a path that needs no name.
pub fn through_proc(fd: &OwnedFd) -> String {
    format!("/proc/self/fd/{}", fd.as_raw_fd())
}
