//! Surfaces of Bezier patches: swept profiles and half tubes.

use super::mesh::{Mesh, Vertex};
use super::newell::{HalfTube, Profile, QUARTER_TURN_K};
use glam::{DVec3, dvec2, dvec3};

/// The cubic Bernstein polynomials at `t`; exactly (1, 0, 0, 0) and (0, 0, 0, 1) at the ends.
fn bernstein(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
}

/// Their derivatives.
fn bernstein_derivative(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-3.0 * s * s, 3.0 * s * s - 6.0 * s * t, 6.0 * s * t - 3.0 * t * t, 3.0 * t * t]
}

/// The sum of `points` weighted by a basis.
fn blend<const N: usize>(basis: [f64; 4], points: &[[f64; N]; 4]) -> [f64; N] {
    std::array::from_fn(|k| (0..4).map(|i| basis[i] * points[i][k]).sum())
}

/// The published z-up coordinates in our y-up world.
fn y_up([x, y, z]: [f64; 3]) -> DVec3 {
    dvec3(x, z, -y)
}

/// A surface of (nearly) revolution: each profile becomes `steps` rings, each quarter turn `steps` segments.
///
/// The outside is on the left of the profile's way when radius grows to the right and height upwards, as for a chain
/// that starts at the top of the axis. Profiles do not share vertices, so that creases between them stay sharp.
pub fn sweep(profiles: &[Profile], steps: usize) -> Mesh {
    let mut mesh = Mesh::default();
    for (k, profile) in profiles.iter().enumerate() {
        mesh = mesh.join(Mesh::grid(4 * steps, steps, |u, v| {
            let mut vertex = swept_point(profile, 4.0 * u, v);
            vertex.uv = dvec2(u, 1.0 - (k as f64 + v) / profiles.len() as f64);
            vertex
        }));
    }
    mesh
}

/// The point at fraction `v` of a profile, swept through `turn` quarter turns.
///
/// With position (r x, r y, z) and both partial derivatives, dP/dv x dP/du is r times the vector below: dividing by r
/// leaves the limit normal on the axis, where the patch itself is degenerate.
fn swept_point(profile: &Profile, turn: f64, v: f64) -> Vertex {
    let quarter = turn.floor();
    let arc = [[1.0, 0.0], [1.0, QUARTER_TURN_K], [QUARTER_TURN_K, 1.0], [0.0, 1.0]];
    let [x, y] = blend(bernstein(turn - quarter), &arc);
    let [dx, dy] = blend(bernstein_derivative(turn - quarter), &arc);
    let [r, z] = blend(bernstein(v), profile);
    let [dr, dz] = blend(bernstein_derivative(v), profile);
    let rotate = |[x, y, z]: [f64; 3]| match quarter as i64 % 4 {
        0 => [x, y, z],
        1 => [-y, x, z],
        2 => [-x, -y, z],
        _ => [y, -x, z],
    };
    Vertex {
        position: y_up(rotate([r * x, r * y, z])),
        normal: y_up(rotate([-dz * dy, dz * dx, dr * (x * dy - y * dx)])).normalize(),
        uv: dvec2(0.0, 0.0),
    }
}

/// A tube of half patches and their mirror images in y = 0; each patch becomes `steps` x `steps` cells and mirror.
pub fn tube(halves: &[HalfTube], steps: usize) -> Mesh {
    let mut mesh = Mesh::default();
    for (k, half) in halves.iter().enumerate() {
        mesh = mesh.join(Mesh::grid(2 * steps, steps, |u, v| {
            // u runs around: the published half, then its mirror image backwards.
            let mirrored = u > 0.5;
            let across = if mirrored { 2.0 - 2.0 * u } else { 2.0 * u };
            let (b, db) = (bernstein(across), bernstein_derivative(across));
            let rows: [[f64; 3]; 4] = std::array::from_fn(|i| blend(b, &half[i]));
            let slopes: [[f64; 3]; 4] = std::array::from_fn(|i| blend(db, &half[i]));
            let along = DVec3::from(blend(bernstein_derivative(v), &rows));
            let across = DVec3::from(blend(bernstein(v), &slopes));
            let flip = |[x, y, z]: [f64; 3]| y_up(if mirrored { [x, -y, z] } else { [x, y, z] });
            Vertex {
                position: flip(blend(bernstein(v), &rows)),
                normal: flip(across.cross(along).normalize().to_array()),
                uv: dvec2(u, (k as f64 + v) / halves.len() as f64),
            }
        }));
    }
    mesh
}
