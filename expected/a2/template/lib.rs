//! Your renderer. README.md beside `src` says where to begin.

mod bsdfs;
mod integrators;
mod renderer;
mod renderpasses;

use basecode::gpu::{Gpu, RenderPass};
use basecode::{
    Bsdf, Film, Integrator, Material, MaterialModel, RenderJob, Renderer, Result, Scene,
    ShadingKind,
};

/// Point lights and shadows, offline and realtime.
struct Student;

impl Renderer for Student {
    fn new(_options: &str) -> Result<Self> {
        Ok(Self)
    }

    fn bsdf(&self, material: &Material) -> Box<dyn Bsdf> {
        match material.model {
            MaterialModel::Diffuse => Box::new(bsdfs::DiffuseBsdf::new(material)),
            _ => Box::new(bsdfs::PhongBsdf::new(material)),
        }
    }

    fn integrator(&self, kind: ShadingKind, shadows: bool) -> Result<Box<dyn Integrator>> {
        match kind {
            ShadingKind::Simple => Ok(Box::new(integrators::SimpleIntegrator { shadows })),
            ShadingKind::Normal => Ok(Box::new(integrators::NormalIntegrator)),
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
        kind: ShadingKind,
        gpu: &Gpu,
        scene: &Scene,
        shadow_map: bool,
    ) -> Result<Box<dyn RenderPass>> {
        match kind {
            ShadingKind::Simple => {
                Ok(Box::new(renderpasses::SimplePass::new(gpu, scene, shadow_map)?))
            }
            ShadingKind::Normal => Ok(Box::new(renderpasses::NormalPass::new(gpu, scene)?)),
        }
    }
}

basecode::export_renderer!(Student, "student template", "0.1.0");
