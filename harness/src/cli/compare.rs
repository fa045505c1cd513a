//! `umbra compare`: two images, without a scene.

use std::path::PathBuf;

use basecode::Image;
use basecode::exr_io::read_exr;

use crate::imaging::metrics::Metrics;
use crate::imaging::pictures::{signed_error, tone_mapped};

/// The relative error that the difference picture shows in full colour.
const FULL_SCALE: f32 = 0.1;

/// What `umbra compare` is told.
#[derive(clap::Args)]
pub struct CompareArguments {
    /// The actual image
    actual: PathBuf,
    /// The expected image
    expected: PathBuf,
    /// Write actual, expected and difference as PNG files into this folder
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
}

/// Prints where two images differ; exit 0 when they are equal, 1 when not. Without the scene's
/// variance nothing more can be decided: `check` and `grade` decide, this only measures.
pub fn run(arguments: &CompareArguments) -> anyhow::Result<u8> {
    let (actual, expected) = (read_exr(&arguments.actual)?, read_exr(&arguments.expected)?);
    let (a, b) = ((actual.width, actual.height), (expected.width, expected.height));
    if a != b {
        println!("actual is {}x{} but expected is {}x{}", a.0, a.1, b.0, b.1);
        return Ok(super::EXIT_NOT_IN_ORDER);
    }
    let place = |index: usize| (index % actual.width, index / actual.width);
    for (name, image) in [("actual", &actual), ("expected", &expected)] {
        let bad: Vec<usize> = positions(image, |p| !p.is_finite());
        if let Some(&first) = bad.first() {
            println!("{name}: {} pixels are not finite; first at {:?}", bad.len(), place(first));
        }
        let negative = positions(image, |p| p.min_element() < 0.0);
        if let Some(&first) = negative.first() {
            println!("{name}: {} pixels are negative; first at {:?}", negative.len(), place(first));
        }
    }
    let differing = (0..actual.pixels.len())
        .filter(|&i| !(actual.pixels[i] - expected.pixels[i]).abs().max_element().eq(&0.0))
        .collect::<Vec<_>>();
    println!("{} of {} pixels differ", differing.len(), actual.pixels.len());
    let largest = differing.iter().copied().max_by(|&a, &b| {
        let difference = |i: usize| {
            let d = (actual.pixels[i] - expected.pixels[i]).abs().max_element();
            if d.is_nan() { f32::INFINITY } else { d }
        };
        difference(a).total_cmp(&difference(b))
    });
    if let Some(index) = largest {
        let (x, y) = place(index);
        println!(
            "largest at ({x}, {y}): actual {}, expected {}",
            actual.pixels[index], expected.pixels[index]
        );
    }
    if let Some(metrics) = Metrics::measure(&actual, &expected) {
        println!("{}", serde_json::to_string_pretty(&metrics)?);
    }
    if let Some(folder) = &arguments.pictures {
        std::fs::create_dir_all(folder)?;
        let scale = median(&expected);
        let mask = crate::imaging::reference::RegionMask::background(actual.width, actual.height);
        for (name, picture) in [
            ("actual", Some(tone_mapped(&actual, scale))),
            ("expected", Some(tone_mapped(&expected, scale))),
            ("difference", signed_error(&actual, &expected, &mask, scale, FULL_SCALE)),
        ] {
            let Some(picture) = picture else { continue };
            let file = folder.join(format!("{name}.png"));
            std::fs::write(&file, picture.png()?)?;
            println!("{}: {}", file.display(), picture.caption);
        }
    }
    Ok(if differing.is_empty() { super::EXIT_OK } else { super::EXIT_NOT_IN_ORDER })
}

fn positions(image: &Image, wanted: impl Fn(&basecode::Vec3) -> bool) -> Vec<usize> {
    (0..image.pixels.len()).filter(|&index| wanted(&image.pixels[index])).collect()
}

/// The median of what is not black, for exposure.
fn median(image: &Image) -> f32 {
    let mut lit: Vec<f32> = image
        .pixels
        .iter()
        .map(|p| p.element_sum() / 3.0)
        .filter(|v| v.is_finite() && *v > 0.0)
        .collect();
    lit.sort_by(f32::total_cmp);
    lit.get(lit.len() / 2).copied().unwrap_or(1.0)
}
