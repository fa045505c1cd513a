//! Eight boxes and eight triangles, and how a ray meets them.

use bytemuck::Zeroable;
use glam::Vec3;

use super::lanes::{Eight, Lanes};
use crate::Ray;

/// The boxes of eight children, and what is in them: four cache lines.
#[derive(Clone)]
#[repr(align(64))]
pub struct Node {
    /// The lower and the upper bounds, axis by axis.
    pub bounds: [[Eight; 3]; 2],
    pub children: [Child; 8],
    /// Bit i: there is a child i.
    pub present: u32,
}

/// The number of a node, or that of a leaf with [`IS_LEAF`].
pub type Child = u32;
/// The bit of a child that is a leaf.
pub const IS_LEAF: Child = 1 << 31;

/// Up to eight triangles: five cache lines.
#[derive(Clone, Copy, Zeroable)]
pub struct Triangles {
    /// Vertex by vertex, axis by axis; NaN where there is no triangle.
    vertices: [[Eight; 3]; 3],
    /// Which they are, with [`PASSES`].
    index: [u32; 8],
}

/// The bit of a triangle that takes no part in any-hit queries.
const PASSES: u32 = 1 << 31;

impl Node {
    /// Without children.
    pub const EMPTY: Self =
        Self { bounds: [[Eight([0.0; 8]); 3]; 2], children: [0; 8], present: 0 };
}

impl Triangles {
    /// None at all.
    pub const EMPTY: Self = Self { vertices: [[Eight([f32::NAN; 8]); 3]; 3], index: [0; 8] };
}

/// One ray, each component eight times over, or eight rays that go the same way.
pub struct WideRay<L> {
    pub origin: [L; 3],
    pub inverse: [L; 3],
    pub way: Way,
    /// The shear that turns the ray to the last axis, and the scale that makes it of length 1.
    pub shear: [L; 3],
    pub min_t: L,
}

/// What rays that go the same way have in common.
#[derive(Clone, Copy)]
pub struct Way {
    /// By axis, which of a node's bounds the ray meets first.
    pub near: [usize; 3],
    /// The axes in an order in which the direction is longest along the last.
    pub axes: [usize; 3],
}

impl Way {
    #[inline(always)]
    pub fn new(negative: [bool; 3], longest: usize) -> Self {
        Self {
            near: negative.map(usize::from),
            axes: [(longest + 1) % 3, (longest + 2) % 3, longest],
        }
    }
}

impl<L: Lanes> WideRay<L> {
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        let (o, d) = (ray.origin, ray.direction);
        // Finite even for a zero component, so that 0 times it is 0 and not NaN.
        let inverse = d.recip().clamp(Vec3::splat(-INVERSE_LIMIT), Vec3::splat(INVERSE_LIMIT));
        let length = d.abs();
        let last = if length.z >= length.x && length.z >= length.y {
            2
        } else {
            usize::from(length.y >= length.x)
        };
        let way = Way::new([inverse.x < 0.0, inverse.y < 0.0, inverse.z < 0.0], last);
        let [x, y, z] = way.axes;
        Self {
            origin: [L::splat(o.x), L::splat(o.y), L::splat(o.z)],
            inverse: [L::splat(inverse.x), L::splat(inverse.y), L::splat(inverse.z)],
            way,
            shear: [L::splat(d[x] / d[z]), L::splat(d[y] / d[z]), L::splat(1.0 / d[z])],
            min_t: L::splat(ray.min_t),
        }
    }

    /// Where the ray meets a plane across an axis.
    #[inline(always)]
    fn plane(&self, axis: usize, at: L) -> L {
        at.minus(self.origin[axis]).times(self.inverse[axis])
    }

    /// Whether the ray meets a box within [min_t, max_t], a bit each, and where it enters it. Of a box the bounds are
    /// given that the ray meets first, axis by axis, and the others.
    ///
    /// The slab test with the widening of Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013.
    #[inline(always)]
    fn meets(&self, near: [L; 3], far: [L; 3], max_t: L) -> (u32, L) {
        let enter = self.plane(0, near[0]).max(self.plane(1, near[1])).max(self.plane(2, near[2]));
        let leave = self.plane(0, far[0]).min(self.plane(1, far[1])).min(self.plane(2, far[2]));
        let enter = enter.max(self.min_t);
        (enter.at_most(widened(leave).min(max_t)), enter)
    }

    /// A vertex as seen from the ray's origin: across the ray, and along it.
    #[inline(always)]
    fn vertex(&self, at: [L; 3]) -> (L, L, L) {
        let [x, y, z] = self.way.axes;
        let depth = at[2].minus(self.origin[z]);
        let right = at[0].minus(self.origin[x]);
        let up = at[1].minus(self.origin[y]);
        let [shear_x, shear_y, scale] = self.shear;
        (right.minus(shear_x.times(depth)), up.minus(shear_y.times(depth)), scale.times(depth))
    }

    /// Whether the ray hits a triangle within [min_t, max_t], a bit each; where, and the barycentric weights of the
    /// second and the third vertex there. The coordinates of a vertex come in the order of the ray's axes.
    ///
    /// Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013, without culling: no ray
    /// passes between triangles that share an edge or a vertex. One of zero area as the ray sees it is not hit.
    #[inline(always)]
    fn hits(&self, [a, b, c]: [[L; 3]; 3], max_t: L) -> (u32, [L; 3]) {
        let (ax, ay, az) = self.vertex(a);
        let (bx, by, bz) = self.vertex(b);
        let (cx, cy, cz) = self.vertex(c);
        let (mut u, mut v, mut w) =
            (edge(cx, cy, bx, by), edge(ax, ay, cx, cy), edge(bx, by, ax, ay));
        let zero = L::splat(0.0);
        let product = u.times(v).times(w);
        if product.at_most(zero) & zero.at_most(product) != 0 {
            // On an edge, or so it seems: products of single precision are exact in double precision.
            let product = product.to_array();
            u = edge_exactly(cx, cy, bx, by, u, &product);
            v = edge_exactly(ax, ay, cx, cy, v, &product);
            w = edge_exactly(bx, by, ax, ay, w, &product);
        }
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        let inside = zero.at_most(least) | most.at_most(zero);
        if inside == 0 {
            return (0, [zero; 3]);
        }
        // Of no area this is no number, and some comparison false.
        let scale = L::splat(1.0).over(u.plus(v).plus(w));
        let t = u.times(az).plus(v.times(bz)).plus(w.times(cz)).times(scale);
        let hit = inside & self.min_t.at_most(t) & t.at_most(max_t);
        (hit, [t, v.times(scale), w.times(scale)])
    }
}

/// The inverse of a direction's component is at most this.
pub const INVERSE_LIMIT: f32 = 1e18;

/// Where a ray leaves a box at the latest, whatever was rounded.
#[inline(always)]
pub fn widened<L: Lanes>(leave: L) -> L {
    leave.times(L::splat(1.000_000_5))
}

impl Node {
    /// Which children's boxes the ray meets within [min_t, max_t], a bit each, and where it enters them.
    #[inline(always)]
    pub fn meet<L: Lanes>(&self, ray: &WideRay<L>, max_t: f32) -> (u32, L) {
        let [x, y, z] = ray.way.near;
        let near = [self.bound(0, x), self.bound(1, y), self.bound(2, z)];
        let far = [self.bound(0, 1 - x), self.bound(1, 1 - y), self.bound(2, 1 - z)];
        let (hit, enter) = ray.meets(near, far, L::splat(max_t));
        // A ray with NaN may seem to meet anything, even children that do not exist.
        (hit & self.present, enter)
    }

    /// The lower or the upper bounds of all boxes along an axis.
    #[inline(always)]
    pub fn bound<L: Lanes>(&self, axis: usize, upper: usize) -> L {
        L::load(&self.bounds[upper & 1][axis])
    }

    /// Which of eight rays meet the box of child `i` within [min_t, max_t], a bit each, and where they enter it.
    #[inline(always)]
    pub fn meet_child<L: Lanes>(&self, i: usize, rays: &WideRay<L>, max_t: L) -> (u32, L) {
        let [x, y, z] = rays.way.near;
        let near = [self.one(0, x, i), self.one(1, y, i), self.one(2, z, i)];
        let far = [self.one(0, 1 - x, i), self.one(1, 1 - y, i), self.one(2, 1 - z, i)];
        rays.meets(near, far, max_t)
    }

    #[inline(always)]
    fn one<L: Lanes>(&self, axis: usize, upper: usize, i: usize) -> L {
        L::splat(self.bounds[upper & 1][axis].0[i % 8])
    }
}

impl Triangles {
    /// Puts triangle `index` in place `i`; `blocks`: it takes part in any-hit queries.
    pub fn set(&mut self, i: usize, index: u32, corners: &[Vec3; 3], blocks: bool) {
        for (lanes, corner) in self.vertices.iter_mut().zip(corners) {
            for (axis, lanes) in lanes.iter_mut().enumerate() {
                lanes.0[i] = corner[axis];
            }
        }
        self.index[i] = index | if blocks { 0 } else { PASSES };
    }

    /// All that it holds.
    #[cfg(test)]
    pub fn content(&self) -> impl Iterator<Item = u32> {
        let corners = self.vertices.iter().flatten().flat_map(|eight| eight.0.map(f32::to_bits));
        corners.chain(self.index)
    }

    /// The index of triangle `i`.
    #[inline(always)]
    pub fn index(&self, i: usize) -> u32 {
        self.index[i] & !PASSES
    }

    /// Whether triangle `i` takes part in any-hit queries.
    #[inline(always)]
    pub fn blocks(&self, i: usize) -> bool {
        self.index[i] & PASSES == 0
    }

    /// Whether any of the triangles that `hit` says takes part in any-hit queries.
    #[inline(always)]
    pub fn any_blocks(&self, mut hit: u32) -> bool {
        while hit != 0 {
            if self.blocks(hit.trailing_zeros() as usize % 8) {
                return true;
            }
            hit &= hit - 1;
        }
        false
    }

    /// Which triangles the ray hits within [min_t, max_t], a bit each; where, and the barycentric weights of
    /// the second and the third vertex there.
    #[inline(always)]
    pub fn meet<L: Lanes>(&self, ray: &WideRay<L>, max_t: f32) -> (u32, [L; 3]) {
        ray.hits(self.corners(ray.way), L::splat(max_t))
    }

    /// The vertices of all triangles, in the order of a ray's axes.
    #[inline(always)]
    fn corners<L: Lanes>(&self, way: Way) -> [[L; 3]; 3] {
        let [x, y, z] = way.axes;
        let [a, b, c] = &self.vertices;
        let a = [L::load(&a[x]), L::load(&a[y]), L::load(&a[z])];
        let b = [L::load(&b[x]), L::load(&b[y]), L::load(&b[z])];
        let c = [L::load(&c[x]), L::load(&c[y]), L::load(&c[z])];
        [a, b, c]
    }

    /// Whether there is a triangle `i`.
    #[inline(always)]
    pub fn has(&self, i: usize) -> bool {
        !self.vertices[0][0].0[i].is_nan()
    }

    /// Which of eight rays hit triangle `i`, and the same of them.
    #[inline(always)]
    pub fn meet_one<L: Lanes>(&self, i: usize, rays: &WideRay<L>, max_t: L) -> (u32, [L; 3]) {
        rays.hits(self.corners_of(i, rays.way), max_t)
    }

    /// The vertices of one triangle, each eight times over.
    #[inline(always)]
    fn corners_of<L: Lanes>(&self, i: usize, way: Way) -> [[L; 3]; 3] {
        let [x, y, z] = way.axes;
        let [a, b, c] = &self.vertices;
        let a = [L::splat(a[x].0[i]), L::splat(a[y].0[i]), L::splat(a[z].0[i])];
        let b = [L::splat(b[x].0[i]), L::splat(b[y].0[i]), L::splat(b[z].0[i])];
        let c = [L::splat(c[x].0[i]), L::splat(c[y].0[i]), L::splat(c[z].0[i])];
        [a, b, c]
    }
}

/// On which side of an edge the ray passes, and how far.
#[inline(always)]
fn edge<L: Lanes>(ax: L, ay: L, bx: L, by: L) -> L {
    ax.times(by).minus(ay.times(bx))
}

/// The same with the right sign, and zero for zero alone, where `product` is zero: what the ray does at one triangle
/// does not depend on the others beside it.
#[inline(always)]
fn edge_exactly<L: Lanes>(ax: L, ay: L, bx: L, by: L, edge: L, product: &[f32; 8]) -> L {
    let (ax, ay, bx, by) = (ax.to_array(), ay.to_array(), bx.to_array(), by.to_array());
    let times = |a: f32, b: f32| f64::from(a) * f64::from(b);
    let mut edge = Eight(edge.to_array());
    for (i, edge) in edge.0.iter_mut().enumerate().filter(|(i, _)| product[*i] == 0.0) {
        *edge = (times(ax[i], by[i]) - times(ay[i], bx[i])) as f32;
    }
    L::load(&edge)
}
