//! Colors of luminance and chroma, as OpenEXR's "RgbaYca" defines them: Y = w . (R, G, B), RY = (R - Y) / Y and
//! BY = (B - Y) / Y.

use super::REC_709;

/// The weights of R, G and B in Y: the Y of each primary, for a white of Y = 1 (SMPTE RP 177).
pub(super) fn weights(chromaticities: Option<[[f32; 2]; 4]>) -> [f32; 3] {
    let [red, green, blue, white] = chromaticities.unwrap_or(REC_709).map(|xy| xy.map(f64::from));
    // Columns are the primaries' XYZ over their Y; Cramer's rule solves for the Y that add up to white.
    let xyz = |[x, y]: [f64; 2]| [x / y, 1.0, (1.0 - x - y) / y];
    let [r, g, b, w] = [red, green, blue, white].map(xyz);
    let determinant = |[a, b, c]: [[f64; 3]; 3]| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - b[0] * (a[1] * c[2] - a[2] * c[1])
            + c[0] * (a[1] * b[2] - a[2] * b[1])
    };
    let all = determinant([r, g, b]);
    [[w, g, b], [r, w, b], [r, g, w]].map(|columns| (determinant(columns) / all) as f32)
}

/// The component (0 to 2 for R, G and B) of a color.
pub(super) fn component(which: usize, [wr, wg, wb]: [f32; 3], [y, ry, by]: [f32; 3]) -> f32 {
    let (red, blue) = ((ry + 1.0) * y, (by + 1.0) * y);
    match which {
        0 => red,
        2 => blue,
        // A gray stays exactly gray.
        _ if ry == 0.0 && by == 0.0 => y,
        _ => (y - red * wr - blue * wb) / wg,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_those_of_the_standard_and_colors_come_back() {
        let w = weights(None);
        for (found, expected) in w.iter().zip([0.2126, 0.7152, 0.0722]) {
            assert!((found - expected).abs() < 1e-4, "{w:?}");
        }
        let color = [0.5, 2.0, 0.25];
        let y: f32 = color.iter().zip(w).map(|(c, w)| c * w).sum();
        let stored = [y, (color[0] - y) / y, (color[2] - y) / y];
        for (which, expected) in color.into_iter().enumerate() {
            assert!((component(which, w, stored) - expected).abs() < 1e-5);
        }
    }
}
