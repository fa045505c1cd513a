//! The plugin side of `renderer_api`: from a [`Renderer`] to the C table that the host loads.
//!
//! Authors need only [`crate::export_renderer!`]. Everything here turns C data into calls of the
//! trait, and errors and panics into a status with a message; no panic leaves the plugin.

mod pass;
mod status;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use glam::{Vec2, Vec3};
pub use renderer_api as api;

use crate::{
    Bsdf, Error, Film, Frame, Material, Ray, RenderJob, Renderer, Result, Sampler, Scene,
    SurfaceInteraction,
};
use pass::{close_realtime, draw_frame, open_realtime, read_frame};
use status::{forget, guard};

/// Exports a type that implements [`Renderer`] as the library's plugin, with its name and version
/// for reports. Use it once a library.
///
/// ```text
/// basecode::export_renderer!(MyRenderer, "my renderer", "1.0");
/// ```
#[macro_export]
macro_rules! export_renderer {
    ($renderer:ty, $name:literal, $version:literal) => {
        /// What the host looks up.
        #[unsafe(no_mangle)]
        #[allow(non_upper_case_globals)]
        pub static umbra_renderer_plugin: $crate::export::api::Plugin = {
            unsafe extern "C" fn load_scene(
                request: *const $crate::export::api::SceneRequest,
                scene: *mut $crate::export::api::Scene,
                message: *mut $crate::export::api::Message,
            ) -> $crate::export::api::Status {
                let make: $crate::export::MakeRenderer =
                    |options| Ok(Box::new(<$renderer as $crate::Renderer>::new(options)?));
                // SAFETY: the host passes valid pointers, as the interface demands.
                unsafe { $crate::export::load_scene(make, request, scene, message) }
            }
            $crate::export::plugin($name, $version, load_scene)
        };
    };
}

/// Makes a renderer from its options.
pub type MakeRenderer = fn(&str) -> Result<Box<dyn Renderer>>;

/// The type of [`api::Plugin::load_scene`].
pub type LoadScene = unsafe extern "C" fn(
    *const api::SceneRequest,
    *mut api::Scene,
    *mut api::Message,
) -> api::Status;

/// The plugin table around a renderer's `load_scene`.
pub const fn plugin(
    name: &'static str,
    version: &'static str,
    load_scene: LoadScene,
) -> api::Plugin {
    api::Plugin {
        magic: api::MAGIC,
        interface_version: api::INTERFACE_VERSION,
        struct_size: size_of::<api::Plugin>() as u32,
        name: api::Text::new(name),
        version: api::Text::new(version),
        load_scene: Some(load_scene),
        unload_scene: Some(unload_scene),
        set_witness: Some(set_witness),
        eval_bsdf: Some(eval_bsdf),
        radiance: Some(radiance),
        render_offline: Some(render_offline),
        open_realtime: Some(open_realtime),
        draw_frame: Some(draw_frame),
        read_frame: Some(read_frame),
        close_realtime: Some(close_realtime),
    }
}

/// What an [`api::Scene`] points to.
struct Loaded {
    renderer: Box<dyn Renderer>,
    scene: Scene,
}

/// Loads a scene into a new renderer.
///
/// # Safety
/// The pointers must be valid, as [`api::Plugin::load_scene`] demands.
pub unsafe fn load_scene(
    make: MakeRenderer,
    request: *const api::SceneRequest,
    scene: *mut api::Scene,
    message: *mut api::Message,
) -> api::Status {
    guard(message, || {
        // SAFETY: the caller vouches for the request and its texts.
        let (path, options) = unsafe { (text(&(*request).path)?, text(&(*request).options)?) };
        let renderer = make(options)?;
        let loaded = Scene::load(Path::new(path), &|material| renderer.bsdf(material))?;
        let loaded = Box::new(Loaded { renderer, scene: loaded });
        // SAFETY: the caller vouches for the place.
        unsafe { *scene = Box::into_raw(loaded).cast() };
        Ok(())
    })
}

unsafe extern "C" fn unload_scene(scene: api::Scene) {
    // SAFETY: the host hands back what `load_scene` gave, once.
    let loaded = unsafe { Box::from_raw(scene.cast::<Loaded>()) };
    // A panic in a student's `drop` must not cross the boundary.
    catch_unwind(AssertUnwindSafe(|| drop(loaded))).unwrap_or_else(forget);
}

unsafe extern "C" fn set_witness(
    scene: api::Scene,
    witness: *const api::WitnessBsdf,
    message: *mut api::Message,
) -> api::Status {
    guard(message, || {
        // SAFETY: a live scene of ours; a witness that stays valid until it is replaced.
        let (loaded, witness) = unsafe { (&mut *scene.cast::<Loaded>(), witness.as_ref()) };
        let witness = witness.map(|witness| Box::new(HostWitness(*witness)) as Box<dyn Bsdf>);
        loaded.scene.set_witness(witness);
        Ok(())
    })
}

unsafe extern "C" fn eval_bsdf(
    scene: api::Scene,
    queries: *const api::BsdfQuery,
    count: usize,
    values: *mut f32,
    message: *mut api::Message,
) -> api::Status {
    guard(message, || {
        // SAFETY: a live scene of ours and host buffers of `count` entries.
        let (loaded, queries, values) = unsafe {
            let values = std::slice::from_raw_parts_mut(values.cast::<Vec3>(), count);
            (&*scene.cast::<Loaded>(), std::slice::from_raw_parts(queries, count), values)
        };
        let mut by_value = ByValue::default();
        for (query, value) in queries.iter().zip(values) {
            let (wo, wi) = (Vec3::from(query.wo), Vec3::from(query.wi));
            *value = if query.source == api::BSDF_OF_VALUE {
                let point = SurfaceInteraction { wo, wi, uv: query.uv.into(), ..FLAT };
                by_value.bsdf(loaded.renderer.as_ref(), &query.material).eval(&point)
            } else {
                let (shape, primitive) = (query.shape as usize, query.primitive as usize);
                let point = loaded.scene.point_on(shape, primitive, Vec2::from(query.uv));
                let Some(point) = point else {
                    return Err(Error::Argument(format!(
                        "no triangle {primitive} in shape {shape}"
                    )));
                };
                let point = SurfaceInteraction { wo, wi, ..point };
                loaded.scene.bsdf(&point).eval(&point)
            };
        }
        Ok(())
    })
}

unsafe extern "C" fn radiance(
    scene: api::Scene,
    settings: *const api::RadianceSettings,
    rays: *const api::RayQuery,
    count: usize,
    values: *mut f32,
    message: *mut api::Message,
) -> api::Status {
    guard(message, || {
        // SAFETY: a live scene of ours and host buffers of `count` entries.
        let (loaded, settings, rays, values) = unsafe {
            let values = std::slice::from_raw_parts_mut(values.cast::<Vec3>(), count);
            (&*scene.cast::<Loaded>(), &*settings, std::slice::from_raw_parts(rays, count), values)
        };
        let kind = loaded.scene.config().kind;
        let integrator = loaded.renderer.integrator(kind, settings.shadows != 0)?;
        let sampler = Sampler::new(settings.seed);
        for (ray, value) in rays.iter().zip(values) {
            let (origin, direction) = (ray.origin.into(), ray.direction.into());
            let ray = Ray::segment(origin, direction, ray.min_t, ray.max_t);
            *value = integrator.radiance(&loaded.scene, &ray, &sampler);
        }
        Ok(())
    })
}

unsafe extern "C" fn render_offline(
    scene: api::Scene,
    settings: *const api::OfflineSettings,
    pixels: *mut f32,
    float_count: usize,
    message: *mut api::Message,
) -> api::Status {
    guard(message, || {
        // SAFETY: a live scene of ours and valid settings.
        let (loaded, settings) = unsafe { (&*scene.cast::<Loaded>(), &*settings) };
        let (width, height) = (settings.width as usize, settings.height as usize);
        expect_floats(width, height, float_count)?;
        // SAFETY: the host's buffer holds `float_count` floats, three for each pixel.
        let pixels =
            unsafe { std::slice::from_raw_parts_mut(pixels.cast::<Vec3>(), width * height) };
        let callbacks = Callbacks(settings);
        let kind = loaded.scene.config().kind;
        let integrator = loaded.renderer.integrator(kind, settings.shadows != 0)?;
        let job = RenderJob {
            width,
            height,
            spp: settings.spp as usize,
            seed: settings.seed,
            threads: settings.threads as usize,
            progress: &|done, total| callbacks.progress(done, total),
            cancelled: &|| callbacks.cancelled(),
        };
        let mut film = Film::new(width, pixels);
        loaded.renderer.render(&loaded.scene, integrator.as_ref(), &job, &mut film)
    })
}

/// A surface point of no scene, for materials given by value.
const FLAT: SurfaceInteraction = SurfaceInteraction {
    t: 0.0,
    p: Vec3::ZERO,
    uv: Vec2::ZERO,
    ng: Vec3::Z,
    frame_ns: Frame { s: Vec3::X, t: Vec3::Y, n: Vec3::Z },
    wo: Vec3::ZERO,
    wi: Vec3::ZERO,
    shape: 0,
    primitive: 0,
    epsilon: Ray::EPSILON,
};

/// The BSDF of the last material given by value: batches hold long runs of the same one.
#[derive(Default)]
struct ByValue {
    last: Option<(api::MaterialValue, Box<dyn Bsdf>)>,
}

impl ByValue {
    fn bsdf(&mut self, renderer: &dyn Renderer, value: &api::MaterialValue) -> &dyn Bsdf {
        let same = |last: &api::MaterialValue| {
            last.model == value.model
                && last.diffuse == value.diffuse
                && last.specular == value.specular
                && last.exponent == value.exponent
        };
        if !self.last.as_ref().is_some_and(|(last, _)| same(last)) {
            self.last = None;
        }
        let last = self.last.get_or_insert_with(|| {
            let (diffuse, specular) = (value.diffuse.into(), value.specular.into());
            let material = match value.model {
                api::MATERIAL_DIFFUSE => Material::diffuse(diffuse),
                _ => Material::phong(diffuse, specular, value.exponent),
            };
            (*value, renderer.bsdf(&material))
        });
        last.1.as_ref()
    }
}

/// A BSDF that asks the host.
struct HostWitness(api::WitnessBsdf);

// SAFETY: the interface allows `eval` from any thread; `user` is only passed back.
unsafe impl Send for HostWitness {}
// SAFETY: as above.
unsafe impl Sync for HostWitness {}

impl Bsdf for HostWitness {
    fn eval(&self, i: &SurfaceInteraction) -> Vec3 {
        let Some(eval) = self.0.eval else { return Vec3::ZERO };
        let query = api::WitnessQuery {
            position: i.p.into(),
            normal: i.frame_ns.n.into(),
            uv: i.uv.into(),
            wo: i.wo.into(),
            wi: i.wi.into(),
            shape: i.shape as u32,
            primitive: i.primitive as u32,
        };
        let mut value = [0.0f32; 3];
        // SAFETY: the host's callback, with its own user pointer and room for three floats.
        unsafe { eval(self.0.user, &query, value.as_mut_ptr()) };
        value.into()
    }
}

/// The host's callbacks during one render.
struct Callbacks<'a>(&'a api::OfflineSettings);

// SAFETY: the interface allows both callbacks from any thread; `user` is only passed back.
unsafe impl Sync for Callbacks<'_> {}

impl Callbacks<'_> {
    fn progress(&self, done: usize, total: usize) {
        if let Some(progress) = self.0.progress {
            // SAFETY: the host's callback with its own user pointer.
            unsafe { progress(self.0.user, done as u32, total as u32) };
        }
    }

    fn cancelled(&self) -> bool {
        // SAFETY: the host's callback with its own user pointer.
        self.0.cancelled.is_some_and(|cancelled| unsafe { cancelled(self.0.user) } != 0)
    }
}

fn expect_floats(width: usize, height: usize, found: usize) -> Result<()> {
    let expected = width * height * 3;
    if found == expected {
        return Ok(());
    }
    let message =
        format!("{width}x{height} pixels need {expected} floats, the buffer holds {found}");
    Err(Error::Argument(message))
}

/// Borrows a text of the host's.
///
/// # Safety
/// As [`api::Text::bytes`].
unsafe fn text<'a>(text: &api::Text) -> Result<&'a str> {
    // SAFETY: the caller vouches for pointer and length.
    std::str::from_utf8(unsafe { text.bytes() }).map_err(|error| {
        Error::Argument(format!("the host passed text that is not UTF-8: {error}"))
    })
}
