//! Assignment 2: one file for surfaces, one for rays, two for triangles.

mod cube_map;
mod raster;
mod rays;
mod surface;

use basecode::gpu::{Gpu, RenderPass};
use basecode::{
    Bsdf, Error, Film, Integrator, Material, RenderJob, Renderer, Result, Scene, ShadingKind, export_renderer,
};

struct Assignment2;

impl Renderer for Assignment2 {
    fn new(_: &str) -> Result<Self> {
        Ok(Assignment2)
    }

    fn bsdf(&self, material: &Material) -> Box<dyn Bsdf> {
        Box::new(surface::Surface::new(material))
    }

    fn integrator(&self, kind: ShadingKind, shadows: bool) -> Result<Box<dyn Integrator>> {
        if kind == ShadingKind::Normal {
            return Err(Error::Argument("normals were assignment 1".into()));
        }
        Ok(Box::new(rays::Direct { shadows }))
    }

    fn render(
        &self,
        scene: &Scene,
        integrator: &dyn Integrator,
        job: &RenderJob,
        film: &mut Film,
    ) -> Result<()> {
        rays::render(scene, integrator, job, film)
    }

    fn render_pass(
        &self,
        kind: ShadingKind,
        gpu: &Gpu,
        scene: &Scene,
        shadow_map: bool,
    ) -> Result<Box<dyn RenderPass>> {
        if kind == ShadingKind::Normal {
            return Err(Error::Argument("normals were assignment 1".into()));
        }
        Ok(Box::new(raster::Raster::new(gpu, scene, shadow_map)?))
    }
}

export_renderer!(Assignment2, "another assignment 2", "1.0");
