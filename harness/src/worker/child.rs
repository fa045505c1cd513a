//! The worker itself: the program `umbra-worker DIR`.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use basecode::gpu::Footprint;
use renderer_api as api;

use super::job::{Request, SceneRef};
use super::neutral_pass::Neutral;
use super::shaders;
use super::shared_memory::{Input, Output, Table};
use super::table::{STATUS_OURS, STATUS_REJECTED, STATUS_STAGE, Slot};
use super::wire::{self, CAMERA_BYTES, WireJob, WireRequest, WorkerFolder, queries, rays, words};
use crate::evidence::Witness;
use crate::plugin::{
    CallError, CallErrorKind, HostPlugin, LoadedScene, OfflineJob, OpenPass, RealtimeJob,
    WitnessState,
};
use crate::process::{self, exit_now};

/// Confines this process, then answers the job in `dir`. Does not return when it worked.
pub fn child_main(dir: &Path) -> ExitCode {
    if let Err(error) = process::confine_self().and_then(|()| work(dir)) {
        eprintln!("umbra: the worker cannot work: {error}");
        return ExitCode::from(process::EXIT_NOT_CONFINED);
    }
    // The answers are in place; what a plugin wants to do at exit concerns nobody.
    exit_now(0)
}

fn work(dir: &Path) -> std::io::Result<()> {
    let folder = WorkerFolder(dir);
    let job: WireJob = serde_json::from_slice(&std::fs::read(folder.job())?)?;
    let table = Table::open(&folder.table(), job.requests.len())?;
    let input = Input::open(&folder.input())?;
    let loading = table.loading();
    loading.start();
    let plugin = match job.plugin.as_deref().map(HostPlugin::load).transpose() {
        Ok(plugin) => plugin,
        Err(error) => {
            loading.answer(STATUS_REJECTED, &error.to_string(), 0.0);
            return Ok(());
        }
    };
    let name = plugin.as_ref().map(HostPlugin::name).unwrap_or_default();
    loading.answer(api::STATUS_OK, &name, 0.0);
    shaders::take(dir);
    if let (true, Some(plugin), [request]) = (job.live, &plugin, &*job.requests) {
        return answer_frames(plugin, request, &folder, table.request(0));
    }
    let (mut scene, mut neutral) = (None, Neutral::default());
    for (index, request) in job.requests.iter().enumerate() {
        let record = table.request(index);
        record.start();
        let begin = Instant::now();
        let mut output = Output::open(&folder.output(), request.output)?;
        let bytes = input.bytes(request.input);
        let result = match &plugin {
            Some(plugin) => ask(plugin, &mut scene, request, bytes, record, output.floats())
                .map(|()| String::new()),
            None => neutral.render(&request.request, output.floats()),
        };
        let seconds = begin.elapsed().as_secs_f64();
        match result {
            Ok(adapter) => record.answer(api::STATUS_OK, &adapter, seconds),
            Err(error) => record.answer(status(error.kind), &error.message, seconds),
        }
    }
    shaders::leave(dir);
    // Scenes are left to the end of the process: unloading is foreign code with nothing to give.
    std::mem::forget(scene);
    Ok(())
}

/// Draws a frame for each camera that comes, until none comes or one fails.
fn answer_frames(
    plugin: &HostPlugin,
    wired: &WireRequest,
    folder: &WorkerFolder,
    record: &Slot,
) -> std::io::Result<()> {
    let mut cameras = File::open(folder.cameras())?;
    let mut answered = File::options().write(true).open(folder.frames())?;
    let mut output = Output::open(&folder.output(), wired.output)?;
    let mut current = None;
    let mut draw = || -> Result<(), CallError> {
        record.start();
        let scene = load(plugin, &mut current, wired.request.scene())?;
        let mut pass = open(scene, &wired.request)?;
        let mut camera = [0; CAMERA_BYTES];
        while cameras.read_exact(&mut camera).is_ok() {
            record.start();
            let begin = Instant::now();
            pass.frame(&wire::camera(&camera), output.floats())?;
            record.answer(api::STATUS_OK, "", begin.elapsed().as_secs_f64());
            // Nobody listens when the parent is gone.
            let _ = answered.write_all(&[0]);
        }
        Ok(())
    };
    let drawn = draw();
    if let Err(error) = &drawn {
        record.answer(status(error.kind), &error.message, 0.0);
        answered.write_all(&[0])?;
    }
    std::mem::forget(current);
    Ok(())
}

/// The scene that is loaded, kept because requests about one scene come together.
type Current<'p> = Option<(SceneRef, LoadedScene<'p>)>;

fn ask<'p>(
    plugin: &'p HostPlugin,
    current: &mut Current<'p>,
    request: &WireRequest,
    input: &[u8],
    record: &Slot,
    values: &mut [f32],
) -> Result<(), CallError> {
    let scene = load(plugin, current, request.request.scene())?;
    match &request.request {
        Request::EvalBsdf { .. } => scene.eval_bsdf(&queries(&words(input)), values),
        Request::Radiance { shadows, witness, seed, .. } => {
            let settings = api::RadianceSettings { shadows: (*shadows).into(), seed: *seed };
            let state = WitnessState::new(*witness);
            let asked = (*witness != Witness::True).then_some(&state);
            let result = scene.radiance(&settings, asked, &rays(&words(input)), values);
            record.witness(&state);
            result
        }
        image => {
            let progress = |done, total| record.progress(done, total);
            if let Some(footprint) = draw(scene, image, &progress, values)? {
                record.footprint(&footprint);
            }
            Ok(())
        }
    }
}

/// Renders or draws what a request for an image asks for; answers what the last frame took, if
/// the plugin says so.
fn draw(
    scene: &LoadedScene,
    request: &Request,
    progress: &(dyn Fn(u32, u32) + Sync),
    values: &mut [f32],
) -> Result<Option<Footprint>, CallError> {
    match request {
        &Request::RenderOffline { width, height, spp, seed, threads, shadows, .. } => {
            let job = OfflineJob { width, height, spp, threads, seed, shadows, progress };
            scene.render_offline(&job, values).map(|()| None)
        }
        Request::RenderRealtime { width, height, cameras, .. } => {
            let mut pass = open(scene, request)?;
            let mut footprint = None;
            let frame_floats = (3 * *width as usize * *height as usize).max(1);
            for (camera, frame) in cameras.iter().zip(values.chunks_exact_mut(frame_floats)) {
                let camera = api::CameraValue {
                    eye: camera.eye,
                    at: camera.at,
                    up: camera.up,
                    fov_y_deg: camera.fov_y_deg,
                };
                footprint = pass.frame(&camera, frame)?;
            }
            Ok(footprint)
        }
        Request::EvalBsdf { .. } | Request::Radiance { .. } => Err(no_image()),
    }
}

/// The pass that a request for realtime frames is about.
fn open<'s>(scene: &'s LoadedScene, request: &Request) -> Result<OpenPass<'s>, CallError> {
    let &Request::RenderRealtime { width, height, shadow_map, ref adapter, ref stages, .. } =
        request
    else {
        return Err(no_image());
    };
    let stages: Vec<_> = stages.iter().map(|stage| (&*stage.name, &*stage.text)).collect();
    scene.open_realtime(&RealtimeJob {
        width,
        height,
        shadow_map,
        adapter_kind: adapter.kind.as_api(),
        adapter_name: &adapter.name,
        stages: &stages,
    })
}

fn no_image() -> CallError {
    CallError { kind: CallErrorKind::Ours, message: "not a request for such an image".to_owned() }
}

/// Answers a request for an image in this very process, without isolation: for authors who debug their own
/// plugin, whose prints and breakpoints then work. Never for foreign code.
///
/// # Errors
/// When the plugin is refused, and what it answers.
pub fn draw_in_process(
    plugin: &Path,
    request: &Request,
    progress: &(dyn Fn(u32, u32) + Sync),
) -> anyhow::Result<Vec<f32>> {
    let plugin = HostPlugin::load(plugin)?;
    let mut values = vec![f32::NAN; request.answer_floats()];
    let mut scene = None;
    draw(load(&plugin, &mut scene, request.scene())?, request, progress, &mut values)?;
    Ok(values)
}

fn load<'c, 'p>(
    plugin: &'p HostPlugin,
    current: &'c mut Current<'p>,
    wanted: &SceneRef,
) -> Result<&'c mut LoadedScene<'p>, CallError> {
    if current.as_ref().is_some_and(|(loaded, _)| loaded != wanted) {
        *current = None;
    }
    let (_, scene) = match current.take() {
        Some(loaded) => current.insert(loaded),
        None => {
            let Some(path) = wanted.path.to_str() else {
                let message = format!("scene path {} is not UTF-8", wanted.path.display());
                return Err(CallError { kind: CallErrorKind::Ours, message });
            };
            let scene = plugin.load_scene(path, &wanted.options)?;
            current.insert((wanted.clone(), scene))
        }
    };
    Ok(scene)
}

/// The status for the table.
fn status(kind: CallErrorKind) -> i32 {
    match kind {
        CallErrorKind::Failed => api::STATUS_ERROR,
        CallErrorKind::NotImplemented => api::STATUS_NOT_IMPLEMENTED,
        CallErrorKind::Panicked => api::STATUS_PANICKED,
        CallErrorKind::Cancelled => api::STATUS_CANCELLED,
        CallErrorKind::NoAdapter => api::STATUS_NO_ADAPTER,
        CallErrorKind::Stage => STATUS_STAGE,
        CallErrorKind::Ours => STATUS_OURS,
    }
}
