//! Mistakes of the shaders, as replacements of text. `xtask verdicts` submits the changed texts.

mod diffuse;
mod harmless;
mod phong;
mod shadow;
mod vertex;

use std::borrow::Cow;

/// A mistake of the shaders, or a right variant.
pub struct StageMistake {
    /// Its name in the catalogue.
    pub name: &'static str,
    /// Stage, text that is there exactly once, text in its place.
    pub changes: &'static [(&'static str, &'static str, &'static str)],
}

const VS: &str = "simple.vs";
const DIFFUSE: &str = "diffuse.fs";
const PHONG: &str = "phong.fs";

// As short as they can be and still stand there once: mistakes in other places go together.
const FACING: &str = "if cos_i <= 0.0 || cos_o <= 0.0 {";
const COSINE: &str = "let cos_i = dot(n, wi);";
const TO_LIGHT: &str = "let to_light = frame.light_position.xyz - world_position;";
const TO_VIEWER: &str = "let wo = normalize(frame.camera_position.xyz - world_position);";
const NORMAL: &str = "let n = normalize(world_normal);";
const SQUARED: &str = "let r2 = dot(to_light, to_light);";
const INTENSITY: &str = "frame.light_intensity.rgb";
const FALLOFF: &str = "/ r2 *";
const TIMES_COSINE: &str = "f * cos_i;";
const RETURN: &str = "return vec4f(radiance, 1.0);";
const GAMMA: &str = "return vec4f(pow(radiance, vec3f(1.0 / 2.2)), 1.0);";
const CLAMPED: &str = "return vec4f(min(radiance, vec3f(1.0)), 1.0);";
const BLACK: &str = "return vec4f(0.0, 0.0, 0.0, 1.0) * radiance.x * 0.0;";
const VISIBLE: &str = "visibility(world_position, n, wi) *";
const VIEW_LIGHT: &str = "let to_light = (frame.view * frame.light_position).xyz - world_position;";
const NO_MINUS: &str = "let to_light = frame.light_position.xyz;";
const REVERSED: &str = "let to_light = world_position - frame.light_position.xyz;";
const OVER_VIEWER: &str = "/ dot(frame.camera_position.xyz - world_position, frame.camera_position.xyz - world_position) *";

/// Every mistake of a shader.
pub fn wrong() -> impl Iterator<Item = &'static StageMistake> {
    [vertex::ALL, diffuse::ALL, phong::ALL, shadow::ALL].into_iter().flatten()
}

/// Right variants: they must cost nothing.
pub const HARMLESS: &[StageMistake] = harmless::ALL;

/// Both.
pub fn all() -> impl Iterator<Item = &'static StageMistake> {
    wrong().chain(HARMLESS)
}

/// The text of a stage with the named mistakes made in it; names of other mistakes change nothing.
///
/// # Errors
/// When a text that is to be replaced is not there exactly once: two mistakes may be about the same.
pub fn apply<'a>(stage: &str, text: &'a str, names: &[&str]) -> Result<Cow<'a, str>, String> {
    let mut text = Cow::Borrowed(text);
    for mistake in all().filter(|mistake| names.contains(&mistake.name)) {
        for (_, from, to) in mistake.changes.iter().filter(|(changed, ..)| *changed == stage) {
            if text.matches(from).count() != 1 {
                return Err(format!(
                    "mistake \"{}\": {stage} does not hold once: {from}",
                    mistake.name
                ));
            }
            text = Cow::Owned(text.replace(from, to));
        }
    }
    Ok(text)
}

macro_rules! mistakes {
    ($($name:literal: $(($stage:expr, $from:expr, $to:expr)),*;)*) => {
        /// All of them.
        pub const ALL: &[super::StageMistake] =
            &[$(super::StageMistake { name: $name, changes: &[$(($stage, $from, $to)),*] },)*];
    };
}
use mistakes;
