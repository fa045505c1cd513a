//! The small film on which pass and stages are judged apart, and where its surfaces lie.

use basecode::{Camera, CameraConfig, Scene, Vec3};

use crate::expected::SurfaceBuffer;
use imaging::reference::RegionMask;

/// How far surfaces may lie from their place on the film [pixels]: hardware snaps vertices to 1/256.
pub(super) const OFFSET_PX: f64 = 0.04;

/// Full vertical field of view from the origin, in degrees.
const WIDE: f32 = 120.0;

/// A camera that sees much of a scene from the origin.
pub fn from_origin(scene: &Scene) -> CameraConfig {
    let drawn = scene.shapes().iter().enumerate();
    let drawn = drawn.filter(|(index, _)| !scene.material_of(*index).is_emitter());
    let middle: Vec3 = drawn.map(|(_, shape)| shape.index_mean().normalize_or_zero()).sum();
    let at = middle.try_normalize().unwrap_or(Vec3::NEG_Z);
    let up = if at.y.abs() > 0.9 { Vec3::Z } else { Vec3::Y };
    CameraConfig { eye: Vec3::ZERO, at, up, fov_y_deg: WIDE }
}

/// A scene on a small film.
pub struct StageFilm<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its camera, on this film.
    pub camera: Camera,
    /// What each pixel shows.
    pub surface: &'a SurfaceBuffer,
    /// Where edges are.
    pub mask: &'a RegionMask,
}

impl StageFilm<'_> {
    /// Pixels away from edges and emitters, with the shape that they show.
    pub(super) fn interior(&self) -> impl Iterator<Item = (usize, usize)> {
        self.surface.pixels.iter().zip(&self.mask.pixels).enumerate().filter_map(
            |(index, ((_, point), value))| {
                let clear = value & (RegionMask::EDGE | RegionMask::EMITTER) == 0;
                point.as_ref().filter(|_| clear).map(|point| (index, point.shape))
            },
        )
    }

    /// Where on the film a world position belongs [pixels from left and top].
    pub(super) fn place_px(&self, position: Vec3) -> [f32; 2] {
        let ndc = (self.camera.projection() * self.camera.view()).project_point3(position);
        let (width, height) = (self.surface.width as f32, self.surface.height as f32);
        [(0.5 + 0.5 * ndc.x) * width, (0.5 - 0.5 * ndc.y) * height]
    }

    /// How far a world position lies from the center of the pixel that shows it [pixels, x and y].
    pub(super) fn offset_px(&self, index: usize, position: Vec3) -> [f32; 2] {
        let (x, y) = (index % self.surface.width, index / self.surface.width);
        let [own_x, own_y] = self.place_px(position);
        [own_x - x as f32 - 0.5, own_y - y as f32 - 0.5]
    }
}

/// The length of the median offset; 0 when there is none.
pub(super) fn median_length(offsets: &mut [[f32; 2]]) -> f64 {
    let mut median = |axis: usize| {
        offsets.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
        offsets.get(offsets.len() / 2).map_or(0.0, |offset| f64::from(offset[axis]))
    };
    median(0).hypot(median(1))
}
