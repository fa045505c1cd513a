//! The stored expected images against a second renderer that shares nothing with the first: its own
//! reader of scene files, f64 throughout, every triangle tried for every ray, formulas of the
//! handout written down again.

#![allow(clippy::unwrap_used)] // its helpers are tests too

use std::collections::HashMap;
use std::path::Path;

use basecode::exr_io::read_exr_layers;
use basecode::glam::{DVec2, DVec3, dvec3};

/// Pixels of each image that are drawn again.
const PIXELS: usize = 1500;
/// Where a ray begins to hit, scene units.
const EPSILON: f64 = 1e-3;

#[derive(Clone, Default)]
struct Material {
    kd: DVec3,
    ks: DVec3,
    ke: DVec3,
    exponent: f64,
    diffuse: bool,
}

struct Triangle {
    corners: [DVec3; 3],
    normals: [DVec3; 3],
    material: String,
}

struct World {
    triangles: Vec<Triangle>,
    materials: HashMap<String, Material>,
    light: DVec3,
    intensity: DVec3,
}

fn vector(words: &[&str]) -> DVec3 {
    let numbers: Vec<f64> = words.iter().map(|word| word.parse().unwrap()).collect();
    dvec3(numbers[0], numbers[1], numbers[2])
}

fn materials(mtl: &str) -> HashMap<String, Material> {
    let (mut all, mut name) = (HashMap::new(), String::new());
    for line in mtl.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [key, rest @ ..] = words.as_slice() else { continue };
        if *key == "newmtl" {
            name = rest[0].to_owned();
            all.insert(name.clone(), Material::default());
        }
        let Some(material) = all.get_mut(&name) else { continue };
        match *key {
            "Kd" => material.kd = vector(rest),
            "Ks" => material.ks = vector(rest),
            "Ke" => material.ke = vector(rest),
            "Ns" => material.exponent = rest[0].parse().unwrap(),
            "illum" => material.diffuse = rest[0] == "7",
            _ => {}
        }
    }
    all
}

impl World {
    fn read(obj: &Path) -> Self {
        let materials = materials(&std::fs::read_to_string(obj.with_extension("mtl")).unwrap());
        let (mut positions, mut normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        let mut material = String::new();
        for line in std::fs::read_to_string(obj).unwrap().lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.as_slice() {
                ["v", rest @ ..] => positions.push(vector(rest)),
                ["vn", rest @ ..] => normals.push(vector(rest).normalize()),
                ["usemtl", name] => material = (*name).to_owned(),
                ["f", corners @ ..] => {
                    assert_eq!(corners.len(), 3, "{line}");
                    let index = |corner: &str, which: usize| {
                        corner.split('/').nth(which).unwrap().parse::<usize>().unwrap() - 1
                    };
                    let corners = [corners[0], corners[1], corners[2]];
                    triangles.push(Triangle {
                        corners: corners.map(|corner| positions[index(corner, 0)]),
                        normals: corners.map(|corner| normals[index(corner, 2)]),
                        material: material.clone(),
                    });
                }
                _ => {}
            }
        }
        let emitting = |triangle: &&Triangle| materials[&triangle.material].ke != DVec3::ZERO;
        let lamp: Vec<&Triangle> = triangles.iter().filter(emitting).collect();
        let sum: DVec3 = lamp.iter().flat_map(|triangle| triangle.corners).sum();
        let light = sum / (3 * lamp.len()) as f64;
        let intensity = materials[&lamp[0].material].ke;
        Self { triangles, materials, light, intensity }
    }

    /// The nearest triangle that a ray hits between `EPSILON` and `far`: distance, barycentric
    /// coordinates of its second and third corner, triangle.
    fn hit(
        &self,
        origin: DVec3,
        direction: DVec3,
        far: f64,
        wanted: impl Fn(&Triangle) -> bool,
    ) -> Option<(f64, DVec2, &Triangle)> {
        let mut nearest: Option<(f64, DVec2, &Triangle)> = None;
        for triangle in &self.triangles {
            let [a, b, c] = triangle.corners;
            let (ab, ac, to_a) = (b - a, c - a, a - origin);
            let volume = direction.dot(ab.cross(ac));
            let t = to_a.dot(ab.cross(ac)) / volume;
            let side = direction.cross(to_a);
            let uv = DVec2::new(-side.dot(ac), side.dot(ab)) / volume;
            // Without area the quotients are not finite, and no comparison holds.
            let inside = uv.x >= 0.0 && uv.y >= 0.0 && uv.x + uv.y <= 1.0;
            let limit = nearest.as_ref().map_or(far, |found| found.0);
            if inside && t > EPSILON && t < limit && wanted(triangle) {
                nearest = Some((t, uv, triangle));
            }
        }
        nearest
    }

    /// Radiance along a camera ray, W sr^-1 m^-2; nothing where it meets the light's own surface.
    fn radiance(&self, origin: DVec3, direction: DVec3) -> Option<DVec3> {
        let Some((t, uv, triangle)) = self.hit(origin, direction, f64::INFINITY, |_| true) else {
            return Some(DVec3::ZERO);
        };
        let material = &self.materials[&triangle.material];
        if material.ke != DVec3::ZERO {
            return None;
        }
        let [na, nb, nc] = triangle.normals;
        let normal = (na * (1.0 - uv.x - uv.y) + nb * uv.x + nc * uv.y).normalize();
        let point = origin + t * direction;
        let to_light = self.light - point;
        let distance = to_light.length();
        let (wi, wo) = (to_light / distance, -direction);
        let (cos_i, cos_o) = (normal.dot(wi), normal.dot(wo));
        if cos_i <= 0.0 || cos_o <= 0.0 {
            return Some(DVec3::ZERO);
        }
        let blocks = |triangle: &Triangle| self.materials[&triangle.material].ke == DVec3::ZERO;
        if self.hit(point, wi, distance - EPSILON, blocks).is_some() {
            return Some(DVec3::ZERO);
        }
        let pi = std::f64::consts::PI;
        let bsdf = if material.diffuse {
            material.kd / pi
        } else {
            let largest = (material.kd + material.ks).max_element();
            let scale = if largest > 1.0 { 0.99 / largest } else { 1.0 };
            let mirrored = 2.0 * cos_i * normal - wi;
            let lobe = mirrored.dot(wo).max(0.0).powf(material.exponent);
            let n = material.exponent;
            scale * (material.kd / pi + material.ks * ((n + 2.0) / (2.0 * pi) * lobe))
        };
        Some(self.intensity / (distance * distance) * bsdf * cos_i)
    }
}

/// The ray through a pixel's center; `camera` holds the lines of a TOML file.
fn camera_ray(toml: &str, width: usize, height: usize, x: usize, y: usize) -> (DVec3, DVec3) {
    let value = |key: &str| {
        let line = toml.lines().find(|line| line.starts_with(&format!("{key} ="))).unwrap();
        line.split('=').nth(1).unwrap().trim().trim_matches(['[', ']']).replace(',', " ")
    };
    let vector = |key| vector(&value(key).split_whitespace().collect::<Vec<_>>());
    let (eye, at, up) = (vector("eye"), vector("at"), vector("up"));
    let half = (value("fov").parse::<f64>().unwrap().to_radians() / 2.0).tan();
    let forward = (at - eye).normalize();
    let right = forward.cross(up).normalize();
    let above = right.cross(forward);
    let side = |pixel: usize| (2.0 * (pixel as f64 + 0.5)) / height as f64;
    let across = side(x) - width as f64 / height as f64;
    let down = side(y) - 1.0;
    (eye, (forward + half * (across * right - down * above)).normalize())
}

#[test]
fn stored_images_are_what_a_slow_tracer_in_f64_without_a_bvh_draws() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for name in ["sphere_diffuse", "sphere_phong", "cbox", "teapot"] {
        let folder = root.join("scenes/a2").join(name);
        let file = match name {
            "cbox" | "teapot" => format!("tinyrender/{name}_simple_offline.toml"),
            _ => format!("tinyrender/{name}_offline.toml"),
        };
        let toml = std::fs::read_to_string(folder.join(file)).unwrap();
        let world = World::read(&folder.join(format!("mesh/{name}.obj")));
        let stored = read_exr_layers(root.join(format!("expected/a2/{name}.exr"))).unwrap();
        let (center, mean) = (&stored.layers["centre"], &stored.layers["mean"]);
        let (width, height) = (center.width, center.height);
        let (mut lit, mut dark, mut wrong) = (0, 0, Vec::new());
        let (mut sum, mut sum_of_means) = (DVec3::ZERO, DVec3::ZERO);
        // A stride without a common factor with the width visits all columns.
        let stride = (width * height / PIXELS) | 1;
        for pixel in (stride / 2..width * height).step_by(stride) {
            let (x, y) = (pixel % width, pixel / width);
            let (eye, direction) = camera_ray(&toml, width, height, x, y);
            let Some(expected) = world.radiance(eye, direction) else { continue };
            let found = center.pixels[pixel].as_dvec3();
            if expected == DVec3::ZERO {
                dark += 1
            } else {
                lit += 1
            }
            if ((found - expected).abs() - 1e-3 * expected).max_element() > 1e-5 {
                wrong.push((x, y, found, expected));
            }
            sum += expected;
            sum_of_means += mean.pixels[pixel].as_dvec3();
        }
        // Rays that graze an edge may fall on the other side of it in f32.
        assert!(
            wrong.len() * 500 <= lit + dark,
            "{name}: {} of {} pixels differ: {:?}",
            wrong.len(),
            lit + dark,
            &wrong[..wrong.len().min(8)]
        );
        assert!(lit > PIXELS / 3 && dark > PIXELS / 100, "{name}: {lit} lit, {dark} dark");
        // The mean over jittered samples differs from the centers on edges alone.
        let bias = ((sum_of_means - sum) / sum).abs().max_element();
        assert!(bias < 0.02, "{name}: the stored mean lies {bias} off");
    }
}
