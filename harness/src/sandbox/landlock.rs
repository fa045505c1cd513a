//! Landlock: limits file access to what the mount namespace shows, by a second mechanism.

use std::path::PathBuf;

use landlock::{
    ABI, Access, AccessFs, AccessNet, BitFlags, LandlockStatus, PathBeneath, PathFd, Ruleset,
    RulesetAttr, RulesetCreatedAttr, RulesetError, RulesetStatus, Scope, make_bitflags,
};

use super::{Policy, SandboxError};

/// The newest version whose rights are asked for; an older kernel gives what it has. Version 9
/// adds connections to path-name sockets, of which we want none.
const NEWEST: ABI = ABI::V9;

/// Restricts this process and its descendants; returns the version in force.
///
/// # Errors
/// When the kernel has no Landlock or does not enforce the rules.
pub fn restrict(policy: &Policy) -> Result<u32, SandboxError> {
    let error = |step: &str, cause: &dyn ToString| {
        SandboxError::new("landlock", step.to_owned(), cause.to_string())
            .hint("Linux 5.13 or newer with `landlock` among the security modules")
    };
    let status = restrict_by(&rules(policy)).map_err(|cause| error("restrict files", &cause))?;
    match (status.ruleset, status.landlock) {
        (RulesetStatus::NotEnforced, _) => Err(error("restrict files", &"not enforced")),
        (_, LandlockStatus::Available { effective_abi, .. }) => Ok(effective_abi as u32),
        _ => Err(error("restrict files", &"not there")),
    }
}

fn restrict_by(rules: &[(PathBuf, Right)]) -> Result<landlock::RestrictionStatus, RulesetError> {
    let mut ruleset = Ruleset::default()
        .handle_access(AccessFs::from_all(NEWEST))?
        // No rule allows a port: no TCP at all.
        .handle_access(AccessNet::from_all(NEWEST))?
        .scope(Scope::from_all(NEWEST))?
        .create()?;
    for (path, right) in rules {
        let folder = path.is_dir();
        // What is not there needs no rule.
        let Ok(fd) = PathFd::new(path) else { continue };
        let access = right.access();
        let access = if folder { access } else { access & AccessFs::from_file(NEWEST) };
        ruleset = ruleset.add_rule(PathBeneath::new(fd, access))?;
    }
    ruleset.restrict_self()
}

#[derive(Clone, Copy)]
enum Right {
    Read,
    ReadAndExecute,
    Write,
    Device,
}

impl Right {
    fn access(self) -> BitFlags<AccessFs> {
        let read = make_bitflags!(AccessFs::{ReadFile | ReadDir});
        // No devices, sockets or pipes are made.
        let write = make_bitflags!(AccessFs::{
            WriteFile | Truncate | Refer | MakeReg | MakeDir | MakeSym | RemoveFile | RemoveDir
        });
        match self {
            Self::Read => read,
            Self::ReadAndExecute => read | AccessFs::Execute,
            Self::Write => read | write,
            Self::Device => make_bitflags!(AccessFs::{ReadFile | WriteFile | IoctlDev}),
        }
    }
}

/// What may be done beneath which path, as the payload sees it.
fn rules(policy: &Policy) -> Vec<(PathBuf, Right)> {
    let read = if policy.kind.may_execute() { Right::ReadAndExecute } else { Right::Read };
    let mut rules = Vec::new();
    for bind in &policy.read_only {
        rules.push((policy.seen(&bind.host), read));
    }
    for bind in &policy.read_write {
        rules.push((policy.seen(&bind.host), Right::Write));
    }
    for device in ["/dev/null", "/dev/zero"] {
        rules.push((device.into(), Right::Device));
    }
    rules.push(("/dev/urandom".into(), Right::Read));
    if let Some(gpu) = &policy.gpu {
        rules.extend(gpu.nodes.iter().map(|path| (path.clone(), Right::Device)));
        rules.extend(gpu.files.iter().map(|path| (path.clone(), Right::Read)));
    }
    if policy.has_scratch() {
        rules.push((policy.scratch_path(), Right::Write));
    }
    if policy.proc {
        rules.push(("/proc/cpuinfo".into(), Right::Read));
    }
    rules
}
