//! Other programs, and what they cost.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Instant;

use anyhow::{Context, ensure};
use nix::sys::resource::{UsageWho, getrusage};

/// What a process cost, start to exit.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    /// Seconds that passed.
    pub wall: f64,
    /// Seconds of all cores.
    pub cpu: f64,
    /// The most memory it held, in MiB.
    pub memory: f64,
}

/// Runs a command line in a process of its own that has no other children: `xtask bench-child`.
///
/// # Errors
/// When it cannot be started or measured.
pub fn measure<I: IntoIterator<Item = S>, S: AsRef<OsStr>>(command: I) -> anyhow::Result<Cost> {
    let own = std::env::current_exe()?;
    let output = Command::new(own).arg("bench-child").args(command).output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let last = text.lines().last().unwrap_or_default();
    let figures: Vec<f64> = last.split(' ').filter_map(|word| word.parse().ok()).collect();
    let [wall, cpu, memory] = figures[..] else {
        anyhow::bail!("a measured process failed: {}", String::from_utf8_lossy(&output.stderr));
    };
    Ok(Cost { wall, cpu, memory })
}

/// The side of [`measure`] in the new process. Whatever the exit code of the command is, it ran.
///
/// # Errors
/// When there is no command, or it cannot be started.
pub fn run(command: &[String]) -> anyhow::Result<String> {
    let [program, arguments @ ..] = command else { anyhow::bail!("no command") };
    let begin = Instant::now();
    Command::new(program)
        .args(arguments)
        .stdout(Stdio::null())
        .status()
        .with_context(|| format!("cannot start {program}"))?;
    let wall = begin.elapsed().as_secs_f64();
    let usage = getrusage(UsageWho::RUSAGE_CHILDREN)?;
    let seconds =
        |time: nix::sys::time::TimeVal| time.tv_sec() as f64 + 1e-6 * time.tv_usec() as f64;
    let cpu = seconds(usage.user_time()) + seconds(usage.system_time());
    Ok(format!("{wall} {cpu} {}", usage.max_rss() as f64 / 1024.0))
}

/// A program that measures what it is told on its standard input.
pub struct Server {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Server {
    /// Starts it.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start(program: &Path, arguments: &[&OsStr]) -> anyhow::Result<Self> {
        let mut child = Command::new(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start {}", program.display()))?;
        let input = child.stdin.take();
        let output = child.stdout.take().context("no standard output")?;
        Ok(Self { child, input, output: BufReader::new(output) })
    }

    /// Seconds, and a count, of what `what` names.
    ///
    /// # Errors
    /// When it has ended, or answers something else.
    pub fn measure(&mut self, what: &str) -> anyhow::Result<(f64, usize)> {
        writeln!(self.input.as_mut().context("it has ended")?, "{what}")?;
        let mut line = String::new();
        self.output.read_line(&mut line)?;
        let (seconds, count) = line.trim().split_once(' ').context("it said nothing")?;
        Ok((seconds.parse()?, count.parse()?))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.input = None;
        let _ = self.child.wait();
    }
}

/// Compiles a C++ program.
///
/// # Errors
/// When there is no compiler, or it refuses the source.
pub fn compile(source: &Path, program: &Path, libraries: &[&str]) -> anyhow::Result<()> {
    let status = Command::new("c++")
        .args(["-O3", "-march=native", "-std=c++17", "-o"])
        .args([program, source])
        .args(libraries)
        .status()
        .context("cannot start c++")?;
    ensure!(status.success(), "{} does not compile", source.display());
    Ok(())
}
