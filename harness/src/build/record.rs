//! Recording the template's compiler call.

use std::collections::{BTreeMap, HashSet};
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::TEMPLATE;
use super::closure::{Metadata, compiled_package, libraries};
use crate::files::{feed, files_below, hex};

/// The manifest of this program's own package.
const UMBRA: &str = "harness/Cargo.toml";

/// Names the file that the compiler wrapper writes its [`Call`] to.
const RECORD_VARIABLE: &str = "UMBRA_RECORD_FILE";

/// The template's compiler call, and the staged libraries that it needs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Recording {
    /// The compiler itself, not a launcher that chooses one.
    pub rustc: PathBuf,
    /// The toolchain's root, which the compiler reads.
    pub sysroot: PathBuf,
    /// Its arguments, as cargo gave them.
    pub args: Vec<String>,
    /// Cargo's environment for the crate: `CARGO_PKG_*` and the like.
    pub env: BTreeMap<String, String>,
    /// The folder with the base code's closure.
    pub closure: PathBuf,
    /// What the recording depends on, hashed: toolchain, lock file, base code, manifests.
    pub key: String,
    /// The compiler's name and version; asked anew each time.
    #[serde(skip)]
    pub version: String,
}

/// Why nothing could be recorded. The environment's matter or ours, never a submission's.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// A file cannot be read or written.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What happened.
        error: io::Error,
    },
    /// A program cannot be started or fails.
    #[error("`{command}` failed: {message}")]
    Program {
        /// What was run.
        command: String,
        /// What it said.
        message: String,
    },
}

/// Cargo's progress on the crates that renderers are built on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Compiling {
    /// Packages that are there.
    pub done: usize,
    /// Packages in all.
    pub packages: usize,
}

impl Compiling {
    /// In words, with how long the rest will take after `elapsed` for what is done.
    pub fn in_words(&self, elapsed: Duration) -> String {
        let Self { done, packages } = *self;
        if done == 0 {
            return format!(
                "compiling the {packages} crates that renderers are built on; the first time only, some \
                 minutes"
            );
        }
        let rest = packages.saturating_sub(done);
        let left = elapsed.mul_f64(rest as f64 / done as f64);
        let left = match left.as_secs() {
            0..5 => String::new(),
            s @ 5..100 => format!(", about {s} s left"),
            s => format!(", about {} min left", (s + 30) / 60),
        };
        format!("compiled {done} of {packages} crates{left}")
    }
}

/// A compiler call as the wrapper saw it.
#[derive(Serialize, Deserialize)]
struct Call {
    args: Vec<String>,
    env: BTreeMap<String, String>,
}

/// When cargo runs this program as its compiler wrapper, plays that part and returns the exit code. `main` asks first
/// of all.
pub fn wrapper_main() -> Option<ExitCode> {
    let file = PathBuf::from(std::env::var_os(RECORD_VARIABLE)?);
    let mut args = std::env::args_os().skip(1);
    let rustc = args.next()?;
    let args: Vec<_> = args.collect();
    let is_template = args.windows(2).any(|pair| pair[0] == "--crate-name" && pair[1] == TEMPLATE);
    if is_template {
        let env = std::env::vars_os()
            .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)))
            .filter(|(name, _)| name.starts_with("CARGO_"));
        let text = args.iter().map(|arg| arg.to_string_lossy().into_owned());
        let call = Call { args: text.collect(), env: env.collect() };
        let written = serde_json::to_vec(&call).map_err(io::Error::from);
        if let Err(error) = written.and_then(|bytes| fs::write(&file, bytes)) {
            eprintln!("umbra: cannot record the compiler call in {}: {error}", file.display());
            return Some(ExitCode::FAILURE);
        }
    }
    let status = Command::new(&rustc).args(args).env_remove(RECORD_VARIABLE).status();
    Some(match status {
        Ok(status) if status.success() => ExitCode::SUCCESS,
        Ok(status) => ExitCode::from(status.code().and_then(|c| c.try_into().ok()).unwrap_or(1)),
        Err(error) => {
            eprintln!("umbra: cannot start {}: {error}", rustc.display());
            ExitCode::FAILURE
        }
    })
}

impl Recording {
    /// The recording for the present state of `workspace`: the stored one, or a new one, made by
    /// letting cargo build the template with `umbra` (this program) as compiler wrapper. Several
    /// processes may ask at once. The template itself need not compile: students work in it.
    ///
    /// Where the template is a link, the workspace is the one that it leads to: an assignment may be a `config.json` of
    /// its own beside links, and nothing is compiled for it again.
    ///
    /// # Errors
    /// When the workspace cannot be read or cargo fails.
    pub fn obtain(workspace: &Path, umbra: &Path) -> Result<Self, RecordError> {
        Self::obtain_telling(workspace, umbra, &|_| ())
    }

    /// The same; `progress` is told how far cargo is while a new recording is made, at first with
    /// nothing done.
    ///
    /// # Errors
    /// As [`Recording::obtain`].
    pub fn obtain_telling(
        workspace: &Path,
        umbra: &Path,
        progress: &dyn Fn(Compiling),
    ) -> Result<Self, RecordError> {
        let workspace = &workspace_of_template(workspace)?;
        let (key, version) = key(workspace)?;
        let folder = workspace.join("target/umbra");
        fs::create_dir_all(&folder).map_err(at(&folder))?;
        let lock = folder.join("record.lock");
        let held = File::create(&lock).map_err(at(&lock))?;
        held.lock().map_err(at(&lock))?;
        let stored = folder.join(format!("record-{key}.json"));
        if let Ok(bytes) = fs::read(&stored)
            && let Ok(mut recording) = serde_json::from_slice::<Self>(&bytes)
            && recording.key == key
            && recording.closure.is_dir()
            && recording.rustc.is_file()
        {
            // It was asked for: see `forget_old`. That may fail on a disk that cannot be written, where nothing is
            // forgotten.
            let file = File::options().append(true).open(&stored);
            let _ = file.and_then(|file| file.set_modified(SystemTime::now()));
            recording.version = version;
            return Ok(recording);
        }
        let sysroot = run(Command::new("rustc").args(["--print", "sysroot"]), workspace)?;
        let sysroot = PathBuf::from(sysroot.trim());
        let rustc = sysroot.join("bin").join(format!("rustc{}", std::env::consts::EXE_SUFFIX));
        let host = run(Command::new(&rustc).args(["--print", "host-tuple"]), workspace)?;
        let mut cargo = Command::new("cargo");
        // Without the filter, cargo would download what other platforms need.
        cargo.args(["metadata", "--format-version=1", "--filter-platform", host.trim()]);
        let metadata = run(&mut cargo, workspace)?;
        let metadata: Metadata = serde_json::from_str(&metadata).map_err(|error| {
            RecordError::Program { command: "cargo metadata".into(), message: error.to_string() }
        })?;
        let (call, messages) = record(workspace, umbra, &folder, &metadata, progress)?;
        let libraries = libraries(&messages, &metadata.closure_of(TEMPLATE));
        let closure = stage(&folder, &key, &libraries)?;
        let Call { args, env } = call;
        let recording = Self { rustc, sysroot, args, env, closure, key, version };
        let bytes =
            serde_json::to_vec_pretty(&recording).map_err(io::Error::from).map_err(at(&stored))?;
        fs::write(&stored, bytes).map_err(at(&stored))?;
        forget_old(&folder);
        Ok(recording)
    }
}

/// A recording that nobody has used for this long is removed: no class takes longer.
const KEPT: Duration = Duration::from_secs(3 * 24 * 60 * 60);

/// Removes recordings, with their closures of some hundred MB, that nobody has asked for in a while. What cannot be
/// removed stays.
fn forget_old(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let key = name.strip_prefix("record-").and_then(|rest| rest.strip_suffix(".json"));
        let used = entry.metadata().and_then(|meta| meta.modified());
        let age = used.ok().and_then(|used| used.elapsed().ok()).unwrap_or_default();
        if let Some(key) = key.filter(|_| age > KEPT) {
            // The closure first: one without a recording would stay for good.
            let closure = folder.join(format!("closure-{key}"));
            if !closure.exists() || fs::remove_dir_all(&closure).is_ok() {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

/// The workspace in which the template lies.
fn workspace_of_template(root: &Path) -> Result<PathBuf, RecordError> {
    let template = root.join(TEMPLATE);
    if !template.is_symlink() {
        return Ok(root.to_owned());
    }
    let real = fs::canonicalize(&template).map_err(at(&template))?;
    Ok(real.parent().unwrap_or(root).to_owned())
}

/// Lets cargo build the template once more and answers its compiler call and cargo's messages.
///
/// Umbra's library is named too, though it is fresh: cargo chooses the features of shared
/// dependencies for all named packages together, and by the template alone it would choose others
/// and compile wgpu a second time. A student's kit does not hold it.
fn record(
    workspace: &Path,
    umbra: &Path,
    folder: &Path,
    metadata: &Metadata,
    progress: &dyn Fn(Compiling),
) -> Result<(Call, String), RecordError> {
    // Cargo's freshness is a file for each crate; without it this one crate is built again. A cargo that builds here
    // holds its lock, and does not expect that.
    let release = workspace.join("target/release");
    let lock = fs::File::open(release.join(".cargo-lock")).ok();
    if let Some(lock) = lock.as_ref().filter(|lock| lock.try_lock().is_err()) {
        eprintln!("umbra: waiting for the cargo that builds in {}", release.display());
        // Where there are no locks, cargo has none either.
        let _ = lock.lock();
    }
    let fingerprints = release.join(".fingerprint");
    for entry in fs::read_dir(&fingerprints).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(&format!("{TEMPLATE}-")) {
            fs::remove_dir_all(entry.path()).map_err(at(&entry.path()))?;
        }
    }
    drop(lock);
    let file = folder.join("call.json");
    let _ = fs::remove_file(&file);
    let mut built = vec![TEMPLATE];
    built.extend(Some("umbra").filter(|_| workspace.join(UMBRA).is_file()));
    let mut cargo = Command::new("cargo");
    cargo.args(["build", "--release", "--lib"]);
    built.iter().for_each(|package| {
        cargo.args(["-p", package]);
    });
    cargo.arg("--target-dir").arg(workspace.join("target"));
    cargo.arg("--message-format=json-render-diagnostics");
    cargo.env("RUSTC_WRAPPER", umbra).env(RECORD_VARIABLE, &file);
    let packages = metadata.compiled_for(&built);
    progress(Compiling { done: 0, packages });
    let mut compiled = HashSet::new();
    let (messages, ended) = run_by_line(&mut cargo, workspace, &mut |line| {
        if compiled_package(line).is_some_and(|package| compiled.insert(package)) {
            progress(Compiling { done: compiled.len().min(packages), packages });
        }
    })?;
    // The template comes last: once its compiler call is there, all that it is linked with is, whether
    // or not it compiles. What is wrong with it is said when it is judged.
    let recorded = fs::read(&file).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let mut call: Call = match (recorded, ended) {
        (Some(call), _) => call,
        (None, Err(error)) => return Err(error),
        (None, Ok(())) => {
            let message = format!("it left no compiler call in {}", file.display());
            return Err(failed_to(&cargo, message));
        }
    };
    // A submission must neither see nor write the user's cache of incremental builds.
    if let Some(at) = call.args.iter().position(|arg| arg.starts_with("incremental=")) {
        call.args.drain(at.saturating_sub(1)..=at);
    }
    Ok((call, messages))
}

/// The `--extern name=path` arguments.
pub(super) fn externs(args: &[String]) -> impl Iterator<Item = (&str, &str)> {
    let values = args.windows(2).filter(|pair| pair[0] == "--extern");
    values.filter_map(|pair| pair[1].split_once('='))
}

/// Links or copies the libraries into a folder of their own. It appears whole or not at all.
fn stage(folder: &Path, key: &str, libraries: &[PathBuf]) -> Result<PathBuf, RecordError> {
    let closure = folder.join(format!("closure-{key}"));
    let unfinished = folder.join(format!("closure-{key}.new"));
    for old in [&closure, &unfinished] {
        if old.exists() {
            fs::remove_dir_all(old).map_err(at(old))?;
        }
    }
    fs::create_dir(&unfinished).map_err(at(&unfinished))?;
    for library in libraries {
        let Some(name) = library.file_name() else { continue };
        let to = unfinished.join(name);
        // Compiler and linker replace their outputs and never write into them, so that a link
        // keeps what it has.
        if !to.exists() && fs::hard_link(library, &to).is_err() {
            fs::copy(library, &to).map_err(at(library))?;
        }
    }
    fs::rename(&unfinished, &closure).map_err(at(&closure))?;
    Ok(closure)
}

/// The hash of everything that the recorded call and its closure depend on, and the compiler's own name.
fn key(workspace: &Path) -> Result<(String, String), RecordError> {
    let mut hash = Sha256::new();
    let version = run(Command::new("rustc").arg("-vV"), workspace)?;
    hash.update(&version);
    for variable in ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS"] {
        hash.update(std::env::var(variable).unwrap_or_default());
        hash.update([0]);
    }
    let mut files = ["Cargo.toml", "Cargo.lock"].map(|file| workspace.join(file)).to_vec();
    files.extend(Some(workspace.join(UMBRA)).filter(|file| file.is_file()));
    files.push(workspace.join(TEMPLATE).join("Cargo.toml"));
    for tree in ["harness/api/src", "harness/basecode/src"] {
        let tree = workspace.join(tree);
        files.extend(files_below(&tree).map_err(at(&tree))?);
    }
    files.extend(
        ["harness/api/Cargo.toml", "harness/basecode/Cargo.toml"].map(|f| workspace.join(f)),
    );
    for file in &files {
        hash.update(file.to_string_lossy().as_bytes());
        hash.update(file.metadata().map_err(at(file))?.len().to_le_bytes());
        feed(&mut hash, file).map_err(at(file))?;
    }
    let name = version.lines().next().unwrap_or_default().to_owned();
    Ok((hex(&hash.finalize()[..8]), name))
}

/// Runs a trusted program in the workspace and answers its standard output.
fn run(command: &mut Command, workspace: &Path) -> Result<String, RecordError> {
    command.current_dir(workspace).stdin(Stdio::null());
    let output = match command.output() {
        Ok(output) => output,
        Err(error) => return Err(failed_to(command, error.to_string())),
    };
    if !output.status.success() {
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        return Err(failed_to(command, message));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Runs a trusted program in the workspace, shows each line of its standard output as it comes, and
/// answers all of them and whether it succeeded.
fn run_by_line(
    command: &mut Command,
    workspace: &Path,
    line: &mut dyn FnMut(&str),
) -> Result<(String, Result<(), RecordError>), RecordError> {
    command.current_dir(workspace).stdin(Stdio::null());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|error| failed_to(command, error.to_string()))?;
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    let (mut said, mut lines) = (Vec::new(), String::new());
    std::thread::scope(|scope| {
        // Read beside the other: a full pipe would hold the program up.
        scope.spawn(|| stderr.map(|mut stderr| stderr.read_to_end(&mut said)));
        for read in stdout.into_iter().flat_map(|stdout| BufReader::new(stdout).lines()) {
            let Ok(read) = read else { break };
            line(&read);
            lines.push_str(&read);
            lines.push('\n');
        }
    });
    let status = child.wait().map_err(|error| failed_to(command, error.to_string()))?;
    let said = String::from_utf8_lossy(&said).into_owned();
    Ok((lines, if status.success() { Ok(()) } else { Err(failed_to(command, said)) }))
}

fn failed_to(command: &Command, message: String) -> RecordError {
    let program = command.get_program().to_string_lossy().into_owned();
    let args = command.get_args().map(|arg| arg.to_string_lossy().into_owned());
    let command = std::iter::once(program).chain(args).collect::<Vec<_>>().join(" ");
    RecordError::Program { command, message }
}

fn at(path: &Path) -> impl Fn(io::Error) -> RecordError {
    let path = path.to_owned();
    move |error| RecordError::File { path: path.clone(), error }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_asked_for_in_days_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (key, age) in [("old", 2 * KEPT), ("new", KEPT / 2), ("bare", 2 * KEPT)] {
            let file = File::create(at(&format!("record-{key}.json"))).unwrap();
            file.set_modified(SystemTime::now() - age).unwrap();
        }
        for key in ["old", "new"] {
            fs::create_dir(at(&format!("closure-{key}"))).unwrap();
            fs::write(at(&format!("closure-{key}/a.rlib")), "x").unwrap();
        }
        fs::write(at("record.lock"), "").unwrap();
        forget_old(folder.path());
        let left = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
        let mut left: Vec<_> = left.map(|name| name.into_string().unwrap()).collect();
        left.sort();
        assert_eq!(left, ["closure-new", "record-new.json", "record.lock"]);
    }
}
