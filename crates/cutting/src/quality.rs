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

/// The smallest sine of a dihedral angle of a tet; negative if it is inverted, not a number or 0 if it is flat.
pub(crate) fn least_sine([a, b, c, d]: [DVec3; 4]) -> f64 {
    let (u, v, w) = (b - a, c - a, d - a);
    let determinant = u.cross(v).dot(w);
    // Twice the areas of the faces opposite to each corner.
    let areas = [(v - u).cross(w - u), w.cross(v), u.cross(w), v.cross(u)].map(DVec3::length);
    // The edge between the corners i and j lies on the faces opposite to the other two.
    let sine =
        |edge: DVec3, i: usize, j: usize| determinant * edge.length() / (areas[i] * areas[j]);
    let sines = [
        sine(u, 2, 3),
        sine(v, 1, 3),
        sine(w, 1, 2),
        sine(v - u, 0, 3),
        sine(w - u, 0, 2),
        sine(w - v, 0, 1),
    ];
    let least = sines.into_iter().min_by(f64::total_cmp);
    least.unwrap_or(f64::NAN)
}

/// How many units of the last digit of its coordinates a tet must be thick.
const THICKNESS: f64 = 8.0;

/// Whether rounding may hide the volume of a tet: it is thinner than some units of the last digit of its coordinates,
/// or inverted.
pub(crate) fn is_thin(corners: [DVec3; 4]) -> bool {
    let [a, b, c, d] = corners;
    let edges = [b - a, c - a, d - a];
    let longest = edges.into_iter().map(DVec3::length_squared);
    let longest = longest.fold(0.0, f64::max);
    let far = corners.into_iter().map(|x| x.abs().max_element());
    let far = far.fold(0.0, f64::max);
    let determinant = edges[0].cross(edges[1]).dot(edges[2]);
    let is_thick = determinant > THICKNESS * f64::EPSILON * far * longest;
    !is_thick
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thin_is_what_the_last_digit_hides() {
        for size in [1e-9, 1.0, 1e9] {
            let tet = |height: f64| [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z * height];
            let is_thin = |height| is_thin(tet(height).map(|x| x * size));
            assert!(!is_thin(1.0) && !is_thin(1e-14));
            assert!(is_thin(1e-15) && is_thin(0.0) && is_thin(-1.0));
        }
        // Ten units away the last digit is ten times as large.
        let away = |height: f64| {
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z * height].map(|x| x + DVec3::X * 10.0)
        };
        assert!(is_thin(away(1e-14)) && !is_thin(away(1e-13)));
    }

    #[test]
    fn sines_agree_with_the_angles() {
        let tets = [
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.3, 0.2, 0.05)],
            [
                DVec3::ZERO,
                DVec3::X,
                DVec3::new(0.5, 2.0, 0.1),
                DVec3::new(0.5, 0.9, 0.4),
            ],
        ];
        for tet in tets {
            let mut dihedrals = Dihedrals::default();
            dihedrals.add(tet);
            let sines = dihedrals
                .range()
                .unwrap()
                .map(|angle| angle.to_radians().sin());
            assert!((least_sine(tet) - sines[0].min(sines[1])).abs() < 1e-12);
            let [a, b, c, d] = tet;
            assert!(least_sine([b, a, c, d]) < 0.0);
        }
    }

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
