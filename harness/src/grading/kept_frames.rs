//! Frames of Umbra's own pass that an earlier run drew: stages that did not change are not drawn again.
//!
//! No foreign code draws them, and only this process writes here. The name of a file holds all that they depend on: the
//! stages' texts, scenes, films and cameras, the program that draws, and the adapter. So whatever WGSL does to its
//! compiler can only change what is kept for the same WGSL.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use sha2::{Digest, Sha256};

use super::draw::{FrameRequest, draw_each};
use super::pipeline::Grading;
use super::session::{KeptFrames, Session};
use crate::files::{feed, hex, keep_newest, write_whole};
use crate::sandbox::Isolation;
use crate::store::scene_digest;
use crate::worker::{Adapter, Answer, Outcome, Request};

/// Number of sets of frames that are kept, of about 4 MB each; those that were not used for longest go.
const KEPT: usize = 24;

impl Grading<'_> {
    /// Keeps in a folder what Umbra's own pass draws of a submission's stages, where isolation is full: elsewhere a
    /// plugin could write there.
    pub fn keep_frames(&mut self, folder: PathBuf) {
        if self.supervisor.isolation.isolation() == Isolation::Full && !self.drawn_with.is_empty() {
            let [_, worker] = self.supervisor.programs();
            let drawn_with = self.drawn_with.clone();
            self.kept_frames = Some(KeptFrames { folder, worker, drawn_with });
        }
    }
}

/// Draws sets of frames with Umbra's own pass, all in one worker while it lives; those that are kept are not drawn.
pub fn draw_sets(session: &Session, sets: &[Vec<FrameRequest>]) -> Vec<Vec<Outcome>> {
    let (Some(kept), Ok(adapter)) = (session.kept_frames, &session.adapter) else {
        return draw_missing(session, sets.iter().collect());
    };
    // Where the program cannot be read, nothing is found and nothing kept.
    let conditions = kept.conditions().ok();
    let file = |set: &Vec<FrameRequest>| kept.file(session, adapter, set, &conditions?).ok();
    let files: Vec<Option<PathBuf>> = sets.iter().map(file).collect();
    let found = |(set, file): (&Vec<FrameRequest>, &Option<PathBuf>)| {
        let requests = set.iter().map(|frame| frame.request(session, None, adapter));
        let file = file.as_ref()?;
        let found = outcomes(&fs::read(file).ok()?, requests)?;
        // Where that cannot be noted, others go first.
        let _ = fs::File::open(file).and_then(|file| file.set_modified(SystemTime::now()));
        Some(found)
    };
    let mut all: Vec<_> = sets.iter().zip(&files).map(found).collect();
    let missing = sets.iter().zip(&all).filter(|(_, found)| found.is_none());
    let mut drawn = draw_missing(session, missing.map(|(set, _)| set).collect()).into_iter();
    for (found, file) in all.iter_mut().zip(files).filter(|(found, _)| found.is_none()) {
        let own = drawn.next().unwrap_or_default();
        // Where they cannot be kept, they are drawn again.
        let _ = file.zip(bytes(&own)).map(|(file, bytes)| keep(&kept.folder, &file, &bytes));
        *found = Some(own);
    }
    all.into_iter().flatten().collect()
}

/// Draws sets of as many frames each, scene by scene.
fn draw_missing(session: &Session, sets: Vec<&Vec<FrameRequest>>) -> Vec<Vec<Outcome>> {
    let count = sets.first().map_or(0, |set| set.len());
    let by_scene = (0..count).flat_map(|scene| sets.iter().map(move |set| set[scene].clone()));
    let outcomes = draw_each(session, None, &by_scene.collect::<Vec<_>>());
    let of_set = |set| outcomes.iter().skip(set).step_by(sets.len()).cloned().collect();
    (0..sets.len()).map(of_set).collect()
}

impl KeptFrames {
    /// The digest of what all frames depend on.
    fn conditions(&self) -> io::Result<[u8; 32]> {
        let mut hash = Sha256::new();
        feed(&mut hash, &self.worker)?;
        Ok(hash.chain_update(&self.drawn_with).finalize().into())
    }

    /// The file of some frames.
    fn file(
        &self,
        session: &Session,
        adapter: &Adapter,
        frames: &[FrameRequest],
        conditions: &[u8; 32],
    ) -> anyhow::Result<PathBuf> {
        let mut hash = Sha256::new();
        hash.update(conditions);
        for frame in frames {
            hash.update(serde_json::to_vec(&frame.request(session, None, adapter))?);
            hash.update(scene_digest(frame.toml)?);
        }
        Ok(self.folder.join(hex(&hash.finalize())))
    }
}

/// The bytes that are kept of outcomes: the digest of all floats, and the floats. `None` if one is no answer.
fn bytes(outcomes: &[Outcome]) -> Option<Vec<u8>> {
    let answers: Option<Vec<&Answer>> = outcomes.iter().map(Outcome::answer).collect();
    let floats = answers?.into_iter().flat_map(|answer| &answer.values);
    let floats: Vec<u8> = floats.flat_map(|value| value.to_le_bytes()).collect();
    Some([Sha256::digest(&floats).to_vec(), floats].concat())
}

/// The outcomes in kept bytes; `None` if they are incomplete or do not fit the requests.
fn outcomes(bytes: &[u8], requests: impl Iterator<Item = Request>) -> Option<Vec<Outcome>> {
    let (digest, floats) = bytes.split_at_checked(Sha256::output_size())?;
    if Sha256::digest(floats)[..] != *digest {
        return None;
    }
    let mut floats = floats.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
    let answers: Vec<Answer> = requests
        .map(|request| Answer {
            values: floats.by_ref().take(request.answer_floats()).collect(),
            ..Answer::default()
        })
        .collect();
    floats.next().is_none().then(|| answers.into_iter().map(Outcome::Done).collect())
}

/// Keeps a file, and no more than [`KEPT`] in `all`.
fn keep(all: &Path, file: &Path, bytes: &[u8]) -> io::Result<()> {
    write_whole(file, bytes)?;
    keep_newest(all, KEPT)
}
