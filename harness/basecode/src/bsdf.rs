//! How surfaces scatter light.

use glam::Vec3;

use crate::SurfaceInteraction;

/// How a scene is shaded, offline and realtime: `type` in the `[renderer]` section of its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShadingKind {
    /// Direct light from the point light: `"simple"` or `"direct"`, and what a scene gets that
    /// says nothing.
    Simple,
    /// Normals as colors, from the previous assignment: `"normal"`.
    Normal,
}

/// A bidirectional scattering distribution function.
pub trait Bsdf: Send + Sync {
    /// The BSDF's value for `i.wo` and `i.wi` (unit vectors in the local shading frame, leaving
    /// the surface), *times* the cosine of `i.wi` [sr^-1]. Zero unless both face the surface.
    fn eval(&self, i: &SurfaceInteraction) -> Vec3;
}
