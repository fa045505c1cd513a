//! Drawing tests. They need a graphics adapter, and fail where there is none.

mod shading;
mod shadows;
mod template;

use std::fmt::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use basecode::gpu::{AdapterKind, Gpu, Target};
use basecode::{Camera, CameraConfig, Image, Ray, Renderer, Scene, ShadingKind, Vec3, vec3};

use crate::Reference;

/// A scene in the making: the text of an OBJ and an MTL file.
struct Build {
    obj: String,
    mtl: String,
    vertices: usize,
}

impl Build {
    /// A scene with nothing but a light: a triangle of 0.1 mm around it.
    fn new(light: Vec3, intensity: Vec3) -> Self {
        let mut build = Self { obj: "mtllib s.mtl\n".into(), mtl: String::new(), vertices: 0 };
        build.material("light", &format!("Kd 0 0 0\nKe {}\nillum 7", text(intensity)));
        let corners = [vec3(2.0, -1.0, 0.0), vec3(-1.0, 2.0, 0.0), vec3(-1.0, -1.0, 0.0)];
        build.polygon("light", &corners.map(|corner| light + 1e-4 * corner));
        build
    }

    fn material(&mut self, name: &str, statements: &str) {
        writeln!(self.mtl, "newmtl {name}\n{statements}").unwrap();
    }

    /// A square of side 8 in y = 0, seen from above.
    fn floor(&mut self, material: &str) {
        let corners = [(-4.0, 4.0), (4.0, 4.0), (4.0, -4.0), (-4.0, -4.0)];
        self.polygon(material, &corners.map(|(x, z)| vec3(x, 0.0, z)));
    }

    /// A flat polygon, anticlockwise when seen from outside.
    fn polygon(&mut self, material: &str, corners: &[Vec3]) {
        writeln!(self.obj, "o {material}{}\nusemtl {material}", self.vertices).unwrap();
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        for corner in corners {
            writeln!(self.obj, "v {}\nvn {}", text(*corner), text(normal)).unwrap();
        }
        self.obj.push('f');
        for _ in corners {
            self.vertices += 1;
            write!(self.obj, " {0}//{0}", self.vertices).unwrap();
        }
        self.obj.push('\n');
    }

    /// The six faces of a box, normals outward.
    fn cuboid(&mut self, material: &str, low: Vec3, high: Vec3) {
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for side in [low, high] {
                let mut corners = [Vec3::ZERO; 4];
                for (corner, (a, b)) in
                    corners.iter_mut().zip([(low, low), (high, low), (high, high), (low, high)])
                {
                    corner[axis] = side[axis];
                    corner[u] = a[u];
                    corner[v] = b[v];
                }
                // Inside out when `low` and `high` are exchanged.
                if side[axis] == low[axis] {
                    corners.reverse();
                }
                self.polygon(material, &corners);
            }
        }
    }

    /// A sphere of many triangles with smooth normals.
    fn sphere(&mut self, material: &str, center: Vec3, radius: f32) {
        let (rows, columns) = (96, 192);
        writeln!(self.obj, "o sphere{}\nusemtl {material}", self.vertices).unwrap();
        for row in 0..=rows {
            for column in 0..columns {
                let theta = std::f32::consts::PI * row as f32 / rows as f32;
                let phi = std::f32::consts::TAU * column as f32 / columns as f32;
                let n = vec3(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
                writeln!(self.obj, "v {}\nvn {}", text(center + radius * n), text(n)).unwrap();
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let at = |row, column| self.vertices + 1 + row * columns + column % columns;
                let (a, b) = (at(row, column), at(row, column + 1));
                let (c, d) = (at(row + 1, column + 1), at(row + 1, column));
                writeln!(self.obj, "f {a}//{a} {b}//{b} {c}//{c} {d}//{d}").unwrap();
            }
        }
        self.vertices += (rows + 1) * columns;
    }

    /// Writes the files to a folder of their own, loads the scene and removes them.
    fn load(&self) -> Scene {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder: PathBuf =
            std::env::temp_dir().join(format!("reference-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("s.toml"), "[input]\nobjfile = \"s.obj\"\n").unwrap();
        std::fs::write(folder.join("s.obj"), &self.obj).unwrap();
        std::fs::write(folder.join("s.mtl"), &self.mtl).unwrap();
        let scene =
            Scene::load(&folder.join("s.toml"), &|material| Reference::default().bsdf(material));
        std::fs::remove_dir_all(&folder).unwrap();
        scene.unwrap()
    }
}

fn text(v: Vec3) -> String {
    format!("{} {} {}", v.x, v.y, v.z)
}

fn camera(eye: Vec3, at: Vec3, fov_y_deg: f32, width: usize, height: usize) -> Camera {
    let up = if (at - eye).normalize().y.abs() > 0.99 { Vec3::Z } else { Vec3::Y };
    Camera::new(CameraConfig { eye, at, up, fov_y_deg }, width, height).unwrap()
}

/// What the reference draws of `scene`, for each camera.
fn draw(
    kind: ShadingKind,
    scene: &Scene,
    shadow_map: bool,
    cameras: &[Camera],
    (width, height): (usize, usize),
) -> Vec<Image> {
    let gpu = Gpu::open(AdapterKind::Any, "").expect("these tests need a graphics adapter");
    let target = Target::new(&gpu, width, height).unwrap();
    let mut pass = gpu
        .checked(&mut || Reference::default().render_pass(kind, &gpu, scene, shadow_map))
        .expect("the pass opens");
    let mut draw = |camera: &Camera| {
        gpu.checked(&mut || pass.draw(&gpu, camera, &target)).expect("the pass draws");
        target.read_back(&gpu).expect("the image comes back")
    };
    cameras.iter().map(&mut draw).collect()
}

/// Radiance through the pixel centers by the offline renderer.
fn trace(
    kind: ShadingKind,
    scene: &Scene,
    shadows: bool,
    camera: &Camera,
    (width, height): (usize, usize),
) -> Image {
    let integrator = Reference::default().integrator(kind, shadows).unwrap();
    let mut image = Image::new(width, height);
    let sampler = basecode::Sampler::new(1);
    for (index, pixel) in image.pixels.iter_mut().enumerate() {
        let (x, y) = ((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
        *pixel = integrator.radiance(scene, &camera.ray(x, y), &sampler);
    }
    image
}

/// Whether two radiances agree within 2e-3 of `b`.
fn agree(a: Vec3, b: Vec3) -> bool {
    // A non-finite `a` must not agree.
    (a - b).abs().cmple(2e-3 * b.abs() + 1e-6).all()
}

/// Where the ray through a pixel's center meets y = 0.
fn floor_point(camera: &Camera, x: usize, y: usize) -> [f64; 3] {
    let ray = camera.ray(x as f32 + 0.5, y as f32 + 0.5);
    let t = -f64::from(ray.origin.y) / f64::from(ray.direction.y);
    [0, 1, 2].map(|axis| f64::from(ray.origin[axis]) + t * f64::from(ray.direction[axis]))
}

/// Which pixels see the same shape, equally lit, as all others within `radius` pixels; an emitter
/// is none of them.
fn interior(
    scene: &Scene,
    camera: &Camera,
    (width, height): (usize, usize),
    radius: usize,
) -> Vec<bool> {
    let light = scene.first_light_position();
    let seen = |index: usize| {
        let (x, y) = ((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
        let hit = scene.intersect(&camera.ray(x, y))?;
        let way = light - hit.p;
        let shadow_ray = Ray::segment(hit.p, way.normalize(), Ray::EPSILON, way.length() - 1e-3);
        Some((hit.shape, scene.occluded(&shadow_ray)))
    };
    let seen: Vec<_> = (0..width * height).map(seen).collect();
    let same_around = |index: usize| {
        let (x, y) = (index % width, index / width);
        let columns = x.saturating_sub(radius)..=(x + radius).min(width - 1);
        let mut rows = y.saturating_sub(radius)..=(y + radius).min(height - 1);
        rows.all(|row| columns.clone().all(|column| seen[row * width + column] == seen[index]))
    };
    let emitter = |shape: usize| scene.material_of(shape).is_emitter();
    (0..width * height)
        .map(|index| same_around(index) && !seen[index].is_some_and(|(shape, _)| emitter(shape)))
        .collect()
}
