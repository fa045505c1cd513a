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
        // A sampler for each row: threads share none, and the image does not depend on their number.
        let sampler = Sampler::new(job.seed.wrapping_add(y as u64));
        // All samples of the row, pixel by pixel, eight at a time.
        let count = row.len() * job.spp;
        row.fill(Vec3::ZERO);
        for first in (0..count).step_by(8) {
            let eight = first..count.min(first + 8);
            let mut rays = [None; 8];
            for (ray, sample) in rays.iter_mut().zip(eight.clone()) {
                let (jx, jy) = if job.spp == 1 { (0.5, 0.5) } else { sampler.next_2d() };
                *ray = Some(camera.ray((sample / job.spp) as f32 + jx, y as f32 + jy));
            }
            let radiance = integrator.radiance_of_eight(scene, &rays, &sampler);
            for (radiance, sample) in radiance.into_iter().zip(eight) {
                row[sample / job.spp] += radiance;
            }
        }
        for pixel in row {
            *pixel /= job.spp as f32;
        }
    })
}
