//! Ray casting: a bounding volume hierarchy over triangles, eight children to a node.
//!
//! obvhs builds a binary tree; folding it and the traversal are ours: a ray meets eight boxes or eight triangles at
//! once, and any-hit queries stop at the first hit. Where the machine has AVX2 it is used, with the same hits.

mod lanes;
#[cfg(test)]
mod tests;

use glam::Vec3;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::triangle::Triangle;
use smallvec::SmallVec;

use crate::Ray;
use crate::realtime::refuse_rays;
use lanes::{Eight, Lanes, Portable};

/// A hierarchy over the triangles of a scene.
pub struct Bvh {
    /// The first is the root.
    nodes: Vec<Node>,
    leaves: Vec<Triangles>,
    /// Whether this machine has AVX2.
    #[cfg_attr(not(target_arch = "x86_64"), expect(dead_code, reason = "only x86-64 has AVX2"))]
    avx2: bool,
}

/// The boxes of eight children, and what is in them.
#[derive(Clone)]
struct Node {
    /// The lower and the upper bounds, axis by axis.
    bounds: [[Eight; 3]; 2],
    children: [Child; 8],
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

/// Up to eight triangles.
struct Triangles {
    /// Vertex by vertex, axis by axis; NaN where there is no triangle.
    vertices: [[Eight; 3]; 3],
    index: [u32; 8],
    /// Bit i: triangle i takes part in any-hit queries.
    blocks: u32,
}

/// So many pending children have room without an allocation; a deeper tree gets a stack on the heap.
const STACK: usize = 96;

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
        let nodes = fold(&bvh.nodes, |first, count| {
            let indices = &bvh.primitive_indices[first as usize..(first + count) as usize];
            let at = leaves.len() as u32;
            leaves.extend(indices.chunks(8).map(|eight| Triangles::new(eight, vertices, blocks)));
            Child { first: at, leaves: leaves.len() as u32 - at }
        });
        #[cfg(target_arch = "x86_64")]
        let avx2 = lanes::has_avx2();
        #[cfg(not(target_arch = "x86_64"))]
        let avx2 = false;
        Self { nodes, leaves, avx2 }
    }

    /// The closest hit with t in [min_t, max_t], from either side of a triangle; of several at one
    /// distance that of the lowest index.
    #[inline(never)]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        refuse_rays();
        #[cfg(target_arch = "x86_64")]
        if self.avx2 {
            // SAFETY: the machine has AVX2.
            return unsafe { closest_avx2(self, ray) };
        }
        self.closest::<Portable>(ray)
    }

    /// Whether any blocking triangle is hit with t in [min_t, max_t].
    #[inline(never)]
    pub fn any_hit(&self, ray: &Ray) -> bool {
        refuse_rays();
        #[cfg(target_arch = "x86_64")]
        if self.avx2 {
            // SAFETY: the machine has AVX2.
            return unsafe { any_avx2(self, ray) };
        }
        self.any::<Portable>(ray)
    }

    #[inline(always)]
    fn closest<L: Lanes>(&self, ray: &Ray) -> Option<Hit> {
        let mut closest: Option<Hit> = None;
        let mut max_t = ray.max_t;
        self.traverse::<L, true>(ray, |wide, leaves| {
            for triangles in leaves {
                let (mut hit, found) = triangles.meet(wide, max_t);
                if hit == 0 {
                    continue;
                }
                let [t, u, v] = [found[0].to_array(), found[1].to_array(), found[2].to_array()];
                while hit != 0 {
                    let i = hit.trailing_zeros() as usize;
                    hit &= hit - 1;
                    let triangle = triangles.index[i] as usize;
                    let wins =
                        |best: Hit| t[i] < best.t || (t[i] == best.t && triangle < best.triangle);
                    if closest.is_none_or(wins) {
                        max_t = t[i];
                        closest = Some(Hit { t: max_t, barycentric: [u[i], v[i]], triangle });
                    }
                }
            }
            Some(max_t)
        });
        closest
    }

    #[inline(always)]
    fn any<L: Lanes>(&self, ray: &Ray) -> bool {
        let mut found = false;
        self.traverse::<L, false>(ray, |wide, leaves| {
            found = leaves.iter().any(|eight| eight.meet(wide, ray.max_t).0 & eight.blocks != 0);
            (!found).then_some(ray.max_t)
        });
        found
    }

    /// Visits the leaves along a ray, nearer ones first where they are `SORTED`. `leaf` answers how far hits
    /// still matter, or `None` to stop.
    #[inline(always)]
    fn traverse<L: Lanes, const SORTED: bool>(
        &self,
        ray: &Ray,
        mut leaf: impl FnMut(&WideRay<L>, &[Triangles]) -> Option<f32>,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let wide = WideRay::<L>::new(ray);
        let mut max_t = ray.max_t;
        // Children put aside, and where the ray enters them; the nearest on top.
        let mut pending = SmallVec::<[(f32, Child); STACK]>::new();
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
                if hit.is_power_of_two() {
                    child = node.children[hit.trailing_zeros() as usize % 8];
                    continue;
                }
                let enter = enter.to_array();
                let bottom = pending.len();
                while hit != 0 {
                    let index = hit.trailing_zeros() as usize % 8;
                    hit &= hit - 1;
                    let next = (enter[index], node.children[index]);
                    let mut at = pending.len();
                    pending.push(next);
                    while SORTED && at > bottom && pending[at - 1].0 < next.0 {
                        pending[at] = pending[at - 1];
                        at -= 1;
                    }
                    pending[at] = next;
                }
            }
            loop {
                let Some((enter, next)) = pending.pop() else { return };
                // The search may have narrowed since this child was put aside.
                if enter <= max_t {
                    child = next;
                    break;
                }
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn closest_avx2(bvh: &Bvh, ray: &Ray) -> Option<Hit> {
    bvh.closest::<lanes::Avx2>(ray)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn any_avx2(bvh: &Bvh, ray: &Ray) -> bool {
    bvh.any::<lanes::Avx2>(ray)
}

/// A ray, each component eight times over.
struct WideRay<L> {
    origin: [L; 3],
    inverse: [L; 3],
    /// By axis, which of a node's bounds the ray meets first.
    near: [usize; 3],
    /// The axes in an order in which the direction is longest along the last.
    axes: [usize; 3],
    /// The shear that turns the ray to the last axis, and the scale that makes it of length 1.
    shear: [L; 3],
    min_t: L,
}

impl<L: Lanes> WideRay<L> {
    #[inline(always)]
    fn new(ray: &Ray) -> Self {
        let (o, d) = (ray.origin, ray.direction);
        // Finite even for a zero component, so that 0 times it is 0 and not NaN.
        let inverse = d.recip().clamp(Vec3::splat(-1e18), Vec3::splat(1e18));
        let length = d.abs();
        let last = if length.z >= length.x && length.z >= length.y {
            2
        } else {
            usize::from(length.y >= length.x)
        };
        let axes = [(last + 1) % 3, (last + 2) % 3, last];
        let longest = d[last];
        Self {
            origin: [L::splat(o.x), L::splat(o.y), L::splat(o.z)],
            inverse: [L::splat(inverse.x), L::splat(inverse.y), L::splat(inverse.z)],
            near: [
                usize::from(inverse.x < 0.0),
                usize::from(inverse.y < 0.0),
                usize::from(inverse.z < 0.0),
            ],
            axes,
            shear: [
                L::splat(d[axes[0]] / longest),
                L::splat(d[axes[1]] / longest),
                L::splat(1.0 / longest),
            ],
            min_t: L::splat(ray.min_t),
        }
    }
}

impl Node {
    /// Which children's boxes the ray meets within [min_t, max_t], a bit each, and where it enters them.
    ///
    /// The slab test with the widening of Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013.
    #[inline(always)]
    fn meet<L: Lanes>(&self, ray: &WideRay<L>, max_t: f32) -> (u32, L) {
        let [x, y, z] = ray.near;
        let enter = self.slab(ray, 0, x).max(self.slab(ray, 1, y)).max(self.slab(ray, 2, z));
        let leave =
            self.slab(ray, 0, 1 - x).min(self.slab(ray, 1, 1 - y)).min(self.slab(ray, 2, 1 - z));
        let (enter, leave) = (enter.max(ray.min_t), leave.times(L::splat(1.000_000_5)));
        // A ray that is no number may seem to meet anything, children that are not there too.
        (enter.at_most(leave.min(L::splat(max_t))) & self.present, enter)
    }

    /// Where the ray meets the planes that bound the boxes below or above along an axis.
    #[inline(always)]
    fn slab<L: Lanes>(&self, ray: &WideRay<L>, axis: usize, bound: usize) -> L {
        L::load(&self.bounds[bound & 1][axis]).minus(ray.origin[axis]).times(ray.inverse[axis])
    }
}

impl Triangles {
    fn new(indices: &[u32], vertices: &[[Vec3; 3]], blocks: &[bool]) -> Self {
        let nothing = [[Eight([f32::NAN; 8]); 3]; 3];
        let mut eight = Self { vertices: nothing, index: [0; 8], blocks: 0 };
        for (i, &index) in indices.iter().enumerate() {
            for (lanes, vertex) in eight.vertices.iter_mut().zip(vertices[index as usize]) {
                for axis in 0..3 {
                    lanes[axis].0[i] = vertex[axis];
                }
            }
            eight.index[i] = index;
            eight.blocks |= u32::from(blocks[index as usize]) << i;
        }
        eight
    }

    /// Vertices as seen from the ray's origin: across the ray, and along it.
    #[inline(always)]
    fn vertex<L: Lanes>(&self, ray: &WideRay<L>, i: usize) -> (L, L, L) {
        let [x, y, z] = ray.axes;
        let depth = L::load(&self.vertices[i][z]).minus(ray.origin[z]);
        let right = L::load(&self.vertices[i][x]).minus(ray.origin[x]);
        let up = L::load(&self.vertices[i][y]).minus(ray.origin[y]);
        let [shear_x, shear_y, scale] = ray.shear;
        (right.minus(shear_x.times(depth)), up.minus(shear_y.times(depth)), scale.times(depth))
    }

    /// Which triangles the ray hits within [min_t, max_t], a bit each; where, and the barycentric weights of
    /// the second and the third vertex there.
    ///
    /// Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013, without culling: no ray
    /// passes between triangles that share an edge or a vertex. One of zero area as the ray sees it is not hit.
    #[inline(always)]
    fn meet<L: Lanes>(&self, ray: &WideRay<L>, max_t: f32) -> (u32, [L; 3]) {
        let (ax, ay, az) = self.vertex(ray, 0);
        let (bx, by, bz) = self.vertex(ray, 1);
        let (cx, cy, cz) = self.vertex(ray, 2);
        let (mut u, mut v, mut w) =
            (edge(cx, cy, bx, by), edge(ax, ay, cx, cy), edge(bx, by, ax, ay));
        let zero = L::splat(0.0);
        let product = u.times(v).times(w);
        if product.at_most(zero) & zero.at_most(product) != 0 {
            // On an edge, or so it seems: products of single precision are exact in double precision.
            u = edge_exactly(cx, cy, bx, by);
            v = edge_exactly(ax, ay, cx, cy);
            w = edge_exactly(bx, by, ax, ay);
        }
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        let inside = zero.at_most(least) | most.at_most(zero);
        if inside == 0 {
            return (0, [zero; 3]);
        }
        // Of no area this is no number, and some comparison false.
        let scale = L::splat(1.0).over(u.plus(v).plus(w));
        let t = u.times(az).plus(v.times(bz)).plus(w.times(cz)).times(scale);
        let hit = inside & ray.min_t.at_most(t) & t.at_most(L::splat(max_t));
        (hit, [t, v.times(scale), w.times(scale)])
    }
}

/// On which side of an edge the ray passes, and how far.
#[inline(always)]
fn edge<L: Lanes>(ax: L, ay: L, bx: L, by: L) -> L {
    ax.times(by).minus(ay.times(bx))
}

/// The same with the right sign, and zero for zero alone.
#[inline(always)]
fn edge_exactly<L: Lanes>(ax: L, ay: L, bx: L, by: L) -> L {
    let (ax, ay, bx, by) = (ax.to_array(), ay.to_array(), bx.to_array(), by.to_array());
    let product = |a: f32, b: f32| f64::from(a) * f64::from(b);
    let mut edge = Eight([0.0; 8]);
    for (i, edge) in edge.0.iter_mut().enumerate() {
        *edge = (product(ax[i], by[i]) - product(ay[i], bx[i])) as f32;
    }
    L::load(&edge)
}

/// Folds a binary tree into one with up to eight children for each node, which are the largest boxes at hand.
/// `leaf` is given the first and the number of a leaf's primitives.
fn fold(binary: &[Bvh2Node], mut leaf: impl FnMut(u32, u32) -> Child) -> Vec<Node> {
    let Some(root) = binary.first() else { return Vec::new() };
    let halves = |node: &Bvh2Node| {
        let first = node.first_index as usize;
        [binary[first], binary[first + 1]]
    };
    let empty =
        Node { bounds: [[Eight([0.0; 8]); 3]; 2], children: [Child::default(); 8], present: 0 };
    let mut nodes = vec![empty.clone()];
    // What is to be folded into which node.
    let mut pending = vec![(*root, 0usize)];
    while let Some((from, index)) = pending.pop() {
        let mut children = vec![from];
        while children.len() < 8 {
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
                node.bounds[0][axis].0[i] = aabb.min[axis];
                node.bounds[1][axis].0[i] = aabb.max[axis];
            }
            node.children[i] = if inner {
                Child { first: next, leaves: 0 }
            } else {
                leaf(child.first_index, child.prim_count)
            };
            node.present |= 1 << i;
            if inner {
                pending.push((*child, next as usize));
                nodes.push(empty.clone());
            }
        }
    }
    nodes
}
