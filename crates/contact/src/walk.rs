//! The way through a body: from tet to tet along a segment.
//!
//! A step leaves a tet by the face that the segment crosses first and goes on in the tet behind that face; where it
//! passes through an edge or a corner, all faces there are tried. Where there is no tet behind, the segment leaves the
//! body. Two sides of a cut are no neighbors, so no way leads across it: this is what
//! tells a true contact from one through a body's own wall.
//! Source: H. Chen, E. Diaz, C. Yuksel 2023, Shortest Path to Boundary for Self-Intersecting Meshes (the test that a
//! straight path is valid). Cost: four volumes a step.

use glam::DVec3;
use incise_cutting::CuttableMesh;
use incise_mesh::TetId;

/// Tets after which a walk gives up. Walks are as long as a depth, a few tets.
const MAX_TETS: usize = 128;
/// Crossings of a segment that differ by this fraction of its length are one.
const SAME: f64 = 1e-6;
/// A point counts as inside a tet if no barycentric coordinate is below minus this.
const INSIDE: f64 = 1e-9;

/// The barycentric coordinates of points in a tet.
pub(crate) struct Barycentric {
    origin: DVec3,
    rows: [DVec3; 3],
}

impl Barycentric {
    /// `None` for a tet that is flat or inverted.
    #[inline]
    pub(crate) fn new([a, b, c, d]: [DVec3; 4]) -> Option<Self> {
        let (ab, ac, ad) = (b - a, c - a, d - a);
        let across = ac.cross(ad);
        let volume = ab.dot(across);
        let scale = 1.0 / volume;
        (volume > 0.0 && scale.is_finite()).then(|| Self {
            origin: a,
            rows: [across * scale, ad.cross(ab) * scale, ab.cross(ac) * scale],
        })
    }

    /// Whether a tet has coordinates.
    #[inline]
    pub(crate) fn exist([a, b, c, d]: [DVec3; 4]) -> bool {
        let volume = (b - a).dot((c - a).cross(d - a));
        volume > 0.0 && (1.0 / volume).is_finite()
    }

    #[inline]
    pub(crate) fn of(&self, x: DVec3) -> [f64; 4] {
        let [b, c, d] = self.rows.map(|row| row.dot(x - self.origin));
        [1.0 - b - c - d, b, c, d]
    }
}

/// The tet that contains the end of a segment that starts in or on `tet`, if all of the segment lies in the body.
///
/// `None` if the segment leaves the body or passes through a flat or inverted tet.
pub(crate) fn walk(
    mesh: &CuttableMesh,
    positions: &[DVec3],
    tet: TetId,
    [from, to]: [DVec3; 2],
) -> Option<TetId> {
    let mut seen = [tet; MAX_TETS];
    // The place of a tet in `seen` and where on the segment it is entered.
    let mut due = [(0, 0.0); MAX_TETS];
    let (mut known, mut waiting) = (1, 1);
    while waiting > 0 {
        waiting -= 1;
        let (place, entered) = due[waiting];
        let tet = seen[place];
        let corners = mesh.mesh().tets[tet.index()].map(|p| positions[p.index()]);
        let Some(barycentric) = Barycentric::new(corners) else {
            continue;
        };
        let (start, end) = (barycentric.of(from), barycentric.of(to));
        let crossing = [0, 1, 2, 3].map(|k| {
            let inside = start[k].max(0.0);
            let is_crossed = end[k] < -INSIDE;
            if is_crossed {
                inside / (inside - end[k])
            } else {
                f64::INFINITY
            }
        });
        let left = crossing.into_iter().fold(f64::INFINITY, f64::min);
        if left == f64::INFINITY {
            return Some(tet);
        }
        if left < entered - SAME {
            // The segment touches this tet only where it was entered.
            continue;
        }
        // Through an edge or a corner, the segment leaves by any of several faces.
        for (k, neighbor) in mesh.neighbors(tet).into_iter().enumerate() {
            let Some(neighbor) = neighbor.filter(|_| crossing[k] <= left + SAME) else {
                continue;
            };
            if known < MAX_TETS && !seen[..known].contains(&neighbor) {
                seen[known] = neighbor;
                due[waiting] = (known, left);
                known += 1;
                waiting += 1;
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use incise_mesh::{TetMesh, kuhn_box};

    use super::*;

    fn contains(mesh: &TetMesh, tet: TetId, x: DVec3) -> bool {
        let barycentric = Barycentric::new(mesh.corners(tet)).unwrap();
        barycentric.of(x).iter().all(|b| *b >= -1e-7)
    }

    /// In a convex body each straight way is valid and ends where the point is.
    #[test]
    fn ways_in_a_box() {
        let body = CuttableMesh::new(kuhn_box([4; 3], DVec3::ONE)).unwrap();
        let (mesh, positions) = (body.mesh(), &body.mesh().positions);
        let tets = mesh.tets.len();
        let mut ways = 0;
        for from in (0..tets).step_by(17).map(TetId::new) {
            for to in (0..tets).step_by(13).map(TetId::new) {
                let center = |tet| mesh.corners(tet).iter().sum::<DVec3>() / 4.0;
                // Through corners and along edges, too.
                for end in [center(to), mesh.corners(to)[1]] {
                    for start in [center(from), mesh.corners(from)[2]] {
                        let found = walk(&body, positions, from, [start, end]);
                        assert!(contains(mesh, found.unwrap(), end));
                        ways += 1;
                    }
                }
            }
        }
        assert!(ways > 1000);
    }

    #[test]
    fn a_way_out_of_the_body_is_none() {
        let body = CuttableMesh::new(kuhn_box([4; 3], DVec3::ONE)).unwrap();
        let positions = &body.mesh().positions;
        for tet in (0..body.mesh().tets.len()).map(TetId::new) {
            let center = body.mesh().corners(tet).iter().sum::<DVec3>() / 4.0;
            let outside = center + DVec3::new(0.3, 0.1, 1.0);
            assert_eq!(walk(&body, positions, tet, [center, outside]), None);
        }
    }

    #[test]
    fn a_flat_tet_ends_the_way() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.3, 0.3, 0.0)];
        assert!(Barycentric::new(corners).is_none() && !Barycentric::exist(corners));
        let [a, b, c, d] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        assert!(Barycentric::new([a, c, b, d]).is_none());
        assert!(!Barycentric::exist([a, c, b, d]) && Barycentric::exist([a, b, c, d]));
        let barycentric = Barycentric::new([a, b, c, d]).unwrap();
        assert_eq!(
            barycentric.of(DVec3::new(0.25, 0.5, 0.125)),
            [0.125, 0.25, 0.5, 0.125]
        );
    }
}
