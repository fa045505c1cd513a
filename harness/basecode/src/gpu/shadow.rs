//! The resources of a shadow map: a depth texture, its sampler and bind group 3.

use bytemuck::Zeroable;

use super::target::depth_attachment;
use super::uniform::filled_buffer;
use super::{DEPTH_FORMAT, Gpu, SHADOW_LAYERS, ShadowUniforms};
use crate::{Error, Result};

/// A depth texture of up to six layers, with the bind group through which shaders look it up.
///
/// The sampler compares with `LessEqual` and does not filter: the answer is 0 or 1.
pub struct ShadowMap {
    /// Bind group 3.
    pub bind_group: wgpu::BindGroup,
    layers: Vec<wgpu::TextureView>,
}

impl ShadowMap {
    /// The dummy to bind when no shadows are drawn: `params.x` is 0 in the shaders.
    pub fn off(gpu: &Gpu) -> Self {
        Self::make(gpu, 1, 1, &ShadowUniforms::zeroed())
    }

    /// A map with one layer of `resolution` x `resolution` texels for each matrix, world space to
    /// the light's clip space. `free` is what `params.w` shall be in the shaders.
    ///
    /// # Errors
    /// When there are no matrices or more than [`SHADOW_LAYERS`], or the resolution is too high.
    pub fn new(
        gpu: &Gpu,
        resolution: u32,
        light_view_projection: &[glam::Mat4],
        free: f32,
    ) -> Result<Self> {
        let count = light_view_projection.len();
        if count == 0 || count > SHADOW_LAYERS {
            let message = format!("a shadow map has 1 to {SHADOW_LAYERS} layers, not {count}");
            return Err(Error::Argument(message));
        }
        let limit = gpu.device.limits().max_texture_dimension_2d;
        if resolution == 0 || resolution > limit {
            return Err(Error::Argument(format!(
                "shadow map resolution is {resolution} but must lie in 1 to {limit}"
            )));
        }
        let mut values = ShadowUniforms::zeroed();
        values.params = glam::vec4(1.0, count as f32, resolution as f32, free);
        values.light_view_projection[..count].copy_from_slice(light_view_projection);
        Ok(Self::make(gpu, resolution, count as u32, &values))
    }

    /// Begins to draw into a layer, cleared to the farthest depth. Use [`Gpu::depth_pipeline`].
    ///
    /// # Panics
    /// When there is no such layer.
    pub fn begin<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        layer: usize,
    ) -> wgpu::RenderPass<'e> {
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadow map"),
            color_attachments: &[],
            depth_stencil_attachment: Some(depth_attachment(&self.layers[layer])),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        })
    }

    fn make(gpu: &Gpu, resolution: u32, count: u32, values: &ShadowUniforms) -> Self {
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("shadow map"),
            size: wgpu::Extent3d {
                width: resolution,
                height: resolution,
                depth_or_array_layers: count,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: DEPTH_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = |dimension, first, layers| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(dimension),
                base_array_layer: first,
                array_layer_count: Some(layers),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("shadow comparison"),
            compare: Some(wgpu::CompareFunction::LessEqual),
            ..wgpu::SamplerDescriptor::default()
        });
        let bytes = bytemuck::bytes_of(values);
        let buffer = filled_buffer(gpu, "shadow", bytes, wgpu::BufferUsages::STORAGE);
        // Where nothing is unset, its zeros still say that no shadows are drawn.
        gpu.queue.write_exactly(&buffer, 0, bytes);
        let all = view(wgpu::TextureViewDimension::D2Array, 0, count);
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("shadow"),
            layout: &gpu.layouts.shadow,
            entries: &[
                entry(0, buffer.as_entire_binding()),
                entry(1, wgpu::BindingResource::TextureView(&all)),
                entry(2, wgpu::BindingResource::Sampler(&sampler)),
            ],
        });
        let layers = (0..count).map(|layer| view(wgpu::TextureViewDimension::D2, layer, 1));
        Self { bind_group, layers: layers.collect() }
    }
}
