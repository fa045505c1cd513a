//! The two sphere scenes: one sphere in front of a curved backdrop.

use super::scene::{Camera, Material, Scene};
use super::shapes::{backdrop, sphere};
use glam::dvec3;

/// A diffuse sphere.
pub fn diffuse() -> Scene {
    scene("sphere_diffuse", Material::diffuse([0.72, 0.46, 0.24]))
}

/// A Phong sphere whose reflectivities sum to less than one: `scale` is 1 here, as in the original course.
pub fn phong() -> Scene {
    scene("sphere_phong", Material::phong([0.16, 0.3, 0.5], [0.36, 0.36, 0.36], 30.0))
}

fn scene(name: &'static str, material: Material) -> Scene {
    let camera = Camera { eye: dvec3(0.0, 2.0, 7.0), at: dvec3(0.0, 0.95, 0.0), fov_deg: 28.0 };
    Scene::new(name, name, camera, [512, 384])
        .with("backdrop", Material::diffuse([0.6, 0.6, 0.6]), backdrop(7.0, 6.0, -3.0, 7.0, 2.0))
        .with("sphere", material, sphere(dvec3(0.0, 0.995, 0.0), 1.0))
        .lit_by(dvec3(-2.5, 4.0, 3.0), [45.0, 45.0, 45.0])
}
