//! Offline: the loop over pixels and direct light along a ray.

use basecode::{Film, Frame, Integrator, Ray, RenderJob, Result, Sampler, Scene, Vec3, vec3};

/// Every row has its own sampler; the id fills the upper digits, the row the lower ones.
pub fn render(
    scene: &Scene,
    integrator: &dyn Integrator,
    job: &RenderJob,
    film: &mut Film,
) -> Result<()> {
    let camera = scene.camera(job.width, job.height)?;
    job.for_each_row(film, &|y, row| {
        let sampler = Sampler::new(job.seed.wrapping_mul(100_000).wrapping_add(y as u64));
        let one_sample = |x: usize| {
            let (dx, dy) = match job.spp {
                1 => (0.5, 0.5),
                _ => sampler.next_2d(),
            };
            let ray = camera.ray(x as f32 + dx, y as f32 + dy);
            integrator.radiance(scene, &ray, &sampler).as_dvec3()
        };
        for (x, pixel) in row.iter_mut().enumerate() {
            let mut mean = one_sample(x);
            for done in 1..job.spp {
                // A running mean.
                mean += (one_sample(x) - mean) / (done + 1) as f64;
            }
            *pixel = mean.as_vec3();
        }
    })
}

/// Light that comes straight from the point light.
pub struct Direct {
    pub shadows: bool,
}

impl Integrator for Direct {
    fn radiance(&self, scene: &Scene, ray: &Ray, _: &Sampler) -> Vec3 {
        let Some(mut hit) = scene.intersect(ray) else { return Vec3::ZERO };
        let light = scene.first_light_position();
        let toward = light.as_dvec3() - hit.p.as_dvec3();
        let frame = frame_on(hit.frame_ns.n);
        hit.frame_ns = frame;
        hit.wo = frame.to_local(-ray.direction);
        hit.wi = frame.to_local(toward.normalize().as_vec3());
        let reflected = scene.bsdf(&hit).eval(&hit);
        if reflected == Vec3::ZERO || (self.shadows && !sees(scene, hit.p, light)) {
            return Vec3::ZERO;
        }
        let arriving = scene.first_light_intensity().as_dvec3() / toward.length_squared();
        (arriving * reflected.as_dvec3()).as_vec3()
    }
}

/// My own tangents: across the world axis that the normal is farthest from.
fn frame_on(n: Vec3) -> Frame {
    let a = n.abs();
    let axis = if a.x <= a.y && a.x <= a.z {
        vec3(1.0, 0.0, 0.0)
    } else if a.y <= a.z {
        vec3(0.0, 1.0, 0.0)
    } else {
        vec3(0.0, 0.0, 1.0)
    };
    let t = n.cross(axis).normalize();
    Frame { s: t.cross(n), t, n }
}

/// Follows a ray from `from` until it meets something that is no lamp, or reaches `to`.
fn sees(scene: &Scene, from: Vec3, to: Vec3) -> bool {
    let distance = from.distance(to);
    let direction = (to - from) / distance;
    let mut start = Ray::EPSILON;
    while let Some(met) =
        scene.intersect(&Ray::segment(from, direction, start, distance - Ray::EPSILON))
    {
        if !scene.material_of(met.shape).is_emitter() {
            return false;
        }
        start = met.t + Ray::EPSILON;
    }
    true
}
