//! `xtask`: the chores of this repository that are not part of grading.

#[cfg(unix)]
mod bench;
mod checks;
mod dist;
mod parallel;
mod samples;
mod scenes;
mod verdicts;

use clap::{Parser, Subcommand};
use std::path::Path;
use std::process::ExitCode;

/// The chores of this repository.
#[derive(Parser)]
#[command(name = "xtask")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write the scenes of the assignment into scenes/a2.
    Scenes {
        /// Write nothing; fail when a committed file differs from what would be written.
        #[arg(long)]
        check: bool,
    },
    /// Measure Umbra beside Embree, OpenImageIO and others; write docs/performance.md.
    #[cfg(unix)]
    Bench(bench::Arguments),
    /// Run a command and print what it cost, for `bench`.
    #[cfg(unix)]
    #[command(hide = true)]
    BenchChild {
        /// The command line.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        command: Vec<String>,
    },
    /// Write the list of checks into docs/evidence.md and ARCHITECTURE.md.
    Checks,
    /// Pack the sample submissions into target/umbra/samples, with the images that their code draws; print their paths.
    Samples {
        /// Folders of samples/; all without any.
        names: Vec<String>,
    },
    /// Make the student's kit.
    Dist(dist::Arguments),
    /// Grade the reference with known mistakes, and without; print the matrix part x mistake.
    Verdicts(verdicts::Arguments),
}

/// The repository.
fn root() -> &'static Path {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().unwrap_or(own)
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Scenes { check: true } => scenes::check(),
        Command::Scenes { check: false } => scenes::write(),
        #[cfg(unix)]
        Command::Bench(arguments) => bench::run(root(), &arguments),
        #[cfg(unix)]
        Command::BenchChild { command } => bench::child::run(&command),
        Command::Checks => checks::run(root(), false),
        Command::Samples { names } => samples::pack_named(root(), &names).map(|samples| {
            let paths = samples.iter().map(|sample| sample.archive.display().to_string());
            paths.collect::<Vec<_>>().join("\n")
        }),
        Command::Dist(arguments) => dist::run(root(), &arguments),
        Command::Verdicts(arguments) => verdicts::run(root(), &arguments),
    };
    match result {
        Ok(summary) => {
            println!("{summary}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
