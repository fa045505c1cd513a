//! Mistakes of `diffuse.fs`.

use super::{
    BLACK, CLAMPED, COSINE, DIFFUSE, FACING, FALLOFF, GAMMA, INTENSITY, NO_MINUS, NORMAL,
    OVER_VIEWER, RETURN, REVERSED, TIMES_COSINE, TO_LIGHT, VIEW_LIGHT, mistakes,
};

const ALBEDO: &str = "rho_d.rgb / PI;";

mistakes! {
    "diffuse-fs-no-pi": (DIFFUSE, ALBEDO, "rho_d.rgb;");
    "diffuse-fs-pi-twice": (DIFFUSE, ALBEDO, "rho_d.rgb / (PI * PI);");
    "diffuse-fs-over-2pi": (DIFFUSE, ALBEDO, "rho_d.rgb / (2.0 * PI);");
    "diffuse-fs-albedo-squared": (DIFFUSE, ALBEDO, "rho_d.rgb * material.rho_d.rgb / PI;");
    "diffuse-fs-albedo-red": (DIFFUSE, ALBEDO, "rho_d.rrr / PI;");
    "diffuse-fs-no-albedo": (DIFFUSE, "material.rho_d.rgb / PI;", "vec3f(1.0 / PI);");
    "diffuse-fs-two-cosines": (DIFFUSE, TIMES_COSINE, "f * cos_i * cos_i;");
    "diffuse-fs-no-cosine": (DIFFUSE, TIMES_COSINE, "f;");
    "diffuse-fs-cos-o": (DIFFUSE, TIMES_COSINE, "f * cos_o;");
    "diffuse-fs-no-falloff": (DIFFUSE, FALLOFF, "*");
    "diffuse-fs-over-r": (DIFFUSE, FALLOFF, "/ sqrt(r2) *");
    "diffuse-fs-over-r-cubed": (DIFFUSE, FALLOFF, "/ (r2 * sqrt(r2)) *");
    "diffuse-fs-over-r-fourth": (DIFFUSE, FALLOFF, "/ (r2 * r2) *");
    "diffuse-fs-distance-to-camera": (DIFFUSE, FALLOFF, OVER_VIEWER);
    "diffuse-fs-grey": (DIFFUSE, INTENSITY, "frame.light_intensity.r");
    "diffuse-fs-red-only": (DIFFUSE, INTENSITY, "vec3f(1.0, 0.0, 0.0) * frame.light_intensity.rgb");
    "diffuse-fs-over-4pi": (DIFFUSE, INTENSITY, "frame.light_intensity.rgb / (4.0 * PI)");
    "diffuse-fs-intensity-clamped": (DIFFUSE, INTENSITY, "min(frame.light_intensity.rgb, vec3f(1.0))");
    "diffuse-fs-no-wo-test": (DIFFUSE, FACING, "if cos_i <= 0.0 {");
    "diffuse-fs-no-wi-test": (DIFFUSE, FACING, "if cos_o <= 0.0 {");
    "diffuse-fs-no-tests": (DIFFUSE, FACING, "if false {");
    "diffuse-fs-wrapped": (DIFFUSE, COSINE, "let cos_i = 0.5 * dot(n, wi) + 0.5;");
    "diffuse-fs-abs-cosine": (DIFFUSE, COSINE, "let cos_i = abs(dot(n, wi));");
    "diffuse-fs-view-space-light": (DIFFUSE, TO_LIGHT, VIEW_LIGHT);
    "diffuse-fs-light-direction": (DIFFUSE, TO_LIGHT, NO_MINUS);
    "diffuse-fs-light-reversed": (DIFFUSE, TO_LIGHT, REVERSED);
    "diffuse-fs-normal-up": (DIFFUSE, NORMAL, "let n = vec3f(0.0, 1.0, 0.0) + 0.0 * world_normal;");
    "diffuse-fs-gamma": (DIFFUSE, RETURN, GAMMA);
    "diffuse-fs-clamped": (DIFFUSE, RETURN, CLAMPED);
    "diffuse-fs-black": (DIFFUSE, RETURN, BLACK);
    "diffuse-fs-ambient":
        (DIFFUSE, RETURN, "return vec4f(radiance + 0.1 * material.rho_d.rgb, 1.0);");
    "diffuse-fs-flat":
        (DIFFUSE, RETURN, "return vec4f(material.rho_d.rgb + 0.0 * radiance, 1.0);");
}
