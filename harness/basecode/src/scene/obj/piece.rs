//! The statements of a piece of an OBJ file.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3};

use super::super::text::{Statements, split_keyword, unquoted, without_comment};
use super::{Corner, Face, MISSING, Named};

/// Where a piece cannot be understood.
pub(super) struct Wrong {
    /// Its line, from 1 in the piece.
    pub line: usize,
    pub message: String,
}

impl Wrong {
    fn at(line: usize, message: String) -> Self {
        Self { line, message }
    }
}

/// A name or a material of the faces that follow.
pub(super) enum Mark {
    Name(String),
    Use(Named),
}

/// An index that was counted backwards from where it stands.
pub(super) struct Relative {
    /// The corner in [`Piece::corners`], or none of them.
    pub corner: usize,
    /// Of position, texture coordinates or normal.
    pub which: usize,
    /// From 0 at the start of the piece; below 0 in what comes before.
    pub index: i64,
    pub line: usize,
    /// How many there are before it in the piece, and the index as it is written, where it may be too low.
    pub word: Option<(usize, String)>,
}

/// An index beyond every file.
pub(super) struct Beyond {
    /// Of position, texture coordinates or normal.
    pub which: usize,
    pub line: usize,
    /// The index as it is written.
    pub word: String,
}

/// Stands in a corner for an index beyond every file.
const BEYOND: u32 = MISSING - 1;

/// Statements that follow each other. Lines count from 1, everything else from 0, in the piece.
#[derive(Default)]
pub(super) struct Piece {
    pub lines: usize,
    pub positions: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    pub corners: Vec<Corner>,
    pub faces: Vec<Face>,
    /// Each before which face.
    pub marks: Vec<(usize, Mark)>,
    pub libraries: Vec<Named>,
    pub relative: Vec<Relative>,
    pub beyond: Vec<Beyond>,
    /// Numbers that are not finite: statement, index, line.
    pub not_finite: Vec<(&'static str, usize, usize)>,
    /// Points, lines, faces of fewer than three corners: how many, the first's line.
    pub without_area: [(usize, usize); 3],
    /// Statements that are not supported: how many of each keyword, the first's line.
    pub ignored: BTreeMap<String, (usize, usize)>,
}

/// Statements that change no picture here: smoothing and merging groups, attributes of a display, and what only
/// describes the free-form curves and surfaces that other statements draw.
const WITHOUT_EFFECT: [&str; 23] = [
    "s",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "maplib",
    "ctech",
    "stech",
    "cstype",
    "deg",
    "bmat",
    "step",
    "vp",
    "parm",
    "trim",
    "hole",
    "scrv",
    "sp",
    "end",
    "con",
];

/// What a remark calls the fourth number of a vertex.
const WEIGHT: &str = "weight (v x y z w)";

impl Piece {
    /// Reads a text, up to the first statement that cannot be understood.
    pub(super) fn read(text: &str) -> (Self, Option<Wrong>) {
        let mut piece = Self::default();
        let mut at = 0;
        while at < text.len() {
            if let Some(next) = piece.common(text.as_bytes(), at) {
                at = next;
                piece.lines += 1;
                continue;
            }
            let mut statements = Statements::from_line(&text[at..], piece.lines);
            let statement = statements.next();
            piece.lines = statements.line();
            at = text.len() - statements.rest().len();
            if let Some((line, statement)) = statement
                && let Err(wrong) = piece.statement(line, &statement)
            {
                return (piece, Some(wrong));
            }
        }
        (piece, None)
    }

    fn statement(&mut self, line: usize, statement: &str) -> Result<(), Wrong> {
        let (keyword, rest) = split_keyword(statement);
        // Some write them in upper case.
        let lower = keyword.to_ascii_lowercase();
        let keyword = lower.as_str();
        match keyword {
            "v" => {
                let position = self.position(line, rest)?;
                self.keep_finite("v", self.positions.len(), line, position.is_finite());
                self.positions.push(position);
            }
            "vt" => {
                // A second coordinate is optional, a third has no meaning for a bitmap.
                let [u, v] = self.numbers::<2>(line, keyword, rest, 1)?;
                self.keep_finite("vt", self.uvs.len(), line, u.is_finite() && v.is_finite());
                self.uvs.push(Vec2::new(u, v));
            }
            "vn" => {
                let normal = Vec3::from(self.numbers::<3>(line, keyword, rest, 3)?);
                self.keep_finite("vn", self.normals.len(), line, normal.is_finite());
                self.normals.push(normal);
            }
            "f" | "fo" => self.face(line, rest)?,
            "p" => self.leave_out(0, line),
            "l" => self.leave_out(1, line),
            "o" | "g" => {
                let name = Mark::Name(without_comment(rest).to_owned());
                self.marks.push((self.faces.len(), name));
            }
            "usemtl" => {
                let name = Mark::Use(Named { line, name: unquoted(rest).to_owned() });
                self.marks.push((self.faces.len(), name));
            }
            "mtllib" => self.libraries.push(Named { line, name: rest.to_owned() }),
            other if WITHOUT_EFFECT.contains(&other) => {}
            other => self.ignored.entry(other.to_owned()).or_insert((0, line)).0 += 1,
        }
        Ok(())
    }

    fn keep_finite(&mut self, statement: &'static str, index: usize, line: usize, finite: bool) {
        if !finite {
            self.not_finite.push((statement, index, line));
        }
    }

    fn leave_out(&mut self, what: usize, line: usize) {
        let (count, first) = &mut self.without_area[what];
        *count += 1;
        if *count == 1 {
            *first = line;
        }
    }

    fn number(&self, line: usize, keyword: &str, word: &str) -> Result<f32, Wrong> {
        word.parse().map_err(|_| {
            Wrong::at(line, format!("{keyword} has \"{word}\" where a number is expected"))
        })
    }

    /// The first `N` numbers of a statement, of which `least` must be there; the others are 0.
    fn numbers<const N: usize>(
        &self,
        line: usize,
        keyword: &str,
        rest: &str,
        least: usize,
    ) -> Result<[f32; N], Wrong> {
        let mut numbers = [0.0; N];
        let mut found = 0;
        for word in words(rest).take(N) {
            numbers[found] = self.number(line, keyword, word)?;
            found += 1;
        }
        if found < least {
            return Err(Wrong::at(
                line,
                format!("{keyword} has {found} numbers, expected {least}"),
            ));
        }
        Ok(numbers)
    }

    /// `x y z`, with a weight `w` behind them or a color of any number of components. A weight has a meaning for
    /// free-form curves and surfaces only ("Advanced Visualizer Manual", appendix B1), and none for a face.
    fn position(&mut self, line: usize, rest: &str) -> Result<Vec3, Wrong> {
        let position = Vec3::from(self.numbers::<3>(line, "v", rest, 3)?);
        let mut more = words(rest).skip(3);
        if let (Some(weight), None) = (more.next(), more.next())
            && self.number(line, "v", weight)? != 1.0
        {
            let weights = self.ignored.entry(WEIGHT.to_owned()).or_insert((0, line));
            weights.0 += 1;
        }
        Ok(position)
    }

    fn face(&mut self, line: usize, rest: &str) -> Result<(), Wrong> {
        let start = (self.corners.len(), self.relative.len());
        for word in words(rest) {
            let corner = self.corner(line, word);
            self.corners.push(corner.ok_or_else(|| Wrong::at(line, wrong_corner(word)))?);
        }
        self.end_face(line, start);
        Ok(())
    }

    /// Makes a face of the corners since there were so many corners and relative indices.
    pub(super) fn end_face(&mut self, line: usize, (start, relative): (usize, usize)) {
        let end = self.corners.len();
        if end - start < 3 {
            self.corners.truncate(start);
            // What they name is not used, but must be there.
            for relative in &mut self.relative[relative..] {
                relative.corner = usize::MAX;
            }
            self.leave_out(2, line);
            return;
        }
        self.faces.push(Face { line: line as u32, corners: start as u32..end as u32 });
    }

    /// A corner; `None` when its word is none. What it names may come later in the file.
    fn corner(&mut self, line: usize, word: &str) -> Option<Corner> {
        let mut indices = [MISSING; 3];
        let known = [self.positions.len(), self.uvs.len(), self.normals.len()];
        for (which, text) in word.split('/').enumerate() {
            let index = indices.get_mut(which)?;
            if text.is_empty() {
                continue;
            }
            let digits = text.strip_prefix(['-', '+']).unwrap_or(text);
            if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
                return None;
            }
            // Beyond every file in any case.
            let far = if text.starts_with('-') { i64::MIN / 2 } else { i64::MAX / 2 };
            let number: i64 = text.parse().unwrap_or(far).clamp(i64::MIN / 2, i64::MAX / 2);
            if number < 0 {
                let here = known[which] as i64 + number;
                self.relative.push(Relative {
                    corner: self.corners.len(),
                    which,
                    index: here,
                    line,
                    word: (here < 0).then(|| (known[which], text.to_owned())),
                });
                // Until it is known what the pieces before it hold.
                *index = 0;
                continue;
            }
            if number == 0 {
                return None;
            }
            *index = u32::try_from(number - 1).unwrap_or(BEYOND).min(BEYOND);
            if *index == BEYOND {
                self.beyond.push(Beyond { which, line, word: text.to_owned() });
            }
        }
        let [v, vt, vn] = indices;
        (v != MISSING).then_some(Corner { v, vt, vn })
    }
}

/// What is wrong with the corner of a face.
fn wrong_corner(word: &str) -> String {
    format!(
        "f has \"{word}\" where a corner is expected: v, v/vt, v//vn or v/vt/vn, counted from 1, or from \
         -1 backwards"
    )
}

/// The words of a numeric statement, up to a comment.
fn words(rest: &str) -> impl Iterator<Item = &str> {
    // `1.#IND` is how Microsoft's compilers write what is no number.
    let mut signs = rest.match_indices('#').map(|(at, _)| at);
    let end = signs.find(|&at| !rest[..at].ends_with('.')).unwrap_or(rest.len());
    rest[..end].split_whitespace()
}
