//! The shader contract as Rust types: what lies in the uniform buffers.
//!
//! `docs/shader_contract.md` documents it, and a test compares the two. Members are only vectors of four floats and 4x4
//! matrices, because these have the same layout in Rust and in WGSL.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3, Vec4};

use crate::Camera;

/// Format of the colors: linear radiance, not clamped.
pub const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
/// Format of the depths, 0 near to 1 far.
pub const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Index of the bind group that holds [`FrameUniforms`].
pub const FRAME_GROUP: u32 = 0;
/// Index of the bind group that holds [`ObjectUniforms`].
pub const OBJECT_GROUP: u32 = 1;
/// Index of the bind group that holds [`MaterialUniforms`].
pub const MATERIAL_GROUP: u32 = 2;
/// Index of the bind group that holds [`ShadowUniforms`], the shadow map and its sampler.
pub const SHADOW_GROUP: u32 = 3;
/// The most layers that a shadow map has: the faces of a cube.
pub const SHADOW_LAYERS: usize = 6;
/// Bytes from one vertex to the next: position and normal, three floats each.
pub const VERTEX_STRIDE: u64 = 24;

/// Group 0: what is the same for everything in a frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct FrameUniforms {
    /// World space to view space.
    pub view: Mat4,
    /// View space to clip space: y up, z in [0, 1].
    pub projection: Mat4,
    /// Position of the camera, world space; w is 1.
    pub camera_position: Vec4,
    /// Position of the point light, world space; w is 1.
    pub light_position: Vec4,
    /// Radiant intensity I of the point light [W sr^-1]; w is 0.
    pub light_intensity: Vec4,
}

impl FrameUniforms {
    /// What a camera decides; the light is zero.
    pub fn new(camera: &Camera) -> Self {
        Self {
            view: camera.view(),
            projection: camera.projection(),
            camera_position: camera.eye().extend(1.0),
            light_position: Vec4::ZERO,
            light_intensity: Vec4::ZERO,
        }
    }
}

/// Group 1: where an object stands.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ObjectUniforms {
    /// Object space to world space. The identity in this assignment.
    pub model: Mat4,
    /// Takes normals to world space: the inverse transpose of `model`, without translation.
    pub normal_matrix: Mat4,
}

impl ObjectUniforms {
    /// An object placed by `model`, which must be invertible.
    pub fn new(model: Mat4) -> Self {
        let linear = glam::Mat3::from_mat4(model);
        Self { model, normal_matrix: Mat4::from_mat3(linear.inverse().transpose()) }
    }
}

/// Group 2: what an object is made of.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MaterialUniforms {
    /// Diffuse albedo, already multiplied by [`crate::Material::energy_scale`]; w is 0.
    pub rho_d: Vec4,
    /// Specular albedo, already multiplied by [`crate::Material::energy_scale`]; w is 0.
    pub rho_s: Vec4,
    /// The Phong exponent n in x; the rest is 0.
    pub exponent: Vec4,
}

impl MaterialUniforms {
    /// The uniforms of a material without textures: a realtime material has one color, so pass
    /// [`crate::Texture::average`], each albedo times [`crate::Material::energy_scale`].
    pub fn new(rho_d: Vec3, rho_s: Vec3, exponent: f32) -> Self {
        Self {
            rho_d: rho_d.extend(0.0),
            rho_s: rho_s.extend(0.0),
            exponent: Vec4::new(exponent, 0.0, 0.0, 0.0),
        }
    }
}

/// Group 3, binding 0: how to look up the shadow map.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ShadowUniforms {
    /// x: 1 when shadows are drawn, else 0; y: number of layers in use; z: width and height of a
    /// layer in texels; w: free for the author.
    pub params: Vec4,
    /// World space to the light's clip space, for each layer in use.
    pub light_view_projection: [Mat4; SHADOW_LAYERS],
}
