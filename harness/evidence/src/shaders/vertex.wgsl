
struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
}

@vertex
fn vs_main(@location(0) position: vec3f, @location(1) normal: vec3f) -> Varyings {
    let world = object.model * vec4f(position, 1.0);
    let turned = object.normal_matrix * vec4f(normal, 0.0);
    return Varyings(frame.projection * frame.view * world, world.xyz, turned.xyz);
}
