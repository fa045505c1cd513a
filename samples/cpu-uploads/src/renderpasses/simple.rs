//! "Realtime" pass: a rasteriser on the CPU, its pixels put on the screen by one triangle.

use basecode::gpu::{Gpu, RenderPass, Target, COLOR_FORMAT, DEPTH_FORMAT};
use basecode::{
    Camera, INV_PI, INV_TWO_PI, Material, MaterialModel, Result, Scene, Vec3, vec3, wgpu,
};

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
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
}

impl SimplePass {
    pub fn new(gpu: &Gpu, scene: &Scene, _shadow_map: bool) -> Result<Self> {
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
        Ok(Self { scene, pipeline, layout })
    }
}

/// What a triangle's corner is for a pixel: place on the film, 1 / w, world position, normal.
struct Corner {
    film: Vec3,
    inverse_w: f32,
    position: Vec3,
    normal: Vec3,
}

impl SimplePass {
    /// Light that the surface sends back toward the camera.
    fn shade(&self, material: &Material, eye: Vec3, p: Vec3, normal: Vec3) -> Vec3 {
        let n = normal.normalize();
        let (wo, to_light) = ((eye - p).normalize(), self.scene.first_light_position() - p);
        let wi = to_light.normalize();
        if n.dot(wo) <= 0.0 || n.dot(wi) <= 0.0 {
            return Vec3::ZERO;
        }
        let (d, s) = (material.diffuse.average(), material.specular.average());
        let phong = material.model == MaterialModel::Phong;
        let mirrored = 2.0 * n.dot(wi) * n - wi;
        let lobe = mirrored.dot(wo).max(0.0).powf(material.exponent);
        let specular = s * ((material.exponent + 2.0) * INV_TWO_PI * lobe);
        let f = if phong { material.energy_scale() * (d * INV_PI + specular) } else { d * INV_PI };
        self.scene.first_light_intensity() / to_light.length_squared() * f * n.dot(wi)
    }

    fn pixels(&self, camera: &Camera, width: usize, height: usize) -> Vec<[f32; 4]> {
        let mut pixels = vec![[0.0, 0.0, 0.0, 1.0]; width * height];
        let mut depths = vec![0.0f32; width * height];
        let clip = camera.projection() * camera.view();
        for (index, shape) in self.scene.shapes().iter().enumerate() {
            let material = self.scene.material_of(index);
            for triangle in &shape.triangles {
                let corners = triangle.map(|vertex| {
                    let (position, normal) =
                        (shape.positions[vertex as usize], shape.normals[vertex as usize]);
                    let c = clip * position.extend(1.0);
                    let x = (0.5 + 0.5 * c.x / c.w) * width as f32;
                    let y = (0.5 - 0.5 * c.y / c.w) * height as f32;
                    Corner { film: vec3(x, y, 0.0), inverse_w: 1.0 / c.w, position, normal }
                });
                if corners.iter().any(|corner| corner.inverse_w <= 0.0) {
                    continue;
                }
                let [a, b, c] = &corners;
                let low = a.film.min(b.film).min(c.film).max(Vec3::ZERO);
                let high = a.film.max(b.film).max(c.film);
                let area = (b.film - a.film).cross(c.film - a.film).z;
                for y in low.y as usize..(high.y.max(0.0).ceil() as usize).min(height) {
                    for x in low.x as usize..(high.x.max(0.0).ceil() as usize).min(width) {
                        let p = vec3(x as f32 + 0.5, y as f32 + 0.5, 0.0);
                        let part = |from: &Corner, to: &Corner| {
                            (to.film - from.film).cross(p - from.film).z / area
                        };
                        let weights = [part(b, c), part(c, a), part(a, b)];
                        if weights.iter().any(|weight| !(*weight >= 0.0)) {
                            continue;
                        }
                        let shares: Vec<f32> =
                            weights.iter().zip(&corners).map(|(w, c)| w * c.inverse_w).collect();
                        let depth: f32 = shares.iter().sum();
                        let pixel = y * width + x;
                        if depth <= depths[pixel] {
                            continue;
                        }
                        depths[pixel] = depth;
                        let mean = |of: &dyn Fn(&Corner) -> Vec3| {
                            let sum = shares.iter().zip(&corners).map(|(s, c)| *s * of(c));
                            sum.sum::<Vec3>() / depth
                        };
                        let (position, normal) = (mean(&|c| c.position), mean(&|c| c.normal));
                        let color = if material.is_emitter() {
                            Vec3::ONE
                        } else {
                            self.shade(material, camera.eye(), position, normal)
                        };
                        pixels[pixel] = [color.x, color.y, color.z, 1.0];
                    }
                }
            }
        }
        pixels
    }
}

impl RenderPass for SimplePass {
    fn draw(&mut self, gpu: &Gpu, camera: &Camera, target: &Target) -> Result<()> {
        let mut data: Vec<[f32; 4]> = vec![[target.width as f32, 0.0, 0.0, 0.0]];
        data.extend(self.pixels(camera, target.width, target.height));
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
