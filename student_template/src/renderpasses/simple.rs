//! Direct illumination from a point light.

// Quiet until the tasks of this file are done: then remove this line, and the compiler helps you.
#![allow(unused)]

use basecode::gpu::{
    EMITTER_FS, FRAME_GROUP, FrameUniforms, Gpu, MATERIAL_GROUP, MaterialUniforms, Mesh,
    OBJECT_GROUP, ObjectUniforms, RenderPass, SHADOW_GROUP, ShadowMap, Stage, Target, Uniform,
};
use basecode::{Camera, Mat4, Material, MaterialModel, Result, Scene, Vec3, wgpu};

use super::shadow;

const SIMPLE_VS: Stage =
    Stage { name: "simple.vs", text: include_str!("../shaders/simple.vs.wgsl") };
const DIFFUSE_FS: Stage =
    Stage { name: "diffuse.fs", text: include_str!("../shaders/diffuse.fs.wgsl") };
const PHONG_FS: Stage = Stage { name: "phong.fs", text: include_str!("../shaders/phong.fs.wgsl") };

/// A pipeline for each way to shade.
struct Pipelines {
    diffuse: wgpu::RenderPipeline,
    phong: wgpu::RenderPipeline,
    /// Plain white.
    emitter: wgpu::RenderPipeline,
}

/// A shape on the device.
struct Object {
    mesh: Mesh,
    /// Model and normal matrix: bind group 1.
    placement: Uniform,
    material: Material,
    /// Albedos and exponent: bind group 2.
    surface: Uniform,
}

/// Shades every object by its material under the scene's point light.
pub struct SimplePass {
    pipelines: Pipelines,
    /// View, projection, camera and light: bind group 0.
    frame: Uniform,
    objects: Vec<Object>,
    /// Bind group 3.
    shadow: ShadowMap,
    light_position: Vec3,
    light_intensity: Vec3,
}

impl SimplePass {
    /// Copies the scene to the device, makes the pipelines and, for shadows, draws the shadow map.
    pub fn new(gpu: &Gpu, scene: &Scene, shadow_map: bool) -> Result<Self> {
        let shadow =
            if shadow_map { shadow::draw_shadow_map(gpu, scene)? } else { ShadowMap::off(gpu) };
        let pipelines = Pipelines {
            diffuse: gpu.pipeline(SIMPLE_VS, DIFFUSE_FS),
            phong: gpu.pipeline(SIMPLE_VS, PHONG_FS),
            emitter: gpu.pipeline(SIMPLE_VS, EMITTER_FS),
        };
        let camera = scene.camera(1, 1)?;
        let mut objects = Vec::new();
        for (index, shape) in scene.shapes().iter().enumerate() {
            let material = scene.material_of(index);
            objects.push(Object {
                mesh: Mesh::new(gpu, shape),
                // Vertices are already in world space.
                placement: Uniform::object(gpu, &ObjectUniforms::new(Mat4::IDENTITY)),
                material: material.clone(),
                surface: Uniform::material(gpu, &material_uniforms(material)),
            });
        }
        Ok(Self {
            pipelines,
            frame: Uniform::frame(gpu, &FrameUniforms::new(&camera)),
            objects,
            shadow,
            light_position: scene.first_light_position(),
            light_intensity: scene.first_light_intensity(),
        })
    }

    /// Sets the light's share of the frame uniforms.
    fn set_light(&self, frame: &mut FrameUniforms) {
        // TODO(A2) 2.1: pass the light position and intensity using uniforms.
        todo!("2.1 render pass: the light")
    }

    /// Binds and draws every object.
    fn draw_objects(&self, pass: &mut wgpu::RenderPass) {
        // TODO(A2) 2.1: bind the appropriate shaders (depending on the material: emitters are plain
        // white, mirrors are diffuse) and draw the object. `normal.rs` is a model for one pipeline.
        todo!("2.1 render pass: the objects")
    }
}

/// What the fragment stages need to know of a material.
fn material_uniforms(material: &Material) -> MaterialUniforms {
    // TODO(A2) 2.1: pass material-specific parameters using uniforms. The shaders get the average
    // color of a texture, and each albedo multiplied by the material's energy scale.
    todo!("2.1 render pass: the material")
}

impl RenderPass for SimplePass {
    fn draw(&mut self, gpu: &Gpu, camera: &Camera, target: &Target) -> Result<()> {
        // View, projection and camera position are forwarded for you.
        let mut frame = FrameUniforms::new(camera);
        self.set_light(&mut frame);
        self.frame.write_frame(gpu, &frame);
        let mut encoder = gpu.encoder();
        let mut pass = target.begin(&mut encoder);
        self.draw_objects(&mut pass);
        // Ends the pass, so that the encoder can be submitted.
        drop(pass);
        gpu.submit(encoder);
        Ok(())
    }
}
