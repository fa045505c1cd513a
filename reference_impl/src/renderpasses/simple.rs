//! Direct illumination from a point light.

use basecode::gpu::{
    EMITTER_FS, FRAME_GROUP, FrameUniforms, Gpu, MATERIAL_GROUP, MaterialUniforms, Mesh,
    OBJECT_GROUP, ObjectUniforms, RenderPass, SHADOW_GROUP, ShadowMap, Stage, Target, Uniform,
};
use basecode::{Camera, Mat4, Material, MaterialModel, Result, Scene, Vec3, wgpu};

use super::shadow;
use crate::mistakes::{self, Mistake, Mistakes};

pub(crate) const SIMPLE_VS: Stage =
    Stage { name: "simple.vs", text: include_str!("../shaders/simple.vs.wgsl") };
pub(crate) const DIFFUSE_FS: Stage =
    Stage { name: "diffuse.fs", text: include_str!("../shaders/diffuse.fs.wgsl") };
pub(crate) const PHONG_FS: Stage =
    Stage { name: "phong.fs", text: include_str!("../shaders/phong.fs.wgsl") };

/// A pipeline for each way to shade.
pub(crate) struct Pipelines {
    pub(crate) diffuse: wgpu::RenderPipeline,
    pub(crate) phong: wgpu::RenderPipeline,
    emitter: wgpu::RenderPipeline,
}

/// A shape on the device.
pub(crate) struct Object {
    pub(crate) mesh: Mesh,
    placement: Uniform,
    pub(crate) material: Material,
    pub(crate) surface: Uniform,
}

/// Shades every object by its material under the scene's point light.
pub struct SimplePass {
    pub(crate) pipelines: Pipelines,
    frame: Uniform,
    pub(crate) objects: Vec<Object>,
    shadow: ShadowMap,
    pub(crate) light_position: Vec3,
    pub(crate) light_intensity: Vec3,
    mistakes: Mistakes,
    /// Pixels; 0 but for a mistake.
    pub(crate) viewport_shift: f32,
    /// What a mistake draws with a frame too late.
    pub(crate) last_frame: Option<FrameUniforms>,
}

impl SimplePass {
    /// Copies the scene to the device, makes the pipelines and, for shadows, draws the shadow map.
    pub fn new(gpu: &Gpu, scene: &Scene, shadow_map: bool, mistakes: &Mistakes) -> Result<Self> {
        let shadow_map = (shadow_map || mistakes.has(Mistake::ShadowMapAlways))
            && !mistakes.has(Mistake::ShadowMapNone);
        let shadow = if shadow_map {
            shadow::draw_shadow_map(gpu, scene, mistakes)?
        } else {
            ShadowMap::off(gpu)
        };
        let (vs, diffuse, phong) =
            (mistakes.text(SIMPLE_VS)?, mistakes.text(DIFFUSE_FS)?, mistakes.text(PHONG_FS)?);
        let vs = Stage { text: &vs, ..SIMPLE_VS };
        let pipelines = Pipelines {
            diffuse: gpu.pipeline(vs, Stage { text: &diffuse, ..DIFFUSE_FS }),
            phong: gpu.pipeline(vs, Stage { text: &phong, ..PHONG_FS }),
            emitter: gpu.pipeline(vs, EMITTER_FS),
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
        let mut pass = Self {
            pipelines,
            frame: Uniform::frame(gpu, &FrameUniforms::new(&camera)),
            objects,
            shadow,
            light_position: scene.first_light_position(),
            light_intensity: scene.first_light_intensity(),
            mistakes: mistakes.clone(),
            viewport_shift: 0.0,
            last_frame: None,
        };
        mistakes::spoil_pass(mistakes, gpu, scene, &mut pass)?;
        Ok(pass)
    }

    /// Sets the light's share of the frame uniforms.
    fn set_light(&self, frame: &mut FrameUniforms) {
        frame.light_position = self.light_position.extend(1.0);
        frame.light_intensity = self.light_intensity.extend(0.0);
    }

    /// The pipeline that shades a material. Mirrors are drawn as diffuse.
    fn pipeline(&self, material: &Material) -> &wgpu::RenderPipeline {
        if material.is_emitter() {
            return &self.pipelines.emitter;
        }
        match material.model {
            MaterialModel::Diffuse | MaterialModel::Mirror => &self.pipelines.diffuse,
            MaterialModel::Phong => &self.pipelines.phong,
        }
    }

    /// Binds and draws every object.
    fn draw_objects(&self, pass: &mut wgpu::RenderPass) {
        pass.set_bind_group(FRAME_GROUP, &self.frame.bind_group, &[]);
        pass.set_bind_group(SHADOW_GROUP, &self.shadow.bind_group, &[]);
        for object in &self.objects {
            pass.set_pipeline(self.pipeline(&object.material));
            pass.set_bind_group(OBJECT_GROUP, &object.placement.bind_group, &[]);
            pass.set_bind_group(MATERIAL_GROUP, &object.surface.bind_group, &[]);
            pass.set_vertex_buffer(0, object.mesh.vertices.slice(..));
            pass.set_index_buffer(object.mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..object.mesh.index_count, 0, 0..1);
        }
    }
}

/// What the fragment stages need to know of a material.
fn material_uniforms(material: &Material) -> MaterialUniforms {
    let scale = material.energy_scale();
    let (rho_d, rho_s) = (material.diffuse.average(), material.specular.average());
    MaterialUniforms::new(scale * rho_d, scale * rho_s, material.exponent)
}

impl RenderPass for SimplePass {
    fn draw(&mut self, gpu: &Gpu, camera: &Camera, target: &Target) -> Result<()> {
        let mut frame = FrameUniforms::new(camera);
        if let Some(last) = &mut self.last_frame {
            std::mem::swap(last, &mut frame);
        }
        self.set_light(&mut frame);
        mistakes::spoil_frame(&self.mistakes, &mut frame);
        self.frame.write_frame(gpu, &frame);
        let mut encoder = gpu.encoder();
        let mut pass = target.begin(&mut encoder);
        if self.viewport_shift != 0.0 {
            let (width, height) = (target.width as f32, target.height as f32);
            let shift = self.viewport_shift;
            pass.set_viewport(shift, shift, width - shift, height - shift, 0.0, 1.0);
        }
        self.draw_objects(&mut pass);
        // Ends the pass, so that the encoder can be submitted.
        drop(pass);
        gpu.submit(encoder);
        Ok(())
    }
}
