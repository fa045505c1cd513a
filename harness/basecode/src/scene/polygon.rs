//! Triangulation of polygons.

use std::collections::HashSet;

use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};

/// Signed areas below this fraction of a polygon's are rounding, not a concave corner.
const ROUNDING: f64 = 1e-6;

/// The triangles of a polygon as indices of its corners, wound as it is: a fan from the first corner
/// where that covers the polygon and nothing else, as for every convex one; else ears are clipped.
///
/// A polygon that is not planar is judged as seen along its mean normal. One without area becomes a
/// fan of triangles without area.
pub(super) fn triangulate(corners: &[Vec3]) -> Vec<[usize; 3]> {
    let fan = || (1..corners.len().saturating_sub(1)).map(|i| [0, i, i + 1]).collect();
    if corners.len() <= 3 {
        return fan();
    }
    let from_first: Vec<DVec3> =
        corners.iter().map(|corner| corner.as_dvec3() - corners[0].as_dvec3()).collect();
    let areas: Vec<DVec3> = from_first[1..].windows(2).map(|pair| pair[0].cross(pair[1])).collect();
    let mut normal: DVec3 = areas.iter().sum();
    let largest = areas.iter().copied().max_by(|a, b| a.length().total_cmp(&b.length()));
    let largest = largest.unwrap_or_default();
    if normal.length() <= ROUNDING * largest.length() {
        // Its halves cancel, as those of a bow tie.
        normal = largest;
    }
    let length = normal.length();
    if !(length > 0.0 && length.is_finite()) {
        return fan();
    }
    let unit = normal / length;
    let (s, t) = unit.any_orthonormal_pair();
    let flat: Vec<DVec2> = from_first.iter().map(|p| DVec2::new(p.dot(s), p.dot(t))).collect();
    let angle = |pair: &[DVec2]| pair[0].perp_dot(pair[1]).atan2(pair[0].dot(pair[1]));
    let sweep: f64 = flat[1..].windows(2).map(angle).sum();
    let turns_back = areas.iter().any(|area| area.dot(unit) < -ROUNDING * length);
    if !turns_back && sweep.abs() <= std::f64::consts::TAU * (1.0 - ROUNDING) {
        return fan();
    }
    // An outline that goes on around itself is no polygon, and each lap would cost ever more.
    let outline = &flat[..before_repetition(corners)];
    let mut indices: Vec<usize> = Vec::new();
    Earcut::new().earcut(outline.iter().map(|p| p.to_array()), &[], &mut indices);
    let mut triangles = indices.as_chunks::<3>().0.to_vec();
    if triangles.is_empty() {
        return fan();
    }
    for [a, b, c] in &mut triangles {
        if (flat[*b] - flat[*a]).perp_dot(flat[*c] - flat[*a]) < 0.0 {
            std::mem::swap(b, c);
        }
    }
    triangles
}

/// How many corners an outline has before it goes along an edge that it went along before, the same way.
fn before_repetition(corners: &[Vec3]) -> usize {
    // Both zeros are one place.
    let place = |corner: &Vec3| (*corner + 0.0).to_array().map(f32::to_bits);
    let mut edges = HashSet::new();
    for (index, pair) in corners.windows(2).enumerate() {
        let edge = (place(&pair[0]), place(&pair[1]));
        if edge.0 != edge.1 && !edges.insert(edge) {
            return index;
        }
    }
    corners.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::vec3;

    fn polygon(corners: &[(f32, f32)]) -> Vec<Vec3> {
        corners.iter().map(|&(x, y)| vec3(x, y, 1.0)).collect()
    }

    /// Sums of signed and unsigned areas along z.
    fn areas(corners: &[Vec3], triangles: &[[usize; 3]]) -> (f64, f64) {
        let area = |t: &[usize; 3]| {
            let [a, b, c] = t.map(|i| corners[i].as_dvec3());
            0.5 * (b - a).cross(c - a).z
        };
        let each = triangles.iter().map(area);
        each.fold((0.0, 0.0), |(sum, all), area| (sum + area, all + area.abs()))
    }

    #[test]
    fn concave_polygons_are_covered_once_from_every_corner_and_side() {
        let arrow = [(-2.0, -2.0), (0.0, 1.6), (2.0, -2.0), (0.0, 2.0)];
        let l = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)];
        let comb = [
            (0.0, 0.0),
            (5.0, 0.0),
            (5.0, 3.0),
            (4.0, 3.0),
            (4.0, 1.0),
            (3.0, 1.0),
            (3.0, 3.0),
            (2.0, 3.0),
            (2.0, 1.0),
            (1.0, 1.0),
            (1.0, 3.0),
            (0.0, 3.0),
        ];
        let spiral = [
            (0.0, 0.0),
            (4.0, 0.0),
            (4.0, 4.0),
            (1.0, 4.0),
            (1.0, 2.0),
            (2.0, 2.0),
            (2.0, 3.0),
            (3.0, 3.0),
            (3.0, 1.0),
            (0.0, 1.0),
        ];
        for (name, outline, area) in [
            ("arrow", &arrow[..], 0.8),
            ("l", &l, 5.0),
            ("comb", &comb, 11.0),
            ("spiral", &spiral, 10.0),
        ] {
            for first in 0..outline.len() {
                let mut corners = polygon(outline);
                corners.rotate_left(first);
                for _ in 0..2 {
                    let triangles = triangulate(&corners);
                    assert_eq!(triangles.len(), corners.len() - 2, "{name} from {first}");
                    let (sum, all) = areas(&corners, &triangles);
                    let outline: f64 = (0..corners.len())
                        .map(|i| {
                            let (a, b) = (
                                corners[i].as_dvec3(),
                                corners[(i + 1) % corners.len()].as_dvec3(),
                            );
                            0.5 * (a.x * b.y - a.y * b.x)
                        })
                        .sum();
                    assert!((all - area).abs() < 1e-6, "{name} from {first}: {all}");
                    assert!(
                        (sum - outline).abs() < 1e-6,
                        "{name} from {first}: wound {sum}, not {outline}"
                    );
                    corners.reverse();
                }
            }
        }
    }

    #[test]
    fn convex_polygons_stay_fans() {
        let quad = polygon(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]);
        assert_eq!(triangulate(&quad), [[0, 1, 2], [0, 2, 3]]);
        let mut saddle = quad.clone();
        saddle[0].z = 1.5;
        saddle[2].z = 1.5;
        assert_eq!(triangulate(&saddle), [[0, 1, 2], [0, 2, 3]]);
        let ring: Vec<Vec3> = (0..40)
            .map(|i| (i as f32 * std::f32::consts::TAU / 40.0).sin_cos())
            .map(|(y, x)| vec3(x, y, 0.0))
            .collect();
        assert_eq!(triangulate(&ring)[37], [0, 38, 39]);
        // A corner on an edge is no concave corner.
        let straight = polygon(&[(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]);
        assert_eq!(triangulate(&straight), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    }

    #[test]
    fn an_outline_that_goes_on_around_itself_counts_once() {
        let arrow = [(-2.0, -2.0), (0.0, 1.6), (2.0, -2.0), (0.0, 2.0)];
        let triangle = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)];
        for (outline, area) in [(&arrow[..], 0.8), (&triangle, 0.5)] {
            for laps in [20, 40_000] {
                let corners = polygon(&outline.repeat(laps));
                let triangles = triangulate(&corners);
                assert_eq!(triangles.len(), outline.len() - 2);
                assert!((areas(&corners, &triangles).1 - area).abs() < 1e-6);
            }
        }
        // A cut to a hole goes along its edge twice, there and back.
        let ring = polygon(&[
            (0.0, 0.0),
            (3.0, 0.0),
            (3.0, 3.0),
            (0.0, 3.0),
            (0.0, 0.0),
            (1.0, 1.0),
            (1.0, 2.0),
            (2.0, 2.0),
            (2.0, 1.0),
            (1.0, 1.0),
        ]);
        assert!((areas(&ring, &triangulate(&ring)).1 - 8.0).abs() < 1e-6);
    }

    #[test]
    fn degenerate_polygons_are_survived() {
        let line = polygon(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)]);
        assert_eq!(areas(&line, &triangulate(&line)).1, 0.0);
        assert_eq!(triangulate(&[Vec3::ONE; 5]).len(), 3);
        let bow_tie = polygon(&[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]);
        assert!(areas(&bow_tie, &triangulate(&bow_tie)).1 < 0.75, "a half is drawn twice");
        let huge = [Vec3::splat(3e38), vec3(-3e38, 3e38, 0.0), vec3(-3e38, -3e38, 0.0), Vec3::X];
        triangulate(&huge);
        assert_eq!(triangulate(&[]).len() + triangulate(&[Vec3::X]).len(), 0);
    }
}
