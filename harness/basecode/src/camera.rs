//! The pinhole camera.

use glam::{Mat4, Vec3};
use serde::{Deserialize, Serialize};

use crate::{Error, Ray, Result};

/// Where a camera stands and what it sees.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default)]
pub struct CameraConfig {
    /// Position, world space.
    pub eye: Vec3,
    /// Point looked at, world space.
    pub at: Vec3,
    /// Up direction, world space; neither unit nor orthogonal.
    pub up: Vec3,
    /// Full vertical field of view in degrees.
    #[serde(rename = "fov")]
    pub fov_y_deg: f32,
}

impl Default for CameraConfig {
    fn default() -> Self {
        Self { eye: Vec3::new(1.0, 1.0, 0.0), at: Vec3::ZERO, up: Vec3::Y, fov_y_deg: 30.0 }
    }
}

/// What a camera gives as its matrices. The host asks for other ones to see what a renderer makes of them: only the
/// first are those of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[doc(hidden)]
pub enum Matrices {
    /// What their names say.
    #[default]
    Usual,
    /// The view matrix holds the product, the projection matrix nothing.
    InView,
    /// The projection matrix holds the product, the view matrix nothing.
    InProjection,
    /// Both are transposed: their product with a row vector is what belongs.
    Transposed,
    /// The camera stands at the origin, and depth is the same everywhere: without the translation, w of a position has
    /// no effect.
    WithoutTranslation,
}

impl Matrices {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::Usual, Self::InView, Self::InProjection, Self::Transposed, Self::WithoutTranslation];
}

/// A pinhole camera for a film of a given size. Pixels are square.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    config: CameraConfig,
    width: usize,
    height: usize,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    tan_half_fov: f32,
    matrices: Matrices,
}

impl Camera {
    /// Distance of the near plane in [`Camera::projection`], scene units.
    pub const NEAR: f32 = 0.01;
    /// Distance of the far plane in [`Camera::projection`], scene units.
    pub const FAR: f32 = 1000.0;

    /// A camera for a film of `width` x `height` pixels.
    ///
    /// # Errors
    /// When the film is empty, the field of view lies outside (0, 180) degrees, or the directions
    /// do not span a frame.
    pub fn new(config: CameraConfig, width: usize, height: usize) -> Result<Self> {
        if width == 0 || height == 0 {
            return Err(Error::Argument(format!(
                "film is {width}x{height} but needs at least one pixel in each direction"
            )));
        }
        if !(config.fov_y_deg > 0.0 && config.fov_y_deg < 180.0) {
            return Err(Error::Argument(format!(
                "camera fov is {} but must lie between 0 and 180 degrees",
                config.fov_y_deg
            )));
        }
        let forward = scaled(config.at - config.eye).normalize_or_zero();
        let right = forward.cross(scaled(config.up)).normalize_or_zero();
        if right == Vec3::ZERO || !right.is_finite() {
            return Err(Error::Argument(format!(
                "camera eye {}, at {} and up {} do not span a frame",
                config.eye, config.at, config.up
            )));
        }
        Ok(Self {
            config,
            width,
            height,
            right,
            up: right.cross(forward),
            forward,
            tan_half_fov: (0.5 * config.fov_y_deg.to_radians()).tan(),
            matrices: Matrices::Usual,
        })
    }

    /// The same camera with other matrices.
    #[doc(hidden)]
    pub fn with_matrices(self, matrices: Matrices) -> Self {
        Self { matrices, ..self }
    }

    /// What the camera was made from.
    pub fn config(&self) -> &CameraConfig {
        &self.config
    }

    /// Position, world space.
    pub fn eye(&self) -> Vec3 {
        self.config.eye
    }

    /// Width over height.
    pub fn aspect(&self) -> f32 {
        self.width as f32 / self.height as f32
    }

    /// The ray through the film position (`x`, `y`) in pixels: (0, 0) is the top left corner of the
    /// film, (0.5, 0.5) the center of the first pixel. It starts at the eye with `min_t` 0.
    pub fn ray(&self, x: f32, y: f32) -> Ray {
        let scale = 2.0 * self.tan_half_fov / self.height as f32;
        let right = (x - 0.5 * self.width as f32) * scale;
        let up = (0.5 * self.height as f32 - y) * scale;
        let direction = (self.forward + right * self.right + up * self.up).normalize();
        Ray::segment(self.config.eye, direction, 0.0, f32::INFINITY)
    }

    /// World space to view space; the camera looks along -z.
    pub fn view(&self) -> Mat4 {
        let rotation = glam::Mat3::from_cols(self.right, self.up, -self.forward).transpose();
        let view = Mat4::from_mat3(rotation) * Mat4::from_translation(-self.config.eye);
        match self.matrices {
            Matrices::Usual => view,
            Matrices::InView => self.with_matrices(Matrices::Usual).projection() * view,
            Matrices::InProjection => Mat4::IDENTITY,
            Matrices::Transposed => view.transpose(),
            Matrices::WithoutTranslation => Mat4::from_mat3(rotation),
        }
    }

    /// View space to clip space: y up, z in [0, 1] from [`Camera::NEAR`] to [`Camera::FAR`].
    pub fn projection(&self) -> Mat4 {
        let y = 1.0 / self.tan_half_fov;
        let depth = Self::FAR / (Self::NEAR - Self::FAR);
        let of_depth = |depth: f32, near: f32| {
            Mat4::from_cols_array_2d(&[
                [y / self.aspect(), 0.0, 0.0, 0.0],
                [0.0, y, 0.0, 0.0],
                [0.0, 0.0, depth, -1.0],
                [0.0, 0.0, near, 0.0],
            ])
        };
        let projection = of_depth(depth, Self::NEAR * depth);
        match self.matrices {
            Matrices::Usual => projection,
            Matrices::InView => Mat4::IDENTITY,
            Matrices::InProjection => projection * self.with_matrices(Matrices::Usual).view(),
            Matrices::Transposed => projection.transpose(),
            Matrices::WithoutTranslation => of_depth(-0.5, 0.0),
        }
    }
}

/// A vector of any length divided by a power of two, so that its square is neither 0 nor infinite. This rounds no
/// digit of it.
fn scaled(v: Vec3) -> Vec3 {
    let largest = v.abs().max_element();
    // Its exponent alone.
    v / f32::from_bits(largest.to_bits() & f32::INFINITY.to_bits()).max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::vec3;

    fn camera() -> Camera {
        let config = CameraConfig {
            eye: vec3(1.0, 2.0, 3.0),
            at: vec3(0.0, 0.5, -1.0),
            up: Vec3::Y,
            fov_y_deg: 40.0,
        };
        Camera::new(config, 40, 30).unwrap()
    }

    #[test]
    fn the_center_ray_looks_at_the_target_and_row_0_is_on_top() {
        let camera = camera();
        let center = camera.ray(20.0, 15.0).direction;
        assert!((center - (vec3(0.0, 0.5, -1.0) - camera.eye()).normalize()).length() < 1e-6);
        assert!(camera.ray(20.0, 0.0).direction.y > camera.ray(20.0, 30.0).direction.y);
        let angle = camera.ray(20.0, 0.0).direction.angle_between(camera.ray(20.0, 30.0).direction);
        assert!((angle.to_degrees() - 40.0).abs() < 1e-3, "vertical field of view {angle}");
    }

    #[test]
    fn matrices_agree_with_rays() {
        let camera = camera();
        for (x, y, t) in [(0.5, 0.5, 2.0), (31.25, 7.75, 9.0), (20.0, 15.0, 0.5)] {
            let p = camera.ray(x, y).at(t);
            let clip = camera.projection() * camera.view() * p.extend(1.0);
            let ndc = clip.truncate() / clip.w;
            assert!((0.5 * (ndc.x + 1.0) * 40.0 - x).abs() < 1e-3, "{ndc}");
            assert!((0.5 * (1.0 - ndc.y) * 30.0 - y).abs() < 1e-3, "{ndc}");
            assert!((0.0..=1.0).contains(&ndc.z), "{ndc}");
        }
    }

    #[test]
    fn directions_of_any_length_span_the_same_frame() {
        let camera = camera();
        for length in [1e-44, 1e-38, 1e-30, 1e-10, 0.5, 1024.0, 1e10, 1e30, 3e38] {
            let config = CameraConfig { up: length * Vec3::Y, ..*camera.config() };
            let view = Camera::new(config, 40, 30).unwrap().view();
            assert!(view.abs_diff_eq(camera.view(), 1e-6), "up {length}: {view}");
        }
        for length in [1e-30, 1e-20, 1e20, 1e30, 1e38] {
            let (eye, up) = (Vec3::ZERO, Vec3::Y);
            let config =
                CameraConfig { eye, at: length * vec3(3.0, 0.0, -1.0), up, fov_y_deg: 40.0 };
            let forward = Camera::new(config, 40, 30).unwrap().ray(20.0, 15.0).direction;
            assert!((forward - vec3(3.0, 0.0, -1.0).normalize()).length() < 1e-6, "at {length}");
        }
    }

    #[test]
    fn a_camera_without_a_frame_is_an_error() {
        let config = CameraConfig { up: vec3(-2.0, -2.0, 0.0), ..CameraConfig::default() };
        assert!(Camera::new(config, 4, 3).unwrap_err().to_string().contains("span"));
        assert!(Camera::new(CameraConfig::default(), 0, 3).is_err());
        let config = CameraConfig { fov_y_deg: f32::NAN, ..CameraConfig::default() };
        assert!(Camera::new(config, 4, 3).unwrap_err().to_string().contains("fov"));
    }
}
