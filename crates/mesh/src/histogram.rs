//! [`QualityHistograms`]: distribution of the shapes of all tets.
//!
//! Classes have fixed limits, so histograms of different meshes can be compared. Linear in the number of tets.

use crate::quality::{dihedral_angles, tet_quality};
use crate::{TetId, TetMesh};

/// Width of a class of dihedral angles in degrees.
const DEGREES: f64 = 10.0;

/// The number of tets, or of angles of tets, in each class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QualityHistograms {
    /// All six dihedral angles of each tet, in classes of 10 degrees from 0 to 180; a right angle belongs to the class
    /// that begins with it.
    pub dihedral: [usize; 18],
    /// Radius ratios, in classes of a tenth from 0 to 1; those of flat and inverted tets are in the first.
    pub radius_ratio: [usize; 10],
}

impl TetMesh {
    /// Counts the tets in each class of shape.
    ///
    /// # Panics
    /// If a corner does not exist.
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{glam::DVec3, kuhn_box};
    ///
    /// // The tets of a cube have angles of 45, 60 and 90 degrees.
    /// let histograms = kuhn_box([1, 1, 1], DVec3::ONE).histograms();
    /// assert_eq!(histograms.dihedral[9], 18); // 90 to 100
    /// assert_eq!(histograms.dihedral.iter().sum::<usize>(), 36);
    /// ```
    #[must_use]
    pub fn histograms(&self) -> QualityHistograms {
        let mut histograms = QualityHistograms::default();
        for t in 0..self.tets.len() {
            let corners = self.corners(TetId::new(t));
            for angle in dihedral_angles(corners) {
                // Rounding must not put a right angle into the class below.
                histograms.dihedral[class(angle / DEGREES + 1e-9, 18)] += 1;
            }
            let ratio = tet_quality(corners).radius_ratio;
            histograms.radius_ratio[class(ratio * 10.0 + 1e-9, 10)] += 1;
        }
        histograms
    }
}

/// The index of the class of a value in units of class widths, below `classes`; 0 for NaN.
fn class(value: f64, classes: usize) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the cast saturates, and what is not a number becomes 0"
    )]
    let class = value as usize;
    class.min(classes - 1)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{ParticleId, TetMesh, kuhn_box};

    #[test]
    fn histograms_agree_with_the_summary() {
        let mut mesh = kuhn_box([5, 6, 7], DVec3::new(1.0, 0.8, 1.1));
        // A skewed and bent mesh, so that all classes have members.
        for p in &mut mesh.positions {
            *p += DVec3::new(0.7 * p.y * p.y, 0.5 * p.z, 0.9 * p.x * p.y);
        }
        let (histograms, worst) = (mesh.histograms(), mesh.quality());
        assert_eq!(
            histograms.dihedral.iter().sum::<usize>(),
            6 * mesh.tets.len()
        );
        assert_eq!(
            histograms.radius_ratio.iter().sum::<usize>(),
            mesh.tets.len()
        );
        let first = histograms.dihedral.iter().position(|&n| n > 0);
        assert_eq!(first, Some(class(worst.min_dihedral / DEGREES, 18)));
        let last = histograms.dihedral.iter().rposition(|&n| n > 0);
        assert_eq!(last, Some(class(worst.max_dihedral / DEGREES, 18)));
        let first = histograms.radius_ratio.iter().position(|&n| n > 0);
        assert_eq!(first, Some(class(worst.worst_radius_ratio * 10.0, 10)));
    }

    #[test]
    fn degenerate_tets_are_in_the_outermost_classes() {
        let mesh = TetMesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)],
            tets: vec![[0, 1, 2, 3].map(ParticleId), [0, 0, 0, 0].map(ParticleId)],
        };
        let histograms = mesh.histograms();
        assert_eq!(histograms.radius_ratio[0], 2);
        assert_eq!(histograms.dihedral.iter().sum::<usize>(), 12);
    }
}
