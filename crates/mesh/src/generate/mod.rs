//! Meshes from formulas: boxes on a grid, smooth solids filled by isosurface stuffing, irregular ones by Delaunay
//! tetrahedralization, and bodies with known answers.
//!
//! Only `+`, `-`, `*`, `/`, square root, minimum, maximum and absolute value are used, so that the same call gives the
//! same bits on every platform.

mod delaunay;
mod distance;
mod fans;
mod grid;
mod irregular;
mod lattice;
mod random;
mod search;
mod shapes;
mod stencil;
mod stuffing;

pub use delaunay::delaunay;
pub use fans::{copies, fan, star};
pub use grid::kuhn_box;
pub use irregular::irregular;
pub use lattice::Lattice;
pub use search::generate;
pub use shapes::Shape;
pub use stuffing::stuff;
