//! The render loop.

use basecode::{Film, Integrator, RenderJob, Result, Sampler, Scene, Vec3};

/// Averages `job.spp` samples in each pixel: at 1 its centre, otherwise uniform over the pixel.
pub fn render(
    scene: &Scene,
    integrator: &dyn Integrator,
    job: &RenderJob,
    film: &mut Film,
) -> Result<()> {
    let camera = scene.camera(job.width, job.height)?;
    // TODO(A2) before you start: all threads share this sampler, so the image changes from run to
    // run. Give every row a sampler of its own, seeded with `job.seed` plus the row.
    let sampler = Sampler::new(job.seed);
    job.for_each_row(film, &|y, row| {
        for (x, pixel) in row.iter_mut().enumerate() {
            let mut sum = Vec3::ZERO;
            for _ in 0..job.spp {
                let (jx, jy) = if job.spp == 1 { (0.5, 0.5) } else { sampler.next_2d() };
                let ray = camera.ray(x as f32 + jx, y as f32 + jy);
                sum += integrator.radiance(scene, &ray, &sampler);
            }
            *pixel = sum / job.spp as f32;
        }
    })
}
