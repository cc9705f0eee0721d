//! Lattice on which level sets are sampled, and root finding on its edges.
//!
//! Cubic cells, whose corners and centers together form a body-centered cubic lattice; its tets are congruent and well
//! shaped. Constant time.

use glam::DVec3;

use crate::MeshingError;

/// Largest number of cells: the tables then take about 2 GiB.
const MAX_CELLS: usize = 1 << 26;

/// Cubic cells whose corners and centers are the vertices of a body-centered cubic lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Low corner, in meters.
    pub origin: DVec3,
    /// Side of a cell, in meters.
    pub spacing: f64,
    /// Number of cells along each axis.
    pub cells: [usize; 3],
}

impl Lattice {
    /// Creates the smallest lattice that covers the box from `low` to `high` with a margin of one layer of cells.
    ///
    /// `shift`, in spacings, moves the lattice vertices relative to the box; integers have no effect.
    ///
    /// # Errors
    /// [`MeshingError::Lattice`] if a number is not finite, the spacing is not positive, the box has a low corner above
    /// its high one, or there would be more than 2²⁶ cells.
    pub fn covering(
        low: DVec3,
        high: DVec3,
        spacing: f64,
        shift: DVec3,
    ) -> Result<Self, MeshingError> {
        if !(low.is_finite() && high.is_finite() && shift.is_finite() && low.cmple(high).all()) {
            let message = format!(
                "{low} to {high}, shifted by {shift}, is no box, give finite corners, the low one first"
            );
            return Err(MeshingError::Lattice(message));
        }
        if !(spacing.is_finite() && spacing > 0.0) {
            return Err(MeshingError::Lattice(format!(
                "the spacing {spacing} is not a positive length"
            )));
        }
        let shift = shift - shift.floor();
        let counts = ((high - low) / spacing).ceil() + 4.0;
        let cells = counts.to_array();
        if cells[0] * cells[1] * cells[2] > MAX_CELLS as f64 {
            let message = format!(
                "the spacing {spacing} makes more than {MAX_CELLS} cells, use a larger one"
            );
            return Err(MeshingError::Lattice(message));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, and bounded just above"
        )]
        let cells = cells.map(|count| count as usize);
        Ok(Self {
            origin: low - spacing * (DVec3::ONE + shift),
            spacing,
            cells,
        })
    }

    /// Number of cells; an error beyond the limit.
    pub(super) fn cell_count(&self) -> Result<usize, MeshingError> {
        let [nx, ny, nz] = self.cells;
        nx.checked_mul(ny)
            .and_then(|n| n.checked_mul(nz))
            .filter(|&n| n <= MAX_CELLS)
            .ok_or_else(|| {
                MeshingError::Lattice(format!(
                    "{nx} x {ny} x {nz} cells are more than {MAX_CELLS}, use a larger spacing"
                ))
            })
    }

    /// Number of cells along an axis.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "at most 2^26 cells"
    )]
    pub(super) fn limit(&self, axis: usize) -> i32 {
        self.cells[axis] as i32
    }

    /// Coordinates of a vertex in half spacings. Vertex `2 c` is the low corner of cell `c`, `2 c + 1` its center.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "at most 2^26 cells"
    )]
    pub(super) fn coordinates(&self, vertex: usize) -> [i32; 3] {
        let cell = vertex / 2;
        let [nx, ny, _] = self.cells;
        [cell % nx, cell / nx % ny, cell / nx / ny].map(|c| 2 * c as i32 + (vertex % 2) as i32)
    }

    /// Position of the vertex with these coordinates in half spacings.
    pub(super) fn position(&self, at: [i32; 3]) -> DVec3 {
        self.origin + 0.5 * self.spacing * DVec3::from_array(at.map(f64::from))
    }
}

/// Finds the zero of the function on the edge between an inside and an outside vertex, to about 1e-6 of the values at
/// its ends.
///
/// False position with the Illinois modification: the bracket always contains a change of sign.
pub(super) fn root(ends: [DVec3; 2], values: [f64; 2], distance: &impl Fn(DVec3) -> f64) -> DVec3 {
    let at = |t: f64| ends[0] + t * (ends[1] - ends[0]);
    let [mut low, mut high] = [0.0, 1.0];
    let [mut inside, mut outside] = values;
    let mut t = 0.5;
    for _ in 0..16 {
        t = (low - (high - low) * inside / (outside - inside)).clamp(low, high);
        let value = distance(at(t));
        if value < 0.0 {
            if value > -1e-6 * (outside - inside) {
                break;
            }
            (low, inside) = (t, value);
            outside *= 0.5;
        } else {
            if value < 1e-6 * (outside - inside) {
                break;
            }
            (high, outside) = (t, value);
            inside *= 0.5;
        }
    }
    at(t)
}
