// The vertex stage of all materials: world space for shading, clip space for the rasteriser.

struct Frame {
    view: mat4x4f,
    projection: mat4x4f,
    camera_position: vec4f,
    light_position: vec4f,
    light_intensity: vec4f,
}

struct Object {
    model: mat4x4f,
    normal_matrix: mat4x4f,
}

@group(0) @binding(0) var<storage, read> frame: Frame;
@group(1) @binding(0) var<storage, read> object: Object;

struct Shadow {
    params: vec4f,
    light_view_projection: array<mat4x4f, 6>,
}
@group(3) @binding(0) var<storage, read> shadow: Shadow;

struct Varyings {
    @location(2) in_map: vec4f,
    @builtin(position) clip_position: vec4f,
    @location(0) world_position: vec3f,
    @location(1) world_normal: vec3f,
}

@vertex
fn vs_main(@location(0) position: vec3f, @location(1) normal: vec3f) -> Varyings {
    var out: Varyings;
    let world_position = object.model * vec4f(position, 1.0);
    out.world_position = world_position.xyz;
    out.world_normal = (frame.view * object.normal_matrix * vec4f(normal, 0.0)).xyz;
    out.clip_position = frame.projection * frame.view * world_position;
    let lvp = shadow.light_view_projection[0];
    let texel = 2.0 * (lvp * world_position).w * shadow.params.w / max(shadow.params.z, 1.0);
    out.in_map = lvp * vec4f(world_position.xyz + 1.5 * texel * normalize(out.world_normal), 1.0);
    return out;
}
