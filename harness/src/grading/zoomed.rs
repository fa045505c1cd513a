//! Pictures of another field of view than the scene's: where their shadows belong.
//!
//! The field of view is the render pass' matter (2.1). Shadows that are right in a larger or smaller picture are right.

use std::path::Path;

use basecode::{Camera, Vec3};

use super::draw::{FrameRequest, draw};
use super::isolate::pass_shown;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use crate::evidence::shadow_map::Shadows;
use crate::expected::regions_seen_by;
use crate::imaging::reference::RegionMask;

/// A zoom within this is none.
const NONE: f32 = 1e-3;
/// Zooms are told apart from other mistakes where this fraction of the pixels agree within [`SAME`].
const MOST: f64 = 0.9;
/// Rasterized positions are as good as this, relative.
const SAME: f32 = 0.01;
/// Pixels nearer to the film's center than this fraction of its height tell nothing.
const CENTER: f32 = 0.1;

/// The regions of a zoomed picture, with and without shadows.
pub struct Masks {
    with: RegionMask,
    without: RegionMask,
}

impl Masks {
    /// As shadows are judged by.
    pub fn shadows(&self, median_lit: f32) -> Shadows<'_> {
        Shadows { mask: &self.with, unshadowed: &self.without, median_lit }
    }
}

/// The regions of what a pass draws of a scene, if that is a zoomed picture of it.
pub fn masks(session: &Session, plugin: &Path, case: &PreparedScene) -> Option<Masks> {
    let stages = pass_shown().pop()?;
    let frame = FrameRequest::probe(case, stages);
    let outcome = draw(session, Some(plugin), &frame);
    let (width, height) = (frame.size.0 as usize, frame.size.1 as usize);
    let positions = session::image(&outcome.answer()?.values, frame.size.0, frame.size.1);
    let scene = &case.expected.scene;
    let camera = scene.camera(width, height).ok()?;
    let zoom = zoom(&camera, &positions.pixels, (width, height))?;
    let mut config = scene.config().camera;
    config.fov_y_deg =
        2.0 * ((0.5 * config.fov_y_deg.to_radians()).tan() / zoom).atan().to_degrees();
    let (width, height) = case.film();
    let (width, height) = (width as usize, height as usize);
    let camera = Camera::new(config, width, height).ok()?;
    let [with, without] = regions_seen_by(scene, &camera, width, height);
    Some(Masks { with, without })
}

/// By how much a picture is larger than what the camera sees, if that is all that is wrong with where it shows world
/// positions; the background shows zeros.
fn zoom(camera: &Camera, positions: &[Vec3], (width, height): (usize, usize)) -> Option<f32> {
    let to_clip = camera.projection() * camera.view();
    let (w, h) = (width as f32, height as f32);
    let mut zooms: Vec<f32> = Vec::new();
    let shown = positions.iter().enumerate().filter(|(_, position)| **position != Vec3::ZERO);
    for (index, position) in shown {
        let ndc = to_clip.project_point3(*position);
        let belongs = [0.5 * ndc.x * w, -0.5 * ndc.y * h];
        let lies = [(index % width) as f32 + 0.5 - 0.5 * w, (index / width) as f32 + 0.5 - 0.5 * h];
        let away = belongs[0].hypot(belongs[1]);
        if away > CENTER * h {
            zooms.push((lies[0] * belongs[0] + lies[1] * belongs[1]) / (away * away));
        }
    }
    zooms.sort_by(f32::total_cmp);
    let median = *zooms.get(zooms.len() / 2)?;
    let same = zooms.iter().filter(|zoom| (*zoom / median - 1.0).abs() <= SAME).count();
    let agree = same as f64 >= MOST * zooms.len() as f64;
    (agree && median > 0.0 && (median - 1.0).abs() > NONE).then_some(median)
}

#[cfg(test)]
mod tests {
    use basecode::CameraConfig;

    use super::*;

    #[test]
    fn another_field_of_view_is_told_from_other_mistakes() {
        let size = (40, 30);
        let at = |fov_y_deg| {
            let eye = Vec3::new(0.0, 0.0, 4.0);
            Camera::new(CameraConfig { eye, fov_y_deg, ..CameraConfig::default() }, 40, 30).unwrap()
        };
        // What the camera sees on a plane through the origin.
        let plane = |camera: &Camera, moved: f32| -> Vec<Vec3> {
            let pixels = (0..40 * 30).map(|index| ((index % 40) as f32, (index / 40) as f32));
            let seen = pixels.map(|(x, y)| camera.ray(x + 0.5 + moved, y + 0.5));
            seen.map(|ray| ray.origin - ray.direction * (ray.origin.z / ray.direction.z)).collect()
        };
        let right = at(40.0);
        assert_eq!(zoom(&right, &plane(&right, 0.0), size), None);
        let found = zoom(&right, &plane(&at(30.0), 0.0), size).unwrap();
        let expected = 20.0f32.to_radians().tan() / 15.0f32.to_radians().tan();
        assert!((found - expected).abs() < 1e-3, "{found} {expected}");
        assert_eq!(zoom(&right, &plane(&right, 5.0), size), None, "moved");
        let mirrored: Vec<Vec3> =
            plane(&right, 0.0).iter().map(|p| Vec3::new(-p.x, p.y, p.z)).collect();
        assert_eq!(zoom(&right, &mirrored, size), None, "mirrored");
        assert_eq!(zoom(&right, &[Vec3::ZERO; 40 * 30], size), None, "nothing is drawn");
    }
}
