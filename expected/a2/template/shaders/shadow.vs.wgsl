// Draws the shadow map (bonus): view and projection are the light's.

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

@vertex
fn vs_main(@location(0) position: vec3f) -> @builtin(position) vec4f {
    // TODO(A2) 2.5 (bonus): the position in the light's clip space.
    return vec4f();
}
