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

/// A ray, each component eight times over.
pub struct WideRay<L> {
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
    pub fn new(ray: &Ray) -> Self {
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
    pub fn meet<L: Lanes>(&self, ray: &WideRay<L>, max_t: f32) -> (u32, L) {
        let [x, y, z] = ray.near;
        let enter = self.slab(ray, 0, x).max(self.slab(ray, 1, y)).max(self.slab(ray, 2, z));
        let leave =
            self.slab(ray, 0, 1 - x).min(self.slab(ray, 1, 1 - y)).min(self.slab(ray, 2, 1 - z));
        let (enter, leave) = (enter.max(ray.min_t), leave.times(L::splat(1.000_000_5)));
        // A ray with NaN may seem to meet anything, even children that do not exist.
        (enter.at_most(leave.min(L::splat(max_t))) & self.present, enter)
    }

    /// Where the ray meets the planes that bound the boxes below or above along an axis.
    #[inline(always)]
    fn slab<L: Lanes>(&self, ray: &WideRay<L>, axis: usize, bound: usize) -> L {
        L::load(&self.bounds[bound & 1][axis]).minus(ray.origin[axis]).times(ray.inverse[axis])
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

    /// Whether any of the triangles that `hit` says takes part in any-hit queries.
    #[inline(always)]
    pub fn any_blocks(&self, mut hit: u32) -> bool {
        while hit != 0 {
            if self.index[hit.trailing_zeros() as usize % 8] & PASSES == 0 {
                return true;
            }
            hit &= hit - 1;
        }
        false
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
    /// Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013, without culling: no ray passes
    /// between triangles that share an edge or a vertex. A triangle without area as seen from the ray is not hit.
    #[inline(always)]
    pub fn meet<L: Lanes>(&self, ray: &WideRay<L>, max_t: f32) -> (u32, [L; 3]) {
        let (ax, ay, az) = self.vertex(ray, 0);
        let (bx, by, bz) = self.vertex(ray, 1);
        let (cx, cy, cz) = self.vertex(ray, 2);
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
        // Without area this is NaN, and some comparison is false.
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

/// The same with the right sign, and zero for zero alone, where `product` is zero: what the ray does at one triangle does
/// not depend on the others beside it.
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
