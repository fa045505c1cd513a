//! Probes of BSDFs, albedos and the light's color.

use super::probe;
use crate::scenes::scene::{Material, Scene};
use crate::scenes::shapes::{ball, floor, height_field, quad};
use crate::scenes::textures::Texture;
use glam::{DVec3, dvec2, dvec3};

/// Five Phong spheres, four of them with Kd + Ks over 1, and a bright diffuse one.
pub fn scale() -> Scene {
    let at = |x: f64, z: f64| ball(dvec3(x, 0.447, z), 0.45);
    probe("scale", dvec3(0.0, 3.2, 6.0), dvec3(0.0, 0.35, 0.0), 30.0)
        .with("floor", Material::diffuse([0.5, 0.5, 0.5]), floor(0.0, [-6.0, -6.0], [6.0, 4.0]))
        .with("below_one", Material::phong([0.5, 0.4, 0.3], [0.4, 0.4, 0.4], 20.0), at(-1.3, -0.7))
        .with("red_over", Material::phong([0.9, 0.3, 0.2], [0.3, 0.3, 0.3], 20.0), at(0.0, -0.7))
        .with("green_over", Material::phong([0.1, 0.7, 0.2], [0.2, 0.8, 0.1], 30.0), at(1.3, -0.7))
        .with("blue_over", Material::phong([0.2, 0.3, 0.85], [0.6, 0.5, 0.9], 15.0), at(-1.3, 0.8))
        .with(
            "all_over",
            Material::phong([0.99, 0.99, 0.99], [0.99, 0.99, 0.99], 50.0),
            at(0.0, 0.8),
        )
        .with("diffuse", Material::diffuse([0.95, 0.9, 0.85]), at(1.3, 0.8))
        .lit_by(dvec3(-1.5, 4.5, 3.5), [50.0, 50.0, 50.0])
}

/// Five strips of floor under a low light: a highlight in front of it, cos alpha < 0 behind it.
pub fn exponents() -> Scene {
    let strip = |k: f64| floor(0.0, [k - 0.5, -5.0], [k + 0.5, 4.5]);
    let metal = |ns: f64| Material::phong([0.12, 0.12, 0.12], [0.6, 0.6, 0.6], ns);
    probe("exponents", dvec3(0.0, 1.3, 6.5), dvec3(0.0, -0.15, 0.0), 32.0)
        .with("n_50", metal(50.0), strip(-2.0))
        .with("n_1", metal(1.0), strip(-1.0))
        .with("n_101_5", metal(101.5), strip(0.0))
        .with("n_9_8", metal(9.8), strip(1.0))
        .with("n_2", metal(2.0), strip(2.0))
        .lit_by(dvec3(0.25, 1.0, -0.5), [5.0, 5.0, 5.0])
}

/// Three Phong spheres of unlike Kd and Ks; the radiance stays below 1 everywhere. The largest values of Kd and of Ks
/// of the left one sum to more than 1, those of Kd + Ks do not.
pub fn coloured() -> Scene {
    let at = |x: f64| ball(dvec3(x, 0.597, 0.0), 0.6);
    let scene = probe("coloured", dvec3(0.0, 2.0, 6.5), dvec3(0.0, 0.45, 0.0), 26.0)
        .with("floor", Material::diffuse([0.35, 0.6, 0.8]), floor(0.0, [-6.0, -7.0], [6.0, 4.0]))
        .with("left", Material::phong([0.7, 0.25, 0.1], [0.05, 0.2, 0.35], 8.0), at(-1.4))
        .with("middle", Material::phong([0.1, 0.5, 0.3], [0.35, 0.1, 0.2], 10.0), at(0.0))
        .with("right", Material::phong([0.15, 0.2, 0.6], [0.2, 0.35, 0.05], 12.0), at(1.4))
        .lit_by(dvec3(1.0, 3.5, 3.0), [16.0, 10.0, 4.5]);
    Scene { listed_backward: true, ..scene }
}

/// A diffuse floor, a Phong wall and a Phong sphere with textures.
///
/// Kd and Ks are 1 where a map replaces them, and the maps' largest values sum to less than 1, so that `scale` is 1.
pub fn textured() -> Scene {
    let both = || Material::Phong {
        kd: [1.0; 3],
        ks: [1.0; 3],
        ns: 25.0,
        map_kd: Some("tiles.png"),
        map_ks: Some("bars.png"),
    };
    let ground = floor(0.0, [-3.0, -1.5], [3.0, 3.0]).map_uv(dvec2(3.0, 2.25), dvec2(-1.4, -0.6));
    let wall = quad(dvec3(-3.0, 0.0, -1.5), DVec3::X * 6.0, DVec3::Y * 3.0)
        .map_uv(dvec2(2.5, 1.25), dvec2(-0.75, -0.4));
    let ball = ball(dvec3(0.3, 0.747, 0.2), 0.75).map_uv(dvec2(3.0, 1.5), dvec2(0.1, -0.5));
    let mut scene = probe("textured", dvec3(0.0, 2.2, 6.0), dvec3(0.0, 0.85, 0.0), 30.0)
        .with("ground", Material::Diffuse { kd: [1.0; 3], map_kd: Some("tiles.png") }, ground)
        .with("wall", both(), wall)
        .with("ball", both(), ball)
        .lit_by(dvec3(-1.5, 3.0, 3.5), [30.0, 30.0, 30.0]);
    scene.textures =
        vec![
            // Four tiles of four colors, each with a gradient and a dark corner: no symmetry in either direction.
            Texture::new("tiles.png", 32, |x, y| {
                let base = [[150, 60, 40], [50, 130, 60], [60, 70, 150], [140, 130, 50]]
                    [(x / 16 + 2 * (y / 16)) as usize];
                let (dark, ramp) = (x % 16 < 5 && y % 16 < 3, (x % 16 + y / 2 % 8) as u8);
                if dark { [20, 16, 12] } else { base.map(|c: u8| c - 30 + ramp) }
            }),
            // Bars that lean: highlights come and go along the surface.
            Texture::new("bars.png", 16, |x, y| {
                if (x + y / 2) % 8 < 5 { [90, 84, 72] } else { [8, 12, 20] }
            }),
        ];
    scene
}

/// Phong surfaces of which a few texels reach Kd + Ks = 1.17 in red, while the average stays below 1 in every channel.
pub fn speckled() -> Scene {
    let both = || Material::Phong {
        kd: [1.0; 3],
        ks: [1.0; 3],
        ns: 14.5,
        map_kd: Some("speckles.png"),
        map_ks: Some("sheen.png"),
    };
    let ground = floor(0.0, [-3.0, -2.0], [3.0, 2.5]).map_uv(dvec2(4.0, 3.0), dvec2(-0.3, -0.2));
    let ball = ball(dvec3(0.4, 0.747, 0.1), 0.75).map_uv(dvec2(4.0, 2.0), dvec2(0.2, 0.0));
    let mut scene = probe("speckled", dvec3(0.0, 2.6, 5.6), dvec3(0.0, 0.55, 0.0), 30.0)
        .with("ground", both(), ground)
        .with("ball", both(), ball)
        .with("plain", Material::diffuse([0.4, 0.5, 0.6]), floor(0.9, [-1.6, -1.0], [-0.9, -0.3]))
        .lit_by(dvec3(-1.2, 3.4, 3.0), [26.0, 26.0, 26.0]);
    scene.textures = vec![
        Texture::new("speckles.png", 16, |x, y| {
            let speckle = (x % 8 == 3 && y % 8 < 2) || (x % 8 == 6 && y % 8 == 5);
            if speckle { [240, 120, 60] } else { [70 + 4 * x as u8, 90, 60 + 5 * y as u8] }
        }),
        Texture::new("sheen.png", 8, |x, y| {
            if (x / 2 + y / 4) % 2 == 0 { [150, 150, 150] } else { [40, 46, 52] }
        }),
    ];
    scene
}

/// Two mirrors, a diffuse and a Phong sphere on a floor.
pub fn mirror() -> Scene {
    let at = |x: f64| ball(dvec3(x, 0.497, 0.0), 0.5);
    let mirror = |kd: [f64; 3]| Material::Mirror { kd, ks: [0.9, 0.85, 0.8] };
    probe("mirror", dvec3(0.0, 2.4, 6.4), dvec3(0.0, 0.4, 0.0), 28.0)
        .with("floor", Material::diffuse([0.5, 0.5, 0.5]), floor(0.0, [-5.0, -6.0], [5.0, 3.5]))
        .with("mirror", mirror([0.6, 0.3, 0.2]), at(-1.65))
        .with("diffuse", Material::diffuse([0.3, 0.5, 0.3]), at(-0.55))
        .with("mirror_too", mirror([0.2, 0.4, 0.7]), at(0.55))
        .with("phong", Material::phong([0.3, 0.3, 0.5], [0.4, 0.4, 0.4], 30.0), at(1.65))
        .lit_by(dvec3(-1.5, 4.0, 3.5), [34.0, 34.0, 34.0])
}

/// Three strips of a bumpy floor, so flat that neither light nor camera is ever hidden. At 1 spp, so
/// that it shows where a pixel's only sample lies.
pub fn open() -> Scene {
    let height = |x: f64, z: f64| 0.1 * (2.1 * x + 0.4).sin() + 0.09 * (2.4 * z - 0.7 * x).cos();
    let slope = |x: f64, z: f64| {
        let ripple = -0.09 * (2.4 * z - 0.7 * x).sin();
        dvec2(0.21 * (2.1 * x + 0.4).cos() - 0.7 * ripple, 2.4 * ripple)
    };
    let strip = |x0: f64, x1: f64| height_field([x0, -4.0], [x1, 3.0], [16, 48], height, slope);
    let mut scene = probe("open", dvec3(0.0, 4.5, 6.0), dvec3(0.0, 0.0, -0.2), 26.0)
        .with("diffuse", Material::diffuse([0.7, 0.5, 0.4]), strip(-4.0, -0.9))
        .with("wide", Material::phong([0.2, 0.4, 0.25], [0.4, 0.4, 0.4], 12.0), strip(-0.9, 0.9))
        .with(
            "narrow",
            Material::phong([0.2, 0.25, 0.5], [0.45, 0.45, 0.45], 60.5),
            strip(0.9, 4.0),
        )
        .lit_by(dvec3(0.9, 5.0, -1.5), [45.0, 45.0, 45.0]);
    scene.spp = 1;
    scene
}
