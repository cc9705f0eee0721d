//! [`Tree`]: triangles in a binary tree of boxes, for questions about what is near a point or a ray.
//!
//! Triangles are halved by the middles of their boxes along the longest side until few are left. Nodes lie in one
//! array, the left child right behind its parent. Cost: O(n log n) to build, 56 bytes a node and 72 a triangle.

use glam::DVec3;
use incise_mesh::Bounds;

use crate::index::index;

/// Triangles of a leaf.
const LEAF: usize = 4;

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// The right child, or 0 in a leaf.
    right: u32,
    /// The first triangle of a leaf.
    start: u32,
    /// The triangles of a leaf.
    count: u32,
}

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    triangles: Vec<[DVec3; 3]>,
}

impl Tree {
    /// Sorts at least one and fewer than 2³¹ triangles into a tree.
    pub(super) fn new(mut triangles: Vec<[DVec3; 3]>) -> Self {
        let mut nodes = Vec::with_capacity(triangles.len());
        split(&mut triangles, 0, &mut nodes);
        Self { nodes, triangles }
    }

    pub(super) fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    pub(super) fn bounds(&self) -> Bounds {
        self.nodes[0].bounds
    }

    /// Shows all triangles in boxes that are wanted.
    pub(super) fn visit(
        &self,
        wanted: impl Fn(&Bounds) -> bool,
        mut show: impl FnMut(&[DVec3; 3]),
    ) {
        // Halving makes no tree deeper than the bits of a count of triangles.
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

    /// Goes down from near boxes to far ones: `distance` of a triangle replaces `best` where it is smaller, and boxes
    /// farther than `best` are left out. Squared distances.
    pub(super) fn nearest(
        &self,
        point: DVec3,
        mut best: f64,
        distance: impl Fn(&[DVec3; 3]) -> f64,
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
                for triangle in &self.triangles[start..start + node.count as usize] {
                    best = best.min(distance(triangle));
                }
                continue;
            }
            let mut children = [at + 1, node.right].map(|child| {
                (
                    child,
                    self.nodes[child as usize].bounds.distance_squared(point),
                )
            });
            // The nearer one comes last, to be looked at first.
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

/// Makes the node of some triangles, of which the first is number `start`, and those below it.
fn split(triangles: &mut [[DVec3; 3]], start: usize, nodes: &mut Vec<Node>) {
    let bounds = Bounds::around(triangles.iter().flatten().copied());
    let here = nodes.len();
    nodes.push(Node {
        bounds,
        right: 0,
        start: index(start),
        count: index(triangles.len()),
    });
    if triangles.len() <= LEAF {
        return;
    }
    let size = bounds.size();
    let axis = (0..3).fold(
        0,
        |best, axis| if size[axis] > size[best] { axis } else { best },
    );
    let twice_middle = |t: &[DVec3; 3]| {
        let along = t.map(|p| p[axis]);
        along[0].min(along[1]).min(along[2]) + along[0].max(along[1]).max(along[2])
    };
    let half = triangles.len() / 2;
    triangles.select_nth_unstable_by(half, |s, t| twice_middle(s).total_cmp(&twice_middle(t)));
    let (left, right) = triangles.split_at_mut(half);
    split(left, start, nodes);
    nodes[here].right = index(nodes.len());
    split(right, start + half, nodes);
}
