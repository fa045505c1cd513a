//! Whole processes that compare images, and readers of OBJ files, beside others'.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::Context;
use basecode::exr_io::{ExrLayers, Precision, write_exr, write_exr_layers};
use basecode::scene::MeshFile;
use basecode::{Image, Sampler, Vec3};

use super::child::{Cost, compile, measure};
use super::figures::{Line, Samples};
use super::page::Curve;
use super::{Bench, knot};

/// The course's film, 4K and 8K.
const SIZES: [(&str, usize, usize); 3] =
    [("768x576", 768, 576), ("4K", 3840, 2160), ("8K", 7680, 4320)];

/// Costs of several runs of one command.
#[derive(Default)]
struct Costs {
    wall: Samples,
    cpu: Samples,
    memory: Samples,
}

impl Costs {
    fn push(&mut self, cost: Cost) {
        self.wall.push(cost.wall);
        self.cpu.push(cost.cpu);
        self.memory.push(cost.memory);
    }
}

/// `umbra compare` against `idiff`, and how both grow with pixels.
///
/// # Errors
/// When `idiff` cannot be run, or an image cannot be written.
pub fn compare(bench: &Bench) -> anyhow::Result<(Vec<Line>, Vec<Curve>)> {
    let mut lines = Vec::new();
    let names = ["Umbra, uncompressed", "Umbra, ZIP", "idiff, uncompressed", "idiff, ZIP"];
    let mut curves = names.map(Curve::new);
    for (name, width, height) in SIZES {
        if bench.without_8k && name == "8K" {
            continue;
        }
        for (zip, kind) in [(false, "uncompressed"), (true, "ZIP")] {
            let [a, b] = pair(&bench.folder, width, height, zip)?;
            let (mut ours, mut theirs) = (Costs::default(), Costs::default());
            let rounds = if width > 4000 { bench.rounds.min(3) } else { bench.rounds };
            for _ in 0..rounds {
                ours.push(measure([&*bench.umbra, Path::new("compare"), &a, &b])?);
                theirs.push(measure([Path::new("idiff"), &a, &b])?);
            }
            for file in [a, b].iter().filter(|_| width > 4000) {
                std::fs::remove_file(file)?;
            }
            let pixels = (width * height) as f64 / 1e6;
            curves[usize::from(zip)].push(pixels, ours.wall.median());
            curves[2 + usize::from(zip)].push(pixels, theirs.wall.median());
            let work = |what: &str| format!("compare {name}, {kind}, {what}");
            lines.push(Line::of_times(work("wall"), "idiff", &theirs.wall, &ours.wall));
            lines.push(Line::of_times(work("CPU"), "idiff", &theirs.cpu, &ours.cpu));
            lines.push(Line {
                work: work("memory"),
                anchor: "idiff".into(),
                theirs: format!("{:.0} MiB", theirs.memory.median()),
                ours: format!("{:.0} MiB", ours.memory.median()),
                ratio: ours.memory.faster_than(&theirs.memory).ratio(),
            });
        }
    }
    Ok((lines, curves.into()))
}

/// Two images of one scene with other noise: smooth shades, and grain as of 256 samples a pixel.
fn pair(folder: &Path, width: usize, height: usize, zip: bool) -> anyhow::Result<[PathBuf; 2]> {
    let mut paths = [PathBuf::new(), PathBuf::new()];
    for (seed, path) in paths.iter_mut().enumerate() {
        *path = folder.join(format!("{width}x{height}-{zip}-{seed}.exr"));
        if path.exists() {
            continue;
        }
        let sampler = Sampler::new(seed as u64 + 1);
        let mut image = Image::new(width, height);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            let (x, y) = ((i % width) as f32 / width as f32, (i / width) as f32 / height as f32);
            let shade = 0.5 + 0.25 * (9.0 * x).sin() * (7.0 * y).cos();
            let grain = Vec3::new(sampler.next_1d(), sampler.next_1d(), sampler.next_1d());
            *pixel = shade * Vec3::new(1.0, 0.8, 0.6) * (0.98 + 0.04 * grain);
        }
        if zip {
            let layers = [(String::new(), image)].into();
            let content = ExrLayers { layers, ..ExrLayers::default() };
            write_exr_layers(&*path, &content, Precision::Float)?;
        } else {
            write_exr(&*path, &image, Precision::Float, &[])?;
        }
    }
    Ok(paths)
}

/// Reading an OBJ file of two million triangles.
///
/// # Errors
/// When the other reader does not compile, or counts other triangles.
pub fn objects(bench: &Bench) -> anyhow::Result<Vec<Line>> {
    let (path, program) = (bench.folder.join("knot.obj"), bench.folder.join("objects"));
    compile(&bench.root.join("xtask/bench/objects.cpp"), &program, &[])?;
    if !path.exists() {
        write_knot(&path, 2_000_000)?;
    }
    let (mut ours, mut theirs) = (Samples::default(), Samples::default());
    for _ in 0..bench.rounds {
        let begin = Instant::now();
        let mesh = MeshFile::load(&path)?;
        ours.push(begin.elapsed().as_secs_f64());
        let triangles = mesh.shapes[0].triangles.len();
        let output = Command::new(&program).arg(&path).output()?;
        let text = String::from_utf8_lossy(&output.stdout);
        let (time, count) = text.trim().split_once(' ').context("tinyobjloader said nothing")?;
        anyhow::ensure!(count == triangles.to_string(), "{triangles} triangles, theirs {count}");
        theirs.push(time.parse()?);
    }
    let work = "OBJ, 2M triangles".to_owned();
    Ok(vec![Line::of_times(work, "tinyobjloader", &theirs, &ours)])
}

fn write_knot(path: &Path, triangles: usize) -> anyhow::Result<()> {
    let knot = knot(triangles);
    let mut text = String::from("mtllib knot.mtl\no knot\nusemtl grey\n");
    for (p, n) in knot.positions.iter().zip(&knot.normals) {
        writeln!(text, "v {:.6} {:.6} {:.6}", p.x, p.y, p.z)?;
        writeln!(text, "vn {:.4} {:.4} {:.4}", n.x, n.y, n.z)?;
    }
    for [a, b, c] in &knot.triangles {
        let [a, b, c] = [a + 1, b + 1, c + 1];
        writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}")?;
    }
    std::fs::write(path, text)?;
    std::fs::write(path.with_file_name("knot.mtl"), "newmtl grey\nKd 0.5 0.5 0.5\n")?;
    Ok(())
}
