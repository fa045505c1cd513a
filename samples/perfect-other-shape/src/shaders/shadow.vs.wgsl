struct Globals { view: mat4x4f, projection: mat4x4f, eye: vec4f, light: vec4f, intensity: vec4f }
@group(0) @binding(0) var<storage, read> globals: Globals;

@vertex
fn vs_main(@location(0) p: vec3f) -> @builtin(position) vec4f {
    return globals.projection * (globals.view * vec4f(p, 1.0));
}
