//! Bonus: what the light sees in all six directions.

use basecode::gpu::{FrameUniforms, Gpu, Mesh, ObjectUniforms, ShadowMap, Stage, Uniform};
use basecode::{Camera, CameraConfig, Mat4, Result, Scene, Vec3, wgpu};

const SIDE: u32 = 2048;

pub fn draw(gpu: &Gpu, scene: &Scene) -> Result<ShadowMap> {
    let light = scene.first_light_position();
    let solid = || {
        let shapes = scene.shapes().iter().enumerate();
        shapes.filter(|(index, _)| !scene.material_of(*index).is_emitter()).map(|(_, shape)| shape)
    };
    // The light is a camera with a square film and a right angle of view.
    let look = |(forward, up): (Vec3, Vec3)| {
        let config = CameraConfig { eye: light, at: light + forward, up, fov_y_deg: 90.0 };
        Camera::new(config, 1, 1)
    };
    let cameras = [
        (Vec3::X, Vec3::Y),
        (-Vec3::X, Vec3::Y),
        (Vec3::Y, Vec3::X),
        (-Vec3::Y, Vec3::X),
        (Vec3::Z, Vec3::Y),
        (-Vec3::Z, Vec3::Y),
    ];
    let cameras: Vec<Camera> = cameras.into_iter().map(look).collect::<Result<_>>()?;
    let clip: Vec<Mat4> = cameras.iter().map(|c| c.projection() * c.view()).collect();
    let map = ShadowMap::new(gpu, SIDE, &clip, 0.0)?;

    let stage = Stage { name: "shadow.vs", text: include_str!("shaders/shadow.vs.wgsl") };
    let pipeline = gpu.depth_pipeline(stage);
    let identity = Uniform::object(gpu, &ObjectUniforms::new(Mat4::IDENTITY));
    let meshes: Vec<Mesh> = solid().map(|shape| Mesh::new(gpu, shape)).collect();
    let mut commands = gpu.encoder();
    for (face, camera) in cameras.iter().enumerate() {
        let globals = Uniform::frame(gpu, &FrameUniforms::new(camera));
        let mut pass = map.begin(&mut commands, face);
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &globals.bind_group, &[]);
        pass.set_bind_group(1, &identity.bind_group, &[]);
        for mesh in &meshes {
            pass.set_vertex_buffer(0, mesh.vertices.slice(..));
            pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..mesh.index_count, 0, 0..1);
        }
    }
    gpu.submit(commands);
    Ok(map)
}
