//! Mistakes of `phong.fs`.

use super::{
    BLACK, CLAMPED, COSINE, FACING, FALLOFF, GAMMA, INTENSITY, NO_MINUS, OVER_VIEWER, PHONG,
    RETURN, REVERSED, TIMES_COSINE, TO_LIGHT, TO_VIEWER, VIEW_LIGHT, mistakes,
};

const ALBEDO: &str = "rho_d.rgb / PI +";
const SPECULAR: &str = "material.rho_s.rgb * lobe;";
const COS_ALPHA: &str = "let cos_alpha = max(dot(reflect(-wo, n), wi), 0.0);";
const EXPONENT: &str = "let exponent = material.exponent.x;";
const FACTOR: &str = "(exponent + 2.0) / (2.0 * PI) *";
const POWER: &str = "pow(cos_alpha, exponent);";

mistakes! {
    "phong-fs-no-pi": (PHONG, ALBEDO, "rho_d.rgb +");
    "phong-fs-pi-twice": (PHONG, ALBEDO, "rho_d.rgb / (PI * PI) +");
    "phong-fs-no-diffuse": (PHONG, "material.rho_d.rgb / PI +", "");
    "phong-fs-no-specular": (PHONG, SPECULAR, "0.0 * lobe;");
    "phong-fs-specular-grey": (PHONG, SPECULAR, "material.rho_s.rrr * lobe;");
    "phong-fs-kd-ks-swapped":
        (PHONG, ALBEDO, "rho_s.rgb / PI +"), (PHONG, SPECULAR, "material.rho_d.rgb * lobe;");
    "phong-fs-specular-without-cosine": (PHONG, SPECULAR, "material.rho_s.rgb * lobe / cos_i;");
    "phong-fs-specular-two-cosines": (PHONG, SPECULAR, "material.rho_s.rgb * lobe * cos_i;");
    "phong-fs-diffuse-without-cosine": (PHONG, ALBEDO, "rho_d.rgb / PI / cos_i +");
    "phong-fs-two-cosines": (PHONG, TIMES_COSINE, "f * cos_i * cos_i;");
    "phong-fs-no-cosine": (PHONG, TIMES_COSINE, "f;");
    "phong-fs-cos-o": (PHONG, TIMES_COSINE, "f * cos_o;");
    "phong-fs-no-falloff": (PHONG, FALLOFF, "*");
    "phong-fs-over-r": (PHONG, FALLOFF, "/ sqrt(r2) *");
    "phong-fs-over-r-cubed": (PHONG, FALLOFF, "/ (r2 * sqrt(r2)) *");
    "phong-fs-over-r-fourth": (PHONG, FALLOFF, "/ (r2 * r2) *");
    "phong-fs-distance-to-camera": (PHONG, FALLOFF, OVER_VIEWER);
    "phong-fs-grey": (PHONG, INTENSITY, "frame.light_intensity.r");
    "phong-fs-red-only": (PHONG, INTENSITY, "vec3f(1.0, 0.0, 0.0) * frame.light_intensity.rgb");
    "phong-fs-over-4pi": (PHONG, INTENSITY, "frame.light_intensity.rgb / (4.0 * PI)");
    "phong-fs-no-wo-test": (PHONG, FACING, "if cos_i <= 0.0 {");
    "phong-fs-no-wi-test": (PHONG, FACING, "if cos_o <= 0.0 {");
    "phong-fs-no-tests": (PHONG, FACING, "if false {");
    "phong-fs-abs-cosine": (PHONG, COSINE, "let cos_i = abs(dot(n, wi));");
    "phong-fs-view-space-light": (PHONG, TO_LIGHT, VIEW_LIGHT);
    "phong-fs-light-direction": (PHONG, TO_LIGHT, NO_MINUS);
    "phong-fs-light-reversed": (PHONG, TO_LIGHT, REVERSED);
    "phong-fs-camera-at-origin": (PHONG, TO_VIEWER, "let wo = normalize(-world_position);");
    "phong-fs-camera-direction":
        (PHONG, TO_VIEWER, "let wo = normalize(frame.camera_position.xyz);");
    "phong-fs-viewer-reversed":
        (PHONG, TO_VIEWER, "let wo = normalize(world_position - frame.camera_position.xyz);");
    "phong-fs-reflect-sign": (PHONG, COS_ALPHA, "let cos_alpha = max(dot(reflect(wo, n), wi), 0.0);");
    "phong-fs-reflect-light": (PHONG, COS_ALPHA, "let cos_alpha = max(dot(reflect(wi, n), wo), 0.0);");
    "phong-fs-reflect-forgotten": (PHONG, COS_ALPHA, "let cos_alpha = max(dot(wo, wi), 0.0);");
    "phong-fs-alpha-from-normal": (PHONG, COS_ALPHA, "let cos_alpha = max(dot(n, wi), 0.0);");
    "phong-fs-specular-abs": (PHONG, COS_ALPHA, "let cos_alpha = abs(dot(reflect(-wo, n), wi));");
    "phong-fs-no-clamp":
        (PHONG, COS_ALPHA, "let cos_alpha = dot(reflect(-wo, n), wi);"),
        (PHONG, POWER, "pow(abs(cos_alpha), exponent);");
    "phong-fs-blinn": (PHONG, COS_ALPHA, "let cos_alpha = max(dot(normalize(wo + wi), n), 0.0);");
    "phong-fs-reflect-no-2":
        (PHONG, COS_ALPHA, "let cos_alpha = max(dot(n * dot(n, wo) - wo, wi), 0.0);");
    "phong-fs-not-a-number": (PHONG, COS_ALPHA, "let cos_alpha = dot(reflect(-wo, n), wi);");
    "phong-fs-pow-swapped": (PHONG, POWER, "pow(exponent, cos_alpha);");
    "phong-fs-no-parentheses": (PHONG, FACTOR, "(exponent + 2.0 / (2.0 * PI)) *");
    "phong-fs-times-rho-d": (PHONG, SPECULAR, "material.rho_s.rgb * material.rho_d.rgb * lobe;");
    "phong-fs-over-root-r": (PHONG, FALLOFF, "/ sqrt(sqrt(r2)) *");
    "phong-fs-distance-from-origin":
        (PHONG, FALLOFF, "/ dot(frame.light_position.xyz, frame.light_position.xyz) *");
    "phong-fs-n-plus-1": (PHONG, FACTOR, "(exponent + 1.0) / (2.0 * PI) *");
    "phong-fs-n-over-2pi": (PHONG, FACTOR, "exponent / (2.0 * PI) *");
    "phong-fs-specular-no-2pi": (PHONG, FACTOR, "(exponent + 2.0) *");
    "phong-fs-specular-over-pi": (PHONG, FACTOR, "(exponent + 2.0) / PI *");
    "phong-fs-unnormalised": (PHONG, FACTOR, "");
    "phong-fs-exponent-plus-1": (PHONG, POWER, "pow(cos_alpha, exponent + 1.0);");
    "phong-fs-exponent-half": (PHONG, POWER, "pow(cos_alpha, 0.5 * exponent);");
    "phong-fs-exponent-twice": (PHONG, POWER, "pow(cos_alpha, 2.0 * exponent);");
    "phong-fs-exponent-fixed": (PHONG, EXPONENT, "let exponent = 32.0 + 0.0 * material.exponent.x;");
    "phong-fs-exponent-truncated": (PHONG, EXPONENT, "let exponent = trunc(material.exponent.x);");
    "phong-fs-exponent-rounded": (PHONG, EXPONENT, "let exponent = round(material.exponent.x);");
    "phong-fs-gamma": (PHONG, RETURN, GAMMA);
    "phong-fs-clamped": (PHONG, RETURN, CLAMPED);
    "phong-fs-black": (PHONG, RETURN, BLACK);
    "phong-fs-facing-reversed": (PHONG, FACING, "if cos_i >= 0.0 || cos_o <= 0.0 {");
    "phong-fs-wo-not-normalized":
        (PHONG, TO_VIEWER, "let wo = frame.camera_position.xyz - world_position;");
    "phong-fs-ambient": (PHONG, RETURN, "return vec4f(radiance + 0.1 * material.rho_d.rgb, 1.0);");
}
