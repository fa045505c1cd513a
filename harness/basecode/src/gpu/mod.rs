//! Offscreen drawing with wgpu: the device, the target, and what `docs/shader_contract.md` fixes.
//!
//! The base code owns what every realtime renderer would write alike: the device ([`Gpu`]), the
//! picture ([`Target`]), vertex buffers ([`Mesh`]), uniform buffers ([`Uniform`]) and pipelines
//! ([`Gpu::pipeline`]). A [`RenderPass`] fills the uniforms, chooses pipelines, binds and draws,
//! with the plain calls of [`wgpu::RenderPass`].
//!
//! For what tutorials bring along: [`perspective`], [`orthographic`] and [`look_at`] make the matrices of
//! a second camera; [`crate::glam`], [`crate::bytemuck`] and [`crate::wgpu`] are the libraries that the
//! base code itself uses. A struct of your own for a buffer is
//! ```
//! use basecode::bytemuck::{Pod, Zeroable};
//!
//! #[derive(Clone, Copy, Pod, Zeroable)]
//! #[repr(C)]
//! #[bytemuck(crate = "basecode::bytemuck")]
//! struct Light {
//!     view_projection: [[f32; 4]; 4],
//! }
//! ```

mod context;
mod contract;
mod device;
mod layouts;
mod made_pipelines;
mod matrices;
mod mesh;
mod message;
mod pipeline;
mod shadow;
mod target;
mod uniform;

pub use context::{AdapterKind, Gpu};
pub use contract::{
    COLOR_FORMAT, DEPTH_FORMAT, FRAME_GROUP, FrameUniforms, MATERIAL_GROUP, MaterialUniforms,
    OBJECT_GROUP, ObjectUniforms, SHADOW_GROUP, SHADOW_LAYERS, ShadowUniforms, VERTEX_STRIDE,
};
pub use device::{
    Device, EDITED_LINE, EMPTY_MAPS, EVERY_FRAGMENT, Footprint, MATRICES, NEGATED_NORMALS,
    NOTHING_UNSET, OUTLINES, Queue, USUAL_PIPELINES,
};
pub use layouts::Layouts;
pub use matrices::{look_at, orthographic, perspective};
pub use mesh::Mesh;
pub use pipeline::{EMITTER_FS, Stage};
pub use shadow::ShadowMap;
pub use target::Target;
pub use uniform::Uniform;

use crate::{Camera, Result};

/// A realtime renderer of one scene, made by [`crate::Renderer::render_pass`].
pub trait RenderPass {
    /// Draws one frame of the scene as `camera` sees it, over whatever `target` held: linear
    /// radiance [W m^-2 sr^-1]. `camera` is that of the frame, whatever the scene's own is; its
    /// position and matrices belong in the uniforms.
    ///
    /// # Errors
    /// When the graphics library refuses a command.
    fn draw(&mut self, gpu: &Gpu, camera: &Camera, target: &Target) -> Result<()>;
}

#[cfg(test)]
mod tests;
