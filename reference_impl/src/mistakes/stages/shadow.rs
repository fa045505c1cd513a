//! Mistakes in the shadow map lookup of both fragment stages.

use super::{DIFFUSE, PHONG, VISIBLE, mistakes};

const MOVED: &str = "let moved = position + texel * (shadow.params.w * n + wi);";
const LOOKUP: &str =
    "return textureSampleCompareLevel(shadow_map, shadow_sampler, uv, face, ndc.z);";
const INVERTED: &str =
    "return 1.0 - textureSampleCompareLevel(shadow_map, shadow_sampler, uv, face, ndc.z);";
const BIASED: &str =
    "return textureSampleCompareLevel(shadow_map, shadow_sampler, uv, face, ndc.z - 0.2);";
const FACE: &str = "let face = face_of(moved - light);";
const UV: &str = "vec2f(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y);";
const V_UP: &str = "vec2f(0.5 + 0.5 * ndc.x, 0.5 + 0.5 * ndc.y);";
const DIVIDED: &str = "let ndc = clip.xyz / clip.w;";
const Y_FACES: &str = "return select(2u, 3u, direction.y < 0.0);";
const TENTH: &str = "(0.1 + 0.9 * visibility(world_position, n, wi)) *";

mistakes! {
    "shadow-map-acne": (DIFFUSE, MOVED, "let moved = position;"), (PHONG, MOVED, "let moved = position;");
    "shadow-map-peter-panning":
        (DIFFUSE, MOVED, "let moved = position + 0.3 * (n + wi);"),
        (PHONG, MOVED, "let moved = position + 0.3 * (n + wi);");
    "shadow-map-depth-bias": (DIFFUSE, LOOKUP, BIASED), (PHONG, LOOKUP, BIASED);
    "shadow-map-inverted": (DIFFUSE, LOOKUP, INVERTED), (PHONG, LOOKUP, INVERTED);
    "shadow-map-first-face": (DIFFUSE, FACE, "let face = 0u;"), (PHONG, FACE, "let face = 0u;");
    "shadow-map-faces-swapped":
        (DIFFUSE, Y_FACES, "return select(3u, 2u, direction.y < 0.0);"),
        (PHONG, Y_FACES, "return select(3u, 2u, direction.y < 0.0);");
    "shadow-map-v-not-flipped": (DIFFUSE, UV, V_UP), (PHONG, UV, V_UP);
    "shadow-map-not-halved": (DIFFUSE, UV, "ndc.xy;"), (PHONG, UV, "ndc.xy;");
    "shadow-map-no-divide":
        (DIFFUSE, DIVIDED, "let ndc = clip.xyz;"), (PHONG, DIVIDED, "let ndc = clip.xyz;");
    "shadow-map-only-diffuse": (PHONG, VISIBLE, "");
    "shadow-map-only-phong": (DIFFUSE, VISIBLE, "");
    "shadow-map-tenth": (DIFFUSE, VISIBLE, TENTH), (PHONG, VISIBLE, TENTH);
}
