//! How a worker is started.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::job::{AdapterKind, Request};
use super::policy::WorkerPolicy;
use super::wire::WorkerFolder;
use crate::process::ProcessLimits;

/// The name of the program that loads plugins; it lies beside `umbra`.
const PROGRAM: &str = "umbra-worker";
/// The name that it gets as its first argument.
const CALLED: &str = "worker";

/// The program that loads plugins, beside `umbra`.
pub fn program_beside(umbra: &Path) -> PathBuf {
    umbra.with_file_name(format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX))
}

/// A program, opened: executed through its descriptor, it is not told where it lies.
pub struct Program {
    path: PathBuf,
    /// Closed by being executed.
    _open: Option<std::fs::File>,
}

impl Program {
    /// The program at `path`.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(path: &Path) -> io::Result<Self> {
        #[cfg(target_os = "linux")]
        {
            use std::os::fd::AsRawFd;
            let missing = |error: io::Error| {
                let hint = "it belongs beside umbra: cargo build --release --workspace makes both";
                io::Error::new(error.kind(), format!("{}: {error}; hint: {hint}", path.display()))
            };
            let open = fs::File::open(path).map_err(missing)?;
            let path = PathBuf::from(format!("/proc/self/fd/{}", open.as_raw_fd()));
            Ok(Self { path, _open: Some(open) })
        }
        #[cfg(not(target_os = "linux"))]
        Ok(Self { path: path.to_owned(), _open: None })
    }

    /// The command that executes it; it must be held until that is done.
    fn command(&self) -> Command {
        let mut command = Command::new(&self.path);
        #[cfg(unix)]
        std::os::unix::process::CommandExt::arg0(&mut command, CALLED);
        command
    }
}

/// The command that starts a worker with the private folder `dir`, an empty environment but for what
/// drivers and thread pools are told. `driver` is the software adapter's.
pub fn command(
    program: &Program,
    dir: &Path,
    own: &WorkerPolicy,
    requests: &[&Request],
    limits: &ProcessLimits,
    driver: Option<&Path>,
) -> Command {
    let mut command = program.command();
    command.arg(&own.job).current_dir(WorkerFolder(dir).scratch()).env_clear();
    command.env("LANG", "C").env("HOME", "/nonexistent");
    // What is compiled stays in the scratch of this one worker: one renderer's shaders are no
    // other's business (`shaders`).
    command.env("MESA_SHADER_CACHE_DISABLE", "false").env("MESA_SHADER_CACHE_DIR", ".");
    // Mesa's layer that sorts devices looks for a display, and prints that there is none.
    command.env("NODEVICE_SELECT", "1");
    // A frame's textures lie where those of the last one lay, in pages that are there: half of the system's time. Older
    // versions of glibc refuse so much, and nothing changes.
    for name in ["MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"] {
        command.env(name, (1 << 30).to_string());
    }
    command.env("LP_NUM_THREADS", limits.threads.to_string());
    command.env("RAYON_NUM_THREADS", limits.threads.to_string());
    let kinds: Vec<AdapterKind> = requests.iter().filter_map(|request| request.adapter()).collect();
    if kinds.contains(&AdapterKind::Software) {
        let driver = driver.unwrap_or(Path::new("/nonexistent"));
        command.env("VK_ICD_FILENAMES", driver).env("VK_DRIVER_FILES", driver);
    } else if !kinds.is_empty() {
        command.env("__GL_SHADER_DISK_CACHE", "0"); // NVIDIA's name for it
    }
    if cfg!(windows) {
        // Without it, no library of the system can be found.
        command.envs(std::env::var_os("SystemRoot").map(|root| ("SystemRoot", root)));
    }
    command
}

/// Where Mesa's lavapipe describes itself to the Vulkan loader.
pub fn software_driver() -> Option<PathBuf> {
    let folders = ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"];
    folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).find_map(|entries| {
        let mut found = entries.flatten().map(|entry| entry.path()).filter(|path| {
            path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("lvp_icd"))
        });
        found.next()
    })
}
