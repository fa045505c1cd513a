//! Pictures that the CPU uploads: a frame that no shader drew, whatever shaders there are.
//!
//! Two things must come together before points are lost. Each frame of each scene uploads as much as
//! a picture of it is large, which meshes, materials and lights never come to on all scenes. And with
//! every fragment in one color, whatever pipelines there are, what is drawn is not the scene's
//! surfaces. One without the other is for the instructor to look at.

use std::path::Path;

use basecode::gpu::EVERY_FRAGMENT;
use basecode::{Image, Vec3};

use super::ask::{self, Asker};
use super::case::Case;
use super::draw::{Frame, draw};
use crate::evidence::{Check, Verdict};
use crate::imaging::reference::RegionMask;
use crate::worker::Stage;

/// Bytes for each pixel that are a picture: the least, 8-bit RGB.
const PICTURE: f64 = 3.0;

/// The color of every fragment, and the stage that draws it.
const SHOWN: Vec3 = Vec3::new(0.25, 0.5, 0.75);
const SHOW: &str =
    "@fragment fn umbra_shown() -> @location(0) vec4f { return vec4f(0.25, 0.5, 0.75, 1.0); }";

/// So much of the background may be drawn over before it is not the scene that is drawn.
const MOST_BACKGROUND: f64 = 0.2;

/// What is to be said of frames that are uploaded; nothing when they are not.
pub struct Uploaded {
    /// The check for the instructor. Costs nothing by itself.
    pub check: Check,
    /// Why no frame counts, if so.
    pub nothing_draws: Option<&'static str>,
}

/// Judges the frames of some scenes. `per_pixel` holds the bytes that each uploaded, by pixel, where
/// it was drawn at all.
pub fn judge(asker: &Asker, plugin: &Path, cases: &[Case], per_pixel: &[f64]) -> Option<Uploaded> {
    let least = per_pixel.iter().copied().reduce(f64::min).filter(|least| *least >= PICTURE)?;
    let summary = format!(
        "every frame uploads {least:.1} bytes and more for each of its pixels, as if no shader drew them"
    );
    let check = Check::new("hand_in.uploads", "", Verdict::Fail, summary);
    let case = cases.iter().max_by_key(|case| background(&case.small.unshadowed_mask).count())?;
    let stage = Stage { name: EVERY_FRAGMENT.to_owned(), text: SHOW.to_owned() };
    let frame = Frame::small(case, vec![stage]);
    let outcome = draw(asker, Some(plugin), &frame);
    let image =
        outcome.answer().map(|answer| ask::image(&answer.values, frame.size.0, frame.size.1));
    let foreign = image.is_some_and(|image| is_something_else(&image, &case.small.unshadowed_mask));
    let nothing_draws =
        foreign.then_some("the pixels are uploaded, and what is drawn with them is not the scene");
    Some(Uploaded { check, nothing_draws })
}

/// Pixels away from edges in which the scene shows nothing.
fn background(mask: &RegionMask) -> impl Iterator<Item = usize> {
    let clear = |value: u16| value & (RegionMask::EDGE | RegionMask::EMITTER) == 0;
    let pixels = mask.pixels.iter().enumerate();
    pixels
        .filter(move |(_, value)| clear(**value) && **value & RegionMask::INDEX == 0)
        .map(|(i, _)| i)
}

/// Whether a frame whose every fragment has one color shows something else than the scene.
fn is_something_else(image: &Image, mask: &RegionMask) -> bool {
    let (mut over, mut all) = (0usize, 0usize);
    for index in background(mask) {
        all += 1;
        over += usize::from(image.pixels[index] == SHOWN);
    }
    all > 0 && over as f64 > MOST_BACKGROUND * all as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imaging::reference::Region;

    #[test]
    fn one_triangle_over_the_film_is_no_scene() {
        let mut mask = RegionMask::background(20, 10);
        mask.regions.push(Region { name: "ball".into(), lit: true, exponent: 0.0 });
        for (i, value) in mask.pixels.iter_mut().enumerate() {
            *value = u16::from(i % 20 < 8);
        }
        let image = |drawn: &dyn Fn(usize) -> bool, color: Vec3| {
            let pixels = (0..200).map(|i| if drawn(i % 20) { color } else { Vec3::ZERO });
            Image { width: 20, height: 10, pixels: pixels.collect() }
        };
        assert!(is_something_else(&image(&|_| true, SHOWN), &mask));
        assert!(!is_something_else(&image(&|x| x < 8, SHOWN), &mask), "the scene itself");
        assert!(!is_something_else(&image(&|x| x < 9, SHOWN), &mask), "nearly so");
        assert!(
            !is_something_else(&image(&|_| true, Vec3::ONE), &mask),
            "no fragment was replaced"
        );
        let full = RegionMask { pixels: vec![1; 200], ..mask };
        assert!(!is_something_else(&image(&|_| true, SHOWN), &full), "no background tells");
    }
}
