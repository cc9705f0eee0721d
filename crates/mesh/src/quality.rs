//! Shape measures of tets: altitudes, dihedral angles, radius ratio.
//!
//! The altitude bounds the stable step of explicit methods and the conditioning of the rest shape; extreme dihedral
//! angles cause interpolation and conditioning errors; the radius ratio combines both in one number. Formulas after
//! J. R. Shewchuk, "What Is a Good Linear Finite Element?", 2002. Angles use `atan2`, whose last bit may differ between
//! platforms. Linear in the number of tets.

use glam::DVec3;

use crate::{TetId, TetMesh, signed_volume};

/// The shape of one tet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TetQuality {
    /// The smallest distance of a corner from the opposite face, in meters; negative for an inverted tet.
    pub min_altitude: f64,
    /// The smallest dihedral angle in degrees.
    pub min_dihedral: f64,
    /// The largest dihedral angle in degrees.
    pub max_dihedral: f64,
    /// Three times the inscribed over the circumscribed radius: 1 for the regular tet, 0 for a flat one, negative for
    /// an inverted one.
    pub radius_ratio: f64,
}

/// The worst values over all tets, and the largest number of tets at a particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QualitySummary {
    /// The smallest altitude in meters; infinite for a mesh without tets.
    pub min_altitude: f64,
    /// The smallest dihedral angle in degrees; infinite for a mesh without tets.
    pub min_dihedral: f64,
    /// The largest dihedral angle in degrees; 0 for a mesh without tets.
    pub max_dihedral: f64,
    /// The smallest radius ratio; infinite for a mesh without tets.
    pub worst_radius_ratio: f64,
    /// The largest number of tets at one particle.
    pub max_tets_at_particle: usize,
}

/// Measures one tet; `corners` in meters. A tet with coincident corners has ratios and angles of 0 or NaN.
///
/// # Example
/// ```
/// use incise_mesh::{glam::dvec3, tet_quality};
///
/// // The regular tet inscribed in a cube of side 2.
/// let corners = [dvec3(1., 1., 1.), dvec3(-1., 1., -1.), dvec3(1., -1., -1.), dvec3(-1., -1., 1.)];
/// let quality = tet_quality(corners);
/// assert!((quality.radius_ratio - 1.0).abs() < 1e-12);
/// assert!((quality.min_dihedral - 70.528_779_365_509_31).abs() < 1e-9);
/// assert!((quality.min_altitude - 4.0 / 3.0_f64.sqrt()).abs() < 1e-12);
/// ```
#[must_use]
pub fn tet_quality(corners: [DVec3; 4]) -> TetQuality {
    let [a, b, c, d] = corners;
    let volume = signed_volume(corners);
    let areas = outward_normals(corners).map(|n| n.length() / 2.0);
    let largest_area = areas.into_iter().fold(0.0, f64::max);

    let (mut min_angle, mut max_angle) = (f64::INFINITY, 0.0);
    for angle in dihedral_angles(corners) {
        min_angle = angle.min(min_angle);
        max_angle = angle.max(max_angle);
    }

    let inradius = 3.0 * volume / areas.iter().sum::<f64>();
    let [u, v, w] = [b - a, c - a, d - a];
    let circumcenter = (u.length_squared() * v.cross(w)
        + v.length_squared() * w.cross(u)
        + w.length_squared() * u.cross(v))
        / (12.0 * volume);
    TetQuality {
        min_altitude: 3.0 * volume / largest_area,
        min_dihedral: min_angle,
        max_dihedral: max_angle,
        radius_ratio: if volume == 0.0 {
            0.0
        } else {
            3.0 * inradius / circumcenter.length()
        },
    }
}

/// The six dihedral angles of a tet in degrees, 0 to 180; for an inverted tet those of its mirror image.
#[must_use]
pub fn dihedral_angles(corners: [DVec3; 4]) -> [f64; 6] {
    let normals = outward_normals(corners);
    let pairs = [(1, 0), (2, 0), (2, 1), (3, 0), (3, 1), (3, 2)];
    pairs.map(|(i, j)| {
        let (n, m) = (normals[i], normals[j]);
        n.cross(m).length().atan2(-n.dot(m)).to_degrees()
    })
}

/// The outward normals of the faces opposite each corner, with a length of twice the area.
#[must_use]
pub fn outward_normals([a, b, c, d]: [DVec3; 4]) -> [DVec3; 4] {
    [
        (c - b).cross(d - b),
        (d - a).cross(c - a),
        (b - a).cross(d - a),
        (c - a).cross(b - a),
    ]
}

impl TetMesh {
    /// The worst shape measures over all tets.
    ///
    /// # Panics
    /// If a corner does not exist.
    #[must_use]
    pub fn quality(&self) -> QualitySummary {
        let mut worst = QualitySummary {
            min_altitude: f64::INFINITY,
            min_dihedral: f64::INFINITY,
            max_dihedral: 0.0,
            worst_radius_ratio: f64::INFINITY,
            max_tets_at_particle: 0,
        };
        let mut uses = vec![0_usize; self.positions.len()];
        for t in 0..self.tets.len() {
            let quality = tet_quality(self.corners(TetId::new(t)));
            worst.min_altitude = worst.min_altitude.min(quality.min_altitude);
            worst.min_dihedral = worst.min_dihedral.min(quality.min_dihedral);
            worst.max_dihedral = worst.max_dihedral.max(quality.max_dihedral);
            worst.worst_radius_ratio = worst.worst_radius_ratio.min(quality.radius_ratio);
            for corner in self.tets[t] {
                uses[corner.index()] += 1;
            }
        }
        worst.max_tets_at_particle = uses.into_iter().max().unwrap_or(0);
        worst
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    #[test]
    fn corner_of_a_cube() {
        let quality = tet_quality([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        assert!((quality.max_dihedral - 90.0).abs() < 1e-12);
        assert!((quality.min_dihedral - 2.0_f64.sqrt().atan().to_degrees()).abs() < 1e-12);
        assert!((quality.min_altitude - (1.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        // r = 1 / (3 + sqrt 3), R = sqrt(3) / 2.
        let expected = 3.0 / (3.0 + 3.0_f64.sqrt()) / (3.0_f64.sqrt() / 2.0);
        assert!((quality.radius_ratio - expected).abs() < 1e-15);
    }

    #[test]
    fn flat_and_inverted_tets() {
        let flat = tet_quality([DVec3::ZERO, DVec3::X, DVec3::Y, dvec3(1.0, 1.0, 0.0)]);
        assert!(flat.min_altitude == 0.0 && flat.radius_ratio == 0.0);
        assert!((flat.max_dihedral - 180.0).abs() < 1e-12);
        let inverted = tet_quality([DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::Z]);
        assert!(inverted.min_altitude < 0.0 && inverted.radius_ratio < 0.0);
    }
}
