//! [`Dihedrals`]: the range of dihedral angles over many tets.
//!
//! Cosines are compared and turned into angles only once at the end. Cost: four cross products and roots a tet.

use glam::DVec3;

/// The extreme cosines so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dihedrals {
    least: f64,
    most: f64,
}

impl Default for Dihedrals {
    fn default() -> Self {
        Self {
            least: f64::INFINITY,
            most: f64::NEG_INFINITY,
        }
    }
}

impl Dihedrals {
    /// Adds the angles of a tet. One so flat that a normal has no direction counts as one with all angles.
    pub(crate) fn add(&mut self, [a, b, c, d]: [DVec3; 4]) {
        let (u, v, w) = (b - a, c - a, d - a);
        let normals = [(v - u).cross(w - u), w.cross(v), u.cross(w), v.cross(u)];
        let [one, two, three, four] = normals.map(|n| n.normalize_or_zero());
        for (n, m) in [
            (one, two),
            (one, three),
            (one, four),
            (two, three),
            (two, four),
            (three, four),
        ] {
            let cosine = if n == DVec3::ZERO || m == DVec3::ZERO {
                f64::NAN
            } else {
                -n.dot(m)
            };
            if cosine.is_nan() {
                (self.least, self.most) = (-1.0, 1.0);
            } else {
                self.least = self.least.min(cosine);
                self.most = self.most.max(cosine);
            }
        }
    }

    /// The smallest and the largest angle in degrees, if a tet was added.
    pub(crate) fn range(self) -> Option<[f64; 2]> {
        let angle = |cosine: f64| cosine.clamp(-1.0, 1.0).acos().to_degrees();
        (self.least <= self.most).then(|| [angle(self.most), angle(self.least)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_known_tets() {
        assert_eq!(Dihedrals::default().range(), None);
        let mut dihedrals = Dihedrals::default();
        // A corner of a cube: three right angles and three of acos(1/√3).
        dihedrals.add([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        let [least, most] = dihedrals.range().unwrap();
        assert!((least - (1.0 / 3.0_f64.sqrt()).acos().to_degrees()).abs() < 1e-12);
        assert!((most - 90.0).abs() < 1e-12);
        dihedrals.add([DVec3::ZERO; 4]);
        assert_eq!(dihedrals.range(), Some([0.0, 180.0]));
    }
}
