// Draws the shadow map: view and projection are the light's.

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
    return frame.projection * frame.view * object.model * vec4f(position, 1.0);
}
