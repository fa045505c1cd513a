//! Which surfaces the frames of a pass show.

use basecode::{Image, Vec2, Vec3};

use super::{BoundValue, NEAR, STRAY_FRACTION, is_close};
use crate::stage_film::{OFFSET_PX, StageFilm};

/// Positions on one pixel that are further apart than this, relative to their distance from the camera, are those of
/// two surfaces.
const BEHIND: f32 = 5e-3;

/// What a pass with Umbra's stages shows where a surface belongs.
pub(super) struct Seen {
    /// Pixels that show a surface when the pass is right.
    pub all: usize,
    /// Those that nothing is drawn on, and the first.
    pub empty: (usize, Option<usize>),
    /// Those that another surface is seen on, and the first.
    pub elsewhere: (usize, Option<usize>),
    /// Whether all others show the right values.
    pub all_values_right: bool,
}

impl Seen {
    pub fn of(film: &StageFilm, frames: &[(BoundValue, Image)], positions: &Image) -> Self {
        let mut seen =
            Self { all: 0, empty: (0, None), elsewhere: (0, None), all_values_right: true };
        let mut right = 0;
        for (index, shape) in film.interior() {
            let (ray, Some(point)) = &film.surface.pixels[index] else { continue };
            seen.all += 1;
            let shown = frames.iter().map(|(_, frame)| frame).chain([positions]);
            let found = positions.pixels[index];
            let distance = (found - point.position).length();
            let is_right = |(bound, frame): &(BoundValue, Image)| {
                let expected = bound.expected(film.scene, &film.camera, shape);
                expected.is_none_or(|expected| is_close(frame.pixels[index], expected))
            };
            let is_right = frames.iter().all(is_right);
            // Close behind it, on the same pixel: the values are another surface's.
            let depth = (point.position - ray.origin).length();
            let is_behind = distance > BEHIND * depth
                && Vec2::from(film.offset_px(index, found)).length() < OFFSET_PX as f32;
            let place = if shown.map(|frame| frame.pixels[index]).all(|value| value == Vec3::ZERO) {
                &mut seen.empty
            } else if distance > NEAR * depth || (is_behind && !is_right) {
                &mut seen.elsewhere
            } else {
                right += usize::from(is_right);
                continue;
            };
            *place = (place.0 + 1, place.1.or(Some(index)));
        }
        let shown = seen.all - seen.empty.0 - seen.elsewhere.0;
        seen.all_values_right = right > 0 && right as f64 >= (1.0 - STRAY_FRACTION) * shown as f64;
        seen
    }

    /// A sentence and a hint, where the surfaces themselves are wrong and not only their values.
    pub fn in_words(&self, film: &StageFilm) -> Option<(String, &'static str)> {
        let few = STRAY_FRACTION * self.all as f64;
        let (what, (count, first), hint) = if self.empty.0 as f64 > few {
            let hint =
                "look at what is drawn: indices, culling, depth test, clearing, and matrices";
            ("nothing is drawn", self.empty, hint)
        } else if self.elsewhere.0 as f64 > few && self.all_values_right {
            let hint = "look at depth test, culling and matrices";
            ("another surface is seen", self.elsewhere, hint)
        } else {
            return None;
        };
        let index = first?;
        let shape = film.surface.pixels[index].1.as_ref().map(|point| point.shape)?;
        let sentence = format!(
            "{what} on {:.0} % of the pixels that show a surface, with Umbra's own stages; first at ({}, {}), where \
             \"{}\" belongs",
            100.0 * count as f64 / self.all as f64,
            index % film.surface.width,
            index / film.surface.width,
            film.scene.shapes()[shape].name
        );
        Some((sentence, hint))
    }
}
