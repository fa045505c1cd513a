//! Ray casting: a binary bounding volume hierarchy over triangles.
//!
//! obvhs builds the tree; the traversal is ours, so that any-hit queries stop at the first hit.

use glam::Vec3A;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::triangle::Triangle;

use crate::Ray;

/// A hierarchy over the triangles of a scene.
pub struct Bvh {
    nodes: Vec<Bvh2Node>,
    triangles: Vec<Edges>,
    stack_size: usize,
}

/// The closest triangle that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray.
    pub t: f32,
    /// Barycentric weights of the triangle's second and third vertex.
    pub barycentric: [f32; 2],
    /// Index of the triangle in the list the hierarchy was built from.
    pub triangle: usize,
}

/// A triangle as the intersector wants it: a corner and the two edges that leave it.
#[derive(Clone, Copy)]
struct Edges {
    corner: Vec3A,
    edge1: Vec3A,
    edge2: Vec3A,
    index: u32,
    blocks: bool,
}

/// Trees are balanced enough that this many pending nodes never come together in practice; a
/// deeper tree gets a stack on the heap.
const STACK: usize = 64;

impl Bvh {
    /// Builds a hierarchy. `blocks[i]` tells whether triangle i takes part in [`Bvh::any_hit`].
    pub fn new(vertices: &[[glam::Vec3; 3]], blocks: &[bool]) -> Self {
        let triangles: Vec<Triangle> = vertices
            .iter()
            .map(|&[v0, v1, v2]| Triangle { v0: v0.into(), v1: v1.into(), v2: v2.into() })
            .collect();
        let params = obvhs::BvhBuildParams::medium_build();
        let bvh = build_bvh2_from_tris(&triangles, params, &mut std::time::Duration::default());
        let ordered = bvh.primitive_indices.iter().map(|&index| {
            let t = &triangles[index as usize];
            Edges {
                corner: t.v0,
                edge1: t.v1 - t.v0,
                edge2: t.v2 - t.v0,
                index,
                blocks: blocks[index as usize],
            }
        });
        let triangles = ordered.collect();
        let stack_size = depth(&bvh.nodes);
        Self { nodes: bvh.nodes, triangles, stack_size }
    }

    /// The closest hit with t in [min_t, max_t], from either side of a triangle.
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let mut closest = None;
        let mut max_t = ray.max_t;
        self.traverse(ray, |origin, direction, triangles| {
            for triangle in triangles {
                if let Some((t, barycentric)) = triangle.intersect(origin, direction)
                    && t >= ray.min_t
                    && t <= max_t
                {
                    max_t = t;
                    closest = Some(Hit { t, barycentric, triangle: triangle.index as usize });
                }
            }
            Some(max_t)
        });
        closest
    }

    /// Whether any blocking triangle is hit with t in [min_t, max_t].
    pub fn any_hit(&self, ray: &Ray) -> bool {
        let mut found = false;
        self.traverse(ray, |origin, direction, triangles| {
            found = triangles.iter().any(|triangle| {
                triangle.blocks
                    && triangle
                        .intersect(origin, direction)
                        .is_some_and(|(t, _)| t >= ray.min_t && t <= ray.max_t)
            });
            (!found).then_some(ray.max_t)
        });
        found
    }

    /// Visits the leaves along a ray, nearer ones first. `leaf` answers how far hits still
    /// matter, or `None` to stop.
    #[inline(always)]
    fn traverse(&self, ray: &Ray, mut leaf: impl FnMut(Vec3A, Vec3A, &[Edges]) -> Option<f32>) {
        if self.nodes.is_empty() {
            return;
        }
        let (origin, direction) = (Vec3A::from(ray.origin), Vec3A::from(ray.direction));
        // Finite even for a zero component, so that 0 times it is 0 and not NaN.
        let inverse = direction.recip().clamp(Vec3A::splat(-1e18), Vec3A::splat(1e18));
        let mut max_t = ray.max_t;
        let mut small = [0u32; STACK];
        let mut large = Vec::new();
        let stack: &mut [u32] = if self.stack_size <= STACK {
            &mut small
        } else {
            large.resize(self.stack_size, 0);
            &mut large
        };
        let mut pending = 0;
        let mut node = &self.nodes[0];
        if entry(node, origin, inverse, ray.min_t, max_t).is_none() {
            return;
        }
        loop {
            if node.prim_count > 0 {
                let first = node.first_index as usize;
                let triangles = &self.triangles[first..first + node.prim_count as usize];
                match leaf(origin, direction, triangles) {
                    Some(t) => max_t = t,
                    None => return,
                }
            } else {
                let first = node.first_index as usize;
                let (a, b) = (&self.nodes[first], &self.nodes[first + 1]);
                let enter_a = entry(a, origin, inverse, ray.min_t, max_t);
                let enter_b = entry(b, origin, inverse, ray.min_t, max_t);
                match (enter_a, enter_b) {
                    (Some(ta), Some(tb)) => {
                        let a_first = ta <= tb;
                        stack[pending] = if a_first { first + 1 } else { first } as u32;
                        pending += 1;
                        node = if a_first { a } else { b };
                        continue;
                    }
                    (Some(_), None) => {
                        node = a;
                        continue;
                    }
                    (None, Some(_)) => {
                        node = b;
                        continue;
                    }
                    (None, None) => {}
                }
            }
            loop {
                if pending == 0 {
                    return;
                }
                pending -= 1;
                node = &self.nodes[stack[pending] as usize];
                // The search may have narrowed since this node was put aside.
                if entry(node, origin, inverse, ray.min_t, max_t).is_some() {
                    break;
                }
            }
        }
    }
}

/// Where a ray enters a node's box, if it does within [min_t, max_t].
///
/// The slab test with the widening of Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013.
#[inline(always)]
fn entry(node: &Bvh2Node, origin: Vec3A, inverse: Vec3A, min_t: f32, max_t: f32) -> Option<f32> {
    let aabb = node.aabb();
    let a = (aabb.min - origin) * inverse;
    let b = (aabb.max - origin) * inverse;
    let near = a.min(b).max_element().max(min_t);
    let far = (a.max(b).min_element() * 1.000_000_5).min(max_t);
    (near <= far).then_some(near)
}

impl Edges {
    /// Möller and Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection", 1997, without
    /// culling. A triangle seen edge-on or of zero area is not hit.
    #[inline(always)]
    fn intersect(&self, origin: Vec3A, direction: Vec3A) -> Option<(f32, [f32; 2])> {
        let p = direction.cross(self.edge2);
        let inv_det = 1.0 / self.edge1.dot(p);
        let s = origin - self.corner;
        let u = s.dot(p) * inv_det;
        let q = s.cross(self.edge1);
        let v = direction.dot(q) * inv_det;
        // A zero determinant makes u and v infinite or NaN, and every comparison below false.
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
            Some((self.edge2.dot(q) * inv_det, [u, v]))
        } else {
            None
        }
    }
}

/// The depth of the tree: no traversal puts more nodes aside.
fn depth(nodes: &[Bvh2Node]) -> usize {
    let mut deepest = 0;
    let mut pending = vec![(0usize, 1usize)];
    while let Some((index, depth)) = pending.pop() {
        deepest = deepest.max(depth);
        if let Some(node) = nodes.get(index).filter(|node| node.prim_count == 0) {
            let first = node.first_index as usize;
            pending.extend([(first, depth + 1), (first + 1, depth + 1)]);
        }
    }
    deepest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sampler;
    use glam::{DVec3, Vec3, vec3};

    fn random_vec3(sampler: &Sampler) -> Vec3 {
        vec3(sampler.next_1d(), sampler.next_1d(), sampler.next_1d()) * 2.0 - 1.0
    }

    /// Every triangle tested in f64: slow and without any tree.
    fn brute_force(triangles: &[[Vec3; 3]], ray: &Ray) -> Option<(f64, usize, f64)> {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let mut best: Option<(f64, usize, f64)> = None;
        for (index, triangle) in triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|v| v.as_dvec3());
            let normal: DVec3 = (b - a).cross(c - a);
            let t = (a - origin).dot(normal) / direction.dot(normal);
            let p = origin + t * direction;
            let inside = |from: DVec3, to: DVec3| (to - from).cross(p - from).dot(normal);
            let margin = inside(a, b).min(inside(b, c)).min(inside(c, a)) / normal.length_squared();
            if margin >= 0.0
                && t >= f64::from(ray.min_t)
                && t <= f64::from(ray.max_t)
                && best.is_none_or(|(nearest, ..)| t < nearest)
            {
                best = Some((t, index, margin));
            }
        }
        best
    }

    #[test]
    fn agrees_with_brute_force_in_f64() {
        let sampler = Sampler::new(1);
        let triangles: Vec<[Vec3; 3]> = (0..400)
            .map(|_| {
                let centre = random_vec3(&sampler);
                [(); 3].map(|()| centre + 0.2 * random_vec3(&sampler))
            })
            .collect();
        let blocks: Vec<bool> = (0..400).map(|i| i % 3 != 0).collect();
        let blocking: Vec<[Vec3; 3]> =
            triangles.iter().zip(&blocks).filter(|(_, b)| **b).map(|(t, _)| *t).collect();
        let bvh = Bvh::new(&triangles, &blocks);
        let (mut hits, mut shadowed) = (0, 0);
        for number in 0..4000 {
            let mut direction = random_vec3(&sampler).normalize();
            if number % 4 == 0 {
                direction = [Vec3::X, -Vec3::Y, Vec3::Z][number / 4 % 3]; // zero components
            }
            let ray = Ray::segment(random_vec3(&sampler) * 1.5, direction, 0.01, 1.5);
            let expected = brute_force(&triangles, &ray);
            let found = bvh.closest_hit(&ray);
            match (expected, found) {
                (Some((t, index, margin)), Some(hit)) if margin > 1e-5 => {
                    assert_eq!(hit.triangle, index);
                    assert!((f64::from(hit.t) - t).abs() < 1e-4, "{} {t}", hit.t);
                    hits += 1;
                }
                (Some((_, _, margin)), None) => assert!(margin < 1e-5, "missed by {margin}"),
                (None, Some(hit)) => {
                    let [u, v] = hit.barycentric;
                    assert!(u.min(v).min(1.0 - u - v) < 1e-4, "hit nothing: {hit:?}");
                }
                _ => {}
            }
            let expected = brute_force(&blocking, &ray);
            if expected.is_none_or(|(.., margin)| margin > 1e-5) {
                assert_eq!(bvh.any_hit(&ray), expected.is_some());
                shadowed += usize::from(expected.is_some());
            }
        }
        assert!(hits > 500 && shadowed > 300, "too few rays hit: {hits}, {shadowed}");
    }

    #[test]
    fn odd_input_is_survived() {
        let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let flat = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X];
        for triangles in [vec![], vec![triangle], vec![flat], vec![triangle; 300]] {
            let bvh = Bvh::new(&triangles, &vec![true; triangles.len()]);
            let down = Ray::new(vec3(0.2, 0.2, 1.0), -Vec3::Z);
            assert_eq!(bvh.any_hit(&down), triangles.contains(&triangle));
            let nan = Ray::new(Vec3::NAN, Vec3::NAN);
            assert!(!bvh.any_hit(&nan) && bvh.closest_hit(&nan).is_none());
            bvh.any_hit(&Ray::new(Vec3::ZERO, Vec3::ZERO));
            bvh.any_hit(&Ray::new(Vec3::splat(1e30), Vec3::X));
        }
    }
}
