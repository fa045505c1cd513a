//! The reference renderer: a plugin like any other, loaded like any other.

mod bsdfs;
mod integrators;
mod renderer;

use basecode::gpu::{Gpu, RenderPass};
use basecode::{
    Bsdf, Error, Film, Integrator, Material, MaterialModel, RenderJob, Renderer, Result, Scene,
};

/// Point lights and shadows, offline and realtime.
struct Reference;

impl Renderer for Reference {
    fn new(_options: &str) -> Result<Self> {
        Ok(Self)
    }

    fn bsdf(&self, material: &Material) -> Box<dyn Bsdf> {
        match material.model {
            MaterialModel::Diffuse => Box::new(bsdfs::DiffuseBsdf::new(material)),
            _ => Box::new(bsdfs::PhongBsdf::new(material)),
        }
    }

    fn integrator(&self, kind: &str, shadows: bool) -> Result<Box<dyn Integrator>> {
        match kind {
            "simple" | "direct" => Ok(Box::new(integrators::SimpleIntegrator { shadows })),
            "normal" => Ok(Box::new(integrators::NormalIntegrator)),
            _ => Err(Error::Argument(format!("there is no integrator \"{kind}\""))),
        }
    }

    fn render(
        &self,
        scene: &Scene,
        integrator: &dyn Integrator,
        job: &RenderJob,
        film: &mut Film,
    ) -> Result<()> {
        renderer::render(scene, integrator, job, film)
    }

    fn render_pass(
        &self,
        kind: &str,
        _gpu: &Gpu,
        _scene: &Scene,
        _shadow_map: bool,
    ) -> Result<Box<dyn RenderPass>> {
        Err(Error::Argument(format!("there is no render pass \"{kind}\"")))
    }
}

basecode::export_renderer!(Reference, "reference", "0.1.0");
