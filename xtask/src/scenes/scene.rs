//! A scene as data: shapes with a material each, one light, a camera, a film.

use super::mesh::Mesh;
use super::shapes::quad;
use super::textures::Texture;
use glam::{DVec3, dvec3};

/// Where the picture is taken from; `fov_deg` is the full vertical angle.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    pub eye: DVec3,
    pub at: DVec3,
    pub fov_deg: f64,
}

/// What a shape is made of. Reflectivities are linear RGB.
#[derive(Clone, Debug)]
pub enum Material {
    /// MTL `illum 7`.
    Diffuse { kd: [f64; 3], map_kd: Option<&'static str> },
    /// MTL `illum 2`, with Phong exponent `ns`.
    Phong {
        kd: [f64; 3],
        ks: [f64; 3],
        ns: f64,
        map_kd: Option<&'static str>,
        map_ks: Option<&'static str>,
    },
    /// MTL `illum 5`: black offline, a plain diffuse `kd` in realtime.
    Mirror { kd: [f64; 3], ks: [f64; 3] },
    /// The point light: `ke` is its radiant intensity [W sr^-1].
    Emitter { ke: [f64; 3] },
}

impl Material {
    pub fn diffuse(kd: [f64; 3]) -> Self {
        Self::Diffuse { kd, map_kd: None }
    }

    pub fn phong(kd: [f64; 3], ks: [f64; 3], ns: f64) -> Self {
        Self::Phong { kd, ks, ns, map_kd: None, map_ks: None }
    }
}

/// One `o` group of the OBJ file.
#[derive(Clone, Debug)]
pub struct Shape {
    pub name: &'static str,
    pub material: Material,
    pub mesh: Mesh,
}

/// One scene folder.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The folder below `scenes/a2`.
    pub folder: String,
    /// Name of the TOML files before `_offline`, `_realtime` and `_realtime_bonus`.
    pub name: &'static str,
    /// Name of the OBJ and MTL files.
    pub mesh_name: &'static str,
    /// Whether there is a `_realtime_bonus` variant.
    pub bonus: bool,
    pub camera: Camera,
    /// Width and height in pixels.
    pub film: [u32; 2],
    /// Samples per pixel offline.
    pub spp: u32,
    pub shapes: Vec<Shape>,
    /// Whether the MTL file lists the materials in the reverse order of the shapes.
    pub listed_backward: bool,
    pub textures: Vec<Texture>,
}

impl Scene {
    /// An empty scene whose files all carry its name.
    pub fn new(folder: &str, name: &'static str, camera: Camera, film: [u32; 2]) -> Self {
        let folder = folder.to_string();
        Self {
            folder,
            name,
            mesh_name: name,
            bonus: false,
            camera,
            film,
            spp: 16,
            shapes: Vec::new(),
            listed_backward: false,
            textures: Vec::new(),
        }
    }

    /// The scene with one shape more.
    pub fn with(mut self, name: &'static str, material: Material, mesh: Mesh) -> Self {
        self.shapes.push(Shape { name, material, mesh });
        self
    }

    /// The scene with its point light: a level quad 2e-6 wide, as in the original course.
    pub fn lit_by(self, position: DVec3, intensity: [f64; 3]) -> Self {
        let e = 1e-6;
        let light =
            quad(position + dvec3(-e, 0.0, -e), dvec3(2.0 * e, 0.0, 0.0), dvec3(0.0, 0.0, 2.0 * e));
        self.with("light", Material::Emitter { ke: intensity }, light)
    }

    /// Where the point light is: the mean of the first emitter's positions over its index list.
    pub fn light(&self) -> DVec3 {
        let emitter =
            self.shapes.iter().find(|shape| matches!(shape.material, Material::Emitter { .. }));
        let mesh = &emitter.expect("every scene has an emitter").mesh;
        let indices = mesh.triangles.as_flattened();
        indices.iter().map(|&i| mesh.vertices[i as usize].position).sum::<DVec3>()
            / indices.len() as f64
    }
}
