//! Offscreen drawing with wgpu: the adapter, the target, and what `docs/shader_contract.md` fixes.

use crate::{Camera, Error, Image, Result};

/// Which kind of adapter to draw with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdapterKind {
    /// Hardware when there is some, software otherwise.
    Any,
    /// A software adapter only (Mesa's lavapipe on Linux).
    Software,
    /// A hardware adapter only.
    Hardware,
}

/// An open graphics device.
pub struct Gpu {
    /// Creates resources.
    pub device: wgpu::Device,
    /// Takes commands.
    pub queue: wgpu::Queue,
    /// What draws.
    pub adapter: wgpu::AdapterInfo,
    stages: Vec<(String, String)>,
}

impl Gpu {
    /// Opens an adapter of `kind` whose name holds `name` (any case; empty accepts all).
    ///
    /// # Errors
    /// [`Error::NoAdapter`] when none fits.
    pub fn open(kind: AdapterKind, name: &str) -> Result<Self> {
        let _ = (kind, name);
        Err(Error::NoAdapter("drawing is not written yet".into()))
    }

    /// Replaces the text of shader stages, by stage name (`simple.vs`, `diffuse.fs`, `phong.fs`).
    pub fn replace_stages(&mut self, stages: Vec<(String, String)>) {
        self.stages = stages;
    }

    /// The text of a stage: the host's replacement, or else the renderer's `own`.
    pub fn stage<'a>(&'a self, name: &str, own: &'a str) -> &'a str {
        self.stages.iter().find(|(stage, _)| stage == name).map_or(own, |(_, text)| text)
    }

    /// Runs `body` and reports what the graphics library found wrong with it.
    ///
    /// # Errors
    /// [`Error::Gpu`] with the library's message, or the body's own error.
    pub fn checked<T>(&self, body: &mut dyn FnMut() -> Result<T>) -> Result<T> {
        body()
    }
}

/// A colour image (Rgba32Float, linear) with depth (Depth32Float) to draw into.
pub struct Target {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
}

impl Target {
    /// Makes a target.
    ///
    /// # Errors
    /// When the device cannot hold it.
    pub fn new(gpu: &Gpu, width: usize, height: usize) -> Result<Self> {
        let _ = gpu;
        Ok(Self { width, height })
    }

    /// Reads the colours back.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn read_back(&self, gpu: &Gpu) -> Result<Image> {
        let _ = gpu;
        Ok(Image::new(self.width, self.height))
    }
}

/// A realtime renderer of one scene, made by [`crate::Renderer::render_pass`].
pub trait RenderPass {
    /// Draws one frame of the scene as `camera` sees it, over whatever `target` held.
    ///
    /// # Errors
    /// When the graphics library refuses a command.
    fn draw(&mut self, gpu: &Gpu, camera: &Camera, target: &Target) -> Result<()>;
}
