//! The command line: parses, calls, prints. Each command is one file.

mod assemble;
mod batch;
mod bless;
mod changes;
mod check;
mod choices;
mod chosen;
mod class;
mod compare;
mod context;
mod decide;
mod defend;
#[cfg(target_os = "linux")]
mod doctor;
mod earlier;
mod explain;
mod export;
mod found;
mod grade;
mod gradescope_pack;
mod join;
mod location;
mod mend;
mod merge;
mod outputs;
mod regrade;
mod release;
mod render;
mod report_folder;
mod selection;
mod settled;
mod similarity;
mod terminal;
mod terminal_pictures;
mod tree;
mod view;
mod watch;

pub use render::AdapterChoice;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::columns::wrap;
use crate::panics;

/// Success.
pub const EXIT_OK: u8 = 0;
/// The answer is no: a submission does not conform, images differ, points are missing.
pub const EXIT_NOT_IN_ORDER: u8 = 1;
/// The command line or an input file cannot be used.
pub const EXIT_USAGE: u8 = 2;
/// The machine lacks something: an adapter, disk space, full isolation.
pub const EXIT_MACHINE: u8 = 3;
/// A bug of Umbra's: of a batch, all other submissions have their reports.
pub const EXIT_BUG: u8 = 70;
/// Ended by Ctrl-C.
pub const EXIT_INTERRUPTED: u8 = 130;

#[derive(Parser)]
#[command(version, about, after_help = EXIT_CODES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Folder of the assignment: config.json, scenes/, expected/ [default: found upward from the
    /// current folder, then from the program]
    #[arg(long, global = true, value_name = "DIR")]
    root: Option<PathBuf>,
}

const EXIT_CODES: &str = "\
Exit codes:
  0    success
  1    the answer is no: points lost, the tree does not conform, images differ
  2    bad command line or input
  3    the machine lacks something
  70   bug in Umbra
  130  interrupted";

/// The text that follows a panic's message.
const BUG: &str = concat!(
    "this is a bug in Umbra, not in the submission. Please report it with the line above, the command \
     line, the file involved and the version, ",
    env!("CARGO_PKG_VERSION"),
    "; RUST_BACKTRACE=1 prints more"
);

#[derive(Subcommand)]
enum Command {
    /// Check your working folder on the public scenes before you submit
    ///
    /// Builds src/, renders every public scene, and says what is wrong, where, and what it looks like.
    Check(check::CheckArguments),
    /// Grade submissions: archives, folders, or a download from a learning platform
    Grade(grade::GradeArguments),
    /// Merge what the tasks of `umbra grade --partition` graded, and write the reports
    Merge(merge::MergeArguments),
    /// Set the points of a part by hand, with a reason that both reports show
    Override(decide::OverrideArguments),
    /// Confirm what a report leaves to the instructor, such as images without code
    Confirm(decide::ConfirmArguments),
    /// Regrade a submission with a small fix, for a penalty
    ///
    /// The grade is never lower than without the fix.
    Mend(mend::MendArguments),
    /// Print why a part has its points: evidence, bounds and how to reproduce them
    Defend(defend::DefendArguments),
    /// Show students the held-back scenes, once nobody can submit any more
    Release(release::ReleaseArguments),
    /// Show how other rules, policies or decisions change the grades
    ///
    /// Renders nothing. --apply writes the change, --undo takes it back.
    Regrade(regrade::RegradeArguments),
    /// List what waits for the instructor
    ///
    /// Exits with 0 if nothing waits, with 1 if something does.
    Status(decide::StatusArguments),
    /// Export grades: grade books, feedback archives, Gradescope, JUnit, CSV, JSON
    Export(export::ExportArguments),
    /// Show submissions with similar sources side by side
    ///
    /// Reads results of JPlag. Costs no points.
    #[command(alias = "likeness")]
    Similarity(similarity::SimilarityArguments),
    /// Write an autograder for Gradescope
    ///
    /// The zip installs and builds Umbra there, and grades each submission.
    GradescopePack(gradescope_pack::PackArguments),
    /// Check the tree of submissions against the handout's
    ///
    /// Exits with 0 if all conform, with 1 if one does not.
    Validate(tree::ValidateArguments),
    /// Pack a working folder into an archive that conforms to the handout
    Pack(tree::PackArguments),
    /// Render a scene with a plugin, offline or realtime as the scene says
    Render(render::RenderArguments),
    /// Compare two EXR images
    Compare(compare::CompareArguments),
    /// Check a working folder on every save, with its report in the browser
    Watch(watch::WatchArguments),
    /// View EXR images in the browser: values, differences, exposure
    View(view::ViewArguments),
    /// Explain a check, a rule or a part
    ///
    /// Prints what it asks, what its error means, where its bound lies, and which code judges it.
    Explain(explain::ExplainArguments),
    /// Show what this machine has: isolation, graphics adapters, compiler
    ///
    /// Exits with 0 if it can grade.
    #[cfg(target_os = "linux")]
    Doctor,
    /// Print shell completions
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Render the stored expected images again and replace them
    Bless(bless::BlessArguments),
}

impl Command {
    /// Whether it works in the system's temporary folder, and not only in the assignment's own.
    fn needs_temporary_folder(&self) -> bool {
        match self {
            Self::Merge(_) | Self::Pack(_) | Self::Watch(_) => true,
            Self::View(arguments) => arguments.output.is_none(),
            #[cfg(target_os = "linux")]
            Self::Doctor => true,
            _ => false,
        }
    }
}

/// Parses the command line, runs the command and prints its error once.
///
/// Hidden commands come first: they are Umbra starting itself, and lock the process before
/// anything else is done in it.
pub fn main() -> ExitCode {
    // Cargo runs this very binary as its compiler wrapper while it is recorded.
    if let Some(code) = crate::build::wrapper_main() {
        return code;
    }
    let args: Vec<_> = std::env::args_os().skip(1).collect();
    #[cfg(target_os = "linux")]
    {
        use crate::sandbox::{LAUNCH_COMMAND, doctor, launch_main};
        match (args.first().and_then(|name| name.to_str()), args.get(1)) {
            (Some(LAUNCH_COMMAND), Some(program)) => return launch_main(program, &args[2..]),
            (Some(doctor::PROBE_COMMAND), _) => return ExitCode::SUCCESS,
            _ => {}
        }
    }
    match (args.first().and_then(|name| name.to_str()), args.get(1)) {
        (Some("__decode"), Some(dir)) => return crate::decode::child_main(Path::new(dir)),
        (Some("__exec"), Some(program)) => return crate::process::exec_main(program, &args[2..]),
        _ => {}
    }
    panics::note();
    // idiff's own codes leave no other for a failure.
    let failed = |code| if compare::is_idiff(&args) { compare::IDIFF_CANNOT } else { code };
    let ended = panics::contain(|| match Arguments::try_parse() {
        Ok(Arguments { command, root }) => run(command, root.as_deref()),
        Err(error) if error.use_stderr() => {
            let _ = error.print();
            Ok(failed(EXIT_USAGE))
        }
        Err(error) => {
            let text = error.render();
            let text = if terminal::colors() { text.ansi().to_string() } else { text.to_string() };
            print_as_is!("{}", wrapped(&text, terminal::width().min(HELP_COLUMNS)));
            Ok(EXIT_OK)
        }
    });
    crate::output::end_of_closed_pipe();
    match ended {
        Ok(Ok(code)) => ExitCode::from(code),
        Err(bug) => match bug.unprintable() {
            Some(error) => {
                eprintln!("umbra: cannot write to standard output: {error}");
                ExitCode::from(failed(EXIT_MACHINE))
            }
            None => {
                eprintln!("umbra: {BUG}");
                ExitCode::from(EXIT_BUG)
            }
        },
        Ok(Err(error)) => {
            eprintln!("umbra: {}", told_once(&error));
            ExitCode::from(failed(if machine_lacks(&error) { EXIT_MACHINE } else { EXIT_USAGE }))
        }
    }
}

/// Help is not wider than this, however wide the terminal is.
const HELP_COLUMNS: usize = 100;

/// A text in which no line is wider than `width` columns. What follows of a line is as far in as it began.
fn wrapped(text: &str, width: usize) -> String {
    let mut out = String::new();
    for line in text.lines() {
        let rest = line.trim_start_matches(' ');
        let indent = &line[..line.len() - rest.len()];
        for part in wrap(rest, width.saturating_sub(indent.len()).max(20)) {
            out.push_str(format!("{indent}{part}").trim_end());
            out.push('\n');
        }
    }
    out
}

/// An error and its causes, without causes that its message already contains and without numbers of the system's.
fn told_once(error: &anyhow::Error) -> String {
    // In the words of the system, and in plain ones.
    let words = |cause: &(dyn std::error::Error + 'static)| {
        let own = without_codes(&cause.to_string());
        let plain = cause.downcast_ref().map_or_else(|| own.clone(), io_words);
        (own, plain)
    };
    error.chain().map(words).fold(String::new(), |told, (own, plain)| match told.as_str() {
        "" => plain,
        told if told.contains(&own) => told.replace(&own, &plain),
        told if told.contains(&plain) => told.to_owned(),
        told => format!("{told}: {plain}"),
    })
}

/// What an error of the system says, in plain words.
fn io_words(error: &std::io::Error) -> String {
    use std::io::ErrorKind;
    let plain = match error.kind() {
        ErrorKind::NotFound => "there is no such file or folder",
        ErrorKind::PermissionDenied => "permission denied",
        ErrorKind::IsADirectory => "it is a folder",
        ErrorKind::NotADirectory => "not a folder",
        _ => return without_codes(&error.to_string()),
    };
    // One that names a path has words of its own.
    if error.raw_os_error().is_some() {
        plain.to_owned()
    } else {
        without_codes(&error.to_string())
    }
}

/// The text without ` (os error 2)` and the like.
fn without_codes(text: &str) -> String {
    let mut parts = text.split(" (os error ");
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        plain += part.split_once(')').map_or(part, |(_, rest)| rest);
    }
    plain
}

/// Whether an error says that the machine lacks something, as far as can be told from it.
fn machine_lacks(error: &anyhow::Error) -> bool {
    use std::io::Error;
    error.downcast_ref::<MachineLacks>().is_some()
        || error.chain().filter_map(|cause| cause.downcast_ref::<Error>()).any(|cause| {
            let too_many_files = [Some(23), Some(24)]; // ENFILE, EMFILE
            too_many_files.contains(&cause.raw_os_error()) || machine_lacks_kind(cause.kind())
        })
}

/// Likewise of an error of the system by its kind.
fn machine_lacks_kind(kind: std::io::ErrorKind) -> bool {
    use std::io::ErrorKind;
    matches!(
        kind,
        ErrorKind::StorageFull
            | ErrorKind::QuotaExceeded
            | ErrorKind::OutOfMemory
            | ErrorKind::ReadOnlyFilesystem
    )
}

/// Makes sure that reports can be written to `output` and temporary files made, before any work.
///
/// # Errors
/// When not, with the folder's name.
fn writable(output: &Path) -> anyhow::Result<()> {
    has_temporary_folder()?;
    anyhow::ensure!(
        output.is_dir() || output.symlink_metadata().is_err(),
        "--report: expected a folder, or a name for a new one, found the file {}",
        output.display()
    );
    takes_files(output)
}

/// Makes sure that temporary files can be made, before any work.
///
/// # Errors
/// When not, with the folder's name and what named it.
fn has_temporary_folder() -> anyhow::Result<()> {
    let folder = std::env::temp_dir();
    if !folder.is_dir() {
        let named =
            if std::env::var_os("TMPDIR").is_some() { "TMPDIR" } else { "temporary folder" };
        let what = if folder.exists() { "not a folder" } else { "not there" };
        return Err(
            MachineLacks(format!("{named} is {}, which is {what}", folder.display())).into()
        );
    }
    takes_files(&folder).map_err(|error| MachineLacks(error.to_string()).into())
}

/// Makes a folder where there is none, and a file in it that goes away again.
fn takes_files(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)
        .and_then(|()| tempfile::Builder::new().prefix(".umbra-").tempfile_in(folder))
        .map_err(|error| {
            // The name of the file that could not be made helps nobody.
            let words = io_words(&error);
            let words = words.split(" at path ").next().unwrap_or_default();
            let said = format!("cannot write to {}: {words}", folder.display());
            if machine_lacks_kind(error.kind()) {
                MachineLacks(said).into()
            } else {
                anyhow::Error::msg(said)
            }
        })?;
    Ok(())
}

/// An error of the machine, not of the command line.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct MachineLacks(String);

fn run(command: Command, root: Option<&Path>) -> anyhow::Result<u8> {
    if command.needs_temporary_folder() {
        has_temporary_folder()?;
    }
    match command {
        Command::Check(arguments) => check::check(&arguments, root),
        Command::Grade(arguments) => grade::grade(&arguments, root),
        Command::Merge(arguments) => merge::merge(&arguments, root),
        Command::Override(arguments) => decide::override_part(&arguments),
        Command::Confirm(arguments) => decide::confirm(&arguments),
        Command::Mend(arguments) => mend::run(&arguments, root),
        Command::Defend(arguments) => defend::run(&arguments, root),
        Command::Release(arguments) => release::run(&arguments, root),
        Command::Regrade(arguments) => regrade::regrade(&arguments, root),
        Command::Status(arguments) => decide::status(&arguments),
        Command::Export(arguments) => export::export(&arguments),
        Command::Similarity(arguments) => similarity::run(&arguments, root),
        Command::GradescopePack(arguments) => gradescope_pack::run(&arguments, root),
        Command::Validate(arguments) => tree::validate(&arguments, root),
        Command::Pack(arguments) => tree::pack(&arguments, root),
        Command::Render(arguments) => render::run(&arguments, root),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Watch(arguments) => watch::run(&arguments, root),
        Command::View(arguments) => view::run(&arguments),
        Command::Explain(arguments) => explain::run(&arguments, root),
        #[cfg(target_os = "linux")]
        Command::Doctor => doctor::run(),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "umbra", &mut script);
            print_as_is!("{}", String::from_utf8_lossy(&script));
            Ok(EXIT_OK)
        }
        Command::Bless(arguments) => bless::run(&arguments, root),
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    #[test]
    fn known_help() {
        let mut umbra = Arguments::command().term_width(100);
        umbra.build();
        let mut all = umbra.render_help().to_string();
        for command in umbra.get_subcommands_mut().filter(|command| command.get_name() != "help") {
            let help = command.render_long_help();
            all.push_str(&format!("\n---- {}\n{help}", command.get_name()));
        }
        // Where there is no sandbox there is no `doctor`.
        if cfg!(target_os = "linux") {
            insta::assert_snapshot!("help", all);
        }
    }

    #[test]
    fn old_spellings_are_understood() {
        for line in [
            "umbra grade in --perturb off",      // an old spelling
            "umbra gradescope-pack --perturb 7", // an old spelling
            "umbra likeness --output out",       // an old spelling
        ] {
            let parsed = Arguments::try_parse_from(line.split(' '));
            assert!(parsed.is_ok(), "{line}");
        }
    }

    #[test]
    fn help_is_as_wide_as_the_terminal() {
        let text = "Usage: umbra\n\n          one two three four five six\n";
        let expected = "Usage: umbra\n\n          one two three four\n          five six\n";
        assert_eq!(wrapped(text, 30), expected);
        let mut grade = Arguments::command().find_subcommand("grade").unwrap().clone();
        for width in [40, 80, 100] {
            let help = wrapped(&grade.render_long_help().to_string(), width);
            let widest = help.lines().map(|line| line.chars().count()).max();
            assert!(widest <= Some(width), "{help}");
        }
    }

    #[test]
    fn errors_are_told_once_and_without_numbers() {
        use anyhow::Context as _;
        let missing = || io::Error::from_raw_os_error(2);
        let error = Err::<(), _>(missing()).context("cannot read a").unwrap_err();
        assert_eq!(told_once(&error), "cannot read a: there is no such file or folder");
        let error = Err::<(), _>(missing()).with_context(|| format!("a: {}", missing()));
        assert_eq!(told_once(&error.unwrap_err()), "a: there is no such file or folder");
        let error = anyhow::anyhow!("a.toml:2: x (os error 2)").context("b (os error 13) c");
        assert_eq!(told_once(&error), "b c: a.toml:2: x");
        assert_eq!(io_words(&io::Error::other("disk (os error 5)")), "disk");
    }

    #[test]
    fn what_the_machine_lacks_is_told_from_what_the_user_said() {
        use anyhow::Context as _;
        let of =
            |error: io::Error| Err::<(), _>(error).context("cannot keep a record").unwrap_err();
        // ENOSPC, EDQUOT, EMFILE, ENFILE, ENOMEM, EROFS.
        for code in [28, 122, 24, 23, 12, 30] {
            assert!(machine_lacks(&of(io::Error::from_raw_os_error(code))), "{code}");
        }
        for code in [2, 13] {
            assert!(!machine_lacks(&of(io::Error::from_raw_os_error(code))), "{code}");
        }
        assert!(machine_lacks(&MachineLacks("an adapter".into()).into()));
    }

    #[test]
    fn an_output_that_cannot_be_written_is_named() {
        let place = tempfile::tempdir().unwrap();
        writable(&place.path().join("new/folder")).unwrap();
        std::fs::write(place.path().join("file"), "").unwrap();
        let error = writable(&place.path().join("file/report")).unwrap_err();
        // The name cannot be one of a folder: no matter of the machine's.
        assert!(error.to_string().contains("file/report") && !machine_lacks(&error), "{error}");
        assert_eq!(place.path().join("new/folder").read_dir().unwrap().count(), 0);
    }
}
