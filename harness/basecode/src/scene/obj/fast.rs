//! A fast byte-by-byte parser for the statements that make up large files: `v`, `vt`, `vn` and `f` in their plain
//! forms. It leaves every other form to `piece.rs`, the one place that knows all forms and all errors.

use glam::{Vec2, Vec3};

use super::piece::{Piece, Relative};
use super::{Corner, MISSING};

impl Piece {
    /// Reads the line at `at` and answers where the next begins; `None`, with nothing changed, when
    /// it is not as plain as that.
    pub(super) fn common(&mut self, text: &[u8], at: usize) -> Option<usize> {
        let at = spaces(text, at);
        match (text.get(at)?, text.get(at + 1)?) {
            (b'v', b' ' | b'\t') => {
                let ([x, y, z], at) = numbers(text, at + 2)?;
                // A color has no effect. A single number more is a weight.
                let at = numbers::<3>(text, at).map_or(at, |(_, at)| at);
                let next = end_of_line(text, at)?;
                self.positions.push(Vec3::new(x, y, z));
                Some(next)
            }
            (b'v', b'n') if is_space(text.get(at + 2)?) => {
                let ([x, y, z], at) = numbers(text, at + 3)?;
                let next = end_of_line(text, at)?;
                self.normals.push(Vec3::new(x, y, z));
                Some(next)
            }
            (b'v', b't') if is_space(text.get(at + 2)?) => {
                let ([u, v], at) = numbers(text, at + 3)?;
                // A third coordinate has no meaning.
                let at = numbers::<1>(text, at).map_or(at, |(_, at)| at);
                let next = end_of_line(text, at)?;
                self.uvs.push(Vec2::new(u, v));
                Some(next)
            }
            (b'f', b' ' | b'\t') => self.common_face(text, at + 2),
            _ => None,
        }
    }

    fn common_face(&mut self, text: &[u8], mut at: usize) -> Option<usize> {
        let start = (self.corners.len(), self.relative.len());
        let next = loop {
            at = spaces(text, at);
            if let Some(next) = end_of_line(text, at) {
                break Some(next);
            }
            match self.common_corner(text, at) {
                Some(end) => at = end,
                None => break None,
            }
        };
        match next {
            Some(_) => self.end_face(self.lines + 1, start),
            None => {
                self.corners.truncate(start.0);
                self.relative.truncate(start.1);
            }
        }
        next
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`; indices that lie in the piece if they count backwards.
    fn common_corner(&mut self, text: &[u8], mut at: usize) -> Option<usize> {
        let known = [self.positions.len(), self.uvs.len(), self.normals.len()];
        let mut indices = [MISSING; 3];
        for which in 0..3 {
            let backwards = text.get(at) == Some(&b'-');
            at += usize::from(backwards);
            let start = at;
            let mut number = 0u32;
            while let Some(digit) = text.get(at).and_then(digit) {
                number = 10 * number + u32::from(digit);
                at += 1;
            }
            match at - start {
                0 if which == 0 || backwards => return None,
                0 => {}
                1..=9 if number == 0 => return None,
                1..=9 if backwards => {
                    let index = known[which].checked_sub(number as usize)?;
                    self.relative.push(Relative {
                        corner: self.corners.len(),
                        which,
                        index: index as i64,
                        line: self.lines + 1,
                        word: None,
                    });
                    indices[which] = 0;
                }
                1..=9 => indices[which] = number - 1,
                _ => return None,
            }
            match text.get(at) {
                Some(b'/') if which < 2 => at += 1,
                None | Some(b' ' | b'\t' | b'\n' | b'\r') => break,
                _ => return None,
            }
        }
        let [v, vt, vn] = indices;
        self.corners.push(Corner { v, vt, vn });
        Some(at)
    }
}

fn is_space(byte: &u8) -> bool {
    matches!(byte, b' ' | b'\t')
}

fn digit(byte: &u8) -> Option<u8> {
    let value = byte.wrapping_sub(b'0');
    (value < 10).then_some(value)
}

fn spaces(text: &[u8], mut at: usize) -> usize {
    while text.get(at).is_some_and(is_space) {
        at += 1;
    }
    at
}

/// Where the next line begins, when nothing but white space is left of this one.
fn end_of_line(text: &[u8], at: usize) -> Option<usize> {
    let at = spaces(text, at);
    match text.get(at) {
        None => Some(at),
        Some(b'\n') => Some(at + 1),
        Some(b'\r') if text.get(at + 1) == Some(&b'\n') => Some(at + 2),
        Some(b'\r') => Some(at + 1),
        _ => None,
    }
}

/// `N` numbers with white space before each; and where they end.
fn numbers<const N: usize>(text: &[u8], mut at: usize) -> Option<([f32; N], usize)> {
    let mut found = [0.0; N];
    for number in &mut found {
        (*number, at) = self::number(text, spaces(text, at))?;
        if !matches!(text.get(at), None | Some(b' ' | b'\t' | b'\n' | b'\r')) {
            return None;
        }
    }
    Some((found, at))
}

/// Powers of ten that are 64-bit floats.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// A decimal number, and where it ends; the same as the standard library's, or `None`.
///
/// A mantissa below 2^53 and a power of ten up to 22 are floats of 64 bits, so their product or
/// quotient is rounded once (Clinger, "How to read floating point numbers accurately", 1990).
/// Rounding it to 32 bits is right unless it lies in the middle of two of those.
fn number(text: &[u8], mut at: usize) -> Option<(f32, usize)> {
    let negative = text.get(at) == Some(&b'-');
    at += usize::from(negative);
    let (mut mantissa, mut exponent) = (0u64, 0i32);
    let start = at;
    while let Some(digit) = text.get(at).and_then(digit) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
        at += 1;
    }
    let mut digits = at - start;
    if text.get(at) == Some(&b'.') {
        at += 1;
        let start = at;
        while let Some(digit) = text.get(at).and_then(digit) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
            at += 1;
        }
        digits += at - start;
        exponent -= (at - start) as i32;
    }
    if let Some(b'e' | b'E') = text.get(at) {
        at += 1;
        let sign = text.get(at).copied();
        at += usize::from(matches!(sign, Some(b'-' | b'+')));
        let start = at;
        let mut power = 0;
        while let Some(digit) = text.get(at).and_then(digit).filter(|_| at - start < 3) {
            power = 10 * power + i32::from(digit);
            at += 1;
        }
        if at == start {
            return None;
        }
        exponent += if sign == Some(b'-') { -power } else { power };
    }
    // 19 digits have not overflowed.
    if digits == 0 || digits > 19 || mantissa > 1 << 53 {
        return None;
    }
    let power = POWERS.get(exponent.unsigned_abs() as usize)?;
    let value = mantissa as f64;
    let value = if exponent < 0 { value / power } else { value * power };
    let between = value.to_bits() & ((1 << 29) - 1) == 1 << 28;
    if between || (value < f64::from(f32::MIN_POSITIVE) && mantissa != 0) {
        return None;
    }
    let value = value as f32;
    if !value.is_finite() {
        return None;
    }
    Some((if negative { -value } else { value }, at))
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_are_those_of_the_standard_library() {
        let mut state = 1u64;
        let mut next = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) % below
        };
        let mut texts: Vec<String> = [
            "0",
            "-0",
            "0.",
            ".5",
            "1.",
            "-.25e1",
            "16777217",
            "33554434.5",
            "1e22",
            "5e-45",
            "3.4028236e38",
        ]
        .map(str::to_owned)
        .to_vec();
        for _ in 0..300_000 {
            let sign = ["", "-"][next(2) as usize];
            let digits = next(9) as u32;
            let before = next(10u64.pow(digits));
            let decimals = next(12) as usize;
            let after = next(10u64.pow(decimals.min(9) as u32).max(1));
            let power = match next(4) {
                0 => format!("e{}", next(60) as i64 - 30),
                _ => String::new(),
            };
            texts.push(match decimals {
                0 => format!("{sign}{before}{power}"),
                _ => format!("{sign}{before}.{after:0decimals$}{power}"),
            });
            // Floats as exporters write them, exactly in between two, and next to there.
            let value = f32::from_bits(next(1 << 31) as u32);
            texts.push(format!("{sign}{value}"));
            texts.push(format!("{:.*}", next(9) as usize, value % 1e4));
            let between = f64::from(value) + f64::from(f32::from_bits(value.to_bits() + 1));
            texts.push(format!("{}", 0.5 * between % 1e3));
        }
        let mut read = 0;
        for text in &texts {
            let Some((value, end)) = number(text.as_bytes(), 0) else { continue };
            read += 1;
            let theirs: f32 = text.parse().expect(text);
            assert_eq!((value.to_bits(), end), (theirs.to_bits(), text.len()), "{text}");
        }
        assert!(read > texts.len() / 3, "{read} of {}", texts.len());
        for text in ["", "-", ".", "e5", "1e", "1e+", "--1", "+1", "nan", "inf", "x"] {
            assert_eq!(
                number(text.as_bytes(), 0).filter(|(_, end)| *end == text.len()),
                None,
                "{text}"
            );
        }
    }
}
