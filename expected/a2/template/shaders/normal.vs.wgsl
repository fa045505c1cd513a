// The vertex stage of the previous assignment: normals as colours.

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
    let world = object.model * vec4f(position, 1.0);
    var out: Varyings;
    out.clip_position = frame.projection * frame.view * world;
    out.world_position = world.xyz;
    out.world_normal = (object.normal_matrix * vec4f(normal, 0.0)).xyz;
    return out;
}
