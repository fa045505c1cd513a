//! Right variants of the stages.

use super::{COSINE, DIFFUSE, FACING, NORMAL, PHONG, SQUARED, VS, mistakes};

const CLIP: &str = "frame.projection * frame.view * world;";
const VS_NORMAL: &str = "(object.normal_matrix * vec4f(normal, 0.0)).xyz;";
const WI: &str = "let wi = to_light * inverseSqrt(r2);";
const COS_ALPHA: &str = "let cos_alpha = max(dot(reflect(-wo, n), wi), 0.0);";
const LENGTH: &str = "let r2 = length(to_light) * length(to_light);";
const CLAMPED: &str = "let cos_i = max(dot(n, wi), 0.0);";

mistakes! {
    "normals-raw": (DIFFUSE, NORMAL, "let n = world_normal;"), (PHONG, NORMAL, "let n = world_normal;");
    "normals-doubled": (VS, VS_NORMAL, "2.0 * (object.normal_matrix * vec4f(normal, 0.0)).xyz;");
    "normals-negated-twice":
        (VS, VS_NORMAL, "-(object.normal_matrix * vec4f(normal, 0.0)).xyz;"),
        (DIFFUSE, NORMAL, "let n = -normalize(world_normal);"),
        (PHONG, NORMAL, "let n = -normalize(world_normal);");
    "normals-as-they-are": (VS, VS_NORMAL, "normal;");
    "no-model-matrix": (VS, "object.model * vec4f(position, 1.0);", "vec4f(position, 1.0);");
    "matrices-first": (VS, CLIP, "(frame.projection * frame.view) * world;");
    "matrices-one-by-one": (VS, CLIP, "frame.projection * (frame.view * world);");
    "cosine-clamped":
        (DIFFUSE, COSINE, CLAMPED), (DIFFUSE, FACING, "if cos_o <= 0.0 {"),
        (PHONG, COSINE, CLAMPED), (PHONG, FACING, "if cos_o <= 0.0 {");
    "distance-by-length": (DIFFUSE, SQUARED, LENGTH), (PHONG, SQUARED, LENGTH);
    "direction-by-normalize":
        (DIFFUSE, WI, "let wi = normalize(to_light);"), (PHONG, WI, "let wi = normalize(to_light);");
    "pi-as-a-factor":
        (DIFFUSE, "rho_d.rgb / PI", "rho_d.rgb * 0.31830988618"),
        (PHONG, "rho_d.rgb / PI", "rho_d.rgb * 0.31830988618");
    "fs-alpha-by-dots":
        (PHONG, COS_ALPHA, "let cos_alpha = max(2.0 * cos_i * cos_o - dot(wi, wo), 0.0);");
    "fs-reflect-light-down":
        (PHONG, COS_ALPHA, "let cos_alpha = max(dot(reflect(-wi, n), wo), 0.0);");
    "fs-power-by-exp2":
        (PHONG, "pow(cos_alpha, exponent);", "exp2(exponent * log2(max(cos_alpha, 1e-30)));");
}
