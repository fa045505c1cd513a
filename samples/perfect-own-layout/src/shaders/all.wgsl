// Every stage in one file, in view space: there the viewer is the origin.

struct Scene {
    to_view: mat4x4f,
    to_clip: mat4x4f,
    // View space, intensity beside it.
    light: vec4f,
    intensity: vec4f,
}

// Kd and the exponent, Ks and what draws: 0 diffuse, 1 Phong, 2 emitter.
struct Thing {
    kd_n: vec4f,
    ks_kind: vec4f,
}

@group(0) @binding(0) var<storage, read> scene: Scene;
@group(0) @binding(1) var<storage, read> things: array<Thing>;

struct Point {
    @builtin(position) clip: vec4f,
    @location(0) p: vec3f,
    @location(1) n: vec3f,
    @location(2) @interpolate(flat) thing: u32,
}

@vertex
fn to_film(
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @builtin(instance_index) thing: u32,
) -> Point {
    let p = scene.to_view * vec4f(position, 1.0);
    let n = scene.to_view * vec4f(normal, 0.0);
    return Point(scene.to_clip * p, p.xyz, n.xyz, thing);
}

@fragment
fn shade(point: Point) -> @location(0) vec4f {
    let thing = things[point.thing];
    let n = normalize(point.n);
    let l = scene.light.xyz - point.p;
    let wi = normalize(l);
    let wo = normalize(-point.p);
    let both = max(dot(n, wi), 0.0) * step(1e-20, dot(n, wo));
    let mirrored = 2.0 * dot(n, wo) * n - wo;
    let exponent = thing.kd_n.w;
    let lobe = 0.5 * (exponent + 2.0) * pow(max(dot(mirrored, wi), 0.0), exponent);
    let phong = select(0.0, lobe, thing.ks_kind.w == 1.0);
    let f = 0.31830988618 * (thing.kd_n.rgb + phong * thing.ks_kind.rgb);
    let reflected = scene.intensity.rgb / dot(l, l) * both * f;
    return vec4f(select(reflected, vec3f(1.0), thing.ks_kind.w == 2.0), 1.0);
}
