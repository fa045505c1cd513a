struct Globals { view: mat4x4f, projection: mat4x4f, eye: vec4f, light: vec4f, intensity: vec4f }
struct Surface { kd: vec4f, ks: vec4f, n: vec4f }
struct Faces { info: vec4f, clip: array<mat4x4f, 6> }
@group(0) @binding(0) var<storage, read> globals: Globals;
@group(2) @binding(0) var<storage, read> surface: Surface;
@group(3) @binding(0) var<storage, read> faces: Faces;
@group(3) @binding(1) var depths: texture_depth_2d_array;

const inv_pi = 0.318309886;

// Compares by hand. A texel tells the depth at its centre, so ask for the depth that the plane of
// this triangle has there; what is left to forgive is the curvature of its neighbours.
fn in_shadow(p: vec3f, plane: vec3f) -> bool {
    let from_light = p - globals.light.xyz;
    let size = abs(from_light);
    var face = 0u;
    if size.y > max(size.x, size.z) {
        face = 2u;
    } else if size.z > size.x {
        face = 4u;
    }
    if from_light[face / 2u] < 0.0 {
        face += 1u;
    }
    let clip = faces.clip[face];
    let right = vec3f(clip[0].x, clip[1].x, clip[2].x);
    let up = vec3f(clip[0].y, clip[1].y, clip[2].y);
    let forward = vec3f(clip[0].w, clip[1].w, clip[2].w);
    let side = faces.info.z;
    let depth = dot(forward, from_light);
    let x = dot(right, from_light) / depth;
    let y = dot(up, from_light) / depth;
    let texel = clamp(floor(vec2f(0.5 + 0.5 * x, 0.5 - 0.5 * y) * side), vec2f(0.0), vec2f(side - 1.0));
    let centre = (texel + 0.5) / side;
    let along = forward + (2.0 * centre.x - 1.0) * right + (1.0 - 2.0 * centre.y) * up;
    let slope = dot(along, plane);
    var expected = depth;
    if abs(slope) > 1e-6 * length(plane) {
        expected = clamp(dot(from_light, plane) / slope, 0.9 * depth, depth);
    }
    expected *= 1.0 - 3.0 / side;
    let q = clip * vec4f(globals.light.xyz + expected * along, 1.0);
    return textureLoad(depths, vec2i(texel), face, 0) < q.z / q.w;
}

@fragment
fn fs_main(@location(0) p: vec3f, @location(1) interpolated: vec3f) -> @location(0) vec4f {
    let plane = cross(dpdx(p), dpdy(p));
    let n = normalize(interpolated);
    let d = globals.light.xyz - p;
    let r = length(d);
    let cosines = vec2f(dot(n, d / r), dot(n, normalize(globals.eye.xyz - p)));
    var rgb = vec3f(0.0);
    if all(cosines > vec2f(0.0)) {
        rgb = globals.intensity.rgb * cosines.x / (r * r) * brdf();
    }
    if faces.info.x != 0.0 {
        if in_shadow(p, plane) {
            rgb = vec3f(0.0);
        }
    }
    return vec4f(rgb, 1.0);
}

fn brdf() -> vec3f {
    return surface.kd.rgb * inv_pi;
}
