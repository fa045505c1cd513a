//! Scenes: shapes, materials, the light, and the rays that meet them.

mod config;
mod material;
mod mesh;
mod mtl;
mod named_file;
mod obj;
mod polygon;
mod text;
mod texture;

use std::path::Path;
use std::sync::OnceLock;

use glam::{Vec2, Vec3};

pub use config::SceneConfig;
pub use material::{Material, MaterialModel};
pub use mesh::{MeshFile, Shape};
pub use mtl::UsedFile;
pub use texture::{Bitmap, Texture};

use crate::bvh::{Bvh, Hit};
use crate::ray::epsilon_at;
use crate::{Bsdf, Camera, Frame, Ray, Result, SurfaceInteraction};

/// A scene, ready to be rendered.
pub struct Scene {
    config: SceneConfig,
    shapes: Vec<Shape>,
    materials: Vec<Material>,
    /// Position and intensity.
    light: Option<(Vec3, Vec3)>,
    remarks: Vec<String>,
    /// Built for the first ray: a realtime frame has none.
    bvh: OnceLock<Bvh>,
    /// The largest coordinate of any vertex.
    extent: f32,
    /// The diagonal of the bounding box of all vertices.
    size: f32,
    /// Shape and triangle of each triangle in the hierarchy.
    triangles: Vec<(u32, u32)>,
    bsdfs: Vec<Box<dyn Bsdf>>,
    witness: Option<Box<dyn Bsdf>>,
}

impl Scene {
    /// Loads a scene's TOML file, its mesh and its materials. `make_bsdf` makes the BSDF of each
    /// material; mirrors are black in this assignment and are not asked for.
    ///
    /// # Errors
    /// When a file cannot be used; names file, line, expected and found.
    pub fn load(path: &Path, make_bsdf: &dyn Fn(&Material) -> Box<dyn Bsdf>) -> Result<Self> {
        let config = SceneConfig::load(path)?;
        let MeshFile { shapes, materials, remarks, .. } = config.load_mesh()?;
        let emits = |shape: &&Shape| materials[shape.material].is_emitter();
        let light = shapes.iter().find(emits);
        let light = light.map(|light| (light.index_mean(), materials[light.material].emission));
        let positions = || shapes.iter().flat_map(|shape| &shape.positions);
        let least = positions().copied().reduce(Vec3::min).unwrap_or_default();
        let most = positions().copied().reduce(Vec3::max).unwrap_or_default();
        let extent = least.abs().max(most.abs()).max_element();
        let mut triangles = Vec::new();
        for (index, shape) in shapes.iter().enumerate() {
            triangles.extend((0..shape.triangles.len()).map(|i| (index as u32, i as u32)));
        }
        let bsdfs = materials.iter().map(|material| match material.model {
            MaterialModel::Mirror => Box::new(Black),
            _ => make_bsdf(material),
        });
        Ok(Self {
            light,
            remarks,
            bvh: OnceLock::new(),
            extent,
            size: (most - least).length(),
            bsdfs: bsdfs.collect(),
            config,
            shapes,
            materials,
            triangles,
            witness: None,
        })
    }

    /// What the TOML file says.
    pub fn config(&self) -> &SceneConfig {
        &self.config
    }

    /// The scene's camera for a film of `width` x `height` pixels.
    ///
    /// # Errors
    /// As [`Camera::new`].
    pub fn camera(&self, width: usize, height: usize) -> Result<Camera> {
        Camera::new(self.config.camera, width, height)
    }

    /// All shapes, the emitter among them.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// All materials; [`Shape::material`] indexes them.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The material of a shape.
    pub fn material_of(&self, shape: usize) -> &Material {
        &self.materials[self.shapes[shape].material]
    }

    /// Content of its files that no picture shows, with file and line; see [`MeshFile::remarks`].
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Position (world space) and radiant intensity I [W sr^-1] of the point light, if there is one:
    /// the index mean and the Ke of the first emitter.
    pub fn light(&self) -> Option<(Vec3, Vec3)> {
        self.light
    }

    /// Position of the point light, world space: the first emitter's index mean.
    ///
    /// # Panics
    /// When the scene has no light. The host reports that as an error of the scene.
    pub fn first_light_position(&self) -> Vec3 {
        self.light.unwrap_or_else(|| self.no_light()).0
    }

    /// Radiant intensity I of the point light [W sr^-1]: the first emitter's Ke.
    ///
    /// # Panics
    /// When the scene has no light. The host reports that as an error of the scene.
    pub fn first_light_intensity(&self) -> Vec3 {
        self.light.unwrap_or_else(|| self.no_light()).1
    }

    #[cold]
    fn no_light(&self) -> ! {
        let mesh = self.config.mesh.display();
        panic!("{NO_LIGHT}: no shape of {mesh} has a material with a Ke above 0");
    }

    /// The BSDF at a surface point.
    pub fn bsdf(&self, i: &SurfaceInteraction) -> &dyn Bsdf {
        match &self.witness {
            Some(witness) => witness.as_ref(),
            None => self.bsdfs[self.shapes[i.shape].material].as_ref(),
        }
    }

    /// The closest surface along a ray, with `wo` set to where the ray came from.
    ///
    /// The emitter is a surface like any other here.
    ///
    /// # Panics
    /// While a render pass lives: a realtime frame has no rays, its pixels come from the shaders.
    pub fn intersect(&self, ray: &Ray) -> Option<SurfaceInteraction> {
        let hit = self.bvh().closest_hit(&ray.begun_off_surface(self.extent))?;
        Some(self.interaction(ray, &hit))
    }

    /// Whether anything lies on a ray between its `min_t` and `max_t`: a shadow query. It stops
    /// at the first hit, whichever that is. Emitters never block.
    ///
    /// # Panics
    /// As [`Scene::intersect`].
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.bvh().any_hit(&ray.begun_off_surface(self.extent))
    }

    /// [`Scene::intersect`] for each of eight rays; `None` where there is no ray. It is twice as fast for rays that lie
    /// close together, such as those of a pixel.
    ///
    /// # Panics
    /// As [`Scene::intersect`].
    pub fn intersect_eight(&self, rays: &[Option<Ray>; 8]) -> [Option<SurfaceInteraction>; 8] {
        let hits = self.bvh().closest_hits(&self.begun_off_surface(rays));
        std::array::from_fn(|i| Some(self.interaction(rays[i].as_ref()?, hits[i].as_ref()?)))
    }

    /// [`Scene::occluded`] for each of eight rays; false where there is no ray. It is faster where rays lie close
    /// together, such as those from neighboring points to one light.
    ///
    /// # Panics
    /// As [`Scene::intersect`].
    pub fn occluded_eight(&self, rays: &[Option<Ray>; 8]) -> [bool; 8] {
        self.bvh().any_hits(&self.begun_off_surface(rays))
    }

    fn begun_off_surface(&self, rays: &[Option<Ray>; 8]) -> [Option<Ray>; 8] {
        rays.map(|ray| Some(ray?.begun_off_surface(self.extent)))
    }

    fn bvh(&self) -> &Bvh {
        self.bvh.get_or_init(|| {
            let place = |&(shape, primitive): &(u32, u32)| (shape as usize, primitive as usize);
            let corners =
                |(shape, primitive): (usize, usize)| self.shapes[shape].corners(primitive);
            let blocks = |(shape, _): (usize, usize)| !self.material_of(shape).is_emitter();
            let vertices: Vec<_> = self.triangles.iter().map(place).map(corners).collect();
            let blocks: Vec<_> = self.triangles.iter().map(place).map(blocks).collect();
            Bvh::new(&vertices, &blocks)
        })
    }

    /// Puts `witness` in the place of every BSDF until it is taken away with `None`.
    pub fn set_witness(&mut self, witness: Option<Box<dyn Bsdf>>) {
        self.witness = witness;
    }

    /// A copy for render passes, with all normals negated. It has no BSDFs.
    pub(crate) fn with_negated_normals(&self) -> Self {
        let negated = |shape: &Shape| Shape {
            normals: shape.normals.iter().map(|normal| -*normal).collect(),
            ..shape.clone()
        };
        Self {
            config: self.config.clone(),
            shapes: self.shapes.iter().map(negated).collect(),
            materials: self.materials.clone(),
            remarks: self.remarks.clone(),
            bvh: OnceLock::new(),
            triangles: self.triangles.clone(),
            bsdfs: Vec::new(),
            witness: None,
            ..*self
        }
    }

    /// A surface point on triangle `primitive` of `shape`, with texture coordinates given; the
    /// position is the triangle's first corner. For looking up a BSDF without a ray.
    pub(crate) fn point_on(
        &self,
        shape: usize,
        primitive: usize,
        uv: Vec2,
    ) -> Option<SurfaceInteraction> {
        let corners =
            self.shapes.get(shape).filter(|s| primitive < s.triangles.len())?.corners(primitive);
        let ng = triangle_normal(corners);
        let frame_ns = Frame::from_normal(if ng == Vec3::ZERO { Vec3::Z } else { ng });
        let zero = Vec3::ZERO;
        Some(SurfaceInteraction {
            t: 0.0,
            p: corners[0],
            uv,
            ng,
            frame_ns,
            wo: zero,
            wi: zero,
            shape,
            primitive,
            epsilon: epsilon_at(corners[0], 0.0, &corners, self.size),
        })
    }

    fn interaction(&self, ray: &Ray, hit: &Hit) -> SurfaceInteraction {
        let (shape_index, primitive) = self.triangles[hit.triangle];
        let shape = &self.shapes[shape_index as usize];
        let vertices = shape.triangles[primitive as usize].map(|vertex| vertex as usize);
        let [u, v] = hit.barycentric;
        let w = 1.0 - u - v;
        let corners = shape.corners(primitive as usize);
        let ng = triangle_normal(corners);
        let p = ray.at(hit.t);
        let [n0, n1, n2] = vertices.map(|vertex| shape.normals[vertex]);
        let [uv0, uv1, uv2] = vertices.map(|vertex| shape.uvs[vertex]);
        let ns = (w * n0 + u * n1 + v * n2).normalize_or(ng);
        let frame_ns = Frame::from_normal(ns);
        SurfaceInteraction {
            t: hit.t,
            p,
            uv: w * uv0 + u * uv1 + v * uv2,
            ng,
            wo: frame_ns.to_local(-ray.direction),
            frame_ns,
            wi: Vec3::ZERO,
            shape: shape_index as usize,
            primitive: primitive as usize,
            epsilon: epsilon_at(p, hit.t, &corners, self.size),
        }
    }
}

/// The beginning of the panic message when a renderer asks for the light of a scene without one.
pub(crate) const NO_LIGHT: &str = "the scene has no light";

/// The BSDF of surfaces without one: reflects nothing.
struct Black;

impl Bsdf for Black {
    fn eval(&self, _: &SurfaceInteraction) -> Vec3 {
        Vec3::ZERO
    }
}

fn triangle_normal([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(c - a).normalize_or_zero()
}

#[cfg(test)]
mod tests;
