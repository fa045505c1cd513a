//! Uniform buffers with the bind groups that hold them.

use super::{FrameUniforms, Gpu, MaterialUniforms, ObjectUniforms};

/// A uniform buffer and the bind group that it fills.
pub struct Uniform {
    /// To be set before drawing.
    pub bind_group: wgpu::BindGroup,
    buffer: wgpu::Buffer,
}

impl Uniform {
    /// For bind group 0.
    pub fn frame(gpu: &Gpu, values: &FrameUniforms) -> Self {
        let values = gpu.nothing_unset(values);
        Self::new(gpu, "frame", &gpu.layouts.frame, bytemuck::bytes_of(&values))
    }

    /// For bind group 1.
    pub fn object(gpu: &Gpu, values: &ObjectUniforms) -> Self {
        Self::new(gpu, "object", &gpu.layouts.object, bytemuck::bytes_of(values))
    }

    /// For bind group 2.
    pub fn material(gpu: &Gpu, values: &MaterialUniforms) -> Self {
        Self::new(gpu, "material", &gpu.layouts.material, bytemuck::bytes_of(values))
    }

    /// Replaces what a frame's uniform buffer holds, from the next submission on.
    pub fn write_frame(&self, gpu: &Gpu, values: &FrameUniforms) {
        let values = gpu.nothing_unset(values);
        gpu.queue.write_buffer(&self.buffer, 0, bytemuck::bytes_of(&values));
    }

    fn new(gpu: &Gpu, name: &str, layout: &wgpu::BindGroupLayout, bytes: &[u8]) -> Self {
        let buffer = filled_buffer(gpu, name, bytes, wgpu::BufferUsages::STORAGE);
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(name),
            layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
        });
        Self { bind_group, buffer }
    }
}

/// A buffer that holds `bytes`, a multiple of four of them.
pub(super) fn filled_buffer(
    gpu: &Gpu,
    name: &str,
    bytes: &[u8],
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    // Not mapped at creation: that panics when the device is lost or out of memory.
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(name),
        size: bytes.len() as u64,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue.write_buffer(&buffer, 0, bytes);
    buffer
}
