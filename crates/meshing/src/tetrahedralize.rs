//! Fills a closed triangle surface: isosurface stuffing of the inside of a [`Solid`].
//!
//! The surface triangles are not kept: the inside is sampled on a lattice and filled by the stencils of the module
//! `stencil`. Bisection finds the spacing for the requested number of tets. Edges and corners are beveled over about a
//! spacing, and thinner parts are lost or torn: every point of the result lies within a spacing of the surface, but not
//! vice versa. A curved surface loses volume, because its chords lie inside. Dihedral angles keep the bound of
//! [`stuff`](crate::stuff) for every surface. Where the body would touch itself at a single particle it is separated
//! there. If it still touches itself along an edge, or has more pieces than the surface has shells, another shift of
//! the lattice is tried.
//!
//! Cost: some three to ten stuffings, six times as many where thin parts tear, each with two samples per cell of the
//! bounding box at O(log n) for n triangles.

use glam::{DMat3, DVec3};
use incise_mesh::TetMesh;

use crate::search::{Wanted, cube_root, find_grid, shift, turned};
use crate::{MeshingError, Solid};

/// Distance up to which distances are computed exactly, in cube roots of the mean tet volume.
const REACH: f64 = 16.0;
/// Number of lattice shifts that are tried, aligned and rotated.
const SHIFTS: u32 = 6;
/// Range of the number of tets.
const TETS: std::ops::RangeInclusive<usize> = 100..=4_000_000;

/// Fills a solid with `tets` tets to within 2 %.
///
/// `levels` is the largest number of times that inner cells are merged into larger ones: 0 gives tets of one size;
/// each further level moves tets from the inside to a finer surface, see [`stuff_graded`](crate::stuff_graded).
///
/// The mesh is valid ([`TetMesh::check`]) and its boundary a closed manifold. All dihedral angles lie between 9.3 and
/// 161.7 degrees, see [`stuff`](crate::stuff). Pieces and handles match the solid where the spacing resolves them.
/// Bit-identical on every platform.
///
/// # Errors
/// [`MeshingError::Surface`] if fewer than 100 or more than four million tets are requested, or if no lattice gives
/// that number and a body that does not touch itself: thin parts need more tets. [`MeshingError::Lattice`] if the
/// bounding box of the solid has too many cells, as for a thin body along the diagonal of its box.
///
/// # Example
/// ```
/// use incise_meshing::{Shape, Solid, generate, tetrahedralize};
/// use incise_mesh::TriangleSurface;
///
/// let liver = generate(Shape::Liver, 3_000)?;
/// let surface = TriangleSurface { triangles: liver.surface().triangles, positions: liver.positions };
/// let solid = Solid::new(&surface)?;
/// let mesh = tetrahedralize(&solid, 8_000, 0)?;
/// assert!(mesh.tets.len().abs_diff(8_000) <= 160);
/// assert!(mesh.surface().is_manifold());
/// assert!((mesh.total_volume() / solid.volume() - 1.0).abs() < 0.02);
/// # Ok::<(), incise_meshing::MeshingError>(())
/// ```
pub fn tetrahedralize(solid: &Solid, tets: usize, levels: u32) -> Result<TetMesh, MeshingError> {
    if !TETS.contains(&tets) {
        return Err(MeshingError::Surface(format!(
            "{tets} tets were asked for, ask for {} to {}",
            TETS.start(),
            TETS.end()
        )));
    }
    let mut touching = false;
    for turn in [DMat3::IDENTITY, turned()] {
        // Thin parts tear on some lattice shifts and not on others; the first result with the fewest pieces is kept.
        let mut disconnected: Option<(usize, TetMesh)> = None;
        for n in 0..SHIFTS {
            match search(solid, tets, levels, turn, shift(n))? {
                Found::Mesh(mesh) => {
                    let pieces = mesh.pieces().count;
                    if pieces <= solid.prepared().shells {
                        return Ok(mesh);
                    }
                    if disconnected
                        .as_ref()
                        .is_none_or(|(fewest, _)| pieces < *fewest)
                    {
                        disconnected = Some((pieces, mesh));
                    }
                }
                Found::TouchesItself => touching = true,
                Found::Nothing => {}
            }
        }
        if let Some((_, mesh)) = disconnected {
            return Ok(mesh);
        }
    }
    Err(MeshingError::Surface(if touching {
        format!("with {tets} tets the body touches itself along edges, ask for more")
    } else {
        format!("no spacing gives {tets} tets to within 2 %, ask for another number")
    }))
}

enum Found {
    Mesh(TetMesh),
    TouchesItself,
    Nothing,
}

/// Fills the solid on a lattice with a given rotation and shift.
fn search(
    solid: &Solid,
    tets: usize,
    levels: u32,
    turn: DMat3,
    shift: DVec3,
) -> Result<Found, MeshingError> {
    let center = solid.low().midpoint(solid.high());
    // Bounding box of the solid along the axes of the lattice.
    let half = turn.transpose().abs() * (0.5 * (solid.high() - solid.low()));
    let place = |p: DVec3| center + turn * p;
    let wanted = Wanted {
        tets,
        volume: solid.volume(),
        levels,
    };
    // A larger reach saves samples, but makes each distance query slower.
    let reach = REACH * cube_root(solid.volume() / tets as f64);
    let distance = |p| solid.signed_distance_within(place(p), reach);
    let Some((grid, count)) = find_grid(half, shift, &wanted, &distance)? else {
        return Ok(Found::Nothing);
    };
    let mut mesh = grid.extract(count);
    drop(grid);
    mesh.positions.iter_mut().for_each(|p| *p = place(*p));
    mesh.split_pinches();
    Ok(if mesh.surface().is_manifold() {
        Found::Mesh(mesh)
    } else {
        Found::TouchesItself
    })
}
