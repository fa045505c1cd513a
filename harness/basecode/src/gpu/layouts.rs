//! Bind group layouts: the fixed part of the shader contract.

use super::{FrameUniforms, MaterialUniforms, ObjectUniforms, ShadowUniforms};

/// The four bind group layouts. They are explicit: an automatic layout would drop what a shader
/// does not use, and stages could not be exchanged.
pub struct Layouts {
    /// Group 0.
    pub frame: wgpu::BindGroupLayout,
    /// Group 1.
    pub object: wgpu::BindGroupLayout,
    /// Group 2.
    pub material: wgpu::BindGroupLayout,
    /// Group 3.
    pub shadow: wgpu::BindGroupLayout,
    pub(super) all: wgpu::PipelineLayout,
    pub(super) depth: wgpu::PipelineLayout,
}

impl Layouts {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let layout = |name, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(name),
                entries,
            })
        };
        let uniform = |size: usize| {
            entry(
                0,
                wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only: true },
                    has_dynamic_offset: false,
                    min_binding_size: std::num::NonZeroU64::new(size as u64),
                },
            )
        };
        let map = entry(
            1,
            wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Depth,
                view_dimension: wgpu::TextureViewDimension::D2Array,
                multisampled: false,
            },
        );
        let comparison = entry(2, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Comparison));
        let frame = layout("frame", &[uniform(size_of::<FrameUniforms>())]);
        let object = layout("object", &[uniform(size_of::<ObjectUniforms>())]);
        let material = layout("material", &[uniform(size_of::<MaterialUniforms>())]);
        let shadow = layout("shadow", &[uniform(size_of::<ShadowUniforms>()), map, comparison]);
        let pipeline = |name, groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(name),
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let all = pipeline("all", &[Some(&frame), Some(&object), Some(&material), Some(&shadow)]);
        let depth = pipeline("depth", &[Some(&frame), Some(&object)]);
        Self { frame, object, material, shadow, all, depth }
    }
}

fn entry(binding: u32, ty: wgpu::BindingType) -> wgpu::BindGroupLayoutEntry {
    let visibility = wgpu::ShaderStages::VERTEX_FRAGMENT;
    wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None }
}
