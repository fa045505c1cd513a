//! The picture that is drawn into, and reading it back.

use glam::Vec3;

use super::{COLOR_FORMAT, DEPTH_FORMAT, Gpu};
use crate::{Error, Image, Result};

/// Bytes of a pixel in [`COLOR_FORMAT`].
const PIXEL_SIZE: u64 = 16;

/// A color image (Rgba32Float, linear) with depth (Depth32Float) to draw into.
pub struct Target {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    color: wgpu::Texture,
    color_view: wgpu::TextureView,
    depth_view: wgpu::TextureView,
}

impl Target {
    /// Makes a target.
    ///
    /// # Errors
    /// When it has no pixel, or the device cannot hold it.
    pub fn new(gpu: &Gpu, width: usize, height: usize) -> Result<Self> {
        let limits = gpu.device.limits();
        let side = limits.max_texture_dimension_2d as usize;
        let bytes = padded_row(width).saturating_mul(height as u64);
        if !(1..=side).contains(&width)
            || !(1..=side).contains(&height)
            || bytes > limits.max_buffer_size
        {
            return Err(Error::Argument(format!(
                "target is {width}x{height} but \"{}\" can draw 1 to {side} pixels in each \
                 direction and {} MiB in all",
                gpu.adapter.name,
                limits.max_buffer_size >> 20
            )));
        }
        gpu.checked(&mut || {
            let texture = |name, format, usage| {
                gpu.device.create_texture(&wgpu::TextureDescriptor {
                    label: Some(name),
                    size: extent(width, height),
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
                    view_formats: &[],
                })
            };
            let color = texture("target colour", COLOR_FORMAT, wgpu::TextureUsages::COPY_SRC);
            let depth = texture("target depth", DEPTH_FORMAT, wgpu::TextureUsages::empty());
            let color_view = color.create_view(&wgpu::TextureViewDescriptor::default());
            let depth_view = depth.create_view(&wgpu::TextureViewDescriptor::default());
            Ok(Self { width, height, color, color_view, depth_view })
        })
    }

    /// Begins to draw: colors are cleared to black (alpha 1), depths to the farthest.
    pub fn begin<'e>(&self, encoder: &'e mut wgpu::CommandEncoder) -> wgpu::RenderPass<'e> {
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("target"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &self.color_view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(depth_attachment(&self.depth_view)),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        })
    }

    /// Reads the colors back: linear radiance [W m^-2 sr^-1], row-major, row 0 on top.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn read_back(&self, gpu: &Gpu) -> Result<Image> {
        gpu.checked(&mut || self.copy_out(gpu))
    }

    fn copy_out(&self, gpu: &Gpu) -> Result<Image> {
        let row = padded_row(self.width);
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read-back"),
            size: row * self.height as u64,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = gpu.encoder();
        encoder.copy_texture_to_buffer(
            self.color.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row as u32),
                    rows_per_image: None,
                },
            },
            extent(self.width, self.height),
        );
        gpu.submit(encoder);
        let (sender, receiver) = std::sync::mpsc::channel();
        buffer.slice(..).map_async(wgpu::MapMode::Read, move |mapped| {
            // Nobody listens any more when the wait below has failed.
            let _ = sender.send(mapped);
        });
        gpu.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|error| gpu.lost(&error.to_string()))?;
        match receiver.try_recv() {
            Ok(Ok(())) => {}
            _ => return Err(gpu.lost("its image cannot be read back")),
        }
        let bytes =
            buffer.slice(..).get_mapped_range().map_err(|error| gpu.lost(&error.to_string()))?;
        let mut image = Image::new(self.width, self.height);
        let rows = bytes.chunks_exact(row as usize).zip(image.pixels.chunks_exact_mut(self.width));
        for (bytes, pixels) in rows {
            let (values, _) = bytes.as_chunks::<4>();
            let (values, _) = values.as_chunks::<4>();
            for (rgba, pixel) in values.iter().zip(pixels) {
                let [r, g, b, _] = rgba.map(f32::from_le_bytes);
                *pixel = Vec3::new(r, g, b);
            }
        }
        Ok(image)
    }
}

/// A depth attachment that is cleared to the farthest depth and kept.
pub(super) fn depth_attachment(
    view: &wgpu::TextureView,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations {
            load: wgpu::LoadOp::Clear(1.0),
            store: wgpu::StoreOp::Store,
        }),
        stencil_ops: None,
    }
}

/// Bytes of a row of pixels in a buffer: devices want them in multiples of 256.
fn padded_row(width: usize) -> u64 {
    (width as u64 * PIXEL_SIZE).next_multiple_of(u64::from(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT))
}

fn extent(width: usize, height: usize) -> wgpu::Extent3d {
    wgpu::Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 }
}
