//! Shapes of an OBJ file and the materials of its MTL file.

use std::cell::{Cell, RefCell};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};

use super::Material;
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
    /// A unit normal for each vertex, world space; the triangle's own when the file has none.
    pub normals: Vec<Vec3>,
    /// Texture coordinates for each vertex; (0, 0) when the file has none.
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

/// Loads an OBJ file and the MTL files it names.
pub(super) fn load(path: &Path) -> Result<(Vec<Shape>, Vec<Material>)> {
    let file = File::open(path)
        .map_err(|error| Error::file(path, format!("cannot read the mesh: {error}")))?;
    let line = Cell::new(0);
    let mut reader = CountLines { inner: BufReader::new(file), line: &line };
    let materials: RefCell<Result<Vec<(PathBuf, tobj::Material)>>> = RefCell::new(Ok(Vec::new()));
    let folder = path.parent().unwrap_or(Path::new(""));
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
    let loaded = tobj::load_obj_buf(&mut reader, &options, |name| {
        let mtl = folder.join(name.to_string_lossy().replace('\\', "/").trim());
        let line = Cell::new(0);
        let entries = std::fs::read(&mtl).map_err(|error| error.to_string()).and_then(|text| {
            if let Some((at, message)) = short_colour(&text) {
                line.set(at);
                return Err(message);
            }
            let mut reader = CountLines { inner: text.as_slice(), line: &line };
            tobj::load_mtl_buf(&mut reader).map_err(|error| error.to_string())
        });
        entries
            .inspect(|(entries, _)| {
                if let Ok(all) = materials.borrow_mut().as_mut() {
                    all.extend(entries.iter().map(|entry| (mtl.clone(), entry.clone())));
                }
            })
            .map_err(|message| {
                let line = Some(line.get()).filter(|&line| line > 0);
                let message = format!("cannot read the materials: {message}");
                *materials.borrow_mut() = Err(Error::File { path: mtl, line, message });
                tobj::LoadError::MaterialParseError
            })
    });
    let materials = materials.into_inner()?;
    let (models, _) = loaded.map_err(|error| Error::File {
        path: path.to_owned(),
        line: Some(line.get()),
        message: format!("mesh cannot be read: {error}"),
    })?;
    let materials = materials
        .iter()
        .map(|(mtl, entry)| Material::from_mtl(mtl, entry))
        .collect::<Result<Vec<_>>>()?;
    let models = models.into_iter().filter(|model| !model.mesh.indices.is_empty());
    let shapes = models.map(|model| shape(path, model)).collect::<Result<Vec<_>>>()?;
    if shapes.is_empty() {
        return Err(Error::file(path, "mesh holds no triangle"));
    }
    Ok((shapes, materials))
}

/// The first line, from 1, whose colour has fewer than three numbers, and what to say of it: tobj
/// panics on it.
fn short_colour(mtl: &[u8]) -> Option<(usize, String)> {
    let text = String::from_utf8_lossy(mtl);
    text.lines().enumerate().find_map(|(index, line)| {
        let mut words = line.split_whitespace();
        let name = words.next().filter(|name| ["Ka", "Kd", "Ks", "Ke"].contains(name))?;
        let found = words.count();
        let message = || format!("{name} has {found} numbers, expected 3: red, green, blue");
        (found < 3).then(|| (index + 1, message()))
    })
}

fn shape(path: &Path, model: tobj::Model) -> Result<Shape> {
    let wrong = |message: String| Error::file(path, format!("shape \"{}\": {message}", model.name));
    let mesh = &model.mesh;
    let Some(material) = mesh.material_id else {
        return Err(wrong("has no material; expected a usemtl statement before its faces".into()));
    };
    let vec3s = |floats: &[f32]| -> Vec<Vec3> {
        floats.as_chunks::<3>().0.iter().map(|&v| Vec3::from(v)).collect()
    };
    let mut positions = vec3s(&mesh.positions);
    let mut normals = vec3s(&mesh.normals);
    let mut uvs: Vec<Vec2> =
        mesh.texcoords.as_chunks::<2>().0.iter().map(|&v| Vec2::from(v)).collect();
    for (statement, finite) in [
        ("v", positions.iter().all(|v| v.is_finite())),
        ("vn", normals.iter().all(|v| v.is_finite())),
        ("vt", uvs.iter().all(|v| v.is_finite())),
    ] {
        if !finite {
            return Err(Error::File {
                path: path.to_owned(),
                line: first_non_finite(path, statement),
                message: format!("shape \"{}\": a `{statement}` is not finite", model.name),
            });
        }
    }
    if uvs.len() != positions.len() {
        uvs = vec![Vec2::ZERO; positions.len()];
    }
    let mut triangles = mesh.indices.as_chunks::<3>().0.to_vec();
    if normals.len() == positions.len() {
        normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    } else {
        // Flat shading: every corner becomes a vertex with its triangle's normal.
        let corners = triangles.iter().flatten().map(|&v| v as usize);
        uvs = corners.clone().map(|v| uvs[v]).collect();
        positions = corners.map(|v| positions[v]).collect();
        normals = positions
            .as_chunks::<3>()
            .0
            .iter()
            .flat_map(|&[a, b, c]| [(b - a).cross(c - a).normalize_or_zero(); 3])
            .collect();
        triangles = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    }
    Ok(Shape { name: model.name, material, positions, normals, uvs, triangles })
}

/// The first line (from 1) whose `statement` holds a number that is not finite.
fn first_non_finite(path: &Path, statement: &str) -> Option<usize> {
    let lines = BufReader::new(File::open(path).ok()?).lines();
    lines
        .map_while(std::result::Result::ok)
        .position(|line| {
            let mut words = line.split_whitespace();
            words.next() == Some(statement)
                && words.any(|word| word.parse::<f32>().is_ok_and(|value| !value.is_finite()))
        })
        .map(|index| index + 1)
}

/// A reader that counts the lines handed out, so that a parse error can name its line.
struct CountLines<'a, R> {
    inner: R,
    line: &'a Cell<usize>,
}

impl<R: BufRead> Read for CountLines<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.inner.read(buffer)?;
        self.line.set(self.line.get() + buffer[..count].iter().filter(|&&b| b == b'\n').count());
        Ok(count)
    }
}

impl<R: BufRead> BufRead for CountLines<'_, R> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.inner.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        if let Ok(buffer) = self.inner.fill_buf() {
            let lines = buffer[..amount.min(buffer.len())].iter().filter(|&&b| b == b'\n').count();
            self.line.set(self.line.get() + lines);
        }
        self.inner.consume(amount);
    }
}
