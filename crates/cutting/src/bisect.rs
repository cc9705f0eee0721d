//! Ordered bisection: splits a tet at any subset of its edges.
//!
//! One operation replaces the table of cases: the flagged edges are taken in one global order, and every piece that
//! still holds both ends of an edge is halved at the edge's new particle. Two tets that share a face see the same
//! flagged edges of that face in the same order and so triangulate it alike: the result conforms without any
//! negotiation. A halved positive tet gives two positive ones, so orientation needs no test.
//!
//! Three edges at one corner give the paper's 4 tets, a ring of four its 6 (section 4.3, figure 2; the paper prints
//! `BB₁C₁C` where `BB₁CD` is meant). All 64 subsets give at most 8. Cost: constant.

use incise_mesh::ParticleId;

use crate::faces::INNER;

/// An edge that is to be split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SplitEdge {
    /// The two ends.
    pub ends: [ParticleId; 2],
    /// The particle on the edge.
    pub point: ParticleId,
}

/// Splits the tet `corners` at `edges`, in their order, and writes the children to `children`.
///
/// The order must be the same for every tet of an operation; [`crate::CuttableMesh`] takes the longest edge at rest
/// first. Edges that are not edges of the tet are ignored. With no edge the only child is the tet itself.
///
/// ```
/// use incise_cutting::{SplitEdge, split_tet};
/// use incise_mesh::ParticleId as P;
///
/// // Three edges at corner 0: the tip and a prism of three.
/// let edges = [1, 2, 3].map(|b| SplitEdge { ends: [P(0), P(b)], point: P(3 + b) });
/// let mut children = Vec::new();
/// split_tet([P(0), P(1), P(2), P(3)], &edges, &mut children);
/// assert_eq!(children.len(), 4);
/// ```
pub fn split_tet(
    corners: [ParticleId; 4],
    edges: &[SplitEdge],
    children: &mut Vec<[ParticleId; 4]>,
) {
    let mut family = Vec::new();
    split_linked((corners, [INNER; 4]), edges, &mut family);
    children.clear();
    children.extend(family.into_iter().map(|(corners, _)| corners));
}

/// Splits a tet with a link for each of its faces, by opposite corner, at `edges` in the order given, and writes the
/// children with their links to `children`. A part of a face gets the link of the whole, faces between children get
/// [`INNER`].
pub(crate) fn split_linked(
    tet: ([ParticleId; 4], [u32; 4]),
    edges: &[SplitEdge],
    children: &mut Vec<([ParticleId; 4], [u32; 4])>,
) {
    children.clear();
    children.push(tet);
    for edge in edges {
        for i in 0..children.len() {
            let (child, links) = children[i];
            let at = |end| child.iter().position(|&corner| corner == end);
            if let (Some(a), Some(b)) = (at(edge.ends[0]), at(edge.ends[1])) {
                // The half that keeps `a` has the new face where `a` looks, the other one where `b` looks.
                let (mut one, mut other) = ((child, links), (child, links));
                (one.0[b], one.1[a]) = (edge.point, INNER);
                (other.0[a], other.1[b]) = (edge.point, INNER);
                children[i] = one;
                children.push(other);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use glam::DVec3;
    use incise_mesh::signed_volume;

    const EDGES: [[u32; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

    /// Every order of the numbers below `n`, by Heap's method.
    fn orders(n: usize) -> Vec<Vec<usize>> {
        fn go(k: usize, items: &mut Vec<usize>, out: &mut Vec<Vec<usize>>) {
            if k <= 1 {
                out.push(items.clone());
                return;
            }
            for i in 0..k {
                go(k - 1, items, out);
                items.swap(if k.is_multiple_of(2) { i } else { 0 }, k - 1);
            }
        }
        let mut out = Vec::new();
        go(n, &mut (0..n).collect(), &mut out);
        out
    }

    /// All 64 patterns in all orders: volume kept, no child flat or inverted, counts as the research says.
    #[test]
    fn all_patterns_in_all_orders() {
        let corners = [ParticleId(0), ParticleId(1), ParticleId(2), ParticleId(3)];
        let mut positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        for (i, [a, b]) in EDGES.iter().enumerate() {
            let t = 0.3 + 0.07 * f64::from(u32::try_from(i).unwrap());
            positions.push(positions[*a as usize].lerp(positions[*b as usize], t));
        }
        let mut children = Vec::new();
        for pattern in 0_u32..64 {
            let flagged: Vec<SplitEdge> = (0..6)
                .filter(|e| pattern >> e & 1 == 1)
                .map(|e| SplitEdge {
                    ends: EDGES[e].map(ParticleId),
                    point: ParticleId::new(4 + e),
                })
                .collect();
            for order in orders(flagged.len()) {
                let edges: Vec<SplitEdge> = order.iter().map(|&i| flagged[i]).collect();
                split_tet(corners, &edges, &mut children);
                let volumes: Vec<f64> = children
                    .iter()
                    .map(|c| signed_volume(c.map(|p| positions[p.index()])))
                    .collect();
                assert!(
                    volumes.iter().all(|&v| v > 1e-4),
                    "pattern {pattern:06b}: {volumes:?}"
                );
                assert!((volumes.iter().sum::<f64>() - 1.0 / 6.0).abs() < 1e-15);
                let expected = match flagged.len() {
                    0 => 1..=1,
                    1 => 2..=2,
                    2 => 3..=4,
                    3 => 4..=5,
                    4 => 5..=6,
                    5 => 6..=7,
                    _ => 8..=8,
                };
                assert!(
                    expected.contains(&children.len()),
                    "pattern {pattern:06b}: {}",
                    children.len()
                );
            }
        }
    }

    /// A ring of four crossed edges gives the paper's six tets whatever the order.
    #[test]
    fn ring_of_four_gives_six() {
        let ring = [[0, 1], [0, 2], [1, 3], [2, 3]];
        for order in orders(4) {
            let edges: Vec<SplitEdge> = order
                .iter()
                .map(|&i| SplitEdge {
                    ends: ring[i].map(ParticleId),
                    point: ParticleId::new(4 + i),
                })
                .collect();
            let mut children = Vec::new();
            split_tet(
                [ParticleId(0), ParticleId(1), ParticleId(2), ParticleId(3)],
                &edges,
                &mut children,
            );
            assert_eq!(children.len(), 6);
        }
    }

    /// All 81 ways in which a surface can pass the corners, generated and counted by class: corners on the positive
    /// side, on the negative side, on the surface -> patterns, crossed edges, children. Every child lies on one side.
    #[test]
    fn table_of_signs() {
        let mut table = BTreeMap::new();
        for pattern in 0..81_u32 {
            let sign = [1, 3, 9, 27].map(|place| i32::try_from(pattern / place % 3).unwrap() - 1);
            let count = |s: i32| sign.iter().filter(|t| **t == s).count();
            let crossed: Vec<SplitEdge> = (0..6)
                .filter(|&e| {
                    let [a, b] = EDGES[e].map(|p| sign[p as usize]);
                    a * b < 0
                })
                .map(|e| SplitEdge {
                    ends: EDGES[e].map(ParticleId),
                    point: ParticleId::new(4 + e),
                })
                .collect();
            let mut children = Vec::new();
            split_tet([0, 1, 2, 3].map(ParticleId), &crossed, &mut children);
            for child in &children {
                let sides = child.map(|p| sign.get(p.index()).copied().unwrap_or(0));
                assert!(
                    !(sides.contains(&1) && sides.contains(&-1)),
                    "pattern {sign:?}: child {child:?} is on both sides"
                );
            }
            let class = (count(1), count(-1), count(0));
            let entry = table
                .entry(class)
                .or_insert((0, crossed.len(), children.len()));
            assert_eq!((entry.1, entry.2), (crossed.len(), children.len()));
            entry.0 += 1;
        }
        let mut expected = BTreeMap::new();
        for (class, patterns, crossed, children) in [
            ([4, 0, 0], 1, 0, 1),
            ([3, 0, 1], 4, 0, 1),
            ([2, 0, 2], 6, 0, 1),
            ([1, 0, 3], 4, 0, 1),
            ([0, 0, 4], 1, 0, 1),
            ([1, 1, 2], 12, 1, 2),
            ([2, 1, 1], 12, 2, 3),
            ([3, 1, 0], 4, 3, 4),
            ([2, 2, 0], 6, 4, 6),
        ] {
            let [p, m, z] = class;
            expected.insert((p, m, z), (patterns, crossed, children));
            expected.insert((m, p, z), (patterns, crossed, children));
        }
        assert_eq!(table, expected);
        assert_eq!(table.values().map(|entry| entry.0).sum::<u32>(), 81);
        assert_eq!(table.len(), 15);
    }
}
