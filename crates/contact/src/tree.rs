//! [`TriangleTree`]: boxes of triangles in a tree with four children a node that is refitted as they move.
//!
//! Built by halving at the median center along the longest axis, first among the pieces of bodies, so that boxes stay
//! small while pieces pass each other, then among the triangles of each; a node stands for two halvings and holds what is
//! asked of its children side by side, so that a search asks four of them at once. Boxes are in single precision, rounded
//! outward, so that half the memory is read and nothing is missed. Its results are a set: their order is the tree's own.
//! Of a child a node has the box around the triangles below it, that around the tets behind them, one around their
//! normals, so that a search may leave out whole patches that face the wrong way, and one around the steps of the frame,
//! so that it looks further where something moves fast.
//!
//! Cost: O(n log n) to build, O(n) to refit, O(log n + found) a search.

use std::ops::Range;

use glam::{BVec4A, DVec3, Vec4};
use incise_mesh::Bounds;

use crate::index::{NONE, index};

/// The most children of a node.
const CHILDREN: usize = 4;
/// Nodes that wait to be looked at in a search at most: three more at each level. A level is at most half as large as the
/// one above, a quarter but for the last one of parts and of triangles, and there are at most 2³² triangles.
const WAITING: usize = 3 * 34 + 1;

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
        let (low, high) = (bounds.low, bounds.high);
        // Written out: a closure over an array is not inlined here.
        Self {
            low: [
                rounded_down(low.x),
                rounded_down(low.y),
                rounded_down(low.z),
                0.0,
            ],
            high: [
                rounded_up(high.x),
                rounded_up(high.y),
                rounded_up(high.z),
                0.0,
            ],
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
    // The next number below, without a branch: rounding keeps the sign, zero's included.
    let bits = near.to_bits();
    let is_above = u32::from(f64::from(near) > x);
    let is_negative = bits >> 31;
    f32::from_bits(bits - is_above + 2 * (is_above & is_negative))
}

/// The smallest number of single precision not below `x`.
#[inline]
fn rounded_up(x: f64) -> f32 {
    -rounded_down(-x)
}

/// Four boxes side by side: coordinates by axis, then by box.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Boxes {
    low: [[f32; CHILDREN]; 3],
    high: [[f32; CHILDREN]; 3],
}

impl Boxes {
    const EMPTY: Self = Self {
        low: [[f32::MAX; CHILDREN]; 3],
        high: [[f32::MIN; CHILDREN]; 3],
    };

    #[inline]
    pub(crate) fn set(&mut self, child: usize, one: &Box32) {
        for k in 0..3 {
            self.low[k][child] = one.low[k];
            self.high[k][child] = one.high[k];
        }
    }

    /// The box around all of them.
    #[inline]
    fn all(&self) -> Box32 {
        let mut all = Box32::EMPTY;
        for k in 0..3 {
            all.low[k] = self.low(k).min_element();
            all.high[k] = self.high(k).max_element();
        }
        all
    }

    #[inline]
    pub(crate) fn low(&self, axis: usize) -> Vec4 {
        Vec4::from_array(self.low[axis])
    }

    #[inline]
    pub(crate) fn high(&self, axis: usize) -> Vec4 {
        Vec4::from_array(self.high[axis])
    }

    /// Which of them overlap a box, as bits.
    #[inline]
    pub(crate) fn overlapping(&self, other: &Box32) -> u32 {
        let mut overlap = BVec4A::splat(true);
        for k in 0..3 {
            overlap &= self.low(k).cmple(Vec4::splat(other.high[k]));
            overlap &= self.high(k).cmpge(Vec4::splat(other.low[k]));
        }
        overlap.bitmask()
    }
}

/// What a node knows of its children: a triangle each, or all those below a node.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Children {
    pub(crate) bounds: Boxes,
    /// Around the tets behind them.
    pub(crate) tets: Boxes,
    /// Around their normals.
    pub(crate) normals: Boxes,
    /// Around their steps.
    pub(crate) steps: Boxes,
}

impl Children {
    pub(crate) const NONE: Self = Self {
        bounds: Boxes::EMPTY,
        tets: Boxes::EMPTY,
        normals: Boxes::EMPTY,
        steps: Boxes::EMPTY,
    };
}

/// The answers of children to two questions of a search, as bits. What answers yes to one of them is looked at.
#[derive(Clone, Copy)]
pub(crate) struct Answers {
    pub(crate) first: u32,
    pub(crate) second: u32,
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
    children: Children,
    /// The places of the children among the triangles or among the nodes, where they come later.
    below: [u32; CHILDREN],
    count: u32,
    holds_triangles: bool,
    /// The part of all triangles below it, [`NONE`] where they are of several, as of the last refit.
    #[cfg_attr(feature = "serde", serde(skip))]
    part: u32,
}

/// A triangle in a tree.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Leaf {
    /// Around the steps of its corners.
    pub(crate) steps: Box32,
    pub(crate) number: u32,
    pub(crate) part: u32,
}

/// The places of the triangles of a part and the box around them.
type Part = (Range<usize>, Box32);

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
        let mut parts: Vec<Part> = Vec::new();
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

    fn push(&mut self) -> usize {
        self.nodes.push(Node {
            children: Children::NONE,
            below: [0; CHILDREN],
            count: 0,
            holds_triangles: false,
            part: NONE,
        });
        self.nodes.len() - 1
    }

    fn adopt(&mut self, node: usize, child: u32) {
        let node = &mut self.nodes[node];
        node.below[node.count as usize] = child;
        node.count += 1;
    }

    /// Appends the nodes over parts; returns the first.
    fn split_parts(&mut self, parts: &mut [Part], boxes: &[Box32]) -> u32 {
        if let [(range, _)] = parts {
            return self.split(range.clone(), boxes);
        }
        let node = self.push();
        let (left, right) = halve_parts(parts);
        for half in [left, right] {
            if half.len() == 1 {
                let child = self.split_parts(half, boxes);
                self.adopt(node, child);
            } else {
                let (left, right) = halve_parts(half);
                for quarter in [left, right] {
                    let child = self.split_parts(quarter, boxes);
                    self.adopt(node, child);
                }
            }
        }
        index(node)
    }

    /// Appends the nodes over triangles in some places; returns the first.
    fn split(&mut self, range: Range<usize>, boxes: &[Box32]) -> u32 {
        let node = self.push();
        if range.len() <= CHILDREN {
            self.nodes[node].holds_triangles = true;
            for place in range {
                self.adopt(node, index(place));
            }
            return index(node);
        }
        for half in self.halve(range, boxes) {
            if half.len() <= CHILDREN {
                let child = self.split(half, boxes);
                self.adopt(node, child);
            } else {
                for quarter in self.halve(half, boxes) {
                    let child = self.split(quarter, boxes);
                    self.adopt(node, child);
                }
            }
        }
        index(node)
    }

    /// Orders the triangles of a range so that those of its first half are lower along the longest axis.
    fn halve(&mut self, range: Range<usize>, boxes: &[Box32]) -> [Range<usize>; 2] {
        let items = &mut self.order[range.clone()];
        let of = |number: u32| boxes[number as usize];
        let axis = around(items, boxes).longest_axis();
        let half = items.len() / 2;
        items.select_nth_unstable_by(half, |&i, &j| {
            let centers = (of(i).center(axis), of(j).center(axis));
            centers.0.total_cmp(&centers.1).then(i.cmp(&j))
        });
        let middle = range.start + half;
        [range.start..middle, middle..range.end]
    }

    /// Takes over the present boxes and normals, the boxes of removed triangles empty.
    pub(crate) fn refit(&mut self, boxes: &[Box32], item_of: impl Fn(u32) -> Item) {
        self.leaves.clear();
        let leaves = self.order.iter().map(|&number| {
            let item = item_of(number);
            Leaf {
                steps: item.steps,
                number,
                part: item.part,
            }
        });
        self.leaves.extend(leaves);
        for i in (0..self.nodes.len()).rev() {
            let (above, below) = self.nodes.split_at_mut(i + 1);
            let node = &mut above[i];
            let Children {
                bounds,
                tets,
                normals,
                steps,
            } = &mut node.children;
            let mut part = None;
            for (child, &place) in node.below[..node.count as usize].iter().enumerate() {
                let part_of_child = if node.holds_triangles {
                    let number = self.order[place as usize];
                    let item = item_of(number);
                    bounds.set(child, &boxes[number as usize]);
                    tets.set(child, &item.tet);
                    normals.set(child, &Box32::at(item.normal.extend(0.0).as_vec4()));
                    steps.set(child, &item.steps);
                    item.part
                } else {
                    let Node { children, part, .. } = &below[place as usize - i - 1];
                    bounds.set(child, &children.bounds.all());
                    tets.set(child, &children.tets.all());
                    normals.set(child, &children.normals.all());
                    steps.set(child, &children.steps.all());
                    *part
                };
                part = match part {
                    Some(part) if part != part_of_child => Some(NONE),
                    _ => Some(part_of_child),
                };
            }
            node.part = part.unwrap_or(NONE);
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
        let ask = |children: &Children, _| Answers {
            first: children.bounds.overlapping(wanted),
            second: 0,
        };
        self.search_where(ask, |leaf, _| {
            visit(leaf);
            true
        });
    }

    /// Calls `visit` with each triangle that answers yes to one of the questions that `ask` asks, as all those above it do,
    /// and with its two answers, until it returns false. Whether it never did. `ask` is told the part of the triangles below
    /// the children, [`NONE`] if they are of several.
    #[inline]
    pub(crate) fn search_where(
        &self,
        ask: impl Fn(&Children, u32) -> Answers,
        mut visit: impl FnMut(&Leaf, [bool; 2]) -> bool,
    ) -> bool {
        if self.nodes.is_empty() {
            return true;
        }
        let mut waiting = [0; WAITING];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let node = &self.nodes[waiting[count] as usize];
            let Answers { first, second } = ask(&node.children, node.part);
            let mut left = (first | second) & ((1 << node.count) - 1);
            while left != 0 {
                let child = left.trailing_zeros() as usize;
                left &= left - 1;
                let place = node.below[child];
                if node.holds_triangles {
                    let answers = [first, second].map(|bits| bits & (1 << child) != 0);
                    if !visit(&self.leaves[place as usize], answers) {
                        return false;
                    }
                } else {
                    waiting[count] = place;
                    count += 1;
                }
            }
        }
        true
    }

    /// The numbers in the order of the leaves.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }
}

/// Two halves of parts, the first lower along the longest axis.
fn halve_parts(parts: &mut [Part]) -> (&mut [Part], &mut [Part]) {
    let all = parts.iter().map(|(_, bounds)| *bounds);
    let axis = all.fold(Box32::EMPTY, Box32::union).longest_axis();
    let half = parts.len() / 2;
    parts.select_nth_unstable_by(half, |(one, i), (other, j)| {
        let (i, j) = (i.center(axis), j.center(axis));
        i.total_cmp(&j).then(one.start.cmp(&other.start))
    });
    parts.split_at_mut(half)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

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

    fn overlap(one: &Box32, other: &Box32) -> bool {
        (0..3).all(|k| one.low[k] <= other.high[k] && other.low[k] <= one.high[k])
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
            (200, 200),
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
                        .filter(|&i| overlap(&now[i as usize], &wanted))
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
            let search = |limit: f32| {
                let (mut found, asked) = (Vec::new(), Cell::new(0));
                let ask = |children: &Children, _| {
                    asked.set(asked.get() + 1);
                    let faces = children.normals.low(0).cmplt(Vec4::splat(limit));
                    Answers {
                        first: faces.bitmask() & children.bounds.overlapping(&wanted),
                        second: 0,
                    }
                };
                tree.search_where(ask, |leaf, _| {
                    found.push(leaf.number);
                    true
                });
                found.sort_unstable();
                (found, asked.get())
            };
            let (found, asked) = search(-0.5);
            left_out += search(2.0).1 - asked;
            let all = 0..index(count);
            let all = all.filter(|&i| overlap(&now[i as usize], &wanted));
            let expected = all.filter(|&i| normals[i as usize].as_vec3().x < -0.5);
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
        // What is too small for single precision.
        let least = f32::from_bits(1);
        assert_eq!((rounded_down(-1e-300), rounded_up(-1e-300)), (-least, 0.0));
        assert_eq!((rounded_down(1e-300), rounded_up(1e-300)), (0.0, least));
    }
}
