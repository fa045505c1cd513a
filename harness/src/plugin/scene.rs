//! Scenes and realtime passes of a plugin.

use std::ptr::{null, null_mut};

use basecode::gpu::Footprint;
use renderer_api as api;

use super::{CHECKED, CallError, WitnessState, call, call_noted, handle};

/// A scene that a plugin loaded; unloaded when dropped.
pub struct LoadedScene<'p> {
    table: &'p api::Plugin,
    scene: api::Scene,
}

/// How to render an image offline; the callback is told finished and total rows, from any thread.
pub struct OfflineJob<'a> {
    /// Film width in pixels.
    pub width: u32,
    /// Film height in pixels.
    pub height: u32,
    /// Samples per pixel.
    pub spp: u32,
    /// Threads to render with.
    pub threads: u32,
    /// Seed of every sampler.
    pub seed: u64,
    /// Whether occluders cast shadows.
    pub shadows: bool,
    /// Told finished and total rows.
    pub progress: &'a (dyn Fn(u32, u32) + Sync),
}

/// How to open a realtime pass.
pub struct RealtimeJob<'a> {
    /// Film width in pixels.
    pub width: u32,
    /// Film height in pixels.
    pub height: u32,
    /// Whether to draw shadows (the bonus).
    pub shadow_map: bool,
    /// One of the `api::ADAPTER_*` values.
    pub adapter_kind: u32,
    /// Part of the adapter's name; empty accepts any.
    pub adapter_name: &'a str,
    /// Names and WGSL texts of the stages to replace.
    pub stages: &'a [(&'a str, &'a str)],
}

impl<'p> LoadedScene<'p> {
    pub(super) fn load(
        table: &'p api::Plugin,
        path: &str,
        options: &str,
    ) -> Result<Self, CallError> {
        let request =
            api::SceneRequest { path: api::Text::new(path), options: api::Text::new(options) };
        let mut scene = null_mut();
        let load = table.load_scene.expect(CHECKED);
        // SAFETY: the request's texts outlive the call, and `scene` is a valid place.
        call(|message| unsafe { load(&request, &mut scene, message) })?;
        Ok(Self { table, scene: handle(scene, "scene")? })
    }

    /// Evaluates BSDFs; `values` holds three floats a query (cosine included) [sr^-1].
    ///
    /// # Errors
    /// What the plugin answers.
    ///
    /// # Panics
    /// When `values` has another size.
    pub fn eval_bsdf(
        &self,
        queries: &[api::BsdfQuery],
        values: &mut [f32],
    ) -> Result<(), CallError> {
        assert_eq!(values.len(), 3 * queries.len(), "three floats a query");
        let eval = self.table.eval_bsdf.expect(CHECKED);
        let (count, values) = (queries.len(), values.as_mut_ptr());
        // SAFETY: a live scene; both buffers have the promised size and outlive the call.
        call(|message| unsafe { eval(self.scene, queries.as_ptr(), count, values, message) })
    }

    /// Radiance along rays into `values`, three floats a ray [W m^-2 sr^-1]. With a witness, it
    /// replaces every BSDF during this call.
    ///
    /// # Errors
    /// What the plugin answers.
    ///
    /// # Panics
    /// When `values` has another size.
    pub fn radiance(
        &mut self,
        settings: &api::RadianceSettings,
        witness: Option<&WitnessState>,
        rays: &[api::RayQuery],
        values: &mut [f32],
    ) -> Result<(), CallError> {
        assert_eq!(values.len(), 3 * rays.len(), "three floats a ray");
        let radiance = self.table.radiance.expect(CHECKED);
        let (count, values) = (rays.len(), values.as_mut_ptr());
        let table = witness.map(WitnessState::table);
        if let Some(table) = &table {
            self.set_witness(table)?;
        }
        let result = call(|message| {
            // SAFETY: a live scene; all buffers have the promised size and outlive the call.
            unsafe { radiance(self.scene, settings, rays.as_ptr(), count, values, message) }
        });
        // Also after a failure: the witness is about to go.
        let removed = if table.is_some() { self.set_witness(null()) } else { Ok(()) };
        result.and(removed)
    }

    fn set_witness(&mut self, witness: *const api::WitnessBsdf) -> Result<(), CallError> {
        let set = self.table.set_witness.expect(CHECKED);
        // SAFETY: a live scene; `radiance` keeps the witness until it is taken away.
        call(|message| unsafe { set(self.scene, witness, message) })
    }

    /// Renders offline into `pixels`, three floats a pixel, rows from the top.
    ///
    /// # Errors
    /// What the plugin answers.
    ///
    /// # Panics
    /// When `pixels` has another size.
    pub fn render_offline(
        &self,
        job: &OfflineJob<'_>,
        pixels: &mut [f32],
    ) -> Result<(), CallError> {
        assert_eq!(pixels.len(), floats(job.width, job.height), "three floats a pixel");
        unsafe extern "C" fn progress(user: *mut std::ffi::c_void, done: u32, total: u32) {
            // SAFETY: `user` is what the settings below hold, alive during the call.
            let job = unsafe { &*user.cast::<OfflineJob<'_>>() };
            (job.progress)(done, total);
        }
        let settings = api::OfflineSettings {
            width: job.width,
            height: job.height,
            spp: job.spp,
            threads: job.threads,
            seed: job.seed,
            shadows: job.shadows.into(),
            user: std::ptr::from_ref(job).cast_mut().cast(),
            progress: Some(progress),
            // The parent ends the whole worker instead.
            cancelled: None,
        };
        let render = self.table.render_offline.expect(CHECKED);
        let (count, pixels) = (pixels.len(), pixels.as_mut_ptr());
        // SAFETY: a live scene; settings, job and buffer outlive the call.
        call(|message| unsafe { render(self.scene, &settings, pixels, count, message) })
    }

    /// Opens a realtime pass.
    ///
    /// # Errors
    /// What the plugin answers.
    pub fn open_realtime(&self, job: &RealtimeJob<'_>) -> Result<OpenPass<'_>, CallError> {
        let stages: Vec<_> = job
            .stages
            .iter()
            .map(|(name, source)| api::StageText {
                name: api::Text::new(name),
                source: api::Text::new(source),
            })
            .collect();
        let settings = api::RealtimeSettings {
            width: job.width,
            height: job.height,
            shadow_map: job.shadow_map.into(),
            adapter_kind: job.adapter_kind,
            adapter_name: api::Text::new(job.adapter_name),
            stages: if stages.is_empty() { null() } else { stages.as_ptr() },
            stage_count: stages.len(),
        };
        let mut pass = null_mut();
        let open = self.table.open_realtime.expect(CHECKED);
        // SAFETY: a live scene; settings and all they point to outlive the call.
        call(|message| unsafe { open(self.scene, &settings, &mut pass, message) })?;
        let pass = handle(pass, "realtime pass")?;
        Ok(OpenPass {
            table: self.table,
            pass,
            floats: floats(job.width, job.height),
            _scene: self,
        })
    }
}

impl Drop for LoadedScene<'_> {
    fn drop(&mut self) {
        let unload = self.table.unload_scene.expect(CHECKED);
        // SAFETY: a live scene, given back once; no pass outlives it.
        unsafe { unload(self.scene) }
    }
}

/// An open realtime pass; closed when dropped, before its scene.
pub struct OpenPass<'s> {
    table: &'s api::Plugin,
    pass: api::Pass,
    floats: usize,
    _scene: &'s LoadedScene<'s>,
}

impl OpenPass<'_> {
    /// Draws one frame and reads it back into `pixels`, three linear floats a pixel; answers what it
    /// took, if the plugin says so.
    ///
    /// # Errors
    /// What the plugin answers.
    ///
    /// # Panics
    /// When `pixels` has another size.
    pub fn frame(
        &mut self,
        camera: &api::CameraValue,
        pixels: &mut [f32],
    ) -> Result<Option<Footprint>, CallError> {
        assert_eq!(pixels.len(), self.floats, "three floats a pixel");
        let draw = self.table.draw_frame.expect(CHECKED);
        let read = self.table.read_frame.expect(CHECKED);
        // SAFETY: a live pass and a valid camera.
        let note = call_noted(|message| unsafe { draw(self.pass, camera, message) })?;
        let (count, pixels) = (pixels.len(), pixels.as_mut_ptr());
        // SAFETY: a live pass; the buffer has the promised size and outlives the call.
        call(|message| unsafe { read(self.pass, pixels, count, message) })?;
        Ok(note.parse().ok())
    }
}

impl Drop for OpenPass<'_> {
    fn drop(&mut self) {
        let close = self.table.close_realtime.expect(CHECKED);
        // SAFETY: a live pass, given back once.
        unsafe { close(self.pass) }
    }
}

fn floats(width: u32, height: u32) -> usize {
    3 * width as usize * height as usize
}
