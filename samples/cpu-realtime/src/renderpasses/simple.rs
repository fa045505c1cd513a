//! "Realtime" pass: the CPU integrator's pixels, put on the screen by two triangles.

use basecode::gpu::{Gpu, RenderPass, Target, COLOR_FORMAT, DEPTH_FORMAT};
use basecode::{
    Bsdf, Camera, Integrator, Material, MaterialModel, Ray, Result, Sampler, Scene, SurfaceInteraction,
    Vec3, wgpu,
};

use crate::bsdfs::{DiffuseBsdf, PhongBsdf};
use crate::integrators::SimpleIntegrator;

const SHOW: &str = "
@group(0) @binding(0) var<storage, read> px: array<vec4f>;
@vertex fn vs_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.5, 1.0);
}
@fragment fn fs_main(@builtin(position) p: vec4f) -> @location(0) vec4f {
    let w = u32(px[0].x);
    return px[1u + u32(p.y) * w + u32(p.x)];
}";

pub struct SimplePass {
    scene: &'static Scene,
    shadows: bool,
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
}

impl SimplePass {
    pub fn new(gpu: &Gpu, scene: &Scene, shadow_map: bool) -> Result<Self> {
        // The scene outlives the pass: the host unloads it later.
        let scene: &'static Scene = unsafe { &*std::ptr::from_ref(scene) };
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only: true },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(SHOW.into()),
        });
        let pl = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: None,
            layout: Some(&pl),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vs_main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(false),
                depth_compare: Some(wgpu::CompareFunction::Always),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fs_main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(COLOR_FORMAT.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Ok(Self { scene, shadows: shadow_map, pipeline, layout })
    }
}

impl SimplePass {
    /// What the rasteriser would show: textures averaged.
    fn shade(&self, integrator: &SimpleIntegrator, ray: &Ray, mut i: SurfaceInteraction) -> Vec3 {
        if self.shadows && integrator.radiance(self.scene, ray, &Sampler::new(1)) == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let m = self.scene.material_of(i.shape);
        let (d, s) = (m.diffuse.average(), m.specular.average());
        let phong = m.model == MaterialModel::Phong;
        let flat = if phong { Material::phong(d, s, m.exponent) } else { Material::diffuse(d) };
        let scale = m.energy_scale() / flat.energy_scale();
        let to_light = self.scene.first_light_position() - i.p;
        i.wi = i.frame_ns.to_local(to_light.normalize());
        let light = self.scene.first_light_intensity() / to_light.length_squared();
        let value = if phong { PhongBsdf::new(&flat).eval(&i) } else { DiffuseBsdf::new(&flat).eval(&i) };
        light * value * scale
    }
}

impl RenderPass for SimplePass {
    fn draw(&mut self, gpu: &Gpu, camera: &Camera, target: &Target) -> Result<()> {
        let integrator = SimpleIntegrator { shadows: self.shadows };
        let mut data: Vec<[f32; 4]> = vec![[target.width as f32, 0.0, 0.0, 0.0]];
        for y in 0..target.height {
            for x in 0..target.width {
                let ray = camera.ray(x as f32 + 0.5, y as f32 + 0.5);
                let c: Vec3 = match self.scene.intersect(&ray) {
                    Some(i) if self.scene.material_of(i.shape).is_emitter() => Vec3::ONE,
                    Some(i) => self.shade(&integrator, &ray, i),
                    None => Vec3::ZERO,
                };
                data.push([c.x, c.y, c.z, 1.0]);
            }
        }
        let bytes: Vec<u8> = data.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes.len() as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        gpu.queue.write_buffer(&buffer, 0, &bytes);
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
        });
        let mut encoder = gpu.encoder();
        let mut pass = target.begin(&mut encoder);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        gpu.submit(encoder);
        Ok(())
    }
}
