//! `umbra validate` and `umbra pack`: a submission's tree, without running anything of it.

use std::path::{Path, PathBuf};

use anyhow::bail;

use super::context::Context;
use crate::intake::{self, IntakeError, Severity};

/// Options of `umbra validate`.
#[derive(clap::Args)]
pub struct ValidateArguments {
    /// The archive or folder
    archive: PathBuf,
    /// Repack a nearly conforming submission (wrong level, other names, junk) into a conforming archive
    #[arg(long, value_name = "OUT.zip")]
    fix: Option<PathBuf>,
}

/// Options of `umbra pack`.
#[derive(clap::Args)]
pub struct PackArguments {
    /// The working folder: config.json, src/, offline/, realtime/
    folder: PathBuf,
    /// Where to write the archive: a file or a folder [default: the current folder]
    #[arg(long, short, value_name = "OUT")]
    output: Option<PathBuf>,
}

/// Prints the expected tree beside the found one; exit 0 when it conforms, 1 when not.
pub fn validate(arguments: &ValidateArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let context = Context::new(root)?;
    let (tree, limits) = (&context.assignment.tree, &context.assignment.limits.archive);
    let private = tempfile::tempdir_in(&context.supervisor.scratch)?;
    let copy = private.path().join("copy");
    std::fs::create_dir(&copy)?;
    let decoder = context.decoder();
    let received = decoder.receive(&arguments.archive, &copy, tree, limits);
    let (validation, hand_in) = match received {
        Ok(received) => {
            let images = decoder.image_findings(&received.hand_in, tree)?;
            (received.validation.with(images), Ok(received.hand_in))
        }
        Err(IntakeError::Refused(refusal)) => {
            (intake::validate_refusal(&refusal), Err(IntakeError::Refused(refusal)))
        }
        Err(error) => bail!(error),
    };
    print!("{}", validation.to_text());
    if let Some(out) = &arguments.fix {
        let packed = intake::fix(&hand_in?, out, tree, limits)?;
        for (from, to) in packed.files.iter().filter(|(from, to)| from != to) {
            println!("moved {from} to {to}");
        }
        println!("repacked as {}", packed.archive.display());
    }
    Ok(if validation.conforms { super::EXIT_OK } else { super::EXIT_NOT_IN_ORDER })
}

/// Writes a conforming archive; exit 1 when the folder lacks something.
pub fn pack(arguments: &PackArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let context = Context::new(root)?;
    let (tree, limits) = (&context.assignment.tree, &context.assignment.limits.archive);
    let out = arguments.output.as_deref().unwrap_or(Path::new("."));
    match intake::pack(&arguments.folder, out, tree, limits) {
        Ok(packed) => {
            // As whoever grades it will see it.
            let private = tempfile::tempdir_in(&context.supervisor.scratch)?;
            let decoder = context.decoder();
            let received = decoder.receive(&packed.archive, private.path(), tree, limits)?;
            let images = decoder.image_findings(&received.hand_in, tree)?;
            let validation = received.validation.with(images);
            for finding in validation.findings.iter().filter(|f| f.severity != Severity::Note) {
                eprintln!("umbra: {finding}");
            }
            println!("{}", packed.archive.display());
            Ok(super::EXIT_OK)
        }
        Err(IntakeError::Refused(refusal)) => {
            print!("{}", intake::validate_refusal(&refusal).to_text());
            Ok(super::EXIT_NOT_IN_ORDER)
        }
        Err(error) => bail!(error),
    }
}
