//! [`Tree`]: triangles in a binary tree of boxes, for nearest-triangle and ray queries.
//!
//! Triangles are split at the median of their box centers along the longest side until few are left. Nodes lie in one
//! array, the left child directly after its parent. Cost: O(n log n) to build, 56 bytes per node and 76 per triangle.

use glam::DVec3;
use incise_mesh::Bounds;

use crate::index::index;

/// Largest number of triangles in a leaf.
const LEAF: usize = 4;

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// Index of the right child, or 0 in a leaf.
    right: u32,
    /// First triangle of a leaf.
    start: u32,
    /// Number of triangles of a leaf.
    count: u32,
}

/// Binary tree of boxes over triangles; see the module.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    triangles: Vec<[DVec3; 3]>,
    /// Index of each triangle in the list that the tree was built from.
    numbers: Vec<u32>,
}

impl Tree {
    /// Builds a tree of at least one and fewer than 2³¹ triangles.
    pub(super) fn new(triangles: &[[DVec3; 3]]) -> Self {
        let mut nodes = Vec::with_capacity(triangles.len());
        let mut numbers: Vec<u32> = (0..).take(triangles.len()).collect();
        split(triangles, &mut numbers, 0, &mut nodes);
        Self {
            nodes,
            triangles: numbers.iter().map(|&t| triangles[t as usize]).collect(),
            numbers,
        }
    }

    pub(super) fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    /// Index in the list that the tree was built from of the triangle at an index of the tree.
    pub(super) fn number(&self, triangle: usize) -> usize {
        self.numbers[triangle] as usize
    }

    pub(super) fn bounds(&self) -> Bounds {
        self.nodes[0].bounds
    }

    /// Visits all triangles in the boxes that a predicate accepts.
    pub(super) fn visit(
        &self,
        wanted: impl Fn(&Bounds) -> bool,
        mut show: impl FnMut(&[DVec3; 3]),
    ) {
        // The depth of the tree is at most the number of bits of the triangle count.
        let mut waiting = [0_u32; 64];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let at = waiting[count];
            let node = &self.nodes[at as usize];
            if !wanted(&node.bounds) {
                continue;
            }
            if node.right == 0 {
                let start = node.start as usize;
                self.triangles[start..start + node.count as usize]
                    .iter()
                    .for_each(&mut show);
            } else {
                waiting[count] = node.right;
                waiting[count + 1] = at + 1;
                count += 2;
            }
        }
    }

    /// Searches boxes from near to far: `distance` of a triangle, which also gets its index in the tree, replaces `best`
    /// if smaller, and boxes farther than `best` are skipped. All distances are squared.
    pub(super) fn nearest(
        &self,
        point: DVec3,
        mut best: f64,
        distance: impl Fn(usize, &[DVec3; 3]) -> f64,
    ) -> f64 {
        let mut waiting = [(0_u32, 0.0_f64); 64];
        waiting[0] = (0, self.nodes[0].bounds.distance_squared(point));
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (at, far) = waiting[count];
            if far >= best {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.right == 0 {
                let start = node.start as usize;
                for t in start..start + node.count as usize {
                    best = best.min(distance(t, &self.triangles[t]));
                }
                continue;
            }
            let mut children = [at + 1, node.right].map(|child| {
                (
                    child,
                    self.nodes[child as usize].bounds.distance_squared(point),
                )
            });
            // The nearer child is pushed last, so that it is popped first.
            if children[0].1 < children[1].1 {
                children.swap(0, 1);
            }
            waiting[count] = children[0];
            waiting[count + 1] = children[1];
            count += 2;
        }
        best
    }
}

/// Creates the node of the triangles with the given indices, which start at `start` of all, and its subtree.
fn split(triangles: &[[DVec3; 3]], numbers: &mut [u32], start: usize, nodes: &mut Vec<Node>) {
    let corners = numbers.iter().flat_map(|&t| triangles[t as usize]);
    let bounds = Bounds::around(corners);
    let here = nodes.len();
    nodes.push(Node {
        bounds,
        right: 0,
        start: index(start),
        count: index(numbers.len()),
    });
    if numbers.len() <= LEAF {
        return;
    }
    let size = bounds.size();
    let axis = (0..3).fold(
        0,
        |best, axis| if size[axis] > size[best] { axis } else { best },
    );
    let twice_middle = |t: u32| {
        let along = triangles[t as usize].map(|p| p[axis]);
        along[0].min(along[1]).min(along[2]) + along[0].max(along[1]).max(along[2])
    };
    let half = numbers.len() / 2;
    numbers.select_nth_unstable_by(half, |&s, &t| twice_middle(s).total_cmp(&twice_middle(t)));
    let (left, right) = numbers.split_at_mut(half);
    split(triangles, left, start, nodes);
    nodes[here].right = index(nodes.len());
    split(triangles, right, start + half, nodes);
}
