// Diffuse reflection of a point light, in world space.

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

@group(0) @binding(0) var<storage, read> frame: Frame;
@group(2) @binding(0) var<storage, read> material: Material;

struct Shadow {
    params: vec4f,
    light_view_projection: array<mat4x4f, 6>,
}

@group(3) @binding(0) var<storage, read> shadow: Shadow;
@group(3) @binding(1) var shadow_map: texture_depth_2d_array;
@group(3) @binding(2) var shadow_sampler: sampler_comparison;

const PI: f32 = 3.14159265;

// 1 where the light sees the point, 0 in its shadow. What the light's frustum does not cover, no
// occluder hides: see renderpasses/shadow.rs.
fn visibility(clip: vec4f) -> f32 {
    if shadow.params.x == 0.0 {
        return 1.0;
    }
    let ndc = clip.xyz / clip.w;
    let covered = clip.w > 0.0 && max(abs(ndc.x), abs(ndc.y)) < 1.0;
    let uv = vec2f(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y);
    let seen = textureSampleCompareLevel(shadow_map, shadow_sampler, uv, 0, ndc.z);
    return select(1.0, seen, covered);
}

@fragment
fn fs_main(
    @location(0) world_position: vec3f,
    @location(1) world_normal: vec3f,
    @location(2) in_map: vec4f,
) -> @location(0) vec4f {
    let n = normalize(world_normal);
    let wo = normalize(frame.camera_position.xyz - world_position);
    let to_light = frame.light_position.xyz - world_position;
    let wi = normalize(to_light);
    let cos_i = dot(n, wi);
    if cos_i <= 0.0 || dot(n, wo) <= 0.0 {
        return vec4f(0.0, 0.0, 0.0, 1.0);
    }
    let incident = frame.light_intensity.rgb / dot(to_light, to_light);
    let f = material.rho_d.rgb / PI;
    return vec4f(visibility(in_map) * incident * f * cos_i, 1.0);
}
