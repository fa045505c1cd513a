//! Rays of one thread beside Embree's, and how their cost grows.

use std::ffi::OsStr;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use basecode::{
    Bsdf, Bvh, Camera, CameraConfig, Ray, Sampler, Scene, SurfaceInteraction, Vec3, vec3,
};

use super::child::Server;
use super::figures::{Line, Samples};
use super::page::Curve;
use super::{Bench, knot};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
/// The kinds of rays, in the order of the file that Embree's side reads.
const KINDS: [(&str, &str); 3] = [
    ("camera rays", "rtcIntersect1"),
    ("shadow rays to a point", "rtcOccluded1"),
    ("shuffled bounces", "rtcIntersect1"),
];
/// What is measured: of which kind, and whether Umbra casts eight rays at once.
const WORK: [(&str, usize, bool); 5] = [
    ("camera rays", 0, false),
    ("camera rays, by eights", 0, true),
    ("shadow rays to a point", 1, false),
    ("shadow rays, by eights", 1, true),
    ("shuffled bounces", 2, false),
];
/// The pixels of eight rays at once.
const TILE: (usize, usize) = (4, 2);
const SCENES: [&str; 3] = ["sphere_diffuse", "teapot", "cbox"];

/// No ray asks for it.
struct Black;

impl Bsdf for Black {
    fn eval(&self, _: &SurfaceInteraction) -> Vec3 {
        Vec3::ZERO
    }
}

/// Triangles, and rays of each kind.
struct Cast {
    name: String,
    triangles: Vec<[Vec3; 3]>,
    bvh: Bvh,
    rays: [Vec<Ray>; 3],
    /// Camera and shadow rays again, in tiles of pixels.
    eights: [Vec<[Option<Ray>; 8]>; 2],
}

impl Cast {
    fn new(name: &str, triangles: Vec<[Vec3; 3]>, camera: Vec<Ray>, light: Vec3) -> Self {
        let bvh = build(&triangles);
        let sampler = Sampler::new(1);
        let shadow_ray = |ray: &Ray| {
            let p = ray.at(bvh.closest_hit(ray)?.t);
            let to_light = light - p;
            let distance = to_light.length();
            Some(Ray::segment(p, to_light / distance, 1e-3, distance - 1e-3))
        };
        let (mut shadow, mut bounces) = (Vec::new(), Vec::new());
        for ray in camera.iter().filter_map(shadow_ray) {
            let anywhere = Vec3::new(sampler.next_1d(), sampler.next_1d(), sampler.next_1d());
            bounces.push(Ray::new(ray.origin, (2.0 * anywhere - 1.0).normalize_or(Vec3::X)));
            shadow.push(ray);
        }
        for i in (1..bounces.len()).rev() {
            bounces.swap(i, (sampler.next_1d() * (i + 1) as f32) as usize);
        }
        let tiled: Vec<Ray> = (0..camera.len()).map(|i| camera[tiled(i)]).collect();
        let lit: Vec<Ray> = tiled.iter().filter_map(shadow_ray).collect();
        let eights = [tiled, lit].map(|rays| rays.chunks(8).map(eight).collect());
        Self { name: name.to_owned(), triangles, bvh, rays: [camera, shadow, bounces], eights }
    }

    fn of_scene(root: &Path, name: &str) -> anyhow::Result<Self> {
        let file = match name {
            "teapot" | "cbox" => format!("{name}_simple_offline.toml"),
            _ => format!("{name}_offline.toml"),
        };
        let path = root.join("scenes/a2").join(name).join("tinyrender").join(file);
        let scene = Scene::load(&path, &|_| Box::new(Black))?;
        let view = scene.camera(WIDTH, HEIGHT)?;
        let at = |i: usize| view.ray((i % WIDTH) as f32 + 0.5, (i / WIDTH) as f32 + 0.5);
        let triangles = scene.shapes();
        let corners = triangles
            .iter()
            .flat_map(|shape| (0..shape.triangles.len()).map(move |i| shape.corners(i)));
        let camera = (0..WIDTH * HEIGHT).map(at).collect();
        Ok(Self::new(name, corners.collect(), camera, scene.first_light_position()))
    }

    fn of_knot(triangles: usize) -> anyhow::Result<Self> {
        let (eye, at) = (vec3(0.0, 0.0, 9.0), Vec3::ZERO);
        let camera = CameraConfig { eye, at, up: Vec3::Y, fov_y_deg: 45.0 };
        let view = Camera::new(camera, WIDTH, HEIGHT)?;
        let at = |i: usize| view.ray((i % WIDTH) as f32 + 0.5, (i / WIDTH) as f32 + 0.5);
        let corners = knot(triangles).corners();
        let name = format!("knot of {}", thousands(corners.len()));
        let rays = (0..WIDTH * HEIGHT).map(at).collect();
        Ok(Self::new(&name, corners, rays, vec3(4.0, 6.0, 8.0)))
    }

    /// Seconds that one thread takes for all rays of a kind, and what was hit.
    fn measure(&self, kind: usize, eight: bool) -> (f64, usize) {
        let begin = Instant::now();
        let Self { bvh, rays, .. } = self;
        let hits = match (kind, eight) {
            (1, true) => {
                self.eights[1].iter().flat_map(|rays| bvh.any_hits(rays)).filter(|hit| *hit).count()
            }
            (_, true) => {
                self.eights[kind].iter().flat_map(|rays| bvh.closest_hits(rays)).flatten().count()
            }
            (1, false) => rays[1].iter().filter(|ray| bvh.any_hit(ray)).count(),
            (_, false) => rays[kind].iter().filter(|ray| bvh.closest_hit(ray).is_some()).count(),
        };
        (begin.elapsed().as_secs_f64(), hits)
    }

    /// Rays beside both of Embree's ways to trace them. They must hit as much as the robust one's.
    fn beside(
        &self,
        (words, kind, eight): (&str, usize, bool),
        [plain, robust]: [&mut Server; 2],
        rounds: usize,
    ) -> anyhow::Result<[Line; 2]> {
        let [mut ours, mut theirs, mut safe] = <[Samples; 3]>::default();
        let (mut own_hits, mut safe_hits) = (0, 0);
        for _ in 0..rounds {
            let own = self.measure(kind, eight);
            theirs.push(plain.measure(&kind.to_string())?.0);
            let robust = robust.measure(&kind.to_string())?;
            ours.push(own.0);
            safe.push(robust.0);
            (own_hits, safe_hits) = (own.1, robust.1);
        }
        let count = self.rays[kind].len();
        anyhow::ensure!(
            own_hits.abs_diff(safe_hits) * 100 <= count,
            "{}, {words}: {own_hits} hits, Embree {safe_hits}",
            self.name
        );
        let rate = |samples: &Samples| format!("{:.1} M/s", count as f64 / samples.median() / 1e6);
        let call = KINDS[kind].1;
        let line = |anchor: String, theirs: &Samples| Line {
            work: format!("{words}, {}", self.name),
            anchor,
            theirs: rate(theirs),
            ours: rate(&ours),
            ratio: ours.faster_than(theirs).ratio(),
        };
        Ok([
            line(format!("Embree `{call}`"), &theirs),
            line(format!("Embree `{call}`, robust"), &safe),
        ])
    }

    /// The build of the BVH beside Embree's.
    fn build_beside(&self, embree: &mut Server, rounds: usize) -> anyhow::Result<Line> {
        let (mut ours, mut theirs) = (Samples::default(), Samples::default());
        for _ in 0..rounds {
            let begin = Instant::now();
            std::hint::black_box(build(&self.triangles));
            ours.push(begin.elapsed().as_secs_f64());
            theirs.push(embree.measure("build")?.0);
        }
        let work = format!("BVH, {}", self.name);
        Ok(Line::of_times(work, "Embree, all cores", &theirs, &ours))
    }

    fn write(&self, path: &Path) -> anyhow::Result<()> {
        let mut bytes = (self.triangles.len() as u32).to_le_bytes().to_vec();
        let mut put = |v: f32| bytes.extend(v.to_le_bytes());
        self.triangles.iter().flatten().for_each(|p| p.to_array().into_iter().for_each(&mut put));
        for rays in &self.rays {
            bytes.extend((rays.len() as u32).to_le_bytes());
            for ray in rays {
                let ends = [ray.min_t, ray.max_t];
                let all = ray.origin.to_array().into_iter().chain(ray.direction.to_array());
                all.chain(ends).for_each(|v| bytes.extend(v.to_le_bytes()));
            }
        }
        Ok(std::fs::File::create(path)?.write_all(&bytes)?)
    }
}

/// The pixel that comes at place `i` of a film in tiles, row by row of tiles.
fn tiled(i: usize) -> usize {
    let (wide, tall) = TILE;
    let (tile, within) = (i / (wide * tall), i % (wide * tall));
    let x = tile % (WIDTH / wide) * wide + within % wide;
    let y = tile / (WIDTH / wide) * tall + within / wide;
    y * WIDTH + x
}

fn eight(rays: &[Ray]) -> [Option<Ray>; 8] {
    std::array::from_fn(|i| rays.get(i).copied())
}

fn build(triangles: &[[Vec3; 3]]) -> Bvh {
    Bvh::new(triangles, &vec![true; triangles.len()])
}

fn thousands(count: usize) -> String {
    match count {
        1_000_000.. => format!("{:.1}M", count as f64 / 1e6),
        _ => format!("{:.0}k", count as f64 / 1e3),
    }
}

/// The table's rows, and plots of millions of rays a second against the number of triangles.
///
/// # Errors
/// When Embree's side does not compile, or hits other triangles.
pub fn run(bench: &Bench) -> anyhow::Result<(Vec<Line>, Vec<Curve>)> {
    let program = bench.folder.join("embree");
    let source = bench.root.join("xtask/bench/embree.cpp");
    super::child::compile(&source, &program, &[bench.embree_library()])?;
    let mut casts = Vec::new();
    for name in SCENES {
        casts.push(Cast::of_scene(&bench.root, name)?);
    }
    casts.push(Cast::of_knot(200_000)?);
    let mut lines: [Vec<Line>; 6] = Default::default();
    for cast in &casts {
        let file = bench.folder.join("rays.bin");
        cast.write(&file)?;
        let mut plain = Server::start(&program, &[file.as_os_str()])?;
        let mut robust = Server::start(&program, &[file.as_os_str(), OsStr::new("robust")])?;
        for (row, work) in WORK.into_iter().enumerate() {
            lines[row].extend(cast.beside(work, [&mut plain, &mut robust], bench.rounds)?);
        }
        if cast.triangles.len() > 100_000 {
            lines[5].push(cast.build_beside(&mut plain, bench.rounds)?);
        }
    }
    Ok((lines.into_iter().flatten().collect(), growth(bench, &program)?))
}

/// Rays against triangles.
fn growth(bench: &Bench, program: &Path) -> anyhow::Result<Vec<Curve>> {
    let mut curves: Vec<Curve> = ["Umbra", "Embree"]
        .iter()
        .flat_map(|who| KINDS.iter().map(move |(kind, _)| Curve::new(&format!("{who}, {kind}"))))
        .collect();
    for count in [1_000, 8_000, 64_000, 500_000, 4_000_000] {
        let cast = Cast::of_knot(count).context("a knot")?;
        let file = bench.folder.join("rays.bin");
        cast.write(&file)?;
        let mut embree = Server::start(program, &[file.as_os_str()])?;
        for kind in 0..KINDS.len() {
            let (mut ours, mut theirs) = (Samples::default(), Samples::default());
            for _ in 0..3 {
                ours.push(cast.measure(kind, false).0);
                theirs.push(embree.measure(&kind.to_string())?.0);
            }
            for (side, samples) in [ours, theirs].iter().enumerate() {
                let rate = cast.rays[kind].len() as f64 / samples.median() / 1e6;
                curves[3 * side + kind].push(cast.triangles.len() as f64, rate);
            }
        }
    }
    Ok(curves)
}
