// What all stages share: it is put in front of each.

struct Globals {
    to_clip: mat4x4f,
    eye: vec4f,
    light: vec4f,
    // w: texels along a side of the cube of distances, 0 without shadows.
    intensity: vec4f,
}

struct Surface {
    kd: vec4f,
    ks: vec4f,
}

struct Point {
    @builtin(position) clip: vec4f,
    @location(0) p: vec3f,
    @location(1) n: vec3f,
}

@group(0) @binding(0) var<storage, read> globals: Globals;
@group(1) @binding(0) var<storage, read> surface: Surface;
