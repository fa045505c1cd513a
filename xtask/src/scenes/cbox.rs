//! The Cornell box with two spheres.

use super::scene::{Camera, Material, Scene};
use super::shapes::{quad, sphere};
use glam::{DVec3, dvec3};

/// Half the width of the box, its height, and half its depth; it is open towards +z.
const HALF_WIDTH: f64 = 1.3;
const HEIGHT: f64 = 2.0;
const HALF_DEPTH: f64 = 1.0;

/// One diffuse and one Phong sphere under a light below the ceiling, so that one frustum sees both shadows.
pub fn cbox() -> Scene {
    let (x, z) = (DVec3::X * 2.0 * HALF_WIDTH, DVec3::Z * 2.0 * HALF_DEPTH);
    let y = DVec3::Y * HEIGHT;
    let corner = |sx: f64, height: f64, sz: f64| dvec3(sx * HALF_WIDTH, height, sz * HALF_DEPTH);
    let white = || Material::diffuse([0.72, 0.7, 0.66]);
    let camera = Camera { eye: dvec3(0.0, 1.05, 4.9), at: dvec3(0.0, 0.98, 0.0), fov_deg: 28.5 };
    let mut scene = Scene::new("cbox", "cbox_simple", camera, [600, 450])
        .with("floor", white(), quad(corner(-1.0, 0.0, 1.0), x, -z))
        .with("ceiling", white(), quad(corner(-1.0, HEIGHT, -1.0), x, z))
        .with("back", white(), quad(corner(-1.0, 0.0, -1.0), x, y))
        .with("left", Material::diffuse([0.6, 0.09, 0.07]), quad(corner(-1.0, 0.0, 1.0), -z, y))
        .with("right", Material::diffuse([0.12, 0.42, 0.1]), quad(corner(1.0, 0.0, -1.0), z, y))
        .with(
            "sphere_diffuse",
            Material::diffuse([0.3, 0.42, 0.75]),
            sphere(dvec3(-0.55, 0.447, -0.25), 0.45),
        )
        .with(
            "sphere_phong",
            Material::phong([0.75, 0.5, 0.2], [0.5, 0.45, 0.35], 40.0),
            sphere(dvec3(0.55, 0.447, 0.2), 0.45),
        )
        .lit_by(dvec3(0.0, 1.75, 0.5), [3.8, 3.7, 3.4]);
    scene.mesh_name = "cbox";
    scene.bonus = true;
    scene
}
