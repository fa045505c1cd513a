//! Realtime frames: the renderer's pass, opened, drawn, read and closed.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::status::{forget, guard, guard_noting};
use super::{Loaded, api, expect_floats, text};
use crate::gpu::{AdapterKind, Footprint, Gpu, MATRICES, NEGATED_NORMALS, RenderPass, Target};
use crate::realtime::Realtime;
use crate::{Camera, CameraConfig, Error, Matrices, Result, Vec3};

/// What an [`api::Pass`] points to. Fields are dropped in order: the device goes last.
struct OpenPass {
    pass: Box<dyn RenderPass>,
    target: Target,
    gpu: Gpu,
    /// The kind and name of adapter that the device was opened with.
    adapter: (AdapterKind, String),
    realtime: Realtime,
    /// What making the pass handed to the device.
    opening: Footprint,
    /// What the camera of a frame gives as its matrices.
    matrices: Matrices,
}

pub unsafe extern "C" fn open_realtime(
    scene: api::Scene,
    settings: *const api::RealtimeSettings,
    pass: *mut api::Pass,
    message: *mut api::Message,
) -> api::Status {
    guard(message, || {
        // SAFETY: a live scene of ours, valid settings with `stage_count` stages.
        let (loaded, settings, stages) = unsafe {
            let settings = &*settings;
            let stages: &[api::StageText] = match settings.stage_count {
                0 => &[],
                count => std::slice::from_raw_parts(settings.stages, count),
            };
            (&*scene.cast::<Loaded>(), settings, stages)
        };
        // SAFETY: texts of the host's, valid during the call.
        let adapter_name = unsafe { text(&settings.adapter_name)? };
        let mut replaced = Vec::new();
        for stage in stages {
            // SAFETY: as above.
            let (name, source) = unsafe { (text(&stage.name)?, text(&stage.source)?) };
            replaced.push((name.to_owned(), source.to_owned()));
        }
        let opened = Box::new(OpenPass::new(loaded, settings, adapter_name, replaced)?);
        // SAFETY: the host's place for the handle.
        unsafe { *pass = Box::into_raw(opened).cast() };
        Ok(())
    })
}

impl OpenPass {
    /// Makes the renderer's pass on a device of its own. `replaced` are names and texts: of the stages, and of what
    /// else the host asks for.
    fn new(
        loaded: &Loaded,
        settings: &api::RealtimeSettings,
        adapter_name: &str,
        replaced: Vec<(String, String)>,
    ) -> Result<Self> {
        let adapter_kind = match settings.adapter_kind {
            api::ADAPTER_SOFTWARE => AdapterKind::Software,
            api::ADAPTER_HARDWARE => AdapterKind::Hardware,
            _ => AdapterKind::Any,
        };
        let realtime = Realtime::begin();
        let mut gpu = Gpu::reopen(adapter_kind, adapter_name)?;
        let asked = replaced.iter().find(|(name, _)| name == MATRICES).map(|(_, text)| text);
        let is_asked =
            |matrices: &Matrices| asked.is_some_and(|text| *text == format!("{matrices:?}"));
        let matrices = Matrices::ALL.into_iter().find(is_asked).unwrap_or_default();
        let negated = replaced.iter().any(|(name, _)| name == NEGATED_NORMALS);
        let negated = negated.then(|| loaded.scene.with_negated_normals());
        let scene = negated.as_ref().unwrap_or(&loaded.scene);
        gpu.replace_stages(replaced);
        let target = Target::new(&gpu, settings.width as usize, settings.height as usize)?;
        let shadow_map = settings.shadow_map != 0;
        let _ = gpu.take_footprint();
        let mut opened = None;
        gpu.checked(&mut || {
            let kind = scene.config().kind;
            opened = Some(loaded.renderer.render_pass(kind, &gpu, scene, shadow_map)?);
            Ok(())
        })?;
        realtime.without_rays()?;
        let Some(pass) = opened else {
            return Err(Error::Gpu("the render pass was not made".into()));
        };
        let adapter = (adapter_kind, adapter_name.to_owned());
        let opening = gpu.take_footprint();
        Ok(Self { pass, target, gpu, adapter, realtime, opening, matrices })
    }
}

pub unsafe extern "C" fn draw_frame(
    pass: api::Pass,
    camera: *const api::CameraValue,
    message: *mut api::Message,
) -> api::Status {
    guard_noting(message, || {
        // SAFETY: a live pass of ours and a valid camera.
        let (open, camera) = unsafe { (&mut *pass.cast::<OpenPass>(), &*camera) };
        let config = CameraConfig {
            eye: camera.eye.into(),
            at: camera.at.into(),
            up: camera.up.into(),
            fov_y_deg: camera.fov_y_deg,
        };
        let camera = Camera::new(config, open.target.width, open.target.height)?;
        let camera = camera.with_matrices(open.matrices);
        let OpenPass { pass, target, gpu, realtime, opening, .. } = open;
        let _ = gpu.take_footprint();
        gpu.checked(&mut || pass.draw(gpu, &camera, target))?;
        realtime.without_rays()?;
        Ok(opening.and(gpu.take_footprint()).to_string())
    })
}

pub unsafe extern "C" fn read_frame(
    pass: api::Pass,
    pixels: *mut f32,
    float_count: usize,
    message: *mut api::Message,
) -> api::Status {
    guard(message, || {
        // SAFETY: a live pass of ours.
        let open = unsafe { &*pass.cast::<OpenPass>() };
        expect_floats(open.target.width, open.target.height, float_count)?;
        let image = open.target.read_back(&open.gpu)?;
        // SAFETY: the host's buffer holds `float_count` floats, three for each pixel.
        let pixels =
            unsafe { std::slice::from_raw_parts_mut(pixels.cast::<Vec3>(), image.pixels.len()) };
        pixels.copy_from_slice(&image.pixels);
        Ok(())
    })
}

pub unsafe extern "C" fn close_realtime(pass: api::Pass) {
    // SAFETY: the host hands back what `open_realtime` gave, once.
    let open = unsafe { Box::from_raw(pass.cast::<OpenPass>()) };
    // A panic in a student's `drop` must not cross the boundary; the device goes with it.
    let dropped = catch_unwind(AssertUnwindSafe(|| {
        let OpenPass { pass, target, gpu, adapter: (kind, name), realtime: _realtime, .. } = *open;
        drop((pass, target));
        gpu.keep(kind, &name);
    }));
    dropped.unwrap_or_else(forget);
}
