//! An offline image by the reference renderer, beside Mitsuba's.

use std::path::Path;
use std::process::Command;

use super::Bench;
use super::child::measure;
use super::figures::{Line, Samples, seconds};

/// Older ones cannot compile Mitsuba's kernels for every processor.
const LLVM: &str = "libLLVM.so.19.1";

/// CPU time of the teapot at 768x576 and 16 samples per pixel.
///
/// # Errors
/// When `umbra` or Mitsuba cannot be run.
pub fn run(bench: &Bench) -> anyhow::Result<Vec<Line>> {
    let python = bench.folder.join("mitsuba/bin/python");
    if !python.exists() {
        eprintln!("Mitsuba is not installed: it is left out");
        return Ok(Vec::new());
    }
    let scene = bench.root.join("scenes/a2/teapot");
    let script = bench.root.join("xtask/bench/teapot.py");
    let mut lines = Vec::new();
    for variant in ["scalar_rgb", "llvm_ad_rgb"] {
        let (mut ours, mut theirs) = (Samples::default(), Samples::default());
        let (mut start, mut first) = (Samples::default(), Samples::default());
        for _ in 0..bench.rounds.min(3) {
            let image = bench.folder.join("teapot.exr");
            let toml = scene.join("tinyrender/teapot_simple_offline.toml");
            let line = [
                &*bench.umbra,
                Path::new("render"),
                &toml,
                Path::new("--plugin=reference"),
                Path::new("--size=768x576"),
                Path::new("--spp=16"),
                Path::new("--output"),
                &image,
            ];
            ours.push(measure(line)?.cpu);
            let output = Command::new(&python)
                .args([&*script, Path::new(variant), &scene.join("mesh/teapot.obj"), &bench.folder])
                .env("DRJIT_LIBLLVM_PATH", LLVM)
                .output()?;
            let text = String::from_utf8_lossy(&output.stdout).into_owned();
            let last = text.lines().last().unwrap_or_default();
            let times: Vec<f64> = last.split(' ').filter_map(|word| word.parse().ok()).collect();
            let [begun, with_kernel, image] = times[..] else {
                anyhow::bail!("Mitsuba failed: {}", String::from_utf8_lossy(&output.stderr));
            };
            start.push(begun);
            first.push(with_kernel);
            theirs.push(image);
        }
        let work = "teapot 768x576, 16 spp, CPU".to_owned();
        let anchor = format!("Mitsuba 3 `{variant}`");
        lines.push(Line::of_times(work, &anchor, &theirs, &ours));
        lines.push(Line {
            work: "its start, and a first image".into(),
            anchor,
            theirs: format!("{}, {}", seconds(start.median()), seconds(first.median())),
            ours: String::new(),
            ratio: String::new(),
        });
    }
    Ok(lines)
}
