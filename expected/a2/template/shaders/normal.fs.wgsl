// The fragment stage of the previous assignment: normals as colours.

@fragment
fn fs_main(
    @location(0) world_position: vec3f,
    @location(1) world_normal: vec3f,
) -> @location(0) vec4f {
    return vec4f(abs(normalize(world_normal)), 1.0);
}
