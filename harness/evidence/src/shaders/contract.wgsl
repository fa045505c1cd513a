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

struct Material {
    rho_d: vec4f,
    rho_s: vec4f,
    exponent: vec4f,
}

@group(0) @binding(0) var<storage, read> frame: Frame;
@group(1) @binding(0) var<storage, read> object: Object;
@group(2) @binding(0) var<storage, read> material: Material;
