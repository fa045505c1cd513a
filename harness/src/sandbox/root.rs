//! The child's own root: an empty tmpfs with the policy's binds at fixed paths.

use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

use nix::errno::Errno;
use nix::fcntl::{AT_FDCWD, OFlag, open};
use nix::libc;
use nix::mount::{MntFlags, MsFlags, mount, umount2};
use nix::sched::CloneFlags;
use nix::sys::stat::Mode;
use nix::unistd::{Gid, Uid, fchown, pivot_root};

use super::policy::SCRATCH;
use super::privileges::{self, Identity, through_proc};
use super::{Bind, Policy, SandboxError};

/// Where the new root is put together. Any folder that every system has; what it hides stays
/// reachable through descriptors that were opened before.
const BASE: &str = "/tmp";

/// Devices that programs take for granted.
const DEVICES: [&str; 3] = ["/dev/null", "/dev/zero", "/dev/urandom"];

fn failed(step: String) -> impl FnOnce(Errno) -> SandboxError {
    move |cause| SandboxError::new("mount_ns", step, cause)
}

/// One thing to be seen inside.
struct Source {
    bind: Bind,
    what: What,
    attributes: u64,
    writable: bool,
}

enum What {
    File(OwnedFd),
    Folder(OwnedFd),
    /// `/lib` is often a link to `usr/lib`: it stays one.
    Link(PathBuf),
}

/// Makes the new root and moves there. Host paths mean nothing afterwards.
///
/// # Errors
/// When a file of the policy is missing, or the kernel refuses a mount.
pub fn enter(policy: &Policy, identity: &Identity) -> Result<(), SandboxError> {
    privileges::enter("mount_ns", CloneFlags::CLONE_NEWNS, policy, identity)?;
    let none = None::<&str>;
    mount(none, "/", none, MsFlags::MS_REC | MsFlags::MS_PRIVATE, none)
        .map_err(failed("make mounts private".to_owned()))?;
    let sources = sources(policy)?;
    let flags = MsFlags::MS_NOSUID | MsFlags::MS_NODEV;
    mount(Some("umbra"), BASE, Some("tmpfs"), flags, Some("mode=755,size=1m,nr_inodes=2048"))
        .map_err(failed("mount the new root".to_owned()))?;
    for source in &sources {
        place(source, identity)?;
    }
    let at = inside(Path::new(SCRATCH))?;
    make_folder(&at)?;
    // To the kernel 0 means without limit; the scratch itself is a file, too.
    let (uid, size) = (identity.inside_uid, policy.scratch.quota_mib.max(1));
    let files = policy.scratch.files + 1;
    let options = format!("mode=700,uid={uid},gid={uid},size={size}m,nr_inodes={files}");
    mount(Some("scratch"), &at, Some("tmpfs"), flags | MsFlags::MS_NOEXEC, Some(&*options))
        .map_err(failed("mount the scratch".to_owned()))?;
    // Of the host's process namespace it would show everybody.
    if policy.proc && policy.layers.pid_ns {
        let at = inside(Path::new("/proc"))?;
        make_folder(&at)?;
        mount(Some("proc"), &at, Some("proc"), flags | MsFlags::MS_NOEXEC, none)
            .map_err(failed("mount /proc".to_owned()))?;
    }
    attribute(Path::new(BASE), libc::MOUNT_ATTR_RDONLY, 0)
        .map_err(failed("make the new root read-only".to_owned()))?;
    let change = || -> Result<(), Errno> {
        nix::unistd::chdir(BASE)?;
        pivot_root(".", ".")?;
        // The old root now lies over the new one.
        umount2(".", MntFlags::MNT_DETACH)?;
        nix::unistd::chdir("/")
    };
    change().map_err(failed("change the root".to_owned()))
}

fn sources(policy: &Policy) -> Result<Vec<Source>, SandboxError> {
    let hidden = libc::MOUNT_ATTR_NOSUID | libc::MOUNT_ATTR_NODEV;
    let read_only = hidden | libc::MOUNT_ATTR_RDONLY;
    let device = libc::MOUNT_ATTR_NOSUID | libc::MOUNT_ATTR_NOEXEC;
    let gpu = policy.gpu.clone().unwrap_or_default();
    let devices = DEVICES.iter().map(PathBuf::from).chain(gpu.nodes).map(Bind::same);
    let all = (policy.read_only.iter().cloned().map(|bind| (bind, read_only, false)))
        .chain(gpu.files.into_iter().map(|path| (Bind::same(path), read_only, false)))
        .chain(policy.read_write.iter().cloned().map(|bind| (bind, hidden, true)))
        .chain(devices.map(|bind| (bind, device, false)));
    let mut sources = Vec::new();
    for (bind, attributes, writable) in all {
        sources.push(Source { what: look(&bind)?, bind, attributes, writable });
    }
    // A folder comes before what lies in it.
    sources.sort_by_key(|source| source.bind.inside.components().count());
    Ok(sources)
}

fn look(bind: &Bind) -> Result<What, SandboxError> {
    let error = |cause: &dyn ToString| {
        SandboxError::new("mount_ns", format!("bind {}", bind.host.display()), cause.to_string())
    };
    let meta = bind.host.symlink_metadata().map_err(|cause| error(&cause))?;
    // Only a system's own link may stay one: any other path inside is to be the thing itself.
    if meta.is_symlink() && bind.host == bind.inside && !bind.host.starts_with("/dev") {
        return std::fs::read_link(&bind.host).map(What::Link).map_err(|cause| error(&cause));
    }
    let meta = bind.host.metadata().map_err(|cause| error(&cause))?;
    let fd = open(&bind.host, OFlag::O_PATH | OFlag::O_CLOEXEC, Mode::empty())
        .map_err(|cause| error(&cause))?;
    Ok(if meta.is_dir() { What::Folder(fd) } else { What::File(fd) })
}

fn place(source: &Source, identity: &Identity) -> Result<(), SandboxError> {
    let at = inside(&source.bind.inside)?;
    let step =
        || format!("bind {} to {}", source.bind.host.display(), source.bind.inside.display());
    let made = |cause: std::io::Error| SandboxError::new("mount_ns", step(), cause);
    if let Some(parent) = at.parent() {
        make_folder(parent)?;
    }
    let fd = match &source.what {
        What::Link(target) => {
            return std::os::unix::fs::symlink(target, &at).map_err(made);
        }
        What::Folder(fd) => {
            make_folder(&at)?;
            fd
        }
        What::File(fd) => {
            if !at.exists() {
                std::fs::File::create(&at).map_err(made)?;
            }
            fd
        }
    };
    let none = None::<&str>;
    let from = through_proc(fd);
    if source.writable && identity.root {
        // The caller gives it away: made by root, it is to be written by nobody.
        let (uid, gid) = (Uid::from_raw(identity.host_uid), Gid::from_raw(identity.host_uid));
        let owned = open(&*from, OFlag::O_RDONLY | OFlag::O_CLOEXEC, Mode::empty())
            .and_then(|file| fchown(file, Some(uid), Some(gid)));
        owned.map_err(failed(step()))?;
    }
    mount(Some(&*from), &at, none, MsFlags::MS_BIND | MsFlags::MS_REC, none)
        .map_err(failed(step()))?;
    attribute(&at, source.attributes, libc::AT_RECURSIVE as u32).map_err(failed(step()))
}

/// Adds attributes to a mount. Unlike a remount this never takes one away, which a user namespace
/// could not.
fn attribute(at: &Path, attributes: u64, flags: u32) -> Result<(), Errno> {
    use nix::NixPath;
    use std::os::fd::AsRawFd;
    let change =
        libc::mount_attr { attr_set: attributes, attr_clr: 0, propagation: 0, userns_fd: 0 };
    let size = size_of::<libc::mount_attr>();
    let base = AT_FDCWD.as_raw_fd();
    let done = at.with_nix_path(|path| {
        // SAFETY: path and attributes are valid for the call, and the size is the latter's.
        unsafe {
            libc::syscall(
                libc::SYS_mount_setattr,
                base,
                path.as_ptr(),
                flags,
                &raw const change,
                size,
            )
        }
    })?;
    Errno::result(done).map(drop)
}

/// A path inside, as it is while the root is put together.
fn inside(path: &Path) -> Result<PathBuf, SandboxError> {
    use std::path::Component;
    let plain = |part: &Component| matches!(part, Component::RootDir | Component::Normal(_));
    match path.strip_prefix("/") {
        Ok(rest) if path.components().all(|part| plain(&part)) && rest != Path::new("") => {
            Ok(Path::new(BASE).join(rest))
        }
        _ => {
            let step = format!("bind something to {}", path.display());
            Err(SandboxError::new("mount_ns", step, "expected an absolute path without `..`"))
        }
    }
}

fn make_folder(at: &Path) -> Result<(), SandboxError> {
    use std::os::unix::fs::DirBuilderExt;
    // The new root belongs to root: its folders are for nobody to read.
    std::fs::DirBuilder::new().recursive(true).mode(0o755).create(at).map_err(|cause| {
        SandboxError::new("mount_ns", format!("make the folder {}", at.display()), cause)
    })
}
