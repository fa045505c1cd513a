//! Probes of visibility, orientation, the light's position and the sampler.

use super::{joined, probe};
use crate::scenes::scene::{Material, Scene};
use crate::scenes::shapes::{ball, cuboid, fan, floor, quad, sphere, sphere_band};
use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::PI;

/// A light 2 above a floor and 0.35 above a shelf, a plate 0.4 above the light.
pub fn behind() -> Scene {
    let plate = quad(dvec3(-0.6, 2.4, -0.6), DVec3::X * 1.2, DVec3::Z * 1.2);
    probe("behind", dvec3(0.6, 4.4, 5.0), dvec3(0.0, 0.7, 0.2), 36.0)
        .with("floor", Material::diffuse([0.7, 0.7, 0.7]), floor(0.0, [-7.0, -6.0], [7.0, 3.5]))
        .with(
            "shelf",
            Material::diffuse([0.1, 0.08, 0.06]),
            floor(1.65, [-0.9, -0.3], [-0.05, 0.5]),
        )
        .with(
            "flap",
            Material::diffuse([0.02, 0.02, 0.02]),
            floor(1.88, [-0.2, -0.05], [-0.06, 0.12]),
        )
        .with("plate", Material::diffuse([0.1, 0.1, 0.1]), plate)
        .with(
            "ball",
            Material::phong([0.3, 0.2, 0.5], [0.3, 0.3, 0.3], 20.0),
            ball(dvec3(1.4, 0.447, 0.8), 0.45),
        )
        .lit_by(dvec3(0.0, 2.0, 0.0), [8.0, 8.0, 8.0])
}

/// A hexagon of emitter, level, fanned out from its first corner.
pub fn emitter() -> Scene {
    // Two thin triangles pull the index mean away from the centroid.
    let corners = [[-2.0, -1.2], [0.2, -1.3], [0.9, -1.2], [1.3, -0.9], [1.6, 0.8], [-0.8, 1.1]];
    let corners = corners.map(|[x, z]| dvec3(x, 3.25, z));
    probe("emitter", dvec3(0.0, 2.5, 8.5), dvec3(0.0, 1.35, 0.0), 28.0)
        .with("floor", Material::diffuse([0.6, 0.6, 0.6]), floor(0.0, [-8.0, -8.0], [8.0, 5.0]))
        .with(
            "left",
            Material::phong([0.5, 0.2, 0.2], [0.3, 0.3, 0.3], 20.0),
            ball(dvec3(-1.5, 0.597, 0.5), 0.6),
        )
        .with("right", Material::diffuse([0.3, 0.5, 0.7]), ball(dvec3(1.2, 0.597, 0.0), 0.6))
        .with("light", Material::Emitter { ke: [20.0, 20.0, 20.0] }, fan(&corners, DVec3::NEG_Y))
}

/// Upright cards on either side of the light, facing to and fro, and a bowl that shows its inside.
pub fn backfaces() -> Scene {
    let toward = |x: f64, z: f64| quad(dvec3(x - 0.35, 0.2, z), DVec3::X * 0.7, DVec3::Y * 0.9);
    let away = |x: f64, z: f64| quad(dvec3(x + 0.35, 0.2, z), DVec3::X * -0.7, DVec3::Y * 0.9);
    let bowl = sphere_band(DVec3::ZERO, 0.5, 48, 12, 0.5).place(
        1.0,
        DQuat::from_rotation_z(PI),
        dvec3(0.0, 0.6, 1.6),
    );
    let phong = |kd: [f64; 3]| Material::phong(kd, [0.4, 0.4, 0.4], 9.0);
    probe("backfaces", dvec3(0.0, 3.4, 7.0), dvec3(0.0, 0.45, 0.0), 32.0)
        .with("floor", Material::diffuse([0.5, 0.5, 0.5]), floor(0.0, [-7.0, -7.0], [7.0, 4.0]))
        .with("both", phong([0.5, 0.3, 0.2]), joined([toward(-1.7, -1.5), toward(0.6, -1.5)]))
        .with("neither", phong([0.2, 0.5, 0.3]), away(-0.7, -1.5))
        .with("neither_diffuse", Material::diffuse([0.7, 0.4, 0.5]), away(1.7, -1.5))
        .with("camera_only", phong([0.3, 0.3, 0.6]), toward(-1.7, 1.4))
        .with("light_only", Material::diffuse([0.6, 0.6, 0.2]), away(-0.85, 1.4))
        .with("camera_only_diffuse", Material::diffuse([0.4, 0.6, 0.6]), toward(0.85, 1.4))
        .with("light_only_phong", phong([0.5, 0.2, 0.5]), away(1.7, 1.4))
        .with("bowl", phong([0.4, 0.4, 0.2]), bowl)
        .lit_by(dvec3(0.25, 3.0, 0.0), [26.0, 26.0, 26.0])
}

/// A comb 0.02 above the floor, a plate 0.2 above it, and a fin that stands on it, under a slanting light.
pub fn contact() -> Scene {
    let bars = (0..5)
        .map(|k| -0.9 + 0.12 * f64::from(k))
        .map(|x| floor(0.02, [x, -0.42], [x + 0.05, 0.42]));
    let mut scene = probe("contact", dvec3(0.0, 2.8, 1.6), dvec3(0.0, 0.0, 0.03), 24.0)
        .with("floor", Material::diffuse([0.7, 0.68, 0.64]), floor(0.0, [-2.0, -2.0], [2.0, 2.0]))
        .with("comb", Material::diffuse([0.5, 0.2, 0.15]), joined(bars))
        .with(
            "plate",
            Material::phong([0.2, 0.4, 0.2], [0.3, 0.3, 0.3], 15.0),
            floor(0.2, [-0.22, -0.35], [0.0, 0.35]),
        )
        .with(
            "fin",
            Material::diffuse([0.2, 0.3, 0.5]),
            cuboid(dvec3(0.536, -0.01, -0.4), dvec3(0.54, 0.11, 0.4)),
        )
        .lit_by(dvec3(-4.0, 2.0, 0.5), [52.0, 52.0, 52.0]);
    scene.film = [192, 144];
    scene
}

/// A light 2 above a floor, two leaves so near to it that only the last tenth of a shadow ray meets them.
///
/// The leaves are level, so that they cut every way from the floor at the same fraction of its length.
pub fn near_light() -> Scene {
    let leaf = |y: f64, low: [f64; 2], high: [f64; 2]| {
        let [low, high] = [low, high].map(|corner| corner.map(|x| x * (2.0 - y)));
        floor(y, low, high)
    };
    let dim = || Material::diffuse([0.01, 0.01, 0.01]);
    probe("near_light", dvec3(0.4, 3.6, 5.2), dvec3(0.0, 0.35, 0.1), 32.0)
        .with("floor", Material::diffuse([0.7, 0.7, 0.7]), floor(0.0, [-4.0, -4.0], [0.0, 3.0]))
        .with(
            "glossy",
            Material::phong([0.3, 0.35, 0.4], [0.3, 0.3, 0.3], 12.5),
            floor(0.0, [0.0, -4.0], [4.0, 3.0]),
        )
        .with("leaf", dim(), leaf(1.88, [-0.85, -0.1], [-0.2, 0.5]))
        .with("far_leaf", dim(), leaf(1.95, [0.15, -0.5], [0.7, 0.15]))
        .with(
            "ball",
            Material::phong([0.5, 0.2, 0.2], [0.3, 0.3, 0.3], 20.0),
            ball(dvec3(-1.75, 0.4, 0.3), 0.35),
        )
        .lit_by(dvec3(0.0, 2.0, 0.0), [8.0, 7.5, 7.0])
}

/// Two plates and a sphere over a floor that is diffuse on the left and Phong on the right. Nothing
/// touches and nothing grazes, so that no bias is put to the test.
pub fn both_shadows() -> Scene {
    let plate = |center: DVec3| {
        let half = dvec3(0.42, 0.03, 0.32);
        cuboid(center - half, center + half)
    };
    let mut scene = probe("both_shadows", dvec3(0.0, 4.6, 6.4), dvec3(0.0, 0.2, -0.1), 22.0)
        .with("floor", Material::diffuse([0.6, 0.58, 0.55]), floor(0.0, [-1.9, -1.5], [0.0, 1.4]))
        .with(
            "glossy",
            Material::phong([0.25, 0.35, 0.5], [0.3, 0.3, 0.3], 18.0),
            floor(0.0, [0.0, -1.5], [1.9, 1.4]),
        )
        .with("plate", Material::diffuse([0.6, 0.3, 0.2]), plate(dvec3(-1.0, 0.8, -0.4)))
        .with(
            "sphere_phong",
            Material::phong([0.6, 0.35, 0.15], [0.35, 0.35, 0.35], 25.0),
            sphere(dvec3(0.8, 0.5, 0.3), 0.42),
        )
        .with("screen", Material::diffuse([0.3, 0.5, 0.3]), plate(dvec3(0.0, 1.5, 0.55)))
        .lit_by(dvec3(-1.6, 5.6, 1.6), [42.0, 41.0, 38.0]);
    scene.bonus = true;
    scene
}

/// Upright stripes whose edges fall on ever other places within a pixel.
///
/// Light and camera are so far away that radiance varies by less than 1e-3 over the film.
pub fn rows() -> Scene {
    // One unit is the height of the film at the stripes: 64 pixels.
    let stripes = (0..28).map(|k| {
        let x = (-47.3 + 3.37 * f64::from(k)) / 64.0;
        quad(dvec3(x, -0.8, 0.0), DVec3::X * (1.71 / 64.0), DVec3::Y * 1.6)
    });
    // Wider than elsewhere: floats near 64 are 8e-6 apart.
    let light = quad(dvec3(-0.01, -0.01, 64.0), DVec3::X * 0.02, DVec3::Y * 0.02);
    let fov_deg = 2.0 * (0.5f64 / 20.0).atan().to_degrees();
    let mut scene = probe("rows", dvec3(0.0, 0.0, 20.0), DVec3::ZERO, fov_deg)
        .with("stripes", Material::diffuse([0.8, 0.8, 0.8]), joined(stripes))
        .with("light", Material::Emitter { ke: [6000.0; 3] }, light);
    scene.film = [96, 64];
    scene
}
