//! Realtime: objects sorted by how they are shaded.

use basecode::gpu::{
    EMITTER_FS, FrameUniforms, Gpu, MaterialUniforms, Mesh, ObjectUniforms, RenderPass, ShadowMap,
    Stage, Target, Uniform,
};
use basecode::{Camera, Mat4, MaterialModel, Result, Scene, Vec3, wgpu};

use crate::cube_map;

macro_rules! stage {
    ($name:literal) => {
        Stage { name: $name, text: include_str!(concat!("shaders/", $name, ".wgsl")) }
    };
}

/// All that one pipeline draws.
struct Batch {
    pipeline: wgpu::RenderPipeline,
    things: Vec<(Mesh, Uniform)>,
}

pub struct Raster {
    batches: [Batch; 3],
    globals: Uniform,
    /// Nothing moves: one for all.
    identity: Uniform,
    shadow: ShadowMap,
    light: (Vec3, Vec3),
}

impl Raster {
    pub fn new(gpu: &Gpu, scene: &Scene, shadow_map: bool) -> Result<Self> {
        let batch = |fragment| Batch {
            pipeline: gpu.pipeline(stage!("simple.vs"), fragment),
            things: Vec::new(),
        };
        let mut batches =
            [batch(stage!("diffuse.fs")), batch(stage!("phong.fs")), batch(EMITTER_FS)];
        for (index, shape) in scene.shapes().iter().enumerate() {
            let material = scene.material_of(index);
            let which = match material.model {
                _ if material.is_emitter() => 2,
                MaterialModel::Phong => 1,
                MaterialModel::Diffuse | MaterialModel::Mirror => 0,
            };
            let [kd, ks] = [&material.diffuse, &material.specular]
                .map(|texture| texture.average() * material.energy_scale());
            let values = MaterialUniforms::new(kd, ks, material.exponent);
            batches[which].things.push((Mesh::new(gpu, shape), Uniform::material(gpu, &values)));
        }
        Ok(Raster {
            batches,
            globals: Uniform::frame(gpu, &FrameUniforms::new(&scene.camera(4, 3)?)),
            identity: Uniform::object(gpu, &ObjectUniforms::new(Mat4::IDENTITY)),
            shadow: match shadow_map {
                true => cube_map::draw(gpu, scene)?,
                false => ShadowMap::off(gpu),
            },
            light: (scene.first_light_position(), scene.first_light_intensity()),
        })
    }
}

impl RenderPass for Raster {
    fn draw(&mut self, gpu: &Gpu, camera: &Camera, target: &Target) -> Result<()> {
        let globals = FrameUniforms {
            light_position: self.light.0.extend(1.0),
            light_intensity: self.light.1.extend(0.0),
            ..FrameUniforms::new(camera)
        };
        self.globals.write_frame(gpu, &globals);
        let mut commands = gpu.encoder();
        {
            let mut pass = target.begin(&mut commands);
            pass.set_bind_group(0, &self.globals.bind_group, &[]);
            pass.set_bind_group(1, &self.identity.bind_group, &[]);
            pass.set_bind_group(3, &self.shadow.bind_group, &[]);
            for batch in &self.batches {
                pass.set_pipeline(&batch.pipeline);
                for (mesh, material) in &batch.things {
                    pass.set_bind_group(2, &material.bind_group, &[]);
                    pass.set_vertex_buffer(0, mesh.vertices.slice(..));
                    pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
                    pass.draw_indexed(0..mesh.index_count, 0, 0..1);
                }
            }
        }
        gpu.submit(commands);
        Ok(())
    }
}
