//! Unshadowed shading: closed forms, and the offline renderer.

use basecode::{ShadingKind, Vec3, vec3};

use super::{Build, agree, camera, draw, floor_point, interior, trace};

/// Radiance that the floor y = 0 reflects toward `eye` at `p`: the handout's formula in f64.
fn closed_form(p: [f64; 3], eye: Vec3, light: Vec3, kd: f64, ks: f64, n: f64) -> f64 {
    let toward = |v: Vec3| {
        let d = [0, 1, 2].map(|axis| f64::from(v[axis]) - p[axis]);
        let length = d.iter().map(|c| c * c).sum::<f64>().sqrt();
        (d.map(|c| c / length), length)
    };
    let ((wi, r), (wo, _)) = (toward(light), toward(eye));
    // The mirror direction of wo about the y axis.
    let cos_alpha = (-wo[0] * wi[0] + wo[1] * wi[1] - wo[2] * wi[2]).max(0.0);
    let pi = std::f64::consts::PI;
    (kd / pi + ks * (n + 2.0) / (2.0 * pi) * cos_alpha.powf(n)) * wi[1] / (r * r)
}

#[test]
fn a_floor_under_a_light_is_the_closed_form() {
    let size = (64, 48);
    // The light stands behind the camera, so that its triangle is out of sight.
    let (eye, light, intensity) =
        (vec3(0.0, 2.0, 2.5), vec3(0.7, 3.0, 3.0), vec3(30.0, 20.0, 10.0));
    for (statements, kd, ks, n) in [
        ("Kd 0.6 0.6 0.6\nillum 7", 0.6, 0.0, 1.0),
        ("Kd 0.3 0.3 0.3\nKs 0.5 0.5 0.5\nNs 9.8\nillum 2", 0.3, 0.5, 9.8),
        // Kd + Ks is 1.5: both are scaled.
        ("Kd 0.7 0.7 0.7\nKs 0.8 0.8 0.8\nNs 50\nillum 2", 0.7 * 0.66, 0.8 * 0.66, 50.0),
        // A mirror is drawn as diffuse.
        ("Kd 0.4 0.4 0.4\nillum 5", 0.4, 0.0, 1.0),
    ] {
        let mut build = Build::new(light, intensity);
        build.material("floor", statements);
        build.floor("floor");
        let scene = build.load();
        let camera = camera(eye, Vec3::ZERO, 40.0, size.0, size.1);
        let image = &draw(ShadingKind::Simple, &scene, false, &[camera], size)[0];
        let mut count = 0;
        for y in 0..size.1 {
            for x in 0..size.0 {
                let p = floor_point(&camera, x, y);
                let l = closed_form(p, eye, scene.first_light_position(), kd, ks, n);
                let expected = intensity * l as f32;
                let actual = image.at(x, y);
                assert!(
                    agree(actual, expected),
                    "{statements:?} at ({x}, {y}): {actual} {expected}"
                );
                count += 1;
            }
        }
        assert_eq!(count, 64 * 48);
    }
}

#[test]
fn back_faces_are_black_and_emitters_white() {
    let size = (32, 32);
    let mut build = Build::new(vec3(0.0, 5.0, 0.0), Vec3::ONE);
    build.material("floor", "Kd 0.5 0.5 0.5\nillum 7");
    build.material("lamp", "Kd 0 0 0\nKe 2 2 2\nillum 7");
    build.floor("floor");
    let h = 0.5;
    build
        .polygon("lamp", &[vec3(-h, 1.0, h), vec3(h, 1.0, h), vec3(h, 1.0, -h), vec3(-h, 1.0, -h)]);
    let scene = build.load();
    let below = camera(vec3(0.0, -4.0, 0.0), Vec3::ZERO, 30.0, size.0, size.1);
    let above = camera(vec3(0.3, 4.0, 0.0), Vec3::ZERO, 30.0, size.0, size.1);
    let images = draw(ShadingKind::Simple, &scene, false, &[below, above], size);
    assert!(images[0].pixels.iter().all(|pixel| *pixel == Vec3::ZERO));
    assert_eq!(images[1].at(16, 16), Vec3::ONE);
    assert!(images[1].at(0, 0) != Vec3::ONE && images[1].at(0, 0).min_element() > 0.0);
}

/// A sphere on a floor.
fn still_life(material: &str) -> Build {
    let mut build = Build::new(vec3(1.5, 3.5, 2.0), vec3(20.0, 18.0, 15.0));
    build.material("floor", "Kd 0.5 0.4 0.3\nillum 7");
    build.material("ball", material);
    build.floor("floor");
    build.sphere("ball", vec3(0.0, 0.6, 0.0), 0.6);
    build
}

#[test]
fn realtime_is_offline_at_the_pixel_center() {
    let size = (160, 120);
    for kind in [ShadingKind::Simple, ShadingKind::Normal] {
        for material in
            ["Kd 0.2 0.5 0.7\nillum 7", "Kd 0.4 0.3 0.2\nKs 0.9 0.8 0.7\nNs 101.5\nillum 2"]
        {
            let scene = still_life(material).load();
            let camera = camera(vec3(0.0, 1.5, 4.0), vec3(0.0, 0.5, 0.0), 35.0, size.0, size.1);
            let drawn = &draw(kind, &scene, false, &[camera], size)[0];
            let expected = trace(kind, &scene, false, &camera, size);
            let inside = interior(&scene, &camera, size, 1);
            let mut compared = 0;
            for (index, (a, b)) in drawn.pixels.iter().zip(&expected.pixels).enumerate() {
                if inside[index] {
                    compared += 1;
                    assert!(agree(*a, *b), "{kind:?} {material:?} pixel {index}: {a} {b}");
                }
            }
            assert!(compared > drawn.pixels.len() * 9 / 10, "only {compared} pixels compared");
            assert!(drawn.pixels.iter().any(|pixel| pixel.max_element() > 0.1));
        }
    }
}
