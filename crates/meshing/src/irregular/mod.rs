//! Irregular bodies: Delaunay meshes of random points, with as varied numbers of tets per particle as meshes of other
//! generators.
//!
//! Lattice meshes have nearly constant numbers (24 in stuffed ones), which hides the hard cases of coloring and
//! clustering. Here random points on the surface and inside a solid (module `sample`) are connected ([`delaunay`]), the
//! tets inside are kept (`interior`), and slivers are removed by local changes (`improve`). Further attempts with other
//! spacings and points bring the number of tets into its range.
//!
//! Measured with seed 1 by the tests `as_irregular_as_other_meshes` and, for the last rows, the ignored
//! `large_and_as_irregular_as_other_meshes`. For comparison, TetGen's meshes of a ball with 6,846, 27,755 and
//! 118,411 tets have at most 42 to 44 tets at a particle, a mean degree of 65.3, 69.7 and 73.2, and smallest dihedral
//! angles of 8 degrees. The degree of a tet is the number of tets it shares a particle with.
//!
//! | shape | tets | tets at a particle: mean, most | degree: mean, most | dihedral angles | radius ratio |
//! |---|---|---|---|---|---|
//! | sphere | 4,973 | 19.8, 40 | 67.0, 100 | 14.5 to 157.7 | 0.142 |
//! | liver | 4,945 | 19.1, 42 | 65.8, 111 | 14.5 to 161.0 | 0.127 |
//! | torus | 4,922 | 17.9, 44 | 64.3, 109 | 14.5 to 162.3 | 0.127 |
//! | sphere | 27,986 | 22.1, 44 | 71.7, 111 | 14.5 to 159.1 | 0.129 |
//! | liver | 27,955 | 21.6, 42 | 71.0, 110 | 14.5 to 161.5 | 0.128 |
//! | torus | 27,953 | 20.8, 44 | 69.8, 111 | 14.5 to 161.8 | 0.126 |
//! | sphere | 119,584 | 23.3, 48 | 74.1, 112 | 14.5 to 160.6 | 0.130 |
//! | liver | 119,881 | 23.0, 50 | 73.8, 118 | 14.5 to 161.3 | 0.125 |
//! | torus | 119,531 | 22.5, 48 | 72.9, 118 | 14.5 to 160.7 | 0.125 |
//!
//! Cost: linear in the number of tets, times the logarithm of sorting; usually two attempts.

mod adjacency_mesh;
mod improve;
mod interior;
mod sample;

use glam::DVec3;
use incise_mesh::{TetId, TetMesh};

use self::adjacency_mesh::AdjacencyMesh;
use self::improve::{improve, quality};
use self::interior::keep_interior;
use self::sample::sample;
use crate::delaunay::{delaunay, morton_keys};
use crate::random::hash;
use crate::search::cube_root;
use crate::{MeshingError, Shape};

/// Lower bound of the sines of dihedral angles (14.47 degrees) and of twice the radius ratio.
const QUALITY: f64 = 0.25;
/// Passes over the bad tets before an attempt fails.
const PASSES: u64 = 40;
/// Attempts before an error; small meshes need several to hit their number.
const ATTEMPTS: u64 = 400;
/// Largest number of tets.
const LARGEST: usize = 1_000_000;

/// Creates an irregular mesh of the shape with `tets` tets to within 2 %.
///
/// The mesh is valid ([`TetMesh::check`]), a single piece also by faces, with a manifold surface of the shape's
/// topology. All dihedral angles lie between 14.4 and 165.6 degrees, all radius ratios above 0.124. Particles are
/// ordered along a space-filling curve, tets by their lowest particle. Sharp edges and corners of the shape get
/// particles of their own, but may be beveled where slivers were dropped. Another `seed` gives another mesh of this
/// kind. Deterministic on all platforms.
///
/// # Errors
/// [`MeshingError::TetCount`] for fewer than [`Shape::smallest_tet_count`] or more than a million tets, or if no
/// attempt meets all guarantees above.
///
/// # Example
/// ```
/// use incise_meshing::{Shape, irregular};
///
/// let mesh = irregular(Shape::Torus, 2_000, 1)?;
/// assert!(mesh.tets.len().abs_diff(2_000) <= 40);
/// mesh.check()?;
/// assert!(mesh.quality().min_dihedral > 14.4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn irregular(shape: Shape, tets: usize, seed: u64) -> Result<TetMesh, MeshingError> {
    let smallest = shape.smallest_tet_count();
    let out_of_range = MeshingError::TetCount {
        shape: shape.name(),
        wanted: tets,
        smallest,
        largest: LARGEST,
    };
    if !(smallest..=LARGEST).contains(&tets) {
        return Err(out_of_range);
    }
    // Tets times the cube of the spacing: nearly constant, smaller for coarse meshes, so it is averaged over the
    // attempts.
    let mut room = 11.0 * shape.volume();
    for attempt in 0..ATTEMPTS {
        let spacing = cube_root(room / tets as f64);
        let Some(mesh) = attempt_at(shape, spacing, hash(seed, attempt))? else {
            continue;
        };
        let count = mesh.tets.len();
        if 50 * count.abs_diff(tets) <= tets && is_faithful(&mesh, shape) {
            return Ok(mesh);
        }
        let found = count as f64 * spacing * spacing * spacing;
        let weight = if attempt < 2 { 1.0 } else { 0.3 };
        room += weight * (found - room);
    }
    Err(out_of_range)
}

/// Makes a mesh with about the given spacing; `None` if the surface does not have the topology of the shape.
fn attempt_at(shape: Shape, spacing: f64, seed: u64) -> Result<Option<TetMesh>, MeshingError> {
    let points = sample(shape, spacing, seed)?;
    let mut order: Vec<(u64, usize)> = morton_keys(&points).zip(0..).collect();
    order.sort_unstable();
    let points: Vec<DVec3> = order.into_iter().map(|(_, p)| points[p]).collect();
    let Some(mesh) = keep_interior(delaunay(&points)?, shape, spacing) else {
        return Ok(None);
    };
    let mut mesh = AdjacencyMesh::new(mesh);
    improve(&mut mesh, shape, spacing, QUALITY, PASSES);
    Ok(Some(mesh.into_mesh()))
}

/// True if a mesh has the topology of the shape and the guaranteed quality.
fn is_faithful(mesh: &TetMesh, shape: Shape) -> bool {
    let surface = mesh.surface();
    surface.euler_characteristic() == shape.euler_characteristic()
        && surface.is_manifold()
        && mesh.face_pieces().count == shape.pieces()
        && (0..mesh.tets.len()).all(|t| quality(mesh.corners(TetId::new(t))) >= QUALITY)
}
