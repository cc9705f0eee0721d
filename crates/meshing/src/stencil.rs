//! Stencils of isosurface stuffing for one lattice tet, with the rules for the diagonals.
//!
//! A lattice tet has corners inside (+), outside (-) or on the surface (0), and a cut point on each edge from + to -.
//! Its inside part is a tet, a pyramid or a prism. Where a face with two + corners loses its - corner, the remaining
//! quadrilateral is shared by two lattice tets; both must choose one diagonal, and the choice determines the dihedral
//! angles. Each quadrilateral is the rest of a triangle with one long and two short edges:
//!
//! - the long edge is cut: the diagonal runs from the cut of the long edge to the inside end of the short one;
//! - both short edges are cut: the *parity rule*. The ends of the long edge differ in one of the signs of their offset
//!   from the lost corner, so exactly one of them exceeds it in an even number of coordinates. The diagonal starts
//!   there.
//!
//! In the prism with two + and two - corners the two shared diagonals then always have different ends, and only one
//! diagonal of the third quadrilateral, which lies on the surface, makes three tets possible.
//!
//! With moved vertices and cuts at their extremes, all angles lie between 9.3 and 161.7 degrees (a test enumerates
//! them). The paper states 10.7 to 164.8 degrees for equal fractions of edges. No choice of diagonals reaches that
//! here: three moved vertices and an inside one make a single tet, without a diagonal, that can have 9.3 degrees (a
//! test builds it). The opposite choice in the first rule gives 7.2 degrees.
//!
//! Source: F. Labelle and J. R. Shewchuk, "Isosurface Stuffing: Fast Tetrahedral Meshes with Good Dihedral Angles",
//! 2007. Constant time per tet.

/// Side of the surface on which a lattice vertex lies.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Side {
    Inside,
    Surface,
    Outside,
}

/// A corner of a lattice tet. Coordinates are in half spacings: all even for cube corners, all odd for cube centers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) vertex: usize,
    pub(super) at: [i32; 3],
    pub(super) side: Side,
}

/// A corner of an output tet: a lattice vertex, or the cut point between an inside and an outside one.
#[derive(Clone, Copy, Debug)]
pub(super) enum Node {
    Vertex(Corner),
    Cut(Corner, Corner),
}

/// True if two vertices of one lattice tet are joined by a long edge: both cube corners or both cube centers.
pub(super) fn is_long(a: Corner, b: Corner) -> bool {
    (a.at[0] ^ b.at[0]) & 1 == 0
}

/// True if the quadrilateral left of the face `p`, `q` (inside), `m` (outside) has its diagonal at `p`, not at `q`.
fn diagonal_at_first(p: Corner, q: Corner, m: Corner) -> bool {
    if is_long(p, q) {
        (0..3).filter(|&axis| p.at[axis] > m.at[axis]).count() % 2 == 0
    } else {
        is_long(q, m)
    }
}

/// Calls `emit` for each output tet of a lattice tet, with corners in no particular orientation.
pub(super) fn fill(tet: [Corner; 4], mut emit: impl FnMut([Node; 4])) {
    use Node::{Cut, Vertex};
    let select = |side| {
        let mut found = [tet[0]; 4];
        let mut count = 0;
        for corner in tet.into_iter().filter(|corner| corner.side == side) {
            found[count] = corner;
            count += 1;
        }
        (found, count)
    };
    let (inside, insides) = select(Side::Inside);
    let (outside, outsides) = select(Side::Outside);
    let (surface, _) = select(Side::Surface);

    match (insides, outsides) {
        (0, _) => {}
        (_, 0) => emit(tet.map(Vertex)),
        (1, _) => {
            let p = inside[0];
            emit(tet.map(|c| {
                if c.side == Side::Outside {
                    Cut(p, c)
                } else {
                    Vertex(c)
                }
            }));
        }
        (2, 1) => {
            // A pyramid over the quadrilateral, with the surface vertex on top.
            let (m, top) = (outside[0], Vertex(surface[0]));
            let (p, q) = diagonal_first(inside[0], inside[1], m);
            emit([Vertex(p), Vertex(q), Cut(q, m), top]);
            emit([Vertex(p), Cut(q, m), Cut(p, m), top]);
        }
        (2, _) => {
            let (m, n) = (outside[0], outside[1]);
            let (p, q) = diagonal_first(inside[0], inside[1], m);
            debug_assert!(
                diagonal_at_first(q, p, n),
                "the shared diagonals have different ends"
            );
            emit([Vertex(p), Cut(p, m), Cut(p, n), Cut(q, m)]);
            emit([Vertex(p), Vertex(q), Cut(p, n), Cut(q, m)]);
            emit([Vertex(q), Cut(q, m), Cut(q, n), Cut(p, n)]);
        }
        (_, _) => {
            // One inside corner, `r`, is joined to the outside one by the long edge. Two diagonals end at its cut.
            let m = outside[0];
            let [p, q, r] = match [0, 1, 2].map(|i| is_long(inside[i], m)) {
                [true, _, _] => [inside[1], inside[2], inside[0]],
                [_, true, _] => [inside[0], inside[2], inside[1]],
                _ => [inside[0], inside[1], inside[2]],
            };
            let (p, q) = diagonal_first(p, q, m);
            emit([Vertex(p), Vertex(q), Vertex(r), Cut(r, m)]);
            emit([Vertex(p), Vertex(q), Cut(q, m), Cut(r, m)]);
            emit([Vertex(p), Cut(q, m), Cut(p, m), Cut(r, m)]);
        }
    }
}

/// Inside corners of a quadrilateral, the one with the diagonal first.
fn diagonal_first(p: Corner, q: Corner, m: Corner) -> (Corner, Corner) {
    if diagonal_at_first(p, q, m) {
        (p, q)
    } else {
        (q, p)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::stuffing::{ALPHA_LONG, ALPHA_SHORT};
    use incise_mesh::{signed_volume, tet_quality};

    const LATTICE_TET: [[i32; 3]; 4] = [[0, 0, 0], [2, 0, 0], [1, -1, -1], [1, -1, 1]];

    /// Positions of a surface vertex: in place, or moved along each of its 14 edges by the largest fraction.
    fn moves() -> Vec<DVec3> {
        let mut moves = vec![DVec3::ZERO];
        moves.extend(
            DVec3::AXES
                .iter()
                .flat_map(|&axis| [-2.0 * ALPHA_LONG * axis, 2.0 * ALPHA_LONG * axis]),
        );
        for octant in 0..8 {
            let sign = |bit: i32| {
                if octant >> bit & 1 == 0 {
                    -ALPHA_SHORT
                } else {
                    ALPHA_SHORT
                }
            };
            moves.push(DVec3::new(sign(0), sign(1), sign(2)));
        }
        moves
    }

    /// Angles of all output tets with the cuts at their extreme positions, in all combinations.
    fn angles(tets: &[[Node; 4]], positions: [DVec3; 4]) -> (f64, f64) {
        const EDGE: [[usize; 4]; 4] = [[0, 0, 1, 2], [0, 0, 3, 4], [1, 3, 0, 5], [2, 4, 5, 0]];
        let mut angles = (180.0_f64, 0.0_f64);
        for choice in 0..64 {
            for nodes in tets {
                let corners = nodes.map(|node| match node {
                    Node::Vertex(v) => positions[v.vertex],
                    Node::Cut(a, b) => {
                        let alpha = if is_long(a, b) {
                            ALPHA_LONG
                        } else {
                            ALPHA_SHORT
                        };
                        let far = choice >> EDGE[a.vertex][b.vertex] & 1 == 1;
                        positions[a.vertex]
                            .lerp(positions[b.vertex], if far { 1.0 - alpha } else { alpha })
                    }
                });
                assert!(signed_volume(corners).abs() > 1e-3);
                let quality = tet_quality(if signed_volume(corners) < 0.0 {
                    [corners[0], corners[1], corners[3], corners[2]]
                } else {
                    corners
                });
                angles = (
                    angles.0.min(quality.min_dihedral),
                    angles.1.max(quality.max_dihedral),
                );
            }
        }
        angles
    }

    /// Edge among `moves` that a vertex moved along, in half spacings; zero if it did not move.
    fn edge_of(the_move: DVec3) -> DVec3 {
        let part = if the_move.abs().max_element() == the_move.abs().element_sum() {
            ALPHA_LONG
        } else {
            ALPHA_SHORT
        };
        (the_move / part).round()
    }

    /// True if two vertices move toward each other along one edge. This is impossible: the first move removes the cut.
    fn meet(moved: &[(usize, DVec3)]) -> bool {
        moved.iter().any(|&(i, along)| {
            moved.iter().any(|&(j, back)| {
                let [from, to] = [i, j].map(|v| DVec3::from_array(LATTICE_TET[v].map(f64::from)));
                i != j && edge_of(along) == to - from && edge_of(back) == from - to
            })
        })
    }

    /// Vertex 2 is outside, 3 inside. The cut toward 0 takes vertex 2 there; 0 and 1 then move to cuts on edges that
    /// lead away, to outside neighbors.
    #[test]
    fn a_tet_without_diagonals_is_below_the_bound_of_the_paper() {
        let corner = |v: usize, octant: [f64; 3]| {
            DVec3::from_array(LATTICE_TET[v].map(f64::from))
                + ALPHA_SHORT * DVec3::from_array(octant)
        };
        let corners = [
            corner(0, [-1.0, -1.0, -1.0]),
            corner(1, [1.0, -1.0, -1.0]),
            corner(2, [-1.0, 1.0, 1.0]),
            corner(3, [0.0; 3]),
        ];
        let smallest = tet_quality(corners).min_dihedral;
        assert!((9.3..9.4).contains(&smallest), "{smallest}");
    }

    #[test]
    fn angles_are_bounded_at_all_extremes() {
        let moves = moves();
        let mut worst = (180.0_f64, 0.0_f64);
        for pattern in 0..81 {
            let mut corners = LATTICE_TET.map(|at| Corner {
                vertex: 0,
                at,
                side: Side::Inside,
            });
            let mut surface = Vec::new();
            for (i, corner) in corners.iter_mut().enumerate() {
                corner.vertex = i;
                corner.side =
                    [Side::Inside, Side::Surface, Side::Outside][pattern / [1, 3, 9, 27][i] % 3];
                if corner.side == Side::Surface {
                    surface.push(i);
                }
            }
            let mut tets = Vec::new();
            fill(corners, |nodes| tets.push(nodes));
            for combination in 0..[1, 15, 225, 3375, 0][surface.len()] {
                let mut positions = LATTICE_TET.map(|at| DVec3::from_array(at.map(f64::from)));
                let moved: Vec<(usize, DVec3)> = surface
                    .iter()
                    .enumerate()
                    .map(|(place, &v)| (v, moves[combination / [1, 15, 225][place] % 15]))
                    .collect();
                if meet(&moved) {
                    continue;
                }
                for &(vertex, the_move) in &moved {
                    positions[vertex] += the_move;
                }
                let angles = angles(&tets, positions);
                worst = (worst.0.min(angles.0), worst.1.max(angles.1));
            }
        }
        assert!(worst.0 > 9.3 && worst.1 < 161.7, "{worst:?}");
    }
}
