//! Whether the base code's projection draws what a camera sees.

use basecode::Camera;
use basecode::scene::MeshFile;
use glam::{DMat3, DVec3};

/// Says what of a mesh is in view but not drawn in realtime: it lies before the near plane or behind the far one.
pub(super) fn out_of_range(camera: &Camera, mesh: &MeshFile) -> Option<String> {
    let Some((nearest, farthest)) = depths_in_view(camera, mesh) else {
        return Some("nothing of it is in view".to_owned());
    };
    let (near, far) = (Camera::NEAR, Camera::FAR);
    let drawn = f64::from(near)..=f64::from(far);
    if drawn.contains(&nearest) && drawn.contains(&farthest) {
        return None;
    }
    let (nearest, farthest) = (nearest as f32, farthest as f32);
    Some(format!(
        "what is in view reaches from {nearest} to {farthest} units before the camera; the base code's \
         projection draws from {near} to {far}"
    ))
}

/// The least and the greatest depth of the surface points that lie within the film's edges, seen from the eye.
fn depths_in_view(camera: &Camera, mesh: &MeshFile) -> Option<(f64, f64)> {
    let rotation = DMat3::from_mat4(camera.view().as_dmat4());
    let eye = camera.eye().as_dvec3();
    let projection = camera.projection();
    let (x, y) = (f64::from(projection.x_axis.x), f64::from(projection.y_axis.y));
    // The planes through the eye and an edge of the film; view space looks along -z.
    let edges = [
        DVec3::new(x, 0.0, -1.0),
        DVec3::new(-x, 0.0, -1.0),
        DVec3::new(0.0, y, -1.0),
        DVec3::new(0.0, -y, -1.0),
    ];
    let mut depths: Option<(f64, f64)> = None;
    for shape in &mesh.shapes {
        for primitive in 0..shape.triangles.len() {
            let corners = shape.corners(primitive);
            let mut polygon = corners.map(|p| rotation * (p.as_dvec3() - eye)).to_vec();
            for edge in edges {
                polygon = inside(&polygon, edge);
            }
            for point in polygon {
                let (least, most) = depths.unwrap_or((-point.z, -point.z));
                depths = Some((least.min(-point.z), most.max(-point.z)));
            }
        }
    }
    depths
}

/// The part of a convex polygon on the positive side of a plane through the origin (Sutherland and Hodgman 1974).
fn inside(polygon: &[DVec3], normal: DVec3) -> Vec<DVec3> {
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (index, &to) in polygon.iter().enumerate() {
        let from = polygon[(index + polygon.len() - 1) % polygon.len()];
        let (a, b) = (from.dot(normal), to.dot(normal));
        if (a < 0.0) != (b < 0.0) {
            part.push(from.lerp(to, a / (a - b)));
        }
        if b >= 0.0 {
            part.push(to);
        }
    }
    part
}
