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
//! The mean thickness of a body is 2 V / A for its volume V and surface area A; for a plate it is the thickness. Two
//! layers of lattice vertices lie inside a plate of any direction if it is about a spacing thick. Coarser lattices tear
//! it or give nothing, which is an error with the number of tets that is needed, in the clear cases before any search.
//!
//! Cost: some three to ten stuffings, six times as many where thin parts tear, each with two samples per cell of the
//! bounding box at O(log n) for n triangles.

use glam::{DMat3, DVec3};
use incise_mesh::TetMesh;

use crate::search::{Search, Wanted, cube_root, find_grid, shift, turned};
use crate::{MeshingError, Solid};

/// Distance up to which distances are computed exactly, in cube roots of the mean tet volume.
const REACH: f64 = 16.0;
/// Number of lattice shifts that are tried, aligned and rotated.
const SHIFTS: u32 = 6;
/// Number of misses after which a body that is thin for its tets gets no further shift: they change little there.
const MISSES_IF_THIN: u32 = 2;
/// Range of the number of tets.
const TETS: std::ops::RangeInclusive<usize> = 100..=4_000_000;
/// Largest spacing in mean thicknesses.
const COARSEST: f64 = 2.0;
/// Spacing in mean thicknesses from which a body is thin for its tets.
const THIN: f64 = 0.5;
/// Spacing in mean thicknesses that a refusal recommends.
const RECOMMENDED: f64 = 0.75;
/// Part of the volume below which a torn body is refused.
const SMALLEST_PART: f64 = 0.8;

/// A lattice that was tried by [`tetrahedralize_with`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Attempt {
    /// Number of the lattice, from 0.
    pub lattice: u32,
    /// Largest number of lattices.
    pub lattices: u32,
    /// Spacing of the lattice in meters.
    pub spacing: f64,
    /// Number of tets that it gives.
    pub tets: usize,
}

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
/// [`MeshingError::Surface`] if fewer than 100 or more than four million tets are requested; if the tets would be more
/// than twice as large as the body is thick, which names the number that is needed; or if no lattice gives that number
/// and a body that does not touch itself. [`MeshingError::Lattice`] if the bounding box of the solid has too many cells,
/// as for a thin body along the diagonal of its box.
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
    tetrahedralize_with(solid, tets, levels, &mut |_| {})
}

/// Fills a solid like [`tetrahedralize`] and calls `tried` after each lattice, for a progress bar.
///
/// # Errors
/// The errors of [`tetrahedralize`].
///
/// # Example
/// ```
/// use incise_mesh::{TriangleSurface, glam::DVec3, kuhn_box};
/// use incise_meshing::{Solid, tetrahedralize_with};
///
/// let cube = TriangleSurface::boundary_of(&kuhn_box([1, 1, 1], DVec3::ONE));
/// let mut last = 0;
/// let mesh = tetrahedralize_with(&Solid::new(&cube)?, 500, 0, &mut |attempt| last = attempt.tets)?;
/// assert_eq!(mesh.tets.len(), last);
/// # Ok::<(), incise_meshing::MeshingError>(())
/// ```
pub fn tetrahedralize_with(
    solid: &Solid,
    tets: usize,
    levels: u32,
    tried: &mut dyn FnMut(&Attempt),
) -> Result<TetMesh, MeshingError> {
    if !TETS.contains(&tets) {
        return Err(MeshingError::Surface(format!(
            "{tets} tets were asked for, ask for {} to {}",
            TETS.start(),
            TETS.end()
        )));
    }
    let thickness = 2.0 * solid.volume() / solid.area();
    let spacing = cube_root(12.0 * solid.volume() / tets as f64);
    let needed = rounded_up(12.0 * solid.volume() / (RECOMMENDED * thickness).powi(3));
    let refuse = |why: String, otherwise: String| {
        let advice = match needed > tets {
            true => format!("ask for {needed} tets or more"),
            false => otherwise,
        };
        Err(MeshingError::Surface(format!(
            "the body is about {thickness:.2e} m thick, and {why}: {advice}"
        )))
    };
    let more = || format!("ask for {} or more", rounded_up(1.5 * tets as f64));
    if spacing > COARSEST * thickness {
        return refuse(
            format!("{tets} tets would be {spacing:.2e} m large"),
            more(),
        );
    }
    let is_thin = spacing > THIN * thickness;
    let (mut touching, mut jump) = (false, None);
    for (turn, first) in [(DMat3::IDENTITY, 0), (turned(), SHIFTS)] {
        // Thin parts tear on some lattice shifts and not on others; the first result with the fewest pieces is kept.
        let mut disconnected: Option<(usize, TetMesh)> = None;
        let mut misses = 0;
        for n in 0..SHIFTS {
            if is_thin && misses == MISSES_IF_THIN {
                break;
            }
            let mut tried = |spacing, tets| {
                tried(&Attempt {
                    lattice: first + n,
                    lattices: 2 * SHIFTS,
                    spacing,
                    tets,
                });
            };
            match search(solid, tets, levels, turn, shift(n), &mut tried)? {
                Found::Mesh(mesh) => {
                    let pieces = mesh.pieces().count;
                    if pieces <= solid.prepared().shells {
                        return Ok(mesh);
                    }
                    if mesh.total_volume() < SMALLEST_PART * solid.volume() {
                        misses += 1;
                    }
                    if disconnected
                        .as_ref()
                        .is_none_or(|(fewest, _)| pieces < *fewest)
                    {
                        disconnected = Some((pieces, mesh));
                    }
                }
                Found::TouchesItself => touching = true,
                Found::Jump(numbers) => {
                    jump = jump.or(Some(numbers));
                    misses += 1;
                }
            }
        }
        if let Some((pieces, mesh)) = disconnected {
            if mesh.total_volume() < SMALLEST_PART * solid.volume() {
                return refuse(
                    format!("with {tets} tets it is torn into {pieces} pieces"),
                    more(),
                );
            }
            return Ok(mesh);
        }
    }
    if touching {
        return refuse(
            format!("with {tets} tets it touches itself along edges"),
            more(),
        );
    }
    // No number above is known if none was reached by the spacings that were tried.
    let (nearest, otherwise) = match jump {
        Some([below, above]) if TETS.contains(&above) => (
            format!(" (nearest numbers: {below} and {above})"),
            format!("ask for {above}"),
        ),
        _ => (String::new(), more()),
    };
    refuse(
        format!("no lattice gives {tets} tets to within 2 %{nearest}"),
        otherwise,
    )
}

/// A number of tets, rounded up to two digits and within the range.
fn rounded_up(tets: f64) -> usize {
    let mut unit = 1.0;
    while tets / unit > 100.0 {
        unit *= 10.0;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive, and too large numbers saturate"
    )]
    let rounded = ((tets / unit).ceil() * unit) as usize;
    rounded.clamp(*TETS.start(), *TETS.end())
}

enum Found {
    Mesh(TetMesh),
    TouchesItself,
    /// The nearest numbers of tets below and above.
    Jump([usize; 2]),
}

/// Fills the solid on a lattice with a given rotation and shift.
fn search(
    solid: &Solid,
    tets: usize,
    levels: u32,
    turn: DMat3,
    shift: DVec3,
    tried: &mut dyn FnMut(f64, usize),
) -> Result<Found, MeshingError> {
    let center = solid.low().midpoint(solid.high());
    // Bounding box of the solid along the axes of the lattice.
    let half = turn.transpose().abs() * (0.5 * (solid.high() - solid.low()));
    let place = |p: DVec3| center + turn * p;
    let wanted = Wanted {
        tets,
        volume: solid.volume(),
        levels,
        smallest_step: 1e-3,
    };
    // A larger reach saves samples, but makes each distance query slower.
    let reach = REACH * cube_root(solid.volume() / tets as f64);
    let distance = |p| solid.signed_distance_within(place(p), reach);
    let (grid, count) = match find_grid(half, shift, &wanted, &distance, tried)? {
        Search::Grid(grid, count) => (grid, count),
        Search::Jump(numbers) => return Ok(Found::Jump(numbers)),
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
