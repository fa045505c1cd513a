//! Mistakes of sampler, loop and camera, and right variants of the order of work: the loop of `crate::renderer`, with
//! switches.

use std::sync::Mutex;

use basecode::{
    Camera, CameraConfig, Film, Integrator, Ray, RenderJob, Result, Sampler, Scene, Vec3,
};

use super::samples::Samples;
use super::{Mistake as M, Mistakes, film};

pub fn render(
    mistakes: &Mistakes,
    scene: &Scene,
    integrator: &dyn Integrator,
    job: &RenderJob,
    film: &mut Film,
) -> Result<()> {
    let has = |mistake| mistakes.has(mistake);
    let eye = Eye::new(mistakes, scene, job)?;
    let seed = if has(M::SeedIgnored) { 0 } else { job.seed };
    let shared = Sampler::new(seed);
    let work = Work { mistakes, scene, integrator, job, eye, seed };
    let row = |y: usize, row: &mut [Vec3]| {
        let row_seed = if has(M::SameSeed) { 0 } else { y as u64 };
        let own = Sampler::new(seed.wrapping_add(row_seed));
        let sampler = if has(M::SharedSampler) { &shared } else { &own };
        let whole = |size: usize| size / 20 * 20;
        let mut before = Vec3::ZERO;
        for (x, pixel) in row.iter_mut().enumerate() {
            if has(M::WholeEightsOnly) && x >= job.width / 8 * 8 {
                continue;
            }
            if has(M::WholeTilesOnly) && (x >= whole(job.width) || y >= whole(job.height)) {
                continue;
            }
            *pixel = work.pixel(x, y, sampler);
            if has(M::SumGoesOn) {
                *pixel += before;
                before = *pixel;
            }
        }
    };
    if has(M::OwnThreads) {
        by_own_threads(job, film, &row);
    } else if has(M::Tiles) || has(M::ColumnOrder) {
        in_other_order(&work, film);
    } else {
        job.for_each_row(film, &row)?;
    }
    film::spoil(mistakes, film);
    Ok(())
}

/// Every thread takes a band of rows; none waits for another.
fn by_own_threads(job: &RenderJob, film: &mut Film, row: &(dyn Fn(usize, &mut [Vec3]) + Sync)) {
    let (width, height) = (film.width(), film.height());
    let band = height.div_ceil(job.threads.max(1));
    std::thread::scope(|scope| {
        for (index, rows) in film.pixels_mut().chunks_mut(width * band).enumerate() {
            scope.spawn(move || {
                for (y, pixels) in rows.chunks_mut(width).enumerate() {
                    row(index * band + y, pixels);
                }
            });
        }
    });
}

/// Pixel by pixel in tiles or columns, each pixel with a sampler of its own.
fn in_other_order(work: &Work, film: &mut Film) {
    let (width, height) = (film.width(), film.height());
    let side = if work.mistakes.has(M::Tiles) { 16 } else { 1 };
    let tall = if work.mistakes.has(M::Tiles) { 16 } else { height };
    let columns = (0..width).step_by(side);
    let tiles: Vec<(usize, usize)> =
        columns.flat_map(|x| (0..height).step_by(tall).map(move |y| (x, y))).collect();
    let film = Mutex::new(film);
    let next = std::sync::atomic::AtomicUsize::new(0);
    let take = || {
        while let Some((left, top)) =
            tiles.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed))
        {
            for y in *top..(top + tall).min(height) {
                for x in *left..(left + side).min(width) {
                    let sampler = Sampler::new(work.pixel_seed(x, y));
                    let value = work.pixel(x, y, &sampler);
                    if let Ok(mut film) = film.lock() {
                        film.set(x, y, value);
                    }
                }
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..work.job.threads.max(1) {
            scope.spawn(take);
        }
    });
}

/// What it takes to render a pixel.
struct Work<'a> {
    mistakes: &'a Mistakes,
    scene: &'a Scene,
    integrator: &'a dyn Integrator,
    job: &'a RenderJob<'a>,
    eye: Eye,
    seed: u64,
}

impl Work<'_> {
    fn pixel_seed(&self, x: usize, y: usize) -> u64 {
        self.seed.wrapping_add(((y as u64) << 32) + x as u64)
    }

    fn pixel(&self, x: usize, y: usize, sampler: &Sampler) -> Vec3 {
        let has = |mistake| self.mistakes.has(mistake);
        let own = has(M::SeedPerPixel).then(|| Sampler::new(self.pixel_seed(x, y)));
        let sampler = own.as_ref().unwrap_or(sampler);
        let (mut sum, mut counted, mut last) = (Vec3::ZERO, 0, Vec3::ZERO);
        let (mut wide, mut mean) = (Vec3::ZERO.as_dvec3(), Vec3::ZERO);
        let asked = self.job.spp;
        let spp = match () {
            () if has(M::FewerSamples) => (asked / 4).max(1),
            () if has(M::OneSample) => 1,
            () => asked,
        };
        let samples = Samples::new(self.mistakes, sampler, asked);
        let late = (usize::from(has(M::ColumnLate)), usize::from(has(M::RowLate)));
        for index in 0..spp {
            let (jx, jy) = samples.get(index);
            let ray = self.eye.ray((x + late.0) as f32 + jx, (y + late.1) as f32 + jy);
            let mut radiance = self.integrator.radiance(self.scene, &ray, sampler);
            if has(M::SamplesClamped) {
                radiance = radiance.min(Vec3::ONE);
            }
            sum += radiance;
            wide += radiance.as_dvec3();
            mean += (radiance - mean) / (index + 1) as f32;
            last = radiance;
            counted += u32::from(!has(M::BlackNotCounted) || radiance != Vec3::ZERO);
        }
        match () {
            () if has(M::NotAveraged) => sum,
            () if has(M::SppPlusOne) => sum / (counted + 1) as f32,
            () if has(M::LastOverSpp) => last / counted as f32,
            () if has(M::SumInF64) => (wide / f64::from(counted)).as_vec3(),
            () if has(M::RunningMean) => mean,
            () => sum / counted.max(1) as f32,
        }
    }
}

/// The camera, with what is wrong about it.
struct Eye {
    camera: Camera,
    /// What a column counts: 1 but for a camera of another film.
    column: f32,
}

impl Eye {
    fn new(mistakes: &Mistakes, scene: &Scene, job: &RenderJob) -> Result<Self> {
        let right = scene.camera(job.width, job.height)?;
        let config = *right.config();
        let of_tangent =
            |tangent: f32| CameraConfig { fov_y_deg: 2.0 * tangent.atan().to_degrees(), ..config };
        let tangent = (0.5 * config.fov_y_deg.to_radians()).tan();
        if mistakes.has(M::SquareAspect) {
            // The film is taken for a square one.
            let camera = Camera::new(config, job.height, job.height)?;
            return Ok(Self { camera, column: job.height as f32 / job.width as f32 });
        }
        if mistakes.has(M::CameraSides) {
            return Ok(Self { camera: scene.camera(job.height, job.width)?, column: 1.0 });
        }
        let config = match () {
            // The angle is taken across the film's width.
            () if mistakes.has(M::HorizontalFov) => {
                of_tangent(tangent * job.height as f32 / job.width as f32)
            }
            // The angle is taken for half of it.
            () if mistakes.has(M::FovHalf) => of_tangent(config.fov_y_deg.to_radians().tan()),
            () => return Ok(Self { camera: right, column: 1.0 }),
        };
        Ok(Self { camera: Camera::new(config, job.width, job.height)?, column: 1.0 })
    }

    fn ray(&self, x: f32, y: f32) -> Ray {
        self.camera.ray(self.column * x, y)
    }
}
