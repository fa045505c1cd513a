//! How far the light sees in each direction (bonus): a cube of distances.

use basecode::{Mat4, Vec3, Vec4, vec4, wgpu};
use wgpu::TextureFormat::{Depth32Float, R32Float};

use super::device;
use super::simple::{Object, to_clip_floats};

/// Texels along a side.
pub const SIDE: u32 = 2048;

/// The cube; a single texel when no shadows are drawn.
pub struct Distances {
    pub view: wgpu::TextureView,
    /// 0 when no shadows are drawn.
    pub side: f32,
}

impl Distances {
    pub fn none(device: &wgpu::Device) -> Self {
        Self { view: view(&device::texture(device, (1, 1, 6), R32Float)), side: 0.0 }
    }

    /// Draws the objects as the light sees them.
    pub fn draw(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        globals: &wgpu::BindGroupLayout,
        (light, near): (Vec3, f32),
        objects: &[Object],
    ) -> Self {
        let cube = device::texture(device, (SIDE, SIDE, 6), R32Float);
        let depth = device::texture(device, (SIDE, SIDE, 1), Depth32Float);
        let depth = depth.create_view(&wgpu::TextureViewDescriptor::default());
        let pipeline = device::pipeline(
            device,
            &device::Recipe {
                groups: &[globals],
                wgsl: concat!(
                    include_str!("../shaders/common.wgsl"),
                    include_str!("../shaders/simple.vs.wgsl")
                ),
                vertex: "to_film",
                fragment: "distance_to_light",
                vertices: true,
                color: R32Float,
                depth: wgpu::CompareFunction::Greater,
            },
        );
        let axes = [Vec3::X, Vec3::Y, Vec3::Z];
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for face in 0..6 {
            let (right, up) = (axes[(face / 2 + 1) % 3], axes[(face / 2 + 2) % 3]);
            let forward = axes[face / 2] * if face % 2 == 0 { 1.0 } else { -1.0 };
            let to_clip = seen_along(right, up, forward, near) * Mat4::from_translation(-light);
            let buffer = device::floats(device, &to_clip_floats(to_clip, light, light, Vec4::ZERO));
            let group = device::group(device, globals, buffer.as_entire_binding());
            let layer = cube.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: face as u32,
                array_layer_count: Some(1),
                ..wgpu::TextureViewDescriptor::default()
            });
            let mut pass = device::begin(&mut encoder, &layer, FAR, &depth);
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            objects.iter().filter(|object| !object.emits).for_each(|object| object.draw(&mut pass));
        }
        queue.submit([encoder.finish()]);
        Self { view: view(&cube), side: SIDE as f32 }
    }
}

/// Farther than anything.
const FAR: wgpu::Color = wgpu::Color { r: 1e30, g: 0.0, b: 0.0, a: 1.0 };

fn view(cube: &wgpu::Texture) -> wgpu::TextureView {
    cube.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..wgpu::TextureViewDescriptor::default()
    })
}

/// A right angle of view along an axis, depths from 1 at `near` to 0 infinitely far away.
fn seen_along(right: Vec3, up: Vec3, forward: Vec3, near: f32) -> Mat4 {
    Mat4::from_cols(
        vec4(right.x, up.x, 0.0, forward.x),
        vec4(right.y, up.y, 0.0, forward.y),
        vec4(right.z, up.z, 0.0, forward.z),
        vec4(0.0, 0.0, near, 0.0),
    )
}
