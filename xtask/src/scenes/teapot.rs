//! The Utah teapot with a teacup on a backdrop.

use super::bezier::{sweep, tube};
use super::mesh::Mesh;
use super::newell::{TEACUP_HANDLE, TEACUP_PROFILES, TEAPOT_HANDLE, TEAPOT_PROFILES, TEAPOT_SPOUT};
use super::scene::{Camera, Material, Scene};
use super::shapes::backdrop;
use glam::{DQuat, DVec3, dvec3};

/// Cells along each side of a patch.
const STEPS: usize = 12;

/// Teapot (Kd + Ks over 1, so that `scale` matters), teacup and backdrop.
pub fn teapot() -> Scene {
    let camera = Camera { eye: dvec3(1.6, 5.0, 12.5), at: dvec3(0.7, 1.2, 0.3), fov_deg: 29.0 };
    let turn = |angle_deg: f64| DQuat::from_rotation_y(angle_deg.to_radians());
    // Both objects are sunk a little, so that no two surfaces coincide.
    let pot = teapot_mesh().place(1.0, turn(20.0), dvec3(-0.5, -0.01, 0.0));
    let cup = teacup_mesh().place(0.36, turn(150.0), dvec3(2.7, -0.01, 2.4));
    let mut scene = Scene::new("teapot", "teapot_simple", camera, [640, 480])
        .with(
            "backdrop",
            Material::diffuse([0.55, 0.55, 0.58]),
            backdrop(12.0, 9.0, -6.0, 10.0, 4.0),
        )
        .with("teapot", Material::phong([0.78, 0.28, 0.14], [0.5, 0.48, 0.45], 50.0), pot)
        .with("teacup", Material::phong([0.2, 0.38, 0.5], [0.3, 0.3, 0.3], 20.0), cup)
        .lit_by(dvec3(-3.5, 7.5, 5.5), [210.0, 204.0, 192.0]);
    scene.mesh_name = "teapot";
    scene.bonus = true;
    scene
}

/// The published handles end on the surface of the body or just outside it; we push both in, so that no gap shows.
const TEAPOT_HANDLE_SHIFT: f64 = 0.05;
const TEACUP_HANDLE_SHIFT: f64 = 0.03;

/// The teapot on y = 0, spout towards +x: 3.15 high, 4 wide without spout and handle.
pub fn teapot_mesh() -> Mesh {
    sweep(&TEAPOT_PROFILES, STEPS).join(teapot_handle()).join(tube(&TEAPOT_SPOUT, STEPS))
}

/// The teacup with its saucer on y = 0, handle towards -x.
pub fn teacup_mesh() -> Mesh {
    sweep(&TEACUP_PROFILES, STEPS).join(teacup_handle())
}

pub fn teapot_handle() -> Mesh {
    tube(&TEAPOT_HANDLE, STEPS).place(1.0, DQuat::IDENTITY, DVec3::X * TEAPOT_HANDLE_SHIFT)
}

pub fn teacup_handle() -> Mesh {
    tube(&TEACUP_HANDLE, STEPS).place(1.0, DQuat::IDENTITY, DVec3::X * TEACUP_HANDLE_SHIFT)
}
