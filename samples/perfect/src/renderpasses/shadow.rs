//! The shadow map (bonus): one frustum from the light that holds everything that casts a shadow.

use basecode::gpu::{
    FRAME_GROUP, FrameUniforms, Gpu, Mesh, OBJECT_GROUP, ObjectUniforms, ShadowMap, Stage, Uniform,
};
use basecode::{Mat3, Mat4, Result, Scene, Shape, Vec3, Vec4, vec4, wgpu};

const SHADOW_VS: Stage =
    Stage { name: "shadow.vs", text: include_str!("../shaders/shadow.vs.wgsl") };

/// Width and height of the map, in texels.
const RESOLUTION: u32 = 4096;

/// Half the frustum opens at most this far: a plane cannot show a whole hemisphere.
const MAX_HALF_ANGLE_DEG: f32 = 80.0;

/// Draws what blocks the scene's light.
pub fn draw_shadow_map(gpu: &Gpu, scene: &Scene) -> Result<ShadowMap> {
    let light = scene.first_light_position();
    let casters = casters(scene);
    let frustum = Frustum::around(light, &casters, scene);
    let (view, projection) = (frustum.view(), frustum.projection());
    let map = ShadowMap::new(gpu, RESOLUTION, &[projection * view], frustum.tan_half)?;

    let frame = FrameUniforms {
        view,
        projection,
        camera_position: light.extend(1.0),
        light_position: light.extend(1.0),
        light_intensity: Vec4::ZERO,
    };
    let frame = Uniform::frame(gpu, &frame);
    let placement = Uniform::object(gpu, &ObjectUniforms::new(Mat4::IDENTITY));
    let meshes: Vec<Mesh> = casters.iter().map(|shape| Mesh::new(gpu, shape)).collect();
    let pipeline = gpu.depth_pipeline(SHADOW_VS);
    let mut encoder = gpu.encoder();
    let mut pass = map.begin(&mut encoder, 0);
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(FRAME_GROUP, &frame.bind_group, &[]);
    pass.set_bind_group(OBJECT_GROUP, &placement.bind_group, &[]);
    for mesh in &meshes {
        pass.set_vertex_buffer(0, mesh.vertices.slice(..));
        pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..mesh.index_count, 0, 0..1);
    }
    drop(pass);
    gpu.submit(encoder);
    Ok(map)
}

/// The shapes that can throw a shadow on something. A wall cannot when all of the scene lies on
/// the light's side of it; without the walls the frustum can be narrow.
fn casters(scene: &Scene) -> Vec<&Shape> {
    let shapes = || scene.shapes().iter().enumerate();
    let solid = |index: &usize| !scene.material_of(*index).is_emitter();
    let light = scene.first_light_position();
    let is_wall = |shape: &Shape| {
        (0..shape.triangles.len()).all(|triangle| {
            let [a, b, c] = shape.corners(triangle);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let side = normal.dot(light - a).signum();
            let mut others = shapes().filter(|(i, _)| solid(i)).flat_map(|(_, s)| &s.positions);
            others.all(|p| side * normal.dot(*p - a) > -1e-3 * (light - a).length())
        })
    };
    shapes().filter(|(i, shape)| solid(i) && !is_wall(shape)).map(|(_, shape)| shape).collect()
}

/// What the light sees.
struct Frustum {
    light: Vec3,
    axis: Vec3,
    tan_half: f32,
    near: f32,
    far: f32,
}

impl Frustum {
    /// Looks at the middle of the casters, wide enough for all of them, and as far as the scene.
    fn around(light: Vec3, casters: &[&Shape], scene: &Scene) -> Self {
        let points = || casters.iter().flat_map(|shape| &shape.positions);
        let low = points().copied().reduce(Vec3::min).unwrap_or(light);
        let high = points().copied().reduce(Vec3::max).unwrap_or(light);
        let axis = (0.5 * (low + high) - light).normalize_or(Vec3::NEG_Y);
        let mut cos_half = 1.0f32;
        let mut near = f32::INFINITY;
        for p in points() {
            cos_half = cos_half.min((*p - light).normalize_or(axis).dot(axis));
            near = near.min((*p - light).dot(axis));
        }
        let depths = scene.shapes().iter().flat_map(|shape| &shape.positions);
        let far = depths.fold(1e-3f32, |far, p| far.max((*p - light).dot(axis)));
        let half = (cos_half.clamp(-1.0, 1.0).acos() + 0.02).min(MAX_HALF_ANGLE_DEG.to_radians());
        Self {
            light,
            axis,
            tan_half: half.tan(),
            near: (0.9 * near).clamp(1e-4 * far, 0.5 * far),
            far: 1.1 * far,
        }
    }

    /// World space to the light's view space; it looks along -z.
    fn view(&self) -> Mat4 {
        let (right, up) = self.axis.any_orthonormal_pair();
        // Right-handed: right x up points back, against the axis.
        let rotation = Mat3::from_cols(up, right, -self.axis).transpose();
        Mat4::from_mat3(rotation) * Mat4::from_translation(-self.light)
    }

    /// View space to clip space, z in [0, 1].
    fn projection(&self) -> Mat4 {
        let depth = self.far / (self.near - self.far);
        Mat4::from_cols(
            Vec4::X / self.tan_half,
            Vec4::Y / self.tan_half,
            vec4(0.0, 0.0, depth, -1.0),
            vec4(0.0, 0.0, self.near * depth, 0.0),
        )
    }
}
