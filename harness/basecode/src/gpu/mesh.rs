//! Vertex and index buffers.

use super::Gpu;
use super::uniform::filled_buffer;
use crate::Shape;

/// The triangles of a shape, on the device.
///
/// ```text
/// pass.set_vertex_buffer(0, mesh.vertices.slice(..));
/// pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
/// pass.draw_indexed(0..mesh.index_count, 0, 0..1);
/// ```
pub struct Mesh {
    /// For each vertex its position and its normal, world space: see [`super::VERTEX_STRIDE`].
    pub vertices: wgpu::Buffer,
    /// Three vertices for each triangle, as 32-bit integers.
    pub indices: wgpu::Buffer,
    /// Number of indices: three times the number of triangles.
    pub index_count: u32,
}

impl Mesh {
    /// Copies a shape to the device.
    pub fn new(gpu: &Gpu, shape: &Shape) -> Self {
        let vertices = shape.positions.iter().zip(&shape.normals);
        let vertices: Vec<[f32; 6]> =
            vertices.map(|(p, n)| [p.x, p.y, p.z, n.x, n.y, n.z]).collect();
        let bytes = bytemuck::cast_slice(&vertices);
        let indices = bytemuck::cast_slice(&shape.triangles);
        Self {
            vertices: filled_buffer(gpu, &shape.name, bytes, wgpu::BufferUsages::VERTEX),
            indices: filled_buffer(gpu, &shape.name, indices, wgpu::BufferUsages::INDEX),
            index_count: 3 * shape.triangles.len() as u32,
        }
    }
}
