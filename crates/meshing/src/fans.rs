//! Test bodies with known properties: tets around one edge, tets around one particle, and copies of any mesh side by
//! side.
//!
//! Results for the graph of tets that share a particle, for pieces, and for tets per particle can be checked exactly
//! against these. Their coordinates are exact or rounded once; their tets have positive volume, but may be very thin.
//! Linear in the number of tets.

use glam::{DVec3, dvec3};
use incise_mesh::{ParticleId, TetMesh};

/// Creates a closed ring of `tets` tets around one common edge, from the particle 0 to the particle 1.
///
/// Any two tets share the edge: the graph of tets with a common particle is complete, with `tets` colors needed and
/// `tets - 1` neighbors each. The particles 0 and 1 have `tets` tets, all others two. One piece by faces; the surface
/// is a double pyramid. The edge is 1 m long, on the z axis around the origin; the ring has the radius 1 m.
///
/// # Panics
/// For fewer than three tets, which cannot close the ring.
///
/// # Example
/// ```
/// use incise_meshing::fan;
///
/// let mesh = fan(50);
/// mesh.check()?;
/// assert_eq!((mesh.tets.len(), mesh.positions.len()), (50, 52));
/// assert_eq!(mesh.quality().max_tets_at_particle, 50);
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
#[must_use]
pub fn fan(tets: usize) -> TetMesh {
    assert!(tets >= 3, "{tets} tets cannot surround an edge, take three");
    let mut positions = vec![dvec3(0.0, 0.0, -0.5), dvec3(0.0, 0.0, 0.5)];
    positions.extend((0..tets).map(|k| {
        // Along the square with its corners on the axes, then projected onto the circle.
        let (quarter, part) = (4 * k / tets, (4 * k % tets) as f64 / tets as f64);
        let [u, v] = [1.0 - part, part];
        let [x, y] = [[u, v], [-v, u], [-u, -v], [v, -u]][quarter];
        DVec3::new(x, y, 0.0) / (u * u + v * v).sqrt()
    }));
    let tet = |k| [0, 1, 2 + k, 2 + (k + 1) % tets].map(ParticleId::new);
    TetMesh {
        positions,
        tets: (0..tets).map(tet).collect(),
    }
}

/// Creates `tets` tets that share only particle 0.
///
/// The graph of tets with a common particle is complete, with `tets` colors needed and `tets - 1` neighbors each. The
/// particle 0 has `tets` tets, all others one. One piece by particles, `tets` pieces by faces. The common particle is
/// the origin, the opposite faces lie side by side in a plane above it, in squares of side 1 m.
///
/// # Example
/// ```
/// use incise_meshing::star;
///
/// let mesh = star(50);
/// mesh.check()?;
/// assert_eq!((mesh.tets.len(), mesh.positions.len()), (50, 151));
/// assert_eq!((mesh.pieces().count, mesh.face_pieces().count), (1, 50));
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
#[must_use]
pub fn star(tets: usize) -> TetMesh {
    let mut side = 1;
    while side * side < tets {
        side += 1;
    }
    let mut mesh = TetMesh {
        positions: vec![DVec3::ZERO],
        tets: Vec::with_capacity(tets),
    };
    let middle = 0.5 * side as f64;
    for k in 0..tets {
        // Half of each square, with a distance to its sides, so that no two faces touch.
        let [x, y] = [k % side, k / side].map(|c| c as f64 - middle);
        let corner = |u: f64, v: f64| dvec3(x + u, y + v, side as f64);
        let first = mesh.positions.len();
        let corners = [
            corner(0.125, 0.125),
            corner(0.875, 0.125),
            corner(0.125, 0.875),
        ];
        mesh.positions.extend(corners);
        mesh.tets
            .push([0, first, first + 1, first + 2].map(ParticleId::new));
    }
    mesh
}

/// Creates `count` separate copies of a mesh, each moved by `offset` (meters) from the previous one.
///
/// All counts are multiplied: particles, tets, pieces, edges of the graph of tets with a common particle. The largest
/// number of tets at a particle and the number of colors needed do not change. The first copy is not moved. Copies
/// overlap if the offset is too short.
///
/// # Panics
/// From 2³² particles on.
///
/// # Example
/// ```
/// use incise_meshing::{copies, fan};
/// use incise_mesh::glam::DVec3;
///
/// let mesh = copies(&fan(7), 3, 2.5 * DVec3::X);
/// mesh.check()?;
/// assert_eq!((mesh.tets.len(), mesh.pieces().count), (21, 3));
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
#[must_use]
pub fn copies(mesh: &TetMesh, count: usize, offset: DVec3) -> TetMesh {
    let mut all = TetMesh::default();
    for copy in 0..count {
        let (first, moved) = (all.positions.len(), copy as f64 * offset);
        all.positions
            .extend(mesh.positions.iter().map(|&p| p + moved));
        let tets = mesh
            .tets
            .iter()
            .map(|tet| tet.map(|p| ParticleId::new(p.index() + first)));
        all.tets.extend(tets);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use incise_mesh::kuhn_box;

    /// Number of particles by their number of tets, ascending.
    fn valences(mesh: &TetMesh) -> Vec<(usize, usize)> {
        let mut uses = vec![0_usize; mesh.positions.len()];
        for p in mesh.tets.iter().flatten() {
            uses[p.index()] += 1;
        }
        uses.sort_unstable();
        uses.chunk_by(|a, b| a == b)
            .map(|same| (same[0], same.len()))
            .collect()
    }

    #[test]
    fn fans_surround_their_edge() {
        for tets in [3, 4, 5, 8, 17, 100, 1001] {
            let mesh = fan(tets);
            mesh.check().expect("sound");
            assert_eq!(valences(&mesh), [(2, tets), (tets, 2)]);
            assert_eq!((mesh.pieces().count, mesh.face_pieces().count), (1, 1));
            let surface = mesh.surface();
            assert!(surface.is_manifold());
            assert_eq!(surface.euler_characteristic(), 2);
            assert_eq!(surface.triangles.len(), 2 * tets);
            for tet in &mesh.tets {
                assert_eq!(tet[..2], [ParticleId(0), ParticleId(1)]);
            }
        }
        // The octahedron: a square of area 2 m² and a height of 1 m.
        assert!((fan(4).total_volume() - 2.0 / 3.0).abs() < 1e-15);
    }

    #[test]
    #[should_panic(expected = "cannot surround an edge")]
    fn two_tets_are_no_fan() {
        let _ = fan(2);
    }

    #[test]
    fn stars_share_a_particle_alone() {
        for tets in [1, 2, 3, 9, 10, 500] {
            let mesh = star(tets);
            mesh.check().expect("sound");
            assert_eq!((mesh.pieces().count, mesh.face_pieces().count), (1, tets));
            let mut uses = valences(&mesh);
            if tets == 1 {
                assert_eq!(uses, [(1, 4)]);
            } else {
                assert_eq!(uses.pop(), Some((tets, 1)));
                assert_eq!(uses, [(1, 3 * tets)]);
            }
            // Cones over disjoint triangles in a plane are disjoint: no two triangles lie in one square.
            let half = (mesh.positions.last().map_or(0.0, |p| p.z) / 2.0).fract();
            let tops = mesh.tets.iter().map(|tet| mesh.positions[tet[1].index()]);
            let mut squares: Vec<_> = tops
                .map(|p| (p + half).floor().to_array().map(f64::to_bits))
                .collect();
            squares.sort_unstable();
            squares.dedup();
            assert_eq!(squares.len(), tets);
        }
        assert!(star(0).tets.is_empty());
    }

    #[test]
    fn copies_multiply_what_is_counted() {
        let mesh = kuhn_box([3, 3, 3], DVec3::ONE);
        let all = copies(&mesh, 5, 2.0 * DVec3::Y);
        all.check().expect("sound");
        assert_eq!((all.pieces().count, all.face_pieces().count), (5, 5));
        let expected: Vec<_> = valences(&mesh)
            .into_iter()
            .map(|(v, n)| (v, 5 * n))
            .collect();
        assert_eq!(valences(&all), expected);
        // An inner particle of the grid has all 24 tets, a clique.
        assert_eq!(all.quality().max_tets_at_particle, 24);
        assert!((all.total_volume() - 5.0).abs() < 1e-12);
        assert_eq!(copies(&mesh, 1, DVec3::X), mesh);
        assert!(copies(&mesh, 0, DVec3::X).tets.is_empty());
    }
}
