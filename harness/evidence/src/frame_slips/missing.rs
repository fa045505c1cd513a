//! The slip that some surfaces are not drawn.

use basecode::MaterialModel;

use super::{FrameSlips, radiance};
use crate::expected::SurfacePoint;
use crate::pixels::RELATIVE;

/// What an image shows of surfaces if some of them are not drawn.
pub(super) struct Missing {
    /// Fraction of the points that show neither their surface, nor one behind it, nor nothing.
    pub left: f64,
    /// Lit points that show their own surface, diffuse and Phong ones.
    pub shown: [usize; 2],
}

/// So many surfaces behind another are looked at.
const BEHIND: usize = 8;

impl Missing {
    pub fn of(frame: &FrameSlips, pixels: &[usize]) -> Self {
        let FrameSlips { scene, places, looked, mean, .. } = frame;
        let shows = |point: &SurfacePoint, found: &[f32; 3]| {
            let right = radiance(&places.shaded_point(scene, point));
            let is_close = |c: usize| {
                let apart = (f64::from(found[c]) - right[c]).abs();
                apart <= RELATIVE * right[c].abs() + 1e-3 * mean
            };
            [0, 1, 2].into_iter().all(is_close)
        };
        let shows_behind = |point: &SurfacePoint, found: &[f32; 3]| {
            let mut ray = point.ray;
            for _ in 0..BEHIND {
                let Some(hit) = scene.intersect(&ray) else { return false };
                ray.min_t = hit.t + hit.epsilon;
                if SurfacePoint::cast(scene, ray).is_some_and(|next| shows(&next, found)) {
                    return true;
                }
            }
            false
        };
        let (mut left, mut shown) = (0usize, [0usize; 2]);
        for &pixel in pixels {
            let (point, found) = (&looked.surfaces[pixel], &looked.found[pixel]);
            if shows(point, found) {
                let lit = found.iter().any(|value| f64::from(*value) > 1e-2 * mean);
                let phong = scene.material_of(point.shape).model == MaterialModel::Phong;
                shown[usize::from(phong)] += usize::from(lit);
            } else if *found != [0.0; 3] && !shows_behind(point, found) {
                left += 1;
            }
        }
        Self { left: left as f64 / pixels.len().max(1) as f64, shown }
    }
}
