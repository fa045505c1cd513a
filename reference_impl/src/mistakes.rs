//! Known mistakes, made on purpose: `mistake=NAME` in the options of a scene, several separated by
//! commas. They prove the grader and feed the diagnosis; without one the plain renderer runs.
//!
//! The plain renderer stays plain. This module duplicates the BSDFs, the integrator and the render loop, with a switch
//! at every place where students slip, and at some where they use a right variant. A mistake of a shader replaces text
//! in one of its lines. `harness/data/mistakes.json` says for every name what it looks like and which parts it belongs
//! to.

mod bsdfs;
mod film;
mod integrator;
mod names;
mod pass;
mod phong;
mod render;
mod samples;
mod shadow;
pub mod stages;

use std::borrow::Cow;
use std::sync::OnceLock;

use basecode::gpu::Stage;
use basecode::{Bsdf, Error, Film, Integrator, Material, MaterialModel, RenderJob, Result, Scene};

pub use names::Mistake;
pub use pass::{spoil as spoil_pass, spoil_frame};

/// What was asked for: nothing, nearly always.
#[derive(Clone, Debug, Default)]
pub struct Mistakes {
    /// A bit for each: it is asked for many with every ray.
    made: [u64; Mistake::COUNT.div_ceil(64)],
    stages: Vec<&'static str>,
}

impl Mistakes {
    /// Adds a mistake by its name.
    ///
    /// # Errors
    /// When there is none of this name.
    pub fn add(&mut self, name: &str) -> Result<()> {
        let code = Mistake::WRONG.iter().chain(Mistake::RIGHT).find(|(_, known)| *known == name);
        let stage = stages::all().find(|mistake| mistake.name == name);
        if let Some((mistake, _)) = code {
            let (word, bit) = place(*mistake);
            self.made[word] |= bit;
        }
        self.stages.extend(stage.map(|mistake| mistake.name));
        if code.is_none() && stage.is_none() {
            return Err(Error::Argument(format!("unknown mistake \"{name}\"")));
        }
        Ok(())
    }

    /// Whether a mistake is to be made.
    #[inline]
    pub fn has(&self, mistake: Mistake) -> bool {
        let (word, bit) = place(mistake);
        self.made[word] & bit != 0
    }

    /// Whether nothing is wrong outside the shaders.
    fn none(&self) -> bool {
        self.made.iter().all(|word| *word == 0)
    }

    /// The text of a shader stage, with its mistakes.
    ///
    /// # Errors
    /// When a line that a mistake replaces is no longer there.
    pub fn text(&self, stage: Stage<'static>) -> Result<Cow<'static, str>> {
        stages::apply(stage.name, stage.text, &self.stages).map_err(Error::Argument)
    }

    /// The BSDF that replaces the right one, if any.
    pub fn bsdf(&self, material: &Material) -> Option<Box<dyn Bsdf>> {
        if self.none() {
            return None;
        }
        Some(match material.model {
            MaterialModel::Diffuse => Box::new(bsdfs::Diffuse::new(self, material)),
            _ => Box::new(phong::Phong::new(self, material)),
        })
    }

    /// The integrator that replaces the right one, if any.
    pub fn integrator(&self, shadows: bool) -> Option<Box<dyn Integrator>> {
        let mistaken =
            || integrator::Mistaken { mistakes: self.clone(), shadows, own_bsdfs: OnceLock::new() };
        (!self.none()).then(|| Box::new(mistaken()) as Box<dyn Integrator>)
    }

    /// Renders instead of the right loop; `None` if no mistake needs that.
    pub fn render(
        &self,
        scene: &Scene,
        integrator: &dyn Integrator,
        job: &RenderJob,
        film: &mut Film,
    ) -> Option<Result<()>> {
        (!self.none()).then(|| render::render(self, scene, integrator, job, film))
    }
}

/// Which bit of which word stands for a mistake.
const fn place(mistake: Mistake) -> (usize, u64) {
    (mistake as usize / 64, 1 << (mistake as usize % 64))
}

#[cfg(test)]
mod tests;
