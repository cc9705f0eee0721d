//! [`TriangleTree`]: boxes of triangles in a binary tree that is refitted as they move.
//!
//! Built by halving at the median center along the longest axis, first among the pieces of bodies, so that boxes stay
//! small while pieces pass each other, then among the triangles of each, four a leaf, nodes in the order of a walk
//! with the node to skip to. A search needs no stack. Boxes are in single precision, rounded outward, so that half the
//! memory is read and nothing is missed. Its results are a set: their order is the tree's own. What most searches look at
//! of a triangle, its box and its normal, lies beside those of the others of its leaf. A node also has a box around the
//! normals below it, so that a search may leave out whole patches that face the wrong way, and one around the steps of the
//! frame, so that it looks further where something moves fast.
//!
//! Cost: O(n log n) to build, O(n) to refit, O(log n + found) a search.

use std::ops::Range;

use glam::{DVec3, Vec4};
use incise_mesh::Bounds;

use crate::index::index;

/// Triangles a leaf holds at most.
const LEAF: usize = 4;

/// A box in single precision around one in double precision; empty where `low` exceeds `high`. The last of four numbers is
/// 0, so that a box is compared in lanes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Box32 {
    pub(crate) low: [f32; 4],
    pub(crate) high: [f32; 4],
}

impl Box32 {
    /// The box without a point. Finite, so that it can be written in any format.
    pub(crate) const EMPTY: Self = Self {
        low: [f32::MAX, f32::MAX, f32::MAX, 0.0],
        high: [f32::MIN, f32::MIN, f32::MIN, 0.0],
    };

    /// The smallest box of this kind around a box.
    #[inline]
    pub(crate) fn around(bounds: &Bounds) -> Self {
        Self {
            low: bounds.low.extend(0.0).to_array().map(rounded_down),
            high: bounds.high.extend(0.0).to_array().map(rounded_up),
        }
    }

    /// The box around one point.
    #[inline]
    pub(crate) fn at(point: Vec4) -> Self {
        let point = point.to_array();
        Self {
            low: point,
            high: point,
        }
    }

    /// The box around the origin alone.
    pub(crate) const POINT: Self = Self {
        low: [0.0; 4],
        high: [0.0; 4],
    };

    #[inline]
    fn union(self, other: Self) -> Self {
        Self {
            low: self.low().min(other.low()).to_array(),
            high: self.high().max(other.high()).to_array(),
        }
    }

    #[inline]
    pub(crate) fn low(&self) -> Vec4 {
        Vec4::from_array(self.low)
    }

    #[inline]
    pub(crate) fn high(&self) -> Vec4 {
        Vec4::from_array(self.high)
    }

    #[inline]
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        let is_below = self.low().cmple(other.high());
        (is_below & other.low().cmple(self.high())).all()
    }

    fn longest_axis(&self) -> usize {
        let size = [0, 1, 2].map(|k| f64::from(self.high[k]) - f64::from(self.low[k]));
        DVec3::from_array(size).max_position()
    }

    /// The sum of both ends along an axis: orders boxes as their centers do.
    fn center(&self, axis: usize) -> f64 {
        f64::from(self.low[axis]) + f64::from(self.high[axis])
    }
}

/// The box around those of numbers.
fn around(numbers: &[u32], boxes: &[Box32]) -> Box32 {
    let all = numbers.iter().map(|&number| boxes[number as usize]);
    all.fold(Box32::EMPTY, Box32::union)
}

/// The largest number of single precision not above `x`.
#[inline]
fn rounded_down(x: f64) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest")]
    let near = x as f32;
    if f64::from(near) > x {
        near.next_down()
    } else {
        near
    }
}

/// The smallest number of single precision not below `x`.
#[inline]
fn rounded_up(x: f64) -> f32 {
    -rounded_down(-x)
}

/// What a node knows of all triangles below it.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Around {
    pub(crate) bounds: Box32,
    /// Around the tets behind them.
    pub(crate) tets: Box32,
    /// Around their normals.
    pub(crate) normals: Box32,
    /// Around their steps.
    pub(crate) steps: Box32,
}

impl Around {
    const NOTHING: Self = Self {
        bounds: Box32::EMPTY,
        tets: Box32::EMPTY,
        normals: Box32::EMPTY,
        steps: Box32::EMPTY,
    };

    fn union(self, other: Self) -> Self {
        Self {
            bounds: self.bounds.union(other.bounds),
            tets: self.tets.union(other.tets),
            normals: self.normals.union(other.normals),
            steps: self.steps.union(other.steps),
        }
    }
}

/// What a tree takes over of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    /// Of unit length.
    pub(crate) normal: DVec3,
    /// The box around the tet behind it.
    pub(crate) tet: Box32,
    /// The box around the steps of its corners.
    pub(crate) steps: Box32,
    pub(crate) part: u32,
}

impl Item {
    /// For trees whose searches ask for boxes only.
    pub(crate) const PLAIN: Self = Self {
        normal: DVec3::ZERO,
        tet: Box32::EMPTY,
        steps: Box32::POINT,
        part: 0,
    };
}

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Node {
    around: Around,
    /// The node after all those below it.
    next: u32,
    /// Of a leaf, the place of its first triangle.
    first: u32,
    /// Of a leaf, the number of its triangles; 0 for other nodes.
    count: u32,
}

/// A triangle in a tree.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Leaf {
    pub(crate) bounds: Box32,
    /// Of unit length up to single precision.
    pub(crate) normal: Vec4,
    /// Around the tet behind it.
    pub(crate) tet: Box32,
    /// Around the steps of its corners.
    pub(crate) steps: Box32,
    pub(crate) number: u32,
    pub(crate) part: u32,
}

/// A tree over numbered triangles.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct TriangleTree {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    /// The numbers in the order of the leaves.
    order: Vec<u32>,
}

impl TriangleTree {
    /// Builds it over the triangles whose numbers are given, in the memory it has. Boxes are by number. Triangles of
    /// different parts share no leaf, and only nodes above all of both.
    pub(crate) fn build(
        &mut self,
        numbers: impl Iterator<Item = u32>,
        boxes: &[Box32],
        item_of: impl Fn(u32) -> Item,
    ) {
        self.order.clear();
        self.order.extend(numbers);
        self.nodes.clear();
        self.order
            .sort_unstable_by_key(|&number| (item_of(number).part, number));
        let mut parts: Vec<(Range<usize>, Box32)> = Vec::new();
        let mut first = 0;
        for same in self
            .order
            .chunk_by(|&i, &j| item_of(i).part == item_of(j).part)
        {
            let range = first..first + same.len();
            first = range.end;
            parts.push((range, around(same, boxes)));
        }
        if !parts.is_empty() {
            self.split_parts(&mut parts, boxes);
        }
        self.refit(boxes, item_of);
    }

    fn fill(&mut self, boxes: &[Box32], item_of: impl Fn(u32) -> Item) {
        self.leaves.clear();
        let leaves = self.order.iter().map(|&number| {
            let item = item_of(number);
            Leaf {
                bounds: boxes[number as usize],
                normal: item.normal.extend(0.0).as_vec4(),
                tet: item.tet,
                steps: item.steps,
                number,
                part: item.part,
            }
        });
        self.leaves.extend(leaves);
    }

    /// Appends the nodes over parts, each the places of its triangles and the box around them.
    fn split_parts(&mut self, parts: &mut [(Range<usize>, Box32)], boxes: &[Box32]) {
        if let [(range, _)] = parts {
            self.split(range.start, range.end, boxes);
            return;
        }
        let all = parts.iter().map(|(_, bounds)| *bounds);
        let bounds = all.fold(Box32::EMPTY, Box32::union);
        let node = self.nodes.len();
        self.nodes.push(Node {
            around: Around::NOTHING,
            next: 0,
            first: 0,
            count: 0,
        });
        let axis = bounds.longest_axis();
        let half = parts.len() / 2;
        parts.select_nth_unstable_by(half, |(one, i), (other, j)| {
            let (i, j) = (i.center(axis), j.center(axis));
            i.total_cmp(&j).then(one.start.cmp(&other.start))
        });
        let (left, right) = parts.split_at_mut(half);
        self.split_parts(left, boxes);
        self.split_parts(right, boxes);
        self.nodes[node].next = index(self.nodes.len());
    }

    fn split(&mut self, first: usize, end: usize, boxes: &[Box32]) {
        let items = &mut self.order[first..end];
        let of = |number: u32| boxes[number as usize];
        let bounds = around(items, boxes);
        let is_leaf = items.len() <= LEAF;
        let node = self.nodes.len();
        self.nodes.push(Node {
            around: Around::NOTHING,
            next: 0,
            first: index(first),
            count: if is_leaf { index(items.len()) } else { 0 },
        });
        if !is_leaf {
            let axis = bounds.longest_axis();
            let half = items.len() / 2;
            items.select_nth_unstable_by(half, |&i, &j| {
                let centers = (of(i).center(axis), of(j).center(axis));
                centers.0.total_cmp(&centers.1).then(i.cmp(&j))
            });
            self.split(first, first + half, boxes);
            self.split(first + half, end, boxes);
        }
        self.nodes[node].next = index(self.nodes.len());
    }

    /// Takes over the present boxes and normals, the boxes of removed triangles empty.
    pub(crate) fn refit(&mut self, boxes: &[Box32], item_of: impl Fn(u32) -> Item) {
        self.fill(boxes, item_of);
        for i in (0..self.nodes.len()).rev() {
            let node = self.nodes[i];
            self.nodes[i].around = if node.count > 0 {
                let triangles = node.first as usize..(node.first + node.count) as usize;
                let leaves = self.leaves[triangles].iter();
                leaves.fold(Around::NOTHING, |around, leaf| {
                    around.union(Around {
                        bounds: leaf.bounds,
                        tets: leaf.tet,
                        normals: Box32::at(leaf.normal),
                        steps: leaf.steps,
                    })
                })
            } else {
                let left = &self.nodes[i + 1];
                let right = &self.nodes[left.next as usize];
                left.around.union(right.around)
            };
        }
    }

    /// Forgets all triangles.
    pub(crate) fn clear(&mut self) {
        self.nodes.clear();
        self.leaves.clear();
        self.order.clear();
    }

    /// How many triangles it was built over.
    pub(crate) fn len(&self) -> usize {
        self.order.len()
    }

    /// Calls `visit` with each triangle whose box overlaps `wanted`.
    #[inline]
    pub(crate) fn search(&self, wanted: &Box32, mut visit: impl FnMut(&Leaf)) {
        self.search_where(
            |around| around.bounds.overlaps(wanted),
            |leaf| {
                if leaf.bounds.overlaps(wanted) {
                    visit(leaf);
                }
                true
            },
        );
    }

    /// Calls `visit` with each triangle but for those below a node that is refused, until it returns false. Whether it
    /// never did.
    #[inline]
    pub(crate) fn search_where(
        &self,
        is_wanted: impl Fn(&Around) -> bool,
        mut visit: impl FnMut(&Leaf) -> bool,
    ) -> bool {
        let mut here = 0;
        while let Some(node) = self.nodes.get(here) {
            if !is_wanted(&node.around) {
                here = node.next as usize;
                continue;
            }
            let triangles = node.first as usize..(node.first + node.count) as usize;
            if !self.leaves[triangles].iter().all(&mut visit) {
                return false;
            }
            here += 1;
        }
        true
    }

    /// The numbers in the order of the leaves.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(count: usize, seed: usize, size: f64) -> Vec<Box32> {
        let at = |i: usize, k: usize| ((i * 7919 + k * 104_729 + seed) % 97) as f64 + 0.1;
        (0..count)
            .map(|i| {
                let low = DVec3::new(at(i / 2, 1), at(i / 2, 2), at(i / 2, 3));
                let high = low + DVec3::new(1.0, 2.0, 3.0) * size;
                Box32::around(&Bounds::around([low, high]))
            })
            .collect()
    }

    fn found(tree: &TriangleTree, wanted: &Box32) -> Vec<u32> {
        let mut found = Vec::new();
        tree.search(wanted, |leaf| found.push(leaf.number));
        found.sort_unstable();
        found
    }

    /// Against all boxes, from none to many, with equal and with empty ones among them, before and after a refit.
    #[test]
    fn finds_what_overlaps() {
        let mut tree = TriangleTree::default();
        for (count, parts) in [
            (0_usize, 1),
            (1, 1),
            (4, 1),
            (5, 2),
            (9, 3),
            (200, 1),
            (200, 7),
        ] {
            let mut now = boxes(count, 0, 4.0);
            let item_of = |i: u32| Item {
                part: i % parts,
                ..Item::PLAIN
            };
            tree.build(0..index(count), &now, item_of);
            for round in 0..3 {
                for wanted in boxes(50, 1234, 8.0) {
                    let expected: Vec<u32> = (0..index(count))
                        .filter(|&i| now[i as usize].overlaps(&wanted))
                        .collect();
                    assert_eq!(found(&tree, &wanted), expected);
                }
                now = boxes(count, 31 * (round + 1), 4.0);
                for empty in now.iter_mut().step_by(3) {
                    *empty = Box32::EMPTY;
                }
                tree.refit(&now, |_| Item::PLAIN);
            }
        }
    }

    /// A condition on normals leaves out nothing that meets it.
    #[test]
    fn finds_what_faces() {
        let count = 200;
        let now = boxes(count, 5, 4.0);
        let normals: Vec<DVec3> = (0..count)
            .map(|i| {
                DVec3::new(((i * 31) % 17) as f64 - 8.0, ((i * 7) % 5) as f64, 1.0).normalize()
            })
            .collect();
        let mut tree = TriangleTree::default();
        let item_of = |i: u32| Item {
            normal: normals[i as usize],
            ..Item::PLAIN
        };
        tree.build(0..index(count), &now, item_of);
        let mut left_out = 0;
        for wanted in boxes(50, 99, 8.0) {
            let mut found = Vec::new();
            let faces = |normal: f32| normal < -0.5;
            tree.search_where(
                |around| {
                    let faces = faces(around.normals.low[0]);
                    faces && around.bounds.overlaps(&wanted)
                },
                |leaf| {
                    if leaf.bounds.overlaps(&wanted) {
                        found.push((leaf.number, leaf.normal.x));
                    }
                    true
                },
            );
            let all = 0..index(count);
            let all = all.filter(|&i| now[i as usize].overlaps(&wanted));
            left_out += all.clone().count() - found.len();
            let mut found: Vec<u32> = found.iter().filter(|f| faces(f.1)).map(|f| f.0).collect();
            found.sort_unstable();
            let expected = all.filter(|&i| faces(normals[i as usize].as_vec3().x));
            assert!(expected.eq(found));
        }
        assert!(left_out > 20, "{left_out}");
    }

    #[test]
    fn boxes_are_rounded_outward() {
        for i in 0..2000 {
            let x = (f64::from(i) - 1000.0) / 3.0 * 1.1_f64.powi(i % 60 - 30);
            let (low, high) = (rounded_down(x), rounded_up(x));
            assert!(f64::from(low) <= x && x <= f64::from(high));
            assert!(low == high || low.next_up() == high);
        }
        assert_eq!(
            (rounded_down(1e300), rounded_up(1e300)),
            (f32::MAX, f32::INFINITY)
        );
        assert_eq!(rounded_down(-0.5), -0.5);
    }
}
