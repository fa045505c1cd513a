//! The statements of an OBJ file.
//!
//! Written after Wavefront's specification ("Advanced Visualizer Manual", appendix B1), and as
//! lenient as the exporters in use demand.

use std::ops::Range;
use std::path::Path;

use glam::{Vec2, Vec3};

use super::text::{Statements, split_keyword, unquoted, without_comment};
use crate::{Error, Result};

/// What a corner does not have.
pub(super) const MISSING: u32 = u32::MAX;

/// The corner of a face: indices from 0 of position, texture coordinates ([`MISSING`] without) and
/// normal ([`MISSING`] without).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    pub v: u32,
    pub vt: u32,
    pub vn: u32,
}

/// A polygon of three corners or more.
#[derive(Clone, Debug)]
pub(super) struct Face {
    /// Its line, from 1.
    pub line: usize,
    /// Where its corners lie in [`Obj::corners`].
    pub corners: Range<usize>,
}

/// A name, and the line that gives it.
#[derive(Clone, Debug)]
pub(super) struct Named {
    /// The line, from 1.
    pub line: usize,
    /// The name.
    pub name: String,
}

/// Consecutive faces of one object or group with one material.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// The name of the object or group.
    pub name: String,
    /// Index of its `usemtl` statement in [`Obj::uses`].
    pub material: Option<usize>,
    /// Its faces.
    pub faces: Range<usize>,
}

/// An OBJ file as it was written; indices are within bounds.
#[derive(Debug, Default)]
pub(super) struct Obj {
    pub positions: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    pub corners: Vec<Corner>,
    pub faces: Vec<Face>,
    pub parts: Vec<Part>,
    /// The `usemtl` statements.
    pub uses: Vec<Named>,
    /// What follows `mtllib`, as it stands there.
    pub libraries: Vec<Named>,
    /// What was left out.
    pub remarks: Vec<String>,
}

impl Obj {
    /// Reads a text; `path` only names it in messages.
    ///
    /// # Errors
    /// At the first statement that cannot be understood, or that names a vertex that is not there.
    pub(super) fn parse(path: &Path, text: &str) -> Result<Self> {
        let mut reader = Reader { path, ..Reader::default() };
        for (line, statement) in Statements::new(text) {
            reader.read(line, &statement)?;
        }
        reader.finish()
    }
}

/// An OBJ file on its way in.
struct Reader<'a> {
    path: &'a Path,
    obj: Obj,
    name: String,
    material: Option<usize>,
    first_face: usize,
    /// Numbers that are not finite: statement, index, line. Only a face that uses them is an error.
    not_finite: Vec<(&'static str, usize, usize)>,
    /// What has no area: words for one and for several, how many, the first's line.
    without_area: [((&'static str, &'static str), usize, usize); 3],
}

const UNNAMED: &str = "unnamed_object";

impl Default for Reader<'_> {
    fn default() -> Self {
        Self {
            path: Path::new(""),
            obj: Obj::default(),
            name: UNNAMED.to_owned(),
            material: None,
            first_face: 0,
            not_finite: Vec::new(),
            without_area: [
                (("point (p) has", "points (p) have"), 0, 0),
                (("line (l) has", "lines (l) have"), 0, 0),
                (("face of fewer than 3 corners has", "faces of fewer than 3 corners have"), 0, 0),
            ],
        }
    }
}

impl Reader<'_> {
    fn wrong(&self, line: usize, message: String) -> Error {
        Error::File { path: self.path.to_owned(), line: Some(line), message }
    }

    fn read(&mut self, line: usize, statement: &str) -> Result<()> {
        let (keyword, rest) = split_keyword(statement);
        // Some write them in upper case.
        let lower = keyword.to_ascii_lowercase();
        let keyword = if keyword.len() <= 6 { lower.as_str() } else { keyword };
        match keyword {
            "v" => {
                let position = self.position(line, rest)?;
                self.keep_finite("v", self.obj.positions.len(), line, position.is_finite());
                self.obj.positions.push(position);
            }
            "vt" => {
                // A second coordinate is optional, a third has no meaning for a bitmap.
                let [u, v] = self.numbers::<2>(line, keyword, rest, 1)?;
                self.keep_finite("vt", self.obj.uvs.len(), line, u.is_finite() && v.is_finite());
                self.obj.uvs.push(Vec2::new(u, v));
            }
            "vn" => {
                let normal = Vec3::from(self.numbers::<3>(line, keyword, rest, 3)?);
                self.keep_finite("vn", self.obj.normals.len(), line, normal.is_finite());
                self.obj.normals.push(normal);
            }
            "f" | "fo" => self.face(line, rest)?,
            "p" => self.leave_out(0, line),
            "l" => self.leave_out(1, line),
            "o" | "g" => {
                self.end_part();
                let name = without_comment(rest);
                self.name = if name.is_empty() { UNNAMED.to_owned() } else { name.to_owned() };
            }
            "usemtl" => {
                let name = unquoted(rest);
                if name.is_empty() {
                    return Err(self.wrong(line, "usemtl names no material".to_owned()));
                }
                let current = self.material.map(|index| self.obj.uses[index].name.as_str());
                if current != Some(name) {
                    self.end_part();
                    self.material = Some(self.obj.uses.len());
                    self.obj.uses.push(Named { line, name: name.to_owned() });
                }
            }
            "mtllib" => self.obj.libraries.push(Named { line, name: rest.to_owned() }),
            // Smoothing groups, free-form geometry, whatever else there is.
            _ => {}
        }
        Ok(())
    }

    fn keep_finite(&mut self, statement: &'static str, index: usize, line: usize, finite: bool) {
        if !finite {
            self.not_finite.push((statement, index, line));
        }
    }

    fn leave_out(&mut self, what: usize, line: usize) {
        let (_, count, first) = &mut self.without_area[what];
        *count += 1;
        if *count == 1 {
            *first = line;
        }
    }

    fn number(&self, line: usize, keyword: &str, word: &str) -> Result<f32> {
        word.parse().map_err(|_| {
            self.wrong(line, format!("{keyword} has \"{word}\" where a number is expected"))
        })
    }

    /// The first `N` numbers of a statement, of which `least` must be there; the others are 0.
    fn numbers<const N: usize>(
        &self,
        line: usize,
        keyword: &str,
        rest: &str,
        least: usize,
    ) -> Result<[f32; N]> {
        let mut numbers = [0.0; N];
        let mut found = 0;
        for word in words(rest).take(N) {
            numbers[found] = self.number(line, keyword, word)?;
            found += 1;
        }
        if found < least {
            return Err(
                self.wrong(line, format!("{keyword} has {found} numbers, expected {least}"))
            );
        }
        Ok(numbers)
    }

    /// `x y z`, with a weight `w` behind them or a colour of any number of components.
    fn position(&self, line: usize, rest: &str) -> Result<Vec3> {
        let position = Vec3::from(self.numbers::<3>(line, "v", rest, 3)?);
        let mut more = words(rest).skip(3);
        let (Some(weight), None) = (more.next(), more.next()) else { return Ok(position) };
        match self.number(line, "v", weight)? {
            0.0 => Err(self.wrong(line, "v has the weight 0".to_owned())),
            weight => Ok(position / weight),
        }
    }

    fn face(&mut self, line: usize, rest: &str) -> Result<()> {
        let start = self.obj.corners.len();
        for word in words(rest) {
            let corner = self.corner(word).ok_or_else(|| {
                let message = format!(
                    "f has \"{word}\" where a corner is expected: v, v/vt, v//vn or v/vt/vn, counted from 1, \
                     or from -1 backwards"
                );
                self.wrong(line, message)
            })?;
            self.obj.corners.push(corner);
        }
        if self.obj.corners.len() - start < 3 {
            self.obj.corners.truncate(start);
            self.leave_out(2, line);
            return Ok(());
        }
        self.obj.faces.push(Face { line, corners: start..self.obj.corners.len() });
        Ok(())
    }

    /// A corner; `None` when its word is none. What it names may come later in the file.
    fn corner(&self, word: &str) -> Option<Corner> {
        let mut indices = [MISSING; 3];
        let known = [self.obj.positions.len(), self.obj.uvs.len(), self.obj.normals.len()];
        for (which, text) in word.split('/').enumerate() {
            let index = indices.get_mut(which)?;
            if text.is_empty() {
                continue;
            }
            let number: i64 = text.parse().ok()?;
            let from_zero =
                if number < 0 { i64::try_from(known[which]).ok()? + number } else { number - 1 };
            *index = u32::try_from(from_zero).ok().filter(|&index| index != MISSING)?;
        }
        let [v, vt, vn] = indices;
        (v != MISSING).then_some(Corner { v, vt, vn })
    }

    fn end_part(&mut self) {
        let faces = self.first_face..self.obj.faces.len();
        self.first_face = faces.end;
        if !faces.is_empty() {
            self.obj.parts.push(Part { name: self.name.clone(), material: self.material, faces });
        }
    }

    fn finish(mut self) -> Result<Obj> {
        self.end_part();
        // Exporters write indices of what they leave out.
        let (no_uvs, no_normals) = (self.obj.uvs.is_empty(), self.obj.normals.is_empty());
        for corner in &mut self.obj.corners {
            if no_uvs {
                corner.vt = MISSING;
            }
            if no_normals {
                corner.vn = MISSING;
            }
        }
        for face in &self.obj.faces {
            for corner in &self.obj.corners[face.corners.clone()] {
                self.check(face.line, corner)?;
            }
        }
        for (what, count, line) in self.without_area {
            let words = if count == 1 { what.0 } else { what.1 };
            if count > 0 {
                let path = self.path.display();
                self.obj
                    .remarks
                    .push(format!("{path}:{line}: {count} {words} no area and will not be seen"));
            }
        }
        Ok(self.obj)
    }

    /// Whether what a corner names is there, and finite.
    fn check(&self, line: usize, corner: &Corner) -> Result<()> {
        let obj = &self.obj;
        for (statement, index, count) in [
            ("v", corner.v, obj.positions.len()),
            ("vt", corner.vt, obj.uvs.len()),
            ("vn", corner.vn, obj.normals.len()),
        ] {
            if index != MISSING && index as usize >= count {
                let number = u64::from(index) + 1;
                let message = format!("f uses {statement} number {number}, the file has {count}");
                return Err(self.wrong(line, message));
            }
        }
        if !self.not_finite.is_empty() {
            for (statement, index) in [("v", corner.v), ("vt", corner.vt), ("vn", corner.vn)] {
                let same = |found: &&(&str, usize, usize)| {
                    found.0 == statement && found.1 == index as usize
                };
                if let Some((.., line)) = self.not_finite.iter().find(same) {
                    return Err(self.wrong(*line, format!("{statement} is not finite")));
                }
            }
        }
        Ok(())
    }
}

/// The words of a numeric statement, up to a comment.
fn words(rest: &str) -> impl Iterator<Item = &str> {
    // `1.#IND` is how Microsoft's compilers write what is no number.
    let mut signs = rest.match_indices('#').map(|(at, _)| at);
    let end = signs.find(|&at| !rest[..at].ends_with('.')).unwrap_or(rest.len());
    rest[..end].split_whitespace()
}
