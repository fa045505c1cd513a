// Normalised Phong reflection of a point light, in world space:
// L = V I / r^2 (rho_d / pi + rho_s (n + 2) / (2 pi) cos^n alpha) cos_i.

struct Frame {
    view: mat4x4f,
    projection: mat4x4f,
    camera_position: vec4f,
    light_position: vec4f,
    light_intensity: vec4f,
}

struct Material {
    rho_d: vec4f,
    rho_s: vec4f,
    exponent: vec4f,
}

struct Shadow {
    params: vec4f,
    light_view_projection: array<mat4x4f, 6>,
}

@group(0) @binding(0) var<storage, read> frame: Frame;
@group(2) @binding(0) var<storage, read> material: Material;
@group(3) @binding(0) var<storage, read> shadow: Shadow;
@group(3) @binding(1) var shadow_map: texture_depth_2d_array;
@group(3) @binding(2) var shadow_sampler: sampler_comparison;

const PI: f32 = 3.14159265358979;

// The face of the shadow cube that a direction from the light meets: +x -x +y -y +z -z.
fn face_of(direction: vec3f) -> u32 {
    let size = abs(direction);
    if size.x >= size.y && size.x >= size.z {
        return select(0u, 1u, direction.x < 0.0);
    }
    if size.y >= size.z {
        return select(2u, 3u, direction.y < 0.0);
    }
    return select(4u, 5u, direction.z < 0.0);
}

// 1 where the light sees the point, 0 in shadow. The renderer explains the bias: see shadow.rs.
fn visibility(position: vec3f, n: vec3f, wi: vec3f) -> f32 {
    if shadow.params.x == 0.0 {
        return 1.0;
    }
    let light = frame.light_position.xyz;
    let size = abs(position - light);
    let texel = 2.0 * max(size.x, max(size.y, size.z)) / shadow.params.z;
    let moved = position + texel * (shadow.params.w * n + wi);
    let face = face_of(moved - light);
    let clip = shadow.light_view_projection[face] * vec4f(moved, 1.0);
    let ndc = clip.xyz / clip.w;
    let uv = vec2f(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y);
    return textureSampleCompareLevel(shadow_map, shadow_sampler, uv, face, ndc.z);
}

@fragment
fn fs_main(
    @location(0) world_position: vec3f,
    @location(1) world_normal: vec3f,
) -> @location(0) vec4f {
    let n = normalize(world_normal);
    let wo = normalize(frame.camera_position.xyz - world_position);
    let to_light = frame.light_position.xyz - world_position;
    let r2 = dot(to_light, to_light);
    let wi = to_light * inverseSqrt(r2);
    let cos_i = dot(n, wi);
    let cos_o = dot(n, wo);
    if cos_i <= 0.0 || cos_o <= 0.0 {
        return vec4f(0.0, 0.0, 0.0, 1.0);
    }
    // `reflect` wants the direction of travel: from the viewer to the surface.
    let cos_alpha = max(dot(reflect(-wo, n), wi), 0.0);
    let exponent = material.exponent.x;
    let lobe = (exponent + 2.0) / (2.0 * PI) * pow(cos_alpha, exponent);
    let f = material.rho_d.rgb / PI + material.rho_s.rgb * lobe;
    let radiance = visibility(world_position, n, wi) * frame.light_intensity.rgb / r2 * f * cos_i;
    return vec4f(radiance, 1.0);
}
