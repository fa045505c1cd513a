//! The local shading frame.

use glam::Vec3;

/// A right-handed orthonormal frame; `n` is the local z axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent, the local x axis, world space.
    pub s: Vec3,
    /// Second tangent, the local y axis, world space.
    pub t: Vec3,
    /// Normal, the local z axis, world space.
    pub n: Vec3,
}

impl Frame {
    /// A frame on the unit normal `n`; the tangents are arbitrary but depend on `n` alone.
    ///
    /// Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.
    pub fn from_normal(n: Vec3) -> Self {
        let (s, t) = n.any_orthonormal_pair();
        Self { s, t, n }
    }

    /// Takes a world-space vector into this frame.
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Takes a local vector to world space.
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }

    /// The cosine between a *local* unit vector and the normal.
    pub fn cos_theta(v: Vec3) -> f32 {
        v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_right_handed_and_invertible() {
        for n in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::Z, Vec3::new(1.0, -2.0, 3.0).normalize()] {
            let frame = Frame::from_normal(n);
            assert!((frame.s.cross(frame.t) - n).length() < 1e-6, "{n}");
            let v = Vec3::new(0.3, -0.5, 0.7);
            assert!((frame.to_world(frame.to_local(v)) - v).length() < 1e-6);
            assert!((frame.to_local(n) - Vec3::Z).length() < 1e-6);
        }
    }
}
