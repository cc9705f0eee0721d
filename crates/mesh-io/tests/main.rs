//! Behavior of the crate as seen from outside; one binary, so that the tests link once.

mod formats;
mod given;
mod gltf;
mod memory;
mod meshio;
mod round_trips;
