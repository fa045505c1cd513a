//! The graphics device: which adapter, and what went wrong.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use super::device::{Footprint, Overrides, Watch};
use super::made_pipelines::MadePipelines;
use super::message::readable;
use super::{
    Device, EDITED_LINE, EMPTY_MAPS, EVERY_FRAGMENT, FrameUniforms, Layouts, NOTHING_UNSET,
    OUTLINES, Queue, USUAL_PIPELINES,
};
use crate::{Error, Result};

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
    pub device: Device,
    /// Takes commands.
    pub queue: Queue,
    /// What draws.
    pub adapter: wgpu::AdapterInfo,
    /// The bind group layouts of the shader contract.
    pub layouts: Layouts,
    stages: Vec<(String, String)>,
    pub(super) pipelines: MadePipelines,
    /// Bodies of [`Gpu::checked`] that were begun and did not end well.
    unfinished: AtomicUsize,
    trouble: Arc<Mutex<Trouble>>,
    pub(super) watch: Arc<Watch>,
}

/// Errors that the graphics library reports outside of any call.
#[derive(Default)]
struct Trouble {
    /// Why the device was lost, once it is.
    lost: Option<String>,
    /// The first error that no scope caught.
    uncaught: Option<wgpu::Error>,
}

/// The device that was kept, with the kind and name of adapter that it was opened with.
static KEPT: Mutex<Option<((AdapterKind, String), Gpu)>> = Mutex::new(None);

/// The one graphics interface to use here. Never GL: on software adapters it has no float targets.
const BACKEND: wgpu::Backends = if cfg!(target_vendor = "apple") {
    wgpu::Backends::METAL
} else if cfg!(windows) {
    wgpu::Backends::DX12
} else {
    wgpu::Backends::VULKAN
};

/// What to do about a missing adapter.
const HINT: &str = if cfg!(target_os = "linux") {
    "install a Vulkan driver; on Debian and Ubuntu the software one is in the packages \
     mesa-vulkan-drivers and libvulkan1"
} else {
    "install the graphics driver of this machine"
};

impl Gpu {
    /// Opens an adapter of `kind` whose name holds `name` (any case; empty accepts all).
    ///
    /// # Errors
    /// [`Error::NoAdapter`] when none fits; it names those there are and what to install.
    pub fn open(kind: AdapterKind, name: &str) -> Result<Self> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: BACKEND,
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let mut adapters = pollster::block_on(instance.enumerate_adapters(BACKEND));
        adapters.sort_by_key(|adapter| rank(adapter.get_info().device_type));
        let fits = |info: &wgpu::AdapterInfo| {
            let software = info.device_type == wgpu::DeviceType::Cpu;
            let kind_fits = match kind {
                AdapterKind::Any => true,
                AdapterKind::Software => software,
                AdapterKind::Hardware => !software,
            };
            kind_fits && info.name.to_lowercase().contains(&name.to_lowercase())
        };
        let Some(adapter) = adapters.iter().find(|adapter| fits(&adapter.get_info())) else {
            let found: Vec<_> = adapters.iter().map(|adapter| adapter.get_info()).collect();
            return Err(no_adapter(kind, name, &found));
        };
        let info = adapter.get_info();
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("umbra"),
            required_features: adapter.features() & wgpu::Features::POLYGON_MODE_LINE,
            // Large films need more than the defaults; take all that the adapter has.
            required_limits: adapter.limits(),
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..wgpu::DeviceDescriptor::default()
        }))
        .map_err(|error| Error::NoAdapter(format!("cannot open \"{}\": {error}", info.name)))?;
        let trouble = Arc::new(Mutex::new(Trouble::default()));
        let shared = Arc::clone(&trouble);
        device.set_device_lost_callback(move |_, why| {
            if let Ok(mut trouble) = shared.lock() {
                trouble.lost.get_or_insert(why);
            }
        });
        let shared = Arc::clone(&trouble);
        // Without a handler of ours, wgpu panics.
        device.on_uncaptured_error(Arc::new(move |error| {
            if let Ok(mut trouble) = shared.lock() {
                trouble.uncaught.get_or_insert(error);
            }
        }));
        let layouts = Layouts::new(&device);
        let (stages, unfinished) = (Vec::new(), AtomicUsize::new(0));
        let pipelines = MadePipelines::default();
        let watch = Arc::new(Watch::default());
        let (device, queue) = (Device::new(device, &watch), Queue::new(queue, &watch));
        let adapter = info;
        Ok(Self { device, queue, adapter, layouts, stages, pipelines, unfinished, trouble, watch })
    }

    /// As [`Gpu::open`], but takes a device of this process that was [kept](Gpu::keep).
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn reopen(kind: AdapterKind, name: &str) -> Result<Self> {
        let kept = KEPT.lock().ok().and_then(|mut kept| kept.take());
        match kept {
            Some((of, gpu)) if of == (kind, name.to_owned()) => Ok(gpu),
            _ => Self::open(kind, name),
        }
    }

    /// Keeps a device for the next [`Gpu::reopen`] of the same `kind` and `name`, for opening one
    /// costs more than a small frame. A device on which anything went wrong is closed instead, so that its errors do
    /// not reach the next pass.
    pub fn keep(mut self, kind: AdapterKind, name: &str) {
        // What happened since the last check comes to light here.
        let polled = self.device.poll(wgpu::PollType::Poll).is_ok();
        let untroubled =
            self.trouble.lock().is_ok_and(|it| it.lost.is_none() && it.uncaught.is_none());
        if polled && untroubled && *self.unfinished.get_mut() == 0 {
            self.replace_stages(Vec::new());
            if let Ok(mut kept) = KEPT.lock() {
                *kept = Some(((kind, name.to_owned()), self));
            }
        }
    }

    /// Replaces the text of shader stages, by stage name (`simple.vs`, `diffuse.fs`, `phong.fs`).
    /// [`EVERY_FRAGMENT`], [`OUTLINES`], [`EMPTY_MAPS`], [`USUAL_PIPELINES`] and [`EDITED_LINE`] change modules and
    /// pipelines that are made from then on, and [`NOTHING_UNSET`] what is written to buffers.
    pub fn replace_stages(&mut self, stages: Vec<(String, String)>) {
        let find = |wanted: &str| stages.iter().find(|(name, _)| name == wanted);
        self.watch.set_overrides(Overrides {
            shown: find(EVERY_FRAGMENT).map(|(_, text)| text.clone()),
            outlines: find(OUTLINES).is_some(),
            empty_maps: find(EMPTY_MAPS).is_some(),
            usual: find(USUAL_PIPELINES).map(|(_, text)| text.clone()),
            edited: find(EDITED_LINE).map(|(_, text)| text.clone()),
            nothing_unset: find(NOTHING_UNSET).map(|(_, text)| text.clone()),
        });
        self.stages = stages;
    }

    /// The text of a stage: the host's replacement, or else the renderer's `own`; without the
    /// byte-order mark that some editors put first and WGSL does not know.
    pub fn stage<'a>(&'a self, name: &str, own: &'a str) -> &'a str {
        let replaced = self.stages.iter().find(|(stage, _)| stage == name);
        let text = replaced.map_or(own, |(_, text)| text);
        text.strip_prefix('\u{feff}').unwrap_or(text)
    }

    /// A frame's uniforms, with the light in its place if it has none and the host asks for [`NOTHING_UNSET`].
    pub(super) fn nothing_unset(&self, values: &FrameUniforms) -> FrameUniforms {
        match self.watch.unset().and_then(|unset| unset.light) {
            Some(light) if values.light_position.truncate() == glam::Vec3::ZERO => {
                FrameUniforms { light_position: light.extend(1.0), ..*values }
            }
            _ => *values,
        }
    }

    /// What was handed to the device since the last call.
    pub fn take_footprint(&self) -> Footprint {
        self.watch.take_footprint()
    }

    /// Begins to record commands.
    pub fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Ends the recording and hands the commands to the device.
    pub fn submit(&self, encoder: wgpu::CommandEncoder) {
        self.queue.submit([encoder.finish()]);
    }

    /// Runs `body` and reports what the graphics library found wrong with it.
    ///
    /// # Errors
    /// The body's own error, or else [`Error::NoAdapter`] when the device was lost, or else
    /// [`Error::Gpu`] with the library's message: for a shader it holds the line of WGSL.
    ///
    /// # Panics
    /// When the body does. If the graphics library panics because of an error that it found before, that error is
    /// returned instead.
    pub fn checked<T>(&self, body: &mut dyn FnMut() -> Result<T>) -> Result<T> {
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        self.unfinished.fetch_add(1, Ordering::Relaxed);
        let answer = catch_unwind(AssertUnwindSafe(&mut *body));
        // An error that poll itself finds is a lost device, which the callback reports.
        let _ = self.device.poll(wgpu::PollType::Poll);
        // Scopes end in reverse order. The first error is the cause: what follows uses its debris.
        let internal = pollster::block_on(internal.pop());
        let memory = pollster::block_on(memory.pop());
        let validation = pollster::block_on(validation.pop());
        let (lost, uncaught) = match self.trouble.lock() {
            Ok(mut trouble) => (trouble.lost.clone(), trouble.uncaught.take()),
            Err(_) => (Some("an error handler panicked".to_owned()), None),
        };
        let found = memory.or(internal).or(validation).or(uncaught);
        let value = match answer {
            Ok(answer) => Ok(answer?),
            Err(panic) if found.is_none() || !is_of_wgpu(&*panic) => resume_unwind(panic),
            Err(_) => Err(Error::Gpu(String::new())),
        };
        if let Some(why) = lost {
            return Err(self.lost(&why));
        }
        match found {
            None => {
                self.unfinished.fetch_sub(1, Ordering::Relaxed);
                value
            }
            Some(wgpu::Error::OutOfMemory { .. }) => Err(Error::Gpu(format!(
                "the graphics device \"{}\" is out of memory",
                self.adapter.name
            ))),
            Some(error) => Err(Error::Gpu(readable(&error.to_string()))),
        }
    }

    /// The error for a device that was lost.
    pub(super) fn lost(&self, why: &str) -> Error {
        Error::NoAdapter(format!("the graphics device \"{}\" was lost: {why}", self.adapter.name))
    }
}

/// Whether the graphics library panicked, as it does on an error in a render bundle.
fn is_of_wgpu(panic: &(dyn Any + Send)) -> bool {
    panic.downcast_ref::<String>().is_some_and(|said| said.starts_with("Error in "))
}

/// Adapters in the order of preference.
fn rank(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

fn words(kind: wgpu::DeviceType) -> &'static str {
    match kind {
        wgpu::DeviceType::DiscreteGpu => "discrete GPU",
        wgpu::DeviceType::IntegratedGpu => "integrated GPU",
        wgpu::DeviceType::VirtualGpu => "virtual GPU",
        wgpu::DeviceType::Other => "other",
        wgpu::DeviceType::Cpu => "CPU",
    }
}

fn no_adapter(kind: AdapterKind, name: &str, found: &[wgpu::AdapterInfo]) -> Error {
    let wanted = match kind {
        AdapterKind::Any => "graphics adapter",
        AdapterKind::Software => "software graphics adapter",
        AdapterKind::Hardware => "hardware graphics adapter",
    };
    let named = if name.is_empty() { String::new() } else { format!(" named like \"{name}\"") };
    let found: Vec<_> = found
        .iter()
        .map(|info| format!("\"{}\" ({})", info.name, words(info.device_type)))
        .collect();
    let found = if found.is_empty() { "none".to_owned() } else { found.join(", ") };
    Error::NoAdapter(format!("no {wanted}{named} on this machine; found {found}; {HINT}"))
}

/// Needs a graphics adapter, as `tests/gpu.rs` does; what tells two devices apart is not public.
#[cfg(test)]
mod tests {
    use super::super::{Stage, Target};
    use super::*;

    const KIND: AdapterKind = AdapterKind::Any;
    const NONSENSE: Stage = Stage { name: "diffuse.fs", text: "no WGSL" };

    fn reopen() -> Gpu {
        Gpu::reopen(KIND, "").unwrap()
    }

    /// Gives a device back, and says whether the next one is the same.
    fn is_kept(gpu: Gpu) -> bool {
        let trouble = Arc::clone(&gpu.trouble);
        gpu.keep(KIND, "");
        Arc::ptr_eq(&trouble, &reopen().trouble)
    }

    #[test]
    fn a_pipeline_is_made_once_and_counted_each_time() {
        let text = "@vertex fn vs_main(@location(0) p: vec3f) -> @builtin(position) vec4f { return vec4f(p, 1.0); }";
        let vertex = Stage { name: "simple.vs", text };
        let white = "@fragment fn fs_main() -> @location(0) vec4f { return vec4f(1.0); }";
        let fragment = Stage { name: "diffuse.fs", text: white };
        let mut gpu = reopen();
        let first = gpu.pipeline(vertex, fragment);
        let depth = gpu.depth_pipeline(vertex);
        gpu.take_footprint();
        assert!(gpu.pipeline(vertex, fragment) == first && gpu.depth_pipeline(vertex) == depth);
        let footprint = gpu.take_footprint();
        assert_eq!((footprint.vertex_pipelines, footprint.maps), (1, 1));
        // What the host changes makes others.
        let black = white.replace("1.0", "0.0");
        for (name, text) in [("diffuse.fs", black.as_str()), (EMPTY_MAPS, "")] {
            gpu.replace_stages(vec![(name.into(), text.into())]);
            assert!(gpu.pipeline(vertex, fragment) != first, "{name}");
        }
        let edit = format!("{white}\n{black}");
        gpu.replace_stages(vec![(EDITED_LINE.into(), edit)]);
        assert!(gpu.pipeline(vertex, fragment) != first && gpu.depth_pipeline(vertex) == depth);
        gpu.replace_stages(Vec::new());
        assert!(gpu.pipeline(vertex, fragment) == first);
    }

    #[test]
    fn a_device_is_kept_only_while_nothing_is_wrong_with_it() {
        let gpu = reopen();
        Target::new(&gpu, 4, 4).unwrap().read_back(&gpu).unwrap();
        assert!(is_kept(gpu), "all was well");
        let mut gpu = reopen();
        gpu.replace_stages(vec![("diffuse.fs".into(), "another's".into())]);
        gpu.keep(KIND, "");
        assert_eq!(reopen().stage("diffuse.fs", "own"), "own");

        let gpu = reopen();
        let refused = gpu.checked(&mut || {
            drop(gpu.pipeline(NONSENSE, NONSENSE));
            Ok(())
        });
        assert!(refused.is_err());
        assert!(!is_kept(gpu), "a check found an error");
        let gpu = reopen();
        drop(gpu.pipeline(NONSENSE, NONSENSE));
        assert!(!is_kept(gpu), "an error that no check saw");
        let gpu = reopen();
        let panics = || gpu.checked::<()>(&mut || panic!("not written"));
        assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(panics)).is_err());
        assert!(!is_kept(gpu), "a check did not end");
        // The library panics where a bundle is made of what it refused: the first error is told.
        let gpu = reopen();
        let bundled = gpu.checked(&mut || {
            let pipeline = gpu.pipeline(NONSENSE, NONSENSE);
            let mut bundle =
                gpu.device.create_render_bundle_encoder(&wgpu::RenderBundleEncoderDescriptor {
                    color_formats: &[Some(wgpu::TextureFormat::Rgba32Float)],
                    sample_count: 1,
                    ..Default::default()
                });
            bundle.set_pipeline(&pipeline);
            bundle.draw(0..3, 0..1);
            bundle.finish(&wgpu::RenderBundleDescriptor::default());
            Ok(())
        });
        assert!(bundled.is_err_and(|error| error.to_string().contains("no WGSL")));
        let gpu = reopen();
        gpu.device.destroy();
        assert!(!is_kept(gpu), "the device was lost");
    }
}
