//! Ray casting: a bounding volume hierarchy over triangles, eight children to a node.
//!
//! `build` makes a binary tree, `fold` one of eight children of it. A ray meets eight boxes or eight triangles at once
//! (`node`), and any-hit queries stop at the first hit. Eight rays meet one box or one triangle at once (`packet`).
//! Where the machine has AVX2 it is used, with the same hits.

mod build;
mod fold;
mod lanes;
mod node;
mod packet;
mod stack;
#[cfg(test)]
mod tests;
mod threads;

use glam::Vec3;

use crate::Ray;
use crate::realtime::refuse_rays;
use fold::{Wide, fold};
use lanes::{Lanes, Portable};
use node::{Child, IS_LEAF, Node, Triangles, WideRay};
use packet::{AnyOfEach, ClosestOfEach};
use stack::Stack;

/// A hierarchy over the triangles of a scene.
pub struct Bvh {
    /// The first is the root.
    nodes: Vec<Node>,
    leaves: Vec<Triangles>,
    /// Whether this machine has AVX2.
    #[cfg_attr(not(target_arch = "x86_64"), expect(dead_code, reason = "only x86-64 has AVX2"))]
    avx2: bool,
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

/// With fewer triangles, building takes less time than starting threads.
const SMALL: usize = 16_384;
/// From this depth on, triangles are split in halves. 0 makes the lowest tree: at most 32 levels, with 7 children
/// beside a path.
const DEEP: u32 = 64;
impl Bvh {
    /// Builds a hierarchy. `blocks[i]` tells whether triangle i takes part in [`Bvh::any_hit`].
    ///
    /// # Panics
    /// While a render pass exists: a realtime frame casts no rays.
    pub fn new(vertices: &[[Vec3; 3]], blocks: &[bool]) -> Self {
        refuse_rays();
        let threads = if vertices.len() < SMALL { 1 } else { threads::available() };
        Self::on_threads(vertices, blocks, threads)
    }

    /// The same hierarchy, whatever the number of threads is.
    fn on_threads(vertices: &[[Vec3; 3]], blocks: &[bool], threads: usize) -> Self {
        let mut wide = fold(vertices, blocks, threads, DEEP);
        if wide.pending > Stack::ROOM {
            wide = fold(vertices, blocks, threads, 0);
        }
        let Wide { nodes, leaves, .. } = wide;
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

    /// [`Bvh::closest_hit`] of each of eight rays, bit by bit; none where there is no ray. It is faster where rays lie
    /// close together.
    #[inline(never)]
    pub fn closest_hits(&self, rays: &[Option<Ray>; 8]) -> [Option<Hit>; 8] {
        refuse_rays();
        #[cfg(target_arch = "x86_64")]
        if self.avx2 {
            // SAFETY: the machine has AVX2.
            return unsafe { closest_of_each_avx2(self, rays) };
        }
        self.closest_of_each::<Portable>(rays)
    }

    /// [`Bvh::any_hit`] of each of eight rays; false where there is no ray.
    #[inline(never)]
    pub fn any_hits(&self, rays: &[Option<Ray>; 8]) -> [bool; 8] {
        refuse_rays();
        #[cfg(target_arch = "x86_64")]
        if self.avx2 {
            // SAFETY: the machine has AVX2.
            return unsafe { any_of_each_avx2(self, rays) };
        }
        self.any_of_each::<Portable>(rays)
    }

    #[inline(always)]
    fn closest_of_each<L: Lanes>(&self, rays: &[Option<Ray>; 8]) -> [Option<Hit>; 8] {
        let mut search = ClosestOfEach([None; 8]);
        self.traverse_eight::<L, _>(rays, &mut search);
        search.0
    }

    #[inline(always)]
    fn any_of_each<L: Lanes>(&self, rays: &[Option<Ray>; 8]) -> [bool; 8] {
        let mut search = AnyOfEach(0);
        self.traverse_eight::<L, _>(rays, &mut search);
        std::array::from_fn(|lane| search.0 >> lane & 1 == 1)
    }

    #[inline(always)]
    fn closest<L: Lanes>(&self, ray: &Ray) -> Option<Hit> {
        let mut search = Closest(None);
        self.traverse::<L, _>(ray, &mut search);
        search.0
    }

    #[inline(always)]
    fn any<L: Lanes>(&self, ray: &Ray) -> bool {
        let mut search = Any(false);
        self.traverse::<L, _>(ray, &mut search);
        search.0
    }

    /// Visits the leaves along a ray.
    #[inline(always)]
    fn traverse<L: Lanes, S: Search>(&self, ray: &Ray, search: &mut S) {
        if self.nodes.is_empty() {
            return;
        }
        let wide = WideRay::<L>::new(ray);
        let mut max_t = ray.max_t;
        // Children put aside, each with where the ray enters it; the nearest on top.
        let mut pending = Stack::new();
        let (mut child, mut begin) = (0, ray.min_t);
        loop {
            if child & IS_LEAF != 0 {
                let leaf = &self.leaves[(child & !IS_LEAF) as usize];
                match search.leaf(&wide, leaf, begin, max_t) {
                    Some(t) => max_t = t,
                    None => return,
                }
            } else {
                let node = &self.nodes[child as usize];
                let (mut hit, enter) = node.meet(&wide, max_t);
                if hit != 0 {
                    let first = hit.trailing_zeros() as usize % 8;
                    hit &= hit - 1;
                    let enter = enter.to_array();
                    if hit == 0 {
                        (child, begin) = (node.children[first], enter[first]);
                        continue;
                    }
                    let mut nearest = entry(enter[first], node.children[first]);
                    let bottom = pending.len();
                    while hit != 0 {
                        let index = hit.trailing_zeros() as usize % 8;
                        hit &= hit - 1;
                        let next = entry(enter[index], node.children[index]);
                        if S::SORTED {
                            pending.insert(bottom, next.max(nearest));
                            nearest = next.min(nearest);
                        } else {
                            pending.push(next);
                        }
                    }
                    (child, begin) = (nearest as Child, entered(nearest));
                    continue;
                }
            }
            // The search may have narrowed since a child was put aside.
            let last = u64::from(order(max_t)) << 32 | u64::from(Child::MAX);
            loop {
                let Some(next) = pending.pop() else { return };
                if next <= last {
                    (child, begin) = (next as Child, entered(next));
                    break;
                }
            }
        }
    }
}

/// What is looked for. A trait instead of a closure, because a closure in AVX2 code may be compiled apart, without
/// AVX2.
trait Search {
    /// Whether nearer children come first.
    const SORTED: bool;
    /// Tests the triangles of a leaf that the ray enters at `enter`. Returns how far hits still matter, or `None` to
    /// stop.
    fn leaf<L: Lanes>(
        &mut self,
        ray: &WideRay<L>,
        triangles: &Triangles,
        enter: f32,
        max_t: f32,
    ) -> Option<f32>;
}

struct Closest(Option<Hit>);

impl Search for Closest {
    const SORTED: bool = true;

    #[inline(always)]
    fn leaf<L: Lanes>(
        &mut self,
        ray: &WideRay<L>,
        triangles: &Triangles,
        enter: f32,
        max_t: f32,
    ) -> Option<f32> {
        let (mut hit, found) = triangles.meet(ray, max_t);
        let mut nearest = max_t;
        if hit == 0 {
            return Some(nearest);
        }
        let [t, u, v] = [found[0].to_array(), found[1].to_array(), found[2].to_array()];
        while hit != 0 {
            let i = hit.trailing_zeros() as usize % 8;
            hit &= hit - 1;
            let triangle = triangles.index(i) as usize;
            let hit = Hit { t: t[i], barycentric: [u[i], v[i]], triangle };
            closer(&mut self.0, &mut nearest, enter, hit);
        }
        Some(nearest)
    }
}

/// Takes a hit for the closest, if it is. Hits matter as far as `nearest`.
///
/// Rounding may put a hit before the box of its leaf. It counts from where the ray enters the box, at `enter`: so a
/// leaf that begins farther away than the closest hit never holds a closer one, and the order of leaves does not
/// matter.
#[inline(always)]
fn closer(best: &mut Option<Hit>, nearest: &mut f32, enter: f32, hit: Hit) {
    let from = if enter > hit.t { enter } else { hit.t };
    let wins = |best: &Hit| from < *nearest || (from == *nearest && hit.triangle < best.triangle);
    if best.as_ref().is_none_or(wins) {
        *nearest = from;
        *best = Some(hit);
    }
}

/// Whether a blocking triangle was hit.
struct Any(bool);

impl Search for Any {
    const SORTED: bool = false;

    #[inline(always)]
    fn leaf<L: Lanes>(
        &mut self,
        ray: &WideRay<L>,
        triangles: &Triangles,
        _: f32,
        max_t: f32,
    ) -> Option<f32> {
        self.0 = triangles.any_blocks(triangles.meet(ray, max_t).0);
        (!self.0).then_some(max_t)
    }
}

/// A child, and where the ray enters it in the upper half, so that the nearer is the smaller.
#[inline(always)]
fn entry(enter: f32, child: Child) -> u64 {
    u64::from(order(enter)) << 32 | u64::from(child)
}

/// A number whose order among integers is that of `t`; both zeros are one.
#[inline(always)]
fn order(t: f32) -> u32 {
    let bits = (t + 0.0).to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

/// Where the ray enters the child of an entry.
#[inline(always)]
fn entered(entry: u64) -> f32 {
    let order = (entry >> 32) as u32;
    f32::from_bits(if order >> 31 == 1 { order & !(1 << 31) } else { !order })
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

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn closest_of_each_avx2(bvh: &Bvh, rays: &[Option<Ray>; 8]) -> [Option<Hit>; 8] {
    bvh.closest_of_each::<lanes::Avx2>(rays)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn any_of_each_avx2(bvh: &Bvh, rays: &[Option<Ray>; 8]) -> [bool; 8] {
    bvh.any_of_each::<lanes::Avx2>(rays)
}
