//! Replaying the recorded compiler call on a submission.

use std::fs;
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::diagnostics::parse;
use super::record::externs;
use super::{Diagnostic, Recording, TEMPLATE};
use crate::files::library_name;
use crate::process::{self, Confinement, Exit, ProcessLimits};
use crate::sandbox::policy::{CLOSURE, SCRATCH, SRC, TOOLCHAIN};
use crate::sandbox::{Bind, ChildKind, Policy};
use crate::worker::Supervisor;

/// Number of characters shown of output that is no compiler message.
const UNREADABLE: usize = 4096;

/// What became of a compiler call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum BuildOutcome {
    /// A plugin came out.
    Built {
        /// Where it lies.
        library: PathBuf,
    },
    /// The compiler or the linker refused the source; what it said, in its order.
    CompileError {
        /// At least one.
        errors: Vec<Diagnostic>,
    },
    /// The compiler did not end by itself, and not because of the source.
    Ended(Exit),
}

/// A compiler call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BuildReport {
    /// What became of it.
    pub outcome: BuildOutcome,
    /// What the compiler warned of.
    pub warnings: Vec<Diagnostic>,
    /// Wall-clock time in seconds.
    pub wall_s: f64,
    /// CPU time in seconds; 0 when unknown.
    pub cpu_s: f64,
}

/// Enough for a submission many times the template's size on a slow machine.
pub fn default_limits() -> ProcessLimits {
    ProcessLimits {
        wall_s: 120.0,
        cpu_s: 120,
        memory_mib: 4096,
        output_kib: 4096,
        file_size_mib: 256,
        scratch_mib: 1024,
        tasks: 160,
        open_files: 1024,
        threads: 1,
    }
}

/// Compiles the submission whose `src` folder is `src` into a plugin in `out`, an existing folder. `supervisor` says
/// which program is Umbra and what isolates the compiler. Nothing of the submission besides `src` is named to the
/// compiler. A timeout counts when it comes again, alone on the machine. Nobody is to blame for an end from outside.
///
/// # Errors
/// When the compiler cannot be started or isolated, or `out` cannot be used.
pub fn compile(
    recording: &Recording,
    supervisor: &Supervisor,
    src: &Path,
    out: &Path,
    limits: &ProcessLimits,
    cancel: &AtomicBool,
) -> io::Result<BuildReport> {
    let late = |report: &io::Result<BuildReport>| match report {
        Ok(report) => matches!(report.outcome, BuildOutcome::Ended(exit) if exit.is_out_of_time()),
        Err(error) => error.kind() == io::ErrorKind::TimedOut,
    };
    supervisor
        .confirming_timeouts(|| compile_once(recording, supervisor, src, out, limits, cancel), late)
}

fn compile_once(
    recording: &Recording,
    supervisor: &Supervisor,
    src: &Path,
    out: &Path,
    limits: &ProcessLimits,
    cancel: &AtomicBool,
) -> io::Result<BuildReport> {
    let (src, out) = (std::path::absolute(src)?, std::path::absolute(out)?);
    let scratch = tempfile::Builder::new().prefix("rustc-").tempdir_in(&out)?;
    let file = library_name(TEMPLATE);
    let library = out.join(&file);
    let report = tempfile::NamedTempFile::new_in(&out)?;
    let mut policy = Policy::new(ChildKind::Build);
    policy.layers = supervisor.isolation;
    policy.read_only.push(Bind::new(&recording.sysroot, TOOLCHAIN));
    policy.read_only.push(Bind::new(&recording.closure, CLOSURE));
    policy.read_only.push(Bind::new(&src, SRC));
    policy.collect.push(Bind::new(&library, Path::new(SCRATCH).join(&file)));
    policy.scratch.without_mount = Some(scratch.path().to_owned());
    policy.report = Some(report.path().to_owned());
    let confinement = Confinement::new(limits, policy.clone());
    let sandboxed = confinement.sandbox.is_some();
    // What the compiler is told: where it sees things, and where it may write.
    let (seen_src, temporary) = (policy.seen(&src), policy.scratch_path());
    let into = if sandboxed { &temporary } else { &out };
    if sandboxed {
        make_empty(&library)?;
    }
    let mut command =
        process::command(&supervisor.umbra, &confinement, &policy.seen(&recording.rustc));
    command.args(replayed(recording, &policy.seen(&recording.closure), &seen_src, into));
    command.current_dir(scratch.path());
    // The linker is found through PATH.
    command.env("PATH", "/usr/local/bin:/usr/bin:/bin").env("LANG", "C");
    command.env("HOME", "/nonexistent").env("TMPDIR", &temporary);
    let told = |name: &str| name.starts_with("CARGO_PKG_") || name == "CARGO_CRATE_NAME";
    command.envs(recording.env.iter().filter(|(name, _)| told(name)));
    if let Some(root) = seen_src.parent() {
        command.env("CARGO_MANIFEST_DIR", root);
    }
    let keep = (limits.output_kib as usize) << 10;
    let ended =
        process::run(command, &confinement, keep, cancel, &mut |_| ControlFlow::Continue(()))?;
    // What lies between was cut: a source may be warned of more than is kept.
    let said = parse(&[&*ended.stderr.head, &*ended.stderr.tail].join("\n"));
    let outcome = match ended.exit {
        Exit::Code(0)
            if fs::metadata(&library).is_ok_and(|file| file.is_file() && file.len() > 0) =>
        {
            BuildOutcome::Built { library }
        }
        // In a sandbox foreign code could end with this code; there the report tells.
        Exit::Code(code) if !sandboxed && code == i32::from(process::EXIT_NOT_CONFINED) => {
            return Err(io::Error::other(ended.stderr.head));
        }
        // The compiler succeeded but left no library: the library could not be stored.
        Exit::Code(0) if said.errors.is_empty() => {
            let message =
                format!("cannot keep what the compiler made in {}: no disk space?", out.display());
            return Err(io::Error::new(io::ErrorKind::StorageFull, message));
        }
        // Words of the compiler's count more than those of an allocator, which a source may quote.
        Exit::OutOfMemory if !said.errors.is_empty() => {
            BuildOutcome::CompileError { errors: said.errors }
        }
        Exit::Code(code) => {
            let mut errors = said.errors;
            if errors.is_empty() {
                let message = format!("the compiler ended with code {code} and no plugin");
                let said: String = ended.stderr.head.chars().take(UNREADABLE).collect();
                let rendered = format!("{message}\n{said}");
                errors.push(Diagnostic { message, place: None, rendered });
            }
            BuildOutcome::CompileError { errors }
        }
        exit if exit == Exit::Starved || exit.is_from_outside() => {
            return Err(process::nobodys_fault("the compiler", exit));
        }
        exit => BuildOutcome::Ended(exit),
    };
    let (wall_s, cpu_s) = (ended.wall_s, ended.cpu_s);
    Ok(BuildReport { outcome, warnings: said.warnings, wall_s, cpu_s })
}

/// An empty file to be written over with what the sandbox collects. Whoever loads it later may be
/// another user.
pub(super) fn make_empty(library: &Path) -> io::Result<()> {
    fs::File::create(library)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        fs::set_permissions(library, fs::Permissions::from_mode(0o755))?;
    }
    Ok(())
}

/// The recorded arguments with source, output and libraries replaced.
fn replayed(recording: &Recording, closure: &Path, src: &Path, out: &Path) -> Vec<String> {
    let staged = |name: &str, path: &str| {
        let file = Path::new(path).file_name().unwrap_or_default();
        format!("{name}={}", closure.join(file).display())
    };
    let root = format!("{TEMPLATE}/src/lib.rs");
    let mut replayed = Vec::new();
    let mut args = recording.args.iter();
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--out-dir" => {
                args.next();
                replayed.extend([arg.clone(), out.display().to_string()]);
            }
            "--extern" => {
                let pair = args.next().into_iter().cloned().collect::<Vec<_>>();
                let pair = [arg.clone()].into_iter().chain(pair).collect::<Vec<_>>();
                for (name, path) in externs(&pair) {
                    replayed.extend([arg.clone(), staged(name, path)]);
                }
            }
            "-L" => {
                // Only the closure: cargo's own folder holds much that does not concern a submission.
                args.next();
            }
            "--emit=dep-info,link" => replayed.push("--emit=link".into()),
            // Without it the rendered messages are plain text, without colors.
            json if json.starts_with("--json=") => {}
            width if width.starts_with("--diagnostic-width=") => {}
            source if source.replace('\\', "/").ends_with(&root) => {
                replayed.push(src.join("lib.rs").display().to_string());
            }
            _ => replayed.push(arg.clone()),
        }
    }
    replayed.extend(["-L".into(), format!("dependency={}", closure.display())]);
    // Messages and panics say `src/...`, wherever the copy lies.
    replayed.push(format!("--remap-path-prefix={}=src", src.display()));
    replayed
}
