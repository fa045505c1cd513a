//! Mistakes of sampler, loop, camera and film: the loop of `crate::renderer`, with switches.

use basecode::{Camera, CameraConfig, Film, Integrator, RenderJob, Result, Sampler, Scene, Vec3};

use super::{Mistake as M, Mistakes};

pub fn render(
    mistakes: &Mistakes,
    scene: &Scene,
    integrator: &dyn Integrator,
    job: &RenderJob,
    film: &mut Film,
) -> Result<()> {
    let has = |mistake| mistakes.has(mistake);
    let camera = camera(mistakes, scene, job)?;
    let shared = Sampler::new(job.seed);
    job.for_each_row(film, &|y, row| {
        let row_seed = if has(M::SameSeed) { 0 } else { y as u64 };
        let own = Sampler::new(job.seed.wrapping_add(row_seed));
        let sampler = if has(M::SharedSampler) { &shared } else { &own };
        for (x, pixel) in row.iter_mut().enumerate() {
            let (mut sum, mut counted) = (Vec3::ZERO, 0);
            let spp = if has(M::FewerSamples) { (job.spp / 4).max(1) } else { job.spp };
            for _ in 0..spp {
                let (jx, jy) = match job.spp {
                    1 if has(M::PixelCorner) => (0.0, 0.0),
                    1 => (0.5, 0.5),
                    _ => sampler.next_2d(),
                };
                let shift = if has(M::JitterShifted) && job.spp > 1 { 0.5 } else { 0.0 };
                let ray = camera.ray(x as f32 + jx - shift, y as f32 + jy - shift);
                let radiance = integrator.radiance(scene, &ray, sampler);
                sum += radiance;
                counted += u32::from(!has(M::BlackNotCounted) || radiance != Vec3::ZERO);
            }
            *pixel = if has(M::NotAveraged) { sum } else { sum / counted.max(1) as f32 };
        }
    })?;
    spoil(mistakes, film);
    Ok(())
}

fn camera(mistakes: &Mistakes, scene: &Scene, job: &RenderJob) -> Result<Camera> {
    let right = scene.camera(job.width, job.height)?;
    if !mistakes.has(M::HorizontalFov) {
        return Ok(right);
    }
    // The angle is taken across the film's width.
    let config = right.config();
    let tangent = (0.5 * config.fov_y_deg.to_radians()).tan();
    let fov_y_deg = 2.0 * (tangent * job.height as f32 / job.width as f32).atan().to_degrees();
    Camera::new(CameraConfig { fov_y_deg, ..*config }, job.width, job.height)
}

/// What goes wrong between the pixels and the image.
fn spoil(mistakes: &Mistakes, film: &mut Film) {
    let (width, height) = (film.width(), film.height());
    let pixels = film.pixels_mut();
    if mistakes.has(M::FlippedRows) {
        let original = pixels.to_vec();
        for (row, from) in pixels.chunks_mut(width).zip(original.chunks(width).rev()) {
            row.copy_from_slice(from);
        }
    }
    if mistakes.has(M::MirroredColumns) {
        pixels.chunks_mut(width).for_each(<[Vec3]>::reverse);
    }
    if mistakes.has(M::Transposed) {
        let original = pixels.to_vec();
        for (index, pixel) in original.into_iter().enumerate() {
            pixels[(index % width) * height + index / width] = pixel;
        }
    }
    if mistakes.has(M::Gamma) {
        pixels.iter_mut().for_each(|pixel| *pixel = pixel.powf(1.0 / 2.2));
    }
    if mistakes.has(M::Clamped) {
        pixels.iter_mut().for_each(|pixel| *pixel = pixel.clamp(Vec3::ZERO, Vec3::ONE));
    }
    if mistakes.has(M::LastPixelMissing)
        && let Some(last) = pixels.last_mut()
    {
        *last = Vec3::NAN;
    }
    if mistakes.has(M::DebugMark) {
        for index in [0, 1, width, width + 1] {
            pixels[index] *= 1.1;
        }
    }
    if mistakes.has(M::Dithered) {
        const HALF_LEVEL: f32 = 0.5 / 65535.0;
        for (index, pixel) in pixels.iter_mut().enumerate() {
            *pixel += if index % 2 == 0 { HALF_LEVEL } else { -HALF_LEVEL };
        }
    }
}
