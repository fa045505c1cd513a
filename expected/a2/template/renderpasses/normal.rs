//! The previous assignment: normals as colours.

use basecode::gpu::{
    FRAME_GROUP, FrameUniforms, Gpu, MATERIAL_GROUP, MaterialUniforms, Mesh, OBJECT_GROUP,
    ObjectUniforms, RenderPass, SHADOW_GROUP, ShadowMap, Stage, Target, Uniform,
};
use basecode::{Camera, Mat4, Result, Scene, Vec3, wgpu};

const NORMAL_VS: Stage =
    Stage { name: "normal.vs", text: include_str!("../shaders/normal.vs.wgsl") };
const NORMAL_FS: Stage =
    Stage { name: "normal.fs", text: include_str!("../shaders/normal.fs.wgsl") };

/// Shows the absolute value of the shading normal.
pub struct NormalPass {
    pipeline: wgpu::RenderPipeline,
    frame: Uniform,
    object: Uniform,
    /// Not looked at by the shaders, but every group must be bound.
    material: Uniform,
    shadow: ShadowMap,
    meshes: Vec<Mesh>,
}

impl NormalPass {
    /// Copies the scene to the device and makes the pipeline.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let camera = scene.camera(1, 1)?;
        Ok(Self {
            pipeline: gpu.pipeline(NORMAL_VS, NORMAL_FS),
            frame: Uniform::frame(gpu, &FrameUniforms::new(&camera)),
            object: Uniform::object(gpu, &ObjectUniforms::new(Mat4::IDENTITY)),
            material: Uniform::material(gpu, &MaterialUniforms::new(Vec3::ZERO, Vec3::ZERO, 0.0)),
            shadow: ShadowMap::off(gpu),
            meshes: scene.shapes().iter().map(|shape| Mesh::new(gpu, shape)).collect(),
        })
    }
}

impl RenderPass for NormalPass {
    fn draw(&mut self, gpu: &Gpu, camera: &Camera, target: &Target) -> Result<()> {
        self.frame.write_frame(gpu, &FrameUniforms::new(camera));
        let mut encoder = gpu.encoder();
        let mut pass = target.begin(&mut encoder);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(FRAME_GROUP, &self.frame.bind_group, &[]);
        pass.set_bind_group(OBJECT_GROUP, &self.object.bind_group, &[]);
        pass.set_bind_group(MATERIAL_GROUP, &self.material.bind_group, &[]);
        pass.set_bind_group(SHADOW_GROUP, &self.shadow.bind_group, &[]);
        for mesh in &self.meshes {
            pass.set_vertex_buffer(0, mesh.vertices.slice(..));
            pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..mesh.index_count, 0, 0..1);
        }
        // Ends the pass, so that the encoder can be submitted.
        drop(pass);
        gpu.submit(encoder);
        Ok(())
    }
}
