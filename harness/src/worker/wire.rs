//! How a job reaches the worker: a JSON file with the large arrays taken out, and those arrays as
//! plain words in a file to be mapped.

use std::path::{Path, PathBuf};

use renderer_api as api;
use serde::{Deserialize, Serialize};

use super::job::{BsdfQuery, BsdfSource, CameraValue, RayQuery, Request};

/// Outputs begin at multiples of this in their file: a multiple of every system's page size.
pub const ALIGN: usize = 64 << 10;

/// A job as the worker reads it.
#[derive(Serialize, Deserialize)]
pub struct WireJob {
    /// The library to load.
    #[serde(with = "crate::files::path_json::optional")]
    pub plugin: Option<PathBuf>,
    /// The requests, in order.
    pub requests: Vec<WireRequest>,
    /// Whether frames of the one request are drawn as they are asked for, until nobody asks any more.
    pub live: bool,
}

/// A request whose arrays lie in the input file.
#[derive(Serialize, Deserialize)]
pub struct WireRequest {
    /// The request, its `queries` or `rays` empty.
    pub request: Request,
    /// Where they lie in the input file, in bytes.
    pub input: (usize, usize),
    /// Where the answer goes.
    pub output: OutputRegion,
}

/// A region of the output file. The answer ends where the region ends, so that a guard page can
/// follow it; what lies before it in the region is filler that nobody may change.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OutputRegion {
    /// First byte of the region, a multiple of [`ALIGN`].
    pub start: usize,
    /// Size of the region in bytes, a multiple of [`ALIGN`].
    pub size: usize,
    /// Size of the answer in floats.
    pub floats: usize,
}

impl OutputRegion {
    /// The region for `floats` at `start`.
    pub fn new(start: usize, floats: usize) -> Self {
        Self { start, size: (4 * floats).next_multiple_of(ALIGN), floats }
    }

    /// Where the answer begins in the region, in bytes.
    pub fn offset(&self) -> usize {
        self.size - 4 * self.floats
    }
}

/// The files of a worker's private folder.
pub struct WorkerFolder<'a>(pub &'a Path);

impl WorkerFolder<'_> {
    /// The [`WireJob`].
    pub fn job(&self) -> PathBuf {
        self.0.join("job.json")
    }
    /// Queries and rays.
    pub fn input(&self) -> PathBuf {
        self.0.join("input")
    }
    /// Answers.
    pub fn output(&self) -> PathBuf {
        self.0.join("output")
    }
    /// Records: one for the plugin's loading, then one for each request.
    pub fn table(&self) -> PathBuf {
        self.0.join("table")
    }
    /// A pipe to a live worker: the cameras of frames.
    pub fn cameras(&self) -> PathBuf {
        self.0.join("cameras")
    }
    /// A pipe from a live worker: a byte for each frame that is answered.
    pub fn frames(&self) -> PathBuf {
        self.0.join("frames")
    }
    /// The worker's current folder.
    pub fn scratch(&self) -> PathBuf {
        self.0.join("scratch")
    }
}

/// Takes the arrays out of a request, as words in the order of `renderer_api`'s fields.
pub fn take_input(request: &Request) -> (Request, Vec<u32>) {
    match request {
        Request::EvalBsdf { scene, queries } => {
            let wired: Vec<WireQuery> = queries.iter().map(WireQuery::new).collect();
            let words = bytemuck::pod_collect_to_vec(&wired);
            (Request::EvalBsdf { scene: scene.clone(), queries: Vec::new() }, words)
        }
        Request::Radiance { scene, rays, shadows, witness, seed } => {
            let words = bytemuck::pod_collect_to_vec(rays);
            let (scene, rays) = (scene.clone(), Vec::new());
            let (shadows, witness, seed) = (*shadows, *witness, *seed);
            (Request::Radiance { scene, rays, shadows, witness, seed }, words)
        }
        other => (other.clone(), Vec::new()),
    }
}

/// A [`BsdfQuery`] as it goes to a worker. The words of a [`RayQuery`] go as they are.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct WireQuery {
    source: u32,
    model: u32,
    diffuse: [f32; 3],
    specular: [f32; 3],
    exponent: f32,
    shape: u32,
    primitive: u32,
    uv: [f32; 2],
    wo: [f32; 3],
    wi: [f32; 3],
}

impl WireQuery {
    fn new(query: &BsdfQuery) -> Self {
        let BsdfQuery { source, uv, wo, wi } = *query;
        let none = [0.0; 3];
        let (source, model, (diffuse, specular, exponent), (shape, primitive)) = match source {
            BsdfSource::Diffuse(albedo) => {
                (api::BSDF_OF_VALUE, api::MATERIAL_DIFFUSE, (albedo, none, 0.0), (0, 0))
            }
            BsdfSource::Phong { diffuse, specular, exponent } => {
                let value = (diffuse, specular, exponent);
                (api::BSDF_OF_VALUE, api::MATERIAL_PHONG, value, (0, 0))
            }
            BsdfSource::Shape { shape, primitive } => {
                let value = (none, none, 0.0);
                (api::BSDF_OF_SHAPE, api::MATERIAL_DIFFUSE, value, (shape, primitive))
            }
        };
        Self { source, model, diffuse, specular, exponent, shape, primitive, uv, wo, wi }
    }
}

/// Reads queries back.
pub fn queries(words: &[u32]) -> Vec<api::BsdfQuery> {
    let query = |query: &WireQuery| {
        let WireQuery { source, model, diffuse, specular, exponent, shape, primitive, uv, wo, wi } =
            *query;
        let material = api::MaterialValue { model, diffuse, specular, exponent };
        api::BsdfQuery { source, material, shape, primitive, uv, wo, wi }
    };
    bytemuck::cast_slice(words).iter().map(query).collect()
}

/// Reads rays back.
pub fn rays(words: &[u32]) -> Vec<api::RayQuery> {
    let ray = |ray: &RayQuery| {
        let RayQuery { origin, min_t, direction, max_t } = *ray;
        api::RayQuery { origin, min_t, direction, max_t }
    };
    bytemuck::cast_slice(words).iter().map(ray).collect()
}

/// Size of a camera in bytes.
pub const CAMERA_BYTES: usize = 40;

/// A camera as it goes to a live worker.
pub fn camera_bytes(camera: &CameraValue) -> [u8; CAMERA_BYTES] {
    let CameraValue { eye, at, up, fov_y_deg, .. } = camera;
    let mut bytes = [0; CAMERA_BYTES];
    let values = [eye, at, up].into_iter().flatten().chain([fov_y_deg]);
    for (to, value) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(values) {
        *to = value.to_ne_bytes();
    }
    bytes
}

/// Reads a camera back.
pub fn camera(bytes: &[u8; CAMERA_BYTES]) -> api::CameraValue {
    let [eye, at, up]: [[f32; 3]; 3] = bytemuck::pod_read_unaligned(&bytes[..36]);
    let fov_y_deg = bytemuck::pod_read_unaligned(&bytes[36..]);
    api::CameraValue { eye, at, up, fov_y_deg }
}

/// Words of mapped bytes; a rest that is no whole word is left out.
pub fn words(bytes: &[u8]) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(&bytes[..bytes.len() / 4 * 4])
}

#[cfg(test)]
mod tests {
    use super::super::job::SceneRef;
    use super::*;
    use crate::evidence::Witness;

    fn scene() -> SceneRef {
        SceneRef { path: "s.toml".into(), options: String::new() }
    }

    #[test]
    fn queries_and_rays_arrive_as_they_left() {
        let source = BsdfSource::Phong {
            diffuse: [1.0, 2.0, 3.0],
            specular: [4.0, 5.0, 6.0],
            exponent: 7.0,
        };
        let phong = BsdfQuery { source, uv: [8.0, 9.0], wo: [10.0, 11.0, 12.0], wi: [13.0; 3] };
        let source = BsdfSource::Shape { shape: 3, primitive: 4 };
        let shape = BsdfQuery { source, ..phong };
        let request = Request::EvalBsdf { scene: scene(), queries: vec![phong, shape] };
        let read = queries(&take_input(&request).1);
        assert_eq!(read.len(), 2);
        assert_eq!((read[0].source, read[0].material.model), (0, api::MATERIAL_PHONG));
        assert_eq!(read[0].material.specular, [4.0, 5.0, 6.0]);
        assert_eq!((read[0].material.exponent, read[0].uv), (7.0, [8.0, 9.0]));
        assert_eq!((read[0].wo, read[0].wi), ([10.0, 11.0, 12.0], [13.0; 3]));
        assert_eq!((read[1].source, read[1].shape, read[1].primitive), (1, 3, 4));

        let ray = RayQuery {
            origin: [1.0, 2.0, 3.0],
            min_t: 4.0,
            direction: [5.0, 6.0, 7.0],
            max_t: f32::INFINITY,
        };
        let request = Request::Radiance {
            scene: scene(),
            rays: vec![ray],
            shadows: true,
            witness: Witness::OfWi,
            seed: 5,
        };
        let (rest, words) = take_input(&request);
        let read = rays(&words)[0];
        assert_eq!((read.origin, read.min_t), (ray.origin, ray.min_t));
        assert_eq!((read.direction, read.max_t), (ray.direction, ray.max_t));
        assert!(matches!(rest, Request::Radiance { rays, seed: 5, .. } if rays.is_empty()));
        let json = serde_json::to_string(&request).unwrap();
        assert_eq!(serde_json::from_str::<Request>(&json).unwrap(), request);
    }

    #[test]
    fn a_camera_arrives_as_it_left() {
        let (eye, at, up) = ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]);
        let matrices = basecode::Matrices::Usual;
        let sent = CameraValue { eye, at, up, fov_y_deg: 10.0, matrices };
        let read = camera(&camera_bytes(&sent));
        assert_eq!((read.eye, read.at, read.up, read.fov_y_deg), (eye, at, up, 10.0));
    }

    #[test]
    fn an_answer_ends_at_the_end_of_its_region() {
        let place = OutputRegion::new(ALIGN, 7);
        assert_eq!((place.size, place.offset()), (ALIGN, ALIGN - 28));
        assert_eq!(OutputRegion::new(0, ALIGN / 4).offset(), 0);
        assert_eq!(OutputRegion::new(0, 0).size, 0);
    }
}
