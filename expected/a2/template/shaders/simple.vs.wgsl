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

struct Varyings {
    @builtin(position) clip_position: vec4f,
    @location(0) world_position: vec3f,
    @location(1) world_normal: vec3f,
}

@vertex
fn vs_main(@location(0) position: vec3f, @location(1) normal: vec3f) -> Varyings {
    var out: Varyings;
    // TODO(A2) 2.2: position and normal in world space, and the position in clip space.
    // `normal.vs.wgsl` is a model.
    return out;
}
