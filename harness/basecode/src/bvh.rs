//! Ray casting: a bounding volume hierarchy over triangles, four children to a node.
//!
//! obvhs builds a binary tree; folding it and the traversal are ours: a ray meets four boxes or four triangles at
//! once, and any-hit queries stop at the first hit.

use glam::{Vec3, Vec4};
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::triangle::Triangle;

use crate::Ray;
use crate::realtime::refuse_rays;

/// A hierarchy over the triangles of a scene.
pub struct Bvh {
    /// The first is the root.
    nodes: Vec<Node>,
    leaves: Vec<Triangles>,
    stack_size: usize,
}

/// The boxes of four children, axis by axis, and what is in them.
#[derive(Clone, Copy)]
struct Node {
    min: [Vec4; 3],
    max: [Vec4; 3],
    children: [Child; 4],
    /// Bit i: there is a child i.
    present: u32,
}

/// A node, or as many leaves as `leaves` says.
#[derive(Clone, Copy, Default)]
struct Child {
    first: u32,
    leaves: u32,
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

/// Four triangles as the intersector wants them, coordinate by coordinate: a corner and the two edges that leave it.
/// Where there are fewer, the rest has no area and is not hit.
#[derive(Clone, Copy)]
struct Triangles {
    corner: [Vec4; 3],
    edge1: [Vec4; 3],
    edge2: [Vec4; 3],
    index: [u32; 4],
    /// Bit i: triangle i takes part in any-hit queries.
    blocks: u32,
}

/// Trees are balanced enough that this many pending children never come together in practice; a
/// deeper tree gets a stack on the heap.
const STACK: usize = 48;

impl Bvh {
    /// Builds a hierarchy. `blocks[i]` tells whether triangle i takes part in [`Bvh::any_hit`].
    ///
    /// # Panics
    /// While a render pass lives, as all that wants a ray: a realtime frame has none.
    pub fn new(vertices: &[[Vec3; 3]], blocks: &[bool]) -> Self {
        refuse_rays();
        let triangles: Vec<Triangle> = vertices
            .iter()
            .map(|&[v0, v1, v2]| Triangle { v0: v0.into(), v1: v1.into(), v2: v2.into() })
            .collect();
        let params = obvhs::BvhBuildParams::medium_build();
        let bvh = build_bvh2_from_tris(&triangles, params, &mut std::time::Duration::default());
        let mut leaves = Vec::new();
        let (nodes, depth) = fold(&bvh.nodes, |first, count| {
            let indices = &bvh.primitive_indices[first as usize..(first + count) as usize];
            let at = leaves.len() as u32;
            leaves.extend(indices.chunks(4).map(|four| Triangles::new(four, &triangles, blocks)));
            Child { first: at, leaves: leaves.len() as u32 - at }
        });
        // Of four children one is gone into.
        Self { nodes, leaves, stack_size: 3 * depth + 1 }
    }

    /// The closest hit with t in [min_t, max_t], from either side of a triangle.
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let mut closest = None;
        let mut max_t = ray.max_t;
        self.traverse(ray, |wide, leaves| {
            for triangles in leaves {
                let (mut hit, t, u, v) = triangles.meet(wide, max_t);
                while hit != 0 {
                    let i = hit.trailing_zeros() as usize;
                    hit &= hit - 1;
                    if t[i] <= max_t {
                        max_t = t[i];
                        let (barycentric, triangle) = ([u[i], v[i]], triangles.index[i] as usize);
                        closest = Some(Hit { t: t[i], barycentric, triangle });
                    }
                }
            }
            Some(max_t)
        });
        closest
    }

    /// Whether any blocking triangle is hit with t in [min_t, max_t].
    pub fn any_hit(&self, ray: &Ray) -> bool {
        let mut found = false;
        self.traverse(ray, |wide, leaves| {
            found = leaves.iter().any(|four| four.meet(wide, ray.max_t).0 & four.blocks != 0);
            (!found).then_some(ray.max_t)
        });
        found
    }

    /// Visits the leaves along a ray, nearer ones first. `leaf` answers how far hits still
    /// matter, or `None` to stop.
    #[inline(always)]
    fn traverse(&self, ray: &Ray, mut leaf: impl FnMut(&WideRay, &[Triangles]) -> Option<f32>) {
        refuse_rays();
        if self.nodes.is_empty() {
            return;
        }
        let wide = WideRay::new(ray);
        let mut max_t = ray.max_t;
        // Children put aside, and where the ray enters them; the nearest on top.
        let mut small = [(Child::default(), 0.0f32); STACK];
        let mut large = Vec::new();
        let stack: &mut [(Child, f32)] = if self.stack_size <= STACK {
            &mut small
        } else {
            large.resize(self.stack_size, (Child::default(), 0.0));
            &mut large
        };
        let mut pending = 0;
        let mut child = Child::default();
        loop {
            let first = child.first as usize;
            if child.leaves > 0 {
                match leaf(&wide, &self.leaves[first..first + child.leaves as usize]) {
                    Some(t) => max_t = t,
                    None => return,
                }
            } else {
                let node = &self.nodes[first];
                let (mut hit, enter) = node.meet(&wide, max_t);
                let bottom = pending;
                while hit != 0 {
                    let index = hit.trailing_zeros() as usize;
                    hit &= hit - 1;
                    let mut at = pending;
                    while at > bottom && stack[at - 1].1 < enter[index] {
                        stack[at] = stack[at - 1];
                        at -= 1;
                    }
                    stack[at] = (node.children[index], enter[index]);
                    pending += 1;
                }
            }
            loop {
                if pending == 0 {
                    return;
                }
                pending -= 1;
                let (next, enter) = stack[pending];
                // The search may have narrowed since this child was put aside.
                if enter <= max_t {
                    child = next;
                    break;
                }
            }
        }
    }
}

/// A ray, each component four times over.
struct WideRay {
    origin: [Vec4; 3],
    direction: [Vec4; 3],
    /// Finite even for a zero component, so that 0 times it is 0 and not NaN.
    inverse: [Vec4; 3],
    min_t: Vec4,
}

impl WideRay {
    fn new(ray: &Ray) -> Self {
        let four = |v: Vec3| [Vec4::splat(v.x), Vec4::splat(v.y), Vec4::splat(v.z)];
        let inverse = ray.direction.recip().clamp(Vec3::splat(-1e18), Vec3::splat(1e18));
        Self {
            origin: four(ray.origin),
            direction: four(ray.direction),
            inverse: four(inverse),
            min_t: Vec4::splat(ray.min_t),
        }
    }
}

impl Node {
    /// Which children's boxes the ray meets within [min_t, max_t], a bit each, and where it enters them.
    ///
    /// The slab test with the widening of Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013.
    #[inline(always)]
    fn meet(&self, ray: &WideRay, max_t: f32) -> (u32, [f32; 4]) {
        let slab = |axis: usize| {
            let a = (self.min[axis] - ray.origin[axis]) * ray.inverse[axis];
            let b = (self.max[axis] - ray.origin[axis]) * ray.inverse[axis];
            (a.min(b), a.max(b))
        };
        let ((near_x, far_x), (near_y, far_y), (near_z, far_z)) = (slab(0), slab(1), slab(2));
        let near = near_x.max(near_y).max(near_z).max(ray.min_t);
        let far = (far_x.min(far_y).min(far_z) * 1.000_000_5).min(Vec4::splat(max_t));
        (near.cmple(far).bitmask() & self.present, near.to_array())
    }
}

impl Triangles {
    fn new(indices: &[u32], triangles: &[Triangle], blocks: &[bool]) -> Self {
        let zero = [Vec4::ZERO; 3];
        let mut four = Self { corner: zero, edge1: zero, edge2: zero, index: [0; 4], blocks: 0 };
        for (i, &index) in indices.iter().enumerate() {
            let t = &triangles[index as usize];
            let (edge1, edge2) = (t.v1 - t.v0, t.v2 - t.v0);
            for axis in 0..3 {
                four.corner[axis][i] = t.v0[axis];
                four.edge1[axis][i] = edge1[axis];
                four.edge2[axis][i] = edge2[axis];
            }
            four.index[i] = index;
            four.blocks |= u32::from(blocks[index as usize]) << i;
        }
        four
    }

    /// Which triangles the ray hits within [min_t, max_t], a bit each; where, and the barycentric weights there.
    ///
    /// Möller and Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection", 1997, without
    /// culling. A triangle seen edge-on or of zero area is not hit.
    #[inline(always)]
    fn meet(&self, ray: &WideRay, max_t: f32) -> (u32, [f32; 4], [f32; 4], [f32; 4]) {
        let p = cross(&ray.direction, &self.edge2);
        let inv_det = 1.0 / dot(&self.edge1, &p);
        let s = minus(&ray.origin, &self.corner);
        let u = dot(&s, &p) * inv_det;
        let q = cross(&s, &self.edge1);
        let v = dot(&ray.direction, &q) * inv_det;
        let t = dot(&self.edge2, &q) * inv_det;
        // A zero determinant makes u and v infinite or NaN, and some comparison false.
        let inside = u.cmpge(Vec4::ZERO) & v.cmpge(Vec4::ZERO) & (u + v).cmple(Vec4::ONE);
        let hit = inside & t.cmpge(ray.min_t) & t.cmple(Vec4::splat(max_t));
        (hit.bitmask(), t.to_array(), u.to_array(), v.to_array())
    }
}

#[inline(always)]
fn minus(a: &[Vec4; 3], b: &[Vec4; 3]) -> [Vec4; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn dot(a: &[Vec4; 3], b: &[Vec4; 3]) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: &[Vec4; 3], b: &[Vec4; 3]) -> [Vec4; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Folds a binary tree into one with up to four children for each node, which are the largest boxes at hand; also
/// answers how many nodes lie on the longest way down. `leaf` is given the first and the number of a leaf's primitives.
fn fold(binary: &[Bvh2Node], mut leaf: impl FnMut(u32, u32) -> Child) -> (Vec<Node>, usize) {
    let Some(root) = binary.first() else { return (Vec::new(), 0) };
    let halves = |node: &Bvh2Node| {
        let first = node.first_index as usize;
        [binary[first], binary[first + 1]]
    };
    let empty = Node {
        min: [Vec4::ZERO; 3],
        max: [Vec4::ZERO; 3],
        children: [Child::default(); 4],
        present: 0,
    };
    let (mut nodes, mut deepest) = (vec![empty], 0);
    // What is to be folded into which node, at which depth.
    let mut pending = vec![(*root, 0usize, 1usize)];
    while let Some((from, index, depth)) = pending.pop() {
        deepest = deepest.max(depth);
        let mut children = vec![from];
        while children.len() < 4 {
            let inner = (0..children.len()).filter(|&i| children[i].prim_count == 0);
            let area = |i: &usize| children[*i].aabb().half_area();
            let Some(largest) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
            let [a, b] = halves(&children[largest]);
            children[largest] = a;
            children.push(b);
        }
        for (i, child) in children.iter().enumerate() {
            let aabb = child.aabb();
            let inner = child.prim_count == 0;
            let next = nodes.len() as u32;
            let node = &mut nodes[index];
            for axis in 0..3 {
                node.min[axis][i] = aabb.min[axis];
                node.max[axis][i] = aabb.max[axis];
            }
            node.children[i] = if inner {
                Child { first: next, leaves: 0 }
            } else {
                leaf(child.first_index, child.prim_count)
            };
            node.present |= 1 << i;
            if inner {
                pending.push((*child, next as usize, depth + 1));
                nodes.push(empty);
            }
        }
    }
    (nodes, deepest)
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

    /// Cards that double in size and distance make a tree like a ladder.
    #[test]
    fn deep_trees_are_walked_to_their_ends() {
        let card = |i: i32| {
            let size = 2f32.powi(i);
            [vec3(size, 0.0, 0.0), vec3(size, size, 0.0), vec3(size, 0.0, size)]
        };
        let triangles: Vec<[Vec3; 3]> = (-38..38).map(card).collect();
        let bvh = Bvh::new(&triangles, &[true; 76]);
        assert!(bvh.stack_size > STACK, "{}", bvh.stack_size);
        for (index, i) in (-38..38).enumerate() {
            let size = 2f32.powi(i);
            let from = vec3(size * 0.9, size * 0.2, size * 0.2);
            let ray = Ray::segment(from, Vec3::X, 0.0, size);
            assert_eq!(bvh.closest_hit(&ray).map(|hit| hit.triangle), Some(index));
            assert!(bvh.any_hit(&ray) && !bvh.any_hit(&Ray { direction: Vec3::Y, ..ray }));
        }
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
