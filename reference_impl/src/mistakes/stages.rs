//! Mistakes of the shaders: lines that read otherwise. Depends on nothing, so that `xtask verdicts`
//! can hand in the mistaken texts: nothing can link this crate.

use std::borrow::Cow;

/// A mistake of the shaders.
pub struct StageMistake {
    /// Its name in the catalogue.
    pub name: &'static str,
    /// Stage, text that is there exactly once, text in its place.
    pub changes: &'static [(&'static str, &'static str, &'static str)],
}

const VS: &str = "simple.vs";
const DIFFUSE: &str = "diffuse.fs";
const PHONG: &str = "phong.fs";

const CLIP: &str = "out.clip_position = frame.projection * frame.view * world;";
const POSITION: &str = "out.world_position = world.xyz;";
const NORMAL: &str = "out.world_normal = (object.normal_matrix * vec4f(normal, 0.0)).xyz;";
const FACING: &str = "if cos_i <= 0.0 || cos_o <= 0.0 {";
const COSINE: &str = "let cos_i = dot(n, wi);";
const TO_LIGHT: &str = "let to_light = frame.light_position.xyz - world_position;";
const TO_VIEWER: &str = "let wo = normalize(frame.camera_position.xyz - world_position);";
const FALLOFF: &str = "frame.light_intensity.rgb / r2 * f * cos_i;";
const COS_ALPHA: &str = "let cos_alpha = max(dot(reflect(-wo, n), wi), 0.0);";
const LOBE: &str = "(exponent + 2.0) / (2.0 * PI) * pow(cos_alpha, exponent);";
const RETURN: &str = "return vec4f(radiance, 1.0);";
const GAMMA: &str = "return vec4f(pow(radiance, vec3f(1.0 / 2.2)), 1.0);";
const MOVED: &str = "let moved = position + texel * (shadow.params.w * n + wi);";
const LOOKUP: &str =
    "return textureSampleCompareLevel(shadow_map, shadow_sampler, uv, face, ndc.z);";
const VIEW_LIGHT: &str = "let to_light = (frame.view * frame.light_position).xyz - world_position;";

macro_rules! mistakes {
    ($($name:literal: $(($stage:expr, $from:expr, $to:expr)),*;)*) => {
        /// All of them.
        pub const ALL: &[StageMistake] =
            &[$(StageMistake { name: $name, changes: &[$(($stage, $from, $to)),*] },)*];
    };
}

mistakes! {
    "vertex-normal-zero": (VS, NORMAL, "out.world_normal = vec3f(0.0);");
    "vertex-normal-is-position": (VS, NORMAL, "out.world_normal = position;");
    "vertex-normal-view-space":
        (VS, NORMAL, "out.world_normal = (frame.view * object.normal_matrix * vec4f(normal, 0.0)).xyz;");
    "vertex-position-view-space": (VS, POSITION, "out.world_position = (frame.view * world).xyz;");
    "vertex-no-view": (VS, CLIP, "out.clip_position = frame.projection * world;");
    "vertex-no-projection": (VS, CLIP, "out.clip_position = frame.view * world;");
    "vertex-flipped":
        (VS, CLIP, "out.clip_position = vec4f(1.0, -1.0, 1.0, 1.0) * (frame.projection * frame.view * world);");
    "diffuse-fs-no-pi": (DIFFUSE, "rho_d.rgb / PI;", "rho_d.rgb;");
    "diffuse-fs-two-cosines": (DIFFUSE, FALLOFF, "frame.light_intensity.rgb / r2 * f * cos_i * cos_i;");
    "diffuse-fs-no-cosine": (DIFFUSE, FALLOFF, "frame.light_intensity.rgb / r2 * f;");
    "diffuse-fs-no-falloff": (DIFFUSE, FALLOFF, "frame.light_intensity.rgb * f * cos_i;");
    "diffuse-fs-over-r": (DIFFUSE, FALLOFF, "frame.light_intensity.rgb / sqrt(r2) * f * cos_i;");
    "diffuse-fs-grey": (DIFFUSE, FALLOFF, "frame.light_intensity.r / r2 * f * cos_i;");
    "diffuse-fs-no-wo-test": (DIFFUSE, FACING, "if cos_i <= 0.0 {");
    "diffuse-fs-no-wi-test": (DIFFUSE, FACING, "if cos_o <= 0.0 {");
    "diffuse-fs-abs-cosine": (DIFFUSE, COSINE, "let cos_i = abs(dot(n, wi));");
    "diffuse-fs-view-space-light": (DIFFUSE, TO_LIGHT, VIEW_LIGHT);
    "diffuse-fs-gamma": (DIFFUSE, RETURN, GAMMA);
    "phong-fs-no-pi": (PHONG, "rho_d.rgb / PI +", "rho_d.rgb +");
    "phong-fs-two-cosines": (PHONG, FALLOFF, "frame.light_intensity.rgb / r2 * f * cos_i * cos_i;");
    "phong-fs-no-falloff": (PHONG, FALLOFF, "frame.light_intensity.rgb * f * cos_i;");
    "phong-fs-no-wo-test": (PHONG, FACING, "if cos_i <= 0.0 {");
    "phong-fs-no-wi-test": (PHONG, FACING, "if cos_o <= 0.0 {");
    "phong-fs-abs-cosine": (PHONG, COSINE, "let cos_i = abs(dot(n, wi));");
    "phong-fs-view-space-light": (PHONG, TO_LIGHT, VIEW_LIGHT);
    "phong-fs-camera-at-origin": (PHONG, TO_VIEWER, "let wo = normalize(-world_position);");
    "phong-fs-reflect-sign": (PHONG, COS_ALPHA, "let cos_alpha = max(dot(reflect(wo, n), wi), 0.0);");
    "phong-fs-reflect-light": (PHONG, COS_ALPHA, "let cos_alpha = max(dot(reflect(wi, n), wo), 0.0);");
    "phong-fs-no-clamp":
        (PHONG, COS_ALPHA, "let cos_alpha = dot(reflect(-wo, n), wi);"),
        (PHONG, LOBE, "(exponent + 2.0) / (2.0 * PI) * pow(abs(cos_alpha), exponent);");
    "phong-fs-blinn": (PHONG, COS_ALPHA, "let cos_alpha = max(dot(normalize(wo + wi), n), 0.0);");
    "phong-fs-n-plus-1": (PHONG, LOBE, "(exponent + 1.0) / (2.0 * PI) * pow(cos_alpha, exponent);");
    "phong-fs-unnormalised": (PHONG, LOBE, "pow(cos_alpha, exponent);");
    "phong-fs-exponent-plus-1":
        (PHONG, LOBE, "(exponent + 2.0) / (2.0 * PI) * pow(cos_alpha, exponent + 1.0);");
    "phong-fs-gamma": (PHONG, RETURN, GAMMA);
    "shadow-map-acne": (DIFFUSE, MOVED, "let moved = position;"), (PHONG, MOVED, "let moved = position;");
    "shadow-map-peter-panning":
        (DIFFUSE, MOVED, "let moved = position + 0.3 * (n + wi);"),
        (PHONG, MOVED, "let moved = position + 0.3 * (n + wi);");
    "shadow-map-inverted":
        (DIFFUSE, LOOKUP, "return 1.0 - textureSampleCompareLevel(shadow_map, shadow_sampler, uv, face, ndc.z);"),
        (PHONG, LOOKUP, "return 1.0 - textureSampleCompareLevel(shadow_map, shadow_sampler, uv, face, ndc.z);");
    "shadow-map-first-face": (DIFFUSE, "let face = face_of(moved - light);", "let face = 0u;"),
        (PHONG, "let face = face_of(moved - light);", "let face = 0u;");
}

/// What is no mistake although it differs: it must cost nothing.
pub const HARMLESS: &[StageMistake] = &[StageMistake {
    name: "normals-raw",
    changes: &[
        (DIFFUSE, "let n = normalize(world_normal);", "let n = world_normal;"),
        (PHONG, "let n = normalize(world_normal);", "let n = world_normal;"),
    ],
}];

/// The text of a stage with the named mistakes made in it; names of other mistakes change nothing.
///
/// # Errors
/// When a text that is to be replaced is not there exactly once.
pub fn apply<'a>(stage: &str, text: &'a str, names: &[&str]) -> Result<Cow<'a, str>, String> {
    let mut text = Cow::Borrowed(text);
    for mistake in ALL.iter().chain(HARMLESS).filter(|mistake| names.contains(&mistake.name)) {
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
