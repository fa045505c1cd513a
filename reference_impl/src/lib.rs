//! The reference renderer: a plugin like any other, loaded like any other.

mod bsdfs;
mod integrators;
mod mistakes;
mod renderer;
mod renderpasses;

use basecode::gpu::{Gpu, RenderPass};
use basecode::{
    Bsdf, Error, Film, Integrator, Material, MaterialModel, RenderJob, Renderer, Result, Scene,
    ShadingKind,
};

use mistakes::Mistakes;
#[doc(hidden)]
pub use mistakes::stages;

/// Point lights and shadows, offline and realtime.
#[derive(Default)]
struct Reference {
    /// Whether offline images show materials as realtime does: a texture is its average.
    realtime_materials: bool,
    /// What it gets wrong on purpose.
    mistakes: Mistakes,
}

impl Renderer for Reference {
    /// Options are words separated by commas: `materials=realtime`, `mistake=NAME`.
    fn new(options: &str) -> Result<Self> {
        let mut reference = Self::default();
        for option in options.split(',').filter(|option| !option.is_empty()) {
            match option.split_once('=') {
                Some(("materials", "realtime")) => reference.realtime_materials = true,
                Some(("mistake", name)) => reference.mistakes.add(name)?,
                _ => return Err(Error::Argument(format!("unknown option \"{option}\""))),
            }
        }
        Ok(reference)
    }

    fn bsdf(&self, material: &Material) -> Box<dyn Bsdf> {
        let averaged = self.realtime_materials.then(|| average(material));
        let material = averaged.as_ref().unwrap_or(material);
        if let Some(mistaken) = self.mistakes.bsdf(material) {
            return mistaken;
        }
        match material.model {
            MaterialModel::Diffuse => Box::new(bsdfs::DiffuseBsdf::new(material)),
            _ => Box::new(bsdfs::PhongBsdf::new(material)),
        }
    }

    fn integrator(&self, kind: ShadingKind, shadows: bool) -> Result<Box<dyn Integrator>> {
        let mistaken = self.mistakes.integrator(shadows);
        match (kind, mistaken) {
            (ShadingKind::Simple, Some(mistaken)) => Ok(mistaken),
            (ShadingKind::Simple, None) => Ok(Box::new(integrators::SimpleIntegrator {
                shadows,
                diffuse_mirrors: self.realtime_materials,
            })),
            (ShadingKind::Normal, _) => Ok(Box::new(integrators::NormalIntegrator)),
        }
    }

    fn render(
        &self,
        scene: &Scene,
        integrator: &dyn Integrator,
        job: &RenderJob,
        film: &mut Film,
    ) -> Result<()> {
        let mistaken = self.mistakes.render(scene, integrator, job, film);
        mistaken.unwrap_or_else(|| renderer::render(scene, integrator, job, film))
    }

    fn render_pass(
        &self,
        kind: ShadingKind,
        gpu: &Gpu,
        scene: &Scene,
        shadow_map: bool,
    ) -> Result<Box<dyn RenderPass>> {
        match kind {
            ShadingKind::Simple => {
                Ok(Box::new(renderpasses::SimplePass::new(gpu, scene, shadow_map, &self.mistakes)?))
            }
            ShadingKind::Normal => Ok(Box::new(renderpasses::NormalPass::new(gpu, scene)?)),
        }
    }
}

/// A material without textures: their averages, the energy scale worked in.
fn average(material: &Material) -> Material {
    let scale = material.energy_scale();
    Material {
        diffuse: (scale * material.diffuse.average()).into(),
        specular: (scale * material.specular.average()).into(),
        ..material.clone()
    }
}

basecode::export_renderer!(Reference, "reference", "0.1.0");

#[cfg(test)]
mod tests;
