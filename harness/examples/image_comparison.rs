//! What one comparison costs at the course's film of 768x576, beside reading the same bytes once:
//! medians, taken in turn. `cargo run --release --example image_comparison`.

use std::hint::black_box;
use std::time::Instant;

use basecode::{Image, Sampler, Vec3};
use umbra::imaging::compare::{compare_offline, compare_realtime_linear, compare_srgb8};
use umbra::imaging::evidence::Tolerances;
use umbra::imaging::reference::{ReferenceImage, Region, RegionMask};

const WIDTH: usize = 768;
const HEIGHT: usize = 576;
const RUNS: usize = 31;

fn main() -> anyhow::Result<()> {
    let sampler = Sampler::new(1);
    let noise = |value: f32| {
        let mut image = Image::new(WIDTH, HEIGHT);
        image.pixels.fill_with(|| Vec3::splat(value + 0.01 * sampler.next_1d()));
        image
    };
    let mut mask = RegionMask::background(WIDTH, HEIGHT);
    mask.regions.push(Region { name: "wall".into(), lit: true, exponent: 20.0 });
    mask.pixels.fill(1);
    let (mean, variance, centre) = (noise(0.5), noise(0.001), noise(0.5));
    let actual = noise(0.5);
    let reference = ReferenceImage::new(mean, variance, 256, centre, mask)?;
    let (centre, mask, tolerances) = (&reference.centre, &reference.mask, Tolerances::default());

    let read = || {
        let images = [&actual, &reference.mean, &reference.variance];
        let sum: Vec3 = images.iter().flat_map(|image| &image.pixels).sum();
        black_box(sum);
    };
    let offline = || drop(black_box(compare_offline(&actual, &reference, 16, &tolerances)));
    let linear = || drop(black_box(compare_realtime_linear(&actual, centre, mask, &tolerances)));
    let levels = || drop(black_box(compare_srgb8(&actual, centre, mask, &tolerances)));
    let runs: [(&str, &dyn Fn()); 4] = [
        ("reading three images", &read),
        ("offline, 16 spp", &offline),
        ("realtime, linear floats", &linear),
        ("realtime, 8-bit levels", &levels),
    ];
    let mut times = vec![Vec::new(); runs.len()];
    for _ in 0..RUNS {
        for ((_, run), times) in runs.iter().zip(&mut times) {
            let begin = Instant::now();
            run();
            times.push(begin.elapsed().as_secs_f64());
        }
    }
    let medians: Vec<f64> = times
        .iter_mut()
        .map(|times| {
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        })
        .collect();
    for ((name, _), median) in runs.iter().zip(&medians) {
        println!("{name:<26} {:6.2} ms, {:5.1} of reading", 1e3 * median, median / medians[0]);
    }
    Ok(())
}
