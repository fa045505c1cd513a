//! Eight rays at once through the hierarchy.
//!
//! Rays of a packet go the same way. The beam around them meets the eight boxes of a node at once (Wald, Boulos and
//! Shirley, "Ray Tracing Deformable Scenes Using Dynamic Bounding Volume Hierarchies", TOG 26(1), 2007). Of the
//! children that it meets, the box is tried with all eight rays, and so is each triangle. A ray hits what it hits
//! alone, bit by bit: the same is computed for it at each box and triangle, and the order of leaves does not matter.

use super::lanes::{Eight, Lanes};
use super::node::{Child, INVERSE_LIMIT, IS_LEAF, Node, Triangles, Way, WideRay, widened};
use super::stack::Stack;
use super::{Bvh, Hit, closer, entry, order};
use crate::Ray;

/// The query of a packet.
pub trait Packet {
    /// Whether nearer children come first.
    const SORTED: bool;
    /// Tests the triangles of a leaf whose box the rays of `lanes` enter at `enter`. `nearest` holds how far hits still
    /// matter for each ray.
    fn leaf<L: Lanes>(
        &mut self,
        rays: &WideRay<L>,
        triangles: &Triangles,
        lanes: u32,
        enter: L,
        nearest: &mut Eight,
    );
}

/// The closest hits.
pub struct ClosestOfEach(pub [Option<Hit>; 8]);

impl Packet for ClosestOfEach {
    const SORTED: bool = true;

    #[inline(always)]
    fn leaf<L: Lanes>(
        &mut self,
        rays: &WideRay<L>,
        triangles: &Triangles,
        lanes: u32,
        enter: L,
        nearest: &mut Eight,
    ) {
        let enter = enter.to_array();
        for i in 0..8 {
            if !triangles.has(i) {
                continue;
            }
            let (met, found) = triangles.meet_one(i, rays, L::load(nearest));
            let mut hit = met & lanes;
            if hit == 0 {
                continue;
            }
            let triangle = triangles.index(i) as usize;
            let [t, u, v] = [found[0].to_array(), found[1].to_array(), found[2].to_array()];
            while hit != 0 {
                let lane = hit.trailing_zeros() as usize % 8;
                hit &= hit - 1;
                let hit = Hit { t: t[lane], barycentric: [u[lane], v[lane]], triangle };
                closer(&mut self.0[lane], &mut nearest.0[lane], enter[lane], hit);
            }
        }
    }
}

/// Which rays hit a blocking triangle, a bit each.
pub struct AnyOfEach(pub u32);

impl Packet for AnyOfEach {
    const SORTED: bool = false;

    #[inline(always)]
    fn leaf<L: Lanes>(
        &mut self,
        rays: &WideRay<L>,
        triangles: &Triangles,
        lanes: u32,
        _: L,
        nearest: &mut Eight,
    ) {
        let mut found = 0;
        for i in 0..8 {
            if triangles.has(i) && triangles.blocks(i) {
                found |= triangles.meet_one(i, rays, L::load(nearest)).0;
            }
        }
        found &= lanes;
        self.0 |= found;
        while found != 0 {
            nearest.0[found.trailing_zeros() as usize % 8] = f32::NEG_INFINITY;
            found &= found - 1;
        }
    }
}

/// Eight rays, of which some may be missing.
struct Rays<L> {
    wide: WideRay<L>,
    /// Minus infinity where there is none.
    max_t: Eight,
    /// Those of the wanted ones that go the way of the first.
    group: u32,
}

impl<L: Lanes> Rays<L> {
    /// The rays whose bits `wanted` has; the first of them stands in the place of each other.
    #[inline(always)]
    fn new(rays: &[Option<Ray>; 8], wanted: u32) -> Option<Self> {
        let first = wanted.trailing_zeros() as usize % 8;
        let instead = rays[first]?;
        let mut columns = [Eight([0.0; 8]); 8];
        for (lane, ray) in rays.iter().enumerate() {
            let (ray, max_t) = match ray {
                Some(ray) if wanted >> lane & 1 == 1 => (ray, ray.max_t),
                _ => (&instead, f32::NAN),
            };
            let [ox, oy, oz] = ray.origin.to_array();
            let [dx, dy, dz] = ray.direction.to_array();
            // A missing ray, or one whose end is NaN, meets nothing.
            let max_t = if max_t.is_nan() { f32::NEG_INFINITY } else { max_t };
            let values = [ox, oy, oz, dx, dy, dz, ray.min_t, max_t];
            for (column, value) in columns.iter_mut().zip(values) {
                column.0[lane] = value;
            }
        }
        let [ox, oy, oz, dx, dy, dz, min_t, max_t] = columns;
        let d = [L::load(&dx), L::load(&dy), L::load(&dz)];
        let origin = [L::load(&ox), L::load(&oy), L::load(&oz)];
        let inverse = [inverse(d[0]), inverse(d[1]), inverse(d[2])];
        let zero = L::splat(0.0);
        let negative =
            [inverse[0].at_most(zero), inverse[1].at_most(zero), inverse[2].at_most(zero)];
        let [x, y, z] = [length(d[0]), length(d[1]), length(d[2])];
        let along_z = x.at_most(z) & y.at_most(z);
        let along_y = x.at_most(y) & !along_z;
        let min_t = L::load(&min_t);
        let mut numbers = min_t.at_most(min_t);
        for axis in 0..3 {
            numbers &= d[axis].at_most(d[axis]) & origin[axis].at_most(origin[axis]);
        }
        let mut group = wanted;
        for bits in [negative[0], negative[1], negative[2], along_y, along_z, numbers] {
            group &= if bits >> first & 1 == 1 { bits } else { !bits };
        }
        let of_first = |bits: u32| bits >> first & 1 == 1;
        let last = if of_first(along_z) { 2 } else { usize::from(of_first(along_y)) };
        let way = Way::new(negative.map(of_first), last);
        let [across, up, along] = way.axes;
        let wide = WideRay {
            origin,
            inverse,
            way,
            shear: [d[across].over(d[along]), d[up].over(d[along]), L::splat(1.0).over(d[along])],
            min_t,
        };
        Some(Self { wide, max_t, group })
    }
}

#[inline(always)]
fn inverse<L: Lanes>(direction: L) -> L {
    L::splat(1.0).over(direction).max(L::splat(-INVERSE_LIMIT)).min(L::splat(INVERSE_LIMIT))
}

#[inline(always)]
fn length<L: Lanes>(direction: L) -> L {
    direction.max(L::splat(0.0).minus(direction))
}

/// Bounds on the rays of a packet.
struct Beam<L> {
    /// The outermost origins, as seen from the bounds that are met first, and from the others.
    origin: [[L; 3]; 2],
    inverse: [[L; 3]; 2],
    min_t: L,
    near: [usize; 3],
}

impl<L: Lanes> Beam<L> {
    #[inline(always)]
    fn new(rays: &WideRay<L>) -> Self {
        let o = rays.origin;
        let least = [o[0].least(), o[1].least(), o[2].least()];
        let most = [o[0].most(), o[1].most(), o[2].most()];
        let near = rays.way.near;
        let inverse = rays.inverse;
        let mut origin = [most, least];
        for axis in 0..3 {
            if near[axis] == 1 {
                (origin[0][axis], origin[1][axis]) = (least[axis], most[axis]);
            }
        }
        Self {
            origin,
            inverse: [
                [inverse[0].least(), inverse[1].least(), inverse[2].least()],
                [inverse[0].most(), inverse[1].most(), inverse[2].most()],
            ],
            min_t: rays.min_t.least(),
            near,
        }
    }

    /// Which children's boxes a ray of the beam may meet before `last`, a bit each, and where at the earliest.
    #[inline(always)]
    fn meet(&self, node: &Node, last: f32) -> (u32, L) {
        let [x, y, z] = self.near;
        let enter = self
            .earliest(0, node.bound(0, x))
            .max(self.earliest(1, node.bound(1, y)))
            .max(self.earliest(2, node.bound(2, z)))
            .max(self.min_t);
        let leave = self
            .latest(0, node.bound(0, 1 - x))
            .min(self.latest(1, node.bound(1, 1 - y)))
            .min(self.latest(2, node.bound(2, 1 - z)));
        (enter.at_most(widened(leave).min(L::splat(last))) & node.present, enter)
    }

    #[inline(always)]
    fn earliest(&self, axis: usize, plane: L) -> L {
        let way = plane.minus(self.origin[0][axis]);
        way.times(self.inverse[0][axis]).min(way.times(self.inverse[1][axis]))
    }

    #[inline(always)]
    fn latest(&self, axis: usize, plane: L) -> L {
        let way = plane.minus(self.origin[1][axis]);
        way.times(self.inverse[0][axis]).max(way.times(self.inverse[1][axis]))
    }
}

impl Bvh {
    #[inline(always)]
    pub(super) fn traverse_eight<L: Lanes, P: Packet>(
        &self,
        rays: &[Option<Ray>; 8],
        search: &mut P,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let mut left = 0;
        for (lane, ray) in rays.iter().enumerate() {
            left |= u32::from(ray.is_some()) << lane;
        }
        while let Some(mut packet) = Rays::<L>::new(rays, left) {
            let group = packet.group;
            if group != left {
                match Rays::new(rays, group) {
                    Some(alone) => packet = alone,
                    None => return,
                }
            }
            self.traverse_packet(&packet.wide, packet.max_t, search);
            left &= !group;
            if left == 0 {
                return;
            }
        }
    }

    /// Visits the leaves along rays that go the same way.
    #[inline(always)]
    fn traverse_packet<L: Lanes, P: Packet>(
        &self,
        rays: &WideRay<L>,
        mut nearest: Eight,
        search: &mut P,
    ) {
        let beam = Beam::new(rays);
        let mut last = L::load(&nearest).most().to_array()[0];
        // Children put aside: the place of each, with where the beam enters it; the nearest on top.
        let mut pending = Stack::new();
        let mut at = 0;
        loop {
            let node = &self.nodes[at as usize];
            let (mut hit, enter) = beam.meet(node, last);
            let enter = enter.to_array();
            let bottom = pending.len();
            while hit != 0 {
                let i = hit.trailing_zeros() as usize % 8;
                hit &= hit - 1;
                let next = entry(enter[i], at * 8 + i as Child);
                if P::SORTED {
                    pending.insert(bottom, next);
                } else {
                    pending.push(next);
                }
            }
            loop {
                let Some(next) = pending.pop() else { return };
                if next > u64::from(order(last)) << 32 | u64::from(Child::MAX) {
                    continue;
                }
                let place = next as Child;
                let (node, i) = (&self.nodes[(place / 8) as usize], (place % 8) as usize);
                let (met, enter) = node.meet_child(i, rays, L::load(&nearest));
                if met == 0 {
                    continue;
                }
                let child = node.children[i];
                if child & IS_LEAF == 0 {
                    at = child;
                    break;
                }
                let leaf = &self.leaves[(child & !IS_LEAF) as usize];
                search.leaf(rays, leaf, met, enter, &mut nearest);
                last = L::load(&nearest).most().to_array()[0];
                if !P::SORTED && last == f32::NEG_INFINITY {
                    return;
                }
            }
        }
    }
}
