//! The interface between Umbra (the *host*) and a renderer (the *plugin*), as C data.
//!
//! A plugin is a dynamic library that exports one symbol, [`ENTRY_SYMBOL`]: a constant [`Plugin`].
//! Its first three fields (magic, interface version, struct size) never move; [`Plugin::check`]
//! reads them before anything else is touched. The rest is a table of functions.
//!
//! # Conventions, fixed here once
//! * World space is right-handed with y up. Colours are linear, Rec. 709 primaries, order R, G, B.
//! * Images are row-major, row 0 is the top row, three floats a pixel.
//! * `wo` points toward the viewer, `wi` toward the light; both are unit vectors that *leave* the
//!   surface. In BSDF queries they are in the local shading frame, whose z axis is the shading normal.
//! * A BSDF value *includes* the cosine foreshortening factor of `wi` [sr^-1].
//! * Radiance L is in W m^-2 sr^-1, radiant intensity I in W sr^-1, lengths are in scene units.
//! * Booleans are `u32`: 0 is false, anything else true.
//! * Text is UTF-8 with a length; it is not NUL-terminated.
//!
//! # Ownership and threads
//! * The host owns every buffer that crosses; the plugin fills it and keeps no pointer to it after
//!   the call returns, except a [`WitnessBsdf`], which stays valid until it is replaced.
//! * The host calls all functions from one thread, one at a time. The plugin may use threads of its
//!   own during a call; none may touch host memory once the call has returned.
//! * Callbacks ([`WitnessBsdf::eval`], [`OfflineSettings::progress`], [`OfflineSettings::cancelled`])
//!   may be called from any thread, several at once, and only during a call of the host.
//! * No panic, C++ exception or longjmp may cross the boundary in either direction.
#![no_std]

use core::ffi::c_void;

/// The first eight bytes of every plugin table: `UMBRAPLG` in memory on a little-endian machine.
pub const MAGIC: u64 = 0x474C_5041_5242_4D55;
/// The version of this interface. Host and plugin must agree exactly.
pub const INTERFACE_VERSION: u32 = 1;
/// The name of the exported constant, without the terminating NUL.
pub const ENTRY_SYMBOL: &str = "umbra_renderer_plugin";

/// What a function of the plugin answers: one of the `STATUS_*` values.
///
/// An integer rather than an enum, because a faulty plugin can answer anything.
pub type Status = i32;
/// The call did what was asked.
pub const STATUS_OK: Status = 0;
/// The call failed; the message says why.
pub const STATUS_ERROR: Status = 1;
/// The part of the assignment that the call needs is not implemented yet; the message names it.
pub const STATUS_NOT_IMPLEMENTED: Status = 2;
/// The plugin panicked and caught it; the message is the panic's.
pub const STATUS_PANICKED: Status = 3;
/// The host asked to stop through [`OfflineSettings::cancelled`].
pub const STATUS_CANCELLED: Status = 4;
/// The machine offers no suitable graphics adapter, or lost it. Believed only when confirmed.
pub const STATUS_NO_ADAPTER: Status = 5;

/// Borrowed UTF-8 text. `data` may be null when `length` is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Text {
    /// First byte.
    pub data: *const u8,
    /// Number of bytes.
    pub length: usize,
}

/// Where the plugin writes the text that goes with a status, in a buffer of the host.
#[repr(C)]
#[derive(Debug)]
pub struct Message {
    /// First byte of the host's buffer.
    pub data: *mut u8,
    /// Size of the buffer in bytes.
    pub capacity: usize,
    /// Number of bytes of UTF-8 written, at most `capacity`.
    pub length: usize,
}

/// Which scene to load.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct SceneRequest {
    /// Path of the scene's TOML file.
    pub path: Text,
    /// Empty for every submission. The reference renderer reads `mistake=NAME` here, separated by
    /// commas, to make known mistakes on purpose; other plugins ignore it.
    pub options: Text,
}

/// A material by value, before any energy scale.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct MaterialValue {
    /// One of the `MATERIAL_*` values.
    pub model: u32,
    /// Diffuse albedo Kd, each component at least 0.
    pub diffuse: [f32; 3],
    /// Specular albedo Ks, each component at least 0.
    pub specular: [f32; 3],
    /// Phong exponent n, at least 0.
    pub exponent: f32,
}
/// Lambertian reflection; `specular` and `exponent` are ignored.
pub const MATERIAL_DIFFUSE: u32 = 0;
/// Normalised Phong.
pub const MATERIAL_PHONG: u32 = 1;

/// One evaluation of a BSDF.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct BsdfQuery {
    /// One of the `BSDF_OF_*` values: whose BSDF is meant.
    pub source: u32,
    /// The material, when `source` is [`BSDF_OF_VALUE`].
    pub material: MaterialValue,
    /// Index of the shape in the scene, when `source` is [`BSDF_OF_SHAPE`].
    pub shape: u32,
    /// Index of the triangle within the shape.
    pub primitive: u32,
    /// Texture coordinates at the surface point.
    pub uv: [f32; 2],
    /// Unit direction toward the viewer, local shading frame.
    pub wo: [f32; 3],
    /// Unit direction toward the light, local shading frame.
    pub wi: [f32; 3],
}
/// The query's own [`BsdfQuery::material`], with constant textures.
pub const BSDF_OF_VALUE: u32 = 0;
/// What the scene hands out for `shape` and `primitive`, textures looked up at `uv`.
pub const BSDF_OF_SHAPE: u32 = 1;

/// What a witness BSDF is asked. Directions are in the local shading frame.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct WitnessQuery {
    /// The surface point, world space.
    pub position: [f32; 3],
    /// The shading normal, world space.
    pub normal: [f32; 3],
    /// Texture coordinates.
    pub uv: [f32; 2],
    /// Direction toward the viewer as the integrator set it; not necessarily a unit vector.
    pub wo: [f32; 3],
    /// Direction toward the light as the integrator set it; not necessarily a unit vector.
    pub wi: [f32; 3],
    /// Index of the shape in the scene.
    pub shape: u32,
    /// Index of the triangle within the shape.
    pub primitive: u32,
}

/// A BSDF of the host's that takes the place of every BSDF the scene hands out.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct WitnessBsdf {
    /// Passed back unchanged.
    pub user: *mut c_void,
    /// Writes the BSDF value (cosine included) to `value`, three floats. Callable from any thread.
    pub eval: Option<
        unsafe extern "C" fn(user: *mut c_void, query: *const WitnessQuery, value: *mut f32),
    >,
}

/// A ray segment, world space.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RayQuery {
    /// Origin.
    pub origin: [f32; 3],
    /// Hits closer than this are ignored.
    pub min_t: f32,
    /// Unit direction.
    pub direction: [f32; 3],
    /// Hits farther than this are ignored; may be infinite.
    pub max_t: f32,
}

/// How to compute radiance along a batch of rays.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RadianceSettings {
    /// Whether occluders cast shadows.
    pub shadows: u32,
    /// Seed of the sampler that the rays share.
    pub seed: u64,
}

/// How to render an image offline. Every value is explicit: the host has resolved the scene's defaults.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct OfflineSettings {
    /// Film width in pixels.
    pub width: u32,
    /// Film height in pixels.
    pub height: u32,
    /// Samples per pixel. At 1 the sample is the pixel's centre.
    pub spp: u32,
    /// Number of threads to render with, at least 1.
    pub threads: u32,
    /// Seed of every sampler.
    pub seed: u64,
    /// Whether occluders cast shadows.
    pub shadows: u32,
    /// Passed back unchanged to the callbacks.
    pub user: *mut c_void,
    /// Called now and then with finished and total rows; may be null.
    pub progress: Option<unsafe extern "C" fn(user: *mut c_void, done: u32, total: u32)>,
    /// Returns non-zero when the plugin should stop early; may be null.
    pub cancelled: Option<unsafe extern "C" fn(user: *mut c_void) -> u32>,
}

/// The text of one shader stage, to be used in place of the plugin's own.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct StageText {
    /// Name of the stage file without `.wgsl`: `simple.vs`, `diffuse.fs` or `phong.fs`.
    pub name: Text,
    /// WGSL source.
    pub source: Text,
}

/// How to open a realtime pass. Every value is explicit.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RealtimeSettings {
    /// Film width in pixels.
    pub width: u32,
    /// Film height in pixels.
    pub height: u32,
    /// Whether to draw shadows by shadow mapping (the bonus).
    pub shadow_map: u32,
    /// One of the `ADAPTER_*` values.
    pub adapter_kind: u32,
    /// Case-insensitive part of the adapter's name; empty accepts any.
    pub adapter_name: Text,
    /// Stages to replace; null when `stage_count` is 0.
    pub stages: *const StageText,
    /// Number of stages to replace.
    pub stage_count: usize,
}
/// A hardware adapter when there is one, a software adapter otherwise.
pub const ADAPTER_ANY: u32 = 0;
/// A software adapter only.
pub const ADAPTER_SOFTWARE: u32 = 1;
/// A hardware adapter only.
pub const ADAPTER_HARDWARE: u32 = 2;

/// A camera for one frame.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct CameraValue {
    /// Position, world space.
    pub eye: [f32; 3],
    /// Point looked at, world space.
    pub at: [f32; 3],
    /// Up direction, world space, not necessarily unit or orthogonal.
    pub up: [f32; 3],
    /// Full vertical field of view in degrees.
    pub fov_y_deg: f32,
}

/// An opaque scene of the plugin's.
pub type Scene = *mut c_void;
/// An opaque realtime pass of the plugin's.
pub type Pass = *mut c_void;

/// The table that a plugin exports under [`ENTRY_SYMBOL`].
///
/// Every function returns a [`Status`] and writes a message when it is not [`STATUS_OK`]. Every
/// entry must be set.
#[repr(C)]
pub struct Plugin {
    /// [`MAGIC`].
    pub magic: u64,
    /// [`INTERFACE_VERSION`].
    pub interface_version: u32,
    /// `sizeof(Plugin)` as the plugin was compiled.
    pub struct_size: u32,
    /// The renderer's name, valid while the library is loaded.
    pub name: Text,
    /// The renderer's version, valid while the library is loaded.
    pub version: Text,
    /// Loads a scene and stores a handle to it in `scene`.
    pub load_scene: Option<
        unsafe extern "C" fn(
            request: *const SceneRequest,
            scene: *mut Scene,
            message: *mut Message,
        ) -> Status,
    >,
    /// Frees a scene. No pass of it is open any more.
    pub unload_scene: Option<unsafe extern "C" fn(scene: Scene)>,
    /// Installs a witness BSDF for `radiance` and `render_offline`; null takes it away.
    pub set_witness: Option<
        unsafe extern "C" fn(
            scene: Scene,
            witness: *const WitnessBsdf,
            message: *mut Message,
        ) -> Status,
    >,
    /// Evaluates `count` queries into `values`, three floats each (cosine included).
    pub eval_bsdf: Option<
        unsafe extern "C" fn(
            scene: Scene,
            queries: *const BsdfQuery,
            count: usize,
            values: *mut f32,
            message: *mut Message,
        ) -> Status,
    >,
    /// Computes the radiance that arrives along `count` rays into `values`, three floats each.
    pub radiance: Option<
        unsafe extern "C" fn(
            scene: Scene,
            settings: *const RadianceSettings,
            rays: *const RayQuery,
            count: usize,
            values: *mut f32,
            message: *mut Message,
        ) -> Status,
    >,
    /// Renders an image into `pixels`, `width * height * 3` floats.
    pub render_offline: Option<
        unsafe extern "C" fn(
            scene: Scene,
            settings: *const OfflineSettings,
            pixels: *mut f32,
            float_count: usize,
            message: *mut Message,
        ) -> Status,
    >,
    /// Opens a realtime pass on a scene and stores a handle to it in `pass`.
    pub open_realtime: Option<
        unsafe extern "C" fn(
            scene: Scene,
            settings: *const RealtimeSettings,
            pass: *mut Pass,
            message: *mut Message,
        ) -> Status,
    >,
    /// Draws one frame for a camera. With [`STATUS_OK`] the message may hold five decimal numbers
    /// separated by spaces. They count what the pass did from its opening to this frame: bytes
    /// uploaded, textures to draw into, picture pipelines with vertices, picture pipelines without,
    /// and other pipelines.
    pub draw_frame: Option<
        unsafe extern "C" fn(
            pass: Pass,
            camera: *const CameraValue,
            message: *mut Message,
        ) -> Status,
    >,
    /// Reads the last frame back into `pixels`, `width * height * 3` linear floats.
    pub read_frame: Option<
        unsafe extern "C" fn(
            pass: Pass,
            pixels: *mut f32,
            float_count: usize,
            message: *mut Message,
        ) -> Status,
    >,
    /// Closes a pass.
    pub close_realtime: Option<unsafe extern "C" fn(pass: Pass)>,
}

// SAFETY: a plugin table is a constant; the pointers in it refer to static data and functions.
unsafe impl Sync for Plugin {}

/// Why a plugin table was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mismatch {
    /// The first eight bytes are not [`MAGIC`].
    Magic {
        /// What was found.
        found: u64,
    },
    /// Another interface version.
    Version {
        /// What was found.
        found: u32,
    },
    /// Another struct size at the same version.
    Size {
        /// What was found, in bytes.
        found: u32,
    },
    /// A function of the table is null.
    NullEntry {
        /// Its name.
        name: &'static str,
    },
}

impl core::fmt::Display for Mismatch {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Magic { found } => write!(
                f,
                "not a renderer plugin: expected magic {MAGIC:#018x}, found {found:#018x}"
            ),
            Self::Version { found } => write!(
                f,
                "plugin speaks another interface: expected version {INTERFACE_VERSION}, found {found}"
            ),
            Self::Size { found } => write!(
                f,
                "plugin table has another size: expected {} bytes, found {found}",
                size_of::<Plugin>()
            ),
            Self::NullEntry { name } => write!(f, "plugin table entry `{name}` is null"),
        }
    }
}

impl core::error::Error for Mismatch {}

impl Plugin {
    /// Checks magic, version, size and that every entry is set, in this order, each before
    /// anything behind it is read.
    ///
    /// # Errors
    /// The first mismatch.
    ///
    /// # Safety
    /// `plugin` must point to readable memory: 8 bytes at least, and as many as each check that
    /// passes promises (16 once the magic is right, the whole struct once the size is right).
    pub unsafe fn check<'a>(plugin: *const Plugin) -> Result<&'a Plugin, Mismatch> {
        // SAFETY: the caller vouches for the memory; each field is read only after those before it.
        unsafe {
            let magic = (&raw const (*plugin).magic).read_unaligned();
            if magic != MAGIC {
                return Err(Mismatch::Magic { found: magic });
            }
            let version = (&raw const (*plugin).interface_version).read_unaligned();
            if version != INTERFACE_VERSION {
                return Err(Mismatch::Version { found: version });
            }
            let size = (&raw const (*plugin).struct_size).read_unaligned();
            if size as usize != size_of::<Plugin>() {
                return Err(Mismatch::Size { found: size });
            }
            let table = &*plugin;
            let entries = [
                ("load_scene", table.load_scene.is_none()),
                ("unload_scene", table.unload_scene.is_none()),
                ("set_witness", table.set_witness.is_none()),
                ("eval_bsdf", table.eval_bsdf.is_none()),
                ("radiance", table.radiance.is_none()),
                ("render_offline", table.render_offline.is_none()),
                ("open_realtime", table.open_realtime.is_none()),
                ("draw_frame", table.draw_frame.is_none()),
                ("read_frame", table.read_frame.is_none()),
                ("close_realtime", table.close_realtime.is_none()),
            ];
            match entries.iter().find(|(_, null)| *null) {
                Some((name, _)) => Err(Mismatch::NullEntry { name }),
                None => Ok(table),
            }
        }
    }
}

impl Text {
    /// Borrows `text`; the result is valid as long as `text` is.
    pub const fn new(text: &str) -> Self {
        Self { data: text.as_ptr(), length: text.len() }
    }

    /// The bytes, or none when the pointer is null.
    ///
    /// # Safety
    /// `data` must be null or point to `length` readable bytes that outlive `'a`.
    pub unsafe fn bytes<'a>(&self) -> &'a [u8] {
        if self.data.is_null() {
            return &[];
        }
        // SAFETY: the caller vouches for pointer and length.
        unsafe { core::slice::from_raw_parts(self.data, self.length) }
    }
}
