//! The device and queue that render passes get: wrappers of wgpu's own that record what a frame is made of.
//!
//! They refuse nothing. The host reads what a pass hands to the device for a frame. It may also change the pipelines
//! that the pass asks for: the resulting frame shows how the pass makes its pictures.

use std::borrow::Cow;
use std::fmt;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};

use serde::{Deserialize, Serialize};
use wgpu::util::{BufferInitDescriptor, DeviceExt, TextureDataOrder};

use super::COLOR_FORMAT;

/// A host switch in the form of a stage name. When the host sets it, its text holds a fragment entry point
/// `umbra_shown`, which draws all fragments of the picture.
pub const EVERY_FRAGMENT: &str = "every.fs";
/// A host switch in the form of a stage name. When the host sets it, only the outlines of triangles are drawn. On a
/// device that cannot draw outlines nothing changes, not even the fragments.
pub const OUTLINES: &str = "outlines";
/// A host switch in the form of a stage name. When the host sets it, pipelines that do not draw the picture, such as
/// those of a shadow map, write nothing.
pub const EMPTY_MAPS: &str = "empty.maps";
/// A host switch in the form of a stage name. When the host sets it, the pass is made for a scene whose normals are all
/// negated: what it draws rightly then, it draws by a normal that is negated once more.
pub const NEGATED_NORMALS: &str = "negated.normals";
/// A host switch in the form of a stage name. When the host sets it, pipelines that draw the picture have the usual
/// state. If the text names two vertex attributes, such as `0 1`, these exchange their locations instead. What a pass
/// draws rightly then, it draws by a slip with a pipeline.
pub const USUAL_PIPELINES: &str = "usual.pipelines";
/// A host switch in the form of a stage name. When the host sets it, the text names the [`crate::Matrices`] of every
/// frame's camera. What a pass draws rightly then, it draws by a slip with them.
pub const MATRICES: &str = "matrices";

/// A host switch in the form of a stage name. When the host sets it, its text holds two lines: wherever the first one
/// stands in WGSL, the second one stands instead. What a pass draws rightly then, it draws by a slip in that line.
pub const EDITED_LINE: &str = "edited.line";
/// A host switch in the form of a stage name. When the host sets it, four floats in uniforms and storage that are all
/// zero are all one: what a pass forgets to set leaves nothing dark then. The text holds the light's position, such as
/// `1 2 3`, which [`crate::gpu::FrameUniforms`] without one have. More numbers, four by four, stand in place of ones:
/// in what is written at once, the next four for each zero, and after the last the first again. Resources of a
/// [`crate::gpu::ShadowMap`] stay as they are.
pub const NOTHING_UNSET: &str = "nothing.unset";

/// Name of the entry point in the text of [`EVERY_FRAGMENT`].
const SHOWN: &str = "umbra_shown";

/// From this width on [texels], a texture is more than a placeholder.
const WIDE: u32 = 32;

/// WGSL up to this length [bytes] is a program; what is longer is data.
const LONG_WGSL: u64 = 64 << 10;

/// What a pass handed to the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Footprint {
    /// Bytes of buffers, textures and overlong shaders.
    pub uploaded: u64,
    /// Textures to draw into, of a picture's format, 32 texels wide or more.
    pub picture_targets: u32,
    /// Pipelines that take vertices, for pictures or for colors that a picture is made of, as a deferred renderer does.
    pub vertex_pipelines: u32,
    /// Pipelines for pictures that take none.
    pub vertexless_pipelines: u32,
    /// Pipelines that draw beside the picture, such as a shadow map.
    pub maps: u32,
}

impl Footprint {
    /// This and what came after it.
    pub fn and(self, later: Self) -> Self {
        Self {
            uploaded: self.uploaded.saturating_add(later.uploaded),
            picture_targets: self.picture_targets.saturating_add(later.picture_targets),
            vertex_pipelines: self.vertex_pipelines.saturating_add(later.vertex_pipelines),
            vertexless_pipelines: self
                .vertexless_pipelines
                .saturating_add(later.vertexless_pipelines),
            maps: self.maps.saturating_add(later.maps),
        }
    }
}

/// Parses the text that [`Footprint`] displays.
impl std::str::FromStr for Footprint {
    type Err = std::num::ParseIntError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut numbers = text.split(' ');
        let mut next = || numbers.next().unwrap_or_default();
        Ok(Self {
            uploaded: next().parse()?,
            picture_targets: next().parse()?,
            vertex_pipelines: next().parse()?,
            vertexless_pipelines: next().parse()?,
            maps: next().parse()?,
        })
    }
}

/// The numbers, as `draw_frame` tells the host.
impl fmt::Display for Footprint {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { uploaded, picture_targets, vertex_pipelines, vertexless_pipelines, maps } = self;
        write!(f, "{uploaded} {picture_targets} {vertex_pipelines} {vertexless_pipelines} {maps}")
    }
}

/// Changes to pipelines that the host asks for.
#[derive(Clone, Default, PartialEq, Eq)]
pub(super) struct Overrides {
    /// The text of [`EVERY_FRAGMENT`].
    pub shown: Option<String>,
    /// [`OUTLINES`].
    pub outlines: bool,
    /// [`EMPTY_MAPS`].
    pub empty_maps: bool,
    /// The text of [`USUAL_PIPELINES`].
    pub usual: Option<String>,
    /// The text of [`EDITED_LINE`].
    pub edited: Option<String>,
    /// The text of [`NOTHING_UNSET`].
    pub nothing_unset: Option<String>,
}

impl Overrides {
    /// The WGSL that is compiled in the place of another.
    pub(super) fn wgsl<'a>(&self, text: &'a str) -> Cow<'a, str> {
        let mut text = Cow::Borrowed(text);
        if let Some(edit) = &self.edited {
            text = with_line(&text, edit).into();
        }
        if let Some(shown) = &self.shown {
            text = format!("{text}\n{shown}\n").into();
        }
        text
    }
}

/// What a text of [`NOTHING_UNSET`] says.
pub(super) struct Unset {
    /// The light's position.
    pub light: Option<glam::Vec3>,
    /// What stands in place of zeros, in turn.
    in_turn: Vec<[f32; 4]>,
}

impl Unset {
    fn parse(text: &str) -> Self {
        let numbers: Vec<f32> = text.split(' ').filter_map(|number| number.parse().ok()).collect();
        let (light, rest) = numbers.split_at(numbers.len().min(3));
        let in_turn = match rest.as_chunks().0 {
            [] => vec![[1.0; 4]],
            some => some.to_vec(),
        };
        Self { light: <[f32; 3]>::try_from(light).ok().map(glam::Vec3::from), in_turn }
    }

    /// What is written of a buffer instead of this.
    fn set(&self, data: &[u8]) -> Vec<u8> {
        let mut data = data.to_owned();
        let is_zero = |four: &&mut [u8]| four.iter().all(|byte| *byte == 0);
        let unset = data.chunks_exact_mut(FOUR_FLOATS).filter(is_zero);
        for (four, values) in unset.zip(self.in_turn.iter().cycle()) {
            four.copy_from_slice(&values.map(f32::to_ne_bytes).concat());
        }
        data
    }
}

/// WGSL with a line in place of another, as a text of [`EDITED_LINE`] says.
fn with_line(text: &str, edit: &str) -> String {
    let (from, to) = edit.split_once('\n').unwrap_or((edit, edit));
    let line =
        |line: &str| if line.trim() == from.trim() { to.to_owned() } else { line.to_owned() };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// Whether a buffer holds what a stage reads by name, and no vertices.
fn takes_values(usage: wgpu::BufferUsages) -> bool {
    use wgpu::BufferUsages as Of;
    usage.intersects(Of::UNIFORM | Of::STORAGE) && !usage.intersects(Of::VERTEX | Of::INDEX)
}

/// Bytes of four floats.
const FOUR_FLOATS: usize = 16;

/// The vertex attributes that a text of [`USUAL_PIPELINES`] names.
fn exchanged(text: &str) -> Option<[u32; 2]> {
    let (a, b) = text.split_once(' ')?;
    Some([a.parse().ok()?, b.parse().ok()?])
}

/// The location of a vertex attribute with two of them exchanged.
fn exchanged_location(location: u32, [a, b]: [u32; 2]) -> u32 {
    match location {
        of if of == a => b,
        of if of == b => a,
        of => of,
    }
}

/// Nearest fragments win, both sides of triangles are drawn, and all channels are written.
fn set_usual_state(desc: &mut wgpu::RenderPipelineDescriptor) {
    desc.primitive = wgpu::PrimitiveState::default();
    if let Some(depth) = &mut desc.depth_stencil {
        depth.depth_write_enabled = Some(true);
        depth.depth_compare = Some(wgpu::CompareFunction::Less);
        depth.stencil = wgpu::StencilState::default();
        depth.bias = wgpu::DepthBiasState::default();
    }
}

/// The state that device and queue share.
#[derive(Default)]
pub(super) struct Watch {
    uploaded: AtomicU64,
    picture_targets: AtomicU32,
    vertex_pipelines: AtomicU32,
    vertexless_pipelines: AtomicU32,
    maps: AtomicU32,
    overrides: Mutex<Overrides>,
}

impl Watch {
    /// Applies these changes to modules and pipelines made from now on.
    pub(super) fn set_overrides(&self, overrides: Overrides) {
        if let Ok(mut current) = self.overrides.lock() {
            *current = overrides;
        }
    }

    /// What stands where nothing is set, if the host asks for that.
    pub(super) fn unset(&self) -> Option<Unset> {
        self.overrides().nothing_unset.as_deref().map(Unset::parse)
    }

    /// What was handed over since the last call.
    pub(super) fn take_footprint(&self) -> Footprint {
        Footprint {
            uploaded: self.uploaded.swap(0, Relaxed),
            picture_targets: self.picture_targets.swap(0, Relaxed),
            vertex_pipelines: self.vertex_pipelines.swap(0, Relaxed),
            vertexless_pipelines: self.vertexless_pipelines.swap(0, Relaxed),
            maps: self.maps.swap(0, Relaxed),
        }
    }

    fn upload(&self, bytes: u64) {
        self.uploaded.fetch_add(bytes, Relaxed);
    }

    fn upload_wgsl(&self, text: &str) {
        self.upload((text.len() as u64).saturating_sub(LONG_WGSL));
    }

    /// Counts a pipeline that is used once more, made of these texts, as if it were made anew.
    pub(super) fn reuse(&self, vertex: &str, fragment: Option<&str>) {
        self.upload_wgsl(vertex);
        fragment.iter().for_each(|text| self.upload_wgsl(text));
        let kind = if fragment.is_some() { &self.vertex_pipelines } else { &self.maps };
        kind.fetch_add(1, Relaxed);
    }

    pub(super) fn overrides(&self) -> Overrides {
        self.overrides.lock().map(|overrides| overrides.clone()).unwrap_or_default()
    }
}

/// A wrapper of [`wgpu::Device`]. [`crate::wgpu`] gives it the same name. The device itself cannot be had: what it
/// takes would not be recorded.
#[derive(Clone)]
pub struct Device {
    device: wgpu::Device,
    watch: Arc<Watch>,
}

/// A wrapper of [`wgpu::Queue`], as [`Device`] is of the device.
#[derive(Clone)]
pub struct Queue {
    queue: wgpu::Queue,
    watch: Arc<Watch>,
}

/// Methods that upload nothing.
macro_rules! pass_on {
    (
        $inner:ident: $wrapped:ident;
        $($(#[$about:meta])* $name:ident($($argument:ident: $type:ty),*) $(-> $answer:ty)?;)*
    ) => {
        impl $wrapped {$(
            #[doc = concat!("As [`wgpu::", stringify!($wrapped), "::", stringify!($name), "`].")]
            $(#[$about])*
            pub fn $name(&self, $($argument: $type),*) $(-> $answer)? {
                self.$inner.$name($($argument),*)
            }
        )*}
    };
}

pass_on! { device: Device;
    ///
    /// # Errors
    /// When the work that is waited for is not done in time, or was never submitted.
    poll(poll_type: wgpu::PollType) -> Result<wgpu::PollStatus, wgpu::PollError>;
    features() -> wgpu::Features;
    limits() -> wgpu::Limits;
    adapter_info() -> wgpu::AdapterInfo;
    create_command_encoder(desc: &wgpu::CommandEncoderDescriptor) -> wgpu::CommandEncoder;
    create_bind_group(desc: &wgpu::BindGroupDescriptor) -> wgpu::BindGroup;
    create_bind_group_layout(desc: &wgpu::BindGroupLayoutDescriptor) -> wgpu::BindGroupLayout;
    create_pipeline_layout(desc: &wgpu::PipelineLayoutDescriptor) -> wgpu::PipelineLayout;
    create_compute_pipeline(desc: &wgpu::ComputePipelineDescriptor) -> wgpu::ComputePipeline;
    create_sampler(desc: &wgpu::SamplerDescriptor) -> wgpu::Sampler;
    create_query_set(desc: &wgpu::QuerySetDescriptor) -> wgpu::QuerySet;
    push_error_scope(filter: wgpu::ErrorFilter) -> wgpu::ErrorScopeGuard;
    get_internal_counters() -> wgpu::InternalCounters;
    destroy();
}

pass_on! { queue: Queue;
    submit(buffers: impl IntoIterator<Item = wgpu::CommandBuffer>) -> wgpu::SubmissionIndex;
    on_submitted_work_done(callback: impl FnOnce() + Send + 'static);
    get_timestamp_period() -> f32;
}

impl Device {
    pub(super) fn new(device: wgpu::Device, watch: &Arc<Watch>) -> Self {
        Self { device, watch: Arc::clone(watch) }
    }

    /// As [`wgpu::Device::create_render_bundle_encoder`].
    pub fn create_render_bundle_encoder<'a>(
        &'a self,
        desc: &wgpu::RenderBundleEncoderDescriptor,
    ) -> wgpu::RenderBundleEncoder<'a> {
        self.device.create_render_bundle_encoder(desc)
    }

    /// As [`wgpu::Device::create_shader_module`].
    pub fn create_shader_module(&self, desc: wgpu::ShaderModuleDescriptor) -> wgpu::ShaderModule {
        let wgpu::ShaderModuleDescriptor { label, mut source } = desc;
        if let wgpu::ShaderSource::Wgsl(text) = &mut source {
            self.watch.upload_wgsl(text);
            *text = self.watch.overrides().wgsl(text).into_owned().into();
        }
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source })
    }

    /// As [`wgpu::Device::create_render_pipeline`].
    pub fn create_render_pipeline(
        &self,
        desc: &wgpu::RenderPipelineDescriptor,
    ) -> wgpu::RenderPipeline {
        let overrides = self.watch.overrides();
        let targets: Vec<Option<wgpu::ColorTargetState>>;
        let mut desc = desc.clone();
        let takes_vertices = desc.vertex.buffers.iter().any(Option::is_some);
        if !draws_picture(&desc) {
            self.watch.maps.fetch_add(1, Relaxed);
            // A shadow map has depths alone; colors are read where surfaces are shaded later.
            if takes_vertices && desc.fragment.as_ref().is_some_and(|f| !f.targets.is_empty()) {
                self.watch.vertex_pipelines.fetch_add(1, Relaxed);
            }
            if overrides.empty_maps {
                if let Some(depth) = &mut desc.depth_stencil {
                    depth.depth_write_enabled = Some(false);
                    depth.depth_compare = Some(wgpu::CompareFunction::Never);
                }
                if let Some(fragment) = &mut desc.fragment {
                    targets = with_mask(fragment.targets, wgpu::ColorWrites::empty());
                    fragment.targets = &targets;
                }
            }
            return self.device.create_render_pipeline(&desc);
        }
        let pipelines = match takes_vertices {
            true => &self.watch.vertex_pipelines,
            false => &self.watch.vertexless_pipelines,
        };
        pipelines.fetch_add(1, Relaxed);
        let (attributes, buffers): (Vec<Vec<_>>, Vec<_>);
        match overrides.usual.as_deref().filter(|_| takes_vertices).map(exchanged) {
            Some(None) => {
                set_usual_state(&mut desc);
                if let Some(fragment) = &mut desc.fragment {
                    targets = with_mask(fragment.targets, wgpu::ColorWrites::ALL);
                    fragment.targets = &targets;
                }
            }
            Some(Some(pair)) => {
                let own = desc.vertex.buffers.iter().map(|buffer| {
                    let own = buffer.iter().flat_map(|buffer| buffer.attributes);
                    let moved = own.map(|attribute| wgpu::VertexAttribute {
                        shader_location: exchanged_location(attribute.shader_location, pair),
                        ..*attribute
                    });
                    moved.collect()
                });
                attributes = own.collect();
                let layouts = desc.vertex.buffers.iter().zip(&attributes);
                let layouts = layouts.map(|(buffer, attributes)| {
                    let layout = buffer.as_ref()?;
                    let (array_stride, step_mode) = (layout.array_stride, layout.step_mode);
                    Some(wgpu::VertexBufferLayout { array_stride, step_mode, attributes })
                });
                buffers = layouts.collect();
                desc.vertex.buffers = &buffers;
            }
            None => (),
        }
        let outlined = self.device.features().contains(wgpu::Features::POLYGON_MODE_LINE);
        if overrides.outlines && outlined {
            desc.primitive.polygon_mode = wgpu::PolygonMode::Line;
        }
        if let Some(fragment) = &mut desc.fragment
            && overrides.shown.is_some()
            && (!overrides.outlines || outlined)
        {
            fragment.entry_point = Some(SHOWN);
        }
        self.device.create_render_pipeline(&desc)
    }

    /// As [`wgpu::Device::create_texture`].
    pub fn create_texture(&self, desc: &wgpu::TextureDescriptor) -> wgpu::Texture {
        let drawn_into = desc.usage.contains(wgpu::TextureUsages::RENDER_ATTACHMENT);
        if drawn_into && desc.format == COLOR_FORMAT && desc.size.width >= WIDE {
            self.watch.picture_targets.fetch_add(1, Relaxed);
        }
        self.device.create_texture(desc)
    }

    /// As [`wgpu::Device::create_buffer`].
    pub fn create_buffer(&self, desc: &wgpu::BufferDescriptor) -> wgpu::Buffer {
        if desc.mapped_at_creation || desc.usage.contains(wgpu::BufferUsages::MAP_WRITE) {
            self.watch.upload(desc.size);
        } else if takes_values(desc.usage)
            && let Some(unset) = self.watch.unset()
        {
            // What nobody writes is zero otherwise.
            let contents = &unset.set(&vec![0; desc.size as usize]);
            let (label, usage) = (desc.label, desc.usage);
            return self.device.create_buffer_init(&BufferInitDescriptor {
                label,
                contents,
                usage,
            });
        }
        self.device.create_buffer(desc)
    }

    /// As [`DeviceExt::create_buffer_init`].
    pub fn create_buffer_init(&self, desc: &BufferInitDescriptor) -> wgpu::Buffer {
        self.watch.upload(desc.contents.len() as u64);
        if takes_values(desc.usage)
            && let Some(unset) = self.watch.unset()
        {
            let contents = &unset.set(desc.contents);
            return self.device.create_buffer_init(&BufferInitDescriptor { contents, ..*desc });
        }
        self.device.create_buffer_init(desc)
    }

    /// As [`DeviceExt::create_texture_with_data`].
    pub fn create_texture_with_data(
        &self,
        queue: &Queue,
        desc: &wgpu::TextureDescriptor,
        order: TextureDataOrder,
        data: &[u8],
    ) -> wgpu::Texture {
        self.watch.upload(data.len() as u64);
        self.device.create_texture_with_data(&queue.queue, desc, order, data)
    }
}

/// Targets of which these channels are written.
fn with_mask(
    targets: &[Option<wgpu::ColorTargetState>],
    write_mask: wgpu::ColorWrites,
) -> Vec<Option<wgpu::ColorTargetState>> {
    let own = targets.iter().cloned();
    own.map(|target| Some(wgpu::ColorTargetState { write_mask, ..target? })).collect()
}

/// Whether a pipeline draws into a picture, by the format of its colors.
fn draws_picture(desc: &wgpu::RenderPipelineDescriptor) -> bool {
    let targets = desc.fragment.as_ref().map_or(&[][..], |fragment| fragment.targets);
    targets.iter().flatten().any(|target| target.format == COLOR_FORMAT)
}

impl Queue {
    pub(super) fn new(queue: wgpu::Queue, watch: &Arc<Watch>) -> Self {
        Self { queue, watch: Arc::clone(watch) }
    }

    /// As [`wgpu::Queue::write_buffer`].
    pub fn write_buffer(&self, buffer: &wgpu::Buffer, offset: u64, data: &[u8]) {
        match takes_values(buffer.usage()).then(|| self.watch.unset()).flatten() {
            Some(unset) => self.write_exactly(buffer, offset, &unset.set(data)),
            None => self.write_exactly(buffer, offset, data),
        }
    }

    /// The same, whatever the host asks for.
    pub(super) fn write_exactly(&self, buffer: &wgpu::Buffer, offset: u64, data: &[u8]) {
        self.watch.upload(data.len() as u64);
        self.queue.write_buffer(buffer, offset, data);
    }

    /// As [`wgpu::Queue::write_buffer_with`].
    pub fn write_buffer_with(
        &self,
        buffer: &wgpu::Buffer,
        offset: u64,
        size: wgpu::BufferSize,
    ) -> Option<wgpu::QueueWriteBufferView> {
        self.watch.upload(size.get());
        self.queue.write_buffer_with(buffer, offset, size)
    }

    /// As [`wgpu::Queue::write_texture`].
    pub fn write_texture(
        &self,
        texture: wgpu::TexelCopyTextureInfo<'_>,
        data: &[u8],
        data_layout: wgpu::TexelCopyBufferLayout,
        size: wgpu::Extent3d,
    ) {
        self.watch.upload(data.len() as u64);
        self.queue.write_texture(texture, data, data_layout, size);
    }
}
