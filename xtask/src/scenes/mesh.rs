//! Triangle meshes with one position, normal and texture coordinate per vertex.

use glam::{DQuat, DVec2, DVec3};

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// World-space position.
    pub position: DVec3,
    /// Unit shading normal, on the side that the surface is seen from.
    pub normal: DVec3,
    /// Texture coordinate; v grows upwards in the image.
    pub uv: DVec2,
}

/// Triangles that share vertices. A triangle is counter-clockwise when seen from its front.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub vertices: Vec<Vertex>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Samples `surface(u, v)` on `nu` x `nv` cells of the unit square.
    ///
    /// Triangles that collapse to a line (at a pole) are left out. The winding follows the normals: either every
    /// triangle is turned or none, so that a surface with inconsistent normals stays visibly wrong.
    pub fn grid(nu: usize, nv: usize, surface: impl Fn(f64, f64) -> Vertex) -> Self {
        let mut mesh = Self::default();
        for j in 0..=nv {
            for i in 0..=nu {
                mesh.vertices.push(surface(i as f64 / nu as f64, j as f64 / nv as f64));
            }
        }
        let index = |i: usize, j: usize| (j * (nu + 1) + i) as u32;
        for j in 0..nv {
            for i in 0..nu {
                let (a, b, c, d) =
                    (index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1));
                for triangle in [[a, b, c], [a, c, d]] {
                    if mesh.cross(triangle).length() > 1e-13 {
                        mesh.triangles.push(triangle);
                    }
                }
            }
        }
        let agreement: f64 = mesh
            .triangles
            .iter()
            .map(|t| mesh.cross(*t).dot(t.iter().map(|i| mesh.vertices[*i as usize].normal).sum()))
            .sum();
        if agreement < 0.0 {
            mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        mesh
    }

    /// Twice the area of a triangle times its geometric normal.
    pub fn cross(&self, triangle: [u32; 3]) -> DVec3 {
        let [a, b, c] = triangle.map(|i| self.vertices[i as usize].position);
        (b - a).cross(c - a)
    }

    /// Both meshes as one.
    pub fn join(mut self, other: Self) -> Self {
        let first = self.vertices.len() as u32;
        self.vertices.extend(other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
        self
    }

    /// Scales, then turns, then moves.
    pub fn place(mut self, scale: f64, turn: DQuat, offset: DVec3) -> Self {
        for vertex in &mut self.vertices {
            vertex.position = turn * (vertex.position * scale) + offset;
            vertex.normal = turn * vertex.normal;
        }
        self
    }

    /// The mesh with its texture coordinates mapped by `uv * scale + offset`.
    pub fn map_uv(mut self, scale: DVec2, offset: DVec2) -> Self {
        for vertex in &mut self.vertices {
            vertex.uv = vertex.uv * scale + offset;
        }
        self
    }
}
