//! What a child may see and use, and what was in force: plain data.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// The compiler's toolchain inside.
pub const TOOLCHAIN: &str = "/toolchain";
/// The base code's compiled closure inside.
pub const CLOSURE: &str = "/closure";
/// A submission's staged source inside.
pub const SRC: &str = "/src";
/// A scene's folder inside.
pub const SCENE: &str = "/scene";
/// A plugin inside.
pub const PLUGIN: &str = "/plugin";
/// The job's files inside: requests, answers.
pub const JOB: &str = "/job";
/// The one place inside that is writable, empty at the start, gone in the end.
pub const SCRATCH: &str = "/scratch";

/// What a child is for; each kind has its own system calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ChildKind {
    /// Loads a plugin and calls it: threads, but no new process and no program.
    Worker,
    /// Executes the compiler, which starts the linker.
    Build,
    /// Decodes hostile files: as a worker.
    Decode,
}

impl ChildKind {
    /// Whether new processes and programs are allowed.
    pub fn may_execute(self) -> bool {
        self == Self::Build
    }
}

/// A file or folder of the host and the path under which the child sees it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bind {
    /// Absolute path outside. The child must not learn it, but where names matter, stage under a
    /// neutral one all the same.
    #[serde(with = "crate::files::path_json")]
    pub host: PathBuf,
    /// Absolute path inside, without `.` and `..`.
    #[serde(with = "crate::files::path_json")]
    pub inside: PathBuf,
}

impl Bind {
    /// `host` seen as `inside`.
    pub fn new(host: impl Into<PathBuf>, inside: impl Into<PathBuf>) -> Self {
        Self { host: host.into(), inside: inside.into() }
    }

    /// A file or folder under its own path.
    pub fn same(path: impl Into<PathBuf>) -> Self {
        let path = path.into();
        Self { host: path.clone(), inside: path }
    }
}

/// The writable place of a child.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scratch {
    /// How much fits into it in all, in MiB. It is memory.
    pub quota_mib: u64,
    /// How many files and folders fit into it.
    pub files: u64,
    /// A folder of the host that takes its place when the mount layer is off; it has no quota.
    #[serde(with = "crate::files::path_json::optional")]
    pub without_mount: Option<PathBuf>,
}

/// What a child may use; the kernel enforces it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KernelLimits {
    /// CPU time of each process, in seconds: SIGXCPU, a second later SIGKILL.
    pub cpu_s: u64,
    /// Address space of each process and, with the cgroup layer, memory of all together, in MiB.
    /// Drawing with Mesa's lavapipe needs 768.
    pub memory_mib: u64,
    /// Size of any one file that is written, in MiB.
    pub file_size_mib: u64,
    /// Open files at a time, of each process.
    pub open_files: u64,
    /// Processes and threads together, Umbra's own process 1 included.
    pub tasks: u64,
}

/// Defines [`Layers`] from one list: bit flags would make each of their many uses longer.
macro_rules! layers {
    ($($(#[$doc:meta])+ $layer:ident,)+) => {
        /// One switch per layer.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub struct Layers {
            $($(#[$doc])+ pub $layer: bool,)+
        }

        impl Layers {
            /// Nothing.
            pub const NONE: Self = Self { $($layer: false),+ };

            /// Every layer that full isolation needs. The cgroup layer is an extra.
            pub const fn full() -> Self {
                Self { cgroup: false, ..Self { $($layer: true),+ } }
            }

            /// The layers by name, in the order in which they are described.
            pub fn named(&self) -> [(&'static str, bool); 9] {
                [$((stringify!($layer), self.$layer)),+]
            }

            /// The switch of a layer, by the name that [`Self::named`] gives it.
            pub fn switch(&mut self, name: &str) -> Option<&mut bool> {
                match name {
                    $(stringify!($layer) => Some(&mut self.$layer),)+
                    _ => None,
                }
            }
        }
    };
}

layers! {
    /// User namespace. Without root all other namespaces need it; as root it makes the count of
    /// processes the child's own.
    user_ns,
    /// Mount namespace with a root of its own that holds the binds and nothing else.
    mount_ns,
    /// Process namespace: sees and signals only its own, ends all at once.
    pid_ns,
    /// Network, IPC and host name namespaces: no interface, no shared memory of others.
    net_ns,
    /// Root becomes user 65534; capabilities are dropped.
    drop_privileges,
    /// Landlock: files, TCP, and (new kernels) signals, abstract and path-name sockets.
    landlock,
    /// System call filter.
    seccomp,
    /// Limits per process.
    rlimits,
    /// Limits for all processes together; optional.
    cgroup,
}

impl Layers {
    /// [`Self::full`] where there is a sandbox, nothing elsewhere.
    pub fn of_this_system() -> Self {
        if cfg!(target_os = "linux") { Self::full() } else { Self::NONE }
    }

    /// What these layers amount to.
    pub fn isolation(&self) -> Isolation {
        let wanted = Self::full().named();
        let missing: Vec<String> = (self.named().iter().zip(wanted))
            .filter(|((_, on), (_, needed))| *needed && !on)
            .map(|((name, _), _)| (*name).to_owned())
            .collect();
        match missing.len() {
            0 => Isolation::Full,
            n if n == wanted.iter().filter(|(_, needed)| *needed).count() => Isolation::None,
            _ => Isolation::Reduced { missing },
        }
    }
}

/// How well a child is isolated.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Isolation {
    /// Every layer of [`Layers::full`].
    Full,
    /// Some of them.
    Reduced {
        /// The names of the layers that are not there.
        missing: Vec<String>,
    },
    /// None of them.
    None,
}

impl std::fmt::Display for Isolation {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Full => f.write_str("full"),
            Self::Reduced { missing } => write!(f, "reduced: no {}", missing.join(", no ")),
            Self::None => f.write_str("none: processes with limits"),
        }
    }
}

/// What a child may see and use.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Policy {
    /// What it is for.
    pub kind: ChildKind,
    /// What it reads. The system's libraries are among them.
    pub read_only: Vec<Bind>,
    /// Existing files or folders that it changes. Nothing bounds a folder's total size: prefer
    /// single files of the right size, and [`Self::collect`].
    pub read_write: Vec<Bind>,
    /// Files beneath [`SCRATCH`] that are copied out when the child ended with code 0: regular
    /// files, not reached through links, at most [`KernelLimits::file_size_mib`] long. They are written
    /// over the existing host file, which is left empty when there is no such file.
    pub collect: Vec<Bind>,
    /// Its writable place.
    pub scratch: Scratch,
    /// What it may use.
    pub limits: KernelLimits,
    /// Device nodes and driver files, when it draws on a GPU.
    pub gpu: Option<super::Gpu>,
    /// Whether it has a `/proc` of its own process namespace. Landlock leaves `/proc/cpuinfo` and
    /// the links to be read (a program finds its own path by `/proc/self/exe`, as rustc's linker
    /// does) and no other file: `mountinfo` would name the binds' host paths.
    pub proc: bool,
    /// Which layers confine it.
    pub layers: Layers,
    /// A file that the launcher writes and the child cannot reach: see [`read_report`].
    #[serde(with = "crate::files::path_json::optional")]
    pub report: Option<PathBuf>,
}

impl Policy {
    /// A policy with full isolation that sees the system's libraries and nothing else.
    pub fn new(kind: ChildKind) -> Self {
        Self {
            kind,
            read_only: system(kind),
            read_write: Vec::new(),
            collect: Vec::new(),
            scratch: Scratch { quota_mib: 64, files: 4096, without_mount: None },
            limits: KernelLimits {
                cpu_s: 120,
                memory_mib: 4096,
                file_size_mib: 64,
                open_files: 256,
                tasks: 64,
            },
            gpu: None,
            proc: kind == ChildKind::Build,
            layers: Layers::full(),
            report: None,
        }
    }

    /// The path under which the child sees a host path: through the binds, or unchanged when the
    /// mount layer is off.
    pub fn seen(&self, host: &Path) -> PathBuf {
        if !self.layers.mount_ns {
            return host.to_owned();
        }
        let binds = self.read_only.iter().chain(&self.read_write);
        let through = |bind: &Bind| {
            let rest = host.strip_prefix(&bind.host).ok()?;
            let whole = rest.as_os_str().is_empty();
            Some(if whole { bind.inside.clone() } else { bind.inside.join(rest) })
        };
        binds.filter_map(through).next_back().unwrap_or_else(|| host.to_owned())
    }

    /// Whether there is a scratch at all.
    pub fn has_scratch(&self) -> bool {
        self.layers.mount_ns || self.scratch.without_mount.is_some()
    }

    /// The child's path of the scratch: [`SCRATCH`], or its stand-in when the mount layer is off.
    pub fn scratch_path(&self) -> PathBuf {
        match &self.scratch.without_mount {
            Some(host) if !self.layers.mount_ns => host.clone(),
            _ => PathBuf::from(SCRATCH),
        }
    }
}

/// The system's files that each kind needs, as far as this machine has them. A worker loads
/// libraries and drivers; a compiler's linker needs programs as well.
fn system(kind: ChildKind) -> Vec<Bind> {
    let libraries: &[&str] = &[
        "/lib",
        "/lib32",
        "/lib64",
        "/usr/lib",
        "/usr/lib32",
        "/usr/lib64",
        "/etc/ld.so.cache",
        "/sys/devices/system/cpu",
    ];
    let more: &[&str] = match kind {
        ChildKind::Worker => &["/usr/share/vulkan", "/usr/share/drirc.d", "/usr/share/glvnd"],
        ChildKind::Build => &["/bin", "/usr/bin", "/usr/libexec", "/etc/alternatives"],
        ChildKind::Decode => &[],
    };
    let there = |path: &&&str| Path::new(path).symlink_metadata().is_ok();
    libraries.iter().chain(more).filter(there).map(|&path| Bind::same(path)).collect()
}

/// What was in force when the first hostile byte was touched: data for the report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InForce {
    /// In one word.
    pub isolation: Isolation,
    /// The layers.
    pub layers: Layers,
    /// Whether Umbra was started as root.
    pub started_as_root: bool,
    /// The child's user id on the host.
    pub host_uid: u32,
    /// Landlock's version in force; 0 when it is off.
    pub landlock_abi: u32,
}

/// Why a child could not be confined: the machine's or Umbra's matter, never the submission's.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("sandbox, {layer}: cannot {step}: {cause}{}", hint_text(.hint))]
pub struct SandboxError {
    /// The layer that failed, by its name in [`Layers`], or the part of the launcher.
    pub layer: String,
    /// What was tried.
    pub step: String,
    /// What the system answered.
    pub cause: String,
    /// What to do about it, or empty.
    pub hint: String,
}

fn hint_text(hint: &str) -> String {
    if hint.is_empty() { String::new() } else { format!(" - hint: {hint}") }
}

impl SandboxError {
    /// `step` of `layer` failed because of `cause`.
    pub fn new(layer: &str, step: impl Into<String>, cause: impl ToString) -> Self {
        let (layer, step) = (layer.to_owned(), step.into());
        Self { layer, step, cause: cause.to_string(), hint: String::new() }
    }

    /// The same with advice.
    #[must_use]
    pub fn hint(mut self, hint: &str) -> Self {
        self.hint = hint.to_owned();
        self
    }
}

/// Reads what the launcher wrote to [`Policy::report`]: what was in force, or why nothing foreign
/// ran. It is written before foreign code runs, by a process that foreign code cannot reach.
///
/// # Errors
/// When the child was not confined, or ended before it was.
pub fn read_report(path: &Path) -> Result<InForce, SandboxError> {
    let error = |cause: String| SandboxError::new("launcher", "read the sandbox's report", cause);
    let text = std::fs::read_to_string(path).map_err(|cause| error(cause.to_string()))?;
    if text.trim().is_empty() {
        return Err(error("the child ended before it was confined".to_owned()));
    }
    serde_json::from_str::<Result<InForce, SandboxError>>(&text)
        .map_err(|cause| error(cause.to_string()))?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_reduced_and_none_are_told_apart() {
        assert_eq!(Layers::full().isolation(), Isolation::Full);
        assert_eq!(Layers::NONE.isolation(), Isolation::None);
        let layers = Layers { pid_ns: false, cgroup: true, ..Layers::full() };
        let missing = vec!["pid_ns".to_owned()];
        assert_eq!(layers.isolation(), Isolation::Reduced { missing });
        // The extra alone is no isolation.
        assert_eq!(Layers { cgroup: true, ..Layers::NONE }.isolation(), Isolation::None);
    }

    #[test]
    fn every_named_layer_has_its_own_switch() {
        for (index, (name, _)) in Layers::NONE.named().iter().enumerate() {
            let mut layers = Layers::NONE;
            *layers.switch(name).expect("a switch of this name") = true;
            let on: Vec<usize> = (0..9).filter(|&index| layers.named()[index].1).collect();
            assert_eq!(on, [index], "{name}");
        }
        assert!({ Layers::NONE }.switch("moat").is_none());
    }

    #[test]
    fn host_paths_are_seen_through_binds() {
        let mut policy = Policy::new(ChildKind::Build);
        policy.read_only.push(Bind::new("/root/.rustup/toolchains/x", TOOLCHAIN));
        policy.read_write.push(Bind::new("/tmp/job/table", "/job/table"));
        let seen = |path: &str| policy.seen(Path::new(path)).display().to_string();
        assert_eq!(seen("/root/.rustup/toolchains/x/bin/rustc"), "/toolchain/bin/rustc");
        assert_eq!(seen("/tmp/job/table"), "/job/table");
        assert_eq!(seen("/usr/bin/cc"), "/usr/bin/cc");
        policy.layers.mount_ns = false;
        assert_eq!(policy.seen(Path::new("/tmp/job/table")), Path::new("/tmp/job/table"));
    }

    #[test]
    fn a_report_is_told_from_silence() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("report");
        assert!(read_report(&path).is_err());
        std::fs::write(&path, "").expect("a file");
        let silence = read_report(&path).expect_err("nothing was reported").to_string();
        assert!(silence.ends_with("the child ended before it was confined"), "{silence}");
        let failed = SandboxError::new("net_ns", "enter it", "EPERM").hint("be root");
        let text = serde_json::to_string(&Err::<InForce, _>(&failed)).expect("plain data");
        std::fs::write(&path, text).expect("a file");
        assert_eq!(read_report(&path), Err(failed.clone()));
        assert_eq!(failed.to_string(), "sandbox, net_ns: cannot enter it: EPERM - hint: be root");
    }
}
