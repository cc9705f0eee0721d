//! Behavior of the crate as seen from outside; one binary, so that the tests link once.

mod faults;
mod formats;
mod given;
mod gltf;
mod irregular;
mod memory;
mod meshio;
mod round_trips;
mod shapes;
mod sizes;
mod tetrahedralize;
