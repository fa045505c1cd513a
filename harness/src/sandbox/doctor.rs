//! Which layers this machine supports: each is tried for real, in a child.

use std::path::Path;
use std::process::Stdio;

use serde::{Deserialize, Serialize};

use super::{ChildKind, InForce, Isolation, Layers, Policy, SandboxError, command, read_report};

/// The hidden command that does nothing: what a probe executes.
pub const PROBE_COMMAND: &str = "__probe";

/// Where the probe's binary is seen.
const UMBRA: &str = "/umbra";

/// One layer on this machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LayerFinding {
    /// Its name in [`Layers`].
    pub layer: String,
    /// Whether a child was confined with it.
    pub available: bool,
    /// What it is and in which version, or why it failed.
    pub detail: String,
    /// What to do about it; empty when it is available.
    pub remedy: String,
}

/// What this machine can do, for the user who asks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Examination {
    /// Every layer, in the order of [`Layers::named`].
    pub findings: Vec<LayerFinding>,
    /// The layers that work, all together: tried as such.
    pub layers: Layers,
    /// What they amount to.
    pub isolation: Isolation,
}

impl Examination {
    /// The layers to ask for. The optional group is left out: it only adds where all else is. Without
    /// a root of its own, a child that is no longer root could not reach root's private files.
    pub fn usable(&self) -> Layers {
        let mut layers = Layers { cgroup: false, ..self.layers };
        if !layers.mount_ns && nix::unistd::geteuid().is_root() {
            layers.drop_privileges = false;
        }
        layers
    }
}

/// The layers to ask for: those of full isolation where they work together, as on most machines, otherwise what
/// [`examine`] finds usable. `umbra` is the binary that knows the hidden commands.
pub fn available(umbra: &Path) -> Layers {
    let full = Layers::full();
    if probe(umbra, &full).is_ok() { full } else { examine(umbra).usable() }
}

/// Tries every layer by itself, then all that worked together. Takes some hundred milliseconds.
pub fn examine(umbra: &Path) -> Examination {
    let mut layers = Layers::NONE;
    let mut findings = Vec::new();
    for (name, _) in Layers::NONE.named() {
        let result = probe(umbra, &alone(name));
        if let (Ok(_), Some(switch)) = (&result, layers.switch(name)) {
            *switch = true;
        }
        findings.push(finding(name, &result));
    }
    if let Err(error) = probe(umbra, &layers) {
        // Each works but not all together: nothing can be promised.
        findings.push(finding("all together", &Err(error)));
        layers = Layers::NONE;
    }
    Examination { findings, isolation: layers.isolation(), layers }
}

/// One layer with the least that it needs.
fn alone(name: &str) -> Layers {
    let mut layers = Layers::NONE;
    if let Some(switch) = layers.switch(name) {
        *switch = true;
    }
    let namespaces = layers.mount_ns || layers.pid_ns || layers.net_ns;
    layers.user_ns |= namespaces && !nix::unistd::geteuid().is_root();
    layers
}

/// Confines a child with these layers and executes [`PROBE_COMMAND`] in it.
fn probe(umbra: &Path, layers: &Layers) -> Result<InForce, SandboxError> {
    let error = |step: &str, cause: &dyn ToString| {
        SandboxError::new("launcher", step.to_owned(), cause.to_string())
    };
    let folder = tempfile::tempdir().map_err(|cause| error("make a temporary folder", &cause))?;
    let mut policy = Policy::new(ChildKind::Build);
    policy.layers = *layers;
    policy.read_only.push(super::Bind::new(umbra, UMBRA));
    policy.report = Some(folder.path().join("report"));
    if !layers.mount_ns && layers.drop_privileges {
        // Root's home may hide the binary from the user it becomes.
        policy.read_only.retain(|bind| bind.inside != Path::new(UMBRA));
    }
    let program = policy.seen(umbra);
    let mut command = command(umbra, &policy, &program, [PROBE_COMMAND])
        .map_err(|cause| error("write the orders", &cause))?;
    let status = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
    let status = status.map_err(|cause| error("start the launcher", &cause))?;
    let report = policy
        .report
        .as_deref()
        .map_or_else(|| Err(error("find the report", &"there is none")), read_report);
    match report {
        // Without a root of its own the program may be out of reach: then being confined is all.
        Ok(in_force) if status.success() || !layers.mount_ns => Ok(in_force),
        Ok(_) => Err(error("execute a program in a confined child", &status)),
        Err(cause) => Err(cause),
    }
}

fn finding(layer: &str, result: &Result<InForce, SandboxError>) -> LayerFinding {
    let layer = layer.to_owned();
    match result {
        Ok(in_force) => {
            let detail = match (&*layer, in_force.started_as_root) {
                ("landlock", _) => format!("version {}", in_force.landlock_abi),
                ("drop_privileges", true) => format!("root becomes user {}", in_force.host_uid),
                ("drop_privileges", false) => "no capabilities".to_owned(),
                _ => "works".to_owned(),
            };
            LayerFinding { layer, available: true, detail, remedy: String::new() }
        }
        Err(error) => {
            let remedy = remedy(&layer, error).to_owned();
            LayerFinding { layer, available: false, detail: error.to_string(), remedy }
        }
    }
}

fn remedy<'a>(layer: &str, error: &'a SandboxError) -> &'a str {
    match layer {
        "user_ns" | "mount_ns" | "pid_ns" | "net_ns" => {
            "let users make namespaces (sysctl user.max_user_namespaces, \
             kernel.unprivileged_userns_clone=1, kernel.apparmor_restrict_unprivileged_userns=0), \
             or run as root; in a container: --privileged, or --security-opt seccomp=unconfined"
        }
        "landlock" => "Linux 5.13 or newer; add `landlock` to the kernel parameter lsm=",
        "seccomp" => "a kernel with CONFIG_SECCOMP_FILTER",
        "cgroup" => "optional: run as root, or delegate a group with memory and pids",
        _ => &error.hint,
    }
}
