//! Right variants of the stages.

use super::{COSINE, DIFFUSE, FACING, NORMAL, PHONG, SQUARED, VISIBLE, VS, mistakes};

const CLIP: &str = "frame.projection * frame.view * world;";
const VS_NORMAL: &str = "(object.normal_matrix * vec4f(normal, 0.0)).xyz;";
const WI: &str = "let wi = to_light * inverseSqrt(r2);";
const COS_ALPHA: &str = "let cos_alpha = max(dot(reflect(-wo, n), wi), 0.0);";
const LENGTH: &str = "let r2 = length(to_light) * length(to_light);";
const CLAMPED: &str = "let cos_i = max(dot(n, wi), 0.0);";
// A third varying: the way from the light, by which the shadow map is looked up.
const VARYING: &str = "@location(1) world_normal: vec3f,";
const AND_THIRD: &str = "@location(1) world_normal: vec3f,\n    @location(2) from_light: vec3f,";
const VS_RETURN: &str = "return out;";
const FORWARDED: &str = "out.from_light = world.xyz - frame.light_position.xyz;\n    return out;";
const BY_THIRD: &str = "visibility(from_light, n, wi) *";
const LIGHT: &str = "let light = frame.light_position.xyz;";
const AT_LIGHT: &str = "let light = vec3f(0.0);";
const LOOKED_UP: &str = "vec4f(moved, 1.0);";
const FROM_LIGHT: &str = "vec4f(moved + frame.light_position.xyz, 1.0);";

mistakes! {
    "third-varying":
        (VS, VARYING, AND_THIRD), (VS, VS_RETURN, FORWARDED),
        (DIFFUSE, VARYING, AND_THIRD), (DIFFUSE, VISIBLE, BY_THIRD), (DIFFUSE, LIGHT, AT_LIGHT),
        (DIFFUSE, LOOKED_UP, FROM_LIGHT),
        (PHONG, VARYING, AND_THIRD), (PHONG, VISIBLE, BY_THIRD), (PHONG, LIGHT, AT_LIGHT),
        (PHONG, LOOKED_UP, FROM_LIGHT);
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
