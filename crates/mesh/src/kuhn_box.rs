//! A box of cubical cells, each cut into six tets: exact geometry for physics tests.
//!
//! Every cell is split along the same main diagonal into one tet for each order in which the three axes can be walked
//! from its low to its high corner, so neighboring cells agree on the diagonals of their common faces. Linear in the
//! number of cells.
//!
//! Source: H. W. Kuhn, "Some combinatorial lemmas in topology", 1960.

use glam::DVec3;

use crate::{ParticleId, TetMesh};

/// The orders of the axes; two corners of the odd ones are swapped to get positive tets.
const WALKS: [([usize; 3], bool); 6] = [
    ([0, 1, 2], true),
    ([0, 2, 1], false),
    ([1, 0, 2], false),
    ([1, 2, 0], true),
    ([2, 0, 1], true),
    ([2, 1, 0], false),
];

/// The axis-aligned box from the origin to `size` (meters) with `cells` cells along each axis, six tets per cell.
///
/// Particles are numbered along x first, then y, then z; so are cells. The particle `(i, j, k)` has the index `i +
/// (cells[0] + 1) * (j + (cells[1] + 1) * k)`, and particles on the far sides have exactly the coordinates of `size`.
/// Without cells the mesh has no tets.
///
/// # Panics
/// If there are more than 2³² particles.
///
/// # Example
/// ```
/// use incise_mesh::{glam::dvec3, kuhn_box};
///
/// let mesh = kuhn_box([4, 2, 1], dvec3(2.0, 1.0, 0.5));
/// assert_eq!(mesh.positions.len(), 5 * 3 * 2);
/// assert_eq!(mesh.tets.len(), 6 * 4 * 2 * 1);
/// assert!((mesh.total_volume() - 1.0).abs() < 1e-12);
/// ```
#[must_use]
pub fn kuhn_box(cells: [usize; 3], size: DVec3) -> TetMesh {
    let [nx, ny, nz] = cells;
    let strides = [1, nx + 1, (nx + 1) * (ny + 1)];
    let mut mesh = TetMesh::default();
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                // Multiplying before dividing puts the far sides exactly on `size`.
                let coordinate =
                    |axis: usize, n: usize| size[axis] * (n as f64) / (cells[axis].max(1) as f64);
                mesh.positions.push(DVec3::new(
                    coordinate(0, i),
                    coordinate(1, j),
                    coordinate(2, k),
                ));
            }
        }
    }
    mesh.tets.reserve(6 * nx * ny * nz);
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let low = i + strides[1] * j + strides[2] * k;
                for (walk, even) in WALKS {
                    let a = low + strides[walk[0]];
                    let b = a + strides[walk[1]];
                    let c = b + strides[walk[2]];
                    let tet = if even { [low, a, b, c] } else { [low, b, a, c] };
                    mesh.tets.push(tet.map(ParticleId::new));
                }
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    #[test]
    fn boxes_are_exact_sound_and_closed() {
        for (cells, size) in [
            ([1, 1, 1], DVec3::ONE),
            ([3, 4, 5], dvec3(0.3, 0.7, 1.1)),
            ([7, 1, 2], dvec3(10.0, 0.1, 3.0)),
        ] {
            let mesh = kuhn_box(cells, size);
            mesh.check().expect("the box is sound");
            let surface = mesh.surface();
            assert!(surface.is_manifold());
            assert_eq!(surface.euler_characteristic(), 2);
            let volume = size.x * size.y * size.z;
            assert!((mesh.total_volume() / volume - 1.0).abs() < 1e-13);
            assert!((surface.volume(&mesh.positions) / volume - 1.0).abs() < 1e-13);
            assert_eq!(mesh.positions.last(), Some(&size));
        }
    }

    #[test]
    fn no_cells_no_tets() {
        assert!(kuhn_box([0, 3, 3], DVec3::ONE).tets.is_empty());
    }
}
