//! `xtask bench`: measures Umbra beside other programs that do the same work, in one run.

pub mod child;
mod figures;
mod files;
mod page;
mod rays;
mod renders;
mod submissions;
mod workers;

use std::path::{Path, PathBuf};
use std::process::Command;

use basecode::{Vec3, vec3};

/// Options of `xtask bench`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Measure each pair this many times
    #[arg(long, default_value_t = 7)]
    rounds: usize,
    /// Print the table only, do not write docs/performance.md
    #[arg(long)]
    dry: bool,
    /// Leave out images of 8K, which take most of the time, and 2 GB of disk
    #[arg(long)]
    without_8k: bool,
    /// Only what has this in its name: compare, rays, renders, objects, workers, submissions
    only: Option<String>,
}

/// Where things are, and how often they are measured.
struct Bench {
    root: PathBuf,
    /// For files that are made.
    folder: PathBuf,
    umbra: PathBuf,
    rounds: usize,
    without_8k: bool,
}

impl Bench {
    /// Debian 12 has Embree 3, later ones have 4.
    fn embree_library(&self) -> &'static str {
        match Path::new("/usr/include/embree4").exists() {
            true => "-lembree4",
            false => "-lembree3",
        }
    }
}

/// Runs it, and returns the table.
///
/// # Errors
/// When a program that is compared with cannot be run, or a file cannot be written.
pub fn run(root: &Path, arguments: &Arguments) -> anyhow::Result<String> {
    let folder = root.join("target/umbra/bench");
    std::fs::create_dir_all(&folder)?;
    let umbra = root.join("target/release/umbra");
    let Arguments { rounds, without_8k, .. } = *arguments;
    let bench = Bench { root: root.to_owned(), folder, umbra, rounds, without_8k };
    let wanted = |name: &str| arguments.only.as_deref().is_none_or(|only| name.contains(only));
    let (mut lines, mut plots) = (Vec::new(), Vec::new());
    if wanted("compare") {
        eprintln!("comparison beside idiff ...");
        let (table, curves) = files::compare(&bench)?;
        lines.extend(table);
        let words = "Comparison against pixels:";
        plots.push(("comparison", words, ["million pixels", "seconds, wall"], curves));
    }
    if wanted("rays") {
        eprintln!("rays beside Embree ...");
        let (table, curves) = rays::run(&bench)?;
        lines.extend(table);
        let words = "Rays against triangles, on knots of 1,000 to 4 million:";
        plots.push(("rays", words, ["triangles", "million rays a second"], curves));
    }
    if wanted("renders") {
        eprintln!("the teapot beside Mitsuba ...");
        lines.extend(renders::run(&bench)?);
    }
    if wanted("objects") {
        eprintln!("OBJ beside tinyobjloader ...");
        lines.extend(files::objects(&bench)?);
    }
    if wanted("workers") {
        eprintln!("worker start ...");
        lines.extend(workers::run(&bench)?);
    }
    if wanted("submissions") {
        eprintln!("submissions beside what they take by hand ...");
        let (table, curves) = submissions::run(&bench)?;
        lines.extend(table);
        let words = "CPU time of a batch against its submissions:";
        plots.push(("batch", words, ["submissions", "seconds, CPU"], curves));
    }
    let table: Vec<String> = lines
        .iter()
        .map(|l| format!("{} | {} {} | {} | {}", l.work, l.anchor, l.theirs, l.ours, l.ratio))
        .collect();
    if !arguments.dry && arguments.only.is_none() {
        page::write(root, &about(), &lines, &plots)?;
    }
    Ok(table.join("\n"))
}

/// Machine, anchors and date.
fn about() -> String {
    let said = |program: &str, arguments: &[&str]| {
        let output = Command::new(program).args(arguments).output();
        let text = output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
        text.unwrap_or_default()
    };
    let cpus = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpus.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or_default();
    let model = model.trim_start_matches([' ', '\t', ':']);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let version = |package: &str| said("dpkg-query", &["-W", "-f", "${Version}", package]);
    let embree = ["libembree4-dev", "libembree-dev"].map(version).join("");
    let (date, oiio) = (said("date", &["+%Y-%m-%d"]), version("openimageio-tools"));
    let tiny = version("libtinyobjloader-dev");
    format!(
        "Measured on {date}: {model}, {cores} cores.\nEmbree {embree}, OpenImageIO {oiio}, tinyobjloader {tiny}."
    )
}

/// A mesh of triangles with vertices that they share.
struct Knot {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Knot {
    fn corners(&self) -> Vec<[Vec3; 3]> {
        let corners = |t: &[u32; 3]| t.map(|i| self.positions[i as usize]);
        self.triangles.iter().map(corners).collect()
    }
}

/// A tube along a trefoil of about so many triangles, inside a sphere of radius 4.
fn knot(triangles: usize) -> Knot {
    let around = ((triangles as f64 / 16.0).sqrt() as u32).max(3);
    let along = (triangles as u32 / 2 / around).max(3);
    let center = |t: f32| {
        vec3(t.sin() + 2.0 * (2.0 * t).sin(), t.cos() - 2.0 * (2.0 * t).cos(), -(3.0 * t).sin())
    };
    let (mut positions, mut normals, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..along {
        let t = i as f32 / along as f32 * std::f32::consts::TAU;
        let forth = (center(t + 1e-2) - center(t - 1e-2)).normalize_or(Vec3::X);
        let side = forth.cross(vec3(0.1, 0.2, 1.0)).normalize_or(Vec3::Y);
        let up = side.cross(forth);
        for j in 0..around {
            let (sin, cos) = (j as f32 / around as f32 * std::f32::consts::TAU).sin_cos();
            let normal = cos * side + sin * up;
            positions.push(center(t) + 0.6 * normal);
            normals.push(normal);
            let index = |i: u32, j: u32| (i % along) * around + j % around;
            let [a, b] = [index(i, j), index(i + 1, j)];
            let [c, d] = [index(i + 1, j + 1), index(i, j + 1)];
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    Knot { positions, normals, triangles: faces }
}
