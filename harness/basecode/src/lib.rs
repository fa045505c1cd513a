//! What a renderer author starts from: scenes, rays, cameras, films and the safe [`Renderer`] trait.
//!
//! # Conventions, fixed here once
//! * World space is right-handed, y is up. Lengths are in scene units.
//! * Colors are linear RGB, Rec. 709 primaries. Radiance L is in W m^-2 sr^-1, radiant
//!   intensity I in W sr^-1.
//! * Images are row-major and row 0 is the *top* row; pixel (x, y) covers [x, x+1) x [y, y+1).
//! * `wo` points toward the viewer, `wi` toward the light. Both are unit vectors that *leave* the
//!   surface, and inside a BSDF both are in the local shading frame, whose z axis is the normal.
//! * [`Bsdf::eval`] *includes* the cosine foreshortening factor of `wi`.
//! * Angles carry their unit in their name (`fov_y_deg`).
//!
//! # Where to find what
//! | you want to | look at |
//! |---|---|
//! | write a material | [`Bsdf`], [`SurfaceInteraction`], [`Frame`], [`Texture`] |
//! | write an integrator | [`Integrator`], [`Scene::intersect`], [`Scene::occluded`], [`Ray`] |
//! | write the render loop | [`Renderer::render`], [`RenderJob`], [`Film`], [`Sampler`], [`Camera`] |
//! | write a realtime pass | [`gpu`], [`gpu::RenderPass`] and `docs/shader_contract.md` |
//! | draw a shadow map (bonus) | [`gpu::ShadowMap`], [`gpu::perspective`], [`gpu::look_at`] |
//!
//! # A minimal renderer
//! It draws every surface the color of its normal, offline only. Compiled as a `cdylib`, this is a
//! plugin that `umbra render --plugin` loads.
//! ```
//! use basecode::gpu::{Gpu, RenderPass};
//! use basecode::*;
//!
//! struct Normals;
//!
//! impl Integrator for Normals {
//!     fn radiance(&self, scene: &Scene, ray: &Ray, _: &Sampler) -> Vec3 {
//!         scene.intersect(ray).map_or(Vec3::ZERO, |hit| hit.frame_ns.n.abs())
//!     }
//! }
//!
//! impl Bsdf for Normals {
//!     fn eval(&self, _: &SurfaceInteraction) -> Vec3 {
//!         Vec3::ZERO // Reflects nothing.
//!     }
//! }
//!
//! impl Renderer for Normals {
//!     fn new(_options: &str) -> Result<Self> {
//!         Ok(Normals)
//!     }
//!     fn bsdf(&self, _: &Material) -> Box<dyn Bsdf> {
//!         Box::new(Normals)
//!     }
//!     fn integrator(&self, _: ShadingKind, _shadows: bool) -> Result<Box<dyn Integrator>> {
//!         Ok(Box::new(Normals))
//!     }
//!     fn render(&self, scene: &Scene, by: &dyn Integrator, job: &RenderJob, film: &mut Film) -> Result<()> {
//!         let camera = scene.camera(job.width, job.height)?;
//!         job.for_each_row(film, &|y, row| {
//!             let sampler = Sampler::new(job.seed + y as u64);
//!             for (x, pixel) in row.iter_mut().enumerate() {
//!                 *pixel = by.radiance(scene, &camera.ray(x as f32 + 0.5, y as f32 + 0.5), &sampler);
//!             }
//!         })
//!     }
//!     fn render_pass(&self, _: ShadingKind, _: &Gpu, _: &Scene, _: bool) -> Result<Box<dyn RenderPass>> {
//!         Err(Error::NotImplemented("realtime".into()))
//!     }
//! }
//!
//! export_renderer!(Normals, "normals", "1.0");
//! # fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
//! #     // One triangle that fills the view and faces the eye: its normal is +z.
//! #     let dir = std::env::temp_dir().join(format!("basecode-doctest-{}", std::process::id()));
//! #     std::fs::create_dir_all(&dir)?;
//! #     std::fs::write(dir.join("t.obj"), "mtllib t.mtl\nv -9 -9 0\nv 9 -9 0\nv 0 9 0\nusemtl m\nf 1 2 3\n")?;
//! #     std::fs::write(dir.join("t.mtl"), "newmtl m\nKd 1 1 1\nillum 7\n")?;
//! # let text = "[input]\nobjfile = 't.obj'\n[camera]\neye = [0, 0, 4]\nat = [0, 0, 0]\nup = [0, 1, 0]\nfov = 30\n";
//! #     std::fs::write(dir.join("t.toml"), text)?;
//! #     let renderer = Normals::new("")?;
//! #     let scene = Scene::load(&dir.join("t.toml"), &|material| renderer.bsdf(material))?;
//! #     std::fs::remove_dir_all(&dir)?;
//! # let job = RenderJob { width: 4, height: 3, spp: 1, seed: 0, threads: 1, progress: &|_, _| {}, cancelled: &|| false
//! };
//! #     let mut pixels = [Vec3::ZERO; 12];
//! #     let integrator = renderer.integrator(ShadingKind::Normal, false)?;
//! #     renderer.render(&scene, integrator.as_ref(), &job, &mut Film::new(4, &mut pixels))?;
//! #     assert_eq!(pixels, [Vec3::Z; 12]);
//! #     Ok(())
//! # }
//! ```

mod bsdf;
mod bvh;
mod camera;
mod error;
pub mod export;
pub mod exr_io;
mod film;
mod frame;
pub mod gpu;
pub mod image;
mod ray;
#[doc(hidden)]
pub mod realtime;
mod renderer;
mod sampler;
pub mod scene;

pub use bsdf::{Bsdf, ShadingKind};
pub use bvh::Bvh;
pub use camera::{Camera, CameraConfig, Matrices};
pub use error::{Error, Result};
pub use film::Film;
pub use frame::Frame;
pub use glam::{Mat3, Mat4, Vec2, Vec3, Vec4, vec2, vec3, vec4};
pub use image::Image;
pub use ray::{Ray, SurfaceInteraction};
pub use renderer::{Integrator, RenderJob, Renderer};
pub use sampler::Sampler;
pub use scene::{Material, MaterialModel, Scene, Shape, Texture};
pub use {bytemuck, glam};

/// The graphics library. [`gpu::Device`] and [`gpu::Queue`] stand for its own types of these names, so
/// that functions which take a `&wgpu::Device` take [`gpu::Gpu::device`].
pub mod wgpu {
    pub use ::wgpu::*;

    pub use crate::gpu::{Device, Queue};
}

/// The constant 1 / pi.
pub const INV_PI: f32 = std::f32::consts::FRAC_1_PI;
/// The constant 1 / (2 pi).
pub const INV_TWO_PI: f32 = 0.5 * std::f32::consts::FRAC_1_PI;
