//! Detects frames that the CPU uploads instead of drawing them with shaders.
//!
//! Points are lost only if two conditions hold. First, each frame of each scene uploads as much data as a picture of
//! it, which meshes, materials and lights never do on all scenes. Second, the frame does not draw the scene's surfaces:
//! with every fragment in one color, in all pipelines, it covers the background as well, or the outlines of triangles
//! fill all surfaces. If only one condition holds, the instructor is told.

use std::path::Path;

use basecode::gpu::{EVERY_FRAGMENT, Footprint, OUTLINES};
use basecode::{Image, Vec3};

use super::draw::{FrameRequest, draw};
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use crate::evidence::{Check, CheckId, Verdict};
use crate::imaging::reference::RegionMask;
use crate::worker::StageText;

/// Bytes for each pixel that may be a picture: a byte of brightness.
const PICTURE: f64 = 1.0;

/// Bytes that any pass may upload: uniforms, tables, place holders.
const ANY: usize = 16 << 10;
/// Bytes for each shape: material and placement, in buffers of their own.
const BY_SHAPE: usize = 1 << 10;
/// Bytes for each triangle: three vertices of 64 bytes.
const BY_TRIANGLE: usize = 192;

/// A scene tells when its own data are at most this many bytes for each pixel.
const MOST_OWN: f64 = 4.0;

/// The color of every fragment, and the stage that draws it.
const SHOWN: Vec3 = Vec3::new(0.25, 0.5, 0.75);
const SHOW: &str =
    "@fragment fn umbra_shown() -> @location(0) vec4f { return vec4f(0.25, 0.5, 0.75, 1.0); }";

/// Fraction of the background that may be covered; beyond it, the frame does not draw the scene.
const MOST_BACKGROUND: f64 = 0.2;

/// Fraction of the surfaces that outlines of triangles may cover; beyond it, triangles are as small as pixels. Scenes
/// of few triangles have 0.1 to 0.3 on small films, triangles of a pixel 0.9 and more.
const MOST_OUTLINES: f64 = 0.6;
/// On scenes with more triangles, outlines prove nothing.
const FEW_TRIANGLES: usize = 200;

/// Findings on how a pass makes its frames.
#[derive(Default)]
pub struct Uploaded {
    /// Checks for the instructor. They cost nothing by themselves.
    pub checks: Vec<Check>,
    /// Why no frame counts, if so.
    pub nothing_draws: Option<&'static str>,
}

/// Judges the frames of some scenes by what each took, where that is known.
pub fn judge(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
    footprints: &[Option<Footprint>],
) -> Uploaded {
    let mut found = Uploaded::default();
    let known = || cases.iter().zip(footprints).filter_map(|(case, of)| Some((case, (*of)?)));
    // A vertex shader that fetches its vertices from a buffer of its own draws the scene's surfaces all the same.
    if known().next().is_some()
        && known().all(|(_, of)| of.vertex_pipelines == 0 && of.vertexless_pipelines > 0)
        && fills_the_film(session, plugin, cases).unwrap_or(true)
    {
        let summary =
            "no pipeline that draws a picture takes vertices: it is made in one piece, or computed";
        found.checks.push(Check::new(CheckId::SubmissionNoVertices, "", Verdict::Fail, summary));
    }
    let unexplained = known().filter_map(|(case, of)| unexplained(case, &of));
    let least = unexplained.reduce(f64::min).filter(|least| *least >= PICTURE);
    if let Some(least) = least {
        let summary = format!(
            "every frame uploads {least:.1} bytes and more for each of its pixels besides the scene's own \
             data, as if no shader drew them"
        );
        found.checks.push(Check::new(CheckId::SubmissionUploads, "", Verdict::Fail, summary));
        found.nothing_draws = nothing_draws(session, plugin, cases);
    }
    found
}

/// Bytes for each pixel that a frame took besides what the scene itself explains; nothing where that
/// is too much to tell.
fn unexplained(case: &PreparedScene, footprint: &Footprint) -> Option<f64> {
    let scene = &case.expected.scene;
    let own = ANY + BY_SHAPE * scene.shapes().len() + BY_TRIANGLE * triangles(case);
    let (width, height) = case.film();
    let by_pixel = |bytes: f64| bytes / (f64::from(width) * f64::from(height));
    (by_pixel(own as f64) <= MOST_OWN).then(|| by_pixel(footprint.uploaded as f64 - own as f64))
}

fn triangles(case: &PreparedScene) -> usize {
    case.expected.scene.shapes().iter().map(|shape| shape.triangles.len()).sum()
}

/// A scene's small film with every fragment in one color, or the outlines of triangles alone.
fn drawn(session: &Session, plugin: &Path, case: &PreparedScene, outlines: bool) -> Option<Image> {
    let mut stages = vec![every_fragment()];
    stages.extend(
        outlines.then(|| StageText { name: OUTLINES.to_owned(), text: "outlines".to_owned() }),
    );
    let frame = FrameRequest::probe(case, stages);
    let outcome = draw(session, Some(plugin), &frame);
    outcome.answer().map(|answer| session::image(&answer.values, frame.size.0, frame.size.1))
}

/// Whether a pass covers the background as well, on the scene that has most of it.
fn fills_the_film(session: &Session, plugin: &Path, cases: &[PreparedScene]) -> Option<bool> {
    let mask = |case: &&PreparedScene| clear(&case.probe_film.unshadowed_mask, true).count();
    let case = cases.iter().max_by_key(mask)?;
    let image = drawn(session, plugin, case, false)?;
    Some(covers_background(&image, &case.probe_film.unshadowed_mask))
}

/// Why what is drawn with uploaded pixels is not the scene, if it is not.
fn nothing_draws(
    session: &Session,
    plugin: &Path,
    cases: &[PreparedScene],
) -> Option<&'static str> {
    if fills_the_film(session, plugin, cases)? {
        return Some("the pixels are uploaded, and what is drawn with them is not the scene");
    }
    let case = cases.iter().min_by_key(|case| triangles(case))?;
    if triangles(case) <= FEW_TRIANGLES
        && covers_surfaces(&drawn(session, plugin, case, true)?, &case.probe_film.unshadowed_mask)
    {
        return Some("the pixels are uploaded, and drawn one by one");
    }
    None
}

/// What the host replaces to see every fragment in one color.
pub fn every_fragment() -> StageText {
    StageText { name: EVERY_FRAGMENT.to_owned(), text: SHOW.to_owned() }
}

/// An image under [`every_fragment`] without what no such fragment drew.
pub fn drawn_parts(image: &Image) -> Image {
    let shown = |pixel: &Vec3| if *pixel == SHOWN { SHOWN } else { Vec3::ZERO };
    Image { pixels: image.pixels.iter().map(shown).collect(), ..*image }
}

/// Pixels away from edges in which the scene shows nothing, or surfaces that are no light.
fn clear(mask: &RegionMask, background: bool) -> impl Iterator<Item = usize> {
    let clear = |value: u16| value & (RegionMask::EDGE | RegionMask::EMITTER) == 0;
    let pixels = mask.pixels.iter().enumerate();
    pixels
        .filter(move |(_, value)| {
            clear(**value) && (**value & RegionMask::INDEX == 0) == background
        })
        .map(|(i, _)| i)
}

/// The fraction of some pixels that show a fragment.
fn fraction(image: &Image, pixels: impl Iterator<Item = usize>) -> f64 {
    let (mut shown, mut all) = (0usize, 0usize);
    for index in pixels {
        all += 1;
        shown += usize::from(image.pixels[index] == SHOWN);
    }
    shown as f64 / all.max(1) as f64
}

/// Whether a frame whose every fragment has one color shows something else than the scene.
fn covers_background(image: &Image, mask: &RegionMask) -> bool {
    fraction(image, clear(mask, true)) > MOST_BACKGROUND
}

/// Whether outlines of triangles fill the surfaces of the scene.
fn covers_surfaces(image: &Image, mask: &RegionMask) -> bool {
    fraction(image, clear(mask, false)) > MOST_OUTLINES
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imaging::reference::Region;

    #[test]
    fn what_is_drawn_is_told_from_the_scene() {
        let mut mask = RegionMask::background(20, 10);
        mask.regions.push(Region { name: "ball".into(), lit: true, exponent: 0.0 });
        for (i, value) in mask.pixels.iter_mut().enumerate() {
            *value = u16::from(i % 20 < 8);
        }
        let image = |drawn: &dyn Fn(usize) -> bool, color: Vec3| {
            let pixels = (0..200).map(|i| if drawn(i % 20) { color } else { Vec3::ZERO });
            Image { width: 20, height: 10, pixels: pixels.collect() }
        };
        let foreign =
            |drawn: &dyn Fn(usize) -> bool, color| covers_background(&image(drawn, color), &mask);
        assert!(foreign(&|_| true, SHOWN));
        assert!(!foreign(&|x| x < 8, SHOWN), "the scene itself");
        assert!(!foreign(&|x| x < 9, SHOWN), "nearly so");
        assert!(!foreign(&|_| true, Vec3::ONE), "no fragment was replaced");
        let filled = |drawn: &dyn Fn(usize) -> bool| covers_surfaces(&image(drawn, SHOWN), &mask);
        assert!(filled(&|x| x < 8), "no larger than pixels");
        assert!(!filled(&|x| x % 8 < 2), "triangles of some pixels");
        let full = RegionMask { pixels: vec![1; 200], ..mask.clone() };
        assert!(!covers_background(&image(&|_| true, SHOWN), &full), "no background tells");
        let empty = RegionMask { pixels: vec![0; 200], ..mask };
        assert!(!covers_surfaces(&image(&|_| true, SHOWN), &empty), "no surface tells");
    }
}
