//! Requests to a worker. Pure data; conventions are those of `renderer_api`.

use std::path::PathBuf;

use basecode::{CameraConfig, Matrices};
use renderer_api as api;
use serde::{Deserialize, Deserializer, Serialize};

use crate::evidence::Witness;

/// Work for one worker: requests are answered in order, after a crash by a fresh worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// The renderer's library; none for Umbra's own neutral pass, where no foreign code runs.
    #[serde(with = "crate::files::path_json::optional")]
    pub plugin: Option<PathBuf>,
    /// What to ask.
    pub requests: Vec<Request>,
}

/// A scene as the plugin is told of it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneRef {
    /// Path of the TOML file.
    #[serde(with = "crate::files::path_json")]
    pub path: PathBuf,
    /// Empty for every submission; see [`api::SceneRequest::options`].
    #[serde(default)]
    pub options: String,
}

/// One question to a renderer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Request {
    /// Evaluate BSDFs: three floats a query, cosine included [sr^-1].
    EvalBsdf {
        /// The scene.
        scene: SceneRef,
        /// What to evaluate.
        queries: Vec<BsdfQuery>,
    },
    /// Radiance along rays: three floats a ray [W m^-2 sr^-1].
    Radiance {
        /// The scene.
        scene: SceneRef,
        /// Along what.
        rays: Vec<RayQuery>,
        /// Whether occluders cast shadows.
        shadows: bool,
        /// The BSDF that the integrator meets.
        witness: Witness,
        /// Seed of the sampler.
        seed: u64,
    },
    /// Render offline: three floats a pixel.
    RenderOffline {
        /// The scene.
        scene: SceneRef,
        /// Film width in pixels.
        width: u32,
        /// Film height in pixels.
        height: u32,
        /// Samples per pixel.
        spp: u32,
        /// Seed of every sampler.
        seed: u64,
        /// Threads to render with.
        threads: u32,
        /// Whether occluders cast shadows.
        shadows: bool,
    },
    /// Draw with a graphics adapter: three floats a pixel, one frame for each camera.
    RenderRealtime {
        /// The scene.
        scene: SceneRef,
        /// Film width in pixels.
        width: u32,
        /// Film height in pixels.
        height: u32,
        /// Whether to draw shadows (the bonus).
        shadow_map: bool,
        /// What to draw with.
        adapter: Adapter,
        /// Stages to replace; without a plugin, all stages.
        stages: Vec<StageText>,
        /// One frame is drawn for each.
        cameras: Vec<CameraValue>,
    },
}

/// One evaluation of a BSDF; directions are unit vectors in the local shading frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BsdfQuery {
    /// Whose BSDF.
    pub source: BsdfSource,
    /// Texture coordinates.
    pub uv: [f32; 2],
    /// Direction toward the viewer.
    pub wo: [f32; 3],
    /// Direction toward the light.
    pub wi: [f32; 3],
}

/// Whose BSDF is meant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum BsdfSource {
    /// A Lambertian material's with this albedo.
    Diffuse([f32; 3]),
    /// A normalized Phong material's, before any energy scale.
    Phong {
        /// Diffuse albedo Kd.
        diffuse: [f32; 3],
        /// Specular albedo Ks.
        specular: [f32; 3],
        /// Exponent n.
        exponent: f32,
    },
    /// What the scene hands out there.
    Shape {
        /// Index of the shape.
        shape: u32,
        /// Index of the triangle within the shape.
        primitive: u32,
    },
}

/// A ray segment, world space. Its layout is that of `renderer_api`'s.
#[derive(
    Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable, Serialize, Deserialize,
)]
#[repr(C)]
pub struct RayQuery {
    /// Origin.
    pub origin: [f32; 3],
    /// Hits closer than this are ignored.
    pub min_t: f32,
    /// Unit direction.
    pub direction: [f32; 3],
    /// Hits farther than this are ignored; may be infinite (`null` in JSON).
    #[serde(deserialize_with = "null_is_infinite")]
    pub max_t: f32,
}

/// Which adapter to draw with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Adapter {
    /// Its kind.
    pub kind: AdapterKind,
    /// Case-insensitive part of its name; empty accepts any.
    #[serde(default)]
    pub name: String,
}

/// Kinds of adapters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum AdapterKind {
    /// Hardware when there is some, software otherwise.
    Any,
    /// Software only; the worker sees no other driver.
    Software,
    /// Hardware only.
    Hardware,
}

/// The names of a realtime renderer's shader stages, in order.
pub const STAGES: [&str; 3] = ["simple.vs", "diffuse.fs", "phong.fs"];

/// The text of one shader stage.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageText {
    /// `simple.vs`, `diffuse.fs` or `phong.fs`.
    pub name: String,
    /// WGSL.
    pub text: String,
}

/// A camera for one frame, world space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraValue {
    /// Position.
    pub eye: [f32; 3],
    /// Point looked at.
    pub at: [f32; 3],
    /// Up direction, any length.
    pub up: [f32; 3],
    /// Full vertical field of view in degrees.
    pub fov_y_deg: f32,
    /// Which matrices Umbra's own pass binds.
    #[serde(default)]
    pub matrices: Matrices,
}

impl From<CameraConfig> for CameraValue {
    fn from(camera: CameraConfig) -> Self {
        Self {
            eye: camera.eye.into(),
            at: camera.at.into(),
            up: camera.up.into(),
            fov_y_deg: camera.fov_y_deg,
            matrices: Matrices::Usual,
        }
    }
}

impl Request {
    /// The scene that is asked about.
    pub fn scene(&self) -> &SceneRef {
        match self {
            Self::EvalBsdf { scene, .. }
            | Self::Radiance { scene, .. }
            | Self::RenderOffline { scene, .. }
            | Self::RenderRealtime { scene, .. } => scene,
        }
    }

    /// The scene, to be changed.
    pub fn scene_mut(&mut self) -> &mut SceneRef {
        match self {
            Self::EvalBsdf { scene, .. }
            | Self::Radiance { scene, .. }
            | Self::RenderOffline { scene, .. }
            | Self::RenderRealtime { scene, .. } => scene,
        }
    }

    /// What kind of question it is, in a word or two.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::EvalBsdf { .. } => "BSDF values",
            Self::Radiance { .. } => "radiance along rays",
            Self::RenderOffline { .. } => "offline image",
            Self::RenderRealtime { .. } => "realtime frame",
        }
    }

    /// Which adapter draws, where one does.
    pub fn adapter(&self) -> Option<AdapterKind> {
        match self {
            Self::RenderRealtime { adapter, .. } => Some(adapter.kind),
            _ => None,
        }
    }

    /// How many floats the answer holds.
    pub fn answer_floats(&self) -> usize {
        let image = |width: u32, height: u32| width as usize * height as usize;
        3 * match self {
            Self::EvalBsdf { queries, .. } => queries.len(),
            Self::Radiance { rays, .. } => rays.len(),
            Self::RenderOffline { width, height, .. } => image(*width, *height),
            Self::RenderRealtime { width, height, cameras, .. } => {
                image(*width, *height) * cameras.len()
            }
        }
    }
}

impl AdapterKind {
    /// The interface's constant.
    pub fn as_api(self) -> u32 {
        match self {
            Self::Any => api::ADAPTER_ANY,
            Self::Software => api::ADAPTER_SOFTWARE,
            Self::Hardware => api::ADAPTER_HARDWARE,
        }
    }
}

fn null_is_infinite<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f32, D::Error> {
    Ok(Option::<f32>::deserialize(deserializer)?.unwrap_or(f32::INFINITY))
}
