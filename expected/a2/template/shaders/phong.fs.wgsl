// Normalised Phong reflection of a point light, in world space.

struct Frame {
    view: mat4x4f,
    projection: mat4x4f,
    camera_position: vec4f,
    light_position: vec4f,
    light_intensity: vec4f,
}

struct Material {
    rho_d: vec4f,
    rho_s: vec4f,
    exponent: vec4f,
}

@group(0) @binding(0) var<storage, read> frame: Frame;
@group(2) @binding(0) var<storage, read> material: Material;

// TODO(A2) 2.5 (bonus): group 3 holds the shadow map; docs/shader_contract.md shows how to declare it.

@fragment
fn fs_main(
    @location(0) world_position: vec3f,
    @location(1) world_normal: vec3f,
) -> @location(0) vec4f {
    // TODO(A2) 2.4: what your integrator (1.3) and your Phong BSDF (1.2) do, in world space.
    // The albedos already hold the energy scale. Mind which way `reflect` wants its direction, and
    // that `pow` of a negative base is undefined.
    return vec4f(0.0, 0.0, 0.0, 1.0);
}
