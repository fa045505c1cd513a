//! Builds a binary tree by the binned surface area heuristic (Wald, "On fast Construction of SAH-based Bounding Volume
//! Hierarchies", 2007). It also computes the cost of each subtree as part of an eight-wide tree (Ylitie, Karras and
//! Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 2017).
//!
//! The tree does not depend on the number of threads: each task's part of it has its own place from the beginning.

use std::sync::{Mutex, PoisonError};

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec3A};

use super::threads::share;

/// The most triangles of a leaf.
pub const LEAF: usize = 8;
/// Costs of eight triangles and of eight boxes. Measured: 1.5 to 4 to one are as good.
const LEAF_COST: f32 = 2.5;
const NODE_COST: f32 = 1.0;
/// So few triangles are not divided. With 4, scenes with large walls lose a fifth of their rays a second.
const UNDIVIDED: usize = 2;
/// Bins of an axis; fewer for few triangles. A power of two.
const BINS: usize = 16;
/// One thread takes a part of so many triangles as a whole.
const PART: usize = 4096;
/// Adding it rounds a number below 2^22 to an integer, which then lies in the lowest bits.
const ROUND: f32 = 8_388_608.0;

/// A box along the axes.
#[derive(Clone, Copy)]
pub struct Aabb {
    pub min: Vec3A,
    pub max: Vec3A,
}

impl Aabb {
    const EMPTY: Self = Self { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY };

    #[inline(always)]
    fn grow(&mut self, min: Vec3A, max: Vec3A) {
        self.min = self.min.min(min);
        self.max = self.max.max(max);
    }

    #[inline(always)]
    fn half_area(&self) -> f32 {
        let d = (self.max - self.min).max(Vec3A::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

/// A triangle to be sorted.
#[derive(Clone, Copy)]
pub struct Item {
    aabb: Aabb,
    /// Its index in the list that the hierarchy is built from.
    pub triangle: u32,
}

impl Item {
    /// Twice the center of its box.
    #[inline(always)]
    fn center(&self) -> Vec3A {
        self.aabb.min + self.aabb.max
    }
}

/// A node of the binary tree. Its left child follows it.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct BinaryNode {
    pub min: [f32; 3],
    pub max: [f32; 3],
    /// Its triangles, as a range of the items.
    pub first: u32,
    pub count: u32,
    /// The right child; 0 where there is none.
    right: u32,
    /// At i: the least cost of it as up to i + 1 children of one node.
    cost: [f32; 7],
}

/// The bounds of triangles, and of their centers.
#[derive(Clone, Copy)]
struct Bounds {
    boxes: Aabb,
    centers: Aabb,
}

impl Bounds {
    const EMPTY: Self = Self { boxes: Aabb::EMPTY, centers: Aabb::EMPTY };

    #[inline(always)]
    fn add(&mut self, item: &Item) {
        self.boxes.grow(item.aabb.min, item.aabb.max);
        self.centers.grow(item.center(), item.center());
    }
}

/// A binary tree of triangles. `items` are in its order, a node's side by side.
pub struct BinaryBvh {
    pub items: Vec<Item>,
    /// The root is the first. Between them lie some that belong to no tree.
    nodes: Vec<BinaryNode>,
}

/// Items that become a subtree, and the room for it.
struct Part<'a> {
    items: &'a mut [Item],
    nodes: &'a mut [BinaryNode],
    /// Where `items` and `nodes` begin in all.
    first: usize,
    at: usize,
    bounds: Bounds,
    /// How many levels of it are divided by costs, those below in halves.
    levels: u32,
}

impl BinaryBvh {
    /// Builds it on up to `threads` threads. From depth `deep` on triangles are divided in halves.
    pub fn new(vertices: &[[Vec3; 3]], threads: usize, deep: u32) -> Self {
        let items = vertices.iter().zip(0..).map(|(&corners, triangle)| {
            let [a, b, c] = corners.map(Vec3A::from);
            Item { aabb: Aabb { min: a.min(b).min(c), max: a.max(b).max(c) }, triangle }
        });
        let mut items: Vec<Item> = items.collect();
        let mut nodes: Vec<BinaryNode> = bytemuck::zeroed_vec((2 * items.len()).saturating_sub(1));
        let mut bounds = Bounds::EMPTY;
        items.iter().for_each(|item| bounds.add(item));
        if !items.is_empty() {
            let (items, room) = (&mut items[..], &mut nodes[..]);
            let whole = Part { items, nodes: room, first: 0, at: 0, bounds, levels: deep };
            let mut upper = grow(whole, threads);
            // Children have higher numbers than their parents.
            upper.sort_unstable();
            for at in upper.into_iter().rev() {
                let [left, right] =
                    [at + 1, nodes[at].right as usize].map(|child: usize| nodes[child].cost);
                nodes[at].set_cost(&left, &right);
            }
        }
        Self { items, nodes }
    }

    /// A node by its number.
    pub fn node(&self, at: usize) -> &BinaryNode {
        &self.nodes[at]
    }

    /// The numbers of up to eight nodes that together hold all that is below one, at the least cost: of itself, where
    /// it is best as a leaf.
    pub fn children(&self, at: usize, out: &mut Vec<usize>) {
        out.clear();
        if self.nodes[at].is_leaf() {
            out.push(at);
        } else {
            self.divide(at, 8, out);
        }
    }

    /// Replaces a node by both of its children, which become `slots` nodes.
    fn divide(&self, at: usize, slots: usize, out: &mut Vec<usize>) {
        let (left, right) = (at + 1, self.nodes[at].right as usize);
        let (own, _) = shared(&self.nodes[left].cost, &self.nodes[right].cost, slots);
        self.collect(left, own, out);
        self.collect(right, slots - own, out);
    }

    fn collect(&self, at: usize, mut slots: usize, out: &mut Vec<usize>) {
        let node = &self.nodes[at];
        while slots > 1 && node.cost[slots - 2] <= node.cost[slots - 1] {
            slots -= 1;
        }
        if slots == 1 || node.right == 0 {
            out.push(at);
        } else {
            self.divide(at, slots, out);
        }
    }
}

impl BinaryNode {
    /// Whether it costs least as a leaf.
    pub fn is_leaf(&self) -> bool {
        self.right == 0 || self.count as usize <= LEAF && self.cost[0] >= self.leaf_cost()
    }

    fn half_area(&self) -> f32 {
        Aabb { min: self.min.into(), max: self.max.into() }.half_area()
    }

    fn leaf_cost(&self) -> f32 {
        LEAF_COST * self.half_area()
    }

    /// What it costs over two children that are known.
    fn set_cost(&mut self, left: &[f32; 7], right: &[f32; 7]) {
        self.cost[0] = NODE_COST * self.half_area() + shared(left, right, 8).1;
        if self.count as usize <= LEAF {
            self.cost[0] = self.cost[0].min(self.leaf_cost());
        }
        for slots in 2..=7 {
            self.cost[slots - 1] = shared(left, right, slots).1.min(self.cost[slots - 2]);
        }
    }
}

/// How many of `slots` children the left one of two gets, and what both cost then.
#[inline(always)]
fn shared(left: &[f32; 7], right: &[f32; 7], slots: usize) -> (usize, f32) {
    let mut best = (1, left[0] + right[slots - 2]);
    for own in 2..slots {
        let cost = left[own - 1] + right[slots - own - 1];
        if cost < best.1 {
            best = (own, cost);
        }
    }
    best
}

/// Grows the tree: the upper levels one after the other, each level's parts at once, and then all parts that are left.
/// Returns the nodes of the upper levels, whose costs are still to be set.
fn grow(whole: Part, threads: usize) -> Vec<usize> {
    let (mut upper, mut level, mut parts) = (Vec::new(), vec![whole], Vec::new());
    while threads > 1 && !level.is_empty() {
        let (large, small): (Vec<Part>, Vec<Part>) =
            level.into_iter().partition(|part| part.items.len() > PART);
        parts.extend(small);
        upper.extend(large.iter().map(|part| part.at));
        let halves = Mutex::new(Vec::new());
        share(large, threads, |part| {
            let both = part.halve();
            halves
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .extend(both.into_iter().flatten());
        });
        level = halves.into_inner().unwrap_or_else(PoisonError::into_inner);
    }
    parts.extend(level);
    share(parts, threads, Part::finish);
    upper
}

impl<'a> Part<'a> {
    /// Makes the root of the subtree, and the parts below it: none where it is not divided.
    fn halve(self) -> Option<[Part<'a>; 2]> {
        let Part { items, nodes, first, at, bounds, levels } = self;
        let root = &mut nodes[0];
        (root.min, root.max) = (bounds.boxes.min.to_array(), bounds.boxes.max.to_array());
        (root.first, root.count) = (first as u32, items.len() as u32);
        if items.len() <= UNDIVIDED {
            root.cost = [root.leaf_cost(); 7];
            return None;
        }
        let (left, [bounds, other]) = split(items, &bounds.centers, levels);
        let right = 2 * left;
        root.right = (at + right) as u32;
        let (items, other_items) = items.split_at_mut(left);
        let (nodes, other_nodes) = nodes[1..].split_at_mut(right - 1);
        let levels = levels.saturating_sub(1);
        Some([
            Part { items, nodes, first, at: at + 1, bounds, levels },
            Part {
                items: other_items,
                nodes: other_nodes,
                first: first + left,
                at: at + right,
                bounds: other,
                levels,
            },
        ])
    }

    /// Makes the whole subtree.
    fn finish(self) {
        let Part { items, nodes, .. } = self;
        let part = Part { items: &mut *items, nodes: &mut *nodes, ..self };
        if let Some([left, right]) = part.halve() {
            left.finish();
            right.finish();
            let [left, right] = [1, nodes[0].right as usize - self.at].map(|at| nodes[at].cost);
            nodes[0].set_cost(&left, &right);
        }
    }
}

/// What lies in one bin of an axis.
#[derive(Clone, Copy)]
struct Bin {
    aabb: Aabb,
    count: u32,
}

/// Partitions triangles into two sides. Returns how many are on the first side, and the bounds of both.
fn split(items: &mut [Item], centers: &Aabb, levels: u32) -> (usize, [Bounds; 2]) {
    if levels > 0
        && let Some((axis, at, bins)) = best_plane(items, centers)
    {
        let scale = bins_per_length(centers, bins)[axis];
        let low = centers.min[axis];
        let limit = ROUND + at as f32;
        // The same operations as those that chose the bin.
        let is_left =
            |item: &Item| (item.aabb.min[axis] + item.aabb.max[axis] - low) * scale + ROUND < limit;
        let (mut i, mut j) = (0, items.len());
        let [mut left, mut right] = [Bounds::EMPTY; 2];
        loop {
            while i < j && is_left(&items[i]) {
                left.add(&items[i]);
                i += 1;
            }
            while i < j && !is_left(&items[j - 1]) {
                j -= 1;
                right.add(&items[j]);
            }
            if i == j {
                break;
            }
            items.swap(i, j - 1);
        }
        if i > 0 && i < items.len() {
            return (i, [left, right]);
        }
    }
    let middle = items.len() / 2;
    let [mut left, mut right] = [Bounds::EMPTY; 2];
    items[..middle].iter().for_each(|item| left.add(item));
    items[middle..].iter().for_each(|item| right.add(item));
    (middle, [left, right])
}

fn bins_per_length(centers: &Aabb, bins: usize) -> Vec3A {
    let extent = centers.max - centers.min;
    let scale = Vec3A::splat(bins as f32 - 1.0) / extent;
    Vec3A::select(extent.cmpgt(Vec3A::ZERO), scale, Vec3A::ZERO)
}

/// The axis, the first bin on the right, and the number of bins of the cheapest plane; `None` without any.
fn best_plane(items: &[Item], centers: &Aabb) -> Option<(usize, usize, usize)> {
    let bins = (4 + items.len() / 16).min(BINS);
    let scale = bins_per_length(centers, bins);
    let mut table = [[Bin { aabb: Aabb::EMPTY, count: 0 }; 3]; BINS];
    for item in items {
        let place = ((item.center() - centers.min) * scale + Vec3A::splat(ROUND)).to_array();
        for (axis, place) in place.iter().enumerate() {
            let bin = &mut table[place.to_bits() as usize % BINS][axis];
            bin.aabb.grow(item.aabb.min, item.aabb.max);
            bin.count += 1;
        }
    }
    let nothing = [Bin { aabb: Aabb::EMPTY, count: 0 }; 3];
    let mut right_cost = [[0.0; 3]; BINS];
    let mut right = nothing;
    for (row, costs) in table[..bins].iter().zip(&mut right_cost).rev() {
        for axis in 0..3 {
            costs[axis] = right[axis].add(&row[axis]);
        }
    }
    let (mut best, mut least) = (None, f32::INFINITY);
    let mut left = nothing;
    for at in 1..bins {
        for axis in 0..3 {
            let cost = left[axis].add(&table[at - 1][axis]) + right_cost[at][axis];
            let count = left[axis].count as usize;
            if cost < least && count > 0 && count < items.len() {
                (best, least) = (Some((axis, at, bins)), cost);
            }
        }
    }
    best
}

impl Bin {
    /// Adds another bin, and returns half the area of both together, times their number of triangles.
    #[inline(always)]
    fn add(&mut self, other: &Self) -> f32 {
        self.aabb.grow(other.aabb.min, other.aabb.max);
        self.count += other.count;
        self.aabb.half_area() * self.count as f32
    }
}
