//! Shaders that are compiled once and given to all workers.

use std::path::Path;

use tempfile::TempDir;

use super::draw::{self, Frame};
use super::isolate;
use super::pipeline::Grading;
use super::session::Session;
use super::stages::Stages;

impl Grading<'_> {
    /// Has the reference renderer draw once what every renderer is asked to, so that workers need not
    /// compile the same shaders again and again.
    pub(super) fn compile_shaders(&mut self) -> anyhow::Result<()> {
        let (Some(reference), Ok(_)) = (&self.reference, &self.adapter) else { return Ok(()) };
        let Some(case) = self.cases.iter().find(|case| case.bonus.is_some()) else { return Ok(()) };
        let plain = Frame::plain(case);
        let toml = case.bonus.as_deref().unwrap_or(&case.realtime);
        let mut frames = vec![plain.clone(), Frame { toml, shadow_map: true, ..plain }];
        let shown = isolate::pass_shown().into_iter();
        frames.extend(shown.map(|stages| Frame::probe(case, stages)));
        let folder = self.shaders_of(&mut self.session(""), Some(reference), frames)?;
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
    ) -> anyhow::Result<Option<TempDir>> {
        let (Some(own), Some(case)) = (stages.all_own(), self.cases.first()) else {
            return Ok(None);
        };
        let folder = self.shaders_of(session, None, vec![Frame::probe(case, own)])?;
        session.supervisor.shaders.push(folder.path().to_owned());
        Ok(Some(folder))
    }

    /// The shaders that some frames need, compiled.
    fn shaders_of(
        &self,
        session: &mut Session,
        renderer: Option<&Path>,
        frames: Vec<Frame>,
    ) -> anyhow::Result<TempDir> {
        let builder =
            tempfile::Builder::new().prefix("shaders-").tempdir_in(&self.supervisor.scratch);
        let folder = builder?;
        session.supervisor.leaves_shaders = Some(folder.path().to_owned());
        draw::compile_shaders(session, renderer, frames);
        session.supervisor.leaves_shaders = None;
        Ok(folder)
    }
}
