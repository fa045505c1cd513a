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
    /// The default `min_t`, in scene units: far enough that a ray does not hit the surface it leaves.
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
    /// Shading frame, built on the interpolated and normalised vertex normal.
    pub frame_ns: Frame,
    /// Direction toward the viewer, *local* shading frame. [`crate::Scene::intersect`] sets it.
    pub wo: Vec3,
    /// Direction toward the light, *local* shading frame. The integrator sets it; zero until then.
    pub wi: Vec3,
    /// Index of the shape in [`crate::Scene::shapes`].
    pub shape: usize,
    /// Index of the triangle within the shape.
    pub primitive: usize,
}
