//! Direct illumination from a point light, shadows by rays in the fragment shader.

use basecode::gpu::{COLOR_FORMAT, DEPTH_FORMAT, Gpu, RenderPass, Target};
use basecode::{Camera, Mat4, MaterialModel, Result, Scene, Vec4, bytemuck, vec4, wgpu};
use wgpu::util::DeviceExt;

const DECLARATIONS: &str = "
struct Globals { to_clip: mat4x4f, eye: vec4f, light: vec4f, intensity: vec4f }
// Kd and the exponent; Ks and the kind: 0 diffuse, 1 Phong, 2 emitter.
struct Surface { kd: vec3f, exponent: f32, ks: vec3f, kind: f32 }
struct Point {
    @builtin(position) clip: vec4f,
    @location(0) p: vec3f,
    @location(1) n: vec3f,
    @location(2) @interpolate(flat) which: u32,
}
@group(0) @binding(0) var<storage, read> globals: Globals;
@group(0) @binding(1) var<storage, read> surfaces: array<Surface>;
// Corners of all triangles that block light; one of nothing when there are no shadows.
@group(0) @binding(2) var<storage, read> blockers: array<vec4f>;
";

const STAGES: &str = "
@vertex
fn place(@location(0) p: vec3f, @location(1) n: vec3f, @builtin(instance_index) i: u32) -> Point {
    return Point(globals.to_clip * vec4f(p, 1.0), p, n, i);
}

fn seen(p: vec3f, n: vec3f) -> f32 {
    let way = globals.light.xyz - p;
    let start = p + 1e-4 * length(way) * n;
    for (var i = 0u; i + 2u < arrayLength(&blockers); i += 3u) {
        let a = blockers[i].xyz;
        let ab = blockers[i + 1u].xyz - a;
        let ac = blockers[i + 2u].xyz - a;
        let h = cross(way, ac);
        let det = dot(ab, h);
        let s = start - a;
        let q = cross(s, ab);
        let uvt = vec3f(dot(s, h), dot(way, q), dot(ac, q)) / det;
        if det != 0.0 && all(uvt >= vec3f(0.0)) && uvt.x + uvt.y <= 1.0 && uvt.z <= 0.9999 {
            return 0.0;
        }
    }
    return 1.0;
}

@fragment
fn shade(point: Point) -> @location(0) vec4f {
    let surface = surfaces[point.which];
    let n = normalize(point.n);
    let way = globals.light.xyz - point.p;
    let wi = normalize(way);
    let wo = normalize(globals.eye.xyz - point.p);
    let cosine = max(dot(n, wi), 0.0) * select(0.0, 1.0, dot(n, wo) > 0.0);
    let mirrored = max(dot(2.0 * dot(n, wi) * n - wi, wo), 0.0);
    let lobe = 0.5 * (surface.exponent + 2.0) * pow(mirrored, surface.exponent);
    let specular = select(vec3f(0.0), surface.ks * lobe, surface.kind == 1.0);
    let f = 0.3183098861838 * (surface.kd + specular);
    let reflected = seen(point.p, n) * globals.intensity.rgb / dot(way, way) * f * cosine;
    return vec4f(select(reflected, vec3f(1.0), surface.kind == 2.0), 1.0);
}
";

/// Distance of the near plane.
const NEAR: f32 = 0.01;

/// Shades every shape by its material under the scene's point light.
pub struct SimplePass {
    globals: wgpu::Buffer,
    light: [Vec4; 2],
    /// Everything there is to draw.
    bundle: wgpu::RenderBundle,
}

/// All shapes behind one another.
#[derive(Default)]
struct Merged {
    vertices: Vec<[f32; 6]>,
    indices: Vec<u32>,
    surfaces: Vec<[f32; 8]>,
    /// Where in the indices each shape ends.
    ends: Vec<u32>,
}

impl Merged {
    fn of(scene: &Scene) -> Self {
        let mut all = Self::default();
        for (index, shape) in scene.shapes().iter().enumerate() {
            let base = all.vertices.len() as u32;
            for (p, n) in shape.positions.iter().zip(&shape.normals) {
                all.vertices.push([p.x, p.y, p.z, n.x, n.y, n.z]);
            }
            all.indices.extend(shape.triangles.as_flattened().iter().map(|vertex| base + vertex));
            all.ends.push(all.indices.len() as u32);
            let material = scene.material_of(index);
            let kind = match material.model {
                _ if material.is_emitter() => 2.0,
                MaterialModel::Phong => 1.0,
                MaterialModel::Diffuse | MaterialModel::Mirror => 0.0,
            };
            let kd = material.diffuse.average() * material.energy_scale();
            let ks = material.specular.average() * material.energy_scale();
            all.surfaces.push([kd.x, kd.y, kd.z, material.exponent, ks.x, ks.y, ks.z, kind]);
        }
        all
    }
}

impl SimplePass {
    /// Copies the scene to the device and records what is drawn.
    pub fn new(gpu: &Gpu, scene: &Scene, shadow_map: bool) -> Result<Self> {
        let all = Merged::of(scene);
        let buffer = |contents: &[u8], usage| {
            gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: None,
                contents,
                usage,
            })
        };
        let vertices = buffer(bytemuck::cast_slice(&all.vertices), wgpu::BufferUsages::VERTEX);
        let indices = buffer(bytemuck::cast_slice(&all.indices), wgpu::BufferUsages::INDEX);
        let blockers = blockers(scene, shadow_map);
        let blockers = buffer(bytemuck::cast_slice(&blockers), wgpu::BufferUsages::STORAGE);
        let surfaces = buffer(bytemuck::cast_slice(&all.surfaces), wgpu::BufferUsages::STORAGE);
        let globals = buffer(&[0; 112], wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST);
        // As wide as a shadow map, but nothing is ever drawn into it.
        drop(gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: 64, height: 64, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Depth32Float,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        }));
        let layout = layout(&gpu.device);
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: globals.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: surfaces.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 2, resource: blockers.as_entire_binding() },
            ],
        });
        let pipeline = pipeline(&gpu.device, &[Some(&layout)]);
        let mut bundle =
            gpu.device.create_render_bundle_encoder(&wgpu::RenderBundleEncoderDescriptor {
                label: None,
                color_formats: &[Some(COLOR_FORMAT)],
                depth_stencil: Some(wgpu::RenderBundleDepthStencil {
                    format: DEPTH_FORMAT,
                    depth_read_only: false,
                    stencil_read_only: true,
                }),
                sample_count: 1,
                multiview: None,
            });
        bundle.set_pipeline(&pipeline);
        bundle.set_bind_group(0, &group, &[]);
        bundle.set_vertex_buffer(0, vertices.slice(..));
        bundle.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
        let mut begin = 0;
        for (which, end) in (0..).zip(all.ends) {
            bundle.draw_indexed(begin..end, 0, which..which + 1);
            begin = end;
        }
        let bundle = bundle.finish(&wgpu::RenderBundleDescriptor { label: None });
        let light =
            [scene.first_light_position().extend(1.0), scene.first_light_intensity().extend(0.0)];
        Ok(Self { globals, light, bundle })
    }
}

/// So many triangles can be asked for every pixel.
const MOST: usize = 5000;

fn blockers(scene: &Scene, shadow_map: bool) -> Vec<[f32; 4]> {
    let mut corners = Vec::new();
    for (index, shape) in scene.shapes().iter().enumerate() {
        if shadow_map && !scene.material_of(index).is_emitter() {
            let triangles = shape.triangles.as_flattened().iter();
            corners.extend(triangles.map(|v| shape.positions[*v as usize].extend(1.0).to_array()));
        }
    }
    if corners.is_empty() || corners.len() > 3 * MOST { vec![[0.0; 4]] } else { corners }
}

fn layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
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
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[entry(0), entry(1), entry(2)],
    })
}

fn pipeline(
    device: &wgpu::Device,
    groups: &[Option<&wgpu::BindGroupLayout>],
) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("all"),
        source: wgpu::ShaderSource::Wgsl(format!("{DECLARATIONS}{STAGES}").into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: groups,
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("place"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: 24,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3],
            })],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::LessEqual),
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
        // Nothing is too far away to be seen.
        let height = 1.0 / (0.5 * camera.config().fov_y_deg.to_radians()).tan();
        let projection = Mat4::from_cols(
            Vec4::X * height / camera.aspect(),
            Vec4::Y * height,
            vec4(0.0, 0.0, -1.0, -1.0),
            vec4(0.0, 0.0, -NEAR, 0.0),
        );
        let [light, intensity] = self.light;
        let mut globals = (projection * camera.view()).to_cols_array().to_vec();
        for value in [camera.eye().extend(1.0), light, intensity] {
            globals.extend(value.to_array());
        }
        gpu.queue.write_buffer(&self.globals, 0, bytemuck::cast_slice(&globals));
        let mut encoder = gpu.encoder();
        target.begin(&mut encoder).execute_bundles([&self.bundle]);
        gpu.submit(encoder);
        Ok(())
    }
}
