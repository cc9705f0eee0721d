//! Generating a shape with a wanted number of tets.
//!
//! The number of tets is close to 12 volume / spacing³, but jumps whenever a layer of lattice vertices enters or leaves
//! the shape, by several percent for flat sides and small meshes. The spacing is searched by bisection sped up with that
//! law; when a jump straddles the wanted number, the lattice is shifted against the shape and the search repeated. Shifts
//! follow a low-discrepancy sequence, so that they are all different and the same for everyone.
//!
//! Cost: a few stuffings for curved shapes, some dozens for flat ones.

use glam::{DVec3, dvec3};

use super::{Lattice, Shape, stuff};
use crate::{MeshError, TetMesh};

/// The largest number of tets that can be asked for.
const LARGEST: usize = 1_000_000;
/// Shifts of the lattice that are tried.
const SHIFTS: u32 = 200;
/// Spacings that are tried with one shift.
const SPACINGS: usize = 14;

/// A mesh of the shape with `tets` tets to within 2 %.
///
/// The mesh is sound ([`TetMesh::check`]), a single piece also by faces, with a manifold surface of the shape's
/// topology. Deterministic on all platforms.
///
/// # Errors
/// [`MeshError::TetCount`] for fewer than [`Shape::smallest_tet_count`] or more than a million tets.
///
/// # Example
/// ```
/// use incise_mesh::generate::{Shape, generate};
///
/// let mesh = generate(Shape::Liver, 2_000)?;
/// assert!(mesh.tets.len().abs_diff(2_000) <= 40);
/// assert_eq!(mesh.face_pieces().count, 1);
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
pub fn generate(shape: Shape, tets: usize) -> Result<TetMesh, MeshError> {
    let refused = || MeshError::TetCount {
        shape: shape.name(),
        wanted: tets,
        smallest: shape.smallest_tet_count(),
        largest: LARGEST,
    };
    if !(shape.smallest_tet_count()..=LARGEST).contains(&tets) {
        return Err(refused());
    }
    let half = shape.half_extent();
    let start = cube_root(12.0 * shape.volume() / tets as f64);
    for shift in (0..SHIFTS).map(shift) {
        let (mut fine, mut coarse) = (0.0, f64::INFINITY);
        let mut spacing = start;
        for _ in 0..SPACINGS {
            let lattice = Lattice::covering(-half, half, spacing, shift)?;
            let mesh = stuff(&lattice, |p| shape.signed_distance(p))?;
            let count = mesh.tets.len();
            if 50 * count.abs_diff(tets) <= tets {
                if is_faithful(&mesh, shape) {
                    return Ok(mesh);
                }
                break;
            }
            *(if count > tets { &mut fine } else { &mut coarse }) = spacing;
            if coarse - fine < 1e-4 * spacing {
                break;
            }
            let guess = spacing * cube_root(count as f64 / tets as f64).clamp(0.7, 1.4);
            spacing = if fine < guess && guess < coarse {
                guess
            } else {
                0.5 * (fine + coarse)
            };
        }
    }
    Err(refused())
}

/// Whether a mesh has the topology of the shape: too coarse a lattice breaks thin parts or closes holes.
fn is_faithful(mesh: &TetMesh, shape: Shape) -> bool {
    let surface = mesh.surface();
    surface.euler_characteristic() == shape.euler_characteristic()
        && surface.is_manifold()
        && mesh.face_pieces().count == 1
}

/// The points of the additive sequence of Roberts (2018), which fills the unit cube evenly.
fn shift(n: u32) -> DVec3 {
    let n = f64::from(n) + 0.5;
    (n * dvec3(
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_2,
        0.549_700_477_901_970_3,
    ))
    .fract()
}

/// The cube root of a positive number by Newton's method, since the library function may differ between platforms.
fn cube_root(x: f64) -> f64 {
    let mut root = x.max(1.0);
    for _ in 0..64 {
        root -= (root - x / (root * root)) / 3.0;
    }
    root
}
