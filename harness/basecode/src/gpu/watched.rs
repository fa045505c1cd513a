//! Device and queue as render passes get them: wgpu's own, with a look at what a frame is made of.
//!
//! Nothing is refused here. The host asks how much was uploaded for a frame, and may have every
//! fragment drawn by an entry point of its own, whatever pipelines a renderer makes: what is drawn
//! then shows which surfaces there are.

use std::ops::Deref;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use wgpu::util::{BufferInitDescriptor, DeviceExt, TextureDataOrder};

/// Name of the entry point that the host's [`Watch::show`] must define.
pub(super) const SHOWN: &str = "umbra_shown";

/// What device and queue know together.
#[derive(Default)]
pub(super) struct Watch {
    /// Bytes that the CPU handed to the device.
    uploaded: AtomicU64,
    /// WGSL with the entry point [`SHOWN`] that all fragments are drawn by.
    shown: Mutex<Option<String>>,
}

impl Watch {
    /// Has all fragments drawn by the entry point in `wgsl`, from the next module on; or none.
    pub(super) fn show(&self, wgsl: Option<String>) {
        if let Ok(mut shown) = self.shown.lock() {
            *shown = wgsl;
        }
    }

    /// Bytes uploaded since the last call.
    pub(super) fn take_uploaded(&self) -> u64 {
        self.uploaded.swap(0, Ordering::Relaxed)
    }

    fn upload(&self, bytes: u64) {
        self.uploaded.fetch_add(bytes, Ordering::Relaxed);
    }

    fn shown(&self) -> Option<String> {
        self.shown.lock().ok().and_then(|shown| shown.clone())
    }
}

/// [`wgpu::Device`], which it stands for wherever one is wanted.
pub struct Device {
    device: wgpu::Device,
    watch: Arc<Watch>,
}

/// [`wgpu::Queue`], which it stands for wherever one is wanted.
pub struct Queue {
    queue: wgpu::Queue,
    watch: Arc<Watch>,
}

impl Deref for Device {
    type Target = wgpu::Device;

    fn deref(&self) -> &wgpu::Device {
        &self.device
    }
}

impl Deref for Queue {
    type Target = wgpu::Queue;

    fn deref(&self) -> &wgpu::Queue {
        &self.queue
    }
}

impl Device {
    pub(super) fn new(device: wgpu::Device, watch: &Arc<Watch>) -> Self {
        Self { device, watch: Arc::clone(watch) }
    }

    /// As [`wgpu::Device::create_shader_module`].
    pub fn create_shader_module(&self, desc: wgpu::ShaderModuleDescriptor) -> wgpu::ShaderModule {
        let wgpu::ShaderModuleDescriptor { label, source } = desc;
        let source = match (source, self.watch.shown()) {
            (wgpu::ShaderSource::Wgsl(text), Some(shown)) => {
                wgpu::ShaderSource::Wgsl(format!("{text}\n{shown}\n").into())
            }
            (source, _) => source,
        };
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source })
    }

    /// As [`wgpu::Device::create_render_pipeline`].
    pub fn create_render_pipeline(
        &self,
        desc: &wgpu::RenderPipelineDescriptor,
    ) -> wgpu::RenderPipeline {
        let mut desc = desc.clone();
        if let Some(fragment) = desc.fragment.as_mut().filter(|_| self.watch.shown().is_some()) {
            fragment.entry_point = Some(SHOWN);
        }
        self.device.create_render_pipeline(&desc)
    }

    /// As [`wgpu::Device::create_buffer`].
    pub fn create_buffer(&self, desc: &wgpu::BufferDescriptor) -> wgpu::Buffer {
        if desc.mapped_at_creation || desc.usage.contains(wgpu::BufferUsages::MAP_WRITE) {
            self.watch.upload(desc.size);
        }
        self.device.create_buffer(desc)
    }

    /// As [`DeviceExt::create_buffer_init`].
    pub fn create_buffer_init(&self, desc: &BufferInitDescriptor) -> wgpu::Buffer {
        self.watch.upload(desc.contents.len() as u64);
        self.device.create_buffer_init(desc)
    }

    /// As [`DeviceExt::create_texture_with_data`].
    pub fn create_texture_with_data(
        &self,
        queue: &wgpu::Queue,
        desc: &wgpu::TextureDescriptor,
        order: TextureDataOrder,
        data: &[u8],
    ) -> wgpu::Texture {
        self.watch.upload(data.len() as u64);
        self.device.create_texture_with_data(queue, desc, order, data)
    }
}

impl Queue {
    pub(super) fn new(queue: wgpu::Queue, watch: &Arc<Watch>) -> Self {
        Self { queue, watch: Arc::clone(watch) }
    }

    /// As [`wgpu::Queue::write_buffer`].
    pub fn write_buffer(&self, buffer: &wgpu::Buffer, offset: u64, data: &[u8]) {
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
