//! [`BoxTree`]: boxes in a binary tree, to find those that overlap a box.
//!
//! Built by halving at the median center along the longest axis. Cost: O(n log n) to build, O(log n + found) a query
//! where the boxes are small.

use incise_mesh::Bounds;

/// Boxes a leaf holds at most.
const LEAF: usize = 4;

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Node {
    bounds: Bounds,
    /// The items below it, in the tree's order.
    first: usize,
    end: usize,
    /// The node after all those below it.
    next: usize,
}

/// A tree over numbered boxes. The nodes lie in the order of a walk, each before those below it.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct BoxTree {
    nodes: Vec<Node>,
    order: Vec<usize>,
    boxes: Vec<Bounds>,
}

impl BoxTree {
    pub(crate) fn new(boxes: Vec<Bounds>) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(boxes.len()),
            order: (0..boxes.len()).collect(),
            boxes,
        };
        if !tree.boxes.is_empty() {
            tree.build(0, tree.boxes.len());
        }
        tree
    }

    fn build(&mut self, first: usize, end: usize) {
        let items = &mut self.order[first..end];
        let boxes = &self.boxes;
        let bounds = items[1..]
            .iter()
            .fold(boxes[items[0]], |all, &i| all.union(boxes[i]));
        let node = self.nodes.len();
        self.nodes.push(Node {
            bounds,
            first,
            end,
            next: 0,
        });
        if items.len() > LEAF {
            let size = bounds.size();
            let axis = size.max_position();
            // Halved first: the sum could overflow.
            let center = |i: usize| 0.5 * boxes[i].low[axis] + 0.5 * boxes[i].high[axis];
            let half = items.len() / 2;
            items.select_nth_unstable_by(half, |&i, &j| {
                center(i).total_cmp(&center(j)).then(i.cmp(&j))
            });
            self.build(first, first + half);
            self.build(first + half, end);
        }
        self.nodes[node].next = self.nodes.len();
    }

    /// The numbers of the boxes that overlap a box, in an order of the tree's own.
    pub(crate) fn overlapping(&self, wanted: Bounds) -> impl Iterator<Item = usize> + '_ {
        let mut node = 0;
        let mut leaf = 0..0;
        std::iter::from_fn(move || {
            loop {
                if let Some(place) = leaf.next() {
                    let item = self.order[place];
                    if self.boxes[item].overlaps(&wanted) {
                        return Some(item);
                    }
                    continue;
                }
                let here = self.nodes.get(node)?;
                if !here.bounds.overlaps(&wanted) {
                    node = here.next;
                    continue;
                }
                if here.end - here.first <= LEAF {
                    leaf = here.first..here.end;
                }
                node += 1;
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// Against all boxes, from none to many, with equal ones among them.
    #[test]
    fn finds_what_overlaps() {
        for count in [0_usize, 1, 4, 5, 9, 200] {
            let at = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 97) as f64;
            let make = |i: usize, size: f64| {
                let low = DVec3::new(at(i, 1), at(i, 2), at(i, 3));
                Bounds::around([low, low + DVec3::new(1.0, 2.0, 3.0) * size])
            };
            let boxes: Vec<Bounds> = (0..count).map(|i| make(i / 2, 4.0)).collect();
            let tree = BoxTree::new(boxes.clone());
            for i in 0..50 {
                let wanted = make(1000 + i, 8.0);
                let mut found: Vec<usize> = tree.overlapping(wanted).collect();
                found.sort_unstable();
                let expected: Vec<usize> =
                    (0..count).filter(|&i| boxes[i].overlaps(&wanted)).collect();
                assert_eq!(found, expected);
            }
        }
    }
}
