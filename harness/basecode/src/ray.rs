//! Rays and what they hit.

use glam::{Vec2, Vec3};

use crate::Frame;

/// A ray segment in world space: the points `origin + t * direction` with t in [min_t, max_t].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where t = 0.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Hits closer than this are ignored.
    pub min_t: f32,
    /// Hits farther than this are ignored.
    pub max_t: f32,
}

impl Ray {
    /// The default `min_t`, in scene units: far enough that a ray does not hit the surface it leaves,
    /// in a scene a few units large. A ray that begins with just this value begins later where the
    /// scene is so large that rounding asks for it. [`SurfaceInteraction::epsilon`] fits any scene.
    pub const EPSILON: f32 = 1e-3;

    /// A ray without a far end. `direction` must be a unit vector.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self::segment(origin, direction, Self::EPSILON, f32::INFINITY)
    }

    /// A ray with both ends. `direction` must be a unit vector.
    pub fn segment(origin: Vec3, direction: Vec3, min_t: f32, max_t: f32) -> Self {
        Self { origin, direction, min_t, max_t }
    }

    /// The point at distance `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }
}

/// A point on a surface, with the directions in which it is looked at and lit.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceInteraction {
    /// Distance along the ray.
    pub t: f32,
    /// The point, world space.
    pub p: Vec3,
    /// Texture coordinates, interpolated; (0, 0) when the mesh has none.
    pub uv: Vec2,
    /// Unit normal of the triangle, world space, by the winding of its vertices.
    pub ng: Vec3,
    /// Shading frame, built on the interpolated and normalized vertex normal.
    pub frame_ns: Frame,
    /// Direction toward the viewer, *local* shading frame. [`crate::Scene::intersect`] sets it.
    pub wo: Vec3,
    /// Direction toward the light, *local* shading frame. The integrator sets it; zero until then.
    pub wi: Vec3,
    /// Index of the shape in [`crate::Scene::shapes`].
    pub shape: usize,
    /// Index of the triangle within the shape.
    pub primitive: usize,
    /// How far from here a ray that leaves the surface should begin, so that rounding does not make it
    /// hit the surface itself, and how far from a light a shadow ray may end. It grows with the scene.
    pub epsilon: f32,
}

/// [`SurfaceInteraction::epsilon`] over the largest of the point's coordinates and its distance along
/// the ray. The original course has 1e-3 in scenes that are seen from 5 to 15 units.
const EPSILON_OF_HIT: f32 = 1e-4;
/// The same, at most, over the scene's size: contact shadows stay in a scene far from the origin or
/// from the camera. A camera with a field of view of 14 degrees sees a whole scene from there.
const EPSILON_OF_SCENE: f32 = 4.0 * EPSILON_OF_HIT;
/// The same over the largest coordinate of the triangle, for a small view of a huge floor.
const EPSILON_OF_TRIANGLE: f32 = 1e-6;
/// The least that rounding asks for, over the same as [`EPSILON_OF_HIT`]. Rounding moves a hit by a few
/// times 6e-8 of them, and by 1 / cos as much along a shadow ray. A ray that begins with
/// [`Ray::EPSILON`] takes it of its origin: nothing changes within 60 units.
const EPSILON_OF_ROUNDING: f32 = 1.0 / 65536.0;

/// [`SurfaceInteraction::epsilon`] of a hit at `p`, `t` along the ray, on a triangle of a scene whose
/// bounding box has a diagonal of `size`.
pub(crate) fn epsilon_at(p: Vec3, t: f32, corners: &[Vec3; 3], size: f32) -> f32 {
    let [a, b, c] = corners.map(|corner| corner.abs());
    let triangle = EPSILON_OF_TRIANGLE * a.max(b).max(c).max_element();
    let reach = p.abs().max_element().max(t);
    let usual = (EPSILON_OF_HIT * reach).min(EPSILON_OF_SCENE * size);
    usual.max(EPSILON_OF_ROUNDING * reach).max(triangle)
}

impl Ray {
    /// The ray that is traced for this one in a scene whose largest coordinate is `extent`: one that
    /// begins with [`Ray::EPSILON`] does not hit the surface it leaves in a large scene either.
    pub(crate) fn begun_off_surface(&self, extent: f32) -> Self {
        if self.min_t != Self::EPSILON {
            return *self;
        }
        let least = EPSILON_OF_ROUNDING * self.origin.abs().max_element();
        let least = least.max(EPSILON_OF_TRIANGLE * extent);
        Self { min_t: Self::EPSILON.max(least), ..*self }
    }
}
