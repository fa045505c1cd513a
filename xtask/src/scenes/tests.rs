//! Tests of the scenes as they are written: the OBJ text is parsed again.

use super::bezier::{sweep, tube};
use super::exporting::{decimal, scene_files};
use super::mesh::Mesh;
use super::newell::{TEACUP_HANDLE, TEACUP_PROFILES, TEAPOT_HANDLE, TEAPOT_PROFILES, TEAPOT_SPOUT};
use super::scene::{Material, Scene};
use super::shapes::{cuboid, sphere};
use super::teapot::{teacup_handle, teacup_mesh, teapot_handle, teapot_mesh};
use super::{all, check, files, probes};
use glam::{DVec2, DVec3, dvec3};
use std::collections::HashMap;
use std::f64::consts::PI;

/// A triangle as written: positions and normals.
struct Triangle {
    p: [DVec3; 3],
    n: [DVec3; 3],
}

/// Triangles by shape name, read back from the OBJ text.
fn parsed(scene: &Scene) -> Vec<(String, Vec<Triangle>)> {
    let files = scene_files(scene).unwrap();
    let file = files.iter().find(|file| file.path.ends_with(".obj")).unwrap();
    let text = std::str::from_utf8(&file.bytes).unwrap();
    let (mut v, mut vn, mut uvs, mut shapes) = (Vec::new(), Vec::new(), 0, Vec::new());
    for line in text.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let vector = || DVec3::from_array([1, 2, 3].map(|i| words[i].parse().unwrap()));
        match words[0] {
            "v" => v.push(vector()),
            "vn" => vn.push(vector()),
            "vt" => uvs += 1,
            "o" => shapes.push((words[1].to_string(), Vec::new())),
            "usemtl" => assert_eq!(words[1], shapes.last().unwrap().0),
            "f" => {
                let corner = [1, 2, 3].map(|i| {
                    words[i].split('/').map(|x| x.parse().unwrap()).collect::<Vec<usize>>()
                });
                assert!(corner.iter().all(|c| c.len() == 3 && c[1] <= uvs));
                let (p, n) = (corner.clone().map(|c| v[c[0] - 1]), corner.map(|c| vn[c[2] - 1]));
                shapes.last_mut().unwrap().1.push(Triangle { p, n });
            }
            _ => {}
        }
    }
    shapes
}

/// Directed edges without a partner in the other direction, by position to five decimals.
fn open_edges(mesh: &Mesh) -> Vec<[DVec3; 2]> {
    let key = |p: DVec3| p.to_array().map(|x| (x * 1e5).round() as i64);
    let mut balance: HashMap<_, (i32, [DVec3; 2])> = HashMap::new();
    for triangle in &mesh.triangles {
        let p = triangle.map(|i| mesh.vertices[i as usize].position);
        for (a, b) in [(p[0], p[1]), (p[1], p[2]), (p[2], p[0])] {
            let (ka, kb) = (key(a), key(b));
            let (edge, sign) = if ka < kb { ((ka, kb), 1) } else { ((kb, ka), -1) };
            balance.entry(edge).or_insert((0, [a, b])).0 += sign;
        }
    }
    balance.into_values().filter(|(count, _)| *count != 0).map(|(_, edge)| edge).collect()
}

/// How often a closed mesh winds around a point: 1 inside, 0 outside (sum of solid angles, van Oosterom and Strackee).
fn winding(mesh: &Mesh, point: DVec3) -> f64 {
    let angle: f64 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| mesh.vertices[i as usize].position - point);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * a.dot(b.cross(c)).atan2(below)
        })
        .sum();
    angle / (4.0 * PI)
}

/// The enclosed volume; negative when the mesh is inside out.
fn volume(mesh: &Mesh) -> f64 {
    let corner = |t: &[u32; 3]| t.map(|i| mesh.vertices[i as usize].position);
    mesh.triangles.iter().map(corner).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

/// The distance of a point from a triangle.
fn distance(point: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a).normalize();
    let foot = point - normal * (point - a).dot(normal);
    let edges = [(a, b), (b, c), (c, a)];
    if edges.iter().all(|&(p, q)| (q - p).cross(foot - p).dot(normal) >= 0.0) {
        return point.distance(foot);
    }
    let to_edge = |(p, q): (DVec3, DVec3)| {
        let t = ((point - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0);
        point.distance(p + (q - p) * t)
    };
    edges.map(to_edge).into_iter().fold(f64::INFINITY, f64::min)
}

/// Whether the segment between two points meets a triangle (Moller and Trumbore).
fn meets([a, b, c]: [DVec3; 3], from: DVec3, to: DVec3) -> bool {
    let (e1, e2, d) = (b - a, c - a, to - from);
    let p = d.cross(e2);
    let det = e1.dot(p);
    let (s, q) = (from - a, (from - a).cross(e1));
    let (u, v, t) = (s.dot(p) / det, d.dot(q) / det, e2.dot(q) / det);
    det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-4 && t < 1.0
}

#[test]
fn committed_files_are_current_and_small() {
    check().unwrap();
    let bytes: usize = files().unwrap().iter().map(|file| file.bytes.len()).sum();
    assert!(bytes < 6_000_000, "{bytes} bytes");
}

#[test]
fn decimals_are_short() {
    let cases =
        [(1.0, "1"), (-0.000001, "0"), (0.123456, "0.12346"), (-2.5, "-2.5"), (100.0, "100")];
    for (value, text) in cases {
        assert_eq!(decimal(value, 5), text);
    }
    assert_eq!(decimal(100.0, 0), "100");
}

#[test]
fn triangles_have_area_and_normals_agree_with_the_winding() {
    for scene in all() {
        for (name, triangles) in parsed(&scene) {
            assert!(!triangles.is_empty(), "{} {name}", scene.folder);
            for Triangle { p, n } in triangles {
                let cross = (p[1] - p[0]).cross(p[2] - p[0]);
                let longest = p[0].distance(p[1]).max(p[1].distance(p[2])).max(p[2].distance(p[0]));
                assert!(
                    cross.length() > 1e-3 * longest * longest,
                    "{} {name}: sliver {p:?}",
                    scene.folder
                );
                for n in n {
                    assert!((n.length() - 1.0).abs() < 2e-5, "{} {name}: normal {n}", scene.folder);
                    assert!(
                        n.dot(cross.normalize()) > 0.3,
                        "{} {name}: {n} against {cross} at {p:?}",
                        scene.folder
                    );
                }
            }
        }
    }
}

#[test]
fn one_emitter_whose_index_mean_is_the_light() {
    for scene in all() {
        let emitters =
            scene.shapes.iter().filter(|shape| matches!(shape.material, Material::Emitter { .. }));
        assert_eq!(emitters.count(), 1, "{}", scene.folder);
        let shapes = parsed(&scene);
        let (name, triangles) = shapes.last().unwrap();
        assert_eq!(name, "light");
        // As a loader sees it: positions are f32.
        let positions: Vec<DVec3> =
            triangles.iter().flat_map(|t| t.p).map(|p| p.as_vec3().as_dvec3()).collect();
        let mean = positions.iter().sum::<DVec3>() / positions.len() as f64;
        assert!(mean.distance(scene.light()) < 1e-6, "{}: {mean}", scene.folder);
        assert!(triangles.iter().all(|t| t.p.map(DVec3::as_vec3).windows(2).all(|w| w[0] != w[1])));
    }
}

#[test]
fn surfaces_keep_clear_of_the_light() {
    for scene in all() {
        let light = scene.light();
        let bound = 0.01 * light.distance(scene.camera.at);
        for (name, triangles) in parsed(&scene).iter().filter(|(name, _)| name != "light") {
            let nearest =
                triangles.iter().map(|t| distance(light, t.p)).fold(f64::INFINITY, f64::min);
            assert!(
                nearest > bound,
                "{} {name}: {nearest} from the light, bound {bound}",
                scene.folder
            );
        }
    }
}

#[test]
fn closed_meshes_are_watertight_and_right_side_out() {
    let ball = sphere(dvec3(0.5, 0.5, 0.5), 1.0);
    let (pot, cup) = (sweep(&TEAPOT_PROFILES, 12), sweep(&TEACUP_PROFILES, 12));
    let block = cuboid(DVec3::ZERO, dvec3(1.0, 2.0, 3.0));
    for mesh in [&ball, &pot, &cup, &block] {
        assert_eq!(open_edges(mesh).len(), 0);
    }
    assert!((volume(&ball) / (4.0 / 3.0 * PI) - 1.0).abs() < 0.01, "{}", volume(&ball));
    assert!((volume(&block) - 6.0).abs() < 1e-12);
    // The pot is about a cylinder of radius 1.8 and height 2.4; the cup holds its tea outside the mesh.
    assert!((15.0..32.0).contains(&volume(&pot)), "{}", volume(&pot));
    assert!(volume(&cup) > 1.0);
    assert!((winding(&pot, dvec3(0.0, 1.0, 0.0)) - 1.0).abs() < 1e-6);
    assert!(winding(&cup, dvec3(0.0, 1.5, 0.0)).abs() < 1e-6);
}

#[test]
fn handles_and_spout_end_inside_what_they_grow_from() {
    let inside =
        |body: &Mesh, end: &[DVec3]| end.iter().all(|&p| (winding(body, p) - 1.0).abs() < 1e-6);
    let ends = |tube: &Mesh, x_split: &dyn Fn(DVec3) -> bool| -> Vec<DVec3> {
        open_edges(tube).into_iter().map(|edge| edge[0]).filter(|&p| x_split(p)).collect()
    };
    let (pot, cup) = (sweep(&TEAPOT_PROFILES, 12), sweep(&TEACUP_PROFILES, 12));
    let handle = ends(&teapot_handle(), &|_| true);
    assert_eq!(handle.len(), 48);
    assert!(inside(&pot, &handle));
    let spout = tube(&TEAPOT_SPOUT, 12);
    assert!(inside(&pot, &ends(&spout, &|p| p.x < 2.0)));
    assert_eq!(ends(&spout, &|p| p.x > 2.0).len(), 24);
    assert!(inside(&cup, &ends(&teacup_handle(), &|_| true)));
    // The published ones would not do.
    assert!(!inside(&pot, &ends(&tube(&TEAPOT_HANDLE, 12), &|_| true)));
    assert!(!inside(&cup, &ends(&tube(&TEACUP_HANDLE, 12), &|_| true)));
}

#[test]
fn teapot_and_teacup_have_their_published_size() {
    let bounds = |mesh: &Mesh| {
        let positions = || mesh.vertices.iter().map(|v| v.position);
        (
            positions().fold(DVec3::INFINITY, DVec3::min),
            positions().fold(DVec3::NEG_INFINITY, DVec3::max),
        )
    };
    let (low, high) = bounds(&teapot_mesh());
    assert!(low.distance(dvec3(-2.95, 0.0, -2.0)) < 0.01, "{low}");
    assert!(high.distance(dvec3(3.434, 3.15, 2.0)) < 0.01, "{high}");
    let (low, high) = bounds(&teacup_mesh());
    // The saucer's rim bulges to 3/4 of the way from 3.20455 to 3.525.
    assert!(
        (high.x - 3.4449).abs() < 1e-3 && (low.z + 3.4449).abs() < 1e-3 && low.y.abs() < 1e-9,
        "{low} {high}"
    );
    assert!((high.y - (2.72386 + 0.75 * 0.40057)).abs() < 1e-3, "{high}");
}

#[test]
fn one_frustum_from_the_light_holds_every_caster() {
    for scene in all().iter().filter(|scene| scene.bonus) {
        let light = scene.light();
        let casters = scene
            .shapes
            .iter()
            .filter(|s| ["sphere", "tea", "plate", "screen"].iter().any(|n| s.name.starts_with(n)));
        let ways: Vec<DVec3> = casters
            .flat_map(|s| &s.mesh.vertices)
            .map(|v| (v.position - light).normalize())
            .collect();
        assert!(ways.len() > 1000);
        let axis = ways.iter().sum::<DVec3>().normalize();
        let widest_deg =
            ways.iter().map(|w| w.angle_between(axis).to_degrees()).fold(0.0, f64::max);
        assert!(widest_deg < 55.0, "{}: {widest_deg} degrees off the axis", scene.folder);
    }
}

#[test]
fn the_leaves_block_the_last_tenth_alone() {
    let scene = probes::all().into_iter().find(|scene| scene.name == "near_light").unwrap();
    let (light, shapes) = (scene.light(), parsed(&scene));
    let named = |name: &str| &shapes.iter().find(|(own, _)| own == name).unwrap().1;
    // Of points all over the floor, many lie in the shadow of each leaf, and none of it is left at 0.9 r.
    let floor = (0..40).flat_map(|i| (0..40).map(move |k| (f64::from(i), f64::from(k))));
    let floor: Vec<DVec3> = floor.map(|(i, k)| dvec3(0.1 * i - 2.0, 0.0, 0.1 * k - 2.0)).collect();
    for leaf in ["leaf", "far_leaf"] {
        let shadowed = |far: f64| {
            let hides =
                |p: &&DVec3| named(leaf).iter().any(|t| meets(t.p, **p, **p + (light - **p) * far));
            floor.iter().filter(hides).count()
        };
        assert!(shadowed(1.0) > 100, "{leaf}: {}", shadowed(1.0));
        assert_eq!(shadowed(0.93), 0, "{leaf}");
    }
}

#[test]
fn the_speckled_scale_is_the_largest_texels() {
    let scene = probes::all().into_iter().find(|scene| scene.name == "speckled").unwrap();
    // As base code decodes them: 8-bit sRGB to linear.
    let linear = |level: u8| {
        let x = f64::from(level) / 255.0;
        if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
    };
    let each = |of: &dyn Fn(&[f64]) -> f64| -> [f64; 3] {
        [0, 1, 2].map(|channel| {
            let values = scene.textures.iter().map(|texture| {
                let texels: Vec<f64> =
                    texture.image.pixels().map(|texel| linear(texel.0[channel])).collect();
                of(&texels)
            });
            values.sum()
        })
    };
    let largest = each(&|texels| texels.iter().copied().fold(0.0, f64::max));
    let average = each(&|texels| texels.iter().sum::<f64>() / texels.len() as f64);
    assert!(largest[0] > 1.05 && largest[1] < 0.99 && largest[2] < 0.99, "{largest:?}");
    assert!(average.iter().all(|m| *m < 0.9), "{average:?}");
}

#[test]
fn nothing_is_hidden_in_the_open() {
    let scene = probes::all().into_iter().find(|scene| scene.name == "open").unwrap();
    let shapes = parsed(&scene);
    let triangles =
        || shapes.iter().filter(|(name, _)| name != "light").flat_map(|(_, triangles)| triangles);
    for point in triangles().step_by(11).map(|t| (t.p[0] + t.p[1] + t.p[2]) / 3.0) {
        for other in [scene.light(), scene.camera.eye] {
            assert!(!triangles().any(|t| meets(t.p, point, other)), "{point} does not see {other}");
        }
    }
}

#[test]
fn the_large_emitter_tells_its_means_apart() {
    let scene = probes::all().into_iter().find(|scene| scene.name == "emitter").unwrap();
    let mesh = &scene.shapes.last().unwrap().mesh;
    let corners: Vec<DVec2> =
        mesh.vertices.iter().map(|v| DVec2::new(v.position.x, v.position.z)).collect();
    let light = DVec2::new(scene.light().x, scene.light().z);
    let count = corners.len();
    let edges = || (0..count).map(|i| (corners[i], corners[(i + 1) % count]));
    assert!(edges().all(|(a, b)| (b - a).perp_dot(light - a) > 0.3), "{light} is not well inside");
    let area: f64 = edges().map(|(a, b)| a.perp_dot(b) / 2.0).sum();
    let centroid = edges().map(|(a, b)| (a + b) * a.perp_dot(b)).sum::<DVec2>() / (6.0 * area);
    let low = corners.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let high = corners.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
    for other in
        [corners.iter().sum::<DVec2>() / count as f64, centroid, (low + high) / 2.0, corners[0]]
    {
        assert!(other.distance(light) > 0.2, "{light} against {other}");
    }
}
