//! From a closed triangle surface to a body: isosurface stuffing of the inside of a [`Solid`].
//!
//! The surface itself is not kept: its inside is sampled on a lattice, whose spacing is found by bisection such that
//! the wanted number of tets comes out, and filled by the stencils of the module `stencil`. Edges and corners come out
//! beveled over about a spacing, and parts thinner than that are lost or torn: every point of the result lies within a
//! spacing of the surface, but not the other way around. A curved surface loses volume, as its chords lie inside.
//! Dihedral angles keep the bound of [`stuff`](crate::stuff) whatever the surface. Where the body would touch itself at
//! a single particle it is taken apart there; where it still touches itself along an edge, or falls into more pieces
//! than the surface has shells, another place of the lattice is tried.
//!
//! Cost: some three to ten stuffings, six times as many where thin parts tear, each two samples a cell of the box
//! around the surface at O(log n) for n triangles.

use glam::{DMat3, DVec3};
use incise_mesh::TetMesh;

use crate::search::{Wanted, cube_root, find_grid, shift, turned};
use crate::{MeshingError, Solid};

/// The distance that is told from far, in cube roots of the volume of a tet.
const REACH: f64 = 16.0;
/// Places of the lattice that are tried, along the axes and turned.
const SHIFTS: u32 = 6;
/// The fewest and most tets that can be asked for.
const TETS: std::ops::RangeInclusive<usize> = 100..=4_000_000;

/// Fills a solid with `tets` tets to within 2 %.
///
/// `levels` says how often cells far enough inside may be doubled: 0 makes all tets alike, and each level more takes
/// tets from the inside for finer ones at the surface, see [`stuff_graded`](crate::stuff_graded).
///
/// The mesh is sound ([`TetMesh::check`]) and its boundary a closed manifold. All dihedral angles lie between 9.3 and
/// 161.7 degrees, see [`stuff`](crate::stuff). Pieces and handles are those of the solid as far as the spacing
/// resolves them. The same bits come out on every platform.
///
/// # Errors
/// [`MeshingError::Surface`] if fewer than 100 or more than four million tets are asked for, or if no lattice was found
/// with which that many come out and the body does not touch itself: thin parts need more.
/// [`MeshingError::Lattice`] if the box around the solid has too many cells, as that of a thin long body across its
/// box.
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
        // Where thin parts tear, others may on a lattice that lies elsewhere; the first with the fewest pieces is kept.
        let mut torn: Option<(usize, TetMesh)> = None;
        for n in 0..SHIFTS {
            match search(solid, tets, levels, turn, shift(n))? {
                Found::Body(mesh) => {
                    let pieces = mesh.pieces().count;
                    if pieces <= solid.prepared().shells {
                        return Ok(mesh);
                    }
                    if torn.as_ref().is_none_or(|(fewest, _)| pieces < *fewest) {
                        torn = Some((pieces, mesh));
                    }
                }
                Found::TouchesItself => touching = true,
                Found::Nothing => {}
            }
        }
        if let Some((_, mesh)) = torn {
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
    Body(TetMesh),
    TouchesItself,
    Nothing,
}

/// Fills the solid on a lattice turned and shifted in a given way.
fn search(
    solid: &Solid,
    tets: usize,
    levels: u32,
    turn: DMat3,
    shift: DVec3,
) -> Result<Found, MeshingError> {
    let center = solid.low().midpoint(solid.high());
    // The box around the solid as seen along the axes of the lattice.
    let half = turn.transpose().abs() * (0.5 * (solid.high() - solid.low()));
    let place = |p: DVec3| center + turn * p;
    let wanted = Wanted {
        tets,
        volume: solid.volume(),
        levels,
    };
    // Knowing more of the distance saves samples, but takes longer to find out.
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
        Found::Body(mesh)
    } else {
        Found::TouchesItself
    })
}
