//! Parts 1.3 and 1.4: radiance along rays of the host's choice, under witness BSDFs.
//!
//! Under a witness a right integrator answers exactly V I / r^2 w, so that a fault in a BSDF is not charged twice. Only
//! unambiguous rays are asked: away from every edge, both directions well above the surface, the light visible (or
//! hidden) whatever the shadow ray's epsilon.

mod material;
mod shadows;
mod unshadowed;

use basecode::glam::{DMat3, DVec3};
use basecode::{Camera, Frame, MaterialModel, Ray, Scene, Vec3};

use super::shading::{Directions, Shading, power};
use super::{Check, Witness};
use crate::expected::{FARTHEST_START, SurfaceBuffer, SurfacePoint, Visibility};
use imaging::reference::RegionMask;

pub use material::{OwnValue, is_of_own_bsdfs, judge_material};
pub use shadows::{INVERTED, Occluders, judge_shadows};
pub use unshadowed::{Unshadowed, judge_unshadowed, passes_unshadowed};

/// Directions of a camera's rays as an integrator may leave them, not normalized: up to the plane at distance 1, or up
/// to the far plane, as the inverse of the matrices gives it.
pub fn longer_directions(camera: &Camera, directions: &[Vec3]) -> [Vec<Vec3>; 2] {
    let to_clip = camera.projection() * camera.view();
    let (back, axis) = (to_clip.inverse(), camera.view().row(2).truncate());
    let near = |direction: &Vec3| *direction / direction.dot(-axis);
    let far = |direction: &Vec3| {
        let on_film = to_clip.project_point3(camera.eye() + *direction);
        back.project_point3(on_film.with_z(1.0)) - camera.eye()
    };
    [directions.iter().map(near).collect(), directions.iter().map(far).collect()]
}

/// Directions closer to the surface than this cosine are left out.
const MIN_COSINE: f32 = 0.05;
/// Largest relative difference of a right answer: f32 positions and frames in any order.
pub(super) const RELATIVE: f64 = 3e-3;
/// Fraction of the rays that may still differ: a student's own intersection code meets other triangles along seams that
/// no mask knows.
pub(super) const STRAY_FRACTION: f64 = 2e-3;
/// Steps of Gauss and Newton that find a light.
const LIGHT_STEPS: usize = 20;
/// Number of distances that tell where a light stands.
const LEAST_DISTANCES: usize = 20;
/// Shadowed rays in contact: their occluder is nearer than this, as a fraction of the light's distance.
const CONTACT: f32 = 0.03;
/// Number of rays in contact that are asked.
const CONTACTS: usize = 150;
/// Number of black rays that are asked.
const BLACK: usize = 200;

/// Adjusts verdicts that depend on another check's verdict, on all scenes together.
pub fn leave_unjudged(checks: &mut [Check]) {
    shadows::leave_unjudged(checks);
    material::leave_unjudged(checks);
}

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
    /// How many of the shadowed ones, the last, were added close behind what blocks them.
    pub contacts: usize,
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
        Self {
            scene: name.to_owned(),
            rays,
            pixels,
            points,
            lit: count,
            contacts: 0,
            intensity,
            light,
        }
    }

    /// The same, with shadowed rays close behind what blocks them, of a finer film: a small one has
    /// few. `width` is that of the film the batch was chosen on, a divisor of the finer one's.
    pub fn with_contacts(mut self, scene: &Scene, fine: &SurfaceBuffer, width: usize) -> Self {
        let times = fine.width / width;
        let blocked = |x: usize, y: usize| {
            let (ray, point) = &fine.pixels[y * fine.width + x];
            let point = point.as_ref().filter(|point| point.visibility == Visibility::Blocked)?;
            let material = scene.material_of(point.shape);
            let above = |w| Frame::cos_theta(w) > MIN_COSINE;
            let judged =
                above(point.wo) && above(point.wi) && material.model != MaterialModel::Mirror;
            (judged && !material.is_emitter()).then_some((ray, point))
        };
        let mut contacts = Vec::new();
        for y in 1..fine.height.saturating_sub(1) {
            for x in 1..fine.width - 1 {
                let Some((ray, point)) = blocked(x, y) else { continue };
                let around = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
                let same = |(x, y)| blocked(x, y).is_some_and(|(_, p)| p.shape == point.shape);
                if !around.into_iter().all(same) {
                    continue;
                }
                let toward = (self.light - point.position) / point.distance;
                let start = FARTHEST_START * point.distance;
                let near = Ray::segment(point.position, toward, start, CONTACT * point.distance);
                if let Some(hit) = scene.intersect(&near) {
                    let pixel = (y / times) * width + x / times;
                    contacts.push((hit.t / point.distance, pixel, *ray, *point));
                }
            }
        }
        contacts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let step = contacts.len().div_ceil(CONTACTS).max(1);
        for (_, pixel, ray, point) in contacts.into_iter().step_by(step) {
            let at = self.points.len();
            self.points.push(point);
            self.rays.insert(at, ray);
            self.pixels.insert(at, pixel);
            self.contacts += 1;
        }
        self
    }

    /// The pixels of the lit and of the shadowed rays, without those of contacts: another film chose them.
    pub fn met(&self) -> impl Iterator<Item = &usize> {
        self.pixels.iter().take(self.points.len() - self.contacts)
    }

    /// The rays that are `wanted`, without shadows: all that end on surfaces are lit. And which they are.
    pub fn without_shadows(&self, wanted: &dyn Fn(usize) -> bool) -> (Self, Vec<usize>) {
        let end = self.points.len();
        let contacts = end - self.contacts..end;
        let is_wanted = |index: &usize| !contacts.contains(index) && wanted(*index);
        let chosen: Vec<usize> = (0..self.rays.len()).filter(is_wanted).collect();
        let met = chosen.iter().filter(|index| **index < end);
        let points: Vec<SurfacePoint> = met.map(|index| self.points[*index]).collect();
        let part = Self {
            scene: self.scene.clone(),
            rays: chosen.iter().map(|index| self.rays[*index]).collect(),
            pixels: chosen.iter().map(|index| self.pixels[*index]).collect(),
            lit: points.len(),
            points,
            contacts: 0,
            ..*self
        };
        (part, chosen)
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

    /// The same with the light elsewhere: what each ray's point sees of it there, all of them lit.
    fn with_light(&self, light: Vec3) -> Self {
        let seen = |point: &SurfacePoint| {
            let to_light = light - point.position;
            let wi = Frame::from_normal(point.normal).to_local(to_light.normalize_or_zero());
            SurfacePoint { wi, distance: to_light.length(), ..*point }
        };
        Self { light, points: self.points.iter().map(seen).collect(), ..self.clone() }
    }

    /// Where the light stands, if the radiance of each of these rays is what is right there times the inverse square
    /// of another distance: by least squares, from where it belongs on. `ratios` are those of what is right to what was
    /// found.
    fn light_by_distances(&self, ratios: &[(usize, f64)]) -> Option<Vec3> {
        let mut light = self.light.as_dvec3();
        for _ in 0..LIGHT_STEPS {
            let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
            for (ray, ratio) in ratios {
                let point = &self.points[*ray];
                let from_point = light - point.position.as_dvec3();
                let squared = ratio * f64::from(point.distance).powi(2);
                // Relative to it: what is near counts as much as what is far.
                let row = 2.0 * from_point / squared;
                matrix += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
                right += row * (1.0 - from_point.length_squared() / squared);
            }
            light += matrix.inverse() * right;
        }
        let light = light.as_vec3();
        (ratios.len() >= LEAST_DISTANCES && light.is_finite()).then_some(light)
    }

    /// (wi, wo) as they reach the BSDF along ray `index`.
    fn directions(&self, index: usize, directions: Directions) -> (Vec3, Vec3) {
        let point = &self.points[index];
        let (wi, wo) = (point.wi, point.wo);
        let (world_wi, world_wo) = (self.to_light(index), -point.ray.direction.normalize());
        let frame = Frame::from_normal(point.normal);
        let local = |v: Vec3| frame.to_local(v.normalize_or_zero());
        match directions {
            Directions::Local => (wi, wo),
            Directions::WorldWi => (world_wi, wo),
            Directions::WorldWo => (wi, world_wo),
            Directions::World => (world_wi, world_wo),
            // The tangents turn too, which no witness tells.
            Directions::NegatedNormal => (-wi, -wo),
            Directions::NegatedWi => (-wi, wo),
            Directions::NegatedWo => (wi, -wo),
            Directions::Exchanged => (wo, wi),
            Directions::WoTwice => (wo, wo),
            Directions::WiTwice => (wi, wi),
            Directions::WiToWorld => (frame.to_world(world_wi), wo),
            Directions::BothToWorld => (frame.to_world(world_wi), frame.to_world(world_wo)),
            Directions::WoLocalTwice => (wi, frame.to_local(wo)),
            Directions::WiLocalTwice => (frame.to_local(wi), wo),
            Directions::WiTurned([x, y, z]) => (Vec3::new(wi[x], wi[y], wi[z]), wo),
            Directions::WoTurned([x, y, z]) => (wi, Vec3::new(wo[x], wo[y], wo[z])),
            Directions::LightFromOrigin => (local(self.light), wo),
            Directions::LightFromViewer => (local(self.light - point.ray.origin), wo),
            Directions::LightPlusPoint => (local(self.light + point.position), wo),
        }
    }

    /// Radiance along lit ray `index` of an integrator that lights as `shading` says, under a witness.
    pub fn under(&self, index: usize, shading: &Shading, witness: Witness) -> [f64; 3] {
        self.witnessed(index, shading, &|wi, wo| witness.of_directions(wi, wo))
    }

    /// Radiance along lit ray `index` of an integrator that lights as `shading` says, under a BSDF
    /// whose value for (wi, wo) is `bsdf`.
    pub fn witnessed(
        &self,
        index: usize,
        shading: &Shading,
        bsdf: &dyn Fn(Vec3, Vec3) -> [f64; 3],
    ) -> [f64; 3] {
        if shading.light_offset != [0.0; 3] {
            let light = self.light + Vec3::from(shading.light_offset);
            let moved = Self { points: vec![self.points[index]], ..Self::default() };
            let moved = Self { intensity: self.intensity, ..moved.with_light(light) };
            return moved.witnessed(0, &Shading { light_offset: [0.0; 3], ..*shading }, bsdf);
        }
        let point = &self.points[index];
        let r = match shading.directions {
            Directions::LightFromOrigin => self.light.length(),
            Directions::LightFromViewer => (self.light - point.ray.origin).length(),
            Directions::LightPlusPoint => (self.light + point.position).length(),
            _ if shading.from_origin => self.light.length(),
            _ if shading.without_axis.is_some() => {
                let mut to_light = self.light - point.position;
                to_light[shading.without_axis.unwrap_or_default()] = 0.0;
                to_light.length()
            }
            _ if shading.along_ray => (point.position - point.ray.origin).length(),
            _ => point.distance,
        };
        let r = f64::from(r);
        let (wi, wo) = self.directions(index, shading.directions);
        let wi = if shading.long_wi { point.distance * wi } else { wi };
        let value = if shading.asks { bsdf(wi, wo) } else { [1.0; 3] };
        let [cos_i, cos_o] = [point.wi, point.wo].map(|w| f64::from(Frame::cos_theta(w)));
        let incident = shading.factor[0]
            * shading.attenuation(r)
            * power(cos_i, shading.cos_i[0] - 1.0)
            * power(cos_o, shading.cos_o[0]);
        std::array::from_fn(|c| {
            let incident = (shading.incident)(f64::from(self.intensity[c]) * incident);
            incident * value[shading.channels[c]] + shading.ambient
        })
    }
}

#[cfg(test)]
mod tests;
