//! Meshes from formulas: boxes on a grid, and smooth solids filled by isosurface stuffing.
//!
//! Only `+`, `-`, `*`, `/`, square root, minimum, maximum and absolute value are used, so that the same call gives the
//! same bits on every platform.

mod distance;
mod doubled;
mod grid;
mod lattice;
mod neighbors;
mod search;
mod shapes;
mod solids;
mod stencil;
mod stuffing;
mod tetrahedralize;

pub use grid::kuhn_box;
pub use lattice::Lattice;
pub use search::generate;
pub use shapes::Shape;
pub use stuffing::{stuff, stuff_graded};
pub use tetrahedralize::tetrahedralize;
