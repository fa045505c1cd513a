//! Shaders that are compiled once and given to all workers, of this run and of later ones.
//!
//! What is kept comes from workers that run no foreign code, and only this process writes it. Its name holds the WGSL
//! that was compiled: a submission's shaders are given to workers of submissions with the same texts alone. Mesa itself
//! looks at driver and text before it uses one.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use tempfile::TempDir;

use super::begun::{REFUSED, Say};
use super::draw::{FrameRequest, draw_each};
use super::isolate;
use super::pipeline::Grading;
use super::session::Session;
use super::stages::Stages;
use crate::files::{copy_tree, hex, keep_newest};
use crate::harmless::harmless;
use crate::sandbox::Isolation;
use crate::store::scene_digest;
use crate::worker::{Outcome, software_driver};

/// The shaders of so many are kept, less than 1 MB each; the oldest go.
const KEPT: usize = 64;

impl Grading<'_> {
    /// Has the reference renderer draw once what every renderer is asked to, so that workers need not
    /// compile the same shaders again and again.
    pub(super) fn compile_shaders(&mut self) -> anyhow::Result<()> {
        let (Some(reference), Ok(_)) = (&self.reference, &self.adapter) else { return Ok(()) };
        let Some(case) = self.cases.iter().find(|case| case.bonus.is_some()) else { return Ok(()) };
        let plain = FrameRequest::plain(case);
        let toml = case.bonus.as_deref().unwrap_or(&case.realtime);
        let mut frames = vec![plain.clone(), FrameRequest { toml, shadow_map: true, ..plain }];
        let shown = isolate::pass_shown().into_iter();
        frames.extend(shown.map(|stages| FrameRequest::probe(case, stages)));
        let folder = self.shaders_of(&mut self.session(""), Some(reference), frames, &|_| ())?;
        self.supervisor.shaders.push(folder.path().to_owned());
        self.compiled = Some(folder);
        Ok(())
    }

    /// The same for the stages of a submission, by Umbra's own pass: no foreign code runs there. They are
    /// given to the workers of `session` while the answer lives.
    pub(super) fn compile_own(
        &self,
        session: &mut Session,
        stages: &Stages,
        say: Say,
    ) -> anyhow::Result<Option<TempDir>> {
        let (Some(own), Some(case)) = (stages.all_own(), self.cases.first()) else {
            return Ok(None);
        };
        let folder = self.shaders_of(session, None, vec![FrameRequest::probe(case, own)], say)?;
        session.supervisor.shaders.push(folder.path().to_owned());
        Ok(Some(folder))
    }

    /// The shaders that some frames need, compiled now or by an earlier run. Why a frame fails is told when it counts;
    /// the compiler's first line is said at once.
    fn shaders_of(
        &self,
        session: &mut Session,
        renderer: Option<&Path>,
        mut frames: Vec<FrameRequest>,
        say: Say,
    ) -> anyhow::Result<TempDir> {
        frames.iter_mut().for_each(|frame| frame.size = (16, 16));
        let builder =
            tempfile::Builder::new().prefix("shaders-").tempdir_in(&self.supervisor.scratch);
        let folder = builder?;
        let kept = self.kept_shaders(session, renderer, &frames)?;
        if kept.as_ref().is_some_and(|kept| copy(kept, folder.path()).is_ok()) {
            return Ok(folder);
        }
        session.supervisor.leaves_shaders = Some(folder.path().to_owned());
        let drawn = draw_each(session, renderer, &frames);
        session.supervisor.leaves_shaders = None;
        let said = drawn.iter().find_map(|outcome| match outcome {
            Outcome::StageRefused(said) => said.lines().next(),
            _ => None,
        });
        if let Some(first) = said {
            say(&format!("{REFUSED}{}", harmless(first)));
        }
        if let Some(kept) = kept
            && drawn.iter().all(|outcome| matches!(outcome, Outcome::Done(_)))
        {
            // Where they cannot be kept, they are compiled again.
            let _ = keep(folder.path(), &kept);
        }
        Ok(folder)
    }

    /// Where the shaders of some frames are kept. Nowhere without full isolation: a plugin could write there.
    fn kept_shaders(
        &self,
        session: &Session,
        renderer: Option<&Path>,
        frames: &[FrameRequest],
    ) -> anyhow::Result<Option<PathBuf>> {
        let Ok(adapter) = &session.adapter else { return Ok(None) };
        if self.supervisor.isolation.isolation() != Isolation::Full {
            return Ok(None);
        }
        let mut hash = Sha256::new();
        let [_, worker] = self.supervisor.programs();
        let programs = [Some(worker), renderer.map(Path::to_owned), software_driver()];
        for program in programs.iter().flatten() {
            let meta = program.metadata()?;
            hash.update(format!("{:?} {} {:?}", program, meta.len(), meta.modified()?));
        }
        hash.update([u8::from(session.supervisor.compiles_quickly)]);
        for frame in frames {
            hash.update(serde_json::to_vec(&frame.request(session, renderer, adapter))?);
            hash.update(scene_digest(frame.toml)?);
        }
        Ok(Some(self.assignment.cache().join("shaders").join(hex(&hash.finalize()))))
    }
}

/// Keeps a copy of a folder as `kept`: whole, or not at all.
fn keep(folder: &Path, kept: &Path) -> io::Result<()> {
    let all = kept.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(all)?;
    let draft = tempfile::Builder::new().prefix("draft-").tempdir_in(all)?;
    copy(folder, draft.path())?;
    // Another process may have been faster.
    fs::rename(draft.path(), kept)?;
    // It has another name now.
    let _ = draft.keep();
    keep_newest(all, KEPT)
}

/// Copies a folder, to be read by workers: as root, they are another user.
fn copy(from: &Path, to: &Path) -> io::Result<()> {
    copy_tree(from, to)?;
    let_others_read(to)
}

fn let_others_read(path: &Path) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = if path.is_dir() { 0o755 } else { 0o644 };
        fs::set_permissions(path, fs::Permissions::from_mode(mode))?;
    }
    if path.is_dir() {
        fs::read_dir(path)?.try_for_each(|entry| let_others_read(&entry?.path()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_whole_and_for_others_to_read() {
        let place = tempfile::tempdir().unwrap();
        let (left, kept) = (place.path().join("left"), place.path().join("all/kept"));
        fs::create_dir_all(left.join("mesa/ab")).unwrap();
        fs::write(left.join("mesa/ab/cd"), "compiled").unwrap();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            for (path, mode) in [("mesa/ab/cd", 0o600), ("mesa/ab", 0o700), ("mesa", 0o700)] {
                let mode = fs::Permissions::from_mode(mode);
                fs::set_permissions(left.join(path), mode).unwrap();
            }
        }
        keep(&left, &kept).unwrap();
        // Whoever is second leaves it as it is, and leaves nothing else.
        fs::write(left.join("mesa/ab/cd"), "another").unwrap();
        keep(&left, &kept).unwrap_err();
        assert_eq!(fs::read_to_string(kept.join("mesa/ab/cd")).unwrap(), "compiled");
        assert_eq!(fs::read_dir(place.path().join("all")).unwrap().count(), 1);
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt as _;
            let mode = |path: &str| kept.join(path).metadata().unwrap().mode() & 0o777;
            assert_eq!(["", "mesa/ab", "mesa/ab/cd"].map(mode), [0o755, 0o755, 0o644]);
        }
    }
}
