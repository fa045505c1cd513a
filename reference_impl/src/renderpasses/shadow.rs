//! The shadow map: a cube of depth images around the point light.
//!
//! A point light shines in all directions, so one frustum cannot cover every scene; six do. The
//! scene does not move: the map is drawn once, when the pass is made.
//!
//! # Bias
//! A texel holds the depth at its centre, but is asked about points up to half its diagonal away; a
//! surface then seems to shadow itself (acne). With d the depth of a point and N the resolution, a
//! texel is s = 2 d / N wide there, so its centre is at most s / sqrt 2 = 0.71 s away. The fragment
//! stages therefore look up the point moved by 0.8 s along its normal: the texel's centre then lies
//! in front of the surface's plane, whatever the angle of the light. (A bias of depth would have to
//! grow with the tangent of that angle, without bound.) They also move it by s toward the light:
//! that shifts no shadow's edge, pays for rounding, and keeps concave corners lit.
//!
//! In return a blocker may come loose from its shadow (peter-panning): by at most s where a card
//! without thickness stands on a floor, by nothing where a solid does. `docs/decisions/0002-shadow-map.md`
//! has the measurements.

use basecode::gpu::{
    FRAME_GROUP, FrameUniforms, Gpu, Mesh, OBJECT_GROUP, ObjectUniforms, ShadowMap, Stage, Uniform,
};
use basecode::{Mat4, Result, Scene, Vec3, Vec4, vec4, wgpu};

use crate::mistakes::{Mistake, Mistakes};

const SHADOW_VS: Stage =
    Stage { name: "shadow.vs", text: include_str!("../shaders/shadow.vs.wgsl") };

/// Width and height of a face of the cube, in texels.
const RESOLUTION: u32 = 2048;

/// By how many texels a point is moved along its normal before it is looked up: `params.w` in the
/// fragment stages.
const NORMAL_OFFSET: f32 = 0.8;

/// The nearest depth is at least this fraction of the farthest: a float resolves no more.
const LEAST_NEAR: f32 = 1e-4;

/// Looking direction and up direction of each face, in the order that the fragment stages expect.
const FACES: [(Vec3, Vec3); 6] = [
    (Vec3::X, Vec3::Y),
    (Vec3::NEG_X, Vec3::Y),
    (Vec3::Y, Vec3::Z),
    (Vec3::NEG_Y, Vec3::Z),
    (Vec3::Z, Vec3::Y),
    (Vec3::NEG_Z, Vec3::Y),
];

/// Draws what blocks the scene's light.
pub fn draw_shadow_map(gpu: &Gpu, scene: &Scene, mistakes: &Mistakes) -> Result<ShadowMap> {
    let has = |mistake| mistakes.has(mistake);
    let mut light = scene.first_light_position();
    if has(Mistake::ShadowMapFromCamera) {
        light = scene.camera(1, 1)?.eye();
    }
    let mut projection = face_projection(scene, has(Mistake::ShadowMapFarHalf));
    if has(Mistake::ShadowMapHalf) {
        (projection.x_axis, projection.y_axis) = (2.0 * projection.x_axis, 2.0 * projection.y_axis);
    }
    let resolution = match () {
        () if has(Mistake::ShadowMapCoarse) => 32,
        () if has(Mistake::ShadowMapSmall) => 1024,
        () if has(Mistake::ShadowMapLarge) => 4096,
        () => RESOLUTION,
    };
    let views = FACES.map(|(direction, up)| face_view(light, direction, up));
    let map = ShadowMap::new(gpu, resolution, &views.map(|v| projection * v), NORMAL_OFFSET)?;
    let pipeline = gpu.depth_pipeline(SHADOW_VS);
    let placement = Uniform::object(gpu, &ObjectUniforms::new(Mat4::IDENTITY));
    let mut meshes: Vec<Mesh> = blockers(scene).map(|shape| Mesh::new(gpu, shape)).collect();
    meshes.truncate(match () {
        () if has(Mistake::ShadowMapEmpty) => 0,
        () if has(Mistake::ShadowMapFirstOnly) => 1,
        () if has(Mistake::ShadowMapLastMissing) => meshes.len() - 1,
        () => meshes.len(),
    });
    let mut encoder = gpu.encoder();
    for (layer, view) in views.into_iter().enumerate() {
        // The light takes the camera's place.
        let frame = FrameUniforms {
            view,
            projection,
            camera_position: light.extend(1.0),
            light_position: light.extend(1.0),
            light_intensity: Vec4::ZERO,
        };
        let frame = Uniform::frame(gpu, &frame);
        let mut pass = map.begin(&mut encoder, layer);
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(FRAME_GROUP, &frame.bind_group, &[]);
        pass.set_bind_group(OBJECT_GROUP, &placement.bind_group, &[]);
        for mesh in &meshes {
            pass.set_vertex_buffer(0, mesh.vertices.slice(..));
            pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..mesh.index_count, 0, 0..1);
        }
    }
    gpu.submit(encoder);
    Ok(map)
}

/// The shapes that cast shadows: all but emitters.
fn blockers(scene: &Scene) -> impl Iterator<Item = &basecode::Shape> {
    let shapes = scene.shapes().iter().enumerate();
    shapes.filter(|(index, _)| !scene.material_of(*index).is_emitter()).map(|(_, shape)| shape)
}

/// World space to the view space of a face; it looks along -z.
fn face_view(light: Vec3, direction: Vec3, up: Vec3) -> Mat4 {
    let right = direction.cross(up);
    let rotation = basecode::Mat3::from_cols(right, up, -direction).transpose();
    Mat4::from_mat3(rotation) * Mat4::from_translation(-light)
}

/// A face sees 90 degrees in both directions, from the nearest blocker to the farthest.
fn face_projection(scene: &Scene, half_as_far: bool) -> Mat4 {
    let light = scene.first_light_position();
    let (mut nearest, mut farthest) = (f32::INFINITY, 0.0f32);
    for shape in blockers(scene) {
        for triangle in 0..shape.triangles.len() {
            let corners = shape.corners(triangle);
            // The depth in a face is the largest component of the way from the light: a bound is
            // had from the triangle's box.
            let low = corners[0].min(corners[1]).min(corners[2]);
            let high = corners[0].max(corners[1]).max(corners[2]);
            nearest = nearest.min((light.clamp(low, high) - light).abs().max_element());
            farthest = farthest.max((low - light).abs().max((high - light).abs()).max_element());
        }
    }
    let mut far = 1.01 * farthest.max(f32::MIN_POSITIVE);
    if half_as_far {
        far *= 0.5;
    }
    let near = (0.99 * nearest).clamp(LEAST_NEAR * far, 0.5 * far);
    let depth = far / (near - far);
    Mat4::from_cols(
        Vec4::X,
        Vec4::Y,
        vec4(0.0, 0.0, depth, -1.0),
        vec4(0.0, 0.0, near * depth, 0.0),
    )
}
