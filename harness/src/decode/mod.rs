//! Decodes untrusted bytes: archives, texts and images of a submission. Each request runs in its own child process,
//! which is Umbra itself and is confined before it touches a byte. The child sees only the one file or folder in
//! question, and can write only its answer.
//!
//! The parent reads an answer after the child has ended, and trusts no name or size in it. A child that dies is the
//! submission's fault: whatever it could not decode is refused.

mod child;
mod wire;

use std::fs::{self, File};
use std::io::{self, Read};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use basecode::exr_io::{MAX_PIXELS, MAX_SIDE};
use basecode::{Image, Vec3};
use serde::Serialize;

pub use child::child_main;

use crate::harmless::printable;
use crate::intake::{self, Finding, IntakeError, Refusal, Submission, TreeSpec, Validation};
use crate::process::{self, ChildOutcome, Confinement, Exit, ProcessLimits};
use crate::sandbox::{Bind, ChildKind, Policy, policy::JOB};
use crate::worker::Supervisor;
// Public for its fuzz target: a child may write anything.
pub use wire::{DecodeAnswer, read_answer};
use wire::{DecodeFolder, DecodeQuestion};

/// Bytes of a child's output that are kept.
const KEEP_OUTPUT: usize = 4 << 10;

/// Asks children to decode.
pub struct Decoder<'a> {
    /// Which program is Umbra, and what isolates its children.
    pub supervisor: &'a Supervisor,
    /// What each child may use.
    pub limits: &'a ProcessLimits,
    /// Ctrl-C.
    pub cancel: &'a AtomicBool,
    /// CPU seconds of all children so far.
    cpu_s: Mutex<f64>,
}

/// A submission as received: the private copy, and the findings on it.
pub struct Received {
    /// The private copy.
    pub submission: Submission,
    /// The copy beside the expected tree, and its `config.json`.
    pub validation: Validation,
    /// What its source contains that an instructor should look at.
    pub source: Vec<Finding>,
}

/// Why there is no answer.
enum NoAnswer {
    /// The bytes ended the child: the submission's matter.
    Died {
        /// How.
        how: String,
        /// Whether it ran out of time.
        late: bool,
    },
    /// The machine's matter, or Ctrl-C.
    Machine(io::Error),
}

impl From<io::Error> for NoAnswer {
    fn from(error: io::Error) -> Self {
        Self::Machine(error)
    }
}

impl<'a> Decoder<'a> {
    /// One that starts children of `supervisor`'s kind.
    pub fn new(
        supervisor: &'a Supervisor,
        limits: &'a ProcessLimits,
        cancel: &'a AtomicBool,
    ) -> Self {
        Self { supervisor, limits, cancel, cpu_s: Mutex::new(0.0) }
    }

    /// Copies the submission at `source` (archive or folder) once, without following links, into the
    /// empty folder `dest`, and looks at the copy.
    ///
    /// # Errors
    /// As [`intake::unpack`]; an archive or text that ends its decoder is refused.
    pub fn receive(
        &self,
        source: &Path,
        dest: &Path,
        tree: &TreeSpec,
        limits: &intake::ArchiveLimits,
    ) -> Result<Received, IntakeError> {
        let submission = match intake::read_archive(source, limits)? {
            // Nothing is decoded: files are copied one by one.
            None => intake::unpack(source, dest, tree, limits)?,
            Some(bytes) => {
                let name = intake::name_of(source);
                let submission = self.unpack_bytes(&bytes, &name, dest, tree, limits)?;
                intake::known(submission, dest, tree)?
            }
        };
        self.inspect(submission, tree)
    }

    /// As [`intake::unpack_bytes`], in a child.
    ///
    /// # Errors
    /// As [`intake::unpack_bytes`]; an archive that ends its decoder is refused.
    pub fn unpack_bytes(
        &self,
        bytes: &[u8],
        name: &str,
        dest: &Path,
        tree: &TreeSpec,
        limits: &intake::ArchiveLimits,
    ) -> Result<Submission, IntakeError> {
        let refused = |finding: Finding| {
            let findings = vec![finding];
            let name = printable(name);
            IntakeError::Refused(Box::new(Refusal { name, format: None, findings }))
        };
        let question = DecodeQuestion::Unpack {
            name: name.to_owned(),
            tree: tree.clone(),
            limits: limits.clone(),
        };
        let wanted = |folder: &DecodeFolder| {
            fs::write(folder.input(), bytes)?;
            Ok(Bind::new(folder.input(), DecodeFolder(Path::new(JOB)).input()))
        };
        // The names of all files, and as much content as an archive may hold.
        let most = limits.max_entries * (limits.max_path_bytes + 256);
        let most = most + (limits.max_total_mib << 20) + (1 << 20);
        match self.ask(&question, &wanted, most) {
            Ok((DecodeAnswer::Unpacked(unpacked), contents)) => {
                let copy = intake::copy_unpacked(&unpacked, &contents, dest, tree, limits)?;
                // What was left out and what was odd is known to whoever saw the archive.
                Ok(Submission { findings: unpacked.findings, ..copy })
            }
            Ok((DecodeAnswer::Refused(refusal), _)) => Err(IntakeError::Refused(Box::new(refusal))),
            Ok(_) => Err(refused(ended("it gave no answer"))),
            Err(NoAnswer::Died { how, .. }) => Err(refused(ended(&how))),
            Err(NoAnswer::Machine(error)) => {
                Err(IntakeError::Io { doing: "unpack", path: name.into(), source: error })
            }
        }
    }

    /// Validates a private copy and scans its source, in a child.
    fn inspect(&self, submission: Submission, tree: &TreeSpec) -> Result<Received, IntakeError> {
        let inside = DecodeFolder(Path::new(JOB)).input();
        let root = std::path::absolute(&submission.root)
            .map_err(|error| IntakeError::io("find", &submission.root, error))?;
        let bind = Bind::new(&root, inside);
        let question = DecodeQuestion::Inspect {
            submission: Submission { root: self.seen(&bind), ..submission.clone() },
            tree: tree.clone(),
        };
        let most = 16 << 20;
        match self.ask(&question, &|_| Ok(bind.clone()), most) {
            Ok((DecodeAnswer::Inspected { validation, source }, _)) => {
                Ok(Received { submission, validation, source })
            }
            Ok(_) => Err(refused_copy(&submission, "it gave no answer")),
            Err(NoAnswer::Died { how, .. }) => Err(refused_copy(&submission, &how)),
            Err(NoAnswer::Machine(error)) => Err(IntakeError::io("read", &submission.root, error)),
        }
    }

    /// Decodes the image in `file`, an EXR; `name` is what messages call it. The inner error says
    /// what is wrong with the image.
    ///
    /// # Errors
    /// The machine's matters and Ctrl-C.
    pub fn image(&self, file: &Path, name: &str) -> io::Result<Result<Image, String>> {
        let bind = Bind::new(std::path::absolute(file)?, DecodeFolder(Path::new(JOB)).input());
        let most = 12 * MAX_PIXELS as u64 + (1 << 20);
        let question = DecodeQuestion::Image { name: name.to_owned() };
        Ok(match self.ask(&question, &|_| Ok(bind.clone()), most) {
            Ok((DecodeAnswer::Image { width, height }, content)) => image(width, height, &content)
                .ok_or_else(|| format!("{name}: its decoder answered another size")),
            Ok((DecodeAnswer::Failed(message), _)) => Err(message),
            Ok(_) => Err(format!("{name}: its decoder gave no answer")),
            Err(NoAnswer::Died { how, .. }) => Err(format!("{name}: cannot be decoded: {how}")),
            Err(NoAnswer::Machine(error)) => return Err(error),
        })
    }

    /// Findings on the tree's images in a private copy before grading: images that are empty, cannot be decoded, or
    /// cannot be their scene's. `film` answers the width and height of the image at a place of the tree.
    ///
    /// # Errors
    /// The machine's matters and Ctrl-C.
    pub fn image_findings(
        &self,
        submission: &Submission,
        tree: &TreeSpec,
        film: &dyn Fn(&str) -> Option<[usize; 2]>,
    ) -> io::Result<Vec<Finding>> {
        let mut findings = Vec::new();
        let images = tree.files.iter().filter(|file| is_image(&file.path));
        for file in images {
            let Some(path) = tree.found_in(&submission.root, &file.path) else { continue };
            let image = self.image(&submission.root.join(path), path)?;
            findings.extend(image_finding(&submission.root, path, &image));
            findings
                .extend(image.ok().and_then(|image| impossible(path, &image, film(&file.path))));
        }
        Ok(findings)
    }

    /// CPU seconds of all children since the last call.
    pub fn take_cpu_s(&self) -> f64 {
        self.cpu_s.lock().map_or(0.0, |mut cpu_s| std::mem::take(&mut *cpu_s))
    }

    /// The path under which a child sees what a bind names.
    fn seen(&self, bind: &Bind) -> std::path::PathBuf {
        let place = if self.supervisor.isolation.mount_ns { &bind.inside } else { &bind.host };
        place.clone()
    }

    /// Runs one child to its end. `wanted` prepares what it looks at in its private folder; its
    /// answer is read up to `most` bytes.
    fn ask(
        &self,
        question: &DecodeQuestion,
        wanted: &dyn Fn(&DecodeFolder) -> io::Result<Bind>,
        most: u64,
    ) -> Result<(DecodeAnswer, Vec<u8>), NoAnswer> {
        let once = || self.ask_once(question, wanted, most);
        let late = |answer: &Result<_, NoAnswer>| match answer {
            Err(NoAnswer::Died { late, .. }) => *late,
            Err(NoAnswer::Machine(error)) => error.kind() == io::ErrorKind::TimedOut,
            Ok(_) => false,
        };
        self.supervisor.confirming_timeouts(once, late)
    }

    fn ask_once(
        &self,
        question: &DecodeQuestion,
        wanted: &dyn Fn(&DecodeFolder) -> io::Result<Bind>,
        most: u64,
    ) -> Result<(DecodeAnswer, Vec<u8>), NoAnswer> {
        let scratch = &self.supervisor.scratch;
        let private = tempfile::Builder::new().prefix("umbra-decode-").tempdir_in(scratch)?;
        let folder = DecodeFolder(private.path());
        let inside = DecodeFolder(Path::new(JOB));
        fs::create_dir(folder.scratch())?;
        let bind = wanted(&folder)?;
        write_json(&folder, &(question, self.seen(&bind)))?;
        let output = File::options().create_new(true).read(true).write(true).open(folder.output());
        let mut output = output?;
        #[cfg(unix)]
        for path in [folder.question(), folder.input()].iter().filter(|path| path.exists()) {
            use std::os::unix::fs::PermissionsExt;
            // As root, the child is another user; the folder above lets nobody else in.
            fs::set_permissions(path, fs::Permissions::from_mode(0o644))?;
        }
        let mut policy = Policy::new(ChildKind::Decode);
        policy.layers = self.supervisor.isolation;
        policy.scratch.without_mount = Some(folder.scratch());
        // Folders count as well.
        policy.scratch.files = 1 << 16;
        policy.report = Some(private.path().join("report"));
        policy.read_only.push(Bind::new(folder.question(), inside.question()));
        policy.read_only.push(bind);
        policy.read_write.push(Bind::new(folder.output(), inside.output()));
        let place = if policy.layers.mount_ns { inside.0 } else { folder.0 };
        let mut command = std::process::Command::new(&self.supervisor.umbra);
        command.arg("__decode").arg(place).current_dir(folder.scratch()).env_clear();
        command.env("LANG", "C").env("HOME", "/nonexistent");
        if cfg!(windows) {
            command.envs(std::env::var_os("SystemRoot").map(|root| ("SystemRoot", root)));
        }
        let confinement = Confinement::new(self.limits, policy);
        let ended = process::run(command, &confinement, KEEP_OUTPUT, self.cancel, &mut |_| {
            ControlFlow::Continue(())
        })?;
        if let Ok(mut cpu_s) = self.cpu_s.lock() {
            *cpu_s += ended.cpu_s;
        }
        death(&ended)?;
        let mut bytes = Vec::new();
        output.by_ref().take(most + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > most {
            return Err(died("it answered more than there can be"));
        }
        read_answer(bytes).ok_or_else(|| died("its answer makes no sense"))
    }
}

fn is_image(path: &str) -> bool {
    path.ends_with(".exr")
}

/// The finding on an image in a private copy that was not decoded.
pub fn image_finding(root: &Path, path: &str, image: &Result<Image, String>) -> Option<Finding> {
    let error = image.as_ref().err()?;
    let is_empty = root.join(path).metadata().is_ok_and(|found| found.len() == 0);
    Some(if is_empty {
        Finding::warning("image_empty", "the image is empty (0 bytes)")
            .at(path)
            .hint("render it again; a full disk leaves such files")
    } else {
        // The message begins with the path.
        let error =
            error.strip_prefix(path).map_or(error.as_str(), |rest| rest.trim_start_matches(": "));
        let message = format!("the image cannot be read: {}", printable(error));
        Finding::warning("image_unreadable", message).at(path).hint("render it again, as EXR")
    })
}

/// Radiance below this is negative: what rounding leaves is far above.
const LEAST: f32 = -1e-6;

/// How many pixels of an image are wrong, if any is.
fn wrong_pixels(image: &Image, how: &str, is: fn(&basecode::Vec3) -> bool) -> Option<String> {
    let mut wrong = image.pixels.iter().enumerate().filter(|(_, pixel)| is(pixel));
    let (first, _) = wrong.next()?;
    let (x, y) = (first % image.width, first / image.width);
    Some(match wrong.count() {
        0 => format!("a pixel of the image is {how}: that at ({x}, {y})"),
        more => format!("{} pixels of the image are {how}; first at ({x}, {y})", more + 1),
    })
}

/// The warning on an image that cannot be its scene's.
fn impossible(path: &str, image: &Image, film: Option<[usize; 2]>) -> Option<Finding> {
    let found = [image.width, image.height];
    let words = |[width, height]: [usize; 2]| format!("{width}x{height}");
    let all = |is: fn(&basecode::Vec3) -> bool| image.pixels.iter().all(is);
    let (code, message) = if let Some(film) = film.filter(|film| *film != found) {
        let (film, found) = (words(film), words(found));
        ("image_size", format!("the image is {found}, expected {film}, the film of its scene"))
    } else if all(|pixel| !pixel.is_finite()) {
        ("image_not_finite", "no pixel of the image is finite".to_owned())
    } else if all(|pixel| *pixel == basecode::Vec3::ZERO) {
        ("image_black", "every pixel of the image is black".to_owned())
    } else if let Some(found) = wrong_pixels(image, "not finite", |pixel| !pixel.is_finite()) {
        ("image_not_finite", found)
    } else if let Some(found) = wrong_pixels(image, "negative", |p| p.min_element() < LEAST) {
        ("image_negative", found)
    } else {
        return None;
    };
    Some(Finding::warning(code, message).at(path).hint("render the scene again, as its file says"))
}

fn died(how: &str) -> NoAnswer {
    NoAnswer::Died { how: how.to_owned(), late: false }
}

/// How the child died, if it did.
fn death(ended: &ChildOutcome) -> Result<(), NoAnswer> {
    let how = match ended.exit {
        Exit::Code(0) => return Ok(()),
        Exit::Cancelled => return Err(io::Error::from(io::ErrorKind::Interrupted).into()),
        exit if exit == Exit::Starved || exit.is_from_outside() => {
            return Err(process::nobodys_fault("a decoder", exit).into());
        }
        // The child itself reports that it could not work: no disk space, no memory, no isolation. Hostile bytes cannot
        // cause this exit.
        Exit::Code(code) if code == i32::from(process::EXIT_NOT_CONFINED) => {
            return Err(io::Error::other(ended.stderr.head.trim().to_owned()).into());
        }
        exit @ Exit::Code(_) => format!("its decoder {exit}: {}", ended.stderr.head),
        exit => format!("its decoder {exit}"),
    };
    Err(NoAnswer::Died { how, late: matches!(ended.exit, Exit::OutOfCpu | Exit::TimedOut) })
}

fn ended(how: &str) -> Finding {
    Finding::error("decoder_ended", format!("cannot be unpacked: {how}"))
        .hint("make the archive anew; umbra pack makes the right one from your working folder")
}

fn refused_copy(submission: &Submission, how: &str) -> IntakeError {
    let finding = Finding::error("decoder_ended", format!("its texts cannot be read: {how}"));
    let (name, format) = (submission.name.clone(), Some(submission.format));
    IntakeError::Refused(Box::new(Refusal { name, format, findings: vec![finding] }))
}

fn image(width: usize, height: usize, content: &[u8]) -> Option<Image> {
    let fits = width.max(height) <= MAX_SIDE && width * height <= MAX_PIXELS;
    if !fits || content.len() != width * height * size_of::<Vec3>() {
        return None;
    }
    Some(Image { width, height, pixels: bytemuck::pod_collect_to_vec(content) })
}

fn write_json(folder: &DecodeFolder, value: &impl Serialize) -> io::Result<()> {
    fs::write(folder.question(), serde_json::to_vec(value)?)
}

#[cfg(test)]
mod tests {
    use basecode::Vec3;

    use super::*;

    #[test]
    fn pixels_that_no_scene_has_are_warned_of() {
        let said = |pixels: [f32; 4]| {
            let pixels = pixels.map(Vec3::splat).to_vec();
            let image = Image { width: 2, height: 2, pixels };
            impossible("a.exr", &image, Some([2, 2])).map(|finding| finding.message)
        };
        assert_eq!(said([0.5, 0.0, 1e9, -1e-7]), None);
        let one = said([0.5, 0.5, f32::INFINITY, 0.5]);
        assert_eq!(one.as_deref(), Some("a pixel of the image is not finite: that at (0, 1)"));
        let all = said([-1.0; 4]);
        assert_eq!(all.as_deref(), Some("4 pixels of the image are negative; first at (0, 0)"));
        assert_eq!(said([f32::NAN; 4]).as_deref(), Some("no pixel of the image is finite"));
    }
}
