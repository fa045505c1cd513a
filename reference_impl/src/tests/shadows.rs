//! The shadow map: lit or dark where it should be, no acne, no peter-panning.

use basecode::{Camera, Scene, ShadingKind, Vec3, vec3};

use super::{Build, agree, camera, draw, floor_point, interior, trace};

const WHITE: &str = "Kd 0.8 0.8 0.8\nillum 7";

#[test]
fn a_card_above_a_floor_casts_the_shadow_that_geometry_says() {
    let size = (160, 120);
    let half = 0.5;
    // High, low and grazing, and one on the edge between two faces of the cube.
    for light in
        [vec3(0.2, 3.0, 0.1), vec3(1.6, 2.0, 0.3), vec3(3.0, 3.0, 0.0), vec3(1.0, 2.0, 1.0)]
    {
        let mut build = Build::new(light, Vec3::splat(10.0));
        build.material("white", WHITE);
        build.floor("white");
        let corners = [(-half, half), (half, half), (half, -half), (-half, -half)];
        build.polygon("white", &corners.map(|(x, z)| vec3(x, 1.0, z)));
        let scene = build.load();
        let camera = camera(vec3(-0.5, 0.7, 4.0), vec3(-0.5, 0.0, 0.0), 40.0, size.0, size.1);
        let image = &draw(ShadingKind::Simple, &scene, true, &[camera], size)[0];
        let unshadowed = &draw(ShadingKind::Simple, &scene, false, &[camera], size)[0];
        let (mut lit, mut dark) = (0, 0);
        for y in 0..size.1 {
            for x in 0..size.0 {
                let ray = camera.ray(x as f32 + 0.5, y as f32 + 0.5);
                let hits_floor = scene.intersect(&ray).is_some_and(|hit| hit.p.y.abs() < 1e-4);
                if !hits_floor {
                    continue;
                }
                let p = floor_point(&camera, x, y);
                // Where the way to the light passes the height of the card.
                let t = 1.0 / f64::from(light.y);
                let cross =
                    [0, 2].map(|axis| (p[axis] + t * (f64::from(light[axis]) - p[axis])).abs());
                let reach = cross[0].max(cross[1]);
                let (actual, full) = (image.at(x, y), unshadowed.at(x, y));
                // The map resolves 2 d / 2048 on the card, d below 4.
                if reach < 0.5 - 0.006 {
                    dark += 1;
                    assert_eq!(actual, Vec3::ZERO, "{light} at ({x}, {y}) should be dark");
                } else if reach > 0.5 + 0.006 {
                    lit += 1;
                    assert!(agree(actual, full), "{light} at ({x}, {y}) should be lit: {actual}");
                }
            }
        }
        assert!(lit > 1000 && dark > 300, "{light}: {lit} lit and {dark} dark pixels");
    }
}

#[test]
fn nothing_shadows_itself() {
    let size = (160, 120);
    // From high to so low that the floor is lit at 3 degrees.
    for light in
        [vec3(0.1, 4.0, 0.2), vec3(2.0, 2.0, 2.0), vec3(-3.0, 0.9, 1.0), vec3(2.9, 0.15, 2.0)]
    {
        let mut build = Build::new(light, Vec3::splat(10.0));
        build.material("white", WHITE);
        build.floor("white");
        build.sphere("white", vec3(0.0, 0.6, 0.0), 0.6);
        let scene = build.load();
        let cameras = [vec3(0.0, 1.5, 4.0), vec3(3.0, 2.5, -2.0)]
            .map(|eye| camera(eye, vec3(0.0, 0.4, 0.0), 40.0, size.0, size.1));
        for (camera, image) in
            cameras.iter().zip(draw(ShadingKind::Simple, &scene, true, &cameras, size))
        {
            let compared = compare_with_rays(&scene, camera, &image, size);
            assert!(compared > 0.85, "{light}: only {compared} of the pixels compared");
        }
    }
}

/// Compares with ray-traced shadows away from edges and from the terminator, where facets count.
/// Returns the part of the pixels that was compared.
fn compare_with_rays(
    scene: &Scene,
    camera: &Camera,
    image: &basecode::Image,
    size: (usize, usize),
) -> f64 {
    let expected = trace(ShadingKind::Simple, scene, true, camera, size);
    let inside = interior(scene, camera, size, 2);
    let light = scene.first_light_position();
    let mut compared = 0;
    for (index, (a, b)) in image.pixels.iter().zip(&expected.pixels).enumerate() {
        let (x, y) = (index % size.0, index / size.0);
        let hit = scene.intersect(&camera.ray(x as f32 + 0.5, y as f32 + 0.5));
        let on_terminator = hit.is_some_and(|hit| {
            let wi = (light - hit.p).normalize();
            // The facets of the sphere are 1.9 degrees wide.
            (hit.ng - hit.frame_ns.n).length() > 1e-4 && hit.frame_ns.n.dot(wi).abs() < 0.05
        });
        if inside[index] && !on_terminator {
            compared += 1;
            assert!(agree(*a, *b), "light {light}, pixel ({x}, {y}): {a}, by rays {b}");
        }
    }
    f64::from(compared) / image.pixels.len() as f64
}

#[test]
fn all_six_faces_of_the_cube_see_their_blockers() {
    let size = (120, 120);
    let light = vec3(0.1, 0.2, -0.15);
    let mut build = Build::new(light, Vec3::splat(5.0));
    build.material("white", WHITE);
    // A room that is seen from inside, and a box before each wall, none centered.
    build.cuboid("white", Vec3::splat(2.0), Vec3::splat(-2.0));
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut center = Vec3::splat(0.3);
            center[axis] = 1.2 * side;
            build.cuboid("white", center - Vec3::splat(0.2), center + Vec3::splat(0.25));
        }
    }
    let scene = build.load();
    let eye = vec3(-0.4, -0.3, -0.35);
    let cameras = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z]
        .map(|direction| camera(eye, eye + direction, 80.0, size.0, size.1));
    for (camera, image) in
        cameras.iter().zip(draw(ShadingKind::Simple, &scene, true, &cameras, size))
    {
        let dark = image.pixels.iter().filter(|pixel| **pixel == Vec3::ZERO).count();
        assert!(dark > 150, "only {dark} pixels are dark");
        let compared = compare_with_rays(&scene, camera, &image, size);
        assert!(compared > 0.8, "only {compared} of the pixels compared");
    }
}

#[test]
fn corners_of_a_room_stay_lit() {
    let size = (400, 40);
    for light in [vec3(0.1, 0.2, -0.15), vec3(1.2, -0.9, 0.3), vec3(-0.9, -1.6, 0.4)] {
        let mut build = Build::new(light, Vec3::splat(5.0));
        build.material("white", WHITE);
        build.cuboid("white", Vec3::splat(2.0), Vec3::splat(-2.0));
        let scene = build.load();
        // Across the edge where x and y are -2; a pixel is about 0.0005 wide there.
        let eye = vec3(-0.6, -0.7, 0.2);
        let camera = camera(eye, vec3(-2.0, -2.0, 0.2), 0.6, size.0, size.1);
        let camera = turned(camera, size);
        let image = &draw(ShadingKind::Simple, &scene, true, &[camera], size)[0];
        let dark = image.pixels.iter().filter(|pixel| **pixel == Vec3::ZERO).count();
        assert_eq!(dark, 0, "{light}: dark pixels along the corner");
    }
}

#[test]
fn shadows_begin_where_things_stand() {
    let size = (400, 40);
    for (light, thickness) in [
        (vec3(-2.0, 1.5, 0.0), 0.5),
        (vec3(-2.0, 1.5, 0.0), 0.02),
        (vec3(-2.0, 1.5, 0.0), 0.0),
        (vec3(-3.5, 0.3, 0.0), 0.0),
        (vec3(-0.7, 3.5, 0.0), 0.0),
        (vec3(-0.7, 3.5, 0.0), 0.5),
        (vec3(-3.0, 0.8, 0.5), 0.5),
    ] {
        let mut build = Build::new(light, Vec3::splat(10.0));
        build.material("white", WHITE);
        build.floor("white");
        // A wall that stands on the floor, or a card without thickness; its dark side is x = 0.
        if thickness > 0.0 {
            build.cuboid("white", vec3(-thickness, 0.0, -1.0), vec3(0.0, 1.0, 1.0));
        } else {
            let corners = [(0.0, -1.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
            build.polygon("white", &corners.map(|(y, z)| vec3(0.0, y, z)));
        }
        let scene = build.load();
        // A pixel is 0.0004 wide where the wall meets the floor.
        let camera = camera(vec3(1.2, 1.0, 0.0), vec3(0.02, 0.0, 0.0), 0.6, size.0, size.1);
        let camera = turned(camera, size);
        let image = &draw(ShadingKind::Simple, &scene, true, &[camera], size)[0];
        let (mut gap, mut seen) = (0.0f64, 0);
        for y in 0..size.1 {
            for x in 0..size.0 {
                let p = floor_point(&camera, x, y);
                let hit = scene.intersect(&camera.ray(x as f32 + 0.5, y as f32 + 0.5));
                let floor = hit.is_some_and(|hit| hit.p.y.abs() < 1e-5 && hit.ng.y > 0.5);
                if p[0] > 0.0 && floor {
                    seen += 1;
                    if image.at(x, y) != Vec3::ZERO {
                        gap = gap.max(p[0]);
                    }
                }
            }
        }
        assert!(seen > 1000, "only {seen} pixels of the floor seen");
        println!("light {light}, wall {thickness}: gap {gap:.5} scene units");
        let distance = f64::from(light.length());
        assert!(gap < 0.0015 * distance, "light {light}, wall {thickness}: gap {gap}");
    }
}

/// The same camera; its film is wide, so that the picture's rows run across the contact.
fn turned(camera: Camera, (width, height): (usize, usize)) -> Camera {
    let config = basecode::CameraConfig { up: Vec3::Z, ..*camera.config() };
    Camera::new(config, width, height).unwrap()
}
