//! Limits for all processes of a child together, where the machine offers control groups. Both
//! versions: many machines still have the memory controller in the first.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use nix::unistd::Pid;

use super::{KernelLimits, SandboxError};

/// Where control groups are mounted on every system that has them.
const MOUNT: &str = "/sys/fs/cgroup";
/// Our groups' names begin with this; the rest is the launcher's process id.
const PREFIX: &str = "umbra-";

/// The groups of one child; removed when it is gone.
pub struct Group {
    folders: Vec<PathBuf>,
}

impl Group {
    /// Makes a group beside the caller's own, or at the top.
    ///
    /// # Errors
    /// When the kernel lets this process make no group with these limits.
    pub fn make(limits: &KernelLimits) -> Result<Self, SandboxError> {
        let error = |cause: io::Error| {
            SandboxError::new("cgroup", "make a control group", cause)
                .hint("needs root or a delegated group with the memory and pids controllers")
        };
        let memory = (limits.memory_mib << 20).to_string();
        let tasks = limits.tasks.to_string();
        let unified = [("memory.max", &*memory), ("memory.swap.max", "0"), ("pids.max", &*tasks)];
        let own = fs::read_to_string("/proc/self/cgroup").map_err(error)?;
        let mut group = Self { folders: Vec::new() };
        let mut why = io::Error::from(io::ErrorKind::Unsupported);
        for parent in unified_parents(&own) {
            match group.add_folder(&parent, &unified) {
                Ok(()) => return Ok(group),
                Err(cause) => why = cause,
            }
        }
        // Version 1: one hierarchy for each controller.
        if !Path::new(MOUNT).join("memory").exists() {
            return Err(error(why));
        }
        let files = [("memory", "memory.limit_in_bytes", &memory), ("pids", "pids.max", &tasks)];
        for (controller, file, value) in files {
            let parent = Path::new(MOUNT).join(controller);
            group.add_folder(&parent, &[(file, value)]).map_err(error)?;
        }
        Ok(group)
    }

    fn add_folder(&mut self, parent: &Path, values: &[(&str, &str)]) -> io::Result<()> {
        sweep(parent);
        let folder = parent.join(format!("{PREFIX}{}", std::process::id()));
        fs::create_dir(&folder)?;
        self.folders.push(folder.clone());
        for (file, value) in values {
            let written = write(&folder.join(file), value);
            // Machines without swap accounting lack that one file.
            if *file != "memory.swap.max"
                && let Err(cause) = written
            {
                let _ = fs::remove_dir(&folder);
                self.folders.pop();
                return Err(cause);
            }
        }
        Ok(())
    }

    /// Puts a process into the group; its children follow.
    ///
    /// # Errors
    /// When the kernel refuses.
    pub fn add(&self, pid: Pid) -> Result<(), SandboxError> {
        for folder in &self.folders {
            write(&folder.join("cgroup.procs"), &pid.to_string()).map_err(|cause| {
                SandboxError::new("cgroup", format!("enter {}", folder.display()), cause)
            })?;
        }
        Ok(())
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        for folder in &self.folders {
            // A reaped process may count for another moment; what remains is swept by a later
            // launcher.
            for _ in 0..50 {
                match fs::remove_dir(folder) {
                    Err(cause) if cause.kind() == io::ErrorKind::ResourceBusy => {
                        std::thread::sleep(std::time::Duration::from_millis(1));
                    }
                    _ => break,
                }
            }
        }
    }
}

/// Control files exist already: never create one.
fn write(file: &Path, text: &str) -> io::Result<()> {
    io::Write::write_all(&mut fs::OpenOptions::new().write(true).open(file)?, text.as_bytes())
}

/// Folders of the unified hierarchy in which a group with memory and pids can be made.
fn unified_parents(own: &str) -> Vec<PathBuf> {
    let path = own.lines().find_map(|line| line.strip_prefix("0::/")).unwrap_or("");
    let own = Path::new(MOUNT).join(path);
    let offers = |folder: &PathBuf| {
        fs::read_to_string(folder.join("cgroup.subtree_control")).is_ok_and(|list| {
            ["memory", "pids"].iter().all(|name| list.split_whitespace().any(|item| item == *name))
        })
    };
    let parents = own.ancestors().take_while(|folder| folder.starts_with(MOUNT));
    parents.map(Path::to_owned).filter(offers).collect()
}

/// Removes groups whose launcher was killed. One that is in use cannot be removed.
fn sweep(parent: &Path) {
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let owner = name.to_str().and_then(|name| name.strip_prefix(PREFIX));
        if owner.is_some_and(|pid| !Path::new("/proc").join(pid).exists()) {
            let _ = fs::remove_dir(entry.path());
        }
    }
}
