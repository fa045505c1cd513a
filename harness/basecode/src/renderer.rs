//! The traits that a renderer's author implements.

use glam::Vec3;
use rayon::prelude::*;

use crate::gpu::{Gpu, RenderPass};
use crate::{Bsdf, Error, Film, Material, Ray, Result, Sampler, Scene, ShadingKind};

/// A renderer: what [`crate::export_renderer!`] turns into a plugin.
///
/// # Who calls, and when
/// The host loads a scene, which asks for a [`Bsdf`] for each material, once; then any of the
/// other methods, in any order and any number of times, from one thread. What the methods hand
/// out is called from several threads where its trait says `Sync`.
pub trait Renderer: Send + Sync {
    /// Makes the renderer. `options` is empty, except for the reference renderer.
    ///
    /// # Errors
    /// When the renderer refuses the options.
    fn new(options: &str) -> Result<Self>
    where
        Self: Sized;

    /// The BSDF of a material, mirrors excepted.
    fn bsdf(&self, material: &Material) -> Box<dyn Bsdf>;

    /// The integrator that draws a scene of this kind. `shadows`: whether blockers cast any.
    ///
    /// # Errors
    /// When the renderer has no such integrator.
    fn integrator(&self, kind: ShadingKind, shadows: bool) -> Result<Box<dyn Integrator>>;

    /// Renders `job` into `film`, which has the job's size: the render loop.
    ///
    /// # Errors
    /// When the image cannot be rendered; [`RenderJob::for_each_row`] reports cancellation.
    fn render(
        &self,
        scene: &Scene,
        integrator: &dyn Integrator,
        job: &RenderJob,
        film: &mut Film,
    ) -> Result<()>;

    /// The realtime pass that draws a scene of this kind. `shadow_map`: whether to draw shadows
    /// (the bonus).
    ///
    /// # Errors
    /// When the renderer has no such pass, or the graphics library refuses it.
    fn render_pass(
        &self,
        kind: ShadingKind,
        gpu: &Gpu,
        scene: &Scene,
        shadow_map: bool,
    ) -> Result<Box<dyn RenderPass>>;
}

/// Computes the radiance along camera rays.
pub trait Integrator: Send + Sync {
    /// The radiance L that arrives at the origin of `ray` [W m^-2 sr^-1]; black where it hits nothing.
    fn radiance(&self, scene: &Scene, ray: &Ray, sampler: &Sampler) -> Vec3;

    /// The radiance along each of eight rays; black where there is no ray. The default calls
    /// [`Integrator::radiance`]. Integrators that cast several rays at once override it: see
    /// [`Scene::intersect_eight`].
    fn radiance_of_eight(
        &self,
        scene: &Scene,
        rays: &[Option<Ray>; 8],
        sampler: &Sampler,
    ) -> [Vec3; 8] {
        let radiance = |ray| self.radiance(scene, ray, sampler);
        std::array::from_fn(|i| rays[i].as_ref().map_or(Vec3::ZERO, radiance))
    }
}

/// What to render offline.
pub struct RenderJob<'a> {
    /// Film width in pixels.
    pub width: usize,
    /// Film height in pixels.
    pub height: usize,
    /// Samples per pixel. At 1, the sample is the pixel's center.
    pub spp: usize,
    /// Seed of the samplers: the student number in a submission's own images.
    pub seed: u64,
    /// Number of threads to render with, at least 1.
    pub threads: usize,
    /// Told finished and total rows now and then, from any thread.
    pub progress: &'a (dyn Fn(usize, usize) + Sync),
    /// Returns true when rendering should stop early; asked from any thread.
    pub cancelled: &'a (dyn Fn() -> bool + Sync),
}

impl RenderJob<'_> {
    /// Calls `render_row(y, row)` for each row of the film, on the job's threads, in any order.
    /// `row` holds the pixels of row `y`, left to right.
    ///
    /// # Errors
    /// When the job is cancelled before all rows are rendered, or no thread can be started.
    ///
    /// # Panics
    /// When `render_row` does: its panic is passed on.
    pub fn for_each_row(
        &self,
        film: &mut Film,
        render_row: &(dyn Fn(usize, &mut [Vec3]) + Sync),
    ) -> Result<()> {
        let (width, height) = (film.width(), film.height());
        let done = std::sync::atomic::AtomicUsize::new(0);
        let one = |(y, row): (usize, &mut [Vec3])| {
            if (self.cancelled)() {
                return Err(Error::Cancelled);
            }
            render_row(y, row);
            let finished = 1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            (self.progress)(finished, height);
            Ok(())
        };
        if self.threads <= 1 {
            return film.pixels_mut().chunks_mut(width).enumerate().try_for_each(one);
        }
        let pool =
            rayon::ThreadPoolBuilder::new().num_threads(self.threads).build().map_err(|error| {
                Error::Argument(format!("cannot start {} threads: {error}", self.threads))
            })?;
        // Bottom up, even where one thread gets to do all: rows that depend on their order show it.
        pool.install(|| film.pixels_mut().par_chunks_mut(width).enumerate().rev().try_for_each(one))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn several_threads_never_go_through_the_rows_from_the_top() {
        for _ in 0..50 {
            let mut pixels = [Vec3::ZERO; 16];
            let mut film = Film::new(1, &mut pixels);
            let begun = Mutex::new(Vec::new());
            let job = RenderJob {
                width: 1,
                height: 16,
                spp: 1,
                seed: 0,
                threads: 2,
                progress: &|_, _| {},
                cancelled: &|| false,
            };
            job.for_each_row(&mut film, &|y, _| begun.lock().expect("no panic").push(y))
                .expect("not cancelled");
            let mut rows = begun.into_inner().expect("no panic");
            assert_ne!(rows, (0..16).collect::<Vec<_>>());
            rows.sort_unstable();
            assert_eq!(rows, (0..16).collect::<Vec<_>>());
        }
    }
}
