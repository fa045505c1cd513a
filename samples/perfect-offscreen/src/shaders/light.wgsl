// Light that arrives at a point, between common.wgsl and the materials.

@group(2) @binding(0) var distances: texture_2d_array<f32>;

// The light sees a point when nothing is nearer in its direction. Texels are wide: the point is moved
// off the surface by nearly one of them.
fn seen(p: vec3f, n: vec3f) -> f32 {
    let side = max(globals.intensity.w, 1.0);
    let straight = abs(p - globals.light.xyz);
    let texel = 2.0 * max(straight.x, max(straight.y, straight.z)) / side;
    let way = p - globals.light.xyz + 0.8 * texel * n;
    let size = abs(way);
    var axis = 0u;
    if size.y >= max(size.x, size.z) {
        axis = 1u;
    } else if size.z >= size.x {
        axis = 2u;
    }
    let face = 2u * axis + select(0u, 1u, way[axis] < 0.0);
    let q = vec2f(way[(axis + 1u) % 3u], way[(axis + 2u) % 3u]) / size[axis];
    let at = clamp(0.5 * side * (1.0 + vec2f(q.x, -q.y)), vec2f(0.0), vec2f(side - 1.0));
    let nearest = textureLoad(distances, vec2u(at), face, 0).x;
    return select(0.0, 1.0, globals.intensity.w == 0.0 || length(way) - texel <= nearest);
}

struct Light {
    wi: vec3f,
    wo: vec3f,
    // Of a surface that is seen, with the cosine.
    irradiance: vec3f,
}

fn light(p: vec3f, n: vec3f) -> Light {
    let way = globals.light.xyz - p;
    let wi = normalize(way);
    let wo = normalize(globals.eye.xyz - p);
    let cosine = max(dot(n, wi), 0.0) * select(0.0, 1.0, dot(n, wo) > 0.0);
    return Light(wi, wo, seen(p, n) * cosine * globals.intensity.rgb / dot(way, way));
}
