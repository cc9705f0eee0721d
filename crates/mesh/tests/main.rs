//! Behavior of the crate as seen from outside; one binary, so that the tests link once.

mod faults;
mod formats;
mod given;
mod gltf;
mod medit;
mod memory;
mod meshio;
mod msh;
mod round_trips;
mod shapes;
