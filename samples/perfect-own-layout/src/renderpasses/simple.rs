//! Direct illumination from a point light, with wgpu alone: one pipeline, one bind group, one
//! list of materials in which every object is an instance.

use std::sync::OnceLock;

use basecode::gpu::{COLOR_FORMAT, DEPTH_FORMAT, Gpu, Mesh, RenderPass, Target, VERTEX_STRIDE};
use basecode::{Camera, Error, MaterialModel, Result, Scene, Vec4, wgpu};

/// Floats of `Scene` in all.wgsl.
const SCENE_FLOATS: usize = 40;

/// Shades every object by its material under the scene's point light.
pub struct SimplePass {
    pipeline: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
    globals: wgpu::Buffer,
    meshes: Vec<Mesh>,
}

/// Position and intensity of the light: a program draws one scene.
static LIGHT: OnceLock<[Vec4; 2]> = OnceLock::new();

fn bytes(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_ne_bytes).collect()
}

impl SimplePass {
    /// Copies the scene to the device and makes the pipeline.
    pub fn new(gpu: &Gpu, scene: &Scene, shadow_map: bool) -> Result<Self> {
        if shadow_map {
            return Err(Error::NotImplemented("2.5 shadow mapping".into()));
        }
        let (position, intensity) = (scene.first_light_position(), scene.first_light_intensity());
        LIGHT.get_or_init(|| [position.extend(1.0), intensity.extend(0.0)]);
        let mut things = Vec::new();
        for index in 0..scene.shapes().len() {
            let material = scene.material_of(index);
            let kind = match material.model {
                _ if material.is_emitter() => 2.0,
                MaterialModel::Phong => 1.0,
                MaterialModel::Diffuse | MaterialModel::Mirror => 0.0,
            };
            let scale = material.energy_scale();
            let kd = material.diffuse.average() * scale;
            let ks = material.specular.average() * scale;
            things.extend(kd.extend(material.exponent).to_array());
            things.extend(ks.extend(kind).to_array());
        }
        let storage = |size: usize| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: size as u64,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let globals = storage(4 * SCENE_FLOATS);
        let materials = storage(4 * things.len());
        gpu.queue.write_buffer(&materials, 0, &bytes(things));
        let entry = |binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: true },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &[entry(0), entry(1)],
        });
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &[bound(0, &globals), bound(1, &materials)],
        });
        Ok(Self {
            pipeline: pipeline(gpu, &layout),
            group,
            globals,
            meshes: scene.shapes().iter().map(|shape| Mesh::new(gpu, shape)).collect(),
        })
    }
}

fn bound(binding: u32, buffer: &wgpu::Buffer) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }
}

fn pipeline(gpu: &Gpu, layout: &wgpu::BindGroupLayout) -> wgpu::RenderPipeline {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("all.wgsl"),
        source: wgpu::ShaderSource::Wgsl(include_str!("../shaders/all.wgsl").into()),
    });
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("to_film"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: VERTEX_STRIDE,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3],
            })],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("shade"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(COLOR_FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

impl RenderPass for SimplePass {
    fn draw(&mut self, gpu: &Gpu, camera: &Camera, target: &Target) -> Result<()> {
        let view = camera.view();
        let [position, intensity] = LIGHT.get().copied().unwrap_or_default();
        let mut globals = Vec::with_capacity(SCENE_FLOATS);
        globals.extend(view.to_cols_array());
        globals.extend(camera.projection().to_cols_array());
        globals.extend((view * position).to_array());
        globals.extend(intensity.to_array());
        gpu.queue.write_buffer(&self.globals, 0, &bytes(globals));
        let mut encoder = gpu.encoder();
        let mut pass = target.begin(&mut encoder);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        for (thing, mesh) in (0..).zip(&self.meshes) {
            pass.set_vertex_buffer(0, mesh.vertices.slice(..));
            pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..mesh.index_count, 0, thing..thing + 1);
        }
        drop(pass);
        gpu.submit(encoder);
        Ok(())
    }
}
