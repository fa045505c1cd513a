//! Parts 1.3 and 1.4: radiance along rays of the host's choice, under witness BSDFs.
//!
//! Under a witness a right integrator answers exactly V I / r^2 w, so that a fault in a BSDF is
//! not paid twice. Only rays that hang on nothing are asked: away from every edge, both directions
//! well above the surface, the light in sight (or out of it) whatever the shadow ray's epsilon.

mod shadows;
mod unshadowed;

use basecode::{Frame, Ray, Scene, Vec3};

use super::shading::{Shading, power};
use crate::expected::{SurfaceBuffer, SurfacePoint};
use crate::imaging::reference::RegionMask;

pub use shadows::{judge_shadows, set_apart};
pub use unshadowed::{Unshadowed, judge_unshadowed, passes_unshadowed};

/// Directions closer to the surface than this cosine are left out.
const MIN_COSINE: f32 = 0.05;
/// Largest relative difference of a right answer: f32 positions and frames in any order.
pub(super) const RELATIVE: f64 = 3e-3;
/// So many of the rays may still differ: a student's own intersection code meets other triangles
/// along seams that no mask knows.
pub(super) const STRAY_FRACTION: f64 = 2e-3;
/// So many black rays are asked.
const BLACK: usize = 200;

/// The rays of one scene, and what is right along them.
#[derive(Clone, Debug, Default)]
pub struct RayBatch {
    /// The scene's name, for reports.
    pub scene: String,
    /// The rays: those that end on lit points, those that end in shadow, those that are black
    /// whatever stands in between: they meet nothing, or a surface from behind or lit from behind.
    pub rays: Vec<Ray>,
    /// The pixel of the small film that each goes through, row by row.
    pub pixels: Vec<usize>,
    /// What each lit and each shadowed ray meets.
    pub points: Vec<SurfacePoint>,
    /// How many of the rays end on lit points.
    pub lit: usize,
    /// Radiant intensity of the light [W sr^-1].
    pub intensity: Vec3,
    /// Position of the light, world space.
    pub light: Vec3,
}

impl RayBatch {
    /// Chooses the rays of a surface buffer; `mask` is that of the same film, with shadows.
    pub fn new(name: &str, scene: &Scene, surface: &SurfaceBuffer, mask: &RegionMask) -> Self {
        let (mut lit, mut dark, mut black) = (Vec::new(), Vec::new(), Vec::new());
        for (pixel, ((ray, point), &value)) in surface.pixels.iter().zip(&mask.pixels).enumerate() {
            if value & (RegionMask::EDGE | RegionMask::EMITTER) != 0 {
                continue;
            }
            let Some(point) = point else {
                black.push((pixel, *ray));
                continue;
            };
            let above = |w| Frame::cos_theta(w) > MIN_COSINE;
            let below = |w| Frame::cos_theta(w) < -MIN_COSINE;
            if below(point.wo) || below(point.wi) {
                black.push((pixel, *ray));
            }
            if above(point.wo) && above(point.wi) {
                let list = if mask.region(value).lit { &mut lit } else { &mut dark };
                list.push((pixel, (*ray, *point)));
            }
        }
        let count = lit.len();
        let (mut pixels, (mut rays, points)): (Vec<_>, (Vec<_>, Vec<_>)) =
            lit.into_iter().chain(dark).unzip();
        let step = black.len().div_ceil(BLACK).max(1);
        for (pixel, ray) in black.into_iter().step_by(step) {
            pixels.push(pixel);
            rays.push(ray);
        }
        let (intensity, light) = (scene.first_light_intensity(), scene.first_light_position());
        Self { scene: name.to_owned(), rays, pixels, points, lit: count, intensity, light }
    }

    /// The pixels of the lit and of the shadowed rays.
    pub fn met(&self) -> impl Iterator<Item = &usize> {
        self.pixels.iter().take(self.points.len())
    }

    /// Unshadowed radiance along ray `index` when the BSDF (cosine included) is `bsdf`.
    fn unshadowed(&self, index: usize, bsdf: [f64; 3]) -> [f64; 3] {
        let r = f64::from(self.points[index].distance);
        std::array::from_fn(|c| f64::from(self.intensity[c]) / (r * r) * bsdf[c])
    }

    /// Unit direction from the point of ray `index` toward the light, world space.
    fn to_light(&self, index: usize) -> Vec3 {
        (self.light - self.points[index].position) / self.points[index].distance
    }

    /// Radiance along lit ray `index` of an integrator that lights as `shading` says, under a BSDF
    /// whose value for (wi, wo) is `bsdf`.
    pub fn witnessed(
        &self,
        index: usize,
        shading: &Shading,
        bsdf: &dyn Fn(Vec3, Vec3) -> [f64; 3],
    ) -> [f64; 3] {
        let point = &self.points[index];
        let r = f64::from(point.distance);
        let wi = if shading.world_wi { self.to_light(index) } else { point.wi };
        let wi = if shading.long_wi { point.distance * wi } else { wi };
        let value = bsdf(wi, point.wo);
        let [cos_i, cos_o] = [point.wi, point.wo].map(|w| f64::from(Frame::cos_theta(w)));
        let incident = shading.factor[0]
            * r.powf(-shading.falloff)
            * power(cos_i, shading.cos_i[0] - 1.0)
            * power(cos_o, shading.cos_o[0]);
        std::array::from_fn(|c| {
            f64::from(self.intensity[c]) * incident * value[shading.channels[c]]
        })
    }
}

#[cfg(test)]
mod tests;
