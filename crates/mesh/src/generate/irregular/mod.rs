//! Irregular bodies: Delaunay meshes of random points, whose particles have as unequal numbers of tets as in meshes of
//! other mesh generators.
//!
//! Lattice meshes have nearly equal numbers everywhere, which hides what makes coloring and clustering hard.

mod body;
mod carve;
mod improve;
mod sample;

use glam::DVec3;

use self::body::Body;
use self::carve::carve;
use self::improve::{improve, quality};
use self::sample::sample;
use super::Shape;
use super::delaunay::{delaunay, morton_keys};
use super::random::hash;
use crate::{MeshError, TetId, TetMesh};

/// The smallest sine of a dihedral angle, and half the smallest radius ratio times four: see [`irregular`].
const QUALITY: f64 = 0.2;
/// Passes over the bad tets; a dozen is the most that was seen to be used.
const PASSES: u64 = 40;
/// Meshes that are made before giving up; small ones hit their number by chance.
const ATTEMPTS: u64 = 400;
/// The largest number of tets that can be asked for.
const LARGEST: usize = 1_000_000;

/// A mesh of the shape with `tets` tets to within 2 %, as irregular as those of other mesh generators.
///
/// The mesh is sound ([`TetMesh::check`]), a single piece also by faces, with a manifold surface of the shape's topology.
/// All dihedral angles lie between 11.5 and 168.5 degrees, all radius ratios above 0.1. Particles come along a
/// space-filling curve, tets by their lowest particle. Another `seed` gives another mesh of the same kind. Deterministic
/// on all platforms.
///
/// # Errors
/// [`MeshError::TetCount`] for fewer than [`Shape::smallest_tet_count`] or more than a million tets.
///
/// # Example
/// ```
/// use incise_mesh::generate::{Shape, irregular};
///
/// let mesh = irregular(Shape::Torus, 2_000, 1)?;
/// assert!(mesh.tets.len().abs_diff(2_000) <= 40);
/// mesh.check()?;
/// assert!(mesh.quality().min_dihedral > 11.5);
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
pub fn irregular(shape: Shape, tets: usize, seed: u64) -> Result<TetMesh, MeshError> {
    let smallest = shape.smallest_tet_count();
    let out_of_range = MeshError::TetCount {
        shape: shape.name(),
        wanted: tets,
        smallest,
        largest: LARGEST,
    };
    if !(smallest..=LARGEST).contains(&tets) {
        return Err(out_of_range);
    }
    // Tets times the spacing cubed: nearly constant, less for coarse meshes, so that it is averaged over the attempts.
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

/// A mesh with about the given spacing; none when the carved surface is not that of the shape.
fn attempt_at(shape: Shape, spacing: f64, seed: u64) -> Result<Option<TetMesh>, MeshError> {
    let points = sample(shape, spacing, seed)?;
    let mut order: Vec<(u64, usize)> = morton_keys(&points).zip(0..).collect();
    order.sort_unstable();
    let points: Vec<DVec3> = order.into_iter().map(|(_, p)| points[p]).collect();
    let Some(mesh) = carve(delaunay(&points)?, shape, spacing) else {
        return Ok(None);
    };
    let mut body = Body::new(mesh);
    improve(&mut body, shape, spacing, QUALITY, PASSES);
    Ok(Some(body.into_mesh()))
}

/// Whether a mesh has the topology of the shape and the promised quality.
fn is_faithful(mesh: &TetMesh, shape: Shape) -> bool {
    let surface = mesh.surface();
    surface.euler_characteristic() == shape.euler_characteristic()
        && surface.is_manifold()
        && mesh.face_pieces().count == 1
        && (0..mesh.tets.len()).all(|t| quality(mesh.corners(TetId::new(t))) >= QUALITY)
}

/// The cube root of a positive number by Newton's method, the same on all platforms.
fn cube_root(x: f64) -> f64 {
    (0..64).fold(x.max(1.0), |root, _| {
        root - (root - x / (root * root)) / 3.0
    })
}
