//! The matrices of a second camera, such as the light's of a shadow map.

use glam::camera::rh::{proj::directx, view};
use glam::{Mat4, Vec3};

/// View space to clip space with perspective, as [`crate::Camera::projection`]: right-handed, the camera
/// looks along -z, clip space has y up and z in [0, 1] from `near` to `far`.
///
/// `fov_y_rad` is the full vertical angle in radians, `aspect` width over height, `near` and `far` are
/// positive distances in scene units. Tutorials call it `perspective_rh` or `perspectiveRH_ZO`. OpenGL's
/// `glm::perspective` has z in [-1, 1]: its depths do not fit here.
///
/// ```
/// use basecode::gpu::{look_at, perspective};
/// use basecode::{Vec3, vec3};
///
/// let light = vec3(0.0, 4.0, 0.0);
/// let view = look_at(light, Vec3::ZERO, Vec3::Z);
/// let light_view_projection = perspective(90f32.to_radians(), 1.0, 0.1, 20.0) * view;
/// let clip = light_view_projection * vec3(0.0, 1.0, 0.0).extend(1.0);
/// assert!(clip.w == 3.0 && (0.0..clip.w).contains(&clip.z));
/// ```
pub fn perspective(fov_y_rad: f32, aspect: f32, near: f32, far: f32) -> Mat4 {
    directx::perspective(fov_y_rad, aspect, near, far)
}

/// View space to clip space without perspective: the box from `left`, `bottom` to `right`, `top` and from
/// `near` to `far` before the camera, in scene units; otherwise as [`perspective`]. Tutorials use it for
/// the sun. A point light, whose rays part, needs [`perspective`].
pub fn orthographic(left: f32, right: f32, bottom: f32, top: f32, near: f32, far: f32) -> Mat4 {
    directx::orthographic(left, right, bottom, top, near, far)
}

/// World space to the view space of a camera at `eye` that looks at `at`, as [`crate::Camera::view`]:
/// right-handed, it looks along -z. `up` is a direction of any length, not parallel to `at - eye`.
/// Tutorials call it `look_at_rh`, or `glm::lookAt`.
pub fn look_at(eye: Vec3, at: Vec3, up: Vec3) -> Mat4 {
    view::look_at_mat4(eye, at, up.normalize_or(Vec3::Y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, CameraConfig};

    #[test]
    fn they_are_the_camera_s() {
        let config = CameraConfig {
            eye: Vec3::new(1.0, 2.0, 3.0),
            at: Vec3::new(0.0, 0.5, -1.0),
            up: Vec3::new(0.0, 3.0, 0.0),
            fov_y_deg: 40.0,
        };
        let camera = Camera::new(config, 40, 30).unwrap();
        let own = look_at(config.eye, config.at, config.up);
        assert!(own.abs_diff_eq(camera.view(), 1e-6), "{own}\n{}", camera.view());
        let own = perspective(40f32.to_radians(), 40.0 / 30.0, Camera::NEAR, Camera::FAR);
        assert!(own.abs_diff_eq(camera.projection(), 1e-5), "{own}\n{}", camera.projection());
    }

    #[test]
    fn a_box_without_perspective_becomes_the_clip_box() {
        let matrix = orthographic(-2.0, 4.0, -1.0, 3.0, 1.0, 5.0);
        let corner = |x, y, z| matrix.project_point3(Vec3::new(x, y, z));
        assert!(corner(-2.0, -1.0, -1.0).abs_diff_eq(Vec3::new(-1.0, -1.0, 0.0), 1e-6));
        assert!(corner(4.0, 3.0, -5.0).abs_diff_eq(Vec3::new(1.0, 1.0, 1.0), 1e-6));
    }
}
