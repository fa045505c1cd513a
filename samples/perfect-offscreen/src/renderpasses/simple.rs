//! Direct illumination from a point light, drawn into textures of its own with reversed depth, then
//! copied to the film.

use basecode::gpu::{COLOR_FORMAT, DEPTH_FORMAT, Gpu, RenderPass, Target};
use basecode::{Camera, Mat4, MaterialModel, Result, Scene, Vec3, Vec4, bytemuck, vec4, wgpu};

use super::device;
use super::shadow::Distances;

/// A near plane at which depth is 1; infinitely far away it is 0.
const NEAR: f32 = 0.01;

macro_rules! lit {
    ($name:literal) => {
        concat!(
            include_str!("../shaders/common.wgsl"),
            include_str!("../shaders/simple.vs.wgsl"),
            include_str!("../shaders/light.wgsl"),
            include_str!($name)
        )
    };
}

/// A shape on the device.
pub struct Object {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    count: u32,
    surface: wgpu::BindGroup,
    /// Which of the pipelines draws it.
    kind: usize,
    /// Whether it is the light.
    pub emits: bool,
}

impl Object {
    /// Draws it with what is set.
    pub fn draw(&self, pass: &mut wgpu::RenderPass) {
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..self.count, 0, 0..1);
    }
}

/// Shades every object by its material under the scene's point light.
pub struct SimplePass {
    /// Diffuse, Phong, emitter.
    pipelines: [wgpu::RenderPipeline; 3],
    copy: wgpu::RenderPipeline,
    picture_layout: wgpu::BindGroupLayout,
    globals: wgpu::Buffer,
    globals_group: wgpu::BindGroup,
    distances_group: wgpu::BindGroup,
    objects: Vec<Object>,
    light: (Vec3, Vec4),
}

/// What `Globals` in common.wgsl holds.
pub fn to_clip_floats(to_clip: Mat4, eye: Vec3, light: Vec3, intensity: Vec4) -> Vec<f32> {
    let mut floats = to_clip.to_cols_array().to_vec();
    for value in [eye.extend(1.0), light.extend(1.0), intensity] {
        floats.extend(value.to_array());
    }
    floats
}

impl SimplePass {
    /// Copies the scene to the device, makes the pipelines and, for shadows, the cube of distances.
    pub fn new(gpu: &Gpu, scene: &Scene, shadow_map: bool) -> Result<Self> {
        let device: &wgpu::Device = &gpu.device;
        let buffer = || device::layout(device, device::BUFFER);
        let (globals_layout, surface_layout) = (buffer(), buffer());
        let cube = device::picture(wgpu::TextureViewDimension::D2Array);
        let distances_layout = device::layout(device, cube);
        let picture = device::picture(wgpu::TextureViewDimension::D2);
        let picture_layout = device::layout(device, picture);

        let object = |index: usize| object(device, &surface_layout, scene, index);
        let objects: Vec<Object> = (0..scene.shapes().len()).map(object).collect();
        let light = scene.first_light_position();
        let distances = if shadow_map {
            let nearest = |shape: &basecode::Shape| {
                shape.positions.iter().map(|p| (*p - light).length()).fold(f32::INFINITY, f32::min)
            };
            let nearest = scene.shapes().iter().map(nearest).filter(|r| *r > 0.0);
            let near = 0.01 * nearest.fold(f32::INFINITY, f32::min).clamp(1e-3, 1.0);
            Distances::draw(device, &gpu.queue, &globals_layout, (light, near), &objects)
        } else {
            Distances::none(device)
        };

        let groups = [&globals_layout, &surface_layout, &distances_layout];
        let pipeline = |wgsl, fragment| {
            let depth = wgpu::CompareFunction::Greater;
            let (vertex, color) = ("to_film", COLOR_FORMAT);
            let groups = &groups;
            let recipe =
                device::Recipe { groups, wgsl, vertex, fragment, vertices: true, color, depth };
            device::pipeline(device, &recipe)
        };
        let copy = device::Recipe {
            groups: &[&picture_layout],
            wgsl: include_str!("../shaders/film.wgsl"),
            vertex: "over_the_film",
            fragment: "copy",
            vertices: false,
            color: COLOR_FORMAT,
            depth: wgpu::CompareFunction::Always,
        };
        let globals = device::floats(device, &[0.0; 28]);
        let cube = wgpu::BindingResource::TextureView(&distances.view);
        Ok(Self {
            pipelines: [
                pipeline(lit!("../shaders/diffuse.fs.wgsl"), "reflect_diffuse"),
                pipeline(lit!("../shaders/phong.fs.wgsl"), "reflect_phong"),
                pipeline(lit!("../shaders/diffuse.fs.wgsl"), "emit"),
            ],
            copy: device::pipeline(device, &copy),
            globals_group: device::group(device, &globals_layout, globals.as_entire_binding()),
            distances_group: device::group(device, &distances_layout, cube),
            picture_layout,
            globals,
            objects,
            light: (light, scene.first_light_intensity().extend(distances.side)),
        })
    }
}

fn object(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    scene: &Scene,
    index: usize,
) -> Object {
    let (shape, material) = (&scene.shapes()[index], scene.material_of(index));
    let vertices: Vec<[Vec3; 2]> =
        shape.positions.iter().zip(&shape.normals).map(|(p, n)| [*p, *n]).collect();
    let scale = material.energy_scale();
    let kd = (scale * material.diffuse.average()).extend(material.exponent);
    let ks = (scale * material.specular.average()).extend(0.0);
    let surface = device::floats(device, &[kd.to_array(), ks.to_array()].concat());
    let filled = |bytes, usage| device::filled(device, bytes, usage);
    Object {
        vertices: filled(bytemuck::cast_slice(&vertices), wgpu::BufferUsages::VERTEX),
        indices: filled(bytemuck::cast_slice(&shape.triangles), wgpu::BufferUsages::INDEX),
        count: 3 * shape.triangles.len() as u32,
        surface: device::group(device, layout, surface.as_entire_binding()),
        kind: match material.model {
            _ if material.is_emitter() => 2,
            MaterialModel::Phong => 1,
            MaterialModel::Diffuse | MaterialModel::Mirror => 0,
        },
        emits: material.is_emitter(),
    }
}

impl RenderPass for SimplePass {
    fn draw(&mut self, gpu: &Gpu, camera: &Camera, target: &Target) -> Result<()> {
        let height = 1.0 / (0.5 * camera.config().fov_y_deg.to_radians()).tan();
        let reversed = Mat4::from_cols(
            Vec4::X * height / camera.aspect(),
            Vec4::Y * height,
            vec4(0.0, 0.0, 0.0, -1.0),
            vec4(0.0, 0.0, NEAR, 0.0),
        );
        let (light, intensity) = self.light;
        let floats = to_clip_floats(reversed * camera.view(), camera.eye(), light, intensity);
        gpu.queue.write_buffer(&self.globals, 0, bytemuck::cast_slice(&floats));

        let size = (target.width as u32, target.height as u32, 1);
        let [picture, depth] = [COLOR_FORMAT, DEPTH_FORMAT].map(|format| {
            let texture = device::texture(&gpu.device, size, format);
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        });
        let mut encoder = gpu.encoder();
        let mut pass = device::begin(&mut encoder, &picture, wgpu::Color::BLACK, &depth);
        for object in &self.objects {
            pass.set_pipeline(&self.pipelines[object.kind]);
            pass.set_bind_group(0, &self.globals_group, &[]);
            pass.set_bind_group(1, &object.surface, &[]);
            pass.set_bind_group(2, &self.distances_group, &[]);
            object.draw(&mut pass);
        }
        drop(pass);
        let picture = wgpu::BindingResource::TextureView(&picture);
        let group = device::group(&gpu.device, &self.picture_layout, picture);
        let mut pass = target.begin(&mut encoder);
        pass.set_pipeline(&self.copy);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        gpu.submit(encoder);
        Ok(())
    }
}
