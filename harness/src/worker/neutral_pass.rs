//! Umbra's own realtime pass: it draws a scene with given stage texts, and no foreign code runs.
//!
//! It follows the shader contract, so any error in its picture is the stages' fault. Of a student's work it sees only
//! WGSL text.

use std::path::{Path, PathBuf};

use basecode::gpu::{
    self, EMITTER_FS, FRAME_GROUP, FrameUniforms, Gpu, MATERIAL_GROUP, MaterialUniforms, Mesh,
    OBJECT_GROUP, ObjectUniforms, SHADOW_GROUP, ShadowMap, Stage, Target, Uniform,
};
use basecode::{Camera, CameraConfig, Error, Mat4, MaterialModel, Scene, wgpu};

use super::job::{Adapter, AdapterKind, Request, STAGES};
use crate::expected::load_scene;
use crate::plugin::{CallError, CallErrorKind};

/// The pass, with what one request leaves for the next: most of what a small frame costs is
/// opening the device and compiling stages.
#[derive(Default)]
pub struct Neutral {
    scene: Option<(PathBuf, Scene)>,
    open: Option<Open>,
    /// Texts that do not compile, each with the reason.
    refused: Vec<(String, String)>,
}

/// Why nothing was drawn.
enum Failure {
    /// A stage does not compile.
    Stage(String),
    Other(Error),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Other(error)
    }
}

/// An open device, and the texts that it compiled.
struct Open {
    gpu: Gpu,
    compiled: Vec<String>,
}

impl Neutral {
    /// Draws a [`Request::RenderRealtime`] into `values`, frame after frame. Answers adapter and driver.
    ///
    /// # Errors
    /// [`CallErrorKind::NoAdapter`] without an adapter, [`CallErrorKind::Stage`] for a stage that is no
    /// WGSL, [`CallErrorKind::Failed`] for stages that do not fit this pass or each other,
    /// [`CallErrorKind::Ours`] for a request that is not one.
    pub fn render(&mut self, request: &Request, values: &mut [f32]) -> Result<String, CallError> {
        let Request::RenderRealtime { scene, width, height, adapter, stages, cameras, .. } =
            request
        else {
            return Err(ours("the neutral pass draws realtime images only"));
        };
        let mut texts = [""; 3];
        for (text, name) in texts.iter_mut().zip(STAGES) {
            let stage = stages.iter().find(|stage| stage.name == name);
            *text = &stage.ok_or_else(|| ours("the neutral pass needs all three stages"))?.text;
        }
        let refused = &mut self.refused;
        if let Some((_, why)) = refused.iter().find(|(text, _)| texts.contains(&text.as_str())) {
            return Err(CallError { kind: CallErrorKind::Stage, message: why.clone() });
        }
        // A device on which something failed is not used again: here it is dropped on errors.
        let mut open = self.open.take();
        let mut draw = || -> Result<String, Failure> {
            let open = match &mut open {
                Some(open) => open,
                closed => closed.insert(Open::new(adapter)?),
            };
            open.compile(texts, refused)?;
            let scene = load(&mut self.scene, &scene.path)?;
            let (width, height) = (*width as usize, *height as usize);
            let target = Target::new(&open.gpu, width, height)?;
            let pass = NeutralPass::new(&open.gpu, scene, texts)?;
            for (camera, frame) in cameras.iter().zip(values.chunks_mut(3 * width * height)) {
                let config = CameraConfig {
                    eye: camera.eye.into(),
                    at: camera.at.into(),
                    up: camera.up.into(),
                    fov_y_deg: camera.fov_y_deg,
                };
                let matrices = camera.matrices;
                let camera = Camera::new(config, width, height)?.with_matrices(matrices);
                open.gpu.checked(&mut || pass.draw(&open.gpu, &camera, &target))?;
                let image = target.read_back(&open.gpu)?;
                frame.copy_from_slice(
                    image.pixels.iter().flat_map(|p| p.to_array()).collect::<Vec<_>>().as_slice(),
                );
            }
            let wgpu::AdapterInfo { name, driver, driver_info, .. } = &open.gpu.adapter;
            Ok(format!("{name}, {driver}, {driver_info}"))
        };
        let drawn = draw();
        if drawn.is_ok() {
            self.open = open;
        }
        drawn.map_err(|failure| {
            let (kind, message) = match failure {
                Failure::Stage(why) => (CallErrorKind::Stage, why),
                Failure::Other(error @ Error::NoAdapter(_)) => {
                    (CallErrorKind::NoAdapter, error.to_string())
                }
                Failure::Other(error @ Error::Gpu(_)) => (CallErrorKind::Failed, error.to_string()),
                Failure::Other(error) => (CallErrorKind::Ours, error.to_string()),
            };
            CallError { kind, message }
        })
    }
}

/// The scene of a file, kept because requests about one scene come together.
fn load<'s>(kept: &'s mut Option<(PathBuf, Scene)>, path: &Path) -> basecode::Result<&'s Scene> {
    let scene = match kept.take() {
        Some((loaded, scene)) if loaded == path => scene,
        _ => load_scene(path)?,
    };
    Ok(&kept.insert((path.to_owned(), scene)).1)
}

impl Open {
    fn new(adapter: &Adapter) -> basecode::Result<Self> {
        let kind = match adapter.kind {
            AdapterKind::Any => gpu::AdapterKind::Any,
            AdapterKind::Software => gpu::AdapterKind::Software,
            AdapterKind::Hardware => gpu::AdapterKind::Hardware,
        };
        Ok(Self { gpu: Gpu::open(kind, &adapter.name)?, compiled: Vec::new() })
    }

    /// Compiles each stage by itself, so that what is no WGSL is told from what only does not fit.
    fn compile(
        &mut self,
        texts: [&str; 3],
        refused: &mut Vec<(String, String)>,
    ) -> Result<(), Failure> {
        for (name, text) in STAGES.into_iter().zip(texts) {
            if self.compiled.iter().any(|known| known == text) {
                continue;
            }
            match self.gpu.check_stage(Stage { name, text }) {
                Err(Error::Gpu(why)) => {
                    refused.push((text.to_owned(), why.clone()));
                    return Err(Failure::Stage(why));
                }
                checked => checked?,
            }
            self.compiled.push(text.to_owned());
        }
        Ok(())
    }
}

fn ours(message: &str) -> CallError {
    CallError { kind: CallErrorKind::Ours, message: message.to_owned() }
}

/// A shape on the device, with the pipeline that its material asks for.
struct Object {
    mesh: Mesh,
    placement: Uniform,
    surface: Uniform,
    pipeline: usize,
}

struct NeutralPass {
    /// Diffuse, Phong, emitter.
    pipelines: [wgpu::RenderPipeline; 3],
    frame: Uniform,
    objects: Vec<Object>,
    shadow: ShadowMap,
    light: [glam::Vec4; 2],
}

impl NeutralPass {
    fn new(gpu: &Gpu, scene: &Scene, [vs, diffuse, phong]: [&str; 3]) -> basecode::Result<Self> {
        let vertex = Stage { name: STAGES[0], text: vs };
        let pipeline = |fragment| gpu.checked(&mut || Ok(gpu.pipeline(vertex, fragment)));
        let pipelines = [
            pipeline(Stage { name: STAGES[1], text: diffuse })?,
            pipeline(Stage { name: STAGES[2], text: phong })?,
            pipeline(EMITTER_FS)?,
        ];
        let object = |(index, shape)| {
            let material = scene.material_of(index);
            let scale = material.energy_scale();
            let uniforms = MaterialUniforms::new(
                scale * material.diffuse.average(),
                scale * material.specular.average(),
                material.exponent,
            );
            Object {
                mesh: Mesh::new(gpu, shape),
                placement: Uniform::object(gpu, &ObjectUniforms::new(Mat4::IDENTITY)),
                surface: Uniform::material(gpu, &uniforms),
                pipeline: match material.model {
                    _ if material.is_emitter() => 2,
                    MaterialModel::Phong => 1,
                    MaterialModel::Diffuse | MaterialModel::Mirror => 0,
                },
            }
        };
        gpu.checked(&mut || {
            Ok(Self {
                pipelines: pipelines.clone(),
                frame: Uniform::frame(gpu, &FrameUniforms::new(&scene.camera(1, 1)?)),
                objects: scene.shapes().iter().enumerate().map(object).collect(),
                shadow: ShadowMap::off(gpu),
                light: [
                    scene.first_light_position().extend(1.0),
                    scene.first_light_intensity().extend(0.0),
                ],
            })
        })
    }

    fn draw(&self, gpu: &Gpu, camera: &Camera, target: &Target) -> basecode::Result<()> {
        let [light_position, light_intensity] = self.light;
        let frame = FrameUniforms { light_position, light_intensity, ..FrameUniforms::new(camera) };
        self.frame.write_frame(gpu, &frame);
        let mut encoder = gpu.encoder();
        let mut pass = target.begin(&mut encoder);
        pass.set_bind_group(FRAME_GROUP, &self.frame.bind_group, &[]);
        pass.set_bind_group(SHADOW_GROUP, &self.shadow.bind_group, &[]);
        for object in &self.objects {
            pass.set_pipeline(&self.pipelines[object.pipeline]);
            pass.set_bind_group(OBJECT_GROUP, &object.placement.bind_group, &[]);
            pass.set_bind_group(MATERIAL_GROUP, &object.surface.bind_group, &[]);
            pass.set_vertex_buffer(0, object.mesh.vertices.slice(..));
            pass.set_index_buffer(object.mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..object.mesh.index_count, 0, 0..1);
        }
        drop(pass);
        gpu.submit(encoder);
        Ok(())
    }
}
