//! The binary tree as one of up to eight children to a node.

use glam::Vec3;

use super::build::BinaryBvh;
use super::node::{IS_LEAF, Node, Triangles};
use super::threads::share;

/// Leaves that one thread fills at a time.
const CHUNK: usize = 1024;

/// A tree of eight children to a node.
pub struct Wide {
    /// The first is the root.
    pub nodes: Vec<Node>,
    pub leaves: Vec<Triangles>,
    /// The most children that lie beside a path from the root.
    pub pending: usize,
}

/// Builds one on up to `threads` threads; from level `deep` of the binary tree on in halves.
pub fn fold(vertices: &[[Vec3; 3]], blocks: &[bool], threads: usize, deep: u32) -> Wide {
    let binary = BinaryBvh::new(vertices, threads, deep);
    let (mut nodes, mut sources, mut most) = (Vec::new(), Vec::new(), 0);
    // Nodes to be folded: from which, into which, and how many children lie beside the path to it.
    let mut todo = Vec::new();
    if !binary.items.is_empty() {
        nodes.push(Node::EMPTY);
        todo.push((0, 0, 0));
    }
    let mut children = Vec::new();
    while let Some((from, into, beside)) = todo.pop() {
        binary.children(from, &mut children);
        let beside = beside + children.len() - 1;
        most = most.max(beside);
        for (i, &at) in children.iter().enumerate() {
            let child = binary.node(at);
            let next = nodes.len();
            let node: &mut Node = &mut nodes[into];
            for axis in 0..3 {
                node.bounds[0][axis].0[i] = child.min[axis];
                node.bounds[1][axis].0[i] = child.max[axis];
            }
            node.present |= 1 << i;
            if child.is_leaf() {
                node.children[i] = IS_LEAF | sources.len() as u32;
                sources.push(child.first as usize..(child.first + child.count) as usize);
            } else {
                node.children[i] = next as u32;
                nodes.push(Node::EMPTY);
                todo.push((at, next, beside));
            }
        }
    }
    // The threads that fill it take its pages.
    let mut leaves: Vec<Triangles> = bytemuck::zeroed_vec(sources.len());
    let chunks = leaves.chunks_mut(CHUNK).zip(sources.chunks(CHUNK)).collect();
    share(chunks, threads, |(leaves, sources)| {
        for (leaf, source) in leaves.iter_mut().zip(sources) {
            *leaf = Triangles::EMPTY;
            for (i, item) in binary.items[source.clone()].iter().enumerate() {
                let index = item.triangle as usize;
                leaf.set(i, item.triangle, &vertices[index], blocks[index]);
            }
        }
    });
    Wide { nodes, leaves, pending: most }
}
