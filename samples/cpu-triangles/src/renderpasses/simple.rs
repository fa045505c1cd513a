//! "Realtime" pass: a rasteriser on the CPU, each pixel a triangle with its color at the corners.

use basecode::gpu::{COLOR_FORMAT, DEPTH_FORMAT, Gpu, RenderPass, Target};
use basecode::{
    Camera, INV_PI, INV_TWO_PI, Material, MaterialModel, Result, Scene, Vec3, vec3, wgpu,
};

const SHOW: &str = "
struct V { @builtin(position) p: vec4f, @location(0) @interpolate(flat) c: vec3f }
@vertex fn vs_main(@location(0) p: vec3f, @location(1) c: vec3f) -> V { return V(vec4f(p, 1.0), c); }
@fragment fn fs_main(v: V) -> @location(0) vec4f { return vec4f(v.c, 1.0); }
";

fn pipeline(device: &wgpu::Device) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(SHOW.into()),
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vs_main"),
            compilation_options: Default::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: 24,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3],
            })],
        },
        primitive: wgpu::PrimitiveState {
            topology: wgpu::PrimitiveTopology::TriangleList,
            ..Default::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(false),
            depth_compare: Some(wgpu::CompareFunction::Always),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fs_main"),
            compilation_options: Default::default(),
            targets: &[Some(COLOR_FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

pub struct SimplePass {
    scene: &'static Scene,
}

impl SimplePass {
    pub fn new(_gpu: &Gpu, scene: &Scene, _shadow_map: bool) -> Result<Self> {
        // The scene outlives the pass: the host unloads it later.
        Ok(Self { scene: unsafe { &*std::ptr::from_ref(scene) } })
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
        let (w, h) = (target.width, target.height);

        let pixels = self.pixels(camera, w, h);
        let mut data: Vec<f32> = Vec::new();
        for (i, c) in pixels.iter().enumerate() {
            if c[0] + c[1] + c[2] == 0.0 {
                continue;
            }
            let (x, y) = ((i % w) as f32, (i / w) as f32);
            for (dx, dy) in [(0.0f32, 0.0f32), (1.0, 0.0), (0.5, 1.2)] {
                data.extend([
                    2.0 * (x + dx) / w as f32 - 1.0,
                    1.0 - 2.0 * (y + dy) / h as f32,
                    0.5,
                    c[0],
                    c[1],
                    c[2],
                ]);
            }
        }
        let bytes: Vec<u8> = data.iter().flat_map(|v| v.to_le_bytes()).collect();
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes.len() as u64,
            usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        gpu.queue.write_buffer(&buffer, 0, &bytes);
        let pipeline = pipeline(&gpu.device);

        let mut encoder = gpu.encoder();
        let mut pass = target.begin(&mut encoder);
        pass.set_pipeline(&pipeline);
        pass.set_vertex_buffer(0, buffer.slice(..));
        pass.draw(0..(data.len() / 6) as u32, 0..1);
        drop(pass);
        gpu.submit(encoder);

        Ok(())
    }
}
