//! The child itself: the hidden command `umbra __decode DIR`.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use basecode::exr_io::read_exr;

use super::wire::{DecodeAnswer, DecodeFolder, DecodeQuestion, write_answer};
use crate::intake::{self, IntakeError, Submission};
use crate::process::{self, exit_now};

/// Confines this process, then answers the question in `dir`. Does not return when it could.
pub fn child_main(dir: &Path) -> ExitCode {
    if let Err(error) = process::confine_self().and_then(|()| answer(dir)) {
        eprintln!("umbra: the decoder cannot work: {error}");
        return ExitCode::from(process::EXIT_NOT_CONFINED);
    }
    exit_now(0)
}

fn answer(dir: &Path) -> io::Result<()> {
    let folder = DecodeFolder(dir);
    let question = std::fs::read(folder.question())?;
    let (question, about): (DecodeQuestion, PathBuf) = serde_json::from_slice(&question)?;
    let mut out = BufWriter::new(File::options().write(true).open(folder.output())?);
    match question {
        DecodeQuestion::Unpack { name, tree, limits } => {
            let bytes = std::fs::read(about)?;
            // The current folder is the scratch.
            let dest = std::env::current_dir()?;
            match intake::unpack_bytes(&bytes, &name, &dest, &tree, &limits) {
                Ok(copy) => {
                    let mut content = |out: &mut dyn Write| contents(&copy, out);
                    write_answer(&mut out, &DecodeAnswer::Unpacked(copy.clone()), &mut content)?;
                }
                Err(IntakeError::Refused(refusal)) => {
                    plain(&mut out, &DecodeAnswer::Refused(*refusal))?
                }
                Err(error) => return Err(io::Error::other(error)),
            }
        }
        DecodeQuestion::Inspect { submission, tree } => {
            let validation = intake::validate_submission(&submission, &tree);
            let source = intake::scan_source(&submission).map_err(io::Error::other)?;
            let validation = validation.map_err(io::Error::other)?;
            plain(&mut out, &DecodeAnswer::Inspected { validation, source })?;
        }
        DecodeQuestion::Image { name } => image(&about, &name, &mut out)?,
    }
    out.flush()
}

/// The files of a copy, one after the other.
fn contents(copy: &Submission, out: &mut dyn Write) -> io::Result<()> {
    for file in &copy.files {
        io::copy(&mut File::open(copy.root.join(&file.path))?, out)?;
    }
    Ok(())
}

fn image(file: &Path, name: &str, out: &mut impl Write) -> io::Result<()> {
    match read_exr(file) {
        Ok(image) => {
            let answer = DecodeAnswer::Image { width: image.width, height: image.height };
            write_answer(out, &answer, &mut |out| {
                out.write_all(bytemuck::cast_slice(&image.pixels))
            })
        }
        Err(error) => {
            let message = error.to_string().replace(&file.display().to_string(), name);
            plain(out, &DecodeAnswer::Failed(message))
        }
    }
}

/// Writes an answer that nothing follows.
fn plain(out: &mut impl Write, answer: &DecodeAnswer) -> io::Result<()> {
    write_answer(out, answer, &mut |_| Ok(()))
}
