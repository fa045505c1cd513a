
@fragment
fn fs_main(@location(0) position: vec3f, @location(1) normal: vec3f) -> @location(0) vec4f {
    return vec4f(normalize(normal), 1.0);
}
