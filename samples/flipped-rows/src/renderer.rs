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
    job.for_each_row(film, &|y, row| {
        let sampler = Sampler::new(job.seed + y as u64);
        for (x, pixel) in row.iter_mut().enumerate() {
            let mut sum = Vec3::ZERO;
            for _ in 0..job.spp {
                let (jx, jy) = if job.spp == 1 { (0.5, 0.5) } else { sampler.next_2d() };
                let from_bottom = (job.height - 1 - y) as f32;
                let ray = camera.ray(x as f32 + jx, from_bottom + jy);
                sum += integrator.radiance(scene, &ray, &sampler);
            }
            *pixel = sum / job.spp as f32;
        }
    })
}
