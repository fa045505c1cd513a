//! The shadow map (bonus).

// Quiet until the task of this file is done: then remove this line, and the compiler helps you.
#![allow(unused)]

use basecode::gpu::{
    FRAME_GROUP, FrameUniforms, Gpu, Mesh, OBJECT_GROUP, ObjectUniforms, ShadowMap, Stage, Uniform,
};
use basecode::{Error, Mat4, Result, Scene, Vec3, wgpu};

const SHADOW_VS: Stage =
    Stage { name: "shadow.vs", text: include_str!("../shaders/shadow.vs.wgsl") };

/// Draws what blocks the scene's light.
pub fn draw_shadow_map(gpu: &Gpu, scene: &Scene) -> Result<ShadowMap> {
    // TODO(A2) 2.5 (bonus): draw the scene's depth from the light into a `ShadowMap`. Use one layer
    // for each view of the light: one that covers the scene, or six in all directions.
    // `ShadowMap::begin` and `Gpu::depth_pipeline` draw a layer. Leave emitters out. Then look the
    // map up in the fragment shaders.
    Err(Error::NotImplemented("2.5 shadow mapping (bonus)".into()))
}
