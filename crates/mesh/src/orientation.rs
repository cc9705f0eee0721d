//! The exact orientation of a tetrahedron, and flipping of inverted ones.
//!
//! The sign of a volume computed in floating point is noise once a tet is flat to about 1e-16 of its size, and cutting
//! makes such slivers. The sign is therefore taken from an adaptive-precision predicate. It costs a few more operations
//! than the plain formula and is exact unless products of coordinates overflow or underflow (differences of coordinates
//! between about 1e-90 and 1e90 are safe).
//!
//! Source: J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997,
//! through the crate `robust`.

use glam::DVec3;
use robust::{Coord3D, orient3d};

use crate::{TetId, TetMesh};

/// The exact orientation of a tet: positive, negative, or zero when the four corners lie in one plane.
///
/// The sign is exact; the size approximates six times the volume (in m³). A tet with a coordinate that is not finite
/// has no orientation: the result is then NaN or meaningless.
///
/// # Example
/// ```
/// use incise_mesh::{glam::DVec3, orientation};
///
/// let [a, b, c] = [DVec3::ZERO, DVec3::X, DVec3::Y];
/// assert!(orientation([a, b, c, DVec3::Z]) > 0.0);
/// assert!(orientation([a, c, b, DVec3::Z]) < 0.0);
/// assert_eq!(orientation([a, b, c, b + c]), 0.0);
/// ```
#[must_use]
pub fn orientation([a, b, c, d]: [DVec3; 4]) -> f64 {
    let [a, b, c, d] = [a, b, c, d].map(|p| Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    });
    // The predicate has the opposite sign. Subtracting instead of negating never gives -0.
    0.0 - orient3d(a, b, c, d)
}

impl TetMesh {
    /// Flips every negatively oriented tet by swapping its last two corners; returns their number.
    ///
    /// Flat tets stay as they are. Linear in the number of tets.
    ///
    /// # Panics
    /// If a corner does not exist.
    pub fn orient_positively(&mut self) -> usize {
        let mut flipped = 0;
        for t in 0..self.tets.len() {
            if orientation(self.corners(TetId::new(t))) < 0.0 {
                self.tets[t].swap(2, 3);
                flipped += 1;
            }
        }
        flipped
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::ParticleId;

    #[test]
    fn slivers_keep_their_sign() {
        // One unit in the last place above and below the plane through three generic points.
        let [a, b] = [dvec3(0.1, 0.2, 0.7), dvec3(1.3, 0.4, 0.7)];
        let c = dvec3(0.6, 1.9, 0.7);
        let above = dvec3(0.5, 0.5, 0.7_f64.next_up());
        let below = dvec3(0.5, 0.5, 0.7_f64.next_down());
        assert!(orientation([a, b, c, above]) > 0.0);
        assert!(orientation([a, b, c, below]) < 0.0);
        assert!(orientation([a, b, c, dvec3(0.5, 0.5, 0.7)]) == 0.0);
    }

    #[test]
    fn agrees_under_every_permutation_of_the_corners() {
        let corners = [
            dvec3(0.1, 0.1, 0.1),
            dvec3(0.2, 0.2, 0.2),
            dvec3(0.3, 0.3, 0.3 + 1e-17),
            dvec3(0.7, 0.3, 0.9),
        ];
        let reference = orientation(corners).signum();
        let even = [[1, 2, 0, 3], [1, 0, 3, 2], [3, 2, 1, 0]];
        for order in even {
            assert!(orientation(order.map(|i: usize| corners[i])).signum() == reference);
        }
    }

    #[test]
    fn only_negative_tets_are_flipped() {
        let ids = |tet: [u32; 4]| tet.map(ParticleId);
        let mut mesh = TetMesh {
            positions: vec![
                DVec3::ZERO,
                DVec3::X,
                DVec3::Y,
                DVec3::Z,
                DVec3::X + DVec3::Y,
            ],
            tets: vec![ids([0, 1, 2, 3]), ids([0, 2, 1, 3]), ids([0, 1, 2, 4])],
        };
        assert_eq!(mesh.orient_positively(), 1);
        assert_eq!(
            mesh.tets,
            [ids([0, 1, 2, 3]), ids([0, 2, 3, 1]), ids([0, 1, 2, 4])]
        );
        assert_eq!(mesh.orient_positively(), 0);
    }
}
