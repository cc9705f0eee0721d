//! Tests of the kernels against their CPU twins, and of transfers between host and device.
//!
//! They need an adapter; Mesa's lavapipe, which is a processor, will do. Without one they skip with a line on stderr,
//! unless `INCISE_REQUIRE_GPU` is set: then they fail.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

mod colliders;
mod coloring;
mod contacts;
mod device;
mod edits;
mod extremes;
mod flight;
mod handles;
mod jacobi;
mod measures;
mod replace;
mod scalars;
mod shaders;
mod sizes;
mod solver;
mod stages;
mod support;
mod tet_solve;
mod twin;
