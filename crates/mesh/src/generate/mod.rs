//! Meshes from formulas: boxes on a grid, smooth solids filled by isosurface stuffing, irregular ones by Delaunay
//! tetrahedralization, and bodies with known answers.
//!
//! Only `+`, `-`, `*`, `/`, square root, minimum, maximum and absolute value are used, so that the same call gives the
//! same bits on every platform.

mod delaunay;
mod distance;
mod doubled;
mod fans;
mod grid;
mod irregular;
mod lattice;
mod neighbors;
mod random;
mod search;
mod shapes;
mod solids;
mod stencil;
mod stuffing;
mod tetrahedralize;

pub use delaunay::delaunay;
pub use fans::{copies, fan, star};
pub use grid::kuhn_box;
pub use irregular::irregular;
pub use lattice::Lattice;
pub use search::generate;
pub use shapes::Shape;
pub use stuffing::{stuff, stuff_graded};
pub use tetrahedralize::tetrahedralize;
