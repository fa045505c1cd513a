//! Simple surfaces in closed form.

use super::mesh::{Mesh, Vertex};
use glam::{DVec2, DVec3, dvec2, dvec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A flat parallelogram with corner `origin`; its front is the side that `u x v` points to.
pub fn quad(origin: DVec3, u: DVec3, v: DVec3) -> Mesh {
    let normal = u.cross(v).normalize();
    Mesh::grid(1, 1, |s, t| Vertex { position: origin + u * s + v * t, normal, uv: dvec2(s, t) })
}

/// A horizontal rectangle at height `y` that faces up, from corner (x0, z0) to corner (x1, z1).
pub fn floor(y: f64, [x0, z0]: [f64; 2], [x1, z1]: [f64; 2]) -> Mesh {
    quad(dvec3(x0, y, z1), dvec3(x1 - x0, 0.0, 0.0), dvec3(0.0, 0.0, z0 - z1))
}

/// A closed sphere with its poles on the y axis.
pub fn sphere(center: DVec3, radius: f64) -> Mesh {
    sphere_band(center, radius, 64, 32, 1.0)
}

/// A coarser closed sphere, for small films.
pub fn ball(center: DVec3, radius: f64) -> Mesh {
    sphere_band(center, radius, 32, 16, 1.0)
}

/// The part of a sphere from its upper pole down to the fraction `part` of the way to the lower pole, seen from
/// outside.
pub fn sphere_band(center: DVec3, radius: f64, segments: usize, rings: usize, part: f64) -> Mesh {
    Mesh::grid(segments, rings, |u, v| {
        // Exact values at the seam and at the poles keep the mesh watertight.
        let (sin_phi, cos_phi) = if u == 1.0 { (0.0, 1.0) } else { (TAU * u).sin_cos() };
        let theta = PI * v * part;
        let sin_theta = if v * part == 1.0 { 0.0 } else { theta.sin() };
        let normal = dvec3(sin_theta * cos_phi, theta.cos(), -sin_theta * sin_phi);
        Vertex { position: center + normal * radius, normal, uv: dvec2(u, 1.0 - v * part) }
    })
}

/// A photographer's backdrop: a floor at y = 0, a quarter circle of the given radius, and a wall up to `height`.
///
/// It spans -half_width to half_width in x; the floor runs from `z_front` towards the wall at `z_wall`.
pub fn backdrop(half_width: f64, z_front: f64, z_wall: f64, height: f64, radius: f64) -> Mesh {
    let arc_steps = 24;
    // The profile in the (z, y) plane: one step of floor, the arc, one step of wall.
    let profile = |step: usize| -> (DVec2, DVec2) {
        let angle = FRAC_PI_2 * (step.clamp(1, arc_steps + 1) - 1) as f64 / arc_steps as f64;
        let normal =
            if step > arc_steps { dvec2(1.0, 0.0) } else { dvec2(angle.sin(), angle.cos()) };
        let center = dvec2(z_wall + radius, radius);
        match step {
            0 => (dvec2(z_front, 0.0), dvec2(0.0, 1.0)),
            s if s == arc_steps + 2 => (dvec2(z_wall, height), dvec2(1.0, 0.0)),
            _ => (center - radius * normal, normal),
        }
    };
    let steps = arc_steps + 2;
    Mesh::grid(1, steps, |u, v| {
        let (p, n) = profile((v * steps as f64).round() as usize);
        let x = half_width * (2.0 * u - 1.0);
        Vertex { position: dvec3(x, p.y, p.x), normal: dvec3(0.0, n.y, n.x), uv: dvec2(u, v) }
    })
}

/// The graph of `height(x, z)` over a rectangle, facing up; `slope` gives the two partial derivatives.
pub fn height_field(
    [x0, z0]: [f64; 2],
    [x1, z1]: [f64; 2],
    cells: [usize; 2],
    height: impl Fn(f64, f64) -> f64,
    slope: impl Fn(f64, f64) -> DVec2,
) -> Mesh {
    Mesh::grid(cells[0], cells[1], |u, v| {
        let (x, z) = (x0 + (x1 - x0) * u, z0 + (z1 - z0) * v);
        let s = slope(x, z);
        Vertex {
            position: dvec3(x, height(x, z), z),
            normal: dvec3(-s.x, 1.0, -s.y).normalize(),
            uv: dvec2(u, v),
        }
    })
}

/// An axis-aligned closed box.
pub fn cuboid(low: DVec3, high: DVec3) -> Mesh {
    let d = high - low;
    let (x, y, z) = (DVec3::X * d.x, DVec3::Y * d.y, DVec3::Z * d.z);
    [(low, y, x), (low, z, y), (low, x, z), (high, -x, -y), (high, -y, -z), (high, -z, -x)]
        .into_iter()
        .map(|(origin, u, v)| quad(origin, u, v))
        .fold(Mesh::default(), Mesh::join)
}

/// Triangles (0, i, i + 1) over a planar polygon, front towards `normal`: vertex 0 occurs in every triangle.
pub fn fan(corners: &[DVec3], normal: DVec3) -> Mesh {
    let vertices =
        corners.iter().map(|&position| Vertex { position, normal, uv: DVec2::ZERO }).collect();
    let triangles = (1..corners.len() as u32 - 1).map(|i| [0, i, i + 1]).collect();
    Mesh { vertices, triangles }
}
