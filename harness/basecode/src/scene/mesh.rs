//! Shapes of an OBJ file, with the materials of its MTL files.

use std::path::Path;

use glam::{Vec2, Vec3};

use super::Material;
use super::mtl::{Library, UsedFile};
use super::named_file::shown;
use super::obj::{Corner, MISSING, Obj, Part};
use super::polygon::triangulate;
use super::text::{begins_as, decode, read};
use crate::{Error, Result};

/// A triangle mesh with one material.
#[derive(Clone, Debug)]
pub struct Shape {
    /// The name in the OBJ file.
    pub name: String,
    /// Index of its material in [`super::Scene::materials`].
    pub material: usize,
    /// Vertex positions, world space.
    pub positions: Vec<Vec3>,
    /// A unit normal for each vertex, world space; the triangle's own where the file gives none.
    pub normals: Vec<Vec3>,
    /// Texture coordinates for each vertex; (0, 0) where the file gives none.
    pub uvs: Vec<Vec2>,
    /// Three vertices for each triangle, anticlockwise when seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// The corners of triangle `primitive`, world space.
    pub fn corners(&self, primitive: usize) -> [Vec3; 3] {
        self.triangles[primitive].map(|vertex| self.positions[vertex as usize])
    }

    /// The mean of the positions over the index list: a vertex counts as often as it is used.
    pub fn index_mean(&self) -> Vec3 {
        let indices = self.triangles.iter().flatten();
        let sum: glam::DVec3 = indices.map(|&v| self.positions[v as usize].as_dvec3()).sum();
        (sum / (3 * self.triangles.len()) as f64).as_vec3()
    }
}

/// The content of an OBJ file and of the MTL files that it names.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// Its shapes: one for each run of faces with one object or group and one material.
    pub shapes: Vec<Shape>,
    /// All materials.
    pub materials: Vec<Material>,
    /// What was left out, with file and line: lines and points, which have no area; maps and
    /// statements that are not supported; what is wrong with materials that no face uses.
    pub remarks: Vec<String>,
    /// The files that it was made of: OBJ, MTL, textures of materials that a face uses.
    pub files: Vec<UsedFile>,
}

/// Coordinates up to this give right pictures: in 32 bits, distances in a small scene survive no larger ones.
const LARGEST: f32 = 1e6;

impl MeshFile {
    /// Loads an OBJ file, the MTL files that it names, and their textures.
    ///
    /// # Errors
    /// When a file cannot be used; names file, line, expected and found.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = read(path)
            .map_err(|error| Error::file(path, format!("cannot read the mesh: {error}")))?;
        let text = decode(&bytes);
        let obj = Obj::parse(path, &text)?;
        let mut library = Library::load(path, &obj.libraries)?;
        // A statement that is not understood may be what is missing.
        let ignored = [&obj.ignored[..], &library.ignored[..]].concat();
        let material = |part| material_of(path, &obj, &library, part);
        let used = obj.parts.iter().map(material).collect::<Result<Vec<_>>>();
        let used = used.map_err(|error| error.also(&ignored))?;
        let files = library.settle(&used)?;
        let mut builder = Builder { obj: &obj, newest: vec![MISSING; obj.positions.len()] };
        let parts = obj.parts.iter().zip(used);
        let shapes: Vec<_> = parts.map(|(part, used)| builder.shape(part, used)).collect();
        if shapes.is_empty() {
            let what = match (obj.positions.len(), obj.faces.len()) {
                (0, _) => {
                    let begins = begins_as(&bytes, &text);
                    format!(
                        "it has no vertex (v) and no face (f), and {begins}: is it an OBJ file?"
                    )
                }
                (vertices, _) => format!("it has {vertices} vertices (v) and no face (f)"),
            };
            return Err(Error::file(path, format!("mesh holds no triangle: {what}")));
        }
        let emits = |shape: &&Shape| library.materials[shape.material].is_emitter();
        let mut lights = shapes.iter().filter(emits);
        let mut remarks = [&obj.remarks[..], &library.remarks[..], &ignored[..]].concat();
        let is_used = |index: usize| obj.parts.iter().any(|part| part.material == Some(index));
        for (index, nameless) in obj.uses.iter().enumerate() {
            if nameless.name.is_empty() && !is_used(index) {
                let (path, line) = (path.display(), nameless.line);
                remarks.push(format!("{path}:{line}: {NAMELESS}; no face uses it"));
            }
        }
        if let (Some(first), more @ 1..) = (lights.next(), lights.count()) {
            remarks.push(format!(
                "{}: {} shapes emit light; the light is the first, \"{}\", of material \"{}\"",
                path.display(),
                more + 1,
                first.name,
                library.materials[first.material].name
            ));
        }
        let coordinates = shapes.iter().flat_map(|shape| &shape.positions);
        let largest = coordinates.fold(0.0, |most: f32, p| most.max(p.abs().max_element()));
        if largest > LARGEST {
            remarks.push(format!(
                "{}: a vertex lies at {largest:e}; beyond {LARGEST:e} from the origin, pictures are wrong",
                path.display()
            ));
        }
        let own = UsedFile { path: path.to_owned(), named_at: None };
        let files = std::iter::once(own).chain(files).collect();
        Ok(Self { shapes, materials: library.materials, remarks, files })
    }
}

const NAMELESS: &str = "usemtl names no material";

/// Index of the material of a part.
fn material_of(path: &Path, obj: &Obj, library: &Library, part: &Part) -> Result<usize> {
    let wrong = |line, message| Error::File { path: path.to_owned(), line: Some(line), message };
    let Some(used) = part.material.map(|index| &obj.uses[index]) else {
        let line = obj.faces[part.faces.start].line as usize;
        let message = "face has no material; expected a usemtl statement before it";
        return Err(wrong(line, message.to_owned()));
    };
    if used.name.is_empty() {
        return Err(wrong(used.line, NAMELESS.to_owned()));
    }
    library.find(&used.name).ok_or_else(|| {
        wrong(used.line, format!("material \"{}\" is {}", shown(&used.name), library.lacks()))
    })
}

/// Makes shapes; corners that are the same vertex share it.
struct Builder<'a> {
    obj: &'a Obj,
    /// For each position of the file, the newest vertex of the current shape made of it.
    newest: Vec<u32>,
}

impl Builder<'_> {
    fn shape(&mut self, part: &Part, material: usize) -> Shape {
        let mut shape = Shape {
            name: part.name.clone(),
            material,
            positions: Vec::new(),
            normals: Vec::new(),
            uvs: Vec::new(),
            triangles: Vec::new(),
        };
        // What each vertex was made of, and the vertex made before it of the same position.
        let mut made: Vec<(Corner, u32)> = Vec::new();
        let mut outline = Vec::new();
        for face in &self.obj.faces[part.faces.clone()] {
            let corners = &self.obj.corners[face.range()];
            let position = |corner: &Corner| self.obj.positions[corner.v as usize];
            outline.clear();
            outline.extend(corners.iter().map(position));
            let mut add = |triangle: [usize; 3]| {
                let [a, b, c] = triangle.map(|i| outline[i]);
                let flat = || (b - a).cross(c - a).normalize_or_zero();
                let vertices =
                    triangle.map(|i| self.vertex(corners[i], flat, &mut shape, &mut made));
                shape.triangles.push(vertices);
            };
            match corners.len() {
                3 => add([0, 1, 2]),
                _ => triangulate(&outline).into_iter().for_each(add),
            }
        }
        for (corner, _) in made {
            self.newest[corner.v as usize] = MISSING;
        }
        shape
    }

    /// The vertex of a corner. One without a normal has its triangle's, `flat()`, and is not shared.
    fn vertex(
        &mut self,
        corner: Corner,
        flat: impl Fn() -> Vec3,
        shape: &mut Shape,
        made: &mut Vec<(Corner, u32)>,
    ) -> u32 {
        let newest = &mut self.newest[corner.v as usize];
        if corner.vn != MISSING {
            let mut candidate = *newest;
            while candidate != MISSING {
                let (of, before) = made[candidate as usize];
                if of == corner {
                    return candidate;
                }
                candidate = before;
            }
        }
        let vertex = made.len() as u32;
        made.push((corner, *newest));
        if corner.vn != MISSING {
            *newest = vertex;
        }
        let obj = self.obj;
        shape.positions.push(obj.positions[corner.v as usize]);
        shape.normals.push(match obj.normals.get(corner.vn as usize) {
            Some(normal) => normal.normalize_or_zero(),
            None => flat(),
        });
        shape.uvs.push(obj.uvs.get(corner.vt as usize).copied().unwrap_or_default());
        vertex
    }
}
