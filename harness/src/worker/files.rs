//! The files of a worker, as the parent holds them.

use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

use renderer_api as api;

use super::job::Request;
use super::outcome::{Answer, Fault, Outcome, WitnessUse};
use super::policy::WorkerPolicy;
use super::table::{SLOT_BYTES, STATUS_OURS, STATUS_REJECTED, STATUS_STAGE, SlotState};
use super::wire::{ALIGN, OutputRegion, WireJob, WireRequest, WorkerFolder, take_input};
use crate::evidence::Witness;

/// The files of a worker, as the parent holds them: opened before it began, read only by plain
/// reads. (A mapping could be pulled away from under us by whoever truncates the file.)
pub(super) struct Files {
    table: File,
    output: File,
    places: Vec<OutputRegion>,
}

impl Files {
    /// Writes the requests, and makes room for the answers.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn prepare(
        dir: &Path,
        own: &WorkerPolicy,
        requests: &[&Request],
        live: bool,
    ) -> io::Result<Self> {
        let folder = WorkerFolder(dir);
        let new = |path| File::options().create_new(true).read(true).write(true).open(path);
        let (mut input, mut output) = (new(folder.input())?, new(folder.output())?);
        let (mut input_end, mut output_end) = (0, 0);
        let mut wired = Vec::new();
        for (request, scene) in requests.iter().zip(&own.scenes) {
            let (mut rest, words) = take_input(request);
            rest.scene_mut().path.clone_from(scene);
            let bytes: &[u8] = bytemuck::cast_slice(&words);
            input.write_all(bytes)?;
            let place = OutputRegion::new(output_end, request.answer_floats());
            output.write_all(&vec![UNWRITTEN; place.size])?;
            wired.push(WireRequest {
                request: rest,
                input: (input_end, bytes.len()),
                output: place,
            });
            input_end += bytes.len();
            output_end += place.size;
        }
        let mut table = new(folder.table())?;
        table.write_all(&vec![0; SLOT_BYTES * (1 + requests.len())])?;
        let places = wired.iter().map(|request| request.output).collect();
        let wired = WireJob { plugin: own.plugin.clone(), requests: wired, live };
        fs::write(folder.job(), serde_json::to_vec(&wired)?)?;
        // As root, the worker is another user; the folder above lets nobody else in.
        #[cfg(unix)]
        for path in [folder.job(), folder.input()] {
            use std::os::unix::fs::PermissionsExt;
            fs::set_permissions(path, fs::Permissions::from_mode(0o644))?;
        }
        Ok(Self { table, output, places })
    }

    /// All records; what is missing at the end of the file was not started.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn records(&mut self) -> io::Result<Vec<SlotState>> {
        let size = SLOT_BYTES * (1 + self.places.len());
        let mut bytes = read_at(&mut self.table, 0, size)?;
        bytes.resize(size, 0);
        let (records, _) = bytes.as_chunks::<SLOT_BYTES>();
        Ok(records.iter().map(SlotState::parse).collect())
    }

    /// The outcome of a request that `noted` says was answered.
    ///
    /// # Errors
    /// When it was not answered, or the answer cannot be read.
    pub fn outcome(
        &mut self,
        index: usize,
        request: &Request,
        noted: &SlotState,
    ) -> io::Result<Outcome> {
        let SlotState::Answered { status, message, seconds, calls, worst_norm_error, footprint } =
            noted
        else {
            return Err(io::Error::other("only an answer becomes an outcome"));
        };
        let message = message.clone();
        Ok(match *status {
            api::STATUS_OK => {
                let place = self.places[index];
                let bytes = read_at(&mut self.output, place.start as u64, place.size)?;
                let Some(values) = values(&bytes, place) else {
                    let message = "the plugin wrote before the start of its output buffer, or cut \
                                   the file short";
                    return Ok(Outcome::Rejected(message.to_owned()));
                };
                let witnessed = match request {
                    Request::Radiance { witness, .. } => *witness != Witness::True,
                    _ => false,
                };
                let witness = witnessed.then_some(WitnessUse {
                    calls: *calls,
                    worst_norm_error: worst_norm_error.is_finite().then_some(*worst_norm_error),
                });
                let (footprint, seconds) = (*footprint, *seconds);
                Outcome::Done(Answer { values, witness, footprint, seconds, adapter: message })
            }
            api::STATUS_ERROR => Outcome::Failed(message),
            api::STATUS_NOT_IMPLEMENTED => Outcome::NotImplemented(message),
            api::STATUS_PANICKED => Outcome::Panicked(message),
            api::STATUS_CANCELLED => Outcome::Failed(format!(
                "the plugin says it was asked to stop, but it was not: {message}"
            )),
            api::STATUS_NO_ADAPTER => Outcome::NoAdapter(message),
            STATUS_REJECTED => Outcome::Rejected(message),
            STATUS_STAGE => Outcome::StageRefused(message),
            STATUS_OURS => Outcome::NotRun { reason: message, fault: Fault::Internal },
            unknown => Outcome::Failed(format!("unknown status {unknown}: {message}")),
        })
    }
}

/// Reads up to `size` bytes, fewer where the file ends.
fn read_at(file: &mut File, start: u64, size: usize) -> io::Result<Vec<u8>> {
    file.seek(SeekFrom::Start(start))?;
    let mut bytes = Vec::with_capacity(size);
    file.take(size as u64).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Each byte of an output before it is written: floats that nobody wrote are not numbers.
const UNWRITTEN: u8 = 0xff;
/// What lies before an answer: less than the multiple that its region is rounded up to.
static FILLER: [u8; ALIGN] = [UNWRITTEN; ALIGN];

/// The floats of a region; none when its size or its filler is not as the parent left it.
fn values(region: &[u8], place: OutputRegion) -> Option<Vec<f32>> {
    if region.len() != place.size {
        return None;
    }
    let (filler, answer) = region.split_at(place.offset());
    let untouched = filler == &FILLER[..filler.len()];
    untouched.then(|| bytemuck::pod_collect_to_vec(answer))
}
