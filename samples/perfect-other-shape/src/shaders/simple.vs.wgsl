struct Globals { view: mat4x4f, projection: mat4x4f, eye: vec4f, light: vec4f, intensity: vec4f }
struct Placement { model: mat4x4f, normals: mat4x4f }
@group(0) @binding(0) var<storage, read> globals: Globals;
@group(1) @binding(0) var<storage, read> placement: Placement;

struct Out {
    @location(0) p: vec3f,
    @location(1) n: vec3f,
    @builtin(position) clip: vec4f,
}

@vertex
fn vs_main(@location(0) p: vec3f, @location(1) n: vec3f) -> Out {
    let world = placement.model * vec4f(p, 1.0);
    let normals = mat3x3f(placement.normals[0].xyz, placement.normals[1].xyz, placement.normals[2].xyz);
    return Out(world.xyz, normalize(normals * n), globals.projection * (globals.view * world));
}
