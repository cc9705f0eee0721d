//! Behavior of the crate as seen from outside; one binary, so that the tests link once.

mod given;
mod irregular;
mod shapes;
mod sizes;
mod tetrahedralize;
