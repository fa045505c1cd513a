//! What a renderer author starts from: scenes, rays, cameras, films and the safe [`Renderer`] trait.
//!
//! # Conventions, fixed here once
//! * World space is right-handed, y is up. Lengths are in scene units.
//! * Colours are linear RGB, Rec. 709 primaries. Radiance L is in W m^-2 sr^-1, radiant
//!   intensity I in W sr^-1.
//! * Images are row-major and row 0 is the *top* row; pixel (x, y) covers [x, x+1) x [y, y+1).
//! * `wo` points toward the viewer, `wi` toward the light. Both are unit vectors that *leave* the
//!   surface, and inside a BSDF both are in the local shading frame, whose z axis is the normal.
//! * [`Bsdf::eval`] *includes* the cosine foreshortening factor of `wi`.
//! * Angles carry their unit in their name (`fov_y_deg`).
//!
//! # Where to find what
//! | you want to | look at |
//! |---|---|
//! | write a material | [`Bsdf`], [`SurfaceInteraction`], [`Frame`], [`Texture`] |
//! | write an integrator | [`Integrator`], [`Scene::intersect`], [`Scene::occluded`], [`Ray`] |
//! | write the render loop | [`Renderer::render`], [`RenderJob`], [`Film`], [`Sampler`], [`Camera`] |
//! | write a realtime pass | [`gpu`], [`gpu::RenderPass`] and `docs/shader_contract.md` |
//! | draw a shadow map (bonus) | [`gpu::ShadowMap`], [`gpu::perspective`], [`gpu::look_at`] |

mod bvh;
mod camera;
mod error;
pub mod export;
pub mod exr_io;
mod film;
mod frame;
pub mod gpu;
pub mod image;
mod ray;
#[doc(hidden)]
pub mod realtime;
mod renderer;
mod sampler;
pub mod scene;

pub use bvh::Bvh;
pub use camera::{Camera, CameraConfig};
pub use error::{Error, Result};
pub use film::Film;
pub use frame::Frame;
pub use glam::{Mat3, Mat4, Vec2, Vec3, Vec4, vec2, vec3, vec4};
pub use image::Image;
pub use ray::{Ray, SurfaceInteraction};
pub use renderer::{Bsdf, Integrator, RenderJob, Renderer, ShadingKind};
pub use sampler::Sampler;
pub use scene::{Material, MaterialModel, Scene, Shape, Texture};
pub use {bytemuck, glam};

/// The graphics library. [`gpu::Device`] and [`gpu::Queue`] stand for its own types of these names, so
/// that functions which take a `&wgpu::Device` take [`gpu::Gpu::device`].
pub mod wgpu {
    pub use ::wgpu::*;

    pub use crate::gpu::{Device, Queue};
}

/// The constant 1 / pi.
pub const INV_PI: f32 = std::f32::consts::FRAC_1_PI;
/// The constant 1 / (2 pi).
pub const INV_TWO_PI: f32 = 0.5 * std::f32::consts::FRAC_1_PI;
