// Copies the finished picture to the film.

@group(0) @binding(0) var picture: texture_2d<f32>;

@vertex
fn over_the_film(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn copy(@builtin(position) at: vec4f) -> @location(0) vec4f {
    return textureLoad(picture, vec2u(at.xy), 0);
}
