//! Neighbors of a vertex in the body-centered cubic lattice, as coordinate offsets and as index steps.
//!
//! A vertex has six neighbors of its own kind along long edges and eight of the other kind along short ones. A
//! direction is an index into one fixed list of the fourteen. Constant time.

use crate::stencil::{Corner, is_long};

/// Offsets to the neighbors of any vertex in half spacings: 6 along long edges, 8 along short ones.
pub(super) const NEIGHBORS: [[i32; 3]; 14] = [
    [-2, 0, 0],
    [2, 0, 0],
    [0, -2, 0],
    [0, 2, 0],
    [0, 0, -2],
    [0, 0, 2],
    [-1, -1, -1],
    [1, -1, -1],
    [-1, 1, -1],
    [1, 1, -1],
    [-1, -1, 1],
    [1, -1, 1],
    [-1, 1, 1],
    [1, 1, 1],
];

/// Index in [`NEIGHBORS`] of the direction from one vertex to a neighbor.
pub(super) fn direction(from: Corner, to: Corner) -> usize {
    let ahead = |axis: usize| usize::from(to.at[axis] > from.at[axis]);
    if is_long(from, to) {
        let axis = (0..2)
            .find(|&axis| from.at[axis] != to.at[axis])
            .unwrap_or(2);
        2 * axis + ahead(axis)
    } else {
        6 + ahead(0) + 2 * ahead(1) + 4 * ahead(2)
    }
}

/// Index steps to the neighbors of a corner and of a center of a cell, in the order of [`NEIGHBORS`].
#[expect(clippy::cast_possible_wrap, reason = "at most 2^26 cells")]
pub(super) fn steps([nx, ny, _]: [usize; 3]) -> [[isize; 14]; 2] {
    let strides = [1, nx, nx * ny].map(|stride| 2 * stride as isize);
    [0, 1].map(|center| {
        NEIGHBORS.map(|offset| {
            // The cell of a neighbor is half its coordinates, rounded down.
            let cells: isize = (0..3)
                .map(|axis| (offset[axis] + center).div_euclid(2) as isize * strides[axis])
                .sum();
            cells + (offset[0] + center).rem_euclid(2) as isize - center as isize
        })
    })
}

/// Iterates over the set bits.
pub(super) fn directions(bits: u16) -> impl Iterator<Item = usize> {
    (0..NEIGHBORS.len()).filter(move |direction| bits >> direction & 1 == 1)
}

/// Index of the opposite offset in [`NEIGHBORS`].
pub(super) fn backward(direction: usize) -> usize {
    if direction < 6 {
        direction ^ 1
    } else {
        19 - direction
    }
}

pub(super) fn add(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_to_neighbors_fit_together() {
        let steps = steps([7, 5, 9]);
        for way in 0..NEIGHBORS.len() {
            assert_eq!(NEIGHBORS[backward(way)], NEIGHBORS[way].map(|c| -c));
            for parity in [0, 1] {
                let far = if way < 6 { parity } else { 1 - parity };
                assert_eq!(steps[parity][way], -steps[far][backward(way)]);
            }
        }
    }
}
