//! An OBJ file.
//!
//! Written after Wavefront's specification ("Advanced Visualizer Manual", appendix B1), and as
//! lenient as the exporters in use demand. A large file is read in pieces, on all cores: `piece.rs`
//! reads the statements of one, and what depends on those before it is settled here, piece by piece.

mod fast;
mod piece;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::text::ignored_remarks;
use crate::{Error, Result};
use piece::{Beyond, Mark, Piece, Wrong};

/// A file is cut into pieces of about so many bytes.
const PIECE_BYTES: usize = 1 << 20;

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
    pub line: u32,
    /// Where its corners lie in [`Obj::corners`].
    pub corners: Range<u32>,
}

impl Face {
    /// Where its corners lie in [`Obj::corners`].
    pub fn range(&self) -> Range<usize> {
        self.corners.start as usize..self.corners.end as usize
    }
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
    /// The remarks on statements that are not supported.
    pub ignored: Vec<String>,
}

impl Obj {
    /// Reads a text; `path` only names it in messages.
    ///
    /// # Errors
    /// At the first statement that cannot be understood, or that names a vertex that is not there.
    pub(super) fn parse(path: &Path, text: &str) -> Result<Self> {
        Self::parse_in_pieces(path, text, PIECE_BYTES)
    }

    fn parse_in_pieces(path: &Path, text: &str, bytes: usize) -> Result<Self> {
        let texts = cut(text, bytes);
        let pieces: Vec<(Piece, Option<Wrong>)> = match &texts[..] {
            [whole] => vec![Piece::read(whole)],
            texts => texts.par_iter().map(|text| Piece::read(text)).collect(),
        };
        let mut whole = Assembly { path, ..Assembly::default() };
        let mut pieces = pieces.into_iter();
        let read = pieces.try_for_each(|(piece, wrong)| whole.append(piece, wrong));
        let read = read.and_then(|()| whole.finish());
        let ignored = ignored_remarks(path, &whole.ignored);
        match read {
            Ok(()) => Ok(Obj { ignored, ..whole.obj }),
            Err(error) => Err(error.also(&ignored)),
        }
    }
}

/// Cuts behind ends of lines, but not where a statement goes on in the next.
fn cut(text: &str, piece_bytes: usize) -> Vec<&str> {
    let bytes = text.as_bytes();
    let mut pieces = Vec::new();
    let (mut start, mut from) = (0, piece_bytes);
    while let Some(at) = bytes.get(from..).and_then(|rest| memchr::memchr(b'\n', rest)) {
        let end = from + at + 1;
        from = end;
        // Whatever may be white space, a backslash may stand before.
        let last = bytes[start..end].iter().rev().find(|byte| !byte.is_ascii_whitespace());
        if last.is_none_or(|&last| last != b'\\' && last != 0x0b && last.is_ascii()) {
            pieces.push(&text[start..end]);
            (start, from) = (end, end + piece_bytes);
        }
    }
    pieces.push(&text[start..]);
    pieces
}

/// A file of which some pieces are in.
struct Assembly<'a> {
    path: &'a Path,
    obj: Obj,
    /// Lines so far.
    lines: usize,
    name: String,
    material: Option<usize>,
    first_face: usize,
    /// Numbers that are not finite: statement, index, line. Only a face that uses them is an error.
    not_finite: Vec<(&'static str, usize, usize)>,
    /// What has no area: words for one and for several, how many, the first's line.
    without_area: [((&'static str, &'static str), usize, usize); 3],
    /// Statements that are not supported: how many of each keyword, the first's line.
    ignored: BTreeMap<String, (usize, usize)>,
    /// Indices beyond every file.
    beyond: Vec<Beyond>,
}

/// The statements that a corner's indices count.
const STATEMENTS: [&str; 3] = ["v", "vt", "vn"];

const UNNAMED: &str = "unnamed_object";

impl Default for Assembly<'_> {
    fn default() -> Self {
        Self {
            path: Path::new(""),
            obj: Obj::default(),
            lines: 0,
            name: UNNAMED.to_owned(),
            material: None,
            first_face: 0,
            not_finite: Vec::new(),
            without_area: [
                (("point (p) has", "points (p) have"), 0, 0),
                (("line (l) has", "lines (l) have"), 0, 0),
                (("face of fewer than 3 corners has", "faces of fewer than 3 corners have"), 0, 0),
            ],
            ignored: BTreeMap::new(),
            beyond: Vec::new(),
        }
    }
}

impl Assembly<'_> {
    fn wrong(&self, line: usize, message: String) -> Error {
        Error::File { path: self.path.to_owned(), line: Some(line), message }
    }

    /// Takes the next piece in; `wrong` is where it ended early.
    fn append(&mut self, mut piece: Piece, wrong: Option<Wrong>) -> Result<()> {
        let obj = &mut self.obj;
        let before = [obj.positions.len(), obj.uvs.len(), obj.normals.len()];
        for (keyword, (more, line)) in piece.ignored {
            self.ignored.entry(keyword).or_insert((0, self.lines + line)).0 += more;
        }
        for relative in piece.relative {
            let index = before[relative.which] as i64 + relative.index;
            let Some(index) = u32::try_from(index).ok().filter(|&index| index != MISSING) else {
                let (statement, before) = (STATEMENTS[relative.which], before[relative.which]);
                let (here, word) = relative.word.unwrap_or_default();
                let count = before + here;
                let message =
                    format!("f uses {statement} number {word}, the file has {count} before it");
                return Err(self.wrong(self.lines + relative.line, message));
            };
            if let Some(corner) = piece.corners.get_mut(relative.corner) {
                *[&mut corner.v, &mut corner.vt, &mut corner.vn][relative.which] = index;
            }
        }
        if let Some(Wrong { line, message }) = wrong {
            return Err(self.wrong(self.lines + line, message));
        }
        let (corners, faces) = (obj.corners.len() as u32, obj.faces.len());
        for face in &mut piece.faces {
            face.line += self.lines as u32;
            face.corners = face.corners.start + corners..face.corners.end + corners;
        }
        append(&mut obj.positions, piece.positions);
        append(&mut obj.uvs, piece.uvs);
        append(&mut obj.normals, piece.normals);
        append(&mut obj.corners, piece.corners);
        append(&mut obj.faces, piece.faces);
        for (at, mark) in piece.marks {
            self.mark(faces + at, mark);
        }
        let line = |named: Named| Named { line: self.lines + named.line, name: named.name };
        self.obj.libraries.extend(piece.libraries.into_iter().map(line));
        for (statement, index, line) in piece.not_finite {
            let which = STATEMENTS.iter().position(|own| *own == statement);
            let index = before[which.unwrap_or_default()] + index;
            self.not_finite.push((statement, index, self.lines + line));
        }
        for ((_, count, first), (more, line)) in
            self.without_area.iter_mut().zip(piece.without_area)
        {
            if *count == 0 {
                *first = self.lines + line;
            }
            *count += more;
        }
        let line = |beyond: Beyond| Beyond { line: self.lines + beyond.line, ..beyond };
        self.beyond.extend(piece.beyond.into_iter().map(line));
        self.lines += piece.lines;
        Ok(())
    }

    /// A name or a material, before the face `at`.
    fn mark(&mut self, at: usize, mark: Mark) {
        match mark {
            Mark::Name(name) => {
                self.end_part(at);
                self.name = if name.is_empty() { UNNAMED.to_owned() } else { name };
            }
            Mark::Use(Named { line, name }) => {
                let current = self.material.map(|index| self.obj.uses[index].name.as_str());
                if current != Some(&name) {
                    self.end_part(at);
                    self.material = Some(self.obj.uses.len());
                    self.obj.uses.push(Named { line: self.lines + line, name });
                }
            }
        }
    }

    fn end_part(&mut self, at: usize) {
        let faces = self.first_face..at;
        self.first_face = at;
        if !faces.is_empty() {
            self.obj.parts.push(Part { name: self.name.clone(), material: self.material, faces });
        }
    }

    fn finish(&mut self) -> Result<()> {
        self.end_part(self.obj.faces.len());
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
            for corner in &self.obj.corners[face.range()] {
                self.check(face.line as usize, corner)?;
            }
        }
        for (what, count, line) in &self.without_area {
            let words = if *count == 1 { what.0 } else { what.1 };
            if *count > 0 {
                let path = self.path.display();
                self.obj
                    .remarks
                    .push(format!("{path}:{line}: {count} {words} no area and will not be seen"));
            }
        }
        Ok(())
    }

    /// Whether what a corner names is there, and finite.
    fn check(&self, line: usize, corner: &Corner) -> Result<()> {
        let obj = &self.obj;
        let found = [
            (corner.v, obj.positions.len()),
            (corner.vt, obj.uvs.len()),
            (corner.vn, obj.normals.len()),
        ];
        for (which, (index, count)) in found.into_iter().enumerate() {
            if index != MISSING && index as usize >= count {
                let same = |beyond: &&Beyond| (beyond.line, beyond.which) == (line, which);
                let word = match self.beyond.iter().find(same) {
                    Some(beyond) => beyond.word.clone(),
                    None => (u64::from(index) + 1).to_string(),
                };
                let statement = STATEMENTS[which];
                let message = format!("f uses {statement} number {word}, the file has {count}");
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

/// Moves what it can.
fn append<T>(all: &mut Vec<T>, mut more: Vec<T>) {
    if all.is_empty() {
        *all = more;
    } else {
        all.append(&mut more);
    }
}
