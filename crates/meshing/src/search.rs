//! Search for the lattice that gives a shape the requested number of tets.
//!
//! The number of tets is close to 12 volume / spacing³, but jumps whenever a layer of lattice vertices enters or leaves
//! the shape, by several percent for flat sides and small meshes. The spacing is found by bisection accelerated with
//! that law. If a jump straddles the requested number, the search is repeated with a shifted lattice, finally also with
//! a rotated one, whose layers do not cross a flat side all at once. Shifts are a fixed low-discrepancy sequence.
//!
//! Cost: a few stuffings for curved shapes, some dozens for flat ones.

use glam::{DMat3, DQuat, DVec3, dvec3};
use incise_mesh::{TetId, TetMesh, outward_normals};

use crate::stuffing::{Grid, Slope};
use crate::{Lattice, MeshingError, Shape};

/// Largest number of tets.
const LARGEST: usize = 4_000_000;
/// Largest number of shifts of the aligned lattice, then of the rotated lattice.
const SHIFTS: [u32; 2] = [24, 200];
/// Largest number of spacings per shift.
const SPACINGS: usize = 14;
/// Cosines of the dihedral angles 164.8 and 10.7 degrees.
const DIHEDRAL_COSINES: [f64; 2] = [-0.965_016, 0.982_613];

/// Generates a mesh of the shape with `tets` tets to within 2 %.
///
/// The mesh is valid ([`TetMesh::check`]), has as many pieces as the shape, also by faces, a manifold surface of the
/// shape's topology and all dihedral angles between 10.7 and 164.8 degrees. Deterministic on all platforms, for any
/// number of threads.
///
/// With few tets, parts thinner than a tet, such as ears and limbs, are shortened or lost.
///
/// # Errors
/// [`MeshingError::TetCount`] for fewer than [`Shape::smallest_tet_count`] or more than four million tets.
///
/// # Example
/// ```
/// use incise_meshing::{Shape, generate};
///
/// let mesh = generate(Shape::Liver, 2_000)?;
/// assert!(mesh.tets.len().abs_diff(2_000) <= 40);
/// assert_eq!(mesh.face_pieces().count, 1);
/// # Ok::<(), incise_meshing::MeshingError>(())
/// ```
pub fn generate(shape: Shape, tets: usize) -> Result<TetMesh, MeshingError> {
    let smallest = shape.smallest_tet_count();
    if (smallest..=LARGEST).contains(&tets) {
        for (turn, shifts) in [DMat3::IDENTITY, turned()].into_iter().zip(SHIFTS) {
            if let Some(mesh) =
                (0..shifts).find_map(|n| search(shape, tets, turn, shift(n)).transpose())
            {
                return mesh;
            }
        }
    }
    Err(MeshingError::TetCount {
        shape: shape.name(),
        wanted: tets,
        smallest,
        largest: LARGEST,
    })
}

/// Fills the shape on a lattice with a given rotation and shift; `None` if the number of tets or the topology is not
/// met.
fn search(
    shape: Shape,
    tets: usize,
    turn: DMat3,
    shift: DVec3,
) -> Result<Option<TetMesh>, MeshingError> {
    // The rotated lattice covers the bounding box of the shape along its own axes.
    let half = turn.transpose().abs() * shape.half_extent();
    let wanted = Wanted {
        tets,
        volume: shape.volume(),
        levels: 0,
        smallest_step: 1e-4,
    };
    let distance = |p| shape.signed_distance(turn * p);
    let found = find_grid(half, shift, &wanted, &distance, &mut |_, _| {})?;
    let Search::Grid(grid, count) = found else {
        return Ok(None);
    };
    let mut mesh = grid.extract(count);
    drop(grid);
    for position in &mut mesh.positions {
        *position = turn * *position;
    }
    Ok(Some(mesh).filter(|mesh| is_faithful(mesh, shape)))
}

/// Target of the search.
pub(super) struct Wanted {
    pub(super) tets: usize,
    /// Volume of the region in m³.
    pub(super) volume: f64,
    /// Largest number of times inner cells are merged into larger ones.
    pub(super) levels: u32,
    /// Relative difference of two spacings between which a change of the number is taken for a jump.
    pub(super) smallest_step: f64,
}

/// Result of a search.
pub(super) enum Search {
    /// A lattice with its number of tets.
    Grid(Box<Grid>, usize),
    /// The number jumps over the wanted one: the nearest ones below and above that were found.
    Jump([usize; 2]),
}

/// Searches a spacing that gives the requested number of tets to within 2 %, in a box around the origin. The slope of
/// `distance` is at most one. `tried` gets each spacing with its number of tets.
pub(super) fn find_grid(
    half: DVec3,
    shift: DVec3,
    wanted: &Wanted,
    distance: &(impl Fn(DVec3) -> f64 + Sync),
    tried: &mut dyn FnMut(f64, usize),
) -> Result<Search, MeshingError> {
    let &Wanted {
        tets,
        volume,
        levels,
        smallest_step,
    } = wanted;
    let (mut fine, mut coarse) = (0.0, f64::INFINITY);
    let [mut below, mut above] = [0, usize::MAX];
    let mut spacing = cube_root(12.0 * volume / tets as f64);
    for _ in 0..SPACINGS {
        let lattice = Lattice::covering(-half, half, spacing, shift)?;
        let mut grid = Grid::new(&lattice, Slope::AtMostOne, distance)?;
        grid.coarsen(levels);
        let count = grid.tet_count();
        tried(spacing, count);
        if 50 * count.abs_diff(tets) <= tets {
            return Ok(Search::Grid(Box::new(grid), count));
        }
        if count > tets {
            fine = spacing;
            above = above.min(count);
        } else {
            coarse = spacing;
            below = below.max(count);
        }
        if coarse - fine < smallest_step * spacing {
            break;
        }
        let guess = spacing * cube_root(count.max(1) as f64 / tets as f64).clamp(0.7, 1.4);
        spacing = if fine < guess && guess < coarse {
            guess
        } else {
            0.5 * (fine + coarse)
        };
    }
    Ok(Search::Jump([below, above]))
}

/// True if a mesh has the topology of the shape, which a coarse lattice can change, and good angles.
fn is_faithful(mesh: &TetMesh, shape: Shape) -> bool {
    if !(0..mesh.tets.len()).all(|t| has_good_angles(mesh.corners(TetId::new(t)))) {
        return false;
    }
    let faces = mesh.faces();
    let surface = mesh.surface_from(&faces);
    surface.euler_characteristic() == shape.euler_characteristic()
        && surface.is_manifold()
        && mesh.face_pieces_from(&faces).count == shape.pieces()
}

/// True if the dihedral angles are within the bounds, tested by their cosines, which are equal on all platforms.
fn has_good_angles(corners: [DVec3; 4]) -> bool {
    let normals = outward_normals(corners).map(|n| n / n.length());
    let [low, high] = DIHEDRAL_COSINES;
    (0..4).all(|i| (0..i).all(|j| (low..=high).contains(&-normals[i].dot(normals[j]))))
}

/// Rotation that keeps the sides of a box away from all lattice directions.
pub(super) fn turned() -> DMat3 {
    DMat3::from_quat(DQuat::from_xyzw(1.0, 2.0, 3.0, 5.0).normalize())
}

/// Point of the additive sequence of Roberts (2018), which fills the unit cube evenly.
pub(super) fn shift(n: u32) -> DVec3 {
    let n = f64::from(n) + 0.5;
    (n * dvec3(
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_2,
        0.549_700_477_901_970_3,
    ))
    .fract()
}

/// Cube root of a positive number by Newton's method; the library function may differ between platforms.
pub(super) fn cube_root(x: f64) -> f64 {
    let mut root = x.max(1.0);
    for _ in 0..64 {
        root -= (root - x / (root * root)) / 3.0;
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_are_known_to_a_percent() {
        for shape in Shape::ALL {
            let half = shape.half_extent();
            let spacing = cube_root(12.0 * shape.volume() / 100_000.0);
            let lattice = Lattice::covering(-half, half, spacing, shift(0)).expect("fits");
            let mesh = Grid::new(&lattice, Slope::AtMostOne, &|p| shape.signed_distance(p))
                .map(|grid| grid.extract(grid.tet_count()))
                .expect("the box around the shape holds it");
            // One percent, plus the loss at beveled edges and flattened curves for this spacing.
            let volume = mesh.total_volume() / shape.volume();
            assert!((volume - 1.0).abs() < 0.015, "{shape}: {volume}");
        }
    }
}
