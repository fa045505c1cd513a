//! Rays of one thread against the assignment's scenes: `cargo bench -p basecode --bench ray_casting`.

use std::path::Path;
use std::sync::LazyLock;

use basecode::{Bsdf, Ray, Sampler, Scene, SurfaceInteraction, Vec3};
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};

const SCENES: [&str; 3] = ["sphere_diffuse", "teapot", "cbox"];
const WIDTH: usize = 320;
const HEIGHT: usize = 240;

/// No ray asks for it.
struct Black;

impl Bsdf for Black {
    fn eval(&self, _: &SurfaceInteraction) -> Vec3 {
        Vec3::ZERO
    }
}

/// A scene and the rays that are cast into it.
struct Cast {
    scene: Scene,
    camera: Vec<Ray>,
    /// From the points that camera rays meet to the light.
    shadow: Vec<Ray>,
    /// From there to anywhere, in no order.
    bounces: Vec<Ray>,
}

impl Cast {
    fn new(name: &str) -> Self {
        let file = match name {
            "teapot" | "cbox" => format!("{name}_simple_offline.toml"),
            _ => format!("{name}_offline.toml"),
        };
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let path = root.join("scenes/a2").join(name).join("tinyrender").join(file);
        let scene = Scene::load(&path, &|_| Box::new(Black)).expect("a scene of the repository");
        let view = scene.camera(WIDTH, HEIGHT).expect("a camera");
        let at = |i: usize| view.ray((i % WIDTH) as f32 + 0.5, (i / WIDTH) as f32 + 0.5);
        let camera: Vec<Ray> = (0..WIDTH * HEIGHT).map(at).collect();
        let light = scene.first_light_position();
        let sampler = Sampler::new(1);
        let (mut shadow, mut bounces) = (Vec::new(), Vec::new());
        for hit in camera.iter().filter_map(|ray| scene.intersect(ray)) {
            let to_light = light - hit.p;
            let distance = to_light.length();
            shadow.push(Ray::segment(hit.p, to_light / distance, 1e-3, distance - 1e-3));
            let anywhere = Vec3::new(sampler.next_1d(), sampler.next_1d(), sampler.next_1d());
            bounces.push(Ray::new(hit.p, (2.0 * anywhere - 1.0).normalize_or(Vec3::X)));
        }
        for i in (1..bounces.len()).rev() {
            bounces.swap(i, (sampler.next_1d() * (i + 1) as f32) as usize);
        }
        Self { scene, camera, shadow, bounces }
    }
}

static CASTS: LazyLock<Vec<Cast>> =
    LazyLock::new(|| SCENES.iter().map(|name| Cast::new(name)).collect());

fn main() {
    LazyLock::force(&CASTS);
    divan::main();
}

fn cast(name: &str) -> &'static Cast {
    &CASTS[SCENES.iter().position(|own| *own == name).expect("one of them")]
}

fn count(bencher: Bencher, rays: &'static [Ray], hits: impl Fn(&Ray) -> bool + Sync) {
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench(|| rays.iter().filter(|ray| hits(black_box(ray))).count());
}

#[divan::bench(args = SCENES)]
fn camera(bencher: Bencher, name: &str) {
    let Cast { scene, camera, .. } = cast(name);
    count(bencher, camera, |ray| scene.intersect(ray).is_some());
}

#[divan::bench(args = SCENES)]
fn shadow(bencher: Bencher, name: &str) {
    let Cast { scene, shadow, .. } = cast(name);
    count(bencher, shadow, |ray| scene.occluded(ray));
}

#[divan::bench(args = SCENES)]
fn bounces(bencher: Bencher, name: &str) {
    let Cast { scene, bounces, .. } = cast(name);
    count(bencher, bounces, |ray| scene.intersect(ray).is_some());
}
